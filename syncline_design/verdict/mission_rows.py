"""Rows of a family: each requirement at its worst mission, sums of what is bought once."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction

from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import to_digits
from syncline_design.spec.case import Case, Mission
from syncline_design.spec.selection import Selection
from syncline_design.verdict.family_named import Sums
from syncline_design.verdict.named import (
    RankedDesign,
)
from syncline_design.verdict.recheck_sums import BUDGETS
from syncline_design.verdict.tree import (
    RequirementResult,
    Verdict,
    Word,
    finite,
    word_of,
)

_STATUS_ORDER = {"fail": 0, "indeterminate": 1, "pass": 2}


@dataclass(frozen=True, slots=True)
class JudgedMission:
    """One mission with the family's design: its verdict, and its rows at their worst corner."""

    mission: Mission
    selection: Selection
    verdict: Verdict
    rows: tuple[RequirementResult, ...]
    alone: RankedDesign | None = None

    @property
    def word(self) -> Word:
        """meets, fails or indeterminate."""
        return word_of(self.rows)


def worst_rows(rows: Sequence[Sequence[RequirementResult]]) -> tuple[RequirementResult, ...]:
    """Of each requirement the worst row; the last rows are those at figures as given."""
    given = {row.id: row for row in rows[-1]}
    out: dict[str, RequirementResult] = {}
    for some in rows:
        for row in some:
            known = out.get(row.id)
            if known is None or _badness(row) < _badness(known):
                out[row.id] = row
    if len(rows) == 1:
        return tuple(out.values())
    return tuple(_at_worst(row, given.get(row.id)) for row in out.values())


def _at_worst(row: RequirementResult, given: RequirementResult | None) -> RequirementResult:
    if given is None or given.value is None or given.value == row.value:
        return row
    unit = "" if given.unit == "1" else f" {given.unit}"
    told = (
        f"at the worst end of the datasheet intervals; {to_digits(given.value, 6)}{unit} at "
        f"given figures"
    )
    return replace(row, note="; ".join(part for part in (row.note, told) if part))


def _badness(row: RequirementResult) -> tuple[int, float]:
    margin = math.inf if row.margin is None else row.margin
    return _STATUS_ORDER[row.status], margin


def with_sums(
    case: Case, rows: Sequence[RequirementResult], sums: Sums
) -> tuple[RequirementResult, ...]:
    """Rows with cost, mass and power of all that the family buys."""
    limits = {one.id: case.limit(one) for one in case.spec.requirements}
    return tuple(
        _with_sum(row, limits[row.id], sums[row.kind]) if row.kind in BUDGETS else row
        for row in rows
    )


def _with_sum(
    row: RequirementResult, limit: Fraction, amount: Fraction | None
) -> RequirementResult:
    if amount is None:
        return row
    passed = amount <= limit
    margin = finite(float(limit - amount))
    return replace(row, status="pass" if passed else "fail", value=float(amount), margin=margin)


def least_own_margin(rows: Sequence[RequirementResult]) -> float:
    """By how much of a limit a mission's own figures stay below it; budgets are all missions'."""
    own = [row for row in rows if row.kind not in BUDGETS]
    shares = [row.margin / row.limit for row in own if row.margin is not None and row.limit]
    return min(shares, default=math.inf)


def family_rows(judged: Sequence[JudgedMission]) -> tuple[RequirementResult, ...]:
    """Of each requirement the row of the mission that is nearest to its limit, or beyond it."""
    worst: dict[str, tuple[RequirementResult, str]] = {}
    for one in judged:
        for row in one.rows:
            share = -math.inf if row.margin is None else row.margin / (row.limit or 1.0)
            known = worst.get(row.id)
            if known is None or (_STATUS_ORDER[row.status], share) < _order_of(known[0]):
                worst[row.id] = (row, one.mission.name)
    return tuple(
        row
        if row.kind in BUDGETS
        else replace(row, note="; ".join(p for p in (f"in mission {name}", row.note) if p))
        for row, name in worst.values()
    )


def _order_of(row: RequirementResult) -> tuple[int, float]:
    share = -math.inf if row.margin is None else row.margin / (row.limit or 1.0)
    return _STATUS_ORDER[row.status], share
