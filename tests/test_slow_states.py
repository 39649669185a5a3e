"""Errors of parameters in noise that is not the model's, and the slopes of the noise likelihood."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.spatial.transform import Rotation

from diagnosis_samples import LATENCY
from fitted_data import data_from
from syncline_design.diagnosis import DiagnosisSettings, diagnose
from syncline_design.diagnosis.candidates import candidates, signatures, zero_values
from syncline_design.diagnosis.fitting import Data, finely, fit
from syncline_design.diagnosis.judged import Judged
from syncline_design.diagnosis.noise import as_specified, first_guess, precision, spec_bounds
from syncline_design.diagnosis.noise_fit import Packing, mean_share, mean_share_slope
from syncline_design.diagnosis.result import Finding
from syncline_design.diagnosis.run import outcome
from syncline_design.diagnosis.settling import valued
from syncline_design.diagnosis.slow_states import slow_states
from syncline_design.diagnosis.sufficient import sufficient
from syncline_design.machine.linear_algebra import one_thread
from tests.world import Noise, WorldLog, hidden, make_log, scenario
from tests.world.foreign import KINDS, WHITE, foreign

LATE = hidden("latency", "position", latency_s=0.02)
ARM = hidden("lever_arm", "position", x_m=0.05, y_m=-0.03, z_m=0.02)


@pytest.fixture(autouse=True)
def _one_thread() -> Iterator[None]:
    """The matrices are small, as for `diagnose`."""
    with one_thread():
        yield


@pytest.mark.parametrize("time_constant_s", [0.02, 3.0, 40.0, 2e6])
def test_the_mean_of_slow_noise_is_its_double_integral(time_constant_s: float) -> None:
    """Var of the mean over a span L: (2 / L^2) int (L - u) exp(-u / T) du, by quadrature."""
    span = 30.0

    def integrated(constant: float) -> float:
        ends = [0.0, *(span * k for k in (0.001, 0.01, 0.1, 1.0))]
        parts = [
            quad(lambda u: (span - u) * np.exp(-u / constant), a, b)[0] for a, b in pairwise(ends)
        ]
        return 2.0 * float(np.sum(parts)) / span**2

    assert mean_share(time_constant_s, span) == pytest.approx(integrated(time_constant_s), rel=1e-6)
    apart = 1e-3
    higher, lower = (integrated(time_constant_s * np.exp(h)) for h in (apart, -apart))
    slope = (np.log(higher) - np.log(lower)) / (2.0 * apart)
    assert mean_share_slope(time_constant_s, span) == pytest.approx(slope, rel=1e-4, abs=1e-7)


def test_what_an_effect_can_make_is_no_slow_noise(tmp_path: Path) -> None:
    """A drift of the yaw leaves all sizes as they are where it may be one, and not otherwise."""
    data = data_from(make_log(scenario("car_stops", 3, 60.0, 5.0)), tmp_path)
    found = [s for s in signatures(data.view, candidates(data.view)) if s.plain]
    drift = next(s.columns for s in found if s.candidate.label[0] == "heading_drift")
    free = replace(data, explained=np.concatenate([s.columns for s in found], axis=2))
    level, error = as_specified(data.structure), data.error(())
    turned = error + 5e-5 * drift[:, :, 0]

    def largest_change(one: Data) -> float:
        sizes, other = (slow_states(one).sizes(level, e) for e in (error, turned))
        return max(abs(np.log(other[c] / sizes[c])) for c in sizes)

    assert largest_change(free) < 0.2
    assert largest_change(data) > 2.0


def test_what_a_log_is_too_short_to_show_is_in_its_statistics(tmp_path: Path) -> None:
    """40 s of a receiver that wanders by 0.77 of its sigma over 15 s: each effect alone is within 3
    standard uncertainties in 19 of 20 cases (10 of 11 without what such logs do not show)."""
    wander = Noise(wander_share=0.6, wander_time_s=15.0)
    found = []
    for seed, platform in enumerate(("multirotor_lines", "car_stops", "vessel_figure_eights") * 2):
        log = make_log(scenario(platform, 3000 + seed, 40.0, 5.0), (), wander)
        data = data_from(log, tmp_path)
        kept = sufficient(data, fit(finely(data)), slow_states(data))
        seen = np.diag(kept.normal) > 0.0
        found += list(kept.score[seen] / np.sqrt(np.diag(kept.normal)[seen]))
    assert len(found) > 200
    assert np.mean(np.abs(found) > 3.0) < 0.05
    assert np.sqrt(np.mean(np.square(found))) < 1.4


def test_an_axis_that_effects_take_up_wanders_as_its_kin(tmp_path: Path) -> None:
    """North is all in what effects could make; east and down wander by 0.6 sigma at k = 1."""
    data = data_from(make_log(scenario("car_stops", 3, 60.0, 5.0)), tmp_path)
    states, rng = slow_states(data), np.random.default_rng(8)
    place = [c for c, (sensor, _) in enumerate(states.roles) if sensor[1] == "position"]
    own = np.isin(states.channel, place) & (states.wave > 0)
    drawn = 0.6 * rng.standard_normal(int(own.sum())) / np.sqrt(states.wave[own])
    error = data.error(()) + states.courses[:, :, own] @ drawn
    north = states.courses[:, :, states.channel == place[0]]
    level = as_specified(data.structure)
    alone = slow_states(data).sizes(level, error)
    beside = slow_states(replace(data, explained=north)).sizes(level, error)
    kin = [alone[states.roles[c]] for c in place[1:]]
    assert min(kin) > 0.05
    assert beside[states.roles[place[0]]] == pytest.approx(float(np.mean(kin)), rel=0.35)


def test_an_axis_that_wanders_alone_does_not_make_its_kin_wander(tmp_path: Path) -> None:
    """North wanders by a whole sigma: east and down tell by themselves that they do not."""
    data = data_from(make_log(scenario("car_stops", 3, 60.0, 5.0)), tmp_path)
    found = [s for s in signatures(data.view, candidates(data.view)) if s.plain]
    late = next(s.columns for s in found if s.candidate.label[:2] == ("latency", "position"))
    states = slow_states(replace(data, explained=late))
    place = [c for c, (sensor, _) in enumerate(states.roles) if sensor[1] == "position"]
    own = (states.channel == place[0]) & (states.wave > 0)
    error = data.error(()) + states.courses[:, :, own] @ (1.0 / np.sqrt(states.wave[own]))
    sizes = states.sizes(as_specified(data.structure), error)
    north, east, down = (sizes[states.roles[c]] for c in place)
    assert north > 0.5
    assert max(east, down) < 0.05


@pytest.mark.parametrize("shared", [False, True])
def test_slopes_of_the_noise_are_those_of_differences(shared: bool, tmp_path: Path) -> None:
    data = data_from(make_log(scenario("car_stops", 3, 30.0, 5.0)), tmp_path)
    structure, error = data.structure, data.error(())
    if shared:  # every second row is of the stamp before
        time_s = structure.time_s.copy()
        time_s[1::2] = time_s[0::2]
        structure = replace(structure, time_s=time_s)
        tight = tuple(replace(s, means=(1e-3, 2e-3, 1e9)) for s in structure.slow)
        structure = replace(structure, slow=tight)
    sizes = tuple(range(len(structure.directed)))[:2]
    bounds = replace(spec_bounds(structure), factor=(9.0,) * len(structure.white))
    packing = Packing(structure, bounds, sizes)
    guess = first_guess(structure)
    level = replace(
        guess,
        factor=(1.3, *guess.factor[1:]),
        time_constant_s=tuple((3.0 + k,) * 3 for k in range(len(structure.slow))),
        size=tuple(0.003 if k in sizes else 0.0 for k in range(len(structure.directed))),
    )

    def cost(vector: np.ndarray) -> float:
        now = packing.unpack(vector)
        found = precision(structure, now).negative_log_likelihood(error)
        return found + packing.prior(now)

    vector = packing.pack(level)
    level = packing.unpack(vector)
    exact = packing.slopes(level, packing.slopes_at(level, precision(structure, level), error))
    step = 1e-5 * np.eye(vector.size)
    rough = [(cost(vector + h) - cost(vector - h)) / 2e-5 for h in step]
    assert exact == pytest.approx(rough, rel=1e-5, abs=1e-5)


def test_the_jackknife_is_that_of_fits_without_a_block(tmp_path: Path) -> None:
    """Delete a block by hand: the same rows less one stretch, weights and slow courses kept.

    With noise of exactly the model's kind the weights hardly change, so a tenth is allowed.
    """
    log = make_log(scenario("multirotor_lines", 5, 60.0, 5.0), (LATE,))
    data = data_from(log, tmp_path)
    late = next(c for c in candidates(data.view) if c.label[:2] == ("latency", "position"))
    acting = [late.acting({"latency_s": 0.0})]
    model = fit(data, acting, start=as_specified(data.structure))
    states = slow_states(data)
    column = log_velocity(log)
    [found] = states.own(model)
    whole, white = data.error(()), data.structure
    covariance = sum(
        factor**2 * part.covariance
        for part, factor in zip(white.white, model.level.factor, strict=True)
    )
    lower = np.linalg.cholesky(covariance)
    scaled, error = np.linalg.solve(lower, column), np.linalg.solve(lower, whole[:, :, None])
    values = []
    for k in range(states.count):
        kept = states.block != k
        x, y = scaled[kept].ravel(), error[kept].ravel()
        values.append(float(x @ y / (x @ x)))
    own = np.sqrt((states.count - 1) / states.count * np.sum((values - np.mean(values)) ** 2))
    [(covariance, count)] = found.jackknives
    assert count == states.count
    assert float(np.sqrt(covariance[0, 0])) == pytest.approx(own, rel=0.3)


def log_velocity(log: WorldLog) -> np.ndarray:
    names = [f"velocity_{axis}_mps" for axis in ("north", "east", "down")]
    return -np.column_stack([log.columns[name] for name in names])[:, :, None]


def test_intervals_cover_in_foreign_noise(tmp_path: Path) -> None:
    """8 kinds of noise, 4 values each, told which effects: 95 % is stated, 90 % promised.

    At 90 % and with values of a log taken for one (8 draws), fewer than 6 kinds with all but one
    value inside come in 0.5 % of choices of seeds.
    """
    good = 0
    for seed, kind in enumerate(sorted(KINDS)[:8]):
        log = foreign(
            make_log(scenario("car_stops", 70 + seed, 60.0, 5.0), (LATE, ARM), WHITE), kind
        )
        data = data_from(log, tmp_path)
        chosen = {c.label[:2]: c for c in candidates(data.view)}
        acting = [
            chosen["latency", "position"].acting({"latency_s": 0.0}),
            chosen["lever_arm", "position"].acting({"x_m": 0.0, "y_m": 0.0, "z_m": 0.0}),
        ]
        model = fit(data, acting, start=as_specified(data.structure))
        truth = [[0.02], [0.05, -0.03, 0.02]]
        inside = [
            abs(value - true) <= one.coverage * spread
            for one, own in zip(slow_states(data).own(model), truth, strict=True)
            for value, spread, true in zip(one.values, one.spread, own, strict=True)
        ]
        good += sum(inside) >= 3
    assert good >= 6


def test_what_effects_took_of_slow_noise_is_in_their_intervals(tmp_path: Path) -> None:
    """A minute of sensors whose noise is nearly all slow, five effects fitted that are not there:
    beyond two uncertainties in one of ten values (one of seven, were courses as small as what is
    left of them)."""
    five = (("mounting", "attitude"), ("lever_arm", "position"), ("heading_drift", "attitude"),
            ("range_bias", "ranging"), ("latency", "position"))  # fmt: skip
    wander, off = Noise(wander_share=0.9, wander_time_s=15.0), []
    for seed in range(16):
        log = make_log(scenario("car_stops", 4000 + seed, 60.0, 5.0), (), wander)
        data = data_from(log, tmp_path)
        chosen = {c.label[:2]: c for c in candidates(data.view)}
        model = fit(data, [chosen[e].acting(zero_values(chosen[e].effect)) for e in five])
        _, own = valued(data, model, slow_states(data))
        off += [abs(z) for one in own for z in one.values / one.spread]
    assert np.mean(np.array(off) > 2.0) < 0.11


def test_a_constant_within_slow_noise_is_not_sure(tmp_path: Path) -> None:
    """A datum offset of half a sigma: sure where the log shows white noise, not in slow noise."""
    fault = hidden("datum_offset", "target", north_m=0.012, east_m=-0.012, down_m=0.0)
    run = scenario("car_stops", 12, 60.0, 5.0)
    sure = []
    for kind in ("", "slow position"):
        log = make_log(run, (fault,), WHITE)
        data = data_from(foreign(log, kind) if kind else log, tmp_path)
        chosen = {c.label[:2]: c for c in candidates(data.view)}
        zero = {"north_m": 0.0, "east_m": 0.0, "down_m": 0.0}
        datum = [chosen["datum_offset", "target"].acting(zero)]
        model = fit(data, datum, start=as_specified(data.structure))
        [one] = slow_states(data).own(model)
        sure.append(float(one.spread[0]))
    assert sure[1] > 3.0 * sure[0]


def test_what_is_judged_takes_the_less_sure_of_both() -> None:
    narrow, wide = np.eye(2), 9.0 * np.eye(2)
    values = np.array([6.0, 0.0])
    one, other = Judged(values, narrow, ((wide, 16),)), Judged(values, wide, ((narrow, 16),))
    assert one.spread == pytest.approx([3.0, 3.0])
    assert other.spread == pytest.approx([3.0, 3.0])
    assert Judged(values, wide, ((wide, 16),)).log_p == pytest.approx(one.log_p)
    assert one.log_p > Judged(values, narrow, ((narrow, 16),)).log_p


def test_an_immaterial_finding_changes_no_verdict() -> None:
    small: Finding = replace(LATENCY, material=False)
    assert outcome((), True) == "agrees"
    assert outcome((small,), True) == "agrees"
    assert outcome((small, LATENCY), True) == "explained"
    assert outcome((LATENCY,), False) == "unexplained"


@pytest.mark.parametrize("kind", ["slow ranging", "multipath steps"])
def test_clean_logs_in_foreign_noise_agree(kind: str, tmp_path: Path) -> None:
    """A false cause comes in at most 5 % of clean logs: with 2 logs, one in 10 choices of seeds."""
    log = foreign(make_log(scenario("car_stops", 81, 80.0, 5.0), (), WHITE), kind)
    assert verdict_of(log, tmp_path) == ("agrees", [])


def test_an_effect_is_named_in_foreign_noise(tmp_path: Path) -> None:
    log = make_log(scenario("multirotor_lines", 82, 80.0, 5.0), (LATE,), WHITE)
    verdict, named = verdict_of(foreign(log, "slow attitude"), tmp_path)
    assert (verdict, named) == ("explained", [("latency", "position")])


def test_what_slow_courses_sized_without_it_have_taken_up_is_named(tmp_path: Path) -> None:
    """A hard iron at ten bounds, on circuits on which the heading comes and goes as slow noise."""
    iron = hidden("heading_hard_iron", "attitude", sin_rad=-0.00097, cos_rad=0.00104)
    log = make_log(scenario("fixed_wing_circuits", 1003, 150.0, 10.0), (iron,), WHITE)
    verdict, named = verdict_of(foreign(log, "as a camera"), tmp_path)
    assert (verdict, named) == ("explained", [("heading_hard_iron", "attitude")])


def verdict_of(log: WorldLog, folder: Path) -> tuple[str, list[tuple[str, str]]]:
    spec = folder / "spec.yaml"
    spec.write_text(log.spec_yaml(), encoding="utf-8")
    log_csv = log.to_csv(folder / "log.csv")
    found = diagnose(spec, [log_csv], DiagnosisSettings(unseen_block=False))
    return found.verdict, [(f.effect, f.sensor) for f in found.findings if f.kind == "cause"]


def test_a_parked_vehicle_shows_nothing(tmp_path: Path) -> None:
    """It agrees with everything: a latency that would turn the requirement is not seen in it."""
    driven = make_log(scenario("car_stops", 9, 60.0, 5.0, "position"), (), WHITE)
    rows = driven.run.stamps_s.size
    still = {
        name: np.zeros(rows) if name.startswith(("velocity", "rate")) else np.full(rows, values[0])
        for name, values in driven.columns.items()
        if not name.startswith(("time", "position"))
    }
    draw, sensors = np.random.default_rng(3), driven.run.carriers[0].sensors
    angles = [float(driven.columns[f"{name}_deg"][0]) for name in ("yaw", "pitch", "roll")]
    arm = Rotation.from_euler("ZYX", angles, degrees=True).apply(sensors.antenna_arm_m)
    for k, axis in enumerate(("north", "east", "down")):
        noise = sensors.position_m[k] * draw.standard_normal(rows)
        still[f"position_{axis}_m"] = still[f"reference_{axis}_m"] + arm[k] + noise
    parked = replace(driven, columns={"time_s": driven.columns["time_s"], **still})
    spec = tmp_path / "spec.yaml"
    spec.write_text(driven.spec_yaml(), encoding="utf-8")
    blind = {}
    for name, log in (("driven", driven), ("parked", parked)):
        found = diagnose(spec, [log.to_csv(tmp_path / "log.csv")])
        assert found.verdict == "agrees"
        blind[name] = {(b.effect, b.sensor) for b in found.informative.blind_to}
        assert found.informative.ok == (not blind[name])
        assert found.demanded_exit_code(informative=False) == 0
        assert found.demanded_exit_code(informative=True) == (0 if found.informative.ok else 3)
        seen = {(s.effect, s.sensor, s.parameter): s.value for s in found.smallest_seen}
        shown = seen["latency", "position", "latency_s"]
        assert shown is None if name == "parked" else shown is not None and shown < 0.02
    assert ("latency", "position") in blind["parked"] - blind["driven"]
