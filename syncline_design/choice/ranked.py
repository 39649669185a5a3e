"""Designs one after the other in the documented order, found lazily.

By best-first search; where that grows without finding anything, by splitting what is left.  Order:
objective, error (12 figures), cost, mass, power, then names by role and clock.
"""

from __future__ import annotations

from collections.abc import Iterator

from syncline_design.choice.best_first import BestFirstSearch, iter_first
from syncline_design.choice.outcome import Deadline, TooLarge
from syncline_design.choice.partition import iter_differing
from syncline_design.choice.table import Design, Problem, is_empty
from syncline_design.machine.deadline import in_force

PATIENCE = 4000  # steps without a further design before splitting takes over
CUT_PATIENCE = 100_000  # the same where what has failed limits the search


def iter_best(
    problem: Problem,
    deadline: Deadline | None = None,
    most_steps: int | None = None,
    *,
    cuts: bool = False,
) -> Iterator[Design]:
    """Every design that meets all requirements, best first, each decided exactly.

    cuts: without those that the judge has learned to fail by their sums.  Raises NoVerdict
    after the deadline, TooLarge after `most_steps` partial designs; without `most_steps`, a search
    that grows without finding anything gives way to splitting.
    """
    if is_empty(problem):
        return
    end = deadline or in_force()
    if most_steps is not None:
        yield from iter_first(problem, end, most_steps, cuts=cuts)
        return
    seen: set[Design] = set()
    try:
        patience = CUT_PATIENCE if cuts else PATIENCE
        for design in BestFirstSearch(problem, cuts=cuts).run(end, patience, patient=True):
            seen.add(design)
            yield design
    except TooLarge:
        rest = iter_differing(problem, "names", clocks=True, deadline=end)
        yield from (design for design in rest if design not in seen)
