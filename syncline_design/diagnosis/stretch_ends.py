"""Where something that acts in a stretch of a log begins and ends, to the row.

Windows of a few lengths find that something acts, with ends that are off by a sixth of it.  With
X b what it would do to a row if it acted there, and W the inverse of the row's noise, the row saves
    g = x' W (e - x / 2),   x = X b,
which is x' W x / 2 on average where it acts, and as much less than nothing where it does not.  The
stretch is the one of the largest sum of g; beyond either end the sum falls by so little within few
rows that noise alone makes it: these are its margin.
Source: change points by the likelihood ratio, Hinkley, Biometrika 57 (1970).
"""

from __future__ import annotations

from typing import Final

import numpy as np

from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass

UNSURE_NATS: Final = 10.0  # that the rows beside an end have to cost, for it to lie before them
MARGIN, MARGIN_ROWS = 0.25, 2  # of the stretch at most, and rows at least
REACH: Final = 1.0  # of a window to either side, in which its ends are looked for


@dataclass(frozen=True, slots=True)
class Ends:
    """First and last row, and the rows beside either by which it may be off."""

    first: int
    last: int
    margin: int


def ends(saved: Array, told: Array, first: int, last: int) -> Ends:
    """The stretch in and around a window [first, last] of rows.

    saved: g of every row; told: x' W x of every row, what it can tell.
    """
    reach = max(round(REACH * (last - first + 1)), 1)
    low, high = max(first - reach, 0), min(last + reach, len(saved) - 1)
    total = np.concatenate([[0.0], np.cumsum(saved[low : high + 1])])
    least = np.minimum.accumulate(total)
    stops = int(np.argmax(total[1:] - least[:-1])) + 1  # Kadane's maximum subarray
    begins = int(np.argmin(total[:stops]))
    first, last = low + begins, low + stops - 1
    own = told[first : last + 1]
    rows = max(
        int(np.searchsorted(0.5 * np.cumsum(side), UNSURE_NATS)) for side in (own, own[::-1])
    )
    return Ends(first, last, MARGIN_ROWS + min(rows, round(MARGIN * len(own))))
