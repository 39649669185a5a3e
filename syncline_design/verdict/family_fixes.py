"""What would let one payload serve missions that cannot share one, each change solved again.

For every limit of every mission alone the least value that some payload keeps, all else met; a
sensor of its own in each mission; a mission left out.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

from syncline_design.choice.explain import by_size
from syncline_design.choice.fixes import fix_of, moves_to, with_moves
from syncline_design.choice.options import RESOURCES
from syncline_design.choice.outcome import Conflict, ConflictMember, Fix, NoVerdict, OutOfTime
from syncline_design.choice.parts import FIELDS, ConflictPart
from syncline_design.choice.table import Problem, with_limits
from syncline_design.choice.variations import Build, with_stage
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.spec.case import Case, Mission
from syncline_design.spec.requirement import SUMMED_KINDS
from syncline_design.verdict.family import (
    ALL,
    Chosen,
    Work,
    choose_family,
    missions_of,
    with_problems,
    work_of,
)

NEAR = 1.0 - 3e-11  # of a sum: what lies above this share of it is the same to 12 figures
STEPS = 60
CLOSE = 1e-4  # of a sync limit
LARGEST_RATIO = 1e12


@dataclass(frozen=True, slots=True)
class FamilyLimit:
    """One limit: of a mission, or (None) of what the whole family buys."""

    mission: str | None
    part: ConflictPart


def asked_of(work: Work) -> tuple[FamilyLimit, ...]:
    """Every limit that is held against sums; a budget is the family's."""
    out: dict[tuple[str | None, str], FamilyLimit] = {}
    for one in work.scenarios:
        limits = one.problem.limits
        names = dict(limits.ids)
        for kind in SUMMED_KINDS:
            if kind == "sample_spacing" or _limit(one.problem, kind) in (None, math.inf):
                continue
            mission = None if kind in RESOURCES else one.mission
            out.setdefault(
                (mission, kind), FamilyLimit(mission, ConflictPart(kind, names.get(kind)))
            )
    return tuple(out.values())


def _limit(problem: Problem, kind: str) -> Any:
    return getattr(problem.limits, FIELDS.get(kind, kind))


def moved(work: Work, limits: dict[FamilyLimit, Any]) -> Work:
    """The family with other limits; None lifts one, infinity a sync limit."""
    problems = []
    for one in work.scenarios:
        changes = {
            FIELDS.get(asked.part.kind, asked.part.kind): value
            for asked, value in limits.items()
            if asked.mission in (None, one.mission)
        }
        new = replace(one.problem.limits, **changes)
        problems.append(with_limits(one.problem, new) if changes else one.problem)
    return with_problems(work, problems)


def lifted(work: Work, some: Sequence[FamilyLimit]) -> Work:
    """The family without some of its limits."""
    return moved(work, {one: math.inf if one.part.kind == "sync" else None for one in some})


def conflict_of(work: Work) -> tuple[tuple[FamilyLimit, ...], bool]:
    """Limits that no payload keeps together, none of which can be left out; whether that is so."""
    every = asked_of(work)
    active = list(every)
    try:
        if first_of(lifted(work, active)) is None:
            return (), False
        for one in every:
            absent = [other for other in every if other not in active or other == one]
            if first_of(lifted(work, absent)) is None:
                active.remove(one)
    except NoVerdict:
        return tuple(active), False
    return tuple(active), True


def conflict(work: Work, found: tuple[tuple[FamilyLimit, ...], bool]) -> Conflict:
    """The same by id, mission and line."""
    cases = {mission.name: mission.case for mission in work.missions}
    return Conflict(tuple(_member(work.case, cases, one) for one in found[0]), found[1])


def _member(spec: Case, cases: dict[str, Case], one: FamilyLimit) -> ConflictMember:
    case = spec if one.mission is None else cases[one.mission]
    line = None
    for index, requirement in enumerate(case.spec.requirements):
        if requirement.id == one.part.id:
            at = case.positions.get(("requirements", index, "limit"))
            place = at or case.positions.get(("requirements", index))
            line = place[0] if place else None
    return ConflictMember(one.part.id, one.part.kind, line, one.mission or None)


def first_of(work: Work) -> Chosen | None:
    """The first payload that meets a family; None where none does, or simulation leaves it open."""
    found = None if work.family.is_empty else choose_family(work)
    return None if found is None or found.undecided else found


def limit_fixes(work: Work, build: Callable[[], Build], seed: int) -> Iterator[Fix]:
    """For each limit alone the least relaxation that helps, the least change first."""
    found: list[Fix] = []
    try:
        for one in asked_of(work):
            value = least_of(work, one)
            if value is not None:
                found += _proven(work, one, value, build, seed)
    except OutOfTime:
        pass
    yield from by_size(found)


def least_of(work: Work, one: FamilyLimit) -> Fraction | None:
    """The least limit at which some payload meets all; None: at none, or not to be proven."""
    try:
        if one.part.kind == "sync":
            return _least_sync(work, one)
        if one.part.kind in RESOURCES:
            return _least_amount(work, one)
        return _least_error(work, one)
    except OutOfTime:
        raise
    except NoVerdict:  # a remedy that cannot be proven is not offered
        return None


def _least_amount(work: Work, one: FamilyLimit) -> Fraction | None:
    name = next(own for own in RESOURCES if own == one.part.kind)
    free = lifted(work, [one])
    problems = [replace(problem, objective=name) for problem in free.family.problems]
    found = first_of(with_problems(free, problems))
    return None if found is None or found.found is None else found.found.sums.amount(name)


def _least_error(work: Work, one: FamilyLimit) -> Fraction | None:
    """By halving; what is found reaches less than it was asked for, and ends the search where
    nothing reaches less than it."""
    fails = min(_limit(own.problem, "accuracy") for own in _scenarios(work, one))
    found = first_of(lifted(work, [one]))
    if found is None:
        return None
    works = _reached(work, one, found)
    for _ in range(STEPS):
        below = first_of(moved(work, {one: works * NEAR}))
        if below is None:
            break
        works = _reached(work, one, below)
        middle = 0.5 * (works + fails)
        halved = first_of(moved(work, {one: middle}))
        if halved is None:
            fails = middle
        else:
            works = _reached(work, one, halved)
    return Fraction(works)


def _scenarios(work: Work, one: FamilyLimit) -> list[Any]:
    return [own for own in work.scenarios if own.mission == one.mission]


def _reached(work: Work, one: FamilyLimit, found: Chosen) -> float:
    """The largest error of one mission with a payload [m]."""
    assert found.found is not None
    missions = found.found.sums.missions
    return max(missions[place].error_m for place in work.of(one.mission or ALL))


def _least_sync(work: Work, one: FamilyLimit) -> Fraction | None:
    def holds(limit: float) -> bool:
        return first_of(moved(work, {one: limit})) is not None

    if not holds(math.inf):
        return None
    fails = min(_limit(own.problem, "sync") for own in _scenarios(work, one))
    works = 2.0 * fails
    while not holds(works):
        fails, works = works, works * 4.0
        if works > LARGEST_RATIO:
            return None
    while works - fails > CLOSE * works:
        middle = 0.5 * (works + fails)
        works, fails = (middle, fails) if holds(middle) else (works, middle)
    return Fraction(works)


def _proven(
    work: Work, one: FamilyLimit, value: Fraction, build: Callable[[], Build], seed: int
) -> list[Fix]:
    """The change as it would be written, if the family so written has a payload."""
    told: dict[Fix, list[str]] = {}
    missions = []
    for mission in work.missions:
        moves = []
        if one.mission in (None, mission.name):
            problem = work.scenarios[work.of(mission.name)[0]].problem
            moves = list(moves_to(mission.case, problem, one.part, value))
        for move in moves:
            told.setdefault(fix_of(mission.case, move), []).append(mission.name)
        missions.append(replace(mission, case=with_moves(mission.case, moves)))
    if len(told) != 1 or first_of(again(work, missions, build, seed)) is None:
        return []
    fix, names = next(iter(told.items()))
    if not work.case.missions or len(names) == len(work.missions):
        return [fix]
    listed = ", ".join(names)
    own = names[0] if len(names) == 1 else None
    return [replace(fix, mission=own, text=f"in mission {listed}: {fix.text}")]


def again(work: Work, missions: Sequence[Mission], build: Callable[[], Build], seed: int) -> Work:
    """The family of changed missions."""
    if work.case.missions:
        return work_of(replace(work.case, missions=tuple(missions)), build, seed)
    return work_of(missions[0].case, build, seed)


def sharing_fixes(work: Work, build: Callable[[], Build], seed: int) -> Iterator[Fix]:
    """Roles that each mission could take in its own way, and missions that could be left out."""
    if not work.case.missions:
        return
    for stage in missions_of(work.case)[0].case.stages:
        for role in stage.roles:
            if role.choice.per_mission:
                continue
            own = [_by_itself(mission, stage.index, role.role) for mission in work.missions]
            if _helps(work, own, build, seed):
                text = f"per_mission: yes for {role.role} of {stage.choice.name}"
                yield Fix(
                    "missions", None, "per_mission", stage.choice.name, None, None, None, text
                )
    for left_out in work.missions:
        rest = [mission for mission in work.missions if mission is not left_out]
        if rest and _helps(work, rest, build, seed):
            text = f"without mission {left_out.name} one payload serves the others"
            yield Fix("missions", None, None, None, None, None, None, text, mission=left_out.name)


def _by_itself(mission: Mission, stage: int, role: Any) -> Mission:
    choice = mission.case.spec.stages[stage].role(role)
    if choice is None:
        return mission
    new = choice.model_copy(update={"per_mission": True})
    return replace(mission, case=with_stage(mission.case, stage, **{role: new}))


def _helps(work: Work, missions: Sequence[Mission], build: Callable[[], Build], seed: int) -> bool:
    try:
        return first_of(again(work, missions, build, seed)) is not None
    except OutOfTime:
        raise
    except NoVerdict:
        return False
