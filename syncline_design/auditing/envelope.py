"""The lower envelope of receipt minus stamp: what the fastest messages say of the clock alone.

Transport only delays: receipt - stamp = offset(t) + delay, delay >= 0.  The line of the lower
convex hull below the middle of the data is the offset (Olson 2010, A Passive Solution to the Sensor
Synchronization Problem; Zhang, Liu, Xia 2002, Clock Synchronization Algorithms for Network
Measurements: of all lines below the data it has the least sum of distances).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from syncline_design.auditing.series import Array

Places = NDArray[np.intp]


def lower_hull(x: Array, y: Array) -> Places:
    """Places of the lower convex hull, x ascending (Andrew's monotone chain)."""
    if x.size > 4000:
        kept = _lowest_of_pieces(y, 2000)
        found: Places = kept[lower_hull(x[kept], y[kept])]
        return found
    hull: list[int] = []
    for k in range(x.size):
        while len(hull) > 1 and not _turns_left(x, y, hull[-2], hull[-1], k):
            hull.pop()
        hull.append(k)
    return np.asarray(hull, dtype=np.intp)


def _lowest_of_pieces(y: Array, pieces: int) -> Places:
    """The lowest place of each of so many stretches, and both ends: no hull point is far from one.

    The hull of these lies above the data by less than the delay of one stretch's fastest message.
    """
    parts = np.array_split(np.arange(y.size), pieces)
    lowest = [int(part[np.argmin(y[part])]) for part in parts]
    return np.unique(np.asarray([0, *lowest, y.size - 1], dtype=np.intp))


def _turns_left(x: Array, y: Array, a: int, b: int, c: int) -> bool:
    return bool((x[b] - x[a]) * (y[c] - y[a]) > (y[b] - y[a]) * (x[c] - x[a]))


def lower_line(x: Array, y: Array) -> tuple[float, float]:
    """(offset at x = 0, slope) of the line below all points with the least sum of distances."""
    if x.size < 2 or x[-1] <= x[0]:
        return (float(y.min()) if y.size else 0.0), 0.0
    hull = lower_hull(x, y)
    middle = float(x.mean())
    k = int(np.searchsorted(x[hull], middle)) - 1
    k = min(max(k, 0), hull.size - 2)
    a, b = hull[k], hull[k + 1]
    slope = float((y[b] - y[a]) / (x[b] - x[a])) if x[b] > x[a] else 0.0
    return float(np.min(y - slope * x)), slope


def above_floor(x: Array, y: Array, *, sloping: bool) -> Array:
    """y above its envelope: a horizontal floor, or the line of the hull."""
    if not y.size:
        return y
    if not sloping:
        return np.asarray(y - y.min())
    offset, slope = lower_line(x, y)
    return np.asarray(y - (offset + slope * x))
