"""The few designs that may take the place of one while something only grows worse for all.

As a sensor error, a timestamp bound or a platform figure grows, what a design costs stays and what
it errs never falls.  So as long as the best design meets every requirement, whatever takes its
place costs no more and kept the accuracy limit from the start, and failed then by its timestamps
alone if at all: those designs are found once, and compared wherever the figure is looked at.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from syncline_design.choice.core import TIED, Beside, core, total_least
from syncline_design.choice.evaluate import Incumbent, Rank, broken, evaluate, rank, resource_of
from syncline_design.choice.narrowed import Narrowed, whole_of
from syncline_design.choice.options import Floats, Indices, Options
from syncline_design.choice.stairs import NO_ROLES, Stairs, stairs
from syncline_design.choice.table import NOTHING, Design, Problem, RoleTable
from syncline_design.choice.what_if import same_design
from syncline_design.machine.quick_dataclass import dataclass

MOST_PARTIAL = 4000  # partial designs looked at, and
MOST_WEIGHED = 300  # designs added up exactly, and
MOST = 30  # rivals compared, before choosing anew is as quick
PASSES = 3  # of dropping options, each with what the one before left

Changed = Callable[[float], Problem]
Vary = Callable[[Problem, Design], Changed]


@dataclass(frozen=True, slots=True)
class Growing:
    """A figure of a design that grows.

    vary: a problem by its value, for a problem and a design of it.  eased: roles in which sensors
    get noisier, so that what fails by its timestamps at first may hold later, and options come in:
    open_to tells which may.  only_worse: whether no design errs less for it.
    """

    vary: Vary
    eased: tuple[int, ...] = ()
    open_to: Callable[[RoleTable], Options] = RoleTable.pool
    only_worse: bool = True


@dataclass(frozen=True, slots=True)
class Rivals:
    """A design and its rivals, in a problem of no other options; changed: that by the figure."""

    problem: Problem
    designs: tuple[Design, ...]  # the design itself first
    changed: Changed

    def best(self, at: float) -> tuple[Problem, Design] | None:
        """The best design where the figure has a value; None where the first one fails there."""
        other = self.changed(at)
        found = list(self._standing(other))
        if not found or found[0][0] != self.designs[0]:
            return None
        return other, min(found, key=lambda entry: entry[1])[2]

    def _standing(self, other: Problem) -> Iterator[tuple[Design, Rank, Design]]:
        for design in self.designs:
            same = same_design(self.problem, design, other)
            sums = None if same is None else evaluate(other, same)
            if same is not None and sums is not None and not broken(other, sums):
                yield design, rank(other, same, sums), same


def rivals(
    problem: Problem, design: Design, figure: Growing, least: float, beside: Beside
) -> Rivals | None:
    """The rivals of the best design of a problem as a figure grows; None where they are too many.

    least: the figure's least value.  Where the error is what is to be least, everything moves, and
    there are none that stay.
    """
    if not figure.only_worse:
        return None
    first = figure.vary(problem, design)(least)
    own = same_design(problem, design, first)
    known = None if own is None else Incumbent.of(first, own)
    if own is None or known is None or known.amount == math.inf or first.objective == "error":
        return None
    roles = list(first.roles)
    for r in figure.eased:
        roles[r] = replace(roles[r], options=figure.open_to(roles[r]), excluded=NOTHING)
    wide = replace(first, roles=tuple(roles))
    limit = first.limits.accuracy_m
    at_hand = same_design(first, own, wide)
    assert at_hand is not None
    most = Incumbent(at_hand, known.amount, math.inf if limit is None else limit)
    left = _left(wide, most, beside)
    found = _designs(left.problem, most, beside)
    if found is None:
        return None
    others = [one for one in map(left.whole, found) if one != at_hand]
    others = [one for one in others[:MOST_WEIGHED] if _may_follow(wide, one, most, figure)]
    if len(found) > MOST_WEIGHED or len(others) > MOST:
        return None
    return _only(wide, (at_hand, *others), figure.vary)


def _left(problem: Problem, most: Incumbent, beside: Beside) -> Narrowed:
    """Without the options that no rival can have; what one pass leaves tells the next one more."""
    left = whole_of(problem)
    for _ in range(PASSES):
        inner = left.problem
        at_hand = same_design(problem, most.design, inner)
        assert at_hand is not None
        fewer = core(inner, replace(most, design=at_hand), beside)
        left = fewer.within(left)
        if fewer.problem.combinations == inner.combinations:
            break
    return left


def _designs(problem: Problem, most: Incumbent, beside: Beside) -> list[Design] | None:
    """Designs within amount and error, by sums of least figures; None where they are too many."""
    have = float(most.amount * beside.unit)
    have += abs(have) * TIED
    rest = _still_to_come(problem, beside)
    amount, error, places = np.array([beside.clocks]), np.zeros(1), np.zeros((1, 0), dtype=np.intp)
    for r, table in enumerate(problem.roles):
        spent = beside.amounts(table.options)
        amounts = np.add.outer(amount, spent).ravel()
        errors = np.add.outer(error, table.options.added).ravel()
        least = np.maximum(errors, np.add.outer(error, _alone(problem, r)).ravel())
        room = most.total_m * (1.0 + TIED) - problem.fixed_error_m - least
        rows = np.flatnonzero(amounts + rest[r].least_within(room) <= have)
        if len(rows) > MOST_PARTIAL:
            return None
        before, here = np.divmod(rows, len(spent))
        amount, error = amounts[rows], errors[rows]
        places = np.column_stack([places[before], here])
    clocks = list(itertools.product(*(range(len(v.clocks)) for v in problem.vehicles)))
    if len(places) * len(clocks) > MOST_PARTIAL:
        return None
    return [Design(tuple(own), chosen) for own in places.tolist() for chosen in clocks]


def _alone(problem: Problem, r: int) -> Floats:
    """What options of a role add at least, their own timestamps included [m]."""
    return np.asarray(total_least(problem, r, problem.roles[r].options) - problem.fixed_error_m)


def _still_to_come(problem: Problem, beside: Beside) -> list[Stairs]:
    """What the roles after each one add at least."""
    out = [NO_ROLES]
    for table in problem.roles[:0:-1]:
        here = stairs(beside.amounts(table.options), table.options.added)
        out.append(here.beside(out[-1]))
    return out[::-1]


def _may_follow(problem: Problem, design: Design, most: Incumbent, figure: Growing) -> bool:
    """Whether a design costs no more and may meet every requirement later, all sums exact."""
    found = evaluate(problem, design)
    amount = found.amount(resource_of(problem))
    if amount is None or amount > most.amount:
        return False
    return found.error_m <= most.total_m if figure.eased else not broken(problem, found)


def _only(problem: Problem, designs: tuple[Design, ...], vary: Vary) -> Rivals:
    """The problem with the options of some designs alone."""
    roles, places = [], []
    for r, table in enumerate(problem.roles):
        rows: Indices = np.unique([one.options[r] for one in designs])
        options = table.options.take(rows)
        roles.append(replace(table, options=options, excluded=NOTHING))
        places.append({int(row): place for place, row in enumerate(rows)})
    inner = tuple(
        Design(tuple(at[i] for at, i in zip(places, one.options, strict=True)), one.clocks)
        for one in designs
    )
    smaller = replace(problem, roles=tuple(roles))
    return Rivals(smaller, inner, vary(smaller, inner[0]))
