"""An effect that is another with every run: heard, named, dated, and no scatter of another.

Oracles: the values the runs were made with, Student's law, and counting.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import syncline_design.campaign.trends as trends_module
import syncline_design.campaign.what_changed as what_changed_module
from syncline_design.campaign.changes import Changes
from syncline_design.campaign.compared_runs import ComparedRuns
from syncline_design.campaign.oddities import DIFFERS
from syncline_design.campaign.passing import taken_by_passing
from syncline_design.campaign.pool import pool_of
from syncline_design.campaign.possible_changes import PossibleChange, PossibleChanges
from syncline_design.campaign.scatter import EffectInRuns, scattered
from syncline_design.campaign.seen import Seen
from syncline_design.campaign.store import Entry, Stored
from syncline_design.campaign.strangers import share_of
from syncline_design.campaign.trends import Trend, shapes, trends
from syncline_design.campaign.what_changed import refined, what_changed
from syncline_design.diagnosis.sufficient import Sufficient
from syncline_design.effects import registry
from tests.watched_series import (
    BOUND,
    LABELS,
    car_spec,
    kept,
    run_of,
    statistics,
    told,
    watch,
)

ALARM = float(np.log(20.0))


def drifting(
    seed: int, runs: int, bounds: float, since: int, alike: float = 0.0
) -> list[Sufficient]:
    """A latency that is another by so many bounds from run to run, `since` the first."""
    rng = np.random.default_rng([61, seed])
    base = 20.0 * BOUND * rng.standard_normal(len(LABELS))
    each = np.array([bounds, 0, 0, 0, 0]) * BOUND
    return [statistics(rng, base + each * max(k - since + 1, 0), alike) for k in range(runs)]


def shown(text: str) -> str:
    """As the console prints it."""
    return text.replace(" us", " µs")


def seen_in(found: list[Sufficient]) -> tuple[Seen, ...]:
    runs = [run_of(one, k) for k, one in enumerate(found)]
    entries = tuple(
        Entry(k + 1, f"#{k + 1}", run, run.statistics(), f"{k:064d}") for k, run in enumerate(runs)
    )
    return ComparedRuns(
        Stored(Path(), "car", {}, entries, (), {}, (), 0, "", b""), entries, ALARM
    ).seen


@pytest.mark.parametrize(("bounds", "usual"), [(1.5, 6), (3.0, 6), (6.0, 6)])
def test_a_drift_rings_soon_and_is_told_as_one(bounds: float, usual: int) -> None:
    """Half of 20 series ring by that run, all by the tenth.  Then the slope is within 4 sigma of
    what it is, these errors scatter by one, and a datum of cosine 0.9 is not named for it."""
    off, first = [], []
    for seed in range(20):
        runs = drifting(seed, 10, bounds, 1, 0.9)
        changes = Changes(pool_of(runs, range(10)))
        first.append(next(n for n in range(2, 11) if changes.log_evidence(n)[0] >= ALARM))
        said = [d for d in changes.differing(10) if d.log_p < np.log(DIFFERS * share_of(10))]
        assert not said
        one, *rest = seen_in(runs)
        assert not rest
        assert one.change.term.label[0] == "latency"
        assert one.change.trend.kind == "drift"
        assert one.low <= 1 <= one.high
        off.append((one.change.values[0] - bounds * BOUND[0]) / one.change.covariance[0, 0] ** 0.5)
    assert max(map(abs, off)) < 4.0
    assert 0.6 < float(np.std(off)) < 1.5
    assert float(np.median(first)) <= usual


def test_what_scatters_is_taken_for_a_drift_no_oftener_than_for_a_step(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The values of a drift in an order that is drawn, 40 series of 9 runs: those that ring are as
    many (two more at most) as where drifts are hardly looked for."""
    rung = {}
    for share in (1e-9, trends_module.DRIFTING):
        monkeypatch.setattr(trends_module, "DRIFTING", share)
        rung[share] = 0
        for seed in range(40):
            rng = np.random.default_rng([62, seed])
            values = 1.2 * rng.permutation(9)
            runs = [statistics(rng, np.array([v, 0, 0, 0, 0]) * BOUND) for v in values]
            changes = Changes(pool_of(runs, range(9)))
            rung[share] += any(changes.log_evidence(n)[0] >= ALARM for n in range(2, 10))
    few, own = rung.values()
    assert own <= few + 2
    assert own <= 8  # 10 % of such series ring (docs/joint.md); more than 8 with a chance of 1 %


def test_a_step_is_no_drift_and_a_drift_no_step() -> None:
    for seed in range(10):
        rng = np.random.default_rng([63, seed])
        moved = np.array([12.0, 0, 0, 0, 0]) * BOUND
        runs = [statistics(rng, moved * (k >= 5)) for k in range(10)]
        assert seen_in(runs)[0].change.trend == Trend("step", 5)


def test_scatter_beside_a_trend_is_that_of_a_weighted_fit() -> None:
    """Cochran's Q left of a mean and of a mean with each trend, by numpy's least squares."""
    rng = np.random.default_rng(64)
    count = 6
    sizes = rng.uniform(0.5, 4.0, count)
    values = rng.standard_normal(count)
    normals = sizes[:, None, None, None]
    found = scattered(normals, 1.0 / normals, (sizes * values)[:, None, None])[:, 0]
    for row, one in enumerate((*trends(count), None)):
        columns = [np.ones(count)] + ([] if one is None else [one.over(count)])
        design = np.column_stack(columns) * np.sqrt(sizes)[:, None]
        left = np.linalg.lstsq(design, np.sqrt(sizes) * values, rcond=None)
        residual = np.sqrt(sizes) * values - design @ left[0]
        assert found[row] == pytest.approx(float(residual @ residual), abs=1e-9)


def test_scatter_beside_a_change_that_went_back_is_that_of_a_weighted_fit() -> None:
    """The same of a mean and what some runs on end or one alone have besides; neither end."""
    rng = np.random.default_rng(69)
    count = 7
    sizes = rng.uniform(0.5, 4.0, (count, 1))
    values = rng.standard_normal((count, 1))
    runs = EffectInRuns(sizes[:, :, None, None], (sizes * values)[:, :, None],
                        np.ones((count, 1), dtype=np.int64), np.ones(1))  # fmt: skip

    def left(*columns: np.ndarray) -> float:
        design = np.column_stack([np.ones(count), *columns]) * np.sqrt(sizes)
        return float(np.linalg.lstsq(design, (np.sqrt(sizes) * values)[:, 0], rcond=None)[1][0])

    taken, begun, ended = taken_by_passing(runs)
    assert len(taken) == 15
    assert begun.min() > 0
    assert ended.max() < count
    for a, b, q in zip(begun, ended, taken[:, 0], strict=True):
        has = (np.arange(count) >= a) & (np.arange(count) < b)
        assert q == pytest.approx(left() - left(has.astype(float)), abs=1e-9)


@pytest.mark.parametrize("beside", [0.0, 8.0])
def test_a_repair_beside_another_change_is_no_scatter(beside: float) -> None:
    """A latency of ten bounds from run 5 on until it is undone at run 8, alone or beside a bias
    that stays: two changes of it, dated right, and none that scatters."""
    for seed in range(4):
        rng = np.random.default_rng([70, seed])
        runs = [
            statistics(rng, np.array([10.0 * (4 <= k < 7), beside * (k >= 6), 0, 0, 0]) * BOUND)
            for k in range(11)
        ]
        seen = seen_in(runs)
        assert not Changes(pool_of(runs, range(11))).differing(11)
        latency = [one.change for one in seen if one.change.term.label[0] == "latency"]
        assert [one.k for one in latency] == [4, 7]
        assert len(seen) == len(latency) + (beside > 0.0)


def test_what_scatters_is_not_told_as_changes_that_went_back() -> None:
    """A latency that scatters by four bounds over twelve runs is told as one that differs, in 19 of
    20 series at least (39 of 40 of these; all 40 before changes that went back were held)."""
    told_so = 0
    for seed in range(20):
        rng = np.random.default_rng([72, seed])
        runs = [statistics(rng, np.array([v, 0, 0, 0, 0]) * BOUND)
                for v in 4.0 * rng.standard_normal(12)]  # fmt: skip
        told_so += bool(Changes(pool_of(runs, range(12))).differing(12))
    assert told_so >= 19


def test_trends_are_steps_and_then_what_grows_by_one_with_every_run() -> None:
    assert shapes(3).tolist() == [[0, 1, 1], [0, 0, 1], [0, 1, 2], [0, 0, 1]]


def test_a_drift_is_told_by_run_and_by_what_it_came_to(tmp_path: Path) -> None:
    spec = car_spec(tmp_path / "spec.yaml")
    store = kept(spec, tmp_path, [run_of(s, k) for k, s in enumerate(drifting(3, 9, 3.0, 1))])
    document = told(spec, store, tmp_path, 1)
    (alarm,) = document["alarms"]
    assert (alarm["effect"], alarm["since"]["run"]) == ("latency", 2)
    true = 3.0 * BOUND[0]
    assert abs(alarm["drift"]["per_run"] - true) < 4.0 * alarm["drift"]["standard_uncertainty"]
    assert alarm["change"] == pytest.approx(8.0 * alarm["drift"]["per_run"])
    assert alarm["drift"]["by_run"] == 9
    said = " ".join(watch(store, spec).output.split())
    assert "Drifts: latency (position), since 2026-09-22" in said
    assert f"latency drifts by {shown(alarm['drift']['text'])} a run since run 2" in said
    assert f"{shown(alarm['text'])} by the last, run 9" in said
    assert "another value in every run" not in said


def test_runs_that_clearly_differ_are_no_all_clear_before_they_ring(tmp_path: Path) -> None:
    """Four runs, six bounds apart each: it may be a drift or scatter, and is said to be open; with
    the next it rings.  The values of an alike series say nothing."""
    spec = car_spec(tmp_path / "spec.yaml")
    runs = [run_of(s, k) for k, s in enumerate(drifting(5, 4, 6.0, 1))]
    store = kept(spec, tmp_path, runs)
    document = told(spec, store, tmp_path, 0)
    assert document["unsettled"]["effect"] == "latency"
    true = float(np.std(6.0 * BOUND[0] * np.arange(4), ddof=1))
    assert document["unsettled"]["spread"]["latency_s"] == pytest.approx(true, rel=0.3)
    said = watch(store, spec, "--require-informative")
    assert said.exit_code == 3
    assert "? The runs are not all alike: latency (position)" in " ".join(said.output.split())
    store.unlink()
    alike = [run_of(s, k) for k, s in enumerate(drifting(5, 4, 0.0, 1))]
    assert "unsettled" not in told(spec, kept(spec, tmp_path, alike), tmp_path, 0)


def test_no_run_of_a_drift_is_unlike_the_others(tmp_path: Path) -> None:
    """The second run of nine lies on the line that all draw, far from most of them."""
    spec = car_spec(tmp_path / "spec.yaml")
    for seed in range(4):
        runs = [run_of(s, k) for k, s in enumerate(drifting(seed, 7, 6.0, 1))]
        document = told(spec, kept(spec, tmp_path, runs), tmp_path, 1)
        assert "unlike" not in document
        (alarm,) = document["alarms"]
        assert (alarm["since"]["run"], alarm["since"]["low"]) == (2, 2)
        (tmp_path / "store.jsonl").unlink()


def test_not_knowing_when_a_drift_began_is_in_what_it_came_to() -> None:
    """A drift of one bound a run, its first run known to one or two: what it came to by the last
    run is told with an error that scatters by one of its uncertainty."""
    off = []
    for seed in range(30):
        runs = drifting(100 + seed, 9, 1.2, 4)
        for one in (s for s in seen_in(runs) if s.change.term.label[0] == "latency"):
            grown = float(one.change.trend.over(9)[-1])
            spread = (grown**2 * one.change.covariance + one.dating_now)[0, 0] ** 0.5
            off.append((grown * one.change.values[0] - 6.0 * BOUND[0]) / spread)
            assert one.dating_now[0, 0] >= 0.0
    assert len(off) >= 20
    assert float(np.sqrt(np.mean(np.square(off)))) < 1.3
    assert sum(abs(z) > 2.5 for z in off) <= 2  # 1.2 % each


def test_of_a_boresight_about_one_axis_no_single_angle_is_told() -> None:
    """Two effects that move the runs alike, one of three values of which one moved and one of one:
    the commoner is told, and the other is an alias, whatever a prior's width makes of three."""
    bore = [p.name for p in registry()["boresight"].slopes()]
    (azimuth,) = [p.name for p in registry()["azimuth_bias"].slopes()]
    labels = tuple(("boresight", "ranging", 0, name) for name in bore)
    labels = (*labels, ("azimuth_bias", "ranging", 0, azimuth))
    rng = np.random.default_rng(66)
    runs = []
    for k in range(9):
        columns = rng.standard_normal((64, 3))
        columns = np.column_stack([columns, columns[:, 2]]) / 1e-4
        y = columns[:, 2] * 4e-5 * max(k - 1, 0) + rng.standard_normal(64)
        normal = columns.T @ columns
        runs.append(Sufficient(labels, normal, columns.T @ y, float(y @ y), normal / 64.0, ()))
    changes = Changes(pool_of(runs, range(9)))
    best = changes.gains(9).max(axis=0)
    names = [term.label[0] for term in changes.terms]
    worse = best[names.index("azimuth_bias")] - best[names.index("boresight")]
    assert worse < 2.0  # within what the commoner of two is told by


def test_a_drift_that_ended_is_told_with_its_end(tmp_path: Path) -> None:
    """Six bounds a run from run 2 to run 6 of ten, and no more: a slower drift that goes on, or a
    step, would be many bounds off in most runs."""
    spec, runs = car_spec(tmp_path / "spec.yaml"), []
    for seed in range(8):
        rng = np.random.default_rng([67, seed])
        base = 20.0 * BOUND * rng.standard_normal(len(LABELS))
        each = np.array([6.0, 0, 0, 0, 0]) * BOUND
        runs = [statistics(rng, base + each * min(k, 5)) for k in range(10)]
        (one,) = seen_in(runs)
        assert one.change.term.label[0] == "latency"
        assert one.change.trend.kind == "drift"
        assert (one.change.k, one.change.trend.until) in ((1, 6), (1, 5), (1, 7))
        came = float(one.change.trend.over(10)[-1] * one.change.values[0])
        assert came == pytest.approx(30.0 * BOUND[0], abs=4.0 * BOUND[0])
    store = kept(spec, tmp_path, [run_of(one, k) for k, one in enumerate(runs)])
    (alarm,) = told(spec, store, tmp_path, 1)["alarms"]
    assert alarm["drift"]["ended"]
    assert alarm["drift"]["by_run"] == 6
    said = " ".join(watch(store, spec).output.split())
    assert "Changed: latency (position), since" in said
    assert f"until run 6: {shown(alarm['text'])}." in said


def test_constants_that_a_drift_hid_are_not_told_as_another_effect() -> None:
    """Runs tell their constants without what changed: a latency that was not 0 before it drifts is
    else held near 0, and the datum's north, of cosine 0.9, told in its place."""
    for seed in (7, 12):
        (one,) = seen_in(drifting(seed, 10, 6.0, 1, 0.9))
        assert one.change.term.label[0] == "latency"
        sigma = one.change.covariance[0, 0] ** 0.5
        assert abs(one.change.values[0] - 6.0 * BOUND[0]) < 4.0 * sigma


def test_one_trend_is_told_where_two_explain_no_more() -> None:
    """A step and a later drift that stood for a drift while its runs were few."""
    for seed in range(6):
        changes = Changes(pool_of(drifting(seed, 10, 4.0, 1), range(10)))
        latency = [term.label[0] for term in changes.terms].index("latency")
        two = [PossibleChange(latency, trend) for trend in (Trend("step", 4), Trend("drift", 6))]
        known = tuple(changes.single(10, one.effect, one.trend) for one in two)
        (one,) = refined(PossibleChanges(changes, 10, (), known), two)
        assert (one.effect, one.trend.kind) == (latency, "drift")
        assert one.trend.k in (1, 2)


def test_a_search_in_which_one_stands_for_two_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two clear changes, of which one is told in the place of both whenever both are known."""
    runs = drifting(3, 9, 0.0, 1)
    moved = np.array([20.0, 25.0, 0, 0, 0]) * BOUND
    rng = np.random.default_rng(71)
    runs = [*runs[:5], *(statistics(rng, moved) for _ in range(4))]
    changes = Changes(pool_of(runs, range(9)))
    assert len(what_changed(changes, 6, ALARM)) > 1
    monkeypatch.setattr(what_changed_module, "_held_against_others", lambda _, __, found: found[:1])
    assert len(what_changed(changes, 6, ALARM)) == 1


def test_whatever_changed_is_told_at_every_look() -> None:
    """Drifts that begin late, end early, go back, beside steps: what is told has a place among the
    runs, at every look that rang."""
    told_at = 0
    for seed in range(12):
        rng = np.random.default_rng([68, seed])
        begun, ended, stepped = (int(k) for k in rng.integers(1, 9, 3))
        runs = []
        for k in range(9):
            drift = 5.0 * max(min(k, ended) - begun + 1, 0)
            moved = np.array([drift, 9.0 * (k >= stepped), 0, 0, 0]) * BOUND
            runs.append(statistics(rng, moved, 0.6))
        for look in range(4, 10):
            for one in seen_in(runs[:look]):
                told_at += 1
                assert 1 <= one.low <= one.change.k <= one.high < look
                until = one.change.trend.until
                assert until is None or one.change.k < until < look
                assert np.all(np.isfinite(one.change.values))
    assert told_at > 40
