"""A verdict as a list of notices with their place in the spec: what CI formats are made of."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Final, Literal

from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.sentences import sentence_list
from syncline_design.report import numbers
from syncline_design.report.verdict_words import (
    kind_text,
    margin_text,
    of_mission,
    outcome,
    quantity_then,
    since_sentence,
    status_id,
    waiver_text,
)
from syncline_design.verdict.obstacle import obstacle_sentence, remedies_sentence, requirement_name
from syncline_design.verdict.since import Baseline
from syncline_design.verdict.tree import (
    Caution,
    Checked,
    FileProblem,
    Refused,
    RequirementResult,
    Verdict,
)

Level = Literal["pass", "fail", "undecided", "not_reached", "waived", "known", "warning"]

SILENT: Final = ("pass", "not_reached")  # nothing to annotate


@dataclass(frozen=True, slots=True)
class Notice:
    """One thing said about a spec: rule (the requirement's kind), id, place, one sentence.

    mission: whose requirement it is, where a spec has several.  figures: of a requirement, by name,
    in the unit that is named beside them.
    """

    level: Level
    rule: str
    id: str
    file: str
    line: int
    column: int
    message: str
    justification: str = ""
    figures: tuple[tuple[str, str], ...] = ()
    mission: str = ""

    @property
    def label(self) -> str:
        """The requirement by its id, after the mission whose it is; empty where it is of none."""
        return of_mission(self.mission, self.id)


def notices(verdict: Checked) -> list[Notice]:
    """Every requirement, problem, reason of infeasibility and warning of a verdict."""
    if isinstance(verdict, Refused):
        return [_problem(entry) for entry in verdict.problems]
    found = list(_requirements(verdict))
    if verdict.verdict in ("infeasible", "indeterminate") and not _is_told(found, verdict):
        found.insert(0, _no_design(verdict))
    left = [entry for entry in verdict.warnings if not _says_waiver(entry, found)]
    return found + [_warning(entry, verdict) for entry in left]


def _requirements(verdict: Verdict) -> Iterator[Notice]:
    """Every requirement; of several missions each mission's, at the place of its own limit."""
    for mission, row in verdict.judged_rows:
        found = _requirement(row, verdict, mission)
        if mission is None:
            yield found
        else:
            message = f"mission {mission}: {found.message}"
            yield replace(found, mission=mission, message=message)


def closing_words(verdict: Checked) -> str:
    """The outcome and, with a baseline, what became of it since."""
    said = outcome(verdict).word
    if isinstance(verdict, Refused) or verdict.baseline is None:
        return said
    return f"{said}. {since_sentence(verdict.baseline, verdict)}"


def _is_told(found: list[Notice], verdict: Verdict) -> bool:
    """Whether something fails a job already, or would but for the baseline."""
    forgiven = verdict.baseline is not None and not verdict.baseline.worse
    telling = ("fail", "known") if forgiven else ("fail",)
    return any(notice.level in telling for notice in found)


def _warning(entry: Caution, verdict: Verdict) -> Notice:
    """At the requirement that it is about, of the mission that it is about; else at the top."""
    places = [
        (row.line or 1, row.column or 1)
        for mission, row in verdict.judged_rows
        if row.id == entry.requirement and (not entry.missions or mission in entry.missions)
    ]
    place = places[0] if places else (1, 1)
    return Notice("warning", entry.code, "", verdict.file, *place, entry.message)


def _says_waiver(entry: Caution, found: list[Notice]) -> bool:
    """Whether what a warning says of a waiver stands with the requirement itself."""
    told = {one.id for one in found if one.level in ("waived", "fail")}
    return entry.code == "waiver" and entry.requirement in told


def _problem(entry: FileProblem) -> Notice:
    message = (f"{entry.path}: " if entry.path else "") + entry.message
    place = (max(entry.line, 1), max(entry.column, 1))
    return Notice("fail", "spec", "", entry.file, *place, message)


def _requirement(row: RequirementResult, verdict: Verdict, mission: str | None = None) -> Notice:
    levels: dict[str, Level] = {"pass": "pass", "fail": "fail", "indeterminate": "undecided"}
    level, message = levels[row.status], requirement_sentence(row)
    conflict = _conflict_of(row, verdict)
    if level == "fail" and row.is_waived:
        level = "waived"
    elif level != "pass" and verdict.design is None and row.id in conflict:
        others = [name for name in conflict if name != row.id]
        level, message = "fail", _conflict_text(row, others, verdict)
    elif level == "undecided" and verdict.design is None:
        level = "not_reached"
    place = (row.line or 1, row.column or 1)
    known, why = verdict.baseline, waiver_text(row) if level == "waived" else ""
    if level == "fail" and row.waiver and row.waiver.expired:
        message = _with(message, waiver_text(row))
    if known is not None and level in ("fail", "undecided") and known.forgives(row.id, mission):
        level, why = "known", _no_worse(known)
    elif known is not None and level != "pass" and not known.forgives(row.id, mission):
        message = _with(message, _then(known, row, mission))
    return Notice(level, row.kind, row.id, verdict.file, *place, message, why, _figures(row))


def _with(message: str, more: str) -> str:
    """A message with what else is to be said, after its last stop if it has one."""
    if not more:
        return message
    if message.endswith("."):
        return f"{message} {more[0].upper()}{more[1:]}."
    return f"{message}; {more}"


def _no_worse(known: Baseline) -> str:
    return f"no worse than in {known.file}"


def _then(known: Baseline, row: RequirementResult, mission: str | None) -> str:
    """How a requirement stood in the baseline; that it is new, where it was not there."""
    one = known.of(row.id, mission)
    if one is None or known.verdict is None:
        return ""
    was = one.was
    if was is None:
        return f"new: it is not in {known.file}" if one.change == "new" else ""
    if was.kind is not None:
        return f"new: in {known.file} it limited {quantity_then(was)}"
    limit = numbers.limit(was)
    if was.value is None:
        return f"in {known.file} its limit was {limit}" if was.limit != row.limit else ""
    waived = ", waived" if was.waived else ""
    return f"in {known.file} it was {numbers.held(was.value, was)} of {limit}{waived}"


def _figures(row: RequirementResult) -> tuple[tuple[str, str], ...]:
    """What a requirement is held at, at full precision; what has no figure is left out."""
    known = (("limit", row.limit), ("value", row.value), ("margin", row.margin))
    shown = [(name, repr(value)) for name, value in known if numbers.finite(value) is not None]
    return (
        *shown,
        ("unit", row.unit),
        ("status", status_id(row)),
    )


def _conflict_of(row: RequirementResult, verdict: Verdict) -> list[str]:
    """Ids of the conflict that a requirement is part of; empty where it is in none."""
    why = verdict.infeasibility
    for members in () if why is None else why.conflicts:
        ids = [requirement_name(entry) for entry in members]
        if row.id in ids:
            return ids
    return []


def _conflict_text(row: RequirementResult, others: list[str], verdict: Verdict) -> str:
    limit = f"{row.id}: {kind_text(row)} limited to {numbers.limit(row)}"
    with_others = f" together with {sentence_list(others)}" if others else ""
    return f"{limit} cannot be met{with_others}.{_fixes(verdict)}"


def _fixes(verdict: Verdict) -> str:
    words = remedies_sentence(verdict.infeasibility)
    return f" {words}" if words else ""


def requirement_sentence(row: RequirementResult) -> str:
    """`ACC-1: Syncline error 93.9 mm exceeds its limit 50 mm (87.8 % over)`."""
    limit = numbers.limit(row)
    if row.kind == "feasible" and row.status == "fail":
        return f"{row.id}: this payload cannot exist; {row.note}"
    if row.value is None:
        text = f"{row.id}: {kind_text(row)} limited to {limit}; no value"
    else:
        verbs = {"pass": "keeps", "fail": "does not keep", "indeterminate": "is undecided against"}
        value = numbers.held(row.value, row)
        text = (
            f"{row.id}: {kind_text(row)} {value} {verbs[row.status]} its limit {limit} "
            f"({margin_text(row)})"
        )
    return text + (f"; {row.note}" if row.note else "")


def _no_design(verdict: Verdict) -> Notice:
    level: Level = "fail" if verdict.verdict == "infeasible" else "undecided"
    why = ""
    if verdict.baseline is not None and not verdict.baseline.worse:
        level, why = "known", _no_worse(verdict.baseline)
    text = f"{outcome(verdict).word}. {obstacle_sentence(verdict.infeasibility)}{_fixes(verdict)}"
    return Notice(level, verdict.verdict, "", verdict.file, 1, 1, text, why)


def all_notices(verdicts: Iterable[Checked]) -> Iterator[Notice]:
    """Findings of several verdicts, in their order."""
    for verdict in verdicts:
        yield from notices(verdict)
