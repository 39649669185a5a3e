"""A design in hand while the proof of the best one is still under way.

Each role keeps a few options: the least in the objective, in error, and in what error and timing
cause together.  Merging those is quick and exact on what is kept, so that a time limit that ends
the whole search leaves a design that meets every sum, and a bound on what it misses.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from syncline_design.choice.best_first import lower_bound
from syncline_design.choice.evaluate import Amount, broken, evaluate, known_or_more, rank
from syncline_design.choice.narrowed import Narrowed, narrowed
from syncline_design.choice.option import ResourceName
from syncline_design.choice.outcome import Choice, Proof, TooLarge
from syncline_design.choice.partition import best_of
from syncline_design.choice.table import Design, Problem
from syncline_design.machine.deadline import Deadline, OutOfTime
from syncline_design.machine.quick_dataclass import dataclass

FEW = (3, 9)  # options per role and aim
SHARE = 0.25  # of the time that is left, for each


@dataclass(frozen=True, slots=True)
class InHand:
    """The best design found so far, and what none can go below in the objective."""

    design: Design
    bound: Amount


def in_hand(problem: Problem, deadline: Deadline) -> InHand | None:
    """A quick design; None without a time limit, and where none was found."""
    if deadline.limit_s is None:
        return None
    found: list[Design] = []
    for count in FEW:
        end = Deadline(SHARE * (deadline.left_s() or 0.0))
        try:
            design = best_of(few(problem, count), end)
        except (OutOfTime, TooLarge):
            break
        found += [] if design is None else [design]
    if not found:
        return None
    best = min(found, key=lambda design: rank(problem, design, evaluate(problem, design)))
    return InHand(best, lower_bound(problem))


def few(problem: Problem, count: int) -> Narrowed:
    """The problem with a few options of each role; every clock stays."""
    rate = float(problem.sync_rate())
    objective: ResourceName = "cost" if problem.objective == "error" else problem.objective
    places = []
    for table in problem.roles:
        options = table.options
        caused = rate * options.tau
        amount = options.spent(objective).order()
        aims = (amount, options.error, caused, options.error + caused)
        orders = [np.lexsort((options.rank, *aims[::-1], aim)) for aim in aims]
        places.append(np.unique(np.concatenate([order[:count] for order in orders])))
    return narrowed(problem, places, [range(len(v.clocks)) for v in problem.vehicles])


def unproven(problem: Problem, found: InHand, method: str) -> Choice | None:
    """The design in hand as the answer, rechecked, with its gap; None where it does not stand."""
    sums = evaluate(problem, found.design)
    if broken(problem, sums):
        return None
    value: Fraction | float = sums.error_m
    if problem.objective != "error":
        value = known_or_more(sums.amount(problem.objective))
    gap = float(1 - Fraction(found.bound) / Fraction(value)) if value else 0.0
    return Choice(found.design, Proof(method, optimal=False, rechecked=True, gap=max(0.0, gap)))
