"""A verdict of several missions against an earlier one: each mission is held against itself."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path
from xml.etree import ElementTree

import pytest

from syncline_design.comparison.diff_result import changes
from syncline_design.report.ci import notices
from syncline_design.report.csv_out import render_csv
from syncline_design.report.junit import render_junit
from syncline_design.report.on_verdict import on_verdict
from syncline_design.report.render_console import console
from syncline_design.report.sarif import render_sarif
from syncline_design.report.verdict_words import since_word
from syncline_design.verdict.baseline import against
from syncline_design.verdict.tree import Verdict
from syncline_design.verdict.verify import CheckSettings
from tests.checked import check_file

LOW = "{name: low & slow, stages: {uav: {distance: 10 m}}, requirements: {ACC-1: 0.05 m}}"
HIGH = "{name: high, stages: {uav: {distance: 60 m}}, requirements: {ACC-1: 0.20 m}}"
EXTRA = "{name: extra, stages: {uav: {distance: 30 m}}, requirements: {ACC-1: 0.08 m}}"
WORSE = HIGH.replace("60 m", "70 m")  # 0.2175 of 0.20 m, where it was 0.1919
BETTER = LOW.replace("10 m", "9 m")
SPEC = """syncline: 1
name: Missions
requirements:
  - {id: ACC-1, kind: accuracy, limit: 0.10 m}
  - {id: COST-1, kind: cost, limit: 60000 EUR}
stages:
  - name: uav
    platform: {use: uav_fixed_wing, distance: 20 m}
    position: {sensor: ublox_f9p_rtk, primitive: pps, timestamping: gpio}
    attitude: {sensor: sbg_apogee, primitive: pps, timestamping: gpio}
    ranging: {sensor: velodyne_hdl32e, primitive: pps, timestamping: gpio}
monte_carlo: {samples: 5000}
missions:
"""


def verdict_of(folder: Path, *missions: str, simulated: bool = False) -> Verdict:
    path = folder / "own.yaml"
    path.write_text(SPEC + "".join(f"  - {one}\n" for one in missions), encoding="utf-8")
    return check_file(path, CheckSettings(monte_carlo=simulated))


# missions then, missions now, exit code, what became of ACC-1 over all and in each
CASES = {
    "as before": ((LOW, HIGH), (LOW, HIGH), 0, {None: "same", "low & slow": "same"}),
    "another one got worse than the one nearest its limit": (
        (LOW, HIGH), (LOW, WORSE), 1, {None: "worse", "low & slow": "same", "high": "worse"},
    ),
    "the one nearest its limit got better, another worse": (
        (LOW, HIGH), (BETTER, WORSE), 1, {None: "worse", "low & slow": "better", "high": "worse"},
    ),
    "the one nearest its limit got better": (
        (LOW, HIGH), (BETTER, HIGH), 0, {None: "better", "low & slow": "better", "high": "same"},
    ),
    "a new one misses": (
        (LOW, HIGH), (LOW, HIGH, EXTRA), 1, {None: "worse", "high": "same", "extra": "new"},
    ),
    "a new one passes": (
        (LOW, HIGH), (LOW, HIGH, EXTRA.replace("0.08 m", "0.8 m")), 0,
        {None: "same", "high": "same", "extra": "new"},
    ),
    "one is gone": ((LOW, HIGH), (LOW,), 0, {None: "same", "low & slow": "same", "high": "gone"}),
}  # fmt: skip


@pytest.mark.parametrize(("old", "new", "code", "changes"), CASES.values(), ids=CASES.keys())
def test_each_mission_is_held_against_itself(
    tmp_path: Path,
    old: tuple[str, ...],
    new: tuple[str, ...],
    code: int,
    changes: dict[str | None, str],
) -> None:
    now = against(verdict_of(tmp_path, *new), [verdict_of(tmp_path, *old)], "old.json")
    assert now.exit_code == code
    assert now.baseline is not None
    assert now.baseline.worse is (code == 1)
    found = {one.mission: one.change for one in now.baseline.requirements if one.id == "ACC-1"}
    assert {mission: found[mission] for mission in changes} == changes
    levels = {(one.mission, one.id): one.level for one in notices(now) if one.id}
    for mission, change in changes.items():
        if mission is not None and change != "gone":
            missed = levels[mission, "ACC-1"] == "fail"
            row = next(r for m, r in now.judged_rows if (m, r.id) == (mission, "ACC-1"))
            assert missed is (row.status == "fail" and change in ("worse", "new"))


def test_every_output_names_the_mission_and_the_requirement_apart(tmp_path: Path) -> None:
    """The requirement of a JUnit case is the spec's id, so that tools link it."""
    now = against(verdict_of(tmp_path, LOW, WORSE), [verdict_of(tmp_path, LOW, HIGH)], "old.json")
    cases = {}
    for case in ElementTree.fromstring(render_junit([now])).iter("testcase"):
        told = {one.get("name"): one.get("value") for one in case.iter("property")}
        cases[told.get("mission"), told["requirement"]] = case
    high, low = cases["high", "ACC-1"], cases["low & slow", "ACC-1"]
    assert high.get("name") == "high ACC-1 accuracy"
    failure = high.find("failure")
    assert failure is not None
    assert "in old.json it was 0.1919\u00a0m of 0.20\u00a0m" in (failure.get("message") or "")
    assert low.find("skipped") is not None
    rows = list(csv.DictReader(io.StringIO(render_csv([now]))))
    told = {(row["mission"], row["requirement"]): row for row in rows}
    assert len(rows) == len(told) == len(now.requirements) + len(now.judged_rows)
    assert told["high", "ACC-1"]["since_baseline"] == "worse"
    assert told["high", "ACC-1"]["status_then"] == "pass"
    assert told["low & slow", "ACC-1"]["since_baseline"] == "no worse"
    states = {
        one["message"]["text"].split(":")[0]: one.get("baselineState")
        for one in json.loads(render_sarif([now]))["runs"][0]["results"]
        if one["ruleId"] == "accuracy"
    }
    assert states == {"mission low & slow": "unchanged", "mission high": None}
    assert "high ACC-1" in console(on_verdict(now))


@pytest.mark.parametrize(
    ("limit", "code", "change"), [("0.004 m", 1, "worse"), ("0.005 m", 0, "same")]
)
def test_a_family_without_a_design_is_held_by_what_it_cannot_meet(
    tmp_path: Path, limit: str, code: int, change: str
) -> None:
    """No design judges a mission; which limit stands in the way is said of all together."""
    own = "attitude: {sensor: sbg_apogee, primitive: pps, timestamping: gpio}"
    offered = own.replace(
        "sensor: sbg_apogee, primitive: pps", "candidates: [sbg_apogee, sbg_ellipse]"
    )
    found = []
    for text in ("0.005 m", limit):
        spec = SPEC.replace(own, offered).replace("limit: 0.10 m", f"limit: {text}")
        path = tmp_path / "own.yaml"
        path.write_text(f"{spec}  - {{name: near}}\n  - {{name: as given}}\n", encoding="utf-8")
        found.append(check_file(path, CheckSettings(monte_carlo=False)))
    then, now = found
    assert (then.verdict, now.verdict) == ("infeasible", "infeasible")
    held = against(now, [then], "old.json")
    assert held.exit_code == code
    assert held.baseline is not None
    of_all = held.baseline.of("ACC-1")
    assert of_all is not None
    assert of_all.change == change


def test_a_diff_tells_what_became_of_each_mission(tmp_path: Path) -> None:
    found = changes(verdict_of(tmp_path, LOW, HIGH), verdict_of(tmp_path, LOW, WORSE, EXTRA))
    told = {(one.mission, one.id): one for one in found.missions or ()}
    high, extra = told["high", "ACC-1"], told["extra", "ACC-1"]
    assert (high.old and high.old.status, high.new and high.new.status) == ("pass", "fail")
    assert (extra.old, extra.new and extra.new.status) == (None, "fail")
    assert found.requirements[0].mission is None


def test_a_warning_stands_at_the_mission_that_it_is_about(tmp_path: Path) -> None:
    """`quantile-above-limit` in mission high, at the line of that mission's own limit."""
    now = verdict_of(tmp_path, LOW.replace("0.05 m", "0.5 m"), HIGH, simulated=True)
    [one] = [w for w in now.warnings if w.code == "quantile-above-limit"]
    assert one.missions == ("high",)
    [told] = [n for n in notices(now) if n.rule == "quantile-above-limit"]
    row = next(r for m, r in now.judged_rows if (m, r.id) == ("high", "ACC-1"))
    assert (told.line, told.column) == (row.line, row.column)
    assert told.line == 15  # of the spec above


def test_what_nothing_judges_is_no_better(tmp_path: Path) -> None:
    """ACC-1 limited further: alone it cannot be met, so nothing holds the price against it."""
    root = Path(__file__).parent.parent
    text = (root / "specs" / "infeasible_example.yaml").read_text(encoding="utf-8")
    path, verdicts = tmp_path / "own.yaml", []
    for limit in ("5 cm", "1 cm"):
        path.write_text(text.replace("limit: 5 cm", f"limit: {limit}"), encoding="utf-8")
        verdicts.append(check_file(path, CheckSettings(monte_carlo=False)))
    then, now = verdicts
    found = against(now, [then], "old.json").baseline
    assert found is not None
    rows = {row.id: row for row in now.requirements if row.status == "indeterminate"}
    assert rows
    for one in found.requirements:
        if one.id in rows:
            assert (one.change, one.judged) == ("same", False)
            assert since_word(one, now).word == "not judged"
