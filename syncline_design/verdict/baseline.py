"""A verdict against an earlier one of the same spec: only what got worse fails.

Worse is: a requirement passed and no longer does, or was open and fails; it fails by more (value
over limit, of a simulated one where the two intervals do not meet; of two verdicts without a
design, by a lower limit); it is new, or limits another quantity than it did, and does not pass; or
the verdict as a whole fell from `meets` to `indeterminate`, `fails`, `infeasible`.  Of missions
each is held against itself.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Final

from syncline_design.verdict.since import Baseline, Earlier, RequirementSince, SinceBaseline
from syncline_design.verdict.tree import (
    MissionVerdict,
    RequirementResult,
    Verdict,
    waived_misses,
)

Judged = Verdict | MissionVerdict
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
    rows = tuple(_with_missions(verdict, before))
    found = Baseline(file, before.verdict, _fell(verdict, before), rows)
    worse = found.worse or any(not found.forgives(row.id, name) for name, row in _missed(verdict))
    return replace(verdict, baseline=replace(found, worse=worse))


def _missed(verdict: Verdict) -> list[tuple[str | None, RequirementResult]]:
    """What does not pass, with its mission; without a design, what all missions cannot meet too."""
    rows = list(verdict.judged_rows)
    if verdict.design is None and verdict.missions is not None:
        rows += [(None, row) for row in verdict.requirements]
    return [(name, row) for name, row in rows if _standing(row) > 0]


def _with_missions(verdict: Verdict, before: Verdict) -> Iterator[RequirementSince]:
    """What became of every requirement; of missions, each mission's after what is said of all.

    A row of all missions is that of the one nearest its limit, which may be another than before:
    so it got worse where any mission's did.  Without a design no mission is judged, and what
    stands in the way is said of all.
    """
    then = {mission.name: mission for mission in before.missions or ()}
    own = [
        replace(row, mission=mission.name)
        for mission in verdict.missions or ()
        for row in _of_mission(mission, then.pop(mission.name, None))
    ]
    own += [
        RequirementSince(row.id, "gone", _earlier(row), name)
        for name, mission in then.items() if verdict.missions
        for row in mission.requirements if not _is_implied(row)
    ]  # fmt: skip
    judged = own if verdict.design is not None else []
    missed = {(name, row.id) for name, row in _missed(verdict)}
    for row in _rows(verdict, before):
        each = [one for one in judged if one.id == row.id and one.change != "gone"]
        yield replace(row, change=_of_all(row.change, each, missed)) if each else row
    yield from own


def _of_mission(now: MissionVerdict, then: MissionVerdict | None) -> Iterator[RequirementSince]:
    if then is not None:
        yield from _rows(now, then)
        return
    for row in now.requirements:
        yield RequirementSince(row.id, "new", None)


def _of_all(
    change: SinceBaseline, each: Sequence[RequirementSince], missed: set[tuple[str | None, str]]
) -> SinceBaseline:
    """What became of a requirement over all missions, by what became of each one's."""
    if change in ("new", "gone"):
        return change
    if any(one.change == "worse" or (one.change == "new" and (one.mission, one.id) in missed)
           for one in each):  # fmt: skip
        return "worse"
    return "better" if any(one.change == "better" for one in each) else "same"


def _of_same_spec(verdict: Verdict, earlier: Sequence[Verdict]) -> Verdict | None:
    for same in (
        [one for one in earlier if one.file == verdict.file],
        [one for one in earlier if one.name == verdict.name],
    ):
        if len(same) == 1:
            return same[0]
    return None


def _rows(verdict: Judged, before: Judged) -> Iterator[RequirementSince]:
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
        judged = None if verdict.design or row.status != "indeterminate" else False
        told = None if was is None else _earlier(was)
        yield RequirementSince(row.id, change, told, judged=judged)
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
    verdict: Judged, before: Judged, row: RequirementResult, was: RequirementResult
) -> SinceBaseline:
    """Where one side has no design its rows have no figures: the verdict as a whole decides.

    Where neither has one, whether the requirement is a part of what cannot be met; then its limit.
    """
    if row.status == "pass":
        return _word(_standing(row) - _standing(was))
    if row.status == "indeterminate" and verdict.design is None:
        return "same"  # no part of what cannot be met, and no design to judge it by
    if verdict.verdict != before.verdict:
        return "worse" if _fell(verdict, before) else "better"
    step = _standing(row) - _standing(was)
    if step == 0 and row.status == "fail" and row.unit == was.unit:
        step = (row.limit < was.limit) - (row.limit > was.limit)
    return _word(step)


def _fell(verdict: Judged, before: Judged) -> bool:
    return _OUTCOMES.index(verdict.verdict) > _OUTCOMES.index(before.verdict)


def _since(now: RequirementResult, then: RequirementResult) -> SinceBaseline:
    """A miss that a waiver covers is worse than none, though it fails nothing."""
    step = _standing(now) - _standing(then)
    if step == 0:
        step = _STATUSES.index(now.status) - _STATUSES.index(then.status)
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
