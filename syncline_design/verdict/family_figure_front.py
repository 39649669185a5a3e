"""A family's front of a resource against a figure of the error, the largest of any mission."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from syncline_design.choice.family import FamilyDesign
from syncline_design.choice.family_best import FamilyPoint, SummedDesign, iter_family
from syncline_design.choice.family_parts import stated_family
from syncline_design.choice.option import ResourceName
from syncline_design.choice.table import Design, Problem
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.spec.case import Case
from syncline_design.spec.requirement import Requirement
from syncline_design.verdict.acceptance import Simulations
from syncline_design.verdict.family import Work, passing, promising_family, with_problems, work_of
from syncline_design.verdict.figure_front import LESS, without_figure


@dataclass(frozen=True, slots=True)
class FigurePoint:
    """A point with the figure that it is drawn over [m]."""

    point: FamilyPoint
    figure_m: float


def family_figure_front(
    case: Case, requirement: Requirement, resource: ResourceName, seed: int
) -> Iterator[FigurePoint]:
    """Points by rising amount and falling figure.

    They keep every requirement of every mission but accuracy and those on this very figure; what
    samples leave open has no place on it.
    """
    missions = tuple(
        replace(one, case=without_figure(one.case, requirement)) for one in case.missions
    )
    work = work_of(replace(case, missions=missions), lambda: Simulations(seed).problem_of, seed)
    problems = [replace(problem, objective=resource) for problem in work.family.problems]
    least, failed, last = float(requirement.limit), set[FamilyDesign](), None
    while True:
        asked = with_problems(work, [_below(one, requirement.id, least) for one in problems])
        one = _first(asked, resource, failed)
        if one is None:
            break
        design, sums = one.design, one.sums
        amount = sums.amount(resource)
        assert amount is not None
        if last is not None and amount > last.point.amount:
            yield last  # else this one takes no more and errs less
        figure = _reached(problems, work.family.designs(design), requirement.id)
        last = FigurePoint(FamilyPoint(amount, sums.error_m, design), figure)
        least = figure * LESS
    if last is not None:
        yield last


def _first(work: Work, resource: ResourceName, failed: set[FamilyDesign]) -> SummedDesign | None:
    """The first design in the order whose figure is below the limit; failed: those that are not,
    at this limit or a larger one, or that samples leave open."""
    part, whole = stated_family(work.family, resource)
    if part.is_empty:
        return None
    hopeful, within = promising_family(part)
    passes = passing(work)

    def also(design: FamilyDesign) -> bool:
        own = whole(within(design))
        if own in failed:
            return False
        if passes is None or passes(own):
            return True
        failed.add(own)
        return False

    found = next(iter_family(hopeful, also), None)
    return None if found is None else replace(found, design=whole(within(found.design)))


def _below(problem: Problem, name: str, least_m: float) -> Problem:
    """The problem with another limit of one figure."""
    assert problem.judge is not None
    limits = tuple((one, least_m if one == name else limit) for one, limit in problem.judge.limits)
    return replace(problem, judge=problem.judge.with_limits(limits))


def _reached(problems: Sequence[Problem], designs: Sequence[Design], name: str) -> float:
    """The largest figure of any mission [m]."""
    return max(
        problem.judge.reached_m(problem, design, name)
        for problem, design in zip(problems, designs, strict=True)
        if problem.judge is not None
    )
