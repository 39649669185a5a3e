"""Plain enumeration: every design, one by one.  Slow, obvious, the oracle of the other roads."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

from syncline_design.choice.evaluate import Evaluation, broken, evaluate, rank
from syncline_design.choice.outcome import Deadline, TooLarge
from syncline_design.choice.table import Design, Problem
from syncline_design.machine.deadline import in_force
from syncline_design.model.figure_text import to_digits

MOST_COMBINATIONS = 300_000


def demand_few(combinations: int) -> None:
    """TooLarge where trying every one of them would take too long."""
    if combinations > MOST_COMBINATIONS:
        raise TooLarge(
            f"{to_digits(combinations, 3)} combinations are too many to enumerate "
            f"(at most {MOST_COMBINATIONS})"
        )


def all_designs(
    problem: Problem, deadline: Deadline | None = None
) -> Iterator[tuple[Design, Evaluation]]:
    """Every design with what it costs and reaches; NoVerdict after the deadline."""
    end = deadline or in_force()
    demand_few(problem.combinations)
    option_ranges = [range(len(role.options)) for role in problem.roles]
    clock_ranges = [range(len(vehicle.clocks)) for vehicle in problem.vehicles]
    for options in itertools.product(*option_ranges):
        end.check()
        for clocks in itertools.product(*clock_ranges):
            design = Design(options, clocks)
            yield design, evaluate(problem, design)


def best_by_enumeration(problem: Problem, deadline: Deadline | None = None) -> Design | None:
    """The first design, in the documented order, that meets every requirement."""
    feasible = [
        (rank(problem, design, found), design)
        for design, found in all_designs(problem, deadline)
        if not broken(problem, found)
    ]
    return min(feasible, key=lambda entry: entry[0])[1] if feasible else None
