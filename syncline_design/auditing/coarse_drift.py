"""Drift that coarse stamps hide in less than one of their ticks.

A tick is no limit where messages are counted: of stamps cut off to a grid the rhythm behind them
is known to far less (`coarse_rhythm`), and packets are stamped when they come, so that receipts
follow each to transport's own scatter.
"""

from __future__ import annotations

from collections.abc import Set
from typing import Final

import numpy as np
from numpy.typing import NDArray

from syncline_design.auditing.blocks import blocks_of
from syncline_design.auditing.clock_shapes import Shape, course
from syncline_design.auditing.coarse_rhythm import counted_behind, periods_within
from syncline_design.auditing.levels import believed, polished
from syncline_design.auditing.naming import all_named
from syncline_design.auditing.result import FaultName, StampFault
from syncline_design.auditing.series import Array, Series, seconds
from syncline_design.auditing.witness import straight
from syncline_design.logs.readers.stream import Nanoseconds

_MOST_WAITED: Final = 1.1  # ticks, with a message or two that were counted elsewhere


def drift_behind(
    series: Series, names: Set[FaultName], tick_s: float, least_s: float
) -> tuple[Series, tuple[StampFault, ...]]:
    """The series without a drift of less than a tick, and that drift; least_s: of the receipts."""
    late, unsure_s = _late(series, names, tick_s)
    time_s = series.seconds[series.places()]
    blocks = None if late is None else blocks_of(time_s, late)
    if late is None or blocks is None or blocks.usable.sum() < 8:
        return series, ()
    drift = Shape("drift", begin_s=float(time_s[0]), end_s=float(time_s[-1]))
    found = polished((drift,), [True], blocks)
    use = blocks.usable
    alone = straight(blocks.time_s[use], blocks.low_s[use], blocks.noise_s)
    if not alone or not believed(found[0], blocks, max(least_s, unsure_s)):
        return series, ()
    moved = course(found, time_s)[_first_alike(series.stamp[series.places()])]
    return series.stamped_later(moved), tuple(all_named(found, time_s))


def _late(series: Series, names: Set[FaultName], tick_s: float) -> tuple[Array | None, float]:
    """Receipt minus what stamps would be without their grid [s], and by how much a rhythm is unsure
    over the log [s]; None where no rhythm tells."""
    if series.receive is None or series.good.sum() < 2:
        return None, 0.0
    places = series.places()
    late = seconds((series.receive - series.stamp)[places])
    if "packetised" in names:
        return np.asarray(late - np.median(late)), 0.0
    count = counted_behind(series, names, tick_s)
    if count is None:
        return None, 0.0
    when = seconds(series.stamp[places] - series.stamp[places[0]])
    period = 0.5 * sum(periods_within(when, count.number, tick_s))
    waits = when - period * count.number
    if float(np.ptp(waits)) > _MOST_WAITED * tick_s:
        return None, 0.0  # miscounted
    # where an interval is nearly a simple part of the tick few waits are met, and many rhythms fit
    low, high = periods_within(when, count.number, _MOST_WAITED * tick_s)
    unsure = 0.5 * (high - low) * float(np.ptp(count.number))
    return np.asarray(late + waits - np.median(late + waits)), unsure


def _first_alike(stamp: Nanoseconds) -> NDArray[np.intp]:
    """The first message with the stamp of each: these stay alike."""
    heads = np.concatenate([[True], np.diff(stamp) != 0])
    return np.maximum.accumulate(np.where(heads, np.arange(stamp.size), 0))
