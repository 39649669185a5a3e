"""What a verdict says in words: outcome, one-sentence design, margins, reasons."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from syncline_design.report import numbers
from syncline_design.report.document import Outcome
from syncline_design.report.text import sentence_list, visible
from syncline_design.report.words import (
    KINDS,
    OBJECTIVES,
    OUTCOMES,
    PRIMITIVES,
    QUALIFYING,
    STATUSES,
    TERMS,
)

Json = Mapping[str, Any]


def part(source: Json | None, key: str) -> Json:
    """A nested mapping, empty when missing or null."""
    value = None if source is None else source.get(key)
    return value if isinstance(value, Mapping) else {}


def items(source: Json | None, key: str) -> list[Json]:
    """A nested list of mappings, empty when missing or null."""
    value = None if source is None else source.get(key)
    return [entry for entry in value or [] if isinstance(entry, Mapping)]


def named(source: Json | None, key: str) -> list[tuple[str, Json]]:
    """The entries of a nested mapping that are mappings themselves, with their names."""
    return [
        (str(name), entry)
        for name, entry in part(source, key).items()
        if isinstance(entry, Mapping)
    ]


def outcome(verdict: Json) -> Outcome:
    """The verdict's outcome; an unknown word counts as no verdict.

    A design that meets while a larger figure of its own does not says so in the same breath.
    """
    found = OUTCOMES.get(str(verdict.get("verdict")), OUTCOMES["indeterminate"])
    return replace(found, word=found.word + qualification(verdict))


def qualification(verdict: Json) -> str:
    """What a headline adds to `meets`: warnings that a figure exceeds the limit; else nothing."""
    if verdict.get("verdict") != "meets":
        return ""
    told = [
        f"{figure} exceeds the limit of {visible(entry.get('requirement') or 'accuracy')} ({code})"
        for code, figure in QUALIFYING.items()
        for entry in items(verdict, "warnings")
        if entry.get("code") == code
    ]
    return f", but {sentence_list(told)}" if told else ""


def status_of(row: Json) -> Outcome:
    """A requirement's outcome; a failing one with a waiver in force is waived."""
    status = str(row.get("status"))
    if status == "fail" and is_waived(row):
        return STATUSES["waived"]
    return STATUSES.get(status, STATUSES["indeterminate"])


def is_waived(row: Json) -> bool:
    """Whether a waiver covers this requirement (an expired one says so itself)."""
    waiver = part(row, "waiver")
    return bool(waiver) and not waiver.get("expired", False)


def waiver_text(row: Json) -> str:
    """`waived until 2027-01-31: reason`, or why it no longer counts."""
    waiver = part(row, "waiver")
    if not waiver:
        return ""
    state = "waiver expired on" if waiver.get("expired") else "waived until"
    until = waiver.get("expires")
    head = f"{state} {until}" if until else "waived"
    return f"{head}: {waiver.get('reason', 'no reason given')}"


def kind_text(row: Json) -> str:
    """What a requirement limits."""
    kind = str(row.get("kind"))
    quantile = numbers.finite(row.get("quantile"))
    if kind == "monte_carlo" and quantile is not None:
        return f"simulated error, {numbers.percent(quantile)} quantile"
    return KINDS.get(kind, kind)


def relative_margin(row: Json) -> float | None:
    """(limit - value) / limit: what is left of the limit; None where it cannot be said."""
    value, limit = numbers.finite(row.get("value")), numbers.finite(row.get("limit"))
    return None if value is None or not limit else (limit - value) / limit


def margin_text(row: Json) -> str:
    """`12.4 % to spare` or `8.1 % over`."""
    margin = relative_margin(row)
    if margin is None:
        return numbers.MISSING
    if margin == 0.0:
        return "exactly at the limit"
    word = "to spare" if margin > 0 else "over"
    return f"{numbers.percent(abs(margin))} {word}"


def value_text(row: Json, key: str) -> str:
    """A requirement's value or limit in its unit."""
    return numbers.in_unit(row.get(key), str(row.get("unit") or ""))


def tightest(rows: list[Json]) -> Json | None:
    """The requirement with the least relative margin."""
    known = [row for row in rows if relative_margin(row) is not None]
    return min(known, key=lambda row: relative_margin(row) or 0.0) if known else None


def term_text(entry: Json) -> str:
    """A ledger term in words with its symbol; an unknown one as it stands."""
    term = str(entry.get("term"))
    return TERMS.get(term, term)


def role_phrase(entry: Json) -> str:
    """`SBG Apogee (1PPS input, timer capture)`."""
    primitive = PRIMITIVES.get(str(entry.get("primitive")), str(entry.get("primitive")))
    method = entry.get("timestamping_name") or entry.get("timestamping")
    how = primitive if not method else f"{primitive}, {method}"
    return f"{entry.get('name') or entry.get('sensor')} ({how})"


def design_sentence(verdict: Json) -> str:
    """The design in one sentence; for an infeasible spec, what stands in the way."""
    stages = items(part(verdict, "design"), "stages")
    if not stages:
        return _no_design_sentence(verdict)
    many = len(stages) > 1
    phrases = []
    for stage in stages:
        roles = [role_phrase(entry) for _, entry in named(stage, "roles")]
        where = f" on {stage.get('name')}" if many else ""
        phrases.append(sentence_list(roles) + where)
    platforms = sentence_list([str(p) for p in _platform_names(verdict)])
    chosen = part(verdict, "spec").get("open_roles")
    lead = "Chosen payload" if chosen else "Payload as pinned"
    return f"{lead} for {platforms}: {'; '.join(phrases)}."


def _platform_names(verdict: Json) -> list[str]:
    stages = items(part(verdict, "spec"), "stages")
    names = [part(stage, "platform") for stage in stages]
    return [str(p.get("name") or p.get("id") or "the platform") for p in names] or ["the platform"]


def requirement_name(entry: Json) -> str:
    """The id of a requirement, or words for the sync limit that no one wrote."""
    return str(entry.get("id") or "the implied sync requirement")


def _no_design_sentence(verdict: Json) -> str:
    problems = items(verdict, "problems")
    if problems:
        plural = "problem" if len(problems) == 1 else "problems"
        return f"{len(problems)} {plural} in the file; nothing was computed."
    infeasibility = part(verdict, "infeasibility")
    members = items(part(infeasibility, "conflict"), "requirements")
    conflict = [requirement_name(member) for member in members]
    if conflict:
        listed = sentence_list(conflict)
        ending = "hold together" if conflict[1:] else "be met"
        return f"{listed[0].upper()}{listed[1:]} cannot {ending}."
    stuck = [f"{r.get('stage')} {r.get('role')}"
             for r in items(infeasibility, "roles_without_options")]  # fmt: skip
    if stuck:
        return f"No candidate fits for {sentence_list(stuck)}."
    return "No design was found."


def selection_reason(verdict: Json, stage: str, role: str) -> str:
    """Why this option stands in the design: pinned, or chosen among how many."""
    open_roles = part(verdict, "spec").get("open_roles")
    if not isinstance(open_roles, list) or f"{stage}.{role}" not in open_roles:
        return "pinned in the spec"
    objective = str(part(verdict, "spec").get("objective") or "cost")
    word = OBJECTIVES.get(objective, objective)
    excluded = [entry for entry in items(part(verdict, "choice"), "excluded")
                if (entry.get("stage"), entry.get("role")) == (stage, role)]  # fmt: skip
    if not excluded:
        return f"chosen for {word} of the whole design"
    plural = "option" if len(excluded) == 1 else "options"
    return f"chosen for {word} of the whole design; {len(excluded)} {plural} ruled out before"
