"""The front of a resource against error, and the price list that it is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from syncline_design.choice.merged_front import Points, merged_front
from syncline_design.choice.narrowed import stated
from syncline_design.choice.option import ResourceName
from syncline_design.choice.outcome import FrontPoint, PriceStep
from syncline_design.choice.simulated_front import accepted_front
from syncline_design.choice.table import Problem


def front(problem: Problem, resource: ResourceName = "cost") -> Sequence[FrontPoint]:
    """The exact front of a resource against error, over designs that meet all but accuracy.

    By rising amount and falling error; errors that agree to 12 figures count as equal.  What does
    not say how much of the resource it takes has no place on it.
    """
    priced = stated(problem, resource)
    if priced.is_empty:
        return ()
    points = merged_front(priced.problem, resource, accuracy=False)
    if problem.judge is not None:
        points = accepted_front(priced.problem, resource, points)
    if isinstance(points, Points):
        return replace(points, part=priced)
    return tuple(replace(point, design=priced.whole(point.design)) for point in points)


def staircase(points: Sequence[FrontPoint]) -> tuple[PriceStep, ...]:
    """What accuracy costs, by falling target, breakpoints exact: one step per point of the front.

    Duals of a mixed-integer program mean nothing; the front is the price list itself.
    """
    steps = []
    before: FrontPoint | None = None
    for point in points:
        steps.append(
            PriceStep(
                float(point.amount),
                point.drawn_m,
                before.drawn_m if before else None,
                float(point.amount - before.amount) if before else None,
            )
        )
        before = point
    return tuple(steps)
