"""The front where simulation decides too: points that fail it give way to the next best.

Simulation follows no order that a merge could use, so that each gap is filled by going through the
designs by rising amount, those with a larger error than a point already found left out.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace

from syncline_design.choice.acceptable import promising
from syncline_design.choice.evaluate import error_key, evaluate
from syncline_design.choice.judged import judgement
from syncline_design.choice.option import ResourceName
from syncline_design.choice.outcome import FrontPoint, Unfinished
from syncline_design.choice.ranked import iter_best
from syncline_design.choice.table import Problem


def accepted_front(
    problem: Problem, resource: ResourceName, points: Sequence[FrontPoint]
) -> tuple[FrontPoint, ...]:
    """The front over designs that simulation accepts, from the front of the sums alone.

    A design that simulation leaves open is listed, marked, and takes no other one's place.
    """
    out: list[FrontPoint] = []
    with suppress(Unfinished):  # what was found stands; the judge remembers that it gave up
        for point in _accepted(problem, resource, points):
            out.append(point)  # noqa: PERF402 - one by one, so that an end keeps what came before
    return tuple(out)


def _accepted(
    problem: Problem, resource: ResourceName, points: Sequence[FrontPoint]
) -> Iterator[FrontPoint]:
    least = math.inf
    failing = False
    for point in points:
        if not judgement(problem, point.design).passed:
            failing = True
            continue
        if failing:
            yield from _gap(problem, resource, least, point)
            failing = False
        yield point
        least = error_key(point.error_m)
    if failing:
        yield from _gap(problem, resource, least, None)


def _gap(
    problem: Problem, resource: ResourceName, least_m: float, until: FrontPoint | None
) -> Iterator[FrontPoint]:
    """Points of less error than `least_m` and a smaller amount than the point that ends the gap."""
    while True:
        found = None
        for found in _next(problem, resource, least_m, until):
            yield found
        if found is None or found.undecided:
            return
        least_m = error_key(found.error_m)


def _next(
    problem: Problem, resource: ResourceName, least_m: float, until: FrontPoint | None
) -> Iterator[FrontPoint]:
    """The cheapest accepted design of a smaller error, after those that are left open."""
    limits = replace(problem.limits, accuracy_m=None if math.isinf(least_m) else least_m)
    smaller = promising(replace(problem, limits=limits, objective=resource))
    for inner in iter_best(smaller.problem, cuts=True):
        design = smaller.whole(inner)
        sums = evaluate(problem, design)
        amount = sums.amount(resource)
        if amount is None or (until is not None and amount >= until.amount):
            return
        if error_key(sums.error_m) >= least_m:
            continue
        found = judgement(problem, design)
        if not found.failed:
            yield FrontPoint(amount, sums.error_m, design, found.undecided)
        if found.passed:
            return
