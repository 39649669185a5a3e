"""A study for CI: one finding per requirement of a base spec, at its line; one test per case."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final
from xml.etree import ElementTree

from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.sentences import sentence_list
from syncline_design.report.ci import Level, Notice, requirement_sentence
from syncline_design.report.github import github_command
from syncline_design.report.sarif import sarif_log
from syncline_design.report.study_words import COMBINED, outcome, rule_sentence
from syncline_design.report.text import unticked, visible
from syncline_design.report.verdict_words import waiver_text
from syncline_design.studies.finished import CaseResult
from syncline_design.studies.result import StudyResult
from syncline_design.studies.table import reason

_FOUND: Final = {"indeterminate": "no verdict", "spec": COMBINED}  # else missed


@dataclass(frozen=True, slots=True)
class _Miss:
    """What a case misses; id: of the requirement, where it is one."""

    rule: str
    message: str
    id: str = ""
    line: int | None = None
    column: int | None = None
    waiver: str = ""  # in force: it does not count


@dataclass
class _Tally:
    """How often one requirement of one base was missed, and the first time."""

    miss: _Miss
    first: CaseResult
    count: int = 0


def study_notices(result: StudyResult) -> list[Notice]:
    """What stands in the way, once per requirement and base however many cases it concerns."""
    tallies: dict[tuple[int, str, str], _Tally] = {}
    totals: dict[int, int] = {}
    for case in result.cases():
        totals[case.base] = totals.get(case.base, 0) + 1
        for miss in (*_misses(case), *_waived(case)):
            tally = tallies.setdefault((case.base, miss.id, miss.rule), _Tally(miss, case))
            tally.count += 1
    return [
        _finding(result, tally, totals[base]) for (base, _, _), tally in sorted(tallies.items())
    ]


def _misses(case: CaseResult) -> Iterator[_Miss]:
    """Everything that a case misses."""
    if case.verdict == "meets":
        return
    failing = case.record.failing
    missed = [r for r in case.record.requirements if r.id in failing and not r.is_waived]
    for row in missed:
        over = f"; {waiver_text(row)}" if row.waiver else ""
        yield _Miss(row.kind, requirement_sentence(row) + over, row.id, row.line, row.column)
    if missed:
        return
    problems = case.record.problems
    if problems:
        yield _Miss("spec", reason(case), "", problems[0].line, problems[0].column)
    else:
        yield _Miss(case.verdict, reason(case))


def _waived(case: CaseResult) -> Iterator[_Miss]:
    """What a waiver in force covers."""
    for row in case.record.requirements if case.record.design is not None else ():
        if row.status == "fail" and row.is_waived:
            sentence = requirement_sentence(row)
            yield _Miss(row.kind, sentence, row.id, row.line, row.column, waiver_text(row))


def _finding(result: StudyResult, tally: _Tally, total: int) -> Notice:
    miss = tally.miss
    level: Level = "waived" if miss.waiver else "warning"
    if result.verdict != "meets" and not miss.waiver:
        level = "undecided" if miss.rule == "indeterminate" else "fail"
    found = _FOUND.get(miss.rule, "missed")
    message = (
        f"{found} in {tally.count} of {total} cases of the study {result.study.name}; first at "
        f"{setting_text(tally.first)}: {miss.message}"
    )
    place = (miss.line or 1, miss.column or 1)
    return Notice(level, miss.rule, miss.id, tally.first.file, *place, message, miss.waiver)


def setting_text(case: CaseResult) -> str:
    """`stages[uav].distance = 40 m, coverage_factor = 2`."""
    return ", ".join(f"{key} = {value}" for key, value in case.labels.items()) or "the base itself"


def study_sarif(result: StudyResult) -> str:
    """A SARIF log with one result per missed requirement."""
    return sarif_log(study_notices(result))


def study_github(result: StudyResult) -> str:
    """Workflow commands: an annotation per missed requirement, a notice with the outcome."""
    lines = [github_command(finding) for finding in study_notices(result)]
    text = f"{result.study.name}: {outcome(result).word}. {rule_sentence(result)}"
    return "\n".join([*lines, f"::notice ::{visible(unticked(text)).replace('%', '%25')}"]) + "\n"


def study_junit(result: StudyResult) -> str:
    """JUnit: a suite per base, a test per case; misses that the study allows are skipped tests."""
    root = ElementTree.Element("testsuites", {"name": visible(result.study.name)})
    suites: dict[int, ElementTree.Element] = {}
    for case in result.cases():
        suite = suites.get(case.base)
        if suite is None:
            suite = ElementTree.SubElement(root, "testsuite", {"name": visible(case.name)})
            suites[case.base] = suite
        suite.append(_test(case, allowed=result.verdict == "meets"))
    for element in (*suites.values(), root):
        tests = list(element.iter("testcase"))
        element.set("tests", str(len(tests)))
        for name, tag in (("failures", "failure"), ("errors", "error"), ("skipped", "skipped")):
            element.set(name, str(sum(test.find(tag) is not None for test in tests)))
        element.set("time", "0")
    ElementTree.indent(root)
    body = ElementTree.tostring(root, encoding="unicode")
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + body + "\n"


def _test(case: CaseResult, *, allowed: bool) -> ElementTree.Element:
    missed = list(_misses(case))
    line = str(missed[0].line or 1) if missed else "1"
    attributes: dict[str, str] = {
        "name": visible(f"{case.number}: {setting_text(case)}"),
        "classname": visible(case.file),
        "file": visible(case.file),
        "line": line,
        "time": "0",
    }
    test = ElementTree.Element("testcase", attributes)
    if not missed:
        if waived := case.record.waived:
            message = f"{case.verdict}, {sentence_list(list(waived))} waived"
            ElementTree.SubElement(test, "skipped", {"message": visible(message)})
        return test
    message = visible(unticked(" ".join(miss.message for miss in missed)))
    tag = "error" if case.verdict == "indeterminate" else "failure"
    if allowed:
        ElementTree.SubElement(test, "skipped", {"message": f"{case.verdict}: {message}"})
        return test
    element = ElementTree.SubElement(test, tag, {"type": missed[0].rule, "message": message})
    element.text = f"{visible(case.file)}:{line}: {message}"
    return test
