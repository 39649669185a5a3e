"""Output formats of verdicts: read back by readers of their own, and fed hostile text."""

from __future__ import annotations

import csv
import io
import json
import math
import re
from dataclasses import replace
from typing import Any
from xml.etree import ElementTree

import jsonschema
import pytest

import report_samples as samples
from syncline_design.choice.outcome import Conflict
from syncline_design.report.checks import CHECK_FORMATS, render_checks
from syncline_design.report.ci import notices
from syncline_design.report.json_out import json_text
from syncline_design.report.sarif import artifact_uri
from syncline_design.report.text import markdown_safe, spreadsheet_safe, visible
from syncline_design.verdict.tree import Checked, Verdict, WaiverResult

TEXT_FORMATS = [name for name in CHECK_FORMATS if name != "html"]

# The objects of SARIF 2.1.0 that this tool writes, typed from the standard (OASIS, sections 3.11
# to 3.52): nothing beyond the listed properties may appear, as in the standard's own schema.
_TEXT = {"type": "string"}


def _closed(required: list[str], **properties: Any) -> dict[str, Any]:
    return {
        "type": "object",
        "required": required,
        "properties": properties,
        "additionalProperties": False,
    }


_MESSAGE = _closed(["text"], text=_TEXT)
_LOCATION = _closed(
    ["physicalLocation"],
    physicalLocation=_closed(
        ["artifactLocation"],
        artifactLocation=_closed(["uri"], uri={"type": "string", "format": "uri-reference"}),
        region=_closed(
            ["startLine"],
            startLine={"type": "integer", "minimum": 1},
            startColumn={"type": "integer", "minimum": 1},
        ),
    ),
)
_RESULT = _closed(
    ["message"],
    ruleId=_TEXT,
    ruleIndex={"type": "integer", "minimum": 0},
    kind={"enum": ["notApplicable", "pass", "fail", "review", "open", "informational"]},
    level={"enum": ["none", "note", "warning", "error"]},
    message=_MESSAGE,
    locations={"type": "array", "items": _LOCATION},
    partialFingerprints={"type": "object", "additionalProperties": _TEXT},
    suppressions={
        "type": "array",
        "uniqueItems": True,
        "items": _closed(["kind"], kind={"enum": ["inSource", "external"]}, justification=_TEXT),
    },
)
_DRIVER = _closed(
    ["name"],
    name=_TEXT,
    version=_TEXT,
    rules={
        "type": "array",
        "uniqueItems": True,
        "items": _closed(["id"], id=_TEXT, shortDescription=_MESSAGE),
    },
)
SARIF_SCHEMA = _closed(
    ["version", "runs"],
    **{"$schema": {"type": "string", "format": "uri"}},
    version={"const": "2.1.0"},
    runs={
        "type": "array",
        "items": _closed(
            ["tool"],
            tool=_closed(["driver"], driver=_DRIVER),
            columnKind={"enum": ["utf16CodeUnits", "unicodeCodePoints"]},
            results={"type": "array", "items": _RESULT},
        ),
    },
)


def sarif_of(*verdicts: Checked) -> dict[str, Any]:
    log: dict[str, Any] = json.loads(render_checks("sarif", verdicts))
    jsonschema.Draft7Validator(SARIF_SCHEMA).validate(log)
    return log


def undecided(verdict: Verdict) -> Verdict:
    """The same with every requirement open."""
    rows = [replace(row, status="indeterminate") for row in verdict.requirements]
    return replace(verdict, requirements=tuple(rows))


def junit_of(*verdicts: Checked) -> ElementTree.Element:
    """Parse and hold against what CI readers count on: totals that add up, places, messages."""
    root = ElementTree.fromstring(render_checks("junit", verdicts).encode())
    assert root.tag == "testsuites"
    for kind, tag in (("failures", "failure"), ("errors", "error"), ("skipped", "skipped")):
        for suite in root:
            assert suite.tag == "testsuite"
            assert int(suite.attrib[kind]) == len(suite.findall(f"testcase/{tag}"))
            assert int(suite.attrib["tests"]) == len(suite.findall("testcase"))
        assert int(root.attrib[kind]) == sum(int(suite.attrib[kind]) for suite in root)
    for case in root.iter("testcase"):
        assert case.attrib["name"]
        assert case.attrib["classname"]
        assert int(case.attrib["line"]) >= 1
    return root


def test_json_is_the_verdict_itself() -> None:
    verdict = samples.fixed_wing()
    assert json.loads(render_checks("json", [verdict])) == verdict.to_json()


def test_json_of_several_keeps_each() -> None:
    verdicts = [samples.fixed_wing(), samples.failing()]
    assert json.loads(render_checks("json", verdicts))["verdicts"] == [
        verdict.to_json() for verdict in verdicts
    ]


def test_json_has_no_infinity() -> None:
    text = json_text({"a": math.inf, "b": [math.nan, 1.5], "c": {"d": -math.inf}})
    assert json.loads(text) == {"a": None, "b": [None, 1.5], "c": {"d": None}}


def test_junit_fails_where_the_verdict_fails() -> None:
    root = junit_of(samples.fixed_wing(), samples.failing())
    assert [suite.attrib["failures"] for suite in root] == ["0", "1"]
    (failed,) = [case for case in root.iter("testcase") if case.find("failure") is not None]
    assert failed.attrib["name"].startswith("ACC-1")
    assert failed.attrib["file"] == "specs/uav_corridor.yaml"
    line = samples.line_of(samples.PINNED, "ACC-1")
    assert failed.attrib["line"] == str(line)
    failure = failed.find("failure")
    assert failure is not None
    value = samples.failing().requirements[0].value
    assert value is not None
    assert f"{100.0 * value:.4g}\u00a0cm" in failure.attrib["message"]
    assert f"specs/uav_corridor.yaml:{line}:5" in (failure.text or "")


def test_junit_carries_the_figures_of_every_requirement() -> None:
    verdict = samples.failing()
    cases = list(junit_of(verdict).iter("testcase"))
    for case, row in zip(cases, verdict.requirements, strict=True):
        told = {one.attrib["name"]: one.attrib["value"] for one in case.iter("property")}
        assert told["requirement"] == row.id
        assert float(told["limit"]) == row.limit
        assert row.value is not None
        assert float(told["value"]) == row.value
        assert float(told["margin"]) == pytest.approx(row.limit - row.value)
        assert (told["unit"], told["status"]) == (row.unit, row.status)
        assert told["place"] == f"{verdict.file}:{row.line}:{row.column}"
        assert case.attrib["name"] == f"{row.id} {row.kind}"


def test_junit_of_an_infeasible_spec_fails_the_conflicting_requirements() -> None:
    root = junit_of(samples.infeasible())
    failures = {
        case.attrib["name"]: case.attrib["line"]
        for case in root.iter("testcase")
        if case.find("failure") is not None
    }
    places = {identity: samples.line_of(samples.OPEN, identity) for identity in ("ACC-1", "COST-1")}
    assert failures == {
        "ACC-1 accuracy": str(places["ACC-1"]),
        "COST-1 cost": str(places["COST-1"]),
    }
    assert root.attrib["skipped"] == "3"  # the others: no design to judge them by
    lines = render_checks("github", [samples.infeasible()]).splitlines()
    wanted = f"line={places['ACC-1']}"
    (line,) = [line for line in lines if line.startswith("::error") and wanted in line]
    assert "cannot be met together with COST-1" in line
    why = samples.infeasible().infeasibility
    assert why is not None
    (cost,) = [fix.text for fix in why.fixes if fix.requirement == "COST-1"]
    assert cost.startswith("COST-1 by ")
    assert cost in line


def test_junit_of_an_infeasible_spec_without_a_conflict_still_fails() -> None:
    verdict = undecided(samples.infeasible())
    root = junit_of(samples.explained(verdict, conflict=Conflict((), False)))
    assert root.attrib["failures"] == "1"
    assert root.attrib["skipped"] == str(len(verdict.requirements))


def test_junit_of_no_verdict_errs() -> None:
    verdict = undecided(samples.infeasible())
    verdict = replace(verdict, verdict="indeterminate", infeasibility=None)
    assert junit_of(verdict).attrib["errors"] == "1"


def test_undecided_monte_carlo_errs() -> None:
    verdict = replace(samples.fixed_wing(), verdict="indeterminate")
    verdict = samples.with_requirement(verdict, 4, status="indeterminate")
    root = junit_of(verdict)
    names = [c.attrib["name"] for c in root.iter("testcase") if c.find("error") is not None]
    assert "MC-1 monte_carlo" in names


def waived(until: str = "2027-01-31", *, expired: bool = False) -> Verdict:
    waiver = WaiverResult("prototype", until, expired)
    verdict = samples.with_requirement(samples.failing(), 0, waiver=waiver)
    return verdict if expired else replace(verdict, verdict="meets")


def test_a_waived_requirement_is_skipped_with_its_reason() -> None:
    root = junit_of(waived())
    assert (root.attrib["failures"], root.attrib["skipped"]) == ("0", "1")
    skipped = next(root.iter("skipped"))
    assert "prototype" in skipped.attrib["message"]
    assert "2027-01-31" in skipped.attrib["message"]
    (result,) = [r for r in sarif_of(waived())["runs"][0]["results"] if r["level"] == "error"]
    assert result["suppressions"][0]["justification"].endswith("prototype")
    assert "::error" not in render_checks("github", [waived()])
    assert "(waived)" in render_checks("github", [waived()])


def test_an_expired_waiver_does_not_help() -> None:
    assert junit_of(waived("2020-01-31", expired=True)).attrib["failures"] == "1"


def test_sarif_points_at_the_specs_line() -> None:
    results = sarif_of(samples.failing())["runs"][0]["results"]
    (error,) = [result for result in results if result["level"] == "error"]
    place = error["locations"][0]["physicalLocation"]
    assert place["artifactLocation"]["uri"] == "specs/uav_corridor.yaml"
    line = samples.line_of(samples.PINNED, "ACC-1")
    assert place["region"] == {"startLine": line, "startColumn": 5}
    rules = sarif_of(samples.failing())["runs"][0]["tool"]["driver"]["rules"]
    assert rules[error["ruleIndex"]]["id"] == error["ruleId"] == "accuracy"


def test_sarif_of_a_passing_spec_has_no_error() -> None:
    results = sarif_of(samples.fixed_wing())["runs"][0]["results"]
    assert {result["level"] for result in results} == {"note"}


def test_sarif_fingerprint_survives_a_change_of_figures() -> None:
    first = samples.failing()
    second = samples.with_requirement(first, 0, value=0.0612)
    prints = [
        [r["partialFingerprints"] for r in sarif_of(v)["runs"][0]["results"]]
        for v in (first, second)
    ]
    assert prints[0] == prints[1]


@pytest.mark.parametrize(
    ("path", "uri"),
    [
        ("specs/a b.yaml", "specs/a%20b.yaml"),
        ("/home/x/s.yaml", "file:///home/x/s.yaml"),
        ("sp\u00e9c#1%.yaml", "sp%C3%A9c%231%25.yaml"),
    ],
)
def test_sarif_uri(path: str, uri: str) -> None:
    assert artifact_uri(path) == uri


def test_refused_spec_reaches_every_ci_format() -> None:
    (result,) = sarif_of(samples.REFUSED)["runs"][0]["results"]
    assert result["locations"][0]["physicalLocation"]["region"]["startLine"] == 3
    assert "did you mean uav_fixed_wing" in result["message"]["text"]
    root = junit_of(samples.REFUSED)
    assert root.attrib["failures"] == "1"
    first = render_checks("github", [samples.REFUSED]).splitlines()[0]
    assert first.startswith("::error file=specs/bad.yaml,line=3,col=7,title=spec::")
    assert "did you mean" in render_checks("markdown", [samples.REFUSED])
    assert "uav\\_fixd\\_wing" in render_checks("markdown", [samples.REFUSED])


COMMAND = re.compile(r"::(error|warning|notice) file=[^:]*,line=\d+(,col=\d+)?,title=[^:]*::.*")


@pytest.mark.parametrize("text", samples.HOSTILE)
def test_hostile_text_starts_no_github_command_of_its_own(text: str) -> None:
    lines = render_checks("github", [samples.with_hostile_text(text)]).splitlines()
    for line in lines:
        assert COMMAND.fullmatch(line), line
    warnings = len(samples.fixed_wing().warnings)
    assert len(lines) == 5 + warnings + 1  # requirements, warnings, the outcome


def runner_reads(line: str) -> tuple[dict[str, str], str]:
    """Properties and message of a workflow command, decoded as GitHub's runner does."""
    head, _, message = line.removeprefix("::").partition("::")
    properties = dict(p.split("=", 1) for p in head.partition(" ")[2].split(","))
    pairs = (("%2C", ","), ("%3A", ":"), ("%0A", "\n"), ("%0D", "\r"), ("%25", "%"))

    def decoded(text: str) -> str:
        for code, character in pairs:
            text = text.replace(code, character)
        return text

    return {key: decoded(value) for key, value in properties.items()}, decoded(message)


def bare(text: str) -> str:
    """As a sentence says it that shows no code: what stands in backticks without them."""
    return visible(text).replace("`", "")


@pytest.mark.parametrize("text", [*samples.HOSTILE, "100%25 done", "50 %, a:b"])
def test_github_runner_reads_back_what_was_meant(text: str) -> None:
    line = render_checks("github", [samples.with_hostile_text(text)]).splitlines()[0]
    properties, message = runner_reads(line)
    assert properties["title"] == f"ACC-1{visible(text)} accuracy"
    assert properties["line"] == str(samples.line_of(samples.OPEN, "ACC-1"))
    assert message.startswith(f"ACC-1{bare(text)}: ")
    assert message.endswith(bare(text))


@pytest.mark.parametrize("text", samples.HOSTILE)
def test_hostile_text_keeps_junit_well_formed(text: str) -> None:
    root = junit_of(samples.with_hostile_text(text))
    failure = next(root.iter("failure"))
    assert bare(text) in failure.attrib["message"]


@pytest.mark.parametrize("text", samples.HOSTILE)
def test_hostile_text_keeps_sarif_valid(text: str) -> None:
    results = sarif_of(samples.with_hostile_text(text))["runs"][0]["results"]
    assert any(bare(text) in result["message"]["text"] for result in results)


@pytest.mark.parametrize("text", samples.HOSTILE)
def test_hostile_text_is_no_formula_in_csv(text: str) -> None:
    out = render_checks("csv", [samples.with_hostile_text(text)])
    rows = list(csv.reader(io.StringIO(out, newline="")))
    assert len(rows) == 1 + 5
    assert len({len(row) for row in rows}) == 1
    cells = [cell for row in rows for cell in row]
    assert not [c for c in cells if c.startswith(("=", "+", "@", "\t", "\r"))]
    assert not [c for c in cells if c.startswith("-") and not c[1:2].isdigit()]


def test_csv_keeps_figures_exactly() -> None:
    verdict = samples.fixed_wing()
    rows = list(csv.DictReader(io.StringIO(render_checks("csv", [verdict]), newline="")))
    assert [float(row["value"]) for row in rows] == [r.value for r in verdict.requirements]
    assert rows[0]["requirement"] == "ACC-1"


def test_spreadsheet_safe_leaves_plain_text_alone() -> None:
    assert spreadsheet_safe("u-blox F9P") == "u-blox F9P"
    assert spreadsheet_safe("=1+1") == "'=1+1"
    assert spreadsheet_safe("  =1+1") == "'  =1+1"


@pytest.mark.parametrize("text", samples.HOSTILE)
def test_hostile_text_is_literal_in_markdown(text: str) -> None:
    out = render_checks("markdown", [samples.with_hostile_text(text)])
    assert "<script" not in out
    assert "<img" not in out
    assert not re.search(r"(?<!&#64;)@everyone", out)
    columns = 0
    for line in out.splitlines():
        bare = len(re.findall(r"(?<!\\)\|", line)) if line.startswith("|") else 0
        assert bare == columns or 0 in (bare, columns), line
        columns = bare


def test_markdown_escapes_what_markup_is_made_of() -> None:
    assert markdown_safe("a*b_c`d`[e](f)|g") == r"a\*b\_c\`d\`\[e\]\(f\)\|g"


@pytest.mark.parametrize(
    "code", [*range(32), 127, *range(128, 160), 0xD800, 0xFFFE, 0x202E, 0x2028]
)
def test_visible_leaves_no_character_that_breaks_an_output(code: int) -> None:
    shown = visible(f"a{chr(code)}b")
    assert chr(code) not in shown
    assert shown.startswith("a")
    assert shown.endswith("b")
    ElementTree.fromstring(f"<x>{shown}</x>")
    shown.encode("utf-8")


def test_visible_keeps_ordinary_text() -> None:
    text = "Måling 100 µs, 測量, \N{GREEK SMALL LETTER TAU}_crit 😀"
    assert visible(text) == text


@pytest.mark.parametrize("name", TEXT_FORMATS)
def test_same_input_same_bytes(name: str) -> None:
    verdicts = [samples.fixed_wing(), samples.infeasible(), samples.two_stages(), samples.REFUSED]
    assert render_checks(name, verdicts) == render_checks(name, verdicts)


@pytest.mark.parametrize("name", TEXT_FORMATS)
def test_a_bare_verdict_is_enough(name: str) -> None:
    full = samples.fixed_wing()
    verdict = Verdict(
        verdict="indeterminate", spec=full.spec, horizon=full.horizon, provenance=full.provenance
    )
    assert render_checks(name, [verdict])


def test_notices_count_what_counts() -> None:
    levels = [notice.level for notice in notices(samples.failing())]
    warnings = len(samples.failing().warnings)
    assert levels == ["fail", "pass", "pass", "pass", "pass", *["warning"] * warnings]


def test_unknown_format_is_refused() -> None:
    with pytest.raises(ValueError, match="unknown format pdf"):
        render_checks("pdf", [samples.fixed_wing()])


def test_one_remedy_is_not_offered_as_a_choice() -> None:
    plain = samples.infeasible()
    assert plain.infeasibility is not None
    fix = plain.infeasibility.fixes[0]
    for count, lead in ((1, "This would do: "), (3, "Any one of these would do: ")):
        ways_out = tuple(replace(fix, text=f"way {k}") for k in range(count))
        verdict = samples.explained(plain, fixes=ways_out)
        ways = "; ".join(f"way {k}" for k in range(count))
        said = [notice.message for notice in notices(verdict) if "would do" in notice.message]
        assert said
        assert all(f"{lead}{ways}." in message for message in said)
