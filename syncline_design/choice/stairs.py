"""Least amounts against least errors: a bound on what roles add, whichever options they take."""

from __future__ import annotations

import math

import numpy as np

from syncline_design.choice.options import Floats
from syncline_design.machine.quick_dataclass import dataclass

MOST_STEPS = 64  # points of a staircase; between them it takes its lower corners


@dataclass(frozen=True, slots=True)
class Stairs:
    """Least amounts, rising, for least errors [m], falling: what some roles take at least."""

    amount: Floats
    error: Floats

    def least_within(self, error_m: Floats) -> Floats:
        """Least amount at no more than these errors; infinite where there is none."""
        place = np.searchsorted(-self.error, -error_m, side="left")
        amounts = np.append(self.amount, math.inf)
        return np.asarray(amounts[place])

    def beside(self, other: Stairs, most: int = MOST_STEPS) -> Stairs:
        """Two groups of roles together."""
        amounts = np.add.outer(self.amount, other.amount).ravel()
        return stairs(amounts, np.add.outer(self.error, other.error).ravel(), most)


NO_ROLES = Stairs(np.zeros(1), np.zeros(1))


def stairs(amount: Floats, error: Floats, most: int = MOST_STEPS) -> Stairs:
    """The lower left staircase of points, thinned out to its lower corners."""
    order = np.lexsort((error, amount))
    amount, error = amount[order], error[order]
    lowest = np.minimum.accumulate(error)
    steps = np.flatnonzero(np.append(True, error[1:] < lowest[:-1]))
    amount, error = amount[steps], error[steps]
    if len(steps) <= most:
        return Stairs(amount, error)
    starts = np.linspace(0, len(steps), most, endpoint=False).astype(np.intp)
    return Stairs(amount[starts], error[np.append(starts[1:], len(steps)) - 1])
