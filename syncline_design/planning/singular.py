"""Of what is asked together, combinations that no drive tells, and which part of each is held.

The clocks of all sensors that run fast by the same rate shift nothing, and the two lever arms of a
rigid body make one error: the information of such effects asked together is singular, whatever is
driven.  One of them has to be known otherwise, as a reference; the others are then told beside it.
Held is the one that is met most seldom, of equals the last in the order position, attitude,
ranging, target.
Source: Rothenberg, Identification in Parametric Models (1971), theorem 1: parameters are locally
told where the information matrix is of full rank.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from syncline_design.diagnosis.candidates import commonness
from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.planning.information import Unknown, covariance_of
from syncline_design.planning.wanted import Goal


@dataclass(frozen=True, slots=True)
class HeldPlaces:
    """A parameter that is held, and the others of a combination that shifts nothing, by places
    among the unknowns; no others: no drive shows it at all."""

    held: int
    beside: tuple[int, ...]


def told_beside(
    every: Sequence[Unknown], goal: Goal, library: Array
) -> tuple[Goal, tuple[HeldPlaces, ...]]:
    """The goal without what no drive tells from the rest of it; library: all legs together.

    What is part of a pair is never held: of pairs the plan says itself whether a drive tells them.
    Where nothing would be left, the goal stays.
    """
    tolerance = dict(zip(goal.wanted, goal.tolerance, strict=True))
    paired = {k for pair in goal.pairs for k in (*pair.first, *pair.second)}
    kept: list[int] = [k for k in goal.wanted if k in paired]
    found: list[HeldPlaces] = []
    for k in sorted((k for k in goal.wanted if k not in paired), key=lambda k: _order(every, k)):
        lost = _lost(library, [*kept, k])
        if k in lost:
            found.append(HeldPlaces(k, tuple(sorted(lost - _lost(library, kept) - {k}))))
        else:
            kept.append(k)
    if not found or not kept:
        return goal, ()
    order = tuple(sorted(kept))
    return Goal(order, np.array([tolerance[k] for k in order]), goal.pairs), tuple(found)


def told_by_size(goal: Goal, library: Array) -> Goal:
    """The goal without the rival of the first pair, where the two are one to first order and only
    the size that is known tells them apart.

    With both free at zero neither has a figure, whatever is driven: what the drive makes of the
    first is then told as it is once the rival is out, and so is what other effects take of it.
    """
    pair = goal.pairs[0] if goal.pairs else None
    if pair is None or pair.beyond is None:
        return goal
    if not _lost(library, [*pair.first, *pair.second]):
        return goal
    asked = np.isfinite(goal.tolerance)
    kept = [
        i for i, k in enumerate(goal.wanted) if asked[i] or k in pair.first or k not in pair.second
    ]
    return Goal(tuple(goal.wanted[i] for i in kept), goal.tolerance[kept], goal.pairs)


def _lost(information: Array, index: list[int]) -> set[int]:
    """Of some parameters those that the information on all of them together does not tell."""
    if not index:
        return set()
    _, lost = covariance_of(information[np.ix_(index, index)])
    return {k for k, is_lost in zip(index, lost, strict=True) if is_lost}


def _order(every: Sequence[Unknown], k: int) -> tuple[tuple[int, int], int]:
    """The commonest first."""
    return commonness(every[k].candidate.label), k
