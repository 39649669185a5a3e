"""The one predicate: a design is acceptable when it meets every requirement.

Sums (accuracy, sync, cost, mass, power) are decided exactly, simulated quantiles by the problem's
judge; known effects are part of both.  Choice, front, prices, runners-up, ledger, measurements and
fixes all ask here.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from syncline_design.choice.judged import judgement
from syncline_design.choice.narrowed import Narrowed, kept
from syncline_design.choice.options import Bools, Options
from syncline_design.choice.outcome import Deadline
from syncline_design.choice.ranked import iter_best
from syncline_design.choice.table import Design, Problem, SimulatedJudgement


def iter_acceptable(
    problem: Problem, deadline: Deadline | None = None
) -> Iterator[tuple[Design, SimulatedJudgement]]:
    """Designs that meet all requirements, best first; those that simulation leaves open as such."""
    for design, found in iter_judged(problem, deadline):
        if not found.failed:
            yield design, found


def iter_judged(
    problem: Problem, deadline: Deadline | None = None
) -> Iterator[tuple[Design, SimulatedJudgement]]:
    """Designs that keep every sum, best first, with what simulation says of them.

    From the first that fails on, sensors whose noise alone fails are left out.
    """
    known: set[Design] = set()
    some_failed = False
    for design in iter_best(problem, deadline):
        found = judgement(problem, design)
        known.add(design)
        yield design, found
        if found.failed:
            some_failed = True
            break
    if not some_failed:
        return
    smaller = promising(problem)
    if smaller.is_empty:
        return
    for inner in iter_best(smaller.problem, deadline, cuts=True):
        design = smaller.whole(inner)
        if design not in known:
            yield design, judgement(problem, design)


def promising(problem: Problem) -> Narrowed:
    """The problem without the options that simulation rules out by their sensor alone."""
    judge = problem.judge
    assert judge is not None

    def hopeful(r: int, options: Options) -> Bools:
        _, first = np.unique(options.sensor, return_index=True)
        gone = [p for p in first.tolist() if judge.hopeless(problem, r, p)]
        return ~np.isin(options.sensor, options.sensor[gone])

    return kept(problem, hopeful, lambda _, clock: True)


def without_simulation(problem: Problem) -> Problem:
    """The problem with the sums alone."""
    return replace(problem, judge=None)
