"""Noise of a motion column from row to row, told from motion that the rows are too far apart for.

Each row is foretold by a cubic of its neighbours, the row left out: of the nearest four, and of
twelve.  White noise leaves the same deviation either way; motion leaves far more by the twelve,
unless it is too quick for the rows: then it shows in the places as well.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from syncline_design.effects.record import Array
from syncline_design.logs.stamps import per_stamp
from syncline_design.model.normal import HALF_WITHIN

NEAR, WIDE = 2, 6  # neighbours on either side
MOST_CENTRES = 2000
ALIKE = 1.3  # ratio of the two deviations up to which they are one


def scatter(time_s: Array, column: Array) -> float:
    """Standard deviation of white noise per component of a column (n, 3); 0 where it is motion."""
    time_s, column = per_stamp(time_s, column)
    if time_s.shape[0] < 4 * WIDE:
        return 0.0
    last = time_s.shape[0] - 1 - WIDE
    centres = np.unique(np.linspace(WIDE, last, MOST_CENTRES).astype(np.int64))
    near, wide = (_deviation(time_s, column, centres, reach) for reach in (NEAR, WIDE))
    return near if wide < ALIKE * near else 0.0


def unforetold(time_s: Array, place_m: Array) -> float:
    """Deviation per component of places (n, 3) from what their neighbours foretell."""
    time_s, place_m = per_stamp(time_s, place_m)
    centres = np.arange(NEAR, time_s.shape[0] - NEAR)[:: 1 + time_s.shape[0] // MOST_CENTRES]
    return _deviation(time_s, place_m, centres, NEAR)


def _deviation(time_s: Array, column: Array, centres: NDArray[np.int64], reach: int) -> float:
    """Deviation of the noise that the cubics of `reach` neighbours on either side leave."""
    steps = np.concatenate([np.arange(-reach, 0), np.arange(1, reach + 1)])
    rows = centres[:, None] + steps
    since = time_s[rows] - time_s[centres][:, None]
    length = np.max(np.abs(since), axis=1, keepdims=True)
    powers = (since / length)[:, :, None] ** np.arange(4)
    # Of the neighbours, in the cubic's value at 0; beyond a long gap all of them are in one place.
    weights = np.linalg.pinv(powers)[:, 0, :]
    left = column[centres] - np.einsum("ij,ijk->ik", weights, column[rows])
    grown = np.sqrt(1.0 + np.sum(weights**2, axis=1))
    moving = np.any(left != 0.0, axis=0)
    if not np.any(moving):
        return 0.0
    scaled = np.abs(left / grown[:, None])[:, moving]
    return float(np.sqrt(np.mean((np.median(scaled, axis=0) / HALF_WITHIN) ** 2)))
