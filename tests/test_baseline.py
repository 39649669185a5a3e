"""A verdict against an earlier one: only what got worse fails; figures from limits set by hand."""

from __future__ import annotations

import json
from datetime import date
from pathlib import Path
from typing import cast
from xml.etree import ElementTree

import pytest
from typer.testing import CliRunner

import syncline_design as sd
from html_page import Page
from syncline_design.cli.app import app
from syncline_design.machine.records import read_as
from syncline_design.report.ci import notices
from syncline_design.report.csv_out import render_csv
from syncline_design.report.junit import render_junit
from syncline_design.report.on_verdict import on_verdict
from syncline_design.report.on_verdicts import on_verdicts
from syncline_design.report.render_console import console
from syncline_design.report.render_html import html
from syncline_design.report.several import since_line, summary_line
from syncline_design.report.verdict_words import since_sentence
from syncline_design.verdict.baseline import against
from syncline_design.verdict.since import Baseline
from syncline_design.verdict.tree import Verdict
from syncline_design.verdict.verify import CheckSettings
from tests.checked import check_file

ROOT = Path(__file__).parent.parent
FAILING = (ROOT / "specs" / "usv_wire_missing.yaml").read_text(encoding="utf-8")
# 447.4 mm of 250 mm, tau / tau_crit 1.734 of 1, 33 357.35 EUR of 36 000 EUR
ACCURACY, COST = "limit: 0.25 m", "limit: 36000 EUR"
KIND = "kind: accuracy"
WHOLE = f"{KIND}, {ACCURACY}"
OPEN = (ROOT / "specs" / "infeasible_example.yaml").read_text(encoding="utf-8")
SYNC = ("kind: sync, limit: 1.0", "kind: sync, limit: 0.000001")  # no stamps are so good
PLAIN = CheckSettings(monte_carlo=False)


def verdict_of(folder: Path, text: str, name: str = "own.yaml") -> Verdict:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return check_file(path, PLAIN)


def changed(text: str, *pairs: tuple[str, str]) -> str:
    for old, new in pairs:
        assert text.count(old) == 1
        text = text.replace(old, new)
    return text


CASES = {
    "nothing changed": (FAILING, FAILING, 0, {}),
    "misses by more": (
        FAILING,
        changed(FAILING, (ACCURACY, "limit: 0.24 m")),
        1,
        {"ACC-1": "worse"},
    ),
    "misses by less": (
        FAILING,
        changed(FAILING, (ACCURACY, "limit: 0.3 m")),
        0,
        {"ACC-1": "better"},
    ),
    "one mended": (FAILING, changed(FAILING, (ACCURACY, "limit: 0.5 m")), 0, {"ACC-1": "better"}),
    "one more missed": (
        FAILING,
        changed(FAILING, (COST, "limit: 30000 EUR")),
        1,
        {"COST-1": "worse"},
    ),
    "one for another": (
        FAILING,
        changed(FAILING, (ACCURACY, "limit: 0.5 m"), (COST, "limit: 30000 EUR")),
        1,
        {"ACC-1": "better", "COST-1": "worse"},
    ),
    "a passing one comes closer": (
        FAILING,
        changed(FAILING, (COST, "limit: 33500 EUR")),
        0,
        {"COST-1": "same"},
    ),
    "new and missed": (
        FAILING,
        changed(
            FAILING, ("requirements:\n", "requirements:\n  - {id: M, kind: mass, limit: 1 kg}\n")
        ),
        1,
        {"M": "new"},
    ),
    "another quantity under its name, missed": (
        FAILING,
        changed(FAILING, (KIND, "kind: worst_case")),
        1,
        {"ACC-1": "new"},
    ),
    "another axis under its name, missed": (
        changed(FAILING, (WHOLE, "kind: rmse, axis: 3d, limit: 1 cm")),
        changed(FAILING, (WHOLE, "kind: rmse, axis: vertical, limit: 1 cm")),
        1,
        {"ACC-1": "new"},
    ),
    "another quantity under its name, kept": (
        FAILING,
        changed(FAILING, (WHOLE, "kind: mass, limit: 9 kg")),
        0,
        {"ACC-1": "new"},
    ),
    "new and kept": (
        FAILING,
        changed(
            FAILING, ("requirements:\n", "requirements:\n  - {id: M, kind: mass, limit: 9 kg}\n")
        ),
        0,
        {"M": "new"},
    ),
    "no longer required": (
        changed(
            FAILING, ("requirements:\n", "requirements:\n  - {id: M, kind: mass, limit: 1 kg}\n")
        ),
        FAILING,
        0,
        {"M": "gone"},
    ),
    "met before, missed under a waiver now": (
        changed(FAILING, (ACCURACY, "limit: 0.5 m")),
        changed(FAILING, (KIND, f"{KIND}, waiver: {{reason: wire, expires: 2999-01-01}}")),
        0,
        {"ACC-1": "worse"},
    ),
    "missed under a waiver before, met now": (
        changed(FAILING, (KIND, f"{KIND}, waiver: {{reason: wire, expires: 2999-01-01}}")),
        changed(FAILING, (ACCURACY, "limit: 0.5 m")),
        0,
        {"ACC-1": "better"},
    ),
    "infeasible before and now": (OPEN, OPEN, 0, {}),
    "one more cannot be met": (OPEN, changed(OPEN, SYNC), 1, {"SYNC-1": "worse"}),
    "one less cannot be met": (changed(OPEN, SYNC), OPEN, 0, {"SYNC-1": "same"}),  # not judged
    "cannot be met, and limited further": (
        OPEN,
        changed(OPEN, ("limit: 5 cm", "limit: 1 cm")),
        1,
        {"ACC-1": "worse"},
    ),
    "infeasible now": (FAILING, OPEN, 1, {}),
    "infeasible before": (OPEN, FAILING, 0, {}),
    "a waiver makes no figure better": (
        FAILING,
        changed(FAILING, (ACCURACY, "limit: 0.2 m, waiver: {reason: trial, expires: 2999-12-31}")),
        0,
        {"ACC-1": "worse"},
    ),
    "waived now, and as it was": (
        FAILING,
        changed(FAILING, (ACCURACY, f"{ACCURACY}, waiver: {{reason: trial, expires: 2999-12-31}}")),
        0,
        {"ACC-1": "same"},
    ),
    "a waiver goes": (
        changed(FAILING, (ACCURACY, f"{ACCURACY}, waiver: {{reason: trial, expires: 2999-12-31}}")),
        FAILING,
        1,
        {"ACC-1": "worse"},
    ),
}


@pytest.mark.parametrize(("old", "new", "code", "changes"), CASES.values(), ids=CASES.keys())
def test_only_what_got_worse_fails(
    tmp_path: Path, old: str, new: str, code: int, changes: dict[str, str]
) -> None:
    before = verdict_of(tmp_path, old)
    now = against(verdict_of(tmp_path, new), [before], "old.json")
    assert now.exit_code == code
    assert now.baseline is not None
    found = {row.id: row.change for row in now.baseline.requirements}
    ours = {row.id for row in now.requirements} | {row.id for row in before.requirements}
    assert set(found) == ours
    for name, change in changes.items():
        assert found.pop(name) == change
    if before.design is not None and now.design is not None:
        assert set(found.values()) <= {"same"}
    failing = [n.level for n in notices(now) if n.level in ("fail", "undecided")]
    assert bool(failing) == (code != 0)
    assert read_as(Verdict, json.dumps(now.to_json())) == now


def test_an_id_that_limits_something_else_says_so_and_is_no_case_of_a_known_miss(
    tmp_path: Path,
) -> None:
    old = verdict_of(tmp_path, FAILING)
    now = against(verdict_of(tmp_path, changed(FAILING, (KIND, "kind: worst_case"))), [old], "b")
    assert "limited Syncline error then" in console(on_verdict(now))
    assert '"ACC-1","worst_case","fail"' in render_csv([now])
    assert '"new: limited Syncline error then","accuracy","fail"' in render_csv([now])
    failed = ElementTree.fromstring(render_junit([now])).findall(".//testcase/failure")
    assert any("new: in b it limited Syncline error" in one.get("message", "") for one in failed)


def test_what_got_worse_and_is_waived_is_named(tmp_path: Path) -> None:
    waiver = "waiver: {reason: trial, expires: 2999-12-31}"
    old = verdict_of(tmp_path, changed(FAILING, (COST, f"limit: 30000 EUR, {waiver}")))
    lower = verdict_of(tmp_path, changed(FAILING, (COST, f"limit: 20000 EUR, {waiver}")))
    now = against(lower, [old], "b")
    assert "nothing got worse but what is waived (COST-1): the exit" in since_sentence(
        cast(Baseline, now.baseline), now
    )
    assert "nothing got worse but what is waived: the exit" in since_line([now])


def test_simulated_figures_are_worse_only_where_their_intervals_do_not_meet(tmp_path: Path) -> None:
    required = "  - {id: MC-1, kind: monte_carlo, quantile: 0.95, limit: 0.2 m}\n"  # 243 mm
    text = changed(FAILING, ("requirements:\n", "requirements:\n" + required))
    path = tmp_path / "own.yaml"
    path.write_text(text, encoding="utf-8")
    first, second = sd.check(path, seed=1), sd.check(path, seed=2)
    row = next(r for r in first.requirements if r.id == "MC-1")
    assert row.status == "fail"
    assert row.value != next(r.value for r in second.requirements if r.id == "MC-1")
    assert against(second, [first], "old.json").exit_code == 0
    assert against(first, [second], "old.json").exit_code == 0
    path.write_text(text.replace("limit: 0.2 m", "limit: 0.19 m"), encoding="utf-8")
    assert against(sd.check(path, seed=2), [first], "old.json").exit_code == 1


def test_the_baseline_of_several_specs_is_found_by_path_then_name(tmp_path: Path) -> None:
    worse = changed(FAILING, (ACCURACY, "limit: 0.1 m"))  # the same name in both
    good, bad = verdict_of(tmp_path, FAILING, "a.yaml"), verdict_of(tmp_path, worse, "b.yaml")
    for mine, code in ((good, 0), (bad, 0)):
        assert against(mine, [bad, good], "all.json").exit_code == code
    elsewhere = verdict_of(tmp_path, FAILING, "c.yaml")
    found = against(elsewhere, [bad, good], "all.json")
    assert found.baseline is not None
    assert found.baseline.verdict is None
    assert found.exit_code == 1
    other = verdict_of(tmp_path, OPEN, "d.yaml")
    assert against(elsewhere, [good, other], "all.json").exit_code == 0


def test_the_only_verdict_of_a_file_is_no_baseline_of_another_spec(tmp_path: Path) -> None:
    """Else a foreign file forgives whatever both miss."""
    named = FAILING.replace("name: ", "name: another ", 1)
    assert named != FAILING
    foreign = verdict_of(tmp_path, named, "foreign.yaml")
    now = against(verdict_of(tmp_path, FAILING), [foreign], "foreign.json")
    assert now.baseline is not None
    assert now.baseline.verdict is None
    assert now.exit_code == 1


def run(*words: str | Path) -> tuple[int, str]:
    found = CliRunner().invoke(app, [str(word) for word in words])
    return found.exit_code, found.stdout + found.stderr


def test_check_takes_a_baseline_in_every_format(tmp_path: Path) -> None:
    spec, old = tmp_path / "own.yaml", tmp_path / "old.json"
    spec.write_text(FAILING, encoding="utf-8")
    assert run("check", spec, "-q", "-o", f"json:{old}")[0] == 1
    code, said = run(
        "check", spec, "--baseline", old, "-o", f"junit:{tmp_path / 'j.xml'}",
        "-o", f"sarif:{tmp_path / 's.json'}", "-o", f"html:{tmp_path / 'p.html'}",
    )  # fmt: skip
    assert code == 0
    assert "0.4474 m / 0.25 m" in said
    assert "nothing got worse" in said
    suite = ElementTree.parse(tmp_path / "j.xml").getroot()
    assert (suite.get("failures"), suite.get("skipped")) == ("0", "2")
    results = json.loads((tmp_path / "s.json").read_text(encoding="utf-8"))["runs"][0]["results"]
    states = {r["ruleId"]: r.get("baselineState") for r in results}
    assert states["accuracy"] == states["sync"] == "unchanged"
    assert "Against the baseline" in (tmp_path / "p.html").read_text(encoding="utf-8")
    _, said = run("check", spec, "--baseline", old, "-o", "github:-")
    assert "::error" not in said
    assert "title=ACC-1 accuracy (known)" in said


def test_a_spec_that_stays_infeasible_has_no_further_test_case(tmp_path: Path) -> None:
    """Every requirement that is in the way is there already, and known."""
    verdict = verdict_of(tmp_path, OPEN)
    then = [one.rule for one in notices(verdict)]
    known = notices(against(verdict, [verdict], "old.json"))
    assert [one.rule for one in known] == then
    assert {one.justification for one in known if one.level == "known"} == {
        "no worse than in old.json"
    }


def test_only_what_is_in_the_way_got_worse_and_what_passes_again_better(tmp_path: Path) -> None:
    infeasible = verdict_of(tmp_path, OPEN)
    meets = verdict_of(tmp_path, changed(OPEN, ("limit: 5 cm", "limit: 9 m")))
    fell = against(infeasible, [meets], "old.json")
    assert fell.baseline is not None
    assert fell.baseline.worse
    kinds = {one.id: one.change for one in fell.baseline.requirements}
    assert kinds == {"ACC-1": "worse", "SYNC-1": "same", "COST-1": "worse"}
    text = Page(html(on_verdict(fell))).text.partition("Against the baseline")[2]
    assert "SYNC-1 not judged" in " ".join(text.split())
    rose = against(meets, [infeasible], "old.json").baseline
    assert rose is not None
    kinds = {one.id: one.change for one in rose.requirements}
    assert kinds == dict.fromkeys(("ACC-1", "SYNC-1", "COST-1"), "better")


def test_an_implied_limit_is_neither_gone_nor_new_where_no_design_is(tmp_path: Path) -> None:
    """It has no row without a design, though the spec asks for it as before."""
    asked = changed(OPEN, ("  - {id: SYNC-1, kind: sync, limit: 1.0}\n", ""))
    infeasible = verdict_of(tmp_path, asked)
    meets = verdict_of(tmp_path, changed(asked, ("limit: 5 cm", "limit: 9 m")))
    assert [row.id for row in meets.requirements if row.line is None]
    fell = against(infeasible, [meets], "old.json").baseline
    assert fell is not None
    assert "gone" not in {one.change for one in fell.requirements}
    rose = against(meets, [infeasible], "old.json").baseline
    assert rose is not None
    assert not rose.worse
    assert "new" not in {one.change for one in rose.requirements}


def test_what_got_worse_says_what_it_was(tmp_path: Path) -> None:
    before = verdict_of(tmp_path, changed(FAILING, (ACCURACY, "limit: 0.5 m")))
    now = against(verdict_of(tmp_path, FAILING), [before], "old.json")
    message = next(one.message for one in notices(now) if one.id == "ACC-1")
    assert "; in old.json it was 0.4474\N{NO-BREAK SPACE}m of 0.5\N{NO-BREAK SPACE}m" in message
    assert summary_line([now]).endswith(f"Against old.json 1 of 1 got worse: {now.name}.")
    same = against(before, [before], "old.json")
    assert summary_line([same]).endswith("Against old.json nothing got worse: the exit code is 0.")


def test_the_page_of_several_specs_says_what_became_of_each(tmp_path: Path) -> None:
    before = verdict_of(tmp_path, changed(FAILING, (ACCURACY, "limit: 0.5 m")))
    now = against(verdict_of(tmp_path, FAILING), [before], "old.json")
    same = against(before, [before], "old.json")
    text = Page(html(on_verdicts([now, same]))).text
    assert "Against old.json 1 of 2 got worse" in text
    table = text.partition("Since then")[2].partition("Specs")[0]
    assert "worse" in table
    assert "no worse" in table
    assert "0.4474\N{NO-BREAK SPACE}m / 0.5\N{NO-BREAK SPACE}m" in text, "the figure then"
    assert "Since then" not in Page(html(on_verdicts([before, before]))).text


BROKEN = {
    "no file": (None, "no such file"),
    "no JSON": ("{", "expected a verdict as `check --output json:PATH` writes it"),
    "another schema": ('{"schema": "syncline-design/diff/v1"}', "baseline"),
    "half a verdict": ('{"schema": "syncline-design/verdict/v1", "verdict": "meets"}', "missing"),
}


@pytest.mark.parametrize(("text", "said"), BROKEN.values(), ids=BROKEN.keys())
def test_a_baseline_that_is_none_is_refused(tmp_path: Path, text: str | None, said: str) -> None:
    spec, old = tmp_path / "own.yaml", tmp_path / "old.json"
    spec.write_text(FAILING, encoding="utf-8")
    if text is not None:
        old.write_text(text, encoding="utf-8")
    code, words = run("check", spec, "--baseline", old)
    assert code == 2
    assert said in words
    assert str(old) in words


def test_a_baseline_is_not_overwritten(tmp_path: Path) -> None:
    spec, old = tmp_path / "own.yaml", tmp_path / "old.json"
    spec.write_text(FAILING, encoding="utf-8")
    run("check", spec, "-q", "-o", f"json:{old}")
    text = old.read_text(encoding="utf-8")
    code, said = run("check", spec, "--baseline", old, "-o", f"json:{old}")
    assert code == 2
    assert "read by this command" in said
    assert old.read_text(encoding="utf-8") == text


def test_a_verdict_that_depends_on_the_day_says_which(tmp_path: Path) -> None:
    """By provenance alone the same figures come again: a waiver ends, so its day belongs there."""
    waiver = "kind: accuracy, waiver: {reason: until the wire, expires: 2027-01-31}"
    path = tmp_path / "own.yaml"
    path.write_text(changed(FAILING, (KIND, waiver)), encoding="utf-8")
    for day in (date(2027, 1, 31), date(2027, 2, 1)):
        found = sd.check(path, monte_carlo=False, today=day)
        assert isinstance(found, Verdict)
        assert found.provenance.judged_on == day.isoformat()
        assert f"waivers judged on {day.isoformat()}" in console(on_verdict(found))
    chosen = sd.optimize(path)
    assert chosen.provenance.judged_on == date.today().isoformat()
    plain = verdict_of(tmp_path, FAILING)
    assert plain.provenance.judged_on is None
    assert "judged_on" not in plain.provenance.to_json()
