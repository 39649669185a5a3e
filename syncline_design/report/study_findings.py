"""A study for CI: one finding per requirement of a base spec, at its line; one test per case."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any
from xml.etree import ElementTree

from syncline_design.report.ci import Finding, Level, requirement_sentence
from syncline_design.report.study_rows import reason
from syncline_design.report.study_words import outcome, rule_sentence
from syncline_design.report.text import visible
from syncline_design.report.verdict_words import Json, is_waived, items
from syncline_design.studies.result import CaseResult, StudyResult


@dataclass
class _Tally:
    """How often one requirement of one base was missed, and the first time."""

    row: Json
    first: CaseResult
    message: str
    count: int = 0
    numbers: list[int] = field(default_factory=list)


def study_findings(result: StudyResult) -> list[Finding]:
    """What stands in the way, once per requirement and base however many cases it concerns."""
    tallies: dict[tuple[int, str, str], _Tally] = {}
    totals: dict[int, int] = {}
    for case in result.cases():
        totals[case.base] = totals.get(case.base, 0) + 1
        for rule, row, message in _misses(case):
            key = (case.base, str(row.get("id") or ""), rule)
            tally = tallies.setdefault(key, _Tally(row, case, message))
            tally.count += 1
    return [
        _finding(result, tally, rule, identity, totals[base])
        for (base, identity, rule), tally in sorted(tallies.items())
    ]


def _misses(case: CaseResult) -> Iterator[tuple[str, Json, str]]:
    """(rule, row with its place, message) of everything that a case misses."""
    if case.verdict == "meets":
        return
    missed = [
        row
        for row in items(case.record, "requirements")
        if row.get("status") == "fail" and not is_waived(row)
    ]
    for row in missed:
        yield str(row.get("kind")), row, requirement_sentence(row)
    if missed:
        return
    problems = items(case.record, "problems")
    place: Json = problems[0] if problems else {}
    rule = "spec" if problems else case.verdict
    yield rule, {"line": place.get("line"), "column": place.get("column")}, reason(case)


def _finding(result: StudyResult, tally: _Tally, rule: str, identity: str, total: int) -> Finding:
    level: Level = "warning"
    if result.verdict != "meets":
        level = "undecided" if rule == "indeterminate" else "fail"
    at = setting_text(tally.first)
    message = (
        f"missed in {tally.count} of {total} cases of the study {result.study.name}; first at "
        f"{at}: {tally.message}"
    )
    row = tally.row
    return Finding(
        level, rule, identity, tally.first.file, int(row.get("line") or 1),
        int(row.get("column") or 1), message,
    )  # fmt: skip


def setting_text(case: CaseResult) -> str:
    """`stages[uav].distance = 40 m, coverage_factor = 2`."""
    return ", ".join(f"{key} = {value}" for key, value in case.labels.items()) or "the base itself"


def study_sarif(result: StudyResult) -> str:
    """A SARIF log with one result per missed requirement."""
    from syncline_design.report.sarif import sarif_log

    return sarif_log(study_findings(result))


def study_github(result: StudyResult) -> str:
    """Workflow commands: an annotation per missed requirement, a notice with the outcome."""
    from syncline_design.report.github import github_command

    lines = [github_command(finding) for finding in study_findings(result)]
    text = f"{result.study.name}: {outcome(result).word}. {rule_sentence(result)}"
    return "\n".join([*lines, f"::notice ::{visible(text).replace('%', '%25')}"]) + "\n"


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
    line = str(int(missed[0][1].get("line") or 1)) if missed else "1"
    attributes: dict[str, str] = {
        "name": visible(f"{case.number}: {setting_text(case)}"),
        "classname": visible(case.file),
        "file": visible(case.file),
        "line": line,
        "time": "0",
    }
    test = ElementTree.Element("testcase", attributes)
    if not missed:
        return test
    message = visible(" ".join(f"{text}" for _, _, text in missed))
    tag = "error" if case.verdict == "indeterminate" else "failure"
    if allowed:
        ElementTree.SubElement(test, "skipped", {"message": f"{case.verdict}: {message}"})
        return test
    element = ElementTree.SubElement(test, tag, {"type": missed[0][0], "message": message})
    element.text = f"{visible(case.file)}:{line}: {message}"
    return test


def study_data(result: StudyResult) -> dict[str, Any]:
    """The study as data (schema syncline-design/study/v1)."""
    from dataclasses import asdict

    from syncline_design import __version__
    from syncline_design.report.study_rows import rows, si_unit
    from syncline_design.spec.keys import label
    from syncline_design.studies.summary import boundaries, heat_map, summarise, winners

    study, summary = result.study, summarise(result)
    heat = heat_map(summary)
    return {
        "schema": "syncline-design/study/v1",
        "verdict": result.verdict,
        "name": study.name,
        "file": str(study.path),
        "meets_when": study.meets_when,
        "counts": result.counts,
        "not_simulated": list(result.not_simulated),
        "factors": [
            {
                "key": factor.key,
                "origin": factor.origin,
                "unit": si_unit(factor),
                "values": [label(value) for value in factor.values],
            }
            for factor in study.factors
        ],
        "heat_map": None
        if heat is None
        else {
            "x": heat.x.key,
            "y": heat.y.key,
            "currency": summary.currencies[0],
            "x_values": heat.x_labels,
            "y_values": heat.y_labels,
            "least_cost": heat.cost,
            "payload": heat.picks,
        },
        "winners": [
            {**asdict(w.pick), "cases": w.cases, "of": w.of, "where": w.where}
            for w in winners(summary)
        ],
        "boundaries": [{**asdict(b), "fixed": dict(b.fixed)} for b in boundaries(summary)],
        "fronts": [
            {
                "cases": f.cases,
                "currency": f.currency,
                "points": [{"cost": c, "error_m": e} for c, e in f.points],
            }
            for f in summary.fronts
        ],
        "cases": list(rows(result)),
        "provenance": {
            "version": __version__,
            "seed": result.seed,
            "study_sha256": study.sha256,
            "bases": [
                {
                    "file": str(base.path),
                    "spec_sha256": base.document.sha256,
                    "catalogs_sha256": base.catalogs.sha256(),
                }
                for base in study.bases
            ],
        },
    }
