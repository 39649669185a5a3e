"""What differs from run to run and what changed, side by side: neither is told for the other.

Oracles: the values that the runs were made with, counting, least squares, numerical integration.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm

from syncline_design.campaign.changes import Changes
from syncline_design.campaign.compared_runs import ComparedRuns
from syncline_design.campaign.differing_odds import log_of_sizes
from syncline_design.campaign.oddities import scattering
from syncline_design.campaign.pool import pool_of
from syncline_design.campaign.scatter import APART, log_odds_apart
from syncline_design.campaign.store import Entry, Stored
from syncline_design.campaign.trends import Trend
from syncline_design.diagnosis.sufficient import Sufficient
from tests.watched_series import BOUND, LABELS, car_spec, kept, run_of, statistics, told, watch

ALARM = float(np.log(20.0))
LATENCY, BIAS, NORTH = range(3)


def course(runs: list[Sufficient]) -> ComparedRuns:
    entries = tuple(
        Entry(k + 1, f"#{k + 1}", run_of(one, k), one, f"{k:064d}") for k, one in enumerate(runs)
    )
    return ComparedRuns(Stored(Path(), "car", {}, entries, (), {}, (), 0, "", b""), entries, ALARM)


def driven(seed: int, values: dict[int, np.ndarray]) -> list[Sufficient]:
    """Runs with values [bounds] of some parameters."""
    rng = np.random.default_rng([81, seed])
    base = 3.0 * BOUND * rng.standard_normal(len(LABELS))
    count = len(next(iter(values.values())))
    moved = np.zeros((count, len(LABELS)))
    for place, own in values.items():
        moved[:, place] = own
    return [statistics(rng, base + BOUND * one) for one in moved]


def scatter(seed: int, bounds: float, count: int) -> np.ndarray:
    return bounds * np.random.default_rng([82, seed]).standard_normal(count)


def changed(watched: ComparedRuns) -> list[tuple[str, int]]:
    if watched.first_look is None:
        return []
    return [(one.change.term.label[0], one.change.k) for one in watched.seen]


def test_a_datum_that_scatters_to_the_north_is_no_change_and_is_said_to() -> None:
    """Eight bounds over nine runs: of 20 series at most two ring at any look, which is no more than
    chance where the law of the scatter itself gives a change, and 17 at least say it of the north
    alone."""
    rung = said = 0
    for seed in range(20):
        watched = course(driven(seed, {NORTH: scatter(seed, 8.0, 9)}))
        rung += watched.first_look is not None
        seen = [one.change for one in watched.seen] if watched.first_look else []
        for one in scattering(watched.changes, seen, 9):
            if one.named.label[0] == "datum_offset":
                said += bool(one.spread[0] > 0.0 and not np.any(one.spread[1:]))
    assert rung <= 2
    assert said >= 17


def test_a_datum_that_scatters_beside_a_step_is_not_told_as_changed() -> None:
    """A latency of twelve bounds from the sixth of nine runs on is told in all of 12 series, and a
    change of the datum, which has another value in every run, in one at most."""
    false = 0
    for seed in range(12):
        step = 12.0 * (np.arange(9) >= 5)
        watched = course(driven(seed, {NORTH: scatter(seed, 8.0, 9), LATENCY: step}))
        found = changed(watched)
        assert ("latency", 5) in found
        false += any(name != "latency" for name, _ in found)
    assert false <= 1


def test_a_day_that_is_nothing_out_of_the_scatter_is_no_change() -> None:
    """The values of a datum [bounds] of which the last, but no less the one before, is far off."""
    north = np.array([0.8, -2.4, -2.4, 0.8, -3.2, 4.8, -0.8, 8.8, -10.4])
    for seed in range(4):
        for count in (8, 9):
            step = 12.0 * (np.arange(count) >= 5)
            watched = course(driven(seed, {NORTH: north[:count], LATENCY: step}))
            assert changed(watched) == [("latency", 5)]


def test_an_odd_day_beside_a_step_is_no_scatter() -> None:
    """A bias of 25 bounds in the third run alone, and a latency of ten from the sixth on: the bias
    is told as come and gone, whether or not its run stands alone, and nothing to differ."""
    for seed in range(6):
        odd, step = 25.0 * (np.arange(8) == 2), 10.0 * (np.arange(8) >= 5)
        watched = course(driven(seed, {BIAS: odd, LATENCY: step}))
        assert changed(watched) == [("range_bias", 2), ("range_bias", 3), ("latency", 5)]
        assert not list(scattering(watched.changes, [s.change for s in watched.seen], 8))


def test_what_changes_explain_is_that_of_least_squares() -> None:
    """By the rows of all runs with one value of everything, with the changes and without."""
    runs = driven(3, {LATENCY: 8.0 * (np.arange(7) >= 4), NORTH: 4.0 * (np.arange(7) >= 2)})
    changes = Changes(pool_of(runs, range(7)))
    labels = [term.label[0] for term in changes.terms]
    ones = [changes.single(7, labels.index(name), Trend("step", k))
            for name, k in (("latency", 4), ("datum_offset", 2))]  # fmt: skip
    roots = [np.linalg.cholesky(one).T for one in changes.pool.normal]
    rows = [np.linalg.solve(root.T, g) for root, g in zip(roots, changes.pool.score, strict=True)]
    away = np.zeros((7, len(LABELS)))
    for one in ones:
        away[:, one.term.index] += one.trend.over(7)[:, None] * one.values
    moved = [row - root @ own for row, root, own in zip(rows, roots, away, strict=True)]
    design = np.concatenate(roots) * BOUND[0]
    left = [float(np.linalg.lstsq(design, np.concatenate(y), rcond=None)[1][0])
            for y in (rows, moved)]  # fmt: skip
    assert changes.explained(7, ones) == pytest.approx(0.5 * (left[0] - left[1]), rel=1e-2)


@pytest.mark.parametrize("value", [0.5, 4.0, 30.0])
def test_the_odds_of_a_size_are_over_all_sizes(value: float) -> None:
    """An estimate of standard deviation 0.7 over its likelihood at its best, by integration."""
    shares = np.exp(log_odds_apart(1))

    def over(size: float) -> float:
        near = (value - 6.0, value + 6.0)
        return float(
            quad(lambda d: norm.pdf(value, d, 0.7) * norm.pdf(d, 0.0, 1.5 * size), *near)[0]
        )

    expected = np.dot(shares / shares.sum(), [over(size) for size in APART])
    found = log_of_sizes(np.array([value]), np.array([[0.49]]), np.array([[2.25]]))
    assert found == pytest.approx(float(np.log(expected / norm.pdf(0.0, 0.0, 0.7))), abs=1e-6)


def test_what_scatters_is_told_by_its_axis(tmp_path: Path) -> None:
    spec = car_spec(tmp_path / "spec.yaml")
    runs = [run_of(one, k) for k, one in enumerate(driven(1, {NORTH: scatter(1, 8.0, 9)}))]
    store = kept(spec, tmp_path, runs)
    (said,) = told(spec, store, tmp_path, 0)["cautions"]
    assert said.startswith("datum offset (target) of car has another value in every run: they diff")
    assert "differ by north " in said
    assert "east" not in said
    assert "Nothing changed" in watch(store, spec).output
