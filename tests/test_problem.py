"""From a spec to tables of options: figures by hand, what is left out and why, sharing."""

from __future__ import annotations

import math
import random
from fractions import Fraction
from pathlib import Path

import mpmath
import pytest

from syncline_design.choice.chosen_system import clock_error, system_of, timing_error
from syncline_design.choice.evaluate import added_up, evaluate
from syncline_design.choice.option import Option
from syncline_design.choice.problem import build_problem, selection_of, sole_design, with_everything
from syncline_design.choice.table import Design, Problem, with_limits
from syncline_design.model import timing
from syncline_design.model.budget import budget
from syncline_design.model.known import Known
from syncline_design.spec.case import Case
from syncline_design.spec.exact import norm, square_root, tau_bound
from syncline_design.spec.load import load, load_text

SPECS = sorted((Path(__file__).parent.parent / "specs").glob("*.yaml"))

USV = """\
syncline: 1
name: A small vessel
currency: EUR
requirements:
  - {id: ACC, kind: accuracy, limit: 0.5 m}
  - {id: COST, kind: cost, limit: 40000 EUR}
stages:
  - name: usv
    platform: {name: hull, v_max: 5 m/s, omega_max: 17 deg/s, distance: 30 m, baseline: 5 m}
    position:
      sensor: {modality: position, sigma_position: 1 cm, primitives: [pps], cost: 800 EUR}
    attitude:
      sensor:
        {modality: attitude, sigma_attitude: [0.1 deg, 0.1 deg, 0.2 deg], primitives: [pps, tov],
         cost: 3000 EUR}
    ranging:
      sensor:
        {modality: ranging, sigma_range: 2 cm, sigma_bearing: [0.08 deg, 0.08 deg],
         primitives: [trigger], cost: 29000 EUR}
timestamping: {candidates: [gpio, arrival]}
"""


def loaded(text: str) -> Case:
    return load_text(text, "spec.yaml")


def by_role(problem: Problem) -> dict[str, list[Option]]:
    return {table.role: list(table.options) for table in problem.roles}


def test_sensor_errors_and_tau_crit_by_hand() -> None:
    problem = build_problem(loaded(USV))
    roles = by_role(problem)
    with mpmath.workdps(50):
        deg = mpmath.pi / 180
        rate = 5 + 30 * 17 * deg
        position = mpmath.sqrt(3) * mpmath.mpf("0.01")
        attitude = mpmath.sqrt(mpmath.mpf("0.06")) * deg * 30
        ranging = mpmath.mpf("0.02") + mpmath.sqrt(2) * mpmath.mpf("0.08") * deg * 30
        for role, error, own_rate in (
            ("position", position, 5),
            ("attitude", attitude, rate),
            ("ranging", ranging, rate),
        ):
            first = roles[role][0]
            assert first.sensor_error_m == float(error)
            assert first.tau_crit_s == pytest.approx(float(error / own_rate), rel=1e-15)
            exact = mpmath.mpf(first.error().numerator) / first.error().denominator
            assert abs(exact - error) < mpmath.mpf(10) ** -48
        assert problem.sync_rate_mps == float(rate)
        assert [pair.rate_mps for pair in problem.pairs] == [5.0, float(30 * 17 * deg)]


def test_options_are_the_pairs_that_sensor_and_method_share() -> None:
    problem = build_problem(loaded(USV))
    options = {
        role: {(o.primitive, o.method) for o in options}
        for role, options in by_role(problem).items()
    }
    gone = {
        table.role: {(one.primitive, one.method): one for one in table.excluded}
        for table in problem.roles
    }
    assert options["position"] == {("pps", "gpio")}
    assert options["attitude"] == {("pps", "gpio"), ("tov", "gpio")}
    assert options["ranging"] == {("trigger", "gpio")}
    # Arrival (16 ms) breaks the tau_crit of position and attitude; the reason says by how much.
    ratio = gone["position"]["arrival", "arrival"].ratio
    assert ratio == pytest.approx(0.016 / (math.sqrt(3) * 0.01 / 5.0))
    assert "own tau_crit" in gone["attitude"]["arrival", "arrival"].reason


def test_method_without_a_common_primitive_is_left_out_with_the_reason() -> None:
    problem = build_problem(loaded(USV.replace("[gpio, arrival]", "[gpio, ptp]")))
    reasons = [one.reason for table in problem.roles for one in table.excluded]
    assert reasons[0] == "ptp serves network; usv.position has pps, arrival"


def test_limits_are_the_tightest_and_sync_is_implied() -> None:
    more = USV.replace(
        "stages:",
        "  - {id: ACC2, kind: accuracy, limit: 40 cm}\n"
        "  - {id: MASS, kind: mass, limit: 3000 g}\nstages:",
    )
    text = more.replace("cost: 800 EUR}", "cost: 800 EUR, mass: 1 kg}")
    text = text.replace("cost: 3000 EUR}", "cost: 3000 EUR, mass: 1 kg}")
    text = text.replace("cost: 29000 EUR}", "cost: 29000 EUR, mass: 1 kg}")
    limits = build_problem(loaded(text)).limits
    assert limits.accuracy_m == 0.4
    assert limits.sync == 1.0
    assert limits.cost == 40000
    assert limits.mass == 3
    assert dict(limits.ids) == {"accuracy": "ACC2", "cost": "COST", "mass": "MASS"}


def test_money_is_converted_to_the_cent_piece_by_piece() -> None:
    """800.10 USD are 736.092 EUR, so 736.09 EUR."""
    text = USV.replace("cost: 800 EUR", "cost: 800.10 USD").replace(
        "currency: EUR", "currency: EUR\nexchange_rates: {USD: 0.92 EUR}"
    )
    option = by_role(build_problem(loaded(text)))["position"][0]
    gpio = load(SPECS[0]).catalog.timestamping["gpio"].cost
    assert option.resources.cost == Fraction("736.09") + gpio.exact  # type: ignore[union-attr]


def test_known_effects_add_to_tau_and_to_the_total() -> None:
    plain = build_problem(loaded(USV))
    extra = build_problem(
        loaded(USV), Known({("usv", "ranging"): 0.001}, (("boresight", "usv", 0.125),))
    )
    one, other = by_role(plain)["ranging"][0], by_role(extra)["ranging"][0]
    assert other.tau() - one.tau() == Fraction(0.001)
    assert extra.fixed_error_m == 0.125
    designs = [Design((0, 0, 0), (0,))] * 2
    totals = [evaluate(p, d).total_m for p, d in zip((plain, extra), designs, strict=True)]
    assert totals[1] - totals[0] == Fraction(0.125) + plain.sync_rate() * Fraction(0.001)


def test_stage_without_ranging_has_its_own_stamp_as_reference() -> None:
    lines = USV.splitlines()
    cut = lines.index("    ranging:")
    text = "\n".join(lines[:cut] + lines[cut + 4 :])
    problem = build_problem(loaded(text))
    assert problem.sync_rate_mps == 5.0
    assert [(p.role, p.reference, p.rate_mps) for p in problem.pairs] == [(0, None, 5.0)]
    attitude = by_role(problem)["attitude"][0]
    assert (attitude.sensor_error_m, attitude.tau_crit_s) == (0.0, math.inf)


def test_pinned_design_is_verified_even_when_it_breaks_sync() -> None:
    text = USV.replace("[gpio, arrival]", "[arrival]")
    problem = build_problem(loaded(text))
    assert problem.combinations == 0
    found = sole_design(problem)
    assert found is not None
    everything, design = found
    assert [one.method for one in selection_of(everything, design).roles] == ["arrival"] * 3
    assert sole_design(build_problem(loaded(USV))) is None  # attitude by pps or tov is open


def test_relaxed_sync_limit_brings_options_back() -> None:
    from dataclasses import replace

    problem = build_problem(loaded(USV))
    relaxed = with_limits(problem, replace(problem.limits, sync=100.0))
    assert len(relaxed.roles[0].options) == 2
    back = with_limits(relaxed, problem.limits)
    assert [t.options for t in back.roles] == [t.options for t in problem.roles]


@pytest.mark.parametrize("path", SPECS, ids=lambda path: path.stem)
def test_system_and_tables_agree_with_the_model(path: Path) -> None:
    """The model's budget of the chosen system, which shares no formula, gives the same sums."""
    spec = load(path)
    problem = build_problem(spec)
    sole = sole_design(problem)
    if sole is not None:
        problem, design = sole
    else:
        problem = with_everything(problem)
        design = Design((0,) * len(problem.roles), (0,) * len(problem.vehicles))
    found = evaluate(problem, design)
    figures = budget(system_of(spec, problem, design))
    assert figures.total(problem.sync_model) == pytest.approx(found.error_m, rel=1e-12)
    assert figures.tau_s == pytest.approx(float(found.tau_sys_s), rel=1e-12)
    assert figures.sensor_error_m == pytest.approx(float(found.sensor_error_m), rel=1e-12)
    assert figures.sync_rate_mps == pytest.approx(problem.sync_rate_mps, rel=1e-12)
    for row, table, place in zip(figures.sensors, problem.roles, design.options, strict=True):
        option = table.options[place]
        assert row.tau_s == pytest.approx(option.tau_s, rel=1e-12)
        assert row.tau_crit_s == pytest.approx(option.tau_crit_s, rel=1e-12)


def test_exact_bounds_equal_the_timing_module() -> None:
    catalog = load(SPECS[0]).catalog
    entries = [m.error for m in catalog.timestamping.values()]
    entries += [c.offset for c in catalog.clocks.values()]
    for entry in entries:
        for factor in (1.0, 3.0):
            expected = timing.bound(timing_error(entry), factor)
            assert float(tau_bound(entry, factor)) == pytest.approx(expected, rel=1e-12)


def test_clock_error_has_the_bound_of_offset_plus_drift_times_holdover() -> None:
    catalog = load(SPECS[0]).catalog
    drifting = 0
    for clock in catalog.clocks.values():
        expected = float(tau_bound(clock.offset, 3.0))
        if clock.drift is not None and clock.holdover is not None:
            drifting += 1
            expected += abs(float(clock.drift)) * float(clock.holdover)
        assert timing.bound(clock_error(clock), 3.0) == pytest.approx(expected, rel=1e-12)
    assert drifting > 0


@pytest.mark.parametrize("text", ["2", "1e-12", "123456789.5", "7e-30", "3e20", "0.0003"])
def test_square_roots_to_fifty_digits(text: str) -> None:
    with mpmath.workdps(80):
        root = square_root(Fraction(text))
        value = mpmath.mpf(root.numerator) / root.denominator
        assert abs(value / mpmath.sqrt(mpmath.mpf(text)) - 1) < mpmath.mpf(10) ** -50


def test_norm_counts_one_figure_per_axis() -> None:
    assert float(norm(2.0, 3)) == pytest.approx(2.0 * math.sqrt(3.0), rel=1e-15)
    assert norm((3.0, 4.0), 2) == 5
    assert norm(0.0, 2) == 0


def test_sums_over_one_denominator_are_those_of_fractions_added_one_by_one() -> None:
    rng = random.Random(7)
    for count in (0, 1, 2, 5, 12):
        for _ in range(50):
            terms = [
                rng.choice([Fraction(rng.gauss(0.0, 1e-6)), Fraction(rng.randint(-999, 999), 700)])
                for _ in range(count)
            ]
            one_by_one = Fraction(0)
            for term in terms:
                one_by_one += term
            assert added_up(terms) == one_by_one
