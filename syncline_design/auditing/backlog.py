"""Messages that waited while the host stood still, and came at once when it went on."""

from __future__ import annotations

from typing import Final

import numpy as np

from syncline_design.auditing.series import Array, Mask

_QUICKLY: Final = 0.5  # of the time between their stamps, in which messages of a backlog come
_IN_A_ROW: Final = 4  # fewer a median of the messages beside them does not notice
_MOST: Final = 0.1  # of all messages: more is how they come, in packets or by turns


def held_up(interval: Array, late: Array) -> Mask:
    """Those whose receipt minus stamp tells how long the host stood still, and no level.

    interval: of stamps (n - 1,) [s]; late: receipt minus stamp (n,) [s].
    """
    quick = interval + np.diff(late) < _QUICKLY * interval
    edges = np.flatnonzero(np.diff(np.concatenate([[0], quick.astype(np.int8), [0]])))
    out = np.zeros(late.size, bool)
    for begin, end in edges.reshape(-1, 2):
        if end - begin >= _IN_A_ROW:
            out[begin : end + 1] = True
    return out if float(np.mean(out)) <= _MOST else np.zeros(late.size, bool)
