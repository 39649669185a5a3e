"""Receipts that go back: written out of order, noted by several threads, or of a clock that was
set."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from syncline_design.auditing.measured_order import set_back, set_by
from syncline_design.auditing.order import MOST_SPIKES, Repaired
from syncline_design.auditing.result import StampFault
from syncline_design.auditing.series import NS, Series, in_words, spread
from syncline_design.logs.readers.stream import UNSET

BACK_NS: Final = 100_000  # no clock is set by less
LARGE_SET_NS: Final = 5 * 10**8  # told without messages to compare
MOST_SETS: Final = 20  # times that a clock is set in a log
FEW_OTHERS: Final = 4  # falls near by: more are messages out of order
MOST_TRIED: Final = 2000  # falls of receipts that are looked at one by one
MOST_MOVED: Final = 50  # messages that one may be written too late by


def in_order_of_receipt(series: Series) -> Series:
    """Messages that were written out of order, with both their times, put in order again.

    By receipts; where their clock was set back, by those of one that was not.
    """
    if series.receive is None or not np.any(np.diff(series.receive) < 0):
        return series
    known = np.where(series.receive == UNSET, np.maximum.accumulate(series.receive), series.receive)
    orders = [np.arange(known.size), np.argsort(known, kind="stable")]
    places = series.places()
    if places.size:
        behind = set_back(series.stamp[places], known[places]).round().astype(np.int64)
        before = np.searchsorted(places, np.arange(known.size), "right") - 1
        orders.append(np.argsort(known + behind[np.maximum(before, 0)], kind="stable"))
    orders = [one for one in orders if _largest_move(one) <= MOST_MOVED]
    order = min(orders, key=lambda one: _falls(series.stamp[one][series.good[one]]))
    return replace(series, stamp=series.stamp[order], receive=series.receive[order],
                   good=series.good[order])  # fmt: skip


def _falls(stamp: NDArray[np.int64]) -> int:
    return int(np.sum(np.diff(stamp) < 0))


def _largest_move(order: NDArray[np.intp]) -> int:
    return int(np.max(np.abs(order - np.arange(order.size))))


def with_receipts_forward(series: Series) -> Repaired:
    """Receipts that go back.

    Where all later ones stay back the recorder's clock was set.  Else some were noted out of order,
    as several threads do: no fault, they count as received no earlier than the one before.
    """
    if series.receive is None or series.receive.size < 3:
        return Repaired(series)
    change = np.diff(series.receive)
    falls = np.flatnonzero((change < 0) & series.good[1:] & series.good[:-1])
    if not falls.size:
        return Repaired(series)
    late = series.receive - series.stamp - _jumps_of_stamps(series)
    moved, faults = _sets(series, late, change, falls) if falls.size <= MOST_TRIED else (0, [])
    put_back = replace(series, receive=series.receive + moved)
    return Repaired(_without_disorder(put_back), tuple(faults))


def _jumps_of_stamps(series: Series) -> NDArray[np.int64]:
    """How late messages are because the clock of their stamps jumped [ns]."""
    places = series.places()
    assert series.receive is not None
    if not places.size:
        return np.zeros(series.stamp.size, np.int64)
    level = set_by(series.stamp[places], series.receive[places])
    before = np.searchsorted(places, np.arange(series.stamp.size), "right") - 1
    return level[np.maximum(before, 0)].round().astype(np.int64)


def _sets(
    series: Series, late: NDArray[np.int64], change: NDArray[np.int64], falls: NDArray[np.intp]
) -> tuple[NDArray[np.int64], list[StampFault]]:
    """By how much receipts are behind after their clock was set back, and each time it was."""
    usual = int(np.median(change))
    moved = np.zeros(series.stamp.size, np.int64)
    faults: list[StampFault] = []
    times = series.seconds
    for fall in falls[change[falls] < -BACK_NS]:
        size = _set_back(series, late, int(fall), usual - int(change[fall]))
        if size is None or len(faults) >= MOST_SETS:
            continue
        moved[fall + 1 :] += size
        faults.append(StampFault(
            "recorder_clock", {"seconds": size / NS, "kind": "step"}, float(times[fall]),
            float(times[-1]),
            f"receipts go back and stay behind by {in_words(size / NS)}: the recorder's clock was "
            "set",
        ))  # fmt: skip
    return moved, faults


def _set_back(
    series: Series, late: NDArray[np.int64], fall: int, about: int
) -> int | None:  # fmt: skip
    """By how much [ns], as messages before and after differ in lateness; None where it passes.

    about: the fall itself and the usual interval; single delays are in it.
    """
    sizes, noise = [], []
    for around in (60, 300):
        low, high = max(0, fall - around + 1), fall + 1 + around
        before = late[low : fall + 1][series.good[low : fall + 1]]
        after = late[fall + 1 : high][series.good[fall + 1 : high]]
        if min(before.size, after.size) < 4:
            return about if about > LARGE_SET_NS else None
        scattered = max(spread(before.astype(np.float64)), spread(after.astype(np.float64)))
        size = float(np.median(before) - np.median(after))
        if size > 2.0 * about + 4.0 * scattered:  # more than receipts fall by: the stamps' own
            return None
        sure = 5.0 * scattered / np.sqrt(min(before.size, after.size))
        if size < max(0.5 * about - scattered, sure, 0.2 * about):
            return None
        sizes.append(size)
        noise.append(float(sure))
    best = sizes[1] if abs(sizes[1] - sizes[0]) < noise[0] else sizes[0]  # the surer, if no drift
    return round(best) if _by_count(series, fall, best) else None


def _by_count(series: Series, fall: int, size: float) -> bool:
    """Whether receipts alone are behind by so much [ns], against the count of messages.

    It tells a recorder's clock from stamps that jump while receipts come out of order.  Messages
    that come too unevenly for it count where receipts fall nowhere else near by.
    """
    assert series.receive is not None
    receive = series.receive
    lag = min(60, receive.size // 2)
    usual = float(np.median((receive[lag:] - receive[:-lag]) / lag))
    low, high = max(0, fall - 59), min(receive.size, fall + 61)
    apart = (receive[low:high] - receive[fall]) - usual * np.arange(low - fall, high - fall)
    before, after = apart[: fall + 1 - low], apart[fall + 1 - low :]
    if max(spread(before), spread(after)) < 0.3 * size:
        return float(np.median(before) - np.median(after)) > 0.5 * size
    others = int(np.sum(np.diff(receive[low:high]) < -BACK_NS)) - 1
    return others < FEW_OTHERS


def _without_disorder(series: Series) -> Series:
    """Receipts that never fall; a message that would have come before all others of its time,
    measured by how late it is, is left out."""
    assert series.receive is not None
    places = series.places()
    receive = series.receive[places]
    falls = np.flatnonzero(np.diff(receive) < 0)
    if not falls.size:
        return series
    late = receive - series.stamp[places]
    good = series.good.copy()
    for fall in falls[:MOST_SPIKES]:
        around = np.concatenate([late[max(0, fall - 60) : fall], late[fall + 2 : fall + 61]])
        if around.size >= 8:
            low, middle = np.percentile(around, [5.0, 50.0])
            if late[fall + 1] < low - (middle - low):
                good[places[fall + 1]] = False
    whole = series.receive.copy()
    left = np.flatnonzero(good)
    whole[left] = np.maximum.accumulate(whole[left])
    return replace(series, receive=whole, good=good)
