"""A system watched over time: the alarm and its date, the store, what is refused."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

import syncline_design as sd
from syncline_design.campaign.changes import Changes
from syncline_design.campaign.kept import NamedAlone, date_of
from syncline_design.campaign.pool import pool_of
from syncline_design.campaign.store import Stored, add_looks, add_run, demand_new, read_store
from syncline_design.campaign.watch_result import Watch
from syncline_design.campaign.watching import Watching, WatchRequest
from syncline_design.diagnosis.system import pinned_system
from syncline_design.spec.load import BadInput, load
from tests.world import make_log, scenario
from watched_series import (
    BOUND,
    DAY,
    FIRST,
    LABELS,
    car_spec,
    kept,
    run_of,
    series,
    statistics,
    told,
    watch,
)


@pytest.fixture(scope="module")
def spec(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return car_spec(tmp_path_factory.mktemp("watch") / "spec.yaml")


def test_ten_days_ring_on_the_day_of_the_change(spec: Path, tmp_path: Path) -> None:
    change = np.array([9.0, 0, 0, 0, 0]) * BOUND
    found = series(11, 10, change, 6)
    store, codes = tmp_path / "store.jsonl", []
    case = load(spec)
    for day, one in enumerate(found):
        add_run(store, "car", pinned_system(case), run_of(one, day))
        codes.append(watch(store, spec, "-q").exit_code)
    assert codes == [0] * 6 + [1] * 4
    document = told(spec, store, tmp_path, 1)
    (alarm,) = document["alarms"]
    assert (alarm["effect"], alarm["sensor"]) == ("latency", "position")
    assert alarm["parameter"] == "latency_s"
    assert alarm["since"]["run"] == 7
    assert alarm["since"]["file"] == "day6.csv"
    assert alarm["since"]["date"] == date_of(FIRST + 6 * DAY)
    assert alarm["since"]["low"] <= 7 <= alarm["since"]["high"]
    assert alarm["first_run"] == 7
    low, high = alarm["interval95"]
    assert low < change[0] < high
    page = (tmp_path / "watch.html").read_text("utf-8")
    assert "fig-courses" in page
    assert "fig-evidence" in page


def test_fewer_than_three_runs_are_no_all_clear(spec: Path, tmp_path: Path) -> None:
    """Neither at first nor after a new baseline, and not where the runs differ plainly."""
    case, store, words = load(spec), tmp_path / "store.jsonl", []
    for day, one in enumerate(series(11, 3, np.array([9.0, 0, 0, 0, 0]) * BOUND, 1)):
        add_run(store, "car", pinned_system(case), run_of(one, day))
        words.append(watch(store, spec).output)
    for count, said in enumerate(words[:2], 1):
        assert f"Too few runs to tell ({count} of 3)" in said
        assert "even a large change may not ring yet" in " ".join(said.split())
        assert "Nothing changed" not in said
    assert "Too few runs" not in words[2]
    assert watch(store, "--accept").exit_code == 0
    assert "Too few runs to tell (0 of 3)" in watch(store, spec).output


def looked(spec: Path, store: Path) -> Stored:
    """What `watch` keeps of its looks when it adds a run."""
    stored = read_store(store)
    assert stored is not None
    return add_looks(stored, Watching(load(spec), WatchRequest(store), stored, 0).fresh)


def counted(spec: Path, store: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[int, Watch]:
    """How many looks are computed for an answer, and the answer."""
    seen: list[int] = []
    own = Changes.log_evidence

    def counting(self: Changes, look: int) -> tuple[float, np.ndarray]:
        seen.append(look)
        return own(self, look)

    with monkeypatch.context() as patch:
        patch.setattr(Changes, "log_evidence", counting)
        answer = Watching(load(spec), WatchRequest(store), read_store(store), 0).told(0)
    return len(seen), answer


def test_what_earlier_looks_found_is_kept(
    spec: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Day by day is the same as all at once, by as many looks as days and not by their square."""
    found = series(18, 12, np.array([9.0, 0, 0, 0, 0]) * BOUND, 8)
    (tmp_path / "once").mkdir()
    once = kept(spec, tmp_path / "once", [run_of(one, day) for day, one in enumerate(found)])
    whole, fresh = counted(spec, once, monkeypatch)
    days = tmp_path / "store.jsonl"
    for day, one in enumerate(found):
        add_run(days, "car", pinned_system(load(spec)), run_of(one, day))
        computed, answer = counted(spec, days, monkeypatch)
        looked(spec, days)
        assert computed <= 4  # one kept, the new one, and two to say what changed
    assert whole >= 11
    assert [a.since.run for a in answer.alarms] == [a.since.run for a in fresh.alarms] == [9]
    for own, other in zip(answer.runs[1:], fresh.runs[1:], strict=True):
        assert own.e_value == pytest.approx(other.e_value, rel=1e-6)
    # a run before the others is another history: all looks after it are computed again
    late = replace(
        run_of(series(18, 13, 0.0 * BOUND, 99)[12], 0), first_s=FIRST - DAY, sha256="f" * 64
    )
    add_run(days, "car", pinned_system(load(spec)), late)
    computed, answer = counted(spec, days, monkeypatch)
    assert computed >= 12
    assert [a.since.file for a in answer.alarms] == ["day8.csv"]


def test_a_look_that_its_runs_do_not_bear_out_is_not_believed(spec: Path, tmp_path: Path) -> None:
    """In a chain made anew, too: every call computes one of the looks again."""
    found = series(11, 8, np.array([9.0, 0, 0, 0, 0]) * BOUND, 6)
    store = kept(spec, tmp_path, [run_of(one, day) for day, one in enumerate(found)])
    stored = looked(spec, store)
    true = [*stored.looks.values()]
    calm = [replace(one, log_evidence=-1.0) if k >= 6 else one for k, one in enumerate(true)]
    assert true[-1].log_evidence > np.log(20.0)
    add_looks(
        stored, [replace(calm[0], log_evidence=-1.0), *calm[1:]]
    )  # of 8 runs the first's turn
    document = told(spec, store, tmp_path, 1)
    assert "computed anew" in document["cautions"][0]
    assert document["alarms"][0]["since"]["run"] == 7
    looked(spec, store)  # the next run puts it right
    assert not told(spec, store, tmp_path, 1)["cautions"]


@pytest.mark.browser
def test_an_accepted_change_is_the_new_baseline(spec: Path, tmp_path: Path) -> None:
    found = series(12, 12, np.array([9.0, 0, 0, 0, 0]) * BOUND, 4)
    store = kept(spec, tmp_path, [run_of(one, day) for day, one in enumerate(found[:8])])
    assert watch(store, spec).exit_code == 1
    assert "accept" in watch(store, spec).output
    assert watch(store, "--accept").exit_code == 0
    assert watch(store, spec).exit_code == 0
    for day in range(8, 12):
        add_run(store, "car", pinned_system(load(spec)), run_of(found[day], day))
    document = told(spec, store, tmp_path, 0)
    assert document["baseline_after"] == 8
    assert [run["baseline"] for run in document["runs"]] == [1] * 8 + [2] * 4


def test_runs_are_ordered_by_date_where_all_have_one(spec: Path, tmp_path: Path) -> None:
    """The same alarm, whatever the order of adding; without dates that order counts."""
    found = series(13, 9, np.array([0, 9.0, 0, 0, 0]) * BOUND, 5)
    turned = [3, 8, 0, 5, 1, 7, 2, 6, 4]
    since = []
    for order, date in ((range(9), True), (turned, True), (range(9), False)):
        folder = tmp_path / f"{order}{date}"
        folder.mkdir()
        store = kept(spec, folder, [run_of(found[d], d, date) for d in order])
        document = told(spec, store, folder, 1)
        assert document["ordered_by"] == ("date" if date else "adding")
        since.append(document["alarms"][0]["since"]["file"])
        listed = watch(store, spec).stdout.split("\nRuns\n")[1].split("What this rests on")[0]
        shown = [int(day) for day in re.findall(r"day(\d)\.csv", listed)]
        assert shown == (sorted(order) if date else list(order))
    assert since == ["day5.csv"] * 3


def test_a_change_that_was_undone_is_told_as_both(spec: Path, tmp_path: Path) -> None:
    """Fourteen bounds in runs 5 and 6 of 12 alone: since 5 so much, and since 7 as much less."""
    base, moved = 20.0 * BOUND, np.array([14.0, 0, 0, 0, 0]) * BOUND
    for seed in range(4):
        rng = np.random.default_rng(100 + seed)
        found = [statistics(rng, base + moved * (k in (4, 5))) for k in range(12)]
        store = kept(spec, tmp_path, [run_of(one, day) for day, one in enumerate(found)])
        up, down = told(spec, store, tmp_path, 1)["alarms"]
        assert [a["effect"] for a in (up, down)] == ["latency", "latency"]
        assert [a["since"]["run"] for a in (up, down)] == [5, 7]
        assert up["change"] == pytest.approx(14.0 * BOUND[0], rel=0.35)
        assert down["change"] == pytest.approx(-14.0 * BOUND[0], rel=0.35)
        store.unlink()


def test_what_differs_from_run_to_run_is_said(spec: Path, tmp_path: Path) -> None:
    """Twenty bounds to and fro with every run: no change, but no one value either."""
    rng = np.random.default_rng(31)
    base = 20.0 * BOUND * rng.standard_normal(len(LABELS))
    off = np.array([10.0, 0, 0, 0, 0]) * BOUND
    found = [statistics(rng, base + (off if k % 2 else -off)) for k in range(12)]
    store = kept(spec, tmp_path, [run_of(one, day) for day, one in enumerate(found)])
    (said,) = told(spec, store, tmp_path, 0)["cautions"]
    assert said.startswith("latency (position) of car has another value in every run")
    size, unit = said.split("differ by ")[1].split()[:2]
    spread = float(np.std([-10.0, 10.0] * 6, ddof=1)) * BOUND[0]
    assert unit in ("ms", "us", "µs")
    assert float(size) * (1e-3 if unit == "ms" else 1e-6) == pytest.approx(spread, rel=0.25)
    quiet = [statistics(rng, base) for _ in range(12)]
    store.unlink()
    store = kept(spec, tmp_path, [run_of(one, day) for day, one in enumerate(quiet)])
    assert told(spec, store, tmp_path, 0)["cautions"] == []


def test_a_run_of_the_time_of_another_is_refused(spec: Path, tmp_path: Path) -> None:
    """A part of a run that is there already, or another logger's: of one minute are ten seconds of
    which another run is; without a calendar nobody can tell."""
    first, second = series(23, 2, 0.0 * BOUND, 9)
    for date in (True, False):
        begun = run_of(first, 0, date)
        store = kept(spec, tmp_path, [begun])
        stored = read_store(store)
        assert stored is not None
        for later_s, fits in ((55.0, True), (50.0, False), (-50.0, False), (60.0, True)):
            other = replace(run_of(second, 1, date), first_s=begun.first_s + later_s)
            if fits or not date:
                demand_new(stored, other, store)
                continue
            with pytest.raises(BadInput, match=r"day1.csv is of the same time as run 1"):
                demand_new(stored, other, store)
        store.unlink()


@pytest.mark.parametrize(("bounds", "seed", "rang"), [(2.5, 203, 8), (3.8, 300, 8)])
def test_an_alarm_stays_when_earlier_days_come_in(
    spec: Path, tmp_path: Path, bounds: float, seed: int, rang: int
) -> None:
    """A day that is added late weakens what later ones told; what rang rings until it is accepted.
    Seeds that were searched for: alarms near the limit, in days that come in to and fro."""
    order = (0, 1, 7, 2, 8, 3, 9, 4, 5, 6)
    found = series(seed, 10, np.array([bounds, 0, 0, 0, 0]) * BOUND, 7)
    store = kept(spec, tmp_path, [run_of(found[day], day) for day in order[:rang]])
    looked(spec, store)
    assert told(spec, store, tmp_path, 1)["alarms"][0]["first_run"] <= rang
    add_run(store, "car", pinned_system(load(spec)), run_of(found[order[rang]], order[rang]))
    looked(spec, store)
    document = told(spec, store, tmp_path, 1)
    assert all((one["e_value"] or 0.0) < 20.0 for one in document["runs"])
    assert document["alarms"][0]["first_run"] == rang


def test_two_changes_are_two_alarms(spec: Path, tmp_path: Path) -> None:
    found = series(14, 6, 0.0 * BOUND, 9)
    rng = np.random.default_rng(15)
    base = 20.0 * BOUND * np.random.default_rng(14).standard_normal(len(LABELS))
    first, both = (np.array(v) * BOUND for v in ([12.0, 0, 0, 0, 0], [12.0, 12.0, 0, 0, 0]))
    found += [statistics(rng, base + first) for _ in range(3)]
    found += [statistics(rng, base + both) for _ in range(3)]
    store = kept(spec, tmp_path, [run_of(one, day) for day, one in enumerate(found)])
    alarms = {a["effect"]: a["since"]["run"] for a in told(spec, store, tmp_path, 1)["alarms"]}
    assert alarms == {"latency": 7, "range_bias": 10}
    drawn = sd.watch(store, spec)._repr_html_() or ""  # as a notebook asks
    named = [drawn.count(f"day{day}.csv") for day in range(12)]
    assert min(named[6], named[9]) > max(named[:6])  # where the changes began is told besides
    assert "<svg" in drawn
    assert "<script" not in drawn


def test_what_differs_from_run_to_run_does_not_ring_for_ever(spec: Path, tmp_path: Path) -> None:
    """A bias drawn anew for every run is no change, once enough runs have shown it."""
    rung = 0
    for seed in range(10):
        rng = np.random.default_rng(700 + seed)
        draws = [np.array([0, 3.0 * rng.standard_normal(), 0, 0, 0]) * BOUND for _ in range(20)]
        quiet = [statistics(rng, 0.1 * draw) for draw in draws[:8]]
        found = quiet + [statistics(rng, 0.3 * draw) for draw in draws[8:]]
        changes = Changes(pool_of(found, range(20)))
        rung += changes.log_evidence(20)[0] >= np.log(20.0)
    assert rung <= 2


def test_a_convention_that_is_another_rings(spec: Path, tmp_path: Path) -> None:
    found = series(16, 4, 0.0 * BOUND, 9)
    word = NamedAlone(
        "frame_convention", "attitude", "car", "Axes of attitude are east-north-up", True
    )
    runs = [run_of(one, day, named=(word,) if day > 2 else ()) for day, one in enumerate(found)]
    (alarm,) = told(spec, kept(spec, tmp_path, runs), tmp_path, 1)["alarms"]
    assert (alarm["effect"], alarm["change"], alarm["since"]["run"]) == (
        "frame_convention",
        None,
        4,
    )
    assert alarm["words"] == "Axes of attitude are east-north-up"


def test_what_is_refused(spec: Path, tmp_path: Path) -> None:
    store = tmp_path / "none.jsonl"
    for arguments, words in (
        ((store, spec), "no runs yet"),
        ((store,), "found no SPEC"),
        ((store, "--accept"), "no runs to accept"),
        ((spec, spec), "spec.yaml:1:1"),
        ((tmp_path, spec), "cannot read the store"),
        ((tmp_path / "mistyped" / "store.jsonl", spec), "there is no folder"),
    ):
        found = watch(*arguments)
        assert found.exit_code == 2, found.output
        assert words in found.output + found.stderr
    assert not store.exists()
    assert not (tmp_path / "mistyped").exists()


def at_calendar_times(path: Path, begun: datetime) -> None:
    """The log with ISO 8601 times from a moment (UTC) on instead of seconds."""
    head, *rows = path.read_text(encoding="utf-8").splitlines()
    names = head.split(",")
    at = names.index("time_s")
    cells = [row.split(",") for row in rows]
    first = float(cells[0][at])
    names[at] = "time"
    for row in cells:
        moment = begun + timedelta(seconds=float(row[at]) - first)
        row[at] = moment.isoformat(timespec="microseconds") + "Z"
    path.write_text("\n".join(map(",".join, [names, *cells])) + "\n", encoding="utf-8")


def test_a_real_run_end_to_end(spec: Path, tmp_path: Path) -> None:
    """Two logs of one vehicle, the later one first, with calendar times; the second under another
    name again is refused."""
    for k in range(2):
        log = make_log(scenario("multirotor_lines", 4 + k, 30.0, 5.0), ())
        at_calendar_times(
            log.to_csv(tmp_path / f"run{k}.csv"), datetime(2026, 10, 2 - k, 23, 59, 50)
        )
        (tmp_path / "spec.yaml").write_text(log.spec_yaml(), encoding="utf-8")
    store, own = tmp_path / "store.jsonl", tmp_path / "spec.yaml"
    for k in range(2):
        found = watch(store, own, tmp_path / f"run{k}.csv")
        assert found.exit_code == 0, found.output + found.stderr
        assert ("A new store, begun with this run" in found.output) == (k == 0)
    kinds = [json.loads(line)["body"]["kind"] for line in store.read_text("utf-8").splitlines()]
    assert kinds == ["store", "run", "looks", "run", "looks"]
    before = store.read_bytes()
    assert watch(store, own).exit_code == 0
    assert store.read_bytes() == before  # who looks again leaves it as it is
    document = told(own, store, tmp_path, 0)
    assert document["ordered_by"] == "date"
    assert [(one["files"], one["date"]) for one in document["runs"]] == [
        (["run0.csv"], "2026-10-02T23:59:50Z"),
        (["run1.csv"], "2026-10-01T23:59:50Z"),
    ]
    (tmp_path / "again.csv").write_bytes((tmp_path / "run1.csv").read_bytes() + b"\n")
    found = watch(store, own, tmp_path / "again.csv")
    assert found.exit_code == 2
    assert "in the store already, as number 2" in found.output + found.stderr


def test_a_noisier_run_is_a_caution(spec: Path, tmp_path: Path) -> None:
    found = series(17, 4, 0.0 * BOUND, 9)
    runs = [run_of(one, day) for day, one in enumerate(found)]
    runs[3] = replace(runs[3], white_factor={"car/position": 2.5})
    document = told(spec, kept(spec, tmp_path, runs), tmp_path, 0)
    assert document["cautions"] == ["noise of car, position in run 4 is 2.5 times that of the "
                                    "runs before"]  # fmt: skip


def test_what_a_change_moves_along_is_not_said_to_differ(spec: Path, tmp_path: Path) -> None:
    """Sixty bounds of latency from run 6 on: nothing else is another in every run."""
    for seed in range(3):
        rng = np.random.default_rng(300 + seed)
        build = 20.0 * BOUND * rng.standard_normal(len(LABELS))
        moved = np.array([60.0, 0, 0, 0, 0]) * BOUND
        found = [statistics(rng, build + moved * (k >= 5), 0.9) for k in range(10)]
        store = kept(spec, tmp_path, [run_of(one, day) for day, one in enumerate(found)])
        document = told(spec, store, tmp_path, 1)
        assert [one["effect"] for one in document["alarms"]] == ["latency"]
        assert document["cautions"] == []
        store.unlink()


@pytest.mark.parametrize(("days", "odd"), [(358, True), (5, False)])
def test_a_date_long_before_all_others_is_asked_about(
    days: int, odd: bool, spec: Path, tmp_path: Path
) -> None:
    """A clock that is a year behind puts the newest run first; an earlier day may come in late."""
    found = series(11, 6, np.array([9.0, 0, 0, 0, 0]) * BOUND, 5)
    runs = [run_of(one, day) for day, one in enumerate(found[:5])]
    runs.append(run_of(found[5], -days))
    every = told(spec, kept(spec, tmp_path, runs), tmp_path, 1)["cautions"]
    said = [one for one in every if "is dated" in one]
    assert [one.startswith("run 6 (day-358.csv) is dated 2025-") for one in said] == [True] * odd
    assert all("358 days before all that were added before it" in one for one in said)


@pytest.mark.parametrize(("driven", "still"), [(0, 1.0), (1, 1.0), (10, 1.0), (10, 0.9995)])
def test_runs_at_rest_are_no_all_clear(
    driven: int, still: float, spec: Path, tmp_path: Path
) -> None:
    """Parked for three days: a latency of any size could hide, and the store stays whole; the
    noise of its velocities makes that of any size below a second."""
    rng, store = np.random.default_rng(41), tmp_path / "store.jsonl"
    for day in range(driven + 3):
        found = statistics(rng, 0.0 * BOUND, still=still * (day >= driven))
        add_run(store, "car", pinned_system(load(spec)), run_of(found, day))
        looked(spec, store)
    document = told(spec, store, tmp_path, 0)
    assert not document["informative"]["ok"]
    blind = {(b["effect"], b["sensor"]): b for b in document["informative"]["blind_to"]}
    least = blind["latency", "position"]["smallest_seen"]
    assert (least is None) == (still == 1.0)
    said = " ".join(watch(store, spec).output.split())
    assert f"? Nothing seen to change, but run {driven + 3} shows no " in said
    shown = "delay at all" if least is None else f"latency (position) below {least:.1f} s"
    assert f"shows no {shown}" in said
    assert "it is blind to" in said
    assert watch(store, spec, "--require-informative").exit_code == 3
    add_run(store, "car", pinned_system(load(spec)), run_of(statistics(rng, 0.0 * BOUND), 20))
    document = told(spec, store, tmp_path, 0)
    assert "latency" not in {b["effect"] for b in document["informative"]["blind_to"]}
    assert "shows no" not in watch(store, spec).output
