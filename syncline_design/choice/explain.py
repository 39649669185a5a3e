"""Why no design meets a spec, in the user's words: roles without options, the requirements that
cannot hold together, and the smallest single changes that help."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext, suppress
from dataclasses import replace
from typing import TypeVar

from syncline_design.choice.fact_fixes import fact_fixes
from syncline_design.choice.fixes import method_fixes, requirement_fixes, with_requirements
from syncline_design.choice.joint import joint_fixes
from syncline_design.choice.outcome import (
    NO_SINGLE_CHANGE,
    Conflict,
    ConflictMember,
    Explanation,
    Fix,
    Members,
    NoVerdict,
    RoleGap,
    cut_short_words,
)
from syncline_design.choice.parts import ConflictPart, is_feasible, lifted, parts_of
from syncline_design.choice.platform_fixes import platform_fixes
from syncline_design.choice.problem import build_problem
from syncline_design.choice.table import Problem, RoleTable, VehicleTable
from syncline_design.choice.variations import Build
from syncline_design.machine.deadline import in_force
from syncline_design.model.figure_text import to_digits
from syncline_design.spec.case import Case

Found = TypeVar("Found")
MOST_A_QUESTION = 100  # designs simulated for one of the questions of an explanation


def told(found: Explanation) -> Explanation:
    """The explanation with its text, which says what its other fields hold."""
    return replace(found, text=tuple(_lines(found)))


def _lines(found: Explanation) -> Iterator[str]:
    yield found.about or "No design meets this spec."
    yield from (f"  {gap.text}" for gap in found.roles_without_options)
    if found.conflict.requirements:
        yield f"  {_conflict_text(found.conflict)}"
    for members in found.further_conflicts:
        yield f"  Apart from that, {_conflict_text(Conflict(members, True))}"
    if found.fixes:
        yield "Any one of these changes makes it feasible (each solved again):"
        yield from (f"  - {fix.text}" for fix in found.fixes)
    elif not found.cut_short:
        yield NO_SINGLE_CHANGE
    if found.joint_fixes:
        yield "Changes that do so together (solved again):"
        yield from ("  - " + " and ".join(f.text for f in fixes) for fixes in found.joint_fixes)
    if found.cut_short:
        yield cut_short_words(found)


def _conflict_text(conflict: Conflict) -> str:
    names = [member.words for member in conflict.requirements]
    if len(names) == 1:
        return f"{names[0]} alone cannot be met by any combination of the candidates."
    if not conflict.minimal:
        return f"{listed(names)} cannot all hold together (a smaller set was not ruled out)."
    ending = "; without any one of them a design exists" if conflict.each_suffices else ""
    return f"{listed(names)} cannot hold together{ending}."


def listed(names: Sequence[str]) -> str:
    return " and ".join(filter(None, (", ".join(names[:-1]), names[-1])))


def explain(case: Case, problem: Problem, build: Build = build_problem) -> Explanation:
    """Reasons and remedies for a problem that has no design.

    build: how a changed spec becomes a problem (with the known effects and simulated requirements,
    where there are any).
    """
    gaps = tuple(_gap(table, problem.limits.sync) for table in problem.roles if not table.options)
    gaps += tuple(_clock_gap(vehicle) for vehicle in problem.vehicles if not vehicle.clocks)
    with _spending(problem):
        conflict, minimal = conflict_of(problem)
    with _spending(problem):
        further = _further(problem, conflict)
    moves = _proven(lambda: requirement_fixes(case, problem, build))
    fixes = [fix for together in moves if len(together) == 1 for fix in together]
    joint = tuple(together for together in moves if len(together) > 1)
    if not moves:
        joint = joint_fixes(case, problem, build)
    fixes += _proven(lambda: method_fixes(case, build, problem))
    fixes += _proven(lambda: fact_fixes(case, problem, build))
    with _spending(problem):
        fixes += _proven(lambda: platform_fixes(case, problem, build))
    fixes = by_size(fixes)
    joint = tuple(sorted((tuple(map(_measured, some)) for some in joint), key=_largest))
    with _spending(problem):
        each_suffices = _each_suffices(case, problem, build, conflict) or None
    found = Explanation(
        gaps,
        Conflict(_members(case, conflict), minimal, each_suffices),
        tuple(_members(case, parts) for parts in further),
        tuple(fixes),
        joint,
        cut_short=in_force().is_over,  # once over, every search after it ended without an answer
        about=_about(case),
    )
    return told(found)


def _about(case: Case) -> str | None:
    """What a spec with waived requirements has none of."""
    return f"No design meets this spec{even_waived(case)}." if case.eased else None


def even_waived(case: Case) -> str:
    """`, even with MASS-1 waived`, of a case whose waived requirements are left out."""
    return f", even with {listed(list(case.eased))} waived" if case.eased else ""


def _spending(problem: Problem) -> AbstractContextManager[None]:
    """So that what one question simulates leaves something to the others."""
    return nullcontext() if problem.judge is None else problem.judge.spending(MOST_A_QUESTION)


def _measured(fix: Fix) -> Fix:
    """The fix with the share of its figure that it changes; a change from nothing has none."""
    if fix.from_ is None or fix.to is None or not fix.from_:
        return fix
    return replace(fix, relative=abs(fix.to - fix.from_) / abs(fix.from_))


def by_size(fixes: Iterable[Fix]) -> list[Fix]:
    """Fixes with the share of their figure that they change, the least change first."""
    return sorted(map(_measured, fixes), key=_size)


def _size(fix: Fix) -> float:
    """The least change first; what is no figure comes last, as it was found."""
    return math.inf if fix.relative is None else fix.relative


def _largest(fixes: Sequence[Fix]) -> float:
    return max(map(_size, fixes))


def _proven(source: Callable[[], Iterable[Found]]) -> list[Found]:
    """What a source finds until it can prove no more."""
    found: list[Found] = []
    with suppress(NoVerdict):  # a remedy that cannot be proven is not offered
        found.extend(source())
    return found


def _each_suffices(
    case: Case, problem: Problem, build: Build, conflict: Sequence[ConflictPart]
) -> bool:
    """Whether the spec has a design without any one requirement of the conflict, as it would be
    written: another requirement of the kind stays, and without a sync requirement 1.0 is implied.
    """

    def helps(part: ConflictPart) -> bool:
        if part.id is None:
            return is_feasible(lifted(problem, [part]))
        rest = [one for one in case.spec.requirements if one.id != part.id]
        return is_feasible(build(with_requirements(case, rest)))

    try:
        return bool(conflict) and all(map(helps, conflict))
    except NoVerdict:
        return False


def _further(
    problem: Problem, first: tuple[ConflictPart, ...]
) -> tuple[tuple[ConflictPart, ...], ...]:
    """Conflicts that remain, one after the other, once those before them are lifted."""
    found: list[tuple[ConflictPart, ...]] = []
    gone = list(first)
    while gone:
        rest = lifted(problem, gone)
        try:
            conflict = () if is_feasible(rest) else conflict_of(rest)[0]
        except NoVerdict:
            break
        if not conflict:
            break
        found.append(conflict)
        gone += conflict
    return tuple(found)


def _gap(table: RoleTable, sync_limit: float) -> RoleGap:
    """The nearest candidate of a role without options, and by how much it misses."""
    where = f"{table.role} of {table.stage_name}"
    measured = [one for one in table.excluded if one.ratio is not None]
    if measured:
        nearest = min(measured, key=lambda one: (one.ratio or 0.0, one.sensor, one.method))
        misses = (nearest.ratio or 0.0) / sync_limit
        name = f"{nearest.sensor} stamped by {nearest.method}"
        text = f"No option for {where}: the nearest, {name}, {_excess(misses)}."
        return RoleGap(table.stage_name, table.role, name, misses, text)
    reasons = "; ".join(dict.fromkeys(one.reason for one in table.excluded))
    text = f"No option for {where}: {reasons or 'no candidates'}."
    return RoleGap(table.stage_name, table.role, None, None, text)


def _excess(misses: float) -> str:
    """How far a timestamp error is from what is allowed, in as many digits as show it."""
    if misses == 1.0:
        return "has exactly the timestamp error that its own tau_crit bids it stay below"
    shown = next(t for n in range(3, 18) if float(t := to_digits(misses, n)) != 1.0)
    return f"has {shown} times the timestamp error that its own tau_crit allows"


def _clock_gap(vehicle: VehicleTable) -> RoleGap:
    """Why no clock that is offered to a vehicle can work there."""
    reasons = "; ".join(one.reason for one in vehicle.excluded)
    text = f"No clock for {vehicle.name}: {reasons}."
    return RoleGap(vehicle.name, "clock", None, None, text)


def conflict_of(problem: Problem) -> tuple[tuple[ConflictPart, ...], bool]:
    """A set of requirements that cannot hold together, none of which can be left out."""
    every = parts_of(problem)
    active = list(every)
    try:
        if not is_feasible(lifted(problem, active)):
            return (), False
    except NoVerdict:
        return tuple(active), False
    minimal = True
    for part in every:
        absent = [one for one in every if one not in active or one == part]
        try:
            feasible = is_feasible(lifted(problem, absent))
        except NoVerdict:
            minimal, feasible = False, True
        if not feasible:
            active.remove(part)
    return tuple(active), minimal


def _members(case: Case, parts: Iterable[ConflictPart]) -> Members:
    return tuple(_member(case, part) for part in parts)


def _member(case: Case, part: ConflictPart) -> ConflictMember:
    line = None
    for index, requirement in enumerate(case.spec.requirements):
        if requirement.id == part.id:
            place = case.positions.get(("requirements", index))
            line = place[0] if place else None
    return ConflictMember(part.id, part.kind, line)
