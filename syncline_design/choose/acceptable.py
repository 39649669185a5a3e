"""The one predicate: a design is acceptable when it meets every requirement.

Sums (accuracy, sync, cost, mass, power) are decided exactly, simulated quantiles by the problem's
judge; known effects are part of both.  Choice, front, prices, runners-up, ledger, measurements and
fixes all ask here.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from syncline_design.choose.evaluate import broken, evaluate
from syncline_design.choose.outcome import Deadline
from syncline_design.choose.ranked import iter_best
from syncline_design.design_space import Design, Judgement, Problem

NOTHING_SIMULATED = Judgement()


def judgement(problem: Problem, design: Design) -> Judgement:
    """What simulation says of a design."""
    return NOTHING_SIMULATED if problem.judge is None else problem.judge.judge(problem, design)


def unmet(problem: Problem, design: Design) -> tuple[str, ...]:
    """Kinds of requirement that a design does not meet; none: it is acceptable."""
    kinds = broken(problem, evaluate(problem, design))
    if kinds or judgement(problem, design).passed:
        return kinds
    return ("monte_carlo",)


def iter_acceptable(
    problem: Problem, deadline: Deadline | None = None
) -> Iterator[tuple[Design, Judgement]]:
    """Designs that meet all requirements, best first; those that simulation leaves open as such."""
    for design in iter_best(problem, deadline):
        found = judgement(problem, design)
        if not found.failed:
            yield design, found


def without_simulation(problem: Problem) -> Problem:
    """The problem with the sums alone."""
    return replace(problem, judge=None)
