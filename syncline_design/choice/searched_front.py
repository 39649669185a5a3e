"""The front by best-first search, where a merge cannot hold every end of the stages' distances.

Sync is then held against several sums of sensor errors at once, and the better sensor of one can
fail another.  The search decides each complete design exactly, one point of the front at a time.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

from syncline_design.choice.best_first import iter_first
from syncline_design.choice.evaluate import error_key, evaluate
from syncline_design.choice.option import ResourceName
from syncline_design.choice.outcome import Deadline, FrontPoint
from syncline_design.choice.table import Problem

MOST_STEPS = 200_000  # partial designs after which another road has to do it


def searched_front(
    problem: Problem, resource: ResourceName, *, accuracy: bool, deadline: Deadline
) -> Iterator[FrontPoint]:
    """Points by rising amount and falling error; TooLarge where there are too many designs."""
    limit = problem.limits.accuracy_m if accuracy else None
    least = math.inf
    while True:
        found = None
        most = min(least, math.inf if limit is None else limit)
        limits = replace(problem.limits, accuracy_m=None if math.isinf(most) else most)
        smaller = replace(problem, limits=limits, objective=resource, judge=None)
        for design in iter_first(smaller, deadline, MOST_STEPS):
            sums = evaluate(problem, design)
            amount = sums.amount(resource)
            if error_key(sums.error_m) < least and amount is not None:
                found = FrontPoint(amount, sums.error_m, design)
                break
        if found is None:
            return
        yield found
        least = error_key(found.error_m)
