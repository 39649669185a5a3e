"""How well rows that gain by something are put into a few whiles of a log, or into many."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from syncline_design.effects.record import Array


def runs_of(rows: NDArray[np.bool_]) -> int:
    """How many runs of rows there are."""
    return int(np.sum(np.diff(np.r_[False, rows].astype(int)) > 0))


def gained_in_whiles(gain: Array, most: int) -> float:
    """The most that rows [nat] gain in at most so many whiles, of which each pays for its ends.

    With c the running sum, a while that ends at i gains c_i - c_j after what was gained up to j.
    """
    if len(gain) == 0:
        return 0.0
    summed = np.r_[0.0, np.cumsum(gain)]
    ends = 2.0 * math.log(len(gain))
    up_to = np.zeros(len(summed))
    for _ in range(most):
        inside = summed + np.maximum.accumulate(up_to - summed) - ends
        further = np.maximum(up_to, np.maximum.accumulate(inside))
        if np.array_equal(further, up_to):
            break
        up_to = further
    return float(up_to[-1])
