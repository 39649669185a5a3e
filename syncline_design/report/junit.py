"""JUnit XML as GitLab, Jenkins and GitHub actions read it: a suite per spec, a case per limit."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from xml.etree import ElementTree

from syncline_design.report.ci import Notice, closing_words, notices
from syncline_design.report.text import unticked, visible
from syncline_design.verdict.tree import Checked


def render_junit(verdicts: Sequence[Checked]) -> str:
    """A JUnit document; failures fail, what is undecided errors; skipped is what is
    waived, not reached, or no worse than in the baseline.

    Times are 0 and no timestamp is given: the same verdict gives the same bytes.
    """
    return junit_text(
        suite_of(verdict.name, verdict.file, notices(verdict), closing_words(verdict))
        for verdict in verdicts
    )


def junit_text(members: Iterable[ElementTree.Element]) -> str:
    """A document of suites with their totals."""
    suites = ElementTree.Element("testsuites", {"name": "syncline-design"})
    suites.extend(members)
    for key in ("tests", "failures", "errors", "skipped"):
        total = sum(int(suite.get(key, "0")) for suite in suites)
        suites.set(key, str(total))
    suites.set("time", "0")
    ElementTree.indent(suites)
    body = ElementTree.tostring(suites, encoding="unicode")
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + body + "\n"


def suite_of(name: str, file: str, found: Sequence[Notice], word: str) -> ElementTree.Element:
    """A suite named after a spec: a test per notice, the outcome and warnings as its output."""
    cases = [notice for notice in found if notice.level != "warning"]
    counts = {
        "tests": len(cases),
        "failures": sum(f.level == "fail" for f in cases),
        "errors": sum(f.level == "undecided" for f in cases),
        "skipped": sum(f.level in ("waived", "known", "not_reached") for f in cases),
    }
    suite = ElementTree.Element("testsuite", {"name": visible(name)})
    for key, value in counts.items():
        suite.set(key, str(value))
    suite.set("time", "0")
    for notice in cases:
        suite.append(_case(notice, file))
    lines = [word]
    lines += [
        f"warning [{f.rule}]: {visible(unticked(f.message))}" for f in found if f.level == "warning"
    ]
    ElementTree.SubElement(suite, "system-out").text = "\n".join(lines)
    return suite


def _case(notice: Notice, file: str) -> ElementTree.Element:
    name = f"{notice.label} {notice.rule}".strip()
    case = ElementTree.Element(
        "testcase",
        {
            "name": visible(name),
            "classname": visible(file),
            "file": visible(notice.file),
            "line": str(notice.line),
            "time": "0",
        },
    )
    message = visible(unticked(notice.message))
    place = f"{visible(notice.file)}:{notice.line}:{notice.column}"
    if notice.id:
        listed = ElementTree.SubElement(case, "properties")
        whose = (("mission", notice.mission),) if notice.mission else ()
        told = (("requirement", notice.id), *whose, ("kind", notice.rule), *notice.figures)
        for key, value in (*told, ("place", place)):
            ElementTree.SubElement(listed, "property", {"name": key, "value": visible(value)})
    if notice.level == "fail":
        failure = ElementTree.SubElement(case, "failure", {"type": notice.rule})
        failure.set("message", message)
        failure.text = f"{place}: {message}"
    elif notice.level == "undecided":
        error = ElementTree.SubElement(case, "error", {"type": notice.rule, "message": message})
        error.text = f"{place}: {message}"
    elif notice.level in ("waived", "known"):
        reason = f"{visible(unticked(notice.justification))}; {message}"
        ElementTree.SubElement(case, "skipped", {"message": reason})
    elif notice.level == "not_reached":
        ElementTree.SubElement(case, "skipped", {"message": message})
    return case
