"""Whether what is left goes on from row to row: it is no white noise then, whatever it looks like.

A place that drifts off in a turn is one course in the world, and scatters in ranges to ever other
targets as noise of these does.  So it is looked at as every sensor reads it: with l_c what one unit
of a reading does to the error e, m_c = l_c . e / |l_c| is a course where sum m(t) m(t + dt) makes
up more than half of sum m^2.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

import numpy as np

from syncline_design.effects.record import Array
from syncline_design.logs.stamps import starts

STEADY: Final = 0.5  # correlation of one row with the next above which it is no noise


def goes_on(time_s: Array, left: Array, slopes: Iterable[Array]) -> bool:
    """left (n, a): the error, less what lasts; slopes (n, a, c): of the readings of each sensor."""
    rows = starts(time_s)  # rows of one stamp share what the pose scatters
    return len(rows) < 3 or any(_is_steady(left[rows], own[rows]) for own in slopes)


def _is_steady(left: Array, slopes: Array) -> bool:
    size = np.linalg.norm(slopes, axis=1)
    seen = np.einsum("nac,na->nc", slopes, left) / np.maximum(size, np.finfo(float).tiny)
    return bool(np.sum(seen[1:] * seen[:-1]) > STEADY * np.sum(seen**2))
