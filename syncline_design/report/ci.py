"""A verdict as a list of findings with their place in the spec: what CI formats are made of."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final, Literal

from syncline_design.report import numbers
from syncline_design.report.text import sentence_list
from syncline_design.report.verdict_words import (
    Json,
    design_sentence,
    is_waived,
    items,
    kind_text,
    margin_text,
    outcome,
    part,
    requirement_name,
    value_text,
    waiver_text,
)

Level = Literal["pass", "fail", "undecided", "not_reached", "waived", "warning"]

SILENT: Final = ("pass", "not_reached")  # nothing to annotate


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing said about a spec: rule (the requirement's kind), id, place, one sentence."""

    level: Level
    rule: str
    id: str
    file: str
    line: int
    column: int
    message: str
    justification: str = ""


def spec_file(verdict: Json) -> str:
    """The path the user gave."""
    return str(part(verdict, "spec").get("file") or verdict.get("file") or "spec.yaml")


def spec_name(verdict: Json) -> str:
    """The system's name, or its file where it could not be read."""
    return str(part(verdict, "spec").get("name") or spec_file(verdict))


def findings(verdict: Json) -> list[Finding]:
    """Every requirement, problem, reason of infeasibility and warning of a verdict."""
    file = spec_file(verdict)
    found = [_problem(entry, file) for entry in items(verdict, "problems")]
    rows = items(verdict, "requirements")
    found += [_requirement(row, file, verdict, _conflict_of(row, verdict)) for row in rows]
    if verdict.get("verdict") in ("infeasible", "indeterminate") and not found_failure(found):
        found.insert(0, _no_design(verdict, file))
    found += [
        Finding("warning", str(entry.get("code") or "warning"), "", file,
                *_about(entry, rows), str(entry.get("message")))
        for entry in items(verdict, "warnings")
    ]  # fmt: skip
    return found


def found_failure(found: list[Finding]) -> bool:
    """Whether something already fails a job."""
    return any(finding.level == "fail" for finding in found)


def _place(entry: Json, key: str) -> int:
    value = numbers.finite(entry.get(key))
    return 1 if value is None or value < 1 else int(value)


def _about(entry: Json, requirements: list[Json]) -> tuple[int, int]:
    """Line and column of a warning: its own, else those of the requirement it is about."""
    named = entry.get("requirement")
    at = next((row for row in requirements if named and row.get("id") == named), entry)
    at = entry if entry.get("line") is not None else at
    return _place(at, "line"), _place(at, "column")


def _problem(entry: Json, file: str) -> Finding:
    path = entry.get("path")
    message = (f"{path}: " if path else "") + str(entry.get("message"))
    return Finding("fail", "spec", "", str(entry.get("file") or file), _place(entry, "line"),
                   _place(entry, "column"), message)  # fmt: skip


def _requirement(row: Json, file: str, verdict: Json, conflict: list[str]) -> Finding:
    levels: dict[str, Level] = {"pass": "pass", "fail": "fail"}
    level = levels.get(str(row.get("status")), "undecided")
    message = requirement_sentence(row)
    if level == "fail" and is_waived(row):
        level = "waived"
    elif level != "pass" and not part(verdict, "design") and str(row.get("id")) in conflict:
        others = [name for name in conflict if name != str(row.get("id"))]
        level, message = "fail", _conflict_text(row, others, verdict)
    elif level == "undecided" and not part(verdict, "design"):
        level = "not_reached"
    return Finding(level, str(row.get("kind")), str(row.get("id")), file, _place(row, "line"),
                   _place(row, "column"), message, waiver_text(row))  # fmt: skip


def _conflict_of(row: Json, verdict: Json) -> list[str]:
    """Ids of the conflict that a requirement is part of; empty where it is in none."""
    why = part(verdict, "infeasibility")
    further = why.get("further_conflicts")
    conflicts = [items(part(why, "conflict"), "requirements")]
    conflicts += further if isinstance(further, list) else []
    for members in conflicts:
        ids = [requirement_name(entry) for entry in members]
        if str(row.get("id")) in ids:
            return ids
    return []


def _conflict_text(row: Json, others: list[str], verdict: Json) -> str:
    limit = f"{row.get('id')}: {kind_text(row)} limited to {value_text(row, 'limit')}"
    with_others = f" together with {sentence_list(others)}" if others else ""
    return f"{limit} cannot be met{with_others}.{_fixes(verdict)}"


def _fixes(verdict: Json) -> str:
    texts = [str(entry.get("text")) for entry in items(part(verdict, "infeasibility"), "fixes")]
    if texts:
        lead = "This" if len(texts) == 1 else "Any one of these"
        return f" {lead} would do: {'; '.join(texts)}."
    joint = part(verdict, "infeasibility").get("joint_fixes")
    sets = [" and ".join(str(f.get("text")) for f in fixes) for fixes in joint or ()]
    return f" Together these would do: {'; or '.join(sets)}." if sets else ""


def requirement_sentence(row: Json) -> str:
    """`ACC-1: Syncline error 93.9 mm exceeds its limit 50 mm (87.8 % over)`."""
    status = str(row.get("status"))
    limit = value_text(row, "limit")
    if row.get("kind") == "feasible" and status == "fail":
        return f"{row.get('id')}: this payload cannot exist; {row.get('note')}"
    if numbers.finite(row.get("value")) is None:
        text = f"{row.get('id')}: {kind_text(row)} limited to {limit}; no value"
    else:
        verb = {"pass": "keeps", "fail": "does not keep"}.get(status, "is undecided against")
        text = (
            f"{row.get('id')}: {kind_text(row)} {value_text(row, 'value')} {verb} its limit "
            f"{limit} ({margin_text(row)})"
        )
    return text + (f"; {row['note']}" if row.get("note") else "")


def _no_design(verdict: Json, file: str) -> Finding:
    word = str(verdict.get("verdict"))
    level: Level = "fail" if word == "infeasible" else "undecided"
    return Finding(level, word, "", file, 1, 1, no_design_text(verdict))


def no_design_text(verdict: Json) -> str:
    """Why there is no design, and what would give one."""
    text = f"{outcome(verdict).word}. {design_sentence({**verdict, 'design': None})}"
    reason = verdict.get("reason")
    return text + (f" {reason}" if reason else "") + _fixes(verdict)


def all_findings(verdicts: list[Any]) -> Iterator[Finding]:
    """Findings of several verdicts, in their order."""
    for verdict in verdicts:
        yield from findings(verdict)
