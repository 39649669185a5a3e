"""`accept` on what is built in and changed once, which at one speed looks like a step of stamps."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from syncline_design.diagnosis.built import _seen as seen_in
from syncline_design.diagnosis.candidates import Candidate, Signature
from syncline_design.diagnosis.changed_instead import changed_instead
from syncline_design.diagnosis.fitting import Data, Model, fit
from syncline_design.diagnosis.once_changed import once_changed
from syncline_design.diagnosis.searched import SearchedLog
from syncline_design.diagnosis.stretch_windows import BlockSums, cumulated
from syncline_design.diagnosis.stretches import Stands, in_stretches
from syncline_design.effects import registry
from syncline_design.effects.acting import Acting
from syncline_design.effects.record import ActsOn, Array
from tests.test_accept_stretches import files, settled, world
from tests.world import Hidden, hidden, make_log

ARMS = {("lever_arm", "position", 0), ("lever_arm", "ranging", 0)}


def changed(
    folder: Path, name: str, seed: int, share: float, moved: Hidden, *, until: bool = False
) -> tuple[Path, Path]:
    """Spec and log of a vehicle of which something is off from a share of its rows on, or until."""
    run = world(name, seed)
    spec, log = files(folder, run)
    lines = log.read_text("utf-8").splitlines()
    other = make_log(run, (moved,)).to_csv(folder / "moved.csv").read_text("utf-8").splitlines()
    at = 1 + round(share * (len(lines) - 1))
    rows = slice(1, at) if until else slice(at, None)
    lines[rows] = other[rows]
    log.write_text("\n".join(lines) + "\n", "utf-8")
    return spec, log


def forward(sensor: str, size_m: float) -> Hidden:
    return hidden("lever_arm", sensor, x_m=size_m, y_m=0.0, z_m=0.0)


def stepping(
    spec: Path, log: Path, at_s: float, *, late: bool = False
) -> tuple[Data, Model, list[Signature]]:
    """What a search that takes a change for a step of the position's stamps leaves."""
    data, model, known = settled(spec, log)
    acting = [_acting("timestamp_step", step_s=0.0, time_s=at_s)]
    acting += [_acting("latency", latency_s=0.0)] if late else []
    return data, fit(data, tuple(acting), start=model.level), known


def _acting(effect: str, **values: float) -> Acting:
    return Acting(registry()[effect], "position", 0, values)


def stands_beside(data: Data, model: Model, known: list[Signature]) -> tuple[Stands, ...]:
    """What `accept` is told of such a model."""
    search = SimpleNamespace(
        proposals=SimpleNamespace(free_signatures=lambda less: [
            s for s in known if s.candidate.label not in less.labels
        ], signatures=tuple(known)),
        episodes=(), settings=SimpleNamespace(seed=0),
    )  # fmt: skip
    one = SimpleNamespace(data=data, search=search, result=SimpleNamespace(model=model))
    return seen_in(cast(SearchedLog, one)).stands


@pytest.mark.parametrize(
    ("name", "seed", "sensor", "size_m"),
    [("car_stops", 3, "position", 0.3), ("car_stops", 3, "ranging", 0.3)],
)
def test_an_arm_that_is_knocked_is_no_step_of_stamps(
    name: str, seed: int, sensor: str, size_m: float, tmp_path: Path
) -> None:
    """The best delay leaves what the speed varies by; either arm leaves noise."""
    log = changed(tmp_path, name, seed, 0.65, forward(sensor, size_m))
    data, model, known = stepping(*log, 39.0)
    first = stands_beside(data, model, known)[0]
    assert first.sure
    assert {first.label, *first.others} == ARMS, first
    assert first.from_s == pytest.approx(39.0, abs=1.0)
    assert first.to_s == pytest.approx(60.0, abs=1.0)
    assert max(map(abs, first.values)) == pytest.approx(size_m, rel=0.15)


def test_an_arm_that_is_put_right_is_no_delay_that_a_step_undoes(tmp_path: Path) -> None:
    """A constant delay and a step against it are two words for one arm until then."""
    spec, log = changed(tmp_path, "car_stops", 3, 0.35, forward("position", 0.3), until=True)
    data, model, known = stepping(spec, log, 21.0, late=True)
    first = stands_beside(data, model, known)[0]
    assert first.sure
    assert {first.label, *first.others} == ARMS, first
    assert first.from_s == pytest.approx(0.0, abs=1.0)
    assert first.to_s == pytest.approx(21.0, abs=1.0)


def test_an_arm_that_is_off_and_changes_is_told_beside_the_other(tmp_path: Path) -> None:
    """What a model holds for all of the log may change as well, so that either arm may."""
    log = changed(tmp_path, "car_stops", 41, 0.65, forward("position", 0.25))
    data, model, known = settled(*log)
    arm = _acting("lever_arm", x_m=0.0, y_m=0.0, z_m=0.0)
    model = fit(data, (arm,), start=model.level)
    first = stands_beside(data, model, known)[0]
    assert first.sure
    assert {first.label, *first.others} >= ARMS, first


def drifting(spec: Path, log: Path) -> tuple[Data, Model, list[Signature]]:
    """What a search that takes a turn for a heading that drifts leaves."""
    data, model, known = settled(spec, log)
    drift = Acting(registry()["heading_drift"], "attitude", 0, {"rate_radps": 0.0})
    return data, fit(data, (drift,), start=model.level), known


@pytest.mark.parametrize(("name", "seed"), [("multirotor_lines", 9), ("fixed_wing_circuits", 2)])
def test_a_heading_that_is_turned_once_is_no_drift(name: str, seed: int, tmp_path: Path) -> None:
    """Half a degree from 40 % on is 2 mrad and more off any line that grows."""
    turn = hidden("mounting", "attitude", x_rad=0.0, y_rad=0.0, z_rad=0.0087)
    data, model, known = drifting(*changed(tmp_path, name, seed, 0.4, turn))
    first = stands_beside(data, model, known)[0]
    assert first.sure
    labels = {first.label, *first.others}
    assert labels & {("mounting", "attitude", 0), ("heading_bias", "attitude", 0)}, first
    assert first.from_s == pytest.approx(24.0, abs=1.0)
    assert max(map(abs, first.values)) == pytest.approx(0.0087, rel=0.15)


def test_a_heading_that_drifts_stays_one(tmp_path: Path) -> None:
    """As much at its end as a turn would be in all of it."""
    drift = hidden("heading_drift", "attitude", rate_radps=0.0087 / 60.0)
    run = world("multirotor_lines", 9)
    data, model, known = drifting(*files(tmp_path, run, (drift,)))
    found = changed_instead(data, model, in_stretches(known))
    assert found.model is model
    assert found.hits == ()


def test_stamps_that_step_stay_a_step(tmp_path: Path) -> None:
    """Neither arm fits a delay where the speed changes."""
    step = hidden("timestamp_step", "position", step_s=0.05, time_s=39.0)
    data, model, known = stepping(*files(tmp_path, world("car_stops", 3), (step,)), 39.0)
    found = changed_instead(data, model, in_stretches(known))
    assert found.model is model
    assert found.hits == ()


def summed(effect: str, sensor: str, columns: Array, left: Array) -> tuple[Signature, BlockSums]:
    """A candidate of such columns (n, 3, p), and what rows of white noise of 1 say of it."""
    n = len(left)
    edges = np.arange(n + 1)
    parts = (
        np.einsum("nij,nik->njk", columns, columns),
        np.einsum("nij,ni->nj", columns, left)[:, None],
        np.sum(left**2, axis=1),
        np.full(n, 3.0),
    )
    normal, score, square, rows = (cumulated(part, edges) for part in parts)
    sums = BlockSums(normal, score, square, rows, edges, 0.1 * np.arange(n))
    one = Candidate(registry()[effect], cast(ActsOn, sensor), 0)
    return Signature(one, {}, columns), sums


@pytest.mark.parametrize("turned", [True, False])
def test_the_likelier_of_two_changes_is_told_whichever_sees_more_slow_noise(turned: bool) -> None:
    """Heights wander: a turn sees all of it, and of an arm's three figures two see nothing.

    Ranges of 0.5 to 1.5 of the mean make the wrong one worse by 600 * 9 * 0.08 = 430 in chi2.
    """
    rng = np.random.default_rng(5)
    n = 1200
    turn = np.zeros((n, 3, 1))
    turn[:, 2, 0] = rng.uniform(0.5, 1.5, n)
    arm = np.broadcast_to(np.eye(3), (n, 3, 3))
    left = rng.normal(size=(n, 3))
    left[:, 2] += 0.5 * np.sin(8.0 * np.pi * np.arange(n) / n)
    left[n // 2 :, 2] += 3.0 * (turn[n // 2 :, 2, 0] if turned else 1.0)
    hit = once_changed([summed("elevation_bias", "ranging", turn, left),
                        summed("lever_arm", "position", arm, left)])  # fmt: skip
    assert hit is not None
    assert hit.signature.candidate.effect.name == ("elevation_bias" if turned else "lever_arm")
    assert hit.from_s == pytest.approx(60.0, abs=1.0)
    assert hit.to_s == pytest.approx(119.9)
