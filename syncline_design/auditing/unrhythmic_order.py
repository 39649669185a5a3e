"""Messages of stamps without a rhythm that several threads noted in another order.

Stamps taken when a packet or a message comes keep no rhythm that tells where each belongs.  Of two
kinds they are put in order all the same: those that lie behind others by little of the sensor's
interval and of the delays, as no wrong stamp does; and those that, once in order, are of packets,
of a grid, or of arrivals, where their delay is one of the others'.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from syncline_design.auditing.arrival import arrived_in_part, stamped_on_arrival
from syncline_design.auditing.cadence import cadence
from syncline_design.auditing.grains import packetised, truncated
from syncline_design.auditing.measured_order import LEAST_MESSAGES, course, set_by
from syncline_design.auditing.series import Series

_LITTLE: Final = 0.2  # of an interval
_AS_DELAYS: Final = 2.0  # and of what nine in ten delays reach
_MOST_LATE: Final = 4.0  # of what nine in ten delays reach; of gamma-like ones 1 in 10^7 more


def order_without_rhythm(series: Series) -> NDArray[np.intp] | None:
    """Places of messages in the order of their stamps; None where nothing is to be moved."""
    places = series.places()
    if series.receive is None or places.size < LEAST_MESSAGES:
        return None
    stamp = series.stamp[places]
    late = (series.receive[places] - stamp).astype(np.float64)
    level = set_by(stamp, series.receive[places])  # a clock that was set, a counter
    away = late - level
    away -= course(away)
    key = stamp + np.round(level).astype(np.int64)
    interval = float(np.ptp(np.percentile(stamp, [5.0, 95.0]))) / (0.9 * places.size)
    nine_in_ten = float(np.subtract(*np.percentile(away, [95.0, 5.0])))
    reach, little = _MOST_LATE * nine_in_ten, min(_LITTLE * interval, _AS_DELAYS * nine_in_ten)
    for deepest in (reach, little):
        sorted_ = _in_order(key, np.abs(away) <= reach, deepest, little)
        if sorted_ is None or _falls(stamp[sorted_]) >= _falls(stamp):
            continue
        order = np.arange(series.stamp.size)
        order[places] = places[sorted_]
        if deepest == little or _explained(series, order):
            return order
    return None


def _in_order(
    key: NDArray[np.int64], usual: NDArray[np.bool_], deepest: float, little: float
) -> NDArray[np.intp] | None:
    """Messages sorted by when they were measured [ns] that lie behind usual ones by no more than
    `deepest` [ns], and are usual themselves or lie behind by a little."""
    newest = np.maximum.accumulate(np.where(usual, key, key.min()))
    behind = newest - key
    moved = (behind > 0) & (behind <= np.where(usual, deepest, little))
    if not moved.any():
        return None
    # all others stay where they are: between those that came before and after them
    order = np.argsort(np.where(moved, key, newest), kind="stable")
    return order if bool(np.any(order != np.arange(order.size))) else None


def _falls(stamp: NDArray[np.int64]) -> int:
    return int(np.count_nonzero(np.diff(stamp) < 0))


def _explained(series: Series, order: NDArray[np.intp]) -> bool:
    """Whether stamps in that order are of packets, of a grid, or of arrivals."""
    assert series.receive is not None
    put = replace(
        series, stamp=series.stamp[order], receive=series.receive[order], good=series.good[order]
    )
    pace = cadence(put)
    if truncated(put, pace, 1.0) or packetised(put, pace):
        return True
    return bool(arrived_in_part(put, pace) or stamped_on_arrival(put, pace))
