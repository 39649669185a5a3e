"""Holes of whole intervals: messages are lost, and stamps that go on at a + k T tell so alone.

Where receipts jump beyond such a hole, either they alone did (a queue, another way), or stamps were
set back by whole intervals just where messages are missing.  Levels of receipt minus stamp tell the
two apart where these are known to much less than an interval: what transport adds is of any size.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from syncline_design.auditing.cadence import Cadence
from syncline_design.auditing.pauses import LONG_GAP
from syncline_design.auditing.series import MEDIAN_SIGMA, Array, Mask, Series, seconds, spread

_JITTER: Final = 10.0  # times: how near to whole intervals such a hole is
_LEAST_S: Final = 2e-5
_SLOW: Final = 2e-4  # of a hole: oscillators wander by less within it
_APART: Final = 6  # messages: receipts in bunches are even from one to the next
_SURE: Final = 3.0  # sigma
_TOLD: Final = 0.25  # of an interval: levels that are known to less tell whole ones apart
_NEXT: Final = 8  # messages on each side of an interval that is counted
_MOST_ODD: Final = 5000
_LASTS: Final = 0.2  # of a log's messages: queues drain within less


def counted(series: Series, pace: Cadence) -> Array:
    """Messages from each to the next: as stamps say, where these jumped as receipts do."""
    assert series.receive is not None
    passed = seconds(np.diff(series.receive[pace.places]))
    late = seconds((series.receive - series.stamp)[pace.places])
    steps = np.maximum(pace.steps, 1.0)
    by_receipt = np.maximum(np.round(passed / pace.period_s), 1.0)
    whole, sure = _whole_holes(pace), _uncertainty(late, _NEXT)
    odd = np.flatnonzero((steps != by_receipt) & (pace.steps != 1.0))
    for k in odd[:_MOST_ODD]:
        before, after = late[max(0, k + 1 - _NEXT) : k + 1], late[k + 1 : k + 1 + _NEXT]
        moved = float(np.median(before) - np.median(after))
        jump = float(pace.interval[k] - by_receipt[k] * pace.period_s)
        beyond = bool(whole[k]) and by_receipt[k] > steps[k]
        if beyond and not _set_back(pace, late, int(k), moved, (jump, sure)):
            continue  # receipts jumped where messages are lost
        if abs(moved - jump) < 0.5 * pace.period_s:
            steps[k] = by_receipt[k]
    return steps


def passed(series: Series, pace: Cadence) -> Array:
    """Intervals of the sensor from each message to the next, of which lost ones are no jump; one
    each where delays scatter by as much as an interval, so that nothing tells these."""
    assert series.receive is not None
    late = seconds((series.receive - series.stamp)[pace.places])
    if not _tells_whole_ones(pace, _uncertainty(late, _NEXT)):
        return np.ones(pace.steps.size)
    return np.asarray(np.minimum(counted(series, pace), np.maximum(pace.steps, 1.0)))


def _tells_whole_ones(pace: Cadence, sure_s: float) -> bool:
    return _SURE * sure_s < _TOLD * pace.period_s


def _whole_holes(pace: Cadence) -> Mask:
    """Intervals that are several whole ones of the sensor."""
    near = np.maximum(max(_JITTER * pace.jitter_s, _LEAST_S), _SLOW * pace.interval)
    off = np.abs(pace.interval - pace.steps * pace.period_s)
    return np.asarray((pace.steps > 1.0) & (off <= near))


def _uncertainty(late: Array, many: int) -> float:
    """Of a change of the median of so many messages on each side [s]."""
    width = min(spread(late), spread(late[_APART:] - late[:-_APART]))
    return MEDIAN_SIGMA * width * float(np.sqrt(2.0 / many)) + 1e-12


def _set_back(
    pace: Cadence, late: Array, k: int, moved_s: float, sizes_s: tuple[float, float]
) -> bool:
    """Whether stamps, rather than receipts, jumped over the k-th interval, a hole of whole ones.

    moved_s: by how much stamps gain on receipts there; sizes_s: the jump by whole intervals that
    this would be, and how well levels are known.
    """
    jump_s, sure_s = sizes_s
    told = _tells_whole_ones(pace, sure_s)
    if told and abs(moved_s - jump_s) > max(_SURE * sure_s, _JITTER * pace.jitter_s, _LEAST_S):
        return False
    if pace.steps[k] > LONG_GAP:
        return True
    return told and _lasts(late, k, moved_s)


def _lasts(late: Array, k: int, moved_s: float) -> bool:
    """Whether receipts stay as far from their stamps, message by message, for a part of the log."""
    after = late[k + 1 :]
    middle = float(np.median(late[max(0, k - 7) : k + 1])) - 0.5 * moved_s
    back = np.flatnonzero(after < middle)
    return (int(back[0]) if back.size else after.size) > _LASTS * late.size


def breaks_none(pace: Cadence, holes: NDArray[np.intp], jump_s: float, sure_s: float) -> bool:
    """Whether all these intervals are of whole ones, which a jump by this size would not leave."""
    near = max(_SURE * sure_s, _TOLD * pace.period_s)
    apart = abs(jump_s - round(jump_s / pace.period_s) * pace.period_s)
    return bool(np.all(_whole_holes(pace)[holes])) and apart > near
