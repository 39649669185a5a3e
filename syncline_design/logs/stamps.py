"""Rows that share a stamp: several targets of one scan are seen from one pose.

Whatever follows the vehicle through time (splines, slopes, slow noise) runs over distinct stamps;
the rows of one stamp then take what was found there.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from syncline_design.effects.record import Array

Index = NDArray[np.intp]


def starts(time_s: Array) -> Index:
    """First row of every distinct stamp, for stamps that never fall."""
    if not time_s.shape[0]:
        return np.zeros(0, dtype=np.intp)
    return np.flatnonzero(np.concatenate([[True], time_s[1:] != time_s[:-1]]))


def groups(time_s: Array) -> Index:
    """Which distinct stamp every row has, (n,)."""
    first = np.zeros(time_s.shape[0], dtype=np.intp)
    first[starts(time_s)[1:]] = 1
    return np.cumsum(first)


def repeated(time_s: Array) -> bool:
    """Whether any two rows share a stamp."""
    return bool(np.any(time_s[1:] == time_s[:-1]))


def summed(first: Index, values: Array) -> Array:
    """Sum over the rows of every stamp: (n, ...) to (stamps, ...)."""
    total: Array = np.add.reduceat(values, first, axis=0)
    return total


def per_stamp(time_s: Array, values: Array) -> tuple[Array, Array]:
    """Distinct stamps, and the mean of the values (n, ...) over the rows of each."""
    if not repeated(time_s):
        return time_s, values
    first = starts(time_s)
    count = np.diff(first, append=time_s.shape[0])
    mean = summed(first, values) / count.reshape(-1, *([1] * (values.ndim - 1)))
    return time_s[first], mean


def usual_step_s(time_s: Array) -> float:
    """Median time between distinct stamps [s]."""
    return float(np.median(np.diff(time_s[starts(time_s)])))
