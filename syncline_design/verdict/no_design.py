"""Verdicts without a design: the time was over, or none meets the spec."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Final

from syncline_design.choice.outcome import Proof
from syncline_design.choice.table import Problem
from syncline_design.model.quantity import Quantity
from syncline_design.spec.case import Case
from syncline_design.spec.requirement import Requirement
from syncline_design.verdict.cautions_of_facts import implausible_cautions
from syncline_design.verdict.cautions_of_waivers import waiver_cautions
from syncline_design.verdict.choice_data import without_choice
from syncline_design.verdict.held import placed
from syncline_design.verdict.named import ChoiceResult
from syncline_design.verdict.settings import CheckSettings
from syncline_design.verdict.tree import (
    UNITS,
    Caution,
    RequirementResult,
    Status,
    Verdict,
    decided,
)
from syncline_design.verdict.verified import framed

if TYPE_CHECKING:
    from syncline_design.choice.variations import Build

LATE: Final = Caution("time-limit", "the time limit ended the search for reasons and remedies")


def unfinished_verdict(
    case: Case, problem: Problem | None, settings: CheckSettings, why: str
) -> Verdict:
    """A verdict that the time limit left without a design."""
    return replace(
        framed("indeterminate", case, problem, settings),
        requirements=tuple(
            placed(case, index, one, unmet(case, one, in_conflict=False), settings)
            for index, one in enumerate(case.spec.requirements)
        ),
        warnings=(Caution("time-limit", f"{why}; no design was found by then"),),
        choice=ChoiceResult(Proof(settings.road, False, False)),
    )


def infeasible_verdict(
    case: Case, problem: Problem, settings: CheckSettings, build: Build
) -> Verdict:
    """Why there is no design, and which single changes would help, whatever is waived aside."""
    # late: 33 ms that a spec with a design need not wait
    from syncline_design.choice.explain import explain
    from syncline_design.choice.waivers import lifted, waived
    from syncline_design.verdict.nearest import nearest

    if not case.eased and (ids := waived(case, settings.day)):
        case = lifted(case, ids)
        problem = build(case)
    found = explain(case, problem, build)
    conflict = {member.id for members in found.conflicts for member in members}
    minimal = found.conflict.minimal
    rows = tuple(
        placed(case, i, one, unmet(case, one, one.id in conflict, minimal), settings)
        for i, one in enumerate(case.spec.requirements)
    )
    return replace(
        framed("infeasible", case, problem, settings),
        requirements=rows,
        warnings=(
            *((LATE,) if found.cut_short else ()),
            *waiver_cautions(case, rows),
            *implausible_cautions(case),
        ),
        infeasibility=found,
        nearest=None if settings.brief else nearest(case, problem, found, build),
        choice=without_choice(problem),
    )


def unmet(
    case: Case, one: Requirement, in_conflict: bool, minimal: bool = True
) -> RequirementResult:
    """A requirement of a spec without a design: part of the conflict, or not reached."""
    unit = UNITS.get(one.kind, case.spec.currency)
    quantile = one.share
    status: Status = "fail" if in_conflict else "indeterminate"
    part = "part of the conflict" if minimal else "perhaps part of the conflict"
    note = part if in_conflict else "no design to judge it by"
    limit = one.limit
    if one.kind == "cost" and isinstance(limit, Quantity):
        limit = float(case.spec.in_currency(limit))
    return decided(
        id=one.id, kind=one.kind, status=status, value=None, limit=float(limit), unit=unit,
        quantile=quantile, note=note, axis=one.axis or one.of,
    )  # fmt: skip
