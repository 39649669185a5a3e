"""Silence that belongs to how a sensor measures: bursts, duty cycles, and what only events set off.

A link that breaks, or a driver that hangs, does so now and then and for any length of time.  A
sensor that is switched on and off is silent again and again, after as many messages each time and
for as long, or for most of the log.  One silence alone is a gap, however long.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from syncline_design.auditing.series import Array, spread
from syncline_design.machine.quick_dataclass import dataclass

LONG_GAP: Final = 4  # missing in a row; fewer may be single losses
_LEAST: Final = 6  # pauses
_LEAST_OF_CYCLE: Final = 2  # pauses of one length after one time
_LONG: Final = 20.0  # intervals; two shorter ones may be as long by chance
_LITTLE: Final = 0.2  # of a log's time: less silence is no cycle
_MOST: Final = 0.5  # of a log's time: more silence is how messages come
_ALIKE: Final = 0.15  # how much bursts of one kind differ
_COUNTS: Final = 2.0  # messages
_OFF_RHYTHM: Final = 0.1  # of an interval: half of pauses at any phase are off by 0.25 and more


@dataclass(frozen=True, slots=True)
class Pauses:
    """So many pauses, which take a share of the log's time.

    anew: the sensor begins with a phase of its own after each.
    """

    count: int
    share: float
    anew: bool


def pauses_of(interval: Array, steps: Array, period_s: float) -> Pauses | None:
    """None where silence is rare, or comes as breaks of a link do.

    interval: between messages [s]; steps: the same in whole intervals of the sensor.
    """
    places = np.flatnonzero(steps > LONG_GAP)
    share = float(interval[places].sum()) / max(float(interval.sum()), 1e-12)
    bursts = np.diff(places, prepend=-1, append=interval.size).astype(np.float64)
    if share < _LITTLE or not _recur(bursts, interval[places], share, period_s):
        return None
    off = float(np.median(np.abs(interval - steps * period_s)[places]))
    return Pauses(int(places.size), share, off > _OFF_RHYTHM * period_s)


def _recur(bursts: Array, silent_s: Array, share: float, period_s: float) -> bool:
    """Whether pauses are how messages come; bursts: messages before, between and after them, the
    first and the last of which the log may have cut."""
    between = bursts[1:-1]
    if silent_s.size >= _LEAST:
        alike = spread(between) <= max(_COUNTS, _ALIKE * float(np.median(between)))
        return alike or share > _MOST
    if silent_s.size < _LEAST_OF_CYCLE:
        return False
    if silent_s.size == _LEAST_OF_CYCLE and float(silent_s.min()) < _LONG * period_s:
        return False
    silent_alike = float(np.ptp(silent_s)) <= _COUNTS * period_s
    cut = float(max(bursts[0], bursts[-1])) <= float(between.min()) + _COUNTS
    return silent_alike and cut and float(np.ptp(between)) <= _COUNTS
