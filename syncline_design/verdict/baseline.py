"""A verdict against an earlier one of the same spec: only what got worse fails.

Worse is: a requirement passed and no longer does, or was open and fails; it fails by more (value
over limit, of a simulated one where the two intervals do not meet; of two verdicts without a
design, by a lower limit); it is new, or limits another quantity than it did, and does not pass; or
the verdict as a whole fell from `meets` to `indeterminate`, `fails`, `infeasible`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Final

from syncline_design.verdict.since import Baseline, Earlier, RequirementSince, SinceBaseline
from syncline_design.verdict.tree import RequirementResult, Verdict, waived_misses

_OUTCOMES: Final = ("meets", "indeterminate", "fails", "infeasible")  # each worse than the last
_STATUSES: Final = ("pass", "indeterminate", "fail")
_ROUNDING = 1e-9  # relative; figures that differ by less are the same


def against(verdict: Verdict, earlier: Sequence[Verdict], file: str) -> Verdict:
    """A verdict that knows the one of the same spec in a baseline.

    The same spec is the one of that path, else the only one of that name; a lone verdict of neither
    is another spec's, whose misses forgive none here.
    """
    before = _of_same_spec(verdict, earlier)
    if before is None:
        found = Baseline(file, None, verdict.verdict != "meets", ())
        return replace(verdict, baseline=found)
    rows = tuple(_rows(verdict, before))
    found = Baseline(file, before.verdict, _fell(verdict, before), rows)
    missed = [row.id for row in verdict.requirements if _standing(row) > 0]
    worse = found.worse or any(not found.forgives(one) for one in missed)
    return replace(verdict, baseline=replace(found, worse=worse))


def _of_same_spec(verdict: Verdict, earlier: Sequence[Verdict]) -> Verdict | None:
    for same in (
        [one for one in earlier if one.file == verdict.file],
        [one for one in earlier if one.name == verdict.name],
    ):
        if len(same) == 1:
            return same[0]
    return None


def _rows(verdict: Verdict, before: Verdict) -> Iterator[RequirementSince]:
    old = {row.id: row for row in before.requirements}
    for row in verdict.requirements:
        was = old.pop(row.id, None)
        if was is not None and _quantity(row) != _quantity(was):
            kind, quantile, axis = _quantity(was)
            then = replace(_earlier(was), kind=kind, quantile=quantile, axis=axis)
            yield RequirementSince(row.id, "new", then)
            continue
        if was is None and _is_implied(row) and before.design is None:
            change: SinceBaseline = _without_design(verdict, before, row, row)
        elif was is None:
            change = "new"
        elif None in (verdict.design, before.design):
            change = _without_design(verdict, before, row, was)
        else:
            change = _since(row, was)
        yield RequirementSince(row.id, change, None if was is None else _earlier(was))
    for was in old.values():
        if verdict.design is not None or not _is_implied(was):
            yield RequirementSince(was.id, "gone", _earlier(was))


def _quantity(row: RequirementResult) -> tuple[str, float | None, str | None]:
    """What a requirement limits; figures of different quantities do not compare."""
    axis = row.axis or "3d" if row.kind in ("rmse", "quantile") else row.axis
    return row.kind, row.quantile, axis


def _is_implied(row: RequirementResult) -> bool:
    """A limit that no spec writes: only a design is held against it, so it is never new or gone."""
    return row.line is None


def _earlier(row: RequirementResult) -> Earlier:
    waived = bool(waived_misses([row])) or None
    return Earlier(row.status, row.value, row.limit, row.unit, row.limit_written, waived)


def _without_design(
    verdict: Verdict, before: Verdict, row: RequirementResult, was: RequirementResult
) -> SinceBaseline:
    """Where one side has no design its rows have no figures: the verdict as a whole decides.

    Where neither has one, whether the requirement is a part of what cannot be met; then its limit.
    """
    if row.status == "pass":
        return _word(_standing(row) - _standing(was))
    if verdict.verdict != before.verdict:
        if row.status == "indeterminate" and verdict.design is None:
            return "same"  # no part of what cannot be met, and no design to judge it by
        return "worse" if _fell(verdict, before) else "better"
    step = _standing(row) - _standing(was)
    if step == 0 and row.status == "fail" and row.unit == was.unit:
        step = (row.limit < was.limit) - (row.limit > was.limit)
    return _word(step)


def _fell(verdict: Verdict, before: Verdict) -> bool:
    return _OUTCOMES.index(verdict.verdict) > _OUTCOMES.index(before.verdict)


def _since(now: RequirementResult, then: RequirementResult) -> SinceBaseline:
    step = _standing(now) - _standing(then)
    both_missed = now.status == then.status == "fail"
    if both_missed and step <= 0 and now.unit == then.unit:  # a waiver makes no figure better
        step = _further(now, then) - _further(then, now)
    return _word(step)


def _word(step: int) -> SinceBaseline:
    return "same" if step == 0 else "worse" if step > 0 else "better"


def _standing(row: RequirementResult) -> int:
    """0 passes or is waived, 1 open, 2 fails."""
    return 0 if row.is_waived else _STATUSES.index(row.status)


def _further(one: RequirementResult, other: RequirementResult) -> bool:
    """Whether one misses its limit by more than the other does its own, beyond doubt."""
    least = one.value if one.low is None else one.low
    most = other.value if other.high is None else other.high
    if least is None or most is None or one.limit <= 0.0 or other.limit <= 0.0:
        return False
    return least / one.limit > most / other.limit * (1.0 + _ROUNDING)
