"""A system watched over time: the evidence, the alarm and its date, the store, the page.

Oracles: Bayes factors by the dense normal density of scipy, and counting.
"""

from __future__ import annotations

import itertools
import json
import re
from dataclasses import replace
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from jsonschema import Draft202012Validator
from scipy.stats import multivariate_normal
from typer.testing import CliRunner, Result

import syncline_design as sd
from browsing import flaws_of
from html_page import Page
from syncline_design.campaign.changes import REACH, Changes, weight_of
from syncline_design.campaign.kept import NamedAlone, Run, date_of, statistics_of
from syncline_design.campaign.pool import pool_of
from syncline_design.campaign.scatter import APART, DIFFERING, log_odds_apart
from syncline_design.campaign.store import Stored, add_looks, add_run, demand_new, read_store
from syncline_design.campaign.watch_result import Watch
from syncline_design.campaign.watching import Watching, WatchRequest
from syncline_design.cli.app import app
from syncline_design.diagnosis.sufficient import Less, Sufficient
from syncline_design.diagnosis.system import pinned_system
from syncline_design.effects import registry
from syncline_design.report.result_schemas import result_schema
from syncline_design.spec.load import BadInput, load
from tests.world import make_log, scenario

LABELS = (
    ("latency", "position", 0, "latency_s"),
    ("range_bias", "ranging", 0, "bias_m"),
    ("datum_offset", "target", 0, "north_m"),
    ("datum_offset", "target", 0, "east_m"),
    ("datum_offset", "target", 0, "down_m"),
)
UNITS = np.array([1e-3, 1e-2, 1e-2, 1e-2, 1e-2])
ROWS, BLOCKS, DAY = 64, 8, 86_400.0
BOUND = UNITS / np.sqrt(ROWS)  # standard deviation of a parameter by one run, roughly
FIRST = 1.79e9


def statistics(rng: np.random.Generator, values: np.ndarray, alike: float = 0.0) -> Sufficient:
    """Of a linear log with unit noise; alike: cosine of latency and the datum's north."""
    columns = rng.standard_normal((ROWS, len(LABELS)))
    columns[:, 2] = alike * columns[:, 0] + np.sqrt(1.0 - alike**2) * columns[:, 2]
    columns /= UNITS
    whole = np.column_stack([columns, columns @ values + rng.standard_normal(ROWS)])
    total = whole.T @ whole
    less = np.array([total - part.T @ part for part in np.split(whole, BLOCKS)])
    return Sufficient(
        LABELS, total[:-1, :-1], total[:-1, -1], float(total[-1, -1]), total[:-1, :-1] / ROWS,
        (Less(less[:, :-1, :-1], less[:, :-1, -1], less[:, -1, -1]),),
    )  # fmt: skip


def run_of(
    found: Sufficient, day: int, date: bool = True, named: tuple[NamedAlone, ...] = ()
) -> Run:
    first = (FIRST if date else 0.0) + DAY * day
    return Run(
        (f"day{day}.csv",), f"{day:064d}", "georeference", first, date_of(first), 60.0, ROWS, ROWS,
        {}, "agrees", 0.0, False, 0.05, {"car/position": 1.0}, named, "0", **statistics_of(found),
    )  # fmt: skip


def series(seed: int, runs: int, change: np.ndarray, since: int) -> list[Sufficient]:
    rng = np.random.default_rng(seed)
    base = 20.0 * BOUND * rng.standard_normal(len(LABELS))  # of the build, whatever it is
    return [statistics(rng, base + (change if k >= since else 0.0)) for k in range(runs)]


def test_the_evidence_is_that_of_the_dense_normal_density() -> None:
    """Scores of all runs together, before and after the change is marginalised, over those where
    one effect after the other differs from run to run."""
    found = series(3, 6, np.array([4.0, 0, 0, 0, 0]) * BOUND, 4)
    changes = Changes(pool_of(found, range(6)))
    p = len(LABELS)
    normal = np.array([f.normal for f in found])
    # estimates of single runs are normal about their values with the inverse information
    values = np.concatenate([np.linalg.solve(f.normal, f.score) for f in found])
    cover = np.zeros((6 * p, 6 * p))
    for k in range(6):
        cover[k * p : (k + 1) * p, k * p : (k + 1) * p] = np.linalg.inv(normal[k])
    spread = np.full(p, 100.0) * BOUND  # narrow enough for dense matrices
    place = [LABELS.index(label) for label in changes.pool.labels]
    changes.__dict__["prior"] = spread[place] ** -2.0
    changes.__dict__["within"] = np.ones((6, len(changes.terms)))
    unit = np.tile(BOUND, 6)
    common = np.tile(np.diag(spread), (6, 1))
    null = cover + common @ common.T

    def density(covariance: np.ndarray) -> float:
        scaled = covariance / unit[:, None] / unit
        return float(multivariate_normal(np.zeros(6 * p), scaled).logpdf(values / unit))

    base = density(null)
    total, table = changes.log_evidence(6)
    whole = [np.log(1.0 - sum(weight_of(k + 1) for k in range(1, 6)))]
    for c, term in enumerate(changes.terms):
        own = [LABELS.index(changes.pool.labels[i]) for i in term.index]
        size = REACH * np.linalg.cholesky(np.linalg.inv(normal.mean(0)[np.ix_(own, own)]))
        for k in range(1, 6):
            column = np.zeros((6 * p, len(own)))
            for r in range(k, 6):
                column[[r * p + i for i in own]] = size
            other = density(null + column @ column.T)
            expected = np.log(weight_of(k + 1)) + changes.log_weights[c] + other - base
            assert table[k - 1, c] == pytest.approx(expected, abs=1e-3)
            whole.append(table[k - 1, c])
    apart = [0.0]
    for term in changes.terms:
        own = [LABELS.index(changes.pool.labels[i]) for i in term.index]
        usual = np.linalg.inv(normal.mean(0)[np.ix_(own, own)])
        for bounds, odds in zip(APART, log_odds_apart(len(changes.terms)), strict=True):
            other = null.copy()
            for r in range(6):
                at = [r * p + i for i in own]
                other[np.ix_(at, at)] += bounds**2 * usual
            apart.append(odds + density(other) - base)
    assert changes.doubt(6) == pytest.approx(float(np.logaddexp.reduce(apart)), abs=1e-3)
    assert changes.doubt(6) > 1.0  # the oracle is asked where there is something to say
    assert total == pytest.approx(float(np.logaddexp.reduce(whole)) - changes.doubt(6), abs=1e-9)


def test_odds_of_differing_are_shared_by_effects_and_sizes() -> None:
    odds = np.exp(log_odds_apart(40))
    assert 40.0 * odds.sum() == pytest.approx(DIFFERING)
    assert odds[0] / odds[1] == pytest.approx((APART[1] / APART[0]) ** 2)


def test_scatter_of_a_rare_effect_is_no_change_of_a_common_one() -> None:
    """Two that move runs almost alike, of which the rarer differs from run to run by two bounds.

    Of 40 series of 24 looks, 1.2 would ring at 3 %, more than 5 with a chance of 0.5 %.
    """
    rare = registry()["packetised_timestamps"].slopes()[0].name
    labels = (LABELS[0], ("packetised_timestamps", "position", 0, rare))
    rung = 0
    for seed in range(40):
        rng = np.random.default_rng([41, seed])
        runs = []
        for _ in range(25):
            size = 64.0 * np.exp(rng.normal(0.0, 1.0))  # how much a day's drive tells
            root = np.sqrt(size) * np.array([[1.0, 0.98], [0.0, 0.2]])
            value = np.array([0.0, 2.0 * rng.standard_normal() / 8.0])
            score = root.T @ (root @ value + rng.standard_normal(2))
            runs.append(Sufficient(labels, root.T @ root, score, 0.0, np.eye(2), ()))
        changes = Changes(pool_of(runs, range(25)))
        rung += any(changes.log_evidence(n)[0] >= np.log(20.0) for n in range(2, 26))
    assert rung <= 5


def test_one_day_far_off_rings_where_its_runs_agreed_and_not_where_they_do_not() -> None:
    """7.5 bounds off with run 7 of a series: e-value above 20 only where runs agreed before.

    In exact figures, of runs one bound apart in the mean square, and of runs that scatter three
    times as far; beside the latency the runs show every other effect that moves the mean as none.
    """
    calm = np.array([1.1, -0.9, 0.2, -1.3, 1.2, -0.3])
    effects = [e for e in registry().values() if e.sensitivity is not None and e.name != "latency"]
    every = [(e.name, e.sensors[0], 0, p.name) for e in effects for p in e.slopes()]
    labels = (LABELS[0], *every)
    first = np.eye(len(labels))[0]

    unit = np.eye(first.size)

    def evidence(before: np.ndarray, last: float) -> float:
        runs = [
            Sufficient(labels, np.eye(first.size) * 64e6, 64e6 * v * first, 0.0, unit, ())
            for v in np.array([*before, last]) * 1e-3 / 8.0
        ]
        return Changes(pool_of(runs, range(7))).log_evidence(7)[0]

    assert evidence(calm, 0.0) < 0.0
    assert evidence(calm, 7.5) > np.log(20.0)
    assert evidence(3.0 * calm, 7.5) < np.log(20.0)


def test_the_evidence_of_a_large_change_does_not_end() -> None:
    """20 bounds from the eleventh run on: every run says it again, however much was said before.

    log B is beyond the logarithm of the largest double (709) by the runs after the eighteenth; what
    differs from run to run is held against all of it.
    """
    change = np.array([20.0, 0, 0, 0, 0]) * BOUND
    changes = Changes(pool_of(series(4, 24, change, 10), range(24)))
    course = [changes.log_evidence(n)[0] for n in range(11, 25)]
    assert all(later > before > 0.0 for before, later in itertools.pairwise(course))
    place = [term.effect.name for term in changes.terms].index("latency")
    assert changes.change(24, 10, place).log_factor > 1000.0


def test_weights_of_all_runs_and_effects_share_the_false_alarms() -> None:
    assert sum(weight_of(k) for k in range(2, 200_000)) == pytest.approx(1.0, abs=0.01)
    assert weight_of(2) > weight_of(3) > weight_of(100) > 0.001
    changes = Changes(pool_of(series(1, 2, 0.0 * BOUND, 9), range(2)))
    share = {t.effect.name: np.exp(w) for t, w in zip(changes.terms, changes.log_weights,
                                                       strict=True)}  # fmt: skip
    assert sum(share.values()) == pytest.approx(1.0)
    assert share["latency"] > share["range_bias"] > share["datum_offset"]


def test_false_alarms_over_many_looks_and_the_delay() -> None:
    """60 quiet series of 25 looks at 5 %: more than 8 ring in 1 % of choices of seeds.

    A change of six bounds of one run is heard within two runs in most series.
    """
    rung = 0
    for seed in range(60):
        changes = Changes(pool_of(series(seed, 26, 0.0 * BOUND, 99), range(26)))
        rung += any(changes.log_evidence(n)[0] >= np.log(20.0) for n in range(2, 27))
    assert rung <= 8
    delays = []
    for seed in range(20):
        change = np.array([6.0, 0, 0, 0, 0]) * BOUND
        changes = Changes(pool_of(series(500 + seed, 16, change, 10), range(16)))
        looks = [n for n in range(2, 17) if changes.log_evidence(n)[0] >= np.log(20.0)]
        delays.append(looks[0] - 11 if looks else 99)
    assert float(np.median(delays)) <= 1.0


@pytest.fixture(scope="module")
def spec(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("watch") / "spec.yaml"
    log = make_log(scenario("car_stops", 4, 20.0, 5.0), ())
    path.write_text(log.spec_yaml(), encoding="utf-8")
    return path


def kept(spec: Path, folder: Path, runs: list[Run]) -> Path:
    store, case = folder / "store.jsonl", load(spec)
    for run in runs:
        add_run(store, "car", pinned_system(case), run)
    return store


def watch(*arguments: str | Path) -> Result:
    return CliRunner().invoke(app, ["watch", *map(str, arguments)])


def told(spec: Path, store: Path, folder: Path, code: int) -> dict:
    out, page = folder / "watch.json", folder / "watch.html"
    found = watch(store, spec, "-o", f"json:{out}", "-o", f"html:{page}")
    assert found.exit_code == code, found.output
    document = dict(json.loads(out.read_text("utf-8")))
    Draft202012Validator(result_schema("watch")).validate(document)
    return document


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
def test_its_page_is_sound(browser: object, spec: Path, tmp_path: Path) -> None:
    change = np.array([9.0, 0, 0, 0, 0]) * BOUND
    runs = [run_of(one, day) for day, one in enumerate(series(11, 5, change, 3))]
    path = tmp_path / "watch.html"
    watch(kept(spec, tmp_path, runs), spec, "-o", f"html:{path}")
    page = path.read_text("utf-8")
    assert "fig-courses-2" in page
    for label in ("syncline-design", "Spec, SHA-256", "Catalogs, SHA-256"):
        assert label in Page(page).text
    assert flaws_of(browser, path) == []


def test_the_courses_are_not_shifted_by_what_changed(spec: Path, tmp_path: Path) -> None:
    """A build with a datum that is off, of which the latency is moved by 30 bounds with run 7.

    Where the mean change is taken for the build's own, the datum's north, which moves runs nearly
    alike, is off by ten standard deviations on every day.  Of 50 values one is beyond 4.2 of them
    with a chance of 0.13 %.
    """
    rng, change = np.random.default_rng(51), 30.0 * BOUND[0]
    build = np.array([0, 0, 25.0, 0, -40.0]) * BOUND
    moved = build + np.array([change, 0, 0, 0, 0])
    found = [statistics(rng, moved if day >= 6 else build, 0.9) for day in range(10)]
    store = kept(spec, tmp_path, [run_of(one, day) for day, one in enumerate(found)])
    runs = told(spec, store, tmp_path, 1)["runs"]
    for (effect, _, _, name), true in zip(LABELS, build, strict=True):
        every = [v for run in runs for v in run["values"] if v["parameter"] == name]
        values, spread = (np.array([v[k] for v in every])
                          for k in ("value", "standard_uncertainty"))  # fmt: skip
        expected = true + np.where((np.arange(10) >= 6) & (effect == "latency"), change, 0.0)
        assert np.max(np.abs(values - expected) / spread) < 4.2, name


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


@pytest.mark.parametrize(("bounds", "seed", "rang"), [(2.5, 203, 8), (3.8, 212, 9)])
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
