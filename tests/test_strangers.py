"""Runs of a store that are unlike the others: named with figures, and hiding no change.

Oracles: the values the runs were made with, and counting.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from syncline_design.campaign.adding import run_of as run_of_log
from syncline_design.campaign.changes import Changes
from syncline_design.campaign.compared_runs import ComparedRuns
from syncline_design.campaign.kept import Run
from syncline_design.campaign.pool import pool_of
from syncline_design.campaign.seen import seen_changes
from syncline_design.campaign.standing import standing
from syncline_design.campaign.store import Entry, Stored, add_run
from syncline_design.campaign.strangers import part_of, strangers
from syncline_design.campaign.watch_result import e_value_text
from syncline_design.diagnosis.result import Check
from syncline_design.diagnosis.settings import DiagnosisSettings
from syncline_design.diagnosis.sufficient import Sufficient
from syncline_design.diagnosis.system import pinned_system
from syncline_design.effects import registry
from syncline_design.spec.load import load
from tests.watched_series import (
    BOUND,
    LABELS,
    UNITS,
    car_spec,
    kept,
    run_of,
    statistics,
    told,
    watch,
)
from tests.world import make_log, scenario

OTHER = np.array([20.0, 10.0, 0, 0, 0]) * BOUND  # another vehicle's latency and range bias
FAST = Check("speed", "car", "contradiction", "speed of car reaches 31 m/s (95 % of the log is "
             "below), the spec's v_max is 15 m/s; 60 % of the log is beyond it", 31.0, 15.0, "m/s",
             0.6)  # fmt: skip


@pytest.fixture(scope="module")
def spec(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return car_spec(tmp_path_factory.mktemp("strangers") / "spec.yaml")


def with_odd(seed: int, count: int, odd: int, off: np.ndarray = OTHER) -> list[Run]:
    """Alike runs but one."""
    rng = np.random.default_rng(seed)
    base = 20.0 * BOUND * rng.standard_normal(len(LABELS))
    return [run_of(statistics(rng, base + off * (k == odd)), k) for k in range(count)]


@pytest.mark.parametrize("size", [1.0, 20.0])
def test_another_vehicles_log_is_named_with_all_that_differs(
    spec: Path, tmp_path: Path, size: float
) -> None:
    """Whether it differs by 20 bounds or by 400: what differs so makes no effect one that differs
    from run to run, and 95 % intervals hold what it was made with."""
    store = kept(spec, tmp_path, with_odd(5, 12, 4, size * OTHER))
    found = told(spec, store, tmp_path, 1)
    assert {one["number"] for one in found["unlike"]} == {5}
    differs = {one["effect"]: one["differs"] for one in found["unlike"]}
    assert set(differs) == {"latency", "range_bias"}
    for (effect, name), true in zip(
        (("latency", "latency_s"), ("range_bias", "bias_m")), size * OTHER[:2], strict=True
    ):
        own = differs[effect][name]
        assert abs(own["value"] - true) < 3.5 * own["standard_uncertainty"]
        assert 0.7 < own["standard_uncertainty"] / BOUND[0 if effect == "latency" else 1] < 1.6
    assert not any("another value in every run" in one for one in found["cautions"])
    (said,) = [one for one in found["cautions"] if "unlike the others" in one]
    assert said.startswith("run 5 (day4.csv) is unlike the others: latency (position) by ")
    assert "--leave-out 5" in said
    page = (tmp_path / "watch.html").read_text("utf-8")
    assert "Run 5 is unlike the others: latency (position) and range bias (ranging)" in page


def test_a_run_that_rang_alone_rings_until_it_is_left_out(spec: Path, tmp_path: Path) -> None:
    """On its day as a change, with the next run as that run's own; left out, nothing changed."""
    runs = with_odd(6, 10, 7)
    store = kept(spec, tmp_path, runs[:8])
    found = told(spec, store, tmp_path, 1)
    assert {one["since"]["run"] for one in found["alarms"]} == {8}
    assert any("run 8" in one and "a change since then" in one for one in found["cautions"])
    assert "Run 8 is unlike the others" in watch(store, spec).output
    for run in runs[8:]:
        add_run(store, "car", pinned_system(load(spec)), run)
        found = told(spec, store, tmp_path, 1)
        assert {(one["since"]["run"], one.get("alone")) for one in found["alarms"]} == {(8, True)}
        assert found["e_value"] < 20.0
    rang = max(run["e_value"] or 0.0 for run in found["runs"])
    said = " ".join(watch(store, spec).output.split())  # the evidence of the alarm, not the day's
    assert f"e-value {e_value_text(found['alarms'][0]['e_value'])} at run 8, " in said
    assert f"{e_value_text(found['e_value'])} by now" in said
    assert rang < 20.0
    assert "--leave-out 8" in " ".join(watch(store, spec).output.split())
    assert watch(store, "--leave-out", "8", "--reason", "another vehicle").exit_code == 0
    found = told(spec, store, tmp_path, 0)
    assert "unlike" not in found
    said = " ".join(watch(store, spec).output.split())
    assert "Nothing changed in 9 runs" in said
    assert "9 held against one another, 1 left out" in said


def test_a_strange_run_hides_no_later_change(spec: Path, tmp_path: Path) -> None:
    """Nine bounds from the tenth run on, after a run that is off by four hundred."""
    runs = with_odd(7, 9, 3, 20.0 * OTHER)
    rng = np.random.default_rng(7)
    base = 20.0 * BOUND * rng.standard_normal(len(LABELS))
    moved = base + np.array([9.0, 0, 0, 0, 0]) * BOUND
    rng = np.random.default_rng(70)
    runs += [run_of(statistics(rng, moved), k) for k in range(9, 13)]
    found = told(spec, kept(spec, tmp_path, runs), tmp_path, 1)
    (alarm,) = found["alarms"]
    assert (alarm["effect"], alarm["since"]["run"], alarm.get("alone")) == ("latency", 10, None)
    low, high = alarm["interval95"]
    assert low < 9.0 * BOUND[0] < high
    assert {one["number"] for one in found["unlike"]} == {4}
    values = {run["run"]: run["values"] for run in found["runs"]}
    north = [v["value"] - base[2] for k in range(1, 14) if k != 4 for v in values[k]
             if v["parameter"] == "north_m"]  # fmt: skip
    assert np.max(np.abs(north)) < 5.0 * BOUND[2]  # the courses of other effects are not shifted


def looks(runs: list[Sufficient], first: int) -> Iterator[Changes]:
    """The question after each run, from so many on; how parts of a run scatter is told once."""
    whole = Changes(pool_of(runs, range(len(runs))))
    return (part_of(whole, np.arange(n)) for n in range(first, len(runs) + 1))


def test_alike_runs_are_seldom_said_to_be_unlike() -> None:
    """1 % over all looks: of 100 series of 20 looks, more than 5 have a chance of 0.06 %."""
    said = 0
    for seed in range(100):
        rng = np.random.default_rng([8, seed])
        runs = [statistics(rng, 20.0 * BOUND) for _ in range(22)]
        said += any(strangers(one) for one in looks(runs, 3))
    assert said <= 5


def test_what_scatters_makes_few_strangers() -> None:
    """A latency of another value in every run, by 2.5 bounds: at most 5 % of series of 24 runs may
    have a run said to be unlike (9 of 60 did where chances were those of no scatter)."""
    said = 0
    for seed in range(60):
        rng = np.random.default_rng([19, seed])
        runs = []
        for _ in range(24):
            values = 20.0 + np.array([2.5 * rng.standard_normal(), 0, 0, 0, 0])
            runs.append(statistics(rng, values * BOUND))
        said += any(strangers(one) for one in looks(runs, 8))
    assert said <= 3


def test_what_lasts_or_differs_in_every_run_makes_no_stranger() -> None:
    """A change from the middle on, one that was undone after two runs, and a scatter."""
    rng = np.random.default_rng(9)
    draws = rng.standard_normal(12)
    for sizes, alone in (
        (10.0 * (np.arange(12) >= 6), ()),
        (10.0 * np.isin(np.arange(12), (4, 5)), ()),
        (20.0 * np.isin(np.arange(12), (4,)), (4,)),
        (20.0 * (np.arange(12) == 4) - 20.0 * (np.arange(12) == 5), (4, 5)),
        (6.0 * draws, ()),
        (20.0 * (np.arange(12) == 11), ()),
    ):
        runs = [statistics(rng, np.array([size, 0, 0, 0, 0]) * BOUND) for size in sizes]
        changes = Changes(pool_of(runs, range(12)))
        assert standing(changes, strangers(changes)).alone == alone


@pytest.mark.parametrize("size", [8.0, 20.0, 60.0])
def test_runs_of_a_change_that_show_it_by_other_names_are_no_strangers(size: float) -> None:
    """Columns of cosine 0.97, moved with the 8th run: one run shows a latency, the next a datum.
    The change is dated by all of its runs, and none of them, nor any before, stands alone."""
    for seed in range(15):
        rng = np.random.default_rng([18, seed])
        base = 20.0 * BOUND * rng.standard_normal(len(LABELS))
        moved = np.array([size, 0, 0, 0, 0]) * BOUND
        runs = [statistics(rng, base + moved * (k >= 7), 0.97) for k in range(12)]
        for look in (9, 10, 12):
            changes = Changes(pool_of(runs[:look], range(look)))
            found = standing(changes, strangers(changes))
            assert found.alone == ()
            assert not found.strange


def test_a_run_that_stands_alone_is_told_by_all_that_it_has() -> None:
    """Latency by 80 bounds and the datum's north by -50, columns of cosine 0.9, in run 6 of 7: each
    is told beside the other, for alone the first would take most of what the second is."""
    moved = np.array([80.0, 0, -50.0, 0, 0]) * BOUND
    true = {"latency_s": moved[0], "north_m": moved[2]}
    off = []
    for seed in range(15):
        rng = np.random.default_rng([19, seed])
        runs = [statistics(rng, moved * (k == 5), 0.9) for k in range(7)]
        (one,) = strangers(Changes(pool_of(runs, range(7))))
        assert one.run == 5
        assert {d.term.label[0] for d in one.departures} == {"latency", "datum_offset"}
        for d in one.departures:
            names = [p.name for p in d.term.effect.slopes()]
            off += list((d.judged.values - [true.get(n, 0.0) for n in names]) / d.judged.spread)
    assert max(map(abs, off)) < 4.5
    assert 0.6 < float(np.std(off)) < 1.3


def test_effects_are_told_by_one_noise_of_a_run() -> None:
    """Parts of runs that scatter more about the latency than about the datum make the datum no
    likelier, in a run that stands alone or from a run on: the one that explains the runs is."""
    moved = np.array([40.0, 0, 0, 0, 0]) * BOUND
    for seed in range(6):
        rng = np.random.default_rng([20, seed])
        runs = [statistics(rng, moved * (k == 5), 0.97) for k in range(7)]
        changes = Changes(pool_of(runs, range(7)))
        latency = [t.label[0] for t in changes.terms].index("latency")
        changes.__dict__["within"] = np.ones((7, len(changes.terms)))
        changes.within[:, latency] = 3.0
        (one,) = strangers(changes)
        assert [d.term.label[0] for d in one.departures] == ["latency"]
        row, c = np.unravel_index(int(np.argmax(changes.likelihoods(6))), (10, len(changes.terms)))
        assert (changes.terms[int(c)].label[0], row) == ("latency", 4)


def test_no_two_effects_of_a_run_undo_each_other() -> None:
    """A latency of 300 bounds, and packets whose slope in that run differs from the latency's by
    one in a hundred, where another day's log is not quite linear: the two would be huge, of either
    sign.  One of them is told, by what it is."""
    rare = registry()["packetised_timestamps"].slopes()[0].name
    labels = (LABELS[0], ("packetised_timestamps", "position", 0, rare))
    rng = np.random.default_rng(21)
    runs = []
    for k in range(9):
        columns = np.repeat(rng.standard_normal((64, 1)) / 1e-3, 2, axis=1)
        columns[:, 1] *= 1.0 + 1e-2 * rng.standard_normal(64)
        curved = 0.25 * (columns[:, 1] - columns[:, 0])  # of second order: 250 ms of either sign
        y = columns[:, 0] * 300.0 * BOUND[0] * (k == 4) + curved * (k == 4)
        y = y + rng.standard_normal(64)
        normal = columns.T @ columns
        runs.append(Sufficient(labels, normal, columns.T @ y, float(y @ y), normal / 64.0, ()))
    (one,) = strangers(Changes(pool_of(runs, range(9))))
    (departure,) = one.departures
    assert departure.judged.values[0] == pytest.approx(300.0 * BOUND[0], rel=0.02)


def test_several_changes_of_one_day_are_told_once_each_with_their_uncertainty(
    tmp_path: Path,
) -> None:
    """Latency by 40 bounds and the datum's north by -30, columns of cosine 0.6: what one leaves is
    no change of its own, and (told - true) / uncertainty scatters by one."""
    off = []
    for seed in range(40):
        rng = np.random.default_rng([10, seed])
        moved = np.array([40.0, 0, -30.0, 0, 0]) * BOUND
        runs = [run_of(statistics(rng, moved * (k >= 6), 0.6), k) for k in range(9)]
        entries = tuple(
            Entry(k + 1, f"#{k + 1}", run, run.statistics(), f"{k:064d}")
            for k, run in enumerate(runs)
        )
        stored = Stored(tmp_path, "car", {}, entries, (), {}, (), 0, "", b"")
        seen = ComparedRuns(stored, entries, float(np.log(20.0))).seen
        assert len({(one.change.term.label, one.change.k) for one in seen}) == len(seen)
        assert {one.change.term.label[0] for one in seen} == {"latency", "datum_offset"}
        true = {"latency_s": moved[0], "north_m": moved[2]}
        for one in seen:
            names = [p.name for p in one.change.term.effect.slopes()]
            error = one.change.values - [true.get(name, 0.0) for name in names]
            off += list(error / np.sqrt(np.diag(one.change.covariance)))
    assert 0.75 < float(np.sqrt(np.mean(np.square(off)))) < 1.2


def test_an_odd_run_among_runs_that_drift_is_told_by_what_it_has(
    spec: Path, tmp_path: Path
) -> None:
    """A latency that drifts by 4 bounds a run from run 2 on, and run 5 another vehicle's: latency
    -40 bounds off that line, range bias 25.  The run is told so, by its own figures, and the drift
    with its rate by run, the odd one counted as one."""
    off = []
    for seed in range(6):
        rng = np.random.default_rng([26, seed])
        base = 20.0 * BOUND * rng.standard_normal(len(LABELS))
        runs = []
        for k in range(9):
            moved = np.array([4.0 * k, 0, 0, 0, 0]) + (k == 4) * np.array([-40.0, 25.0, 0, 0, 0])
            runs.append(run_of(statistics(rng, base + moved * BOUND, 0.9), k))
        found = told(spec, kept(spec, tmp_path, runs), tmp_path, 1)
        assert {one["number"] for one in found["unlike"]} == {5}
        assert {one["effect"] for one in found["unlike"]} == {"latency", "range_bias"}
        for one, true in zip(sorted(found["unlike"], key=lambda one: one["effect"]),
                             (-40.0 * BOUND[0], 25.0 * BOUND[1]), strict=True):  # fmt: skip
            (own,) = one["differs"].values()
            off.append((own["value"] - true) / own["standard_uncertainty"])
        (alarm,) = found["alarms"]
        assert alarm["effect"] == "latency"
        rate, sigma = (alarm["drift"][key] for key in ("per_run", "standard_uncertainty"))
        assert abs(rate - 4.0 * BOUND[0]) < 4.0 * sigma
        assert alarm["change"] == pytest.approx((9 - alarm["since"]["run"] + 1) * rate)
        (tmp_path / "store.jsonl").unlink()
    assert max(map(abs, off)) < 4.0


def test_a_weaker_effect_of_the_same_day_is_told_beside_the_first(tmp_path: Path) -> None:
    """A latency by 40 bounds, and the range bias by 7 with the same run, three runs before it and
    three from it on: too little to ring by itself, as it may be scatter; that day had a change."""
    told_too = 0
    for seed in range(12):
        rng = np.random.default_rng([23, seed])
        moved = np.array([40.0, 7.0, 0, 0, 0]) * BOUND
        runs = [run_of(statistics(rng, moved * (k >= 3)), k) for k in range(6)]
        entries = tuple(
            Entry(k + 1, f"#{k + 1}", run, run.statistics(), f"{k:064d}")
            for k, run in enumerate(runs)
        )
        stored = Stored(tmp_path, "car", {}, entries, (), {}, (), 0, "", b"")
        seen = {s.change.term.label[0]: s for s in ComparedRuns(stored, entries, 3.0).seen}
        assert "latency" in seen
        assert set(seen) <= {"latency", "range_bias"}
        told_too += "range_bias" in seen
    assert told_too == 12


def test_two_effects_of_one_day_are_not_told_as_a_third() -> None:
    """A latency and a range bias that moved together, and a datum's offset whose north is nearly
    the one and whose east nearly the other: one effect of three values does it almost as well.
    Where the two explain clearly more they are told, and the datum's offset is not."""
    mixed = np.eye(len(LABELS))
    north, east = LABELS.index(LABELS[2]), LABELS.index(LABELS[3])
    mixed[0, north], mixed[1, east] = 0.98, 0.98
    mixed[north, north] = mixed[east, east] = np.sqrt(1.0 - 0.98**2)
    right = 0
    for seed in range(15):
        rng = np.random.default_rng([25, seed])
        moved = np.array([22.0, 22.0, 0, 0, 0]) * BOUND
        runs = []
        for k in range(9):
            columns = rng.standard_normal((64, len(LABELS))) @ mixed / UNITS
            y = columns @ (moved * (k >= 5)) + rng.standard_normal(64)
            normal = columns.T @ columns
            runs.append(Sufficient(LABELS, normal, columns.T @ y, float(y @ y), normal / 64.0, ()))
        told_of = seen_changes(Changes(pool_of(runs, range(9))), 6, 3.0)
        names = sorted(one.change.term.label[0] for one in told_of)
        right += names == ["latency", "range_bias"]
        assert len(names) == len(set(names))
        for one in told_of if names == ["latency", "range_bias"] else ():
            true = 22.0 * BOUND[0 if one.change.term.label[0] == "latency" else 1]
            assert abs(one.change.values[0] - true) < 4.5 * one.change.covariance[0, 0] ** 0.5
            assert one.change.k == 5
    assert right >= 13


def test_what_would_do_as_well_is_said_of_a_run_and_of_what_scatters(
    spec: Path, tmp_path: Path
) -> None:
    """Latency and the datum's north of cosine 0.995: neither a run by itself nor scatter tells them
    apart, and the words say so, once for both."""
    rng = np.random.default_rng(24)
    moved = np.array([25.0, 0, 0, 0, 0]) * BOUND
    runs = [run_of(statistics(rng, moved * (k == 5), 0.995), k) for k in range(9)]
    store = kept(spec, tmp_path, runs)
    found = told(spec, store, tmp_path, 1)
    (one,) = found["unlike"]
    names = {one["effect"], *(other["effect"] for other in one["aliases"])}
    assert names == {"latency", "datum_offset"}
    assert found["alarms"][0]["aliases"] == one["aliases"]
    said = " ".join(watch(store, spec).output.split())
    assert f"or as well {one['aliases'][0]['effect'].replace('_', ' ')}" in said
    store.unlink()
    scattered = rng.standard_normal(12) * 8.0
    runs = [run_of(statistics(rng, np.array([v, 0, 0, 0, 0]) * BOUND, 0.995), k)
            for k, v in enumerate(scattered)]  # fmt: skip
    words = [w for w in told(spec, kept(spec, tmp_path, runs), tmp_path, 0)["cautions"]
             if "another value in every run" in w]  # fmt: skip
    assert len(words) == 1
    assert "latency (position)" in words[0]
    assert "datum offset (target)" in words[0]


def test_a_run_beyond_the_platforms_limits_is_said_until_it_is_left_out(
    spec: Path, tmp_path: Path
) -> None:
    """With the same effects as all others it is no change, and no all-clear either."""
    runs = with_odd(11, 6, 2, 0.0 * OTHER)
    runs[2] = replace(runs[2], checks=(FAST,), left_material=True)
    store = kept(spec, tmp_path, runs)
    found = told(spec, store, tmp_path, 0)
    (said,) = found["cautions"]
    assert said.startswith(f"run 3 (day2.csv): {FAST.message}")
    assert "--leave-out 3" in said
    assert [bool(run.get("checks")) for run in found["runs"]] == [k == 2 for k in range(6)]
    out = " ".join(watch(store, spec).output.split())
    assert "? Nothing seen to change, but run 3 is beyond the platform's limits" in out
    assert watch(store, spec, "--require-informative").exit_code == 3
    assert watch(store, "--leave-out", "3", "--reason", "a truck's").exit_code == 0
    assert "beyond the platform's limits" not in watch(store, spec).output


def test_a_log_of_a_faster_vehicle_keeps_what_it_exceeds(tmp_path: Path) -> None:
    """A fixed wing read with the spec of a multirotor: 24 m/s and 110 m, not 9 and 40."""
    slow, fast = (make_log(scenario(name, 5051, 20.0, 5.0), ())
                  for name in ("multirotor_lines", "fixed_wing_circuits"))  # fmt: skip
    spec = tmp_path / "spec.yaml"
    spec.write_text(slow.spec_yaml(), encoding="utf-8")
    run = run_of_log(load(spec), [fast.to_csv(tmp_path / "fast.csv")], DiagnosisSettings())
    assert {check.code for check in run.checks or ()} == {"speed", "range"}
    assert all(check.value > check.limit for check in run.checks or ())


@pytest.mark.parametrize(("bare", "said"), [((3,), True), ((), False), (tuple(range(6)), False)])
def test_a_run_without_a_date_among_dated_ones_is_named(
    bare: tuple[int, ...], said: bool, spec: Path, tmp_path: Path
) -> None:
    runs = with_odd(12, 6, 2, 0.0 * OTHER)
    runs = [replace(run, first_s=5.0, date=None) if k in bare else run
            for k, run in enumerate(runs)]  # fmt: skip
    found = told(spec, kept(spec, tmp_path, runs), tmp_path, 0)
    assert found["ordered_by"] == ("adding" if bare else "date")
    words = [one for one in found["cautions"] if "has no date" in one]
    assert [one.startswith("run 4 (day3.csv) has no date") for one in words] == [True] * said


def test_rows_that_a_run_lost_are_said(spec: Path, tmp_path: Path) -> None:
    """Half of the last run's rows have no time: what they would tell is missing."""
    runs = with_odd(13, 4, 2, 0.0 * OTHER)
    runs[3] = replace(runs[3], rows=128, rejected={"no time stamp": 64})
    runs[2] = replace(runs[2], rows=66, rejected={"no time stamp": 2})
    for count, said in ((3, []), (4, ["of 128 rows of run 4 (day3.csv) 64 were left out (no time "
                                      "stamp: 64): it tells of the others alone"])):  # fmt: skip
        store = kept(spec, tmp_path, runs[:count])
        assert told(spec, store, tmp_path, 0)["cautions"] == said
        store.unlink()


def test_two_strange_runs_are_both_named_and_left_out(spec: Path, tmp_path: Path) -> None:
    """One by 20 bounds and the next by as much to the other side: neither is a change undone."""
    runs = with_odd(14, 6, 3)
    rng = np.random.default_rng(14)
    base = 20.0 * BOUND * rng.standard_normal(len(LABELS))
    rng = np.random.default_rng(140)
    runs[4] = run_of(statistics(rng, base - OTHER), 4)
    runs += [run_of(statistics(rng, base), k) for k in range(6, 10)]
    store = kept(spec, tmp_path, runs)
    assert {one["number"] for one in told(spec, store, tmp_path, 1)["unlike"]} == {4, 5}
    said = " ".join(watch(store, spec).output.split())
    assert "Runs 4 and 5 are unlike the others" in said
    assert "--leave-out N --reason TEXT counts each of these runs no more" in said
    for run in ("4", "5"):
        assert watch(store, "--leave-out", run, "--reason", "another vehicle").exit_code == 0
    told(spec, store, tmp_path, 0)
