"""The order in which messages were measured, from stamps that may jump and some that are wrong.

Transport changes the order of receipts, a clock that is set back that of stamps, and single stamps
may be wrong.  A message is put where its stamp says, stretches after a clock went back moved to
follow the ones before: which of both a message belongs to is told by how late it is.  A stamp that
lies between two places of the sensor's rhythm, or on one that another message took with less delay,
is wrong; its message is put where its receipt says.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from syncline_design.auditing.series import Array, Mask, Series
from syncline_design.logs.readers.stream import UNSET
from syncline_design.machine.quick_dataclass import dataclass

Places = NDArray[np.intp]

LEAST_MESSAGES: Final = 40
_SIDE: Final = 5  # messages whose median is a level
_BLOCK: Final = 24  # messages that tell a usual interval, delay and scatter
_JUMP: Final = 3.0  # of the delays' scatter: a clock that goes back by less is not told from them
_INTERVALS: Final = 1.5  # and of the interval
_GAP, _LONG, _CALM = 0.5, 2.0, 0.3  # of what usually passes
_MIXED: Final = 48  # messages about a jump that may be of either side
_APART: Final = 12  # messages between two jumps
_OFTEN, _LEAST_OF_RUN = 8, 3
_HERE: Final = 0.5  # of a jump, by the messages next to it
_LEVEL: Final = 64  # messages that tell how far it went
_NEAR: Final = 0.2  # of an interval: how near to the rhythm stamps are once in order
_MOST_ODD: Final = 0.1  # of all intervals, and of all stamps
_ROUNDS: Final = 3
_NEXT: Final = 9  # intervals, most of which are usual
_MOST_FREE: Final = 20_000
_LONG_GAP: Final = 50.0  # intervals
_REPEATED: Final = 2.5  # intervals: a message that repeats an older stamp than its last but one
_COVERED: Final = 0.5  # of the time that passed
_ALONE, _MOST_ALONE = 0.6, 0.6  # of an interval; of the messages far behind
DEEPEST_NS: Final = 2 * 10**9  # a stamp further back was not overtaken


@dataclass(frozen=True, slots=True, eq=False)
class Sequence:
    """order: of messages as they were measured.  wrong: whose stamps are none of their own.

    behind_ns: how far each right one lies behind one that came before it.  away_ns: how late each
    is beyond others near by.  period_ns: the usual interval.
    """

    order: Places
    wrong: Mask
    behind_ns: Array
    away_ns: Array
    period_ns: float


def sequence_of(series: Series) -> Sequence | None:
    """Messages in order of receipt put in order of measurement; None where no rhythm, be it one
    that changes slowly, says that they are."""
    places = series.places()
    if series.receive is None or places.size < LEAST_MESSAGES:
        return None
    stamp, receive = series.stamp[places], series.receive[places]
    late = (receive - stamp).astype(np.float64)
    least = _least(receive, late)
    if _crowded(_of_stamps(stamp, receive, least)):
        return None
    level = set_by(stamp, receive)
    key = stamp + np.round(level).astype(np.int64)
    if _folded(key, receive):
        return None
    jumps = _levels(late, np.abs(_advance(receive - stamp)) > least, least)  # of either clock
    usual = jumps + course(late - jumps)
    away = late - usual
    right = away > -least  # nothing comes before it was measured
    for _ in range(_ROUNDS):
        odd = _wrong(key, away, right)
        if not odd.any():
            break
        right &= ~odd
    behind = np.maximum.accumulate(np.where(right, key, key.min())) - key
    right &= (behind <= DEEPEST_NS) & ~_displaced(key, away, right, behind)
    period = _kept(key[right]) if float(np.mean(right)) > 1.0 - _MOST_ODD else None
    if period is None:
        return None
    told = np.zeros(series.stamp.size, bool)
    told[places[right]] = True
    order = np.argsort(_placed(series, told, key[right], usual - level, least), kind="stable")
    wrong = series.good & ~told
    wrong[places[:_SIDE]] = wrong[places[-_SIDE:]] = False  # too few to tell a jump by
    overtaken: Array = np.where(right, behind, 0).astype(np.float64)
    return Sequence(order, wrong, overtaken, away, period)


def _folded(key: NDArray[np.int64], receive: NDArray[np.int64]) -> bool:
    """Whether stamps in order cover much less time than passed, as those of a counter that begins
    anew before a jump can be told: to sort them would fold all its turns into one."""
    covered, passed = (np.subtract(*np.percentile(x, [95.0, 5.0])) for x in (key, receive))
    return bool(covered < _COVERED * passed)


def _placed(
    series: Series, told: Mask, key: NDArray[np.int64], usual: Array, least: float
) -> NDArray[np.int64]:  # fmt: skip
    """When every message was measured [ns]: as its stamp says, or, of those whose stamps say
    nothing, at the empty place of the rhythm that is nearest to what receipts say."""
    assert series.receive is not None
    placed = np.zeros(told.size, np.int64)
    placed[told] = key
    others = np.flatnonzero(~told)
    before = np.clip(np.searchsorted(series.places(), others) - 1, 0, usual.size - 1)
    came = np.maximum.accumulate(np.where(told, series.receive, 0))
    came = np.where(series.receive == UNSET, came, series.receive)
    expected = came[others] - np.round(usual[before]).astype(np.int64)
    free = _empty(np.sort(key))
    for k, at in zip(others, expected, strict=True):
        low = int(np.searchsorted(free, at - least))
        near = free[low : int(np.searchsorted(free, at + least, "right"))]
        placed[k] = at
        if near.size and free.size <= _MOST_FREE:
            nearest = int(np.argmin(np.abs(near - at)))
            placed[k] = near[nearest]
            free = np.delete(free, low + nearest)
    return placed


def _empty(key: NDArray[np.int64]) -> NDArray[np.int64]:
    """Places of the rhythm that no message takes [ns], but for those in long gaps."""
    change = np.diff(key).astype(np.float64)
    counts = np.round(change / _periods(change))
    found = [
        key[k] + np.round(change[k] / counts[k] * np.arange(1, counts[k])).astype(np.int64)
        for k in np.flatnonzero((counts > 1.0) & (counts < _LONG_GAP))
    ]
    return np.concatenate(found) if found else np.zeros(0, np.int64)


def course(values: Array) -> Array:
    """The slow course of values: medians of blocks, and lines between them."""
    count = max(1, values.size // _BLOCK)
    kept = values[: count * _BLOCK]
    level = np.median(kept.reshape(count, -1), axis=1)
    middle = (np.arange(count) + 0.5) * (kept.size / count) - 0.5
    return np.asarray(np.interp(np.arange(values.size), middle, level))


def _scatter(late: Array) -> float:
    """How far delays usually reach [ns], as neighbours differ: no jump, no slow course enters."""
    return float(np.subtract(*np.percentile(np.diff(late), [90.0, 10.0]))) / float(np.sqrt(2.0))


# ---- clocks that jump ------------------------------------------------------------------------


def set_back(stamp: NDArray[np.int64], receive: NDArray[np.int64]) -> Array:
    """By how much the receipts of messages in any order are behind the first ones, as far as
    lateness falls by jumps [ns]: their clock was set back, or that of stamps forward."""
    late = (receive - stamp).astype(np.float64)
    if late.size < LEAST_MESSAGES:
        return np.zeros(late.size)
    least = _least(receive, late)
    return -_levels(late, _advance(receive - stamp) < -least, least)


def set_by(stamp: NDArray[np.int64], receive: NDArray[np.int64]) -> Array:
    """By how much messages in order of receipt are later than the first ones because the clock of
    their stamps jumped [ns]."""
    late = (receive - stamp).astype(np.float64)
    if late.size < LEAST_MESSAGES:
        return np.zeros(late.size)
    least = _least(receive, late)
    return _levels(late, _of_stamps(stamp, receive, least), least)


def _least(receive: NDArray[np.int64], late: Array) -> float:
    """What no delay usually is [ns]: an earlier message, or a smaller jump, cannot be told."""
    interval = float(receive.max() - receive.min()) / (receive.size - 1)
    return max(_JUMP * _scatter(late), _INTERVALS * interval)


def _levels(late: Array, off: Mask, least: float) -> Array:
    """How late messages are beyond the first ones because of jumps of more than `least` [ns].

    off: where the messages of both sides differ.  Near a jump how late a message is tells its side.
    """
    found = np.concatenate([[0], _middles(off) + _SIDE, [late.size]])
    level = np.zeros(late.size)
    last = -_APART
    for at in found[1:-1]:
        first, end = _bounds(found, int(at))
        base = float(np.median(late[max(first, at - _LEVEL) : at]))
        moved = float(np.median(late[at : min(end, at + _LEVEL)])) - base
        near = float(np.median(late[at : at + _APART]) - np.median(late[max(0, at - _APART) : at]))
        if abs(moved) < least or at < last + _APART or near / moved < _HERE:
            continue
        last = at
        level[at:] += moved
        zone = np.arange(max(at - _MIXED, (first + at) // 2), min(at + _MIXED, (at + end) // 2))
        new = (late[zone] - base) / moved > 0.5
        level[zone] += moved * (new.astype(float) - (zone >= at).astype(float))
    return level


def _middles(off: Mask) -> Places:
    edges = np.flatnonzero(np.diff(np.concatenate([[False], off, [False]]).astype(int)))
    return np.asarray((edges[::2] + edges[1::2] - 1) // 2)


def _crowded(off: Mask) -> bool:
    """Whether a clock jumps so often that no messages between tell how far."""
    apart = np.diff(_middles(off))
    return apart.size >= _OFTEN and float(np.median(apart)) < _APART + _LEAST_OF_RUN


def _bounds(found: Places, at: int) -> tuple[int, int]:
    """The jumps before and after one; what is nearer may be messages that were held up."""
    return int(found[found <= at - _APART].max(initial=0)), int(
        found[found >= at + _APART].min(initial=found[-1])
    )


def _of_stamps(stamp: NDArray[np.int64], receive: NDArray[np.int64], least: float) -> Mask:
    """Where stamps are off by more than `least` [ns] while receipts go on."""
    counted, passed = _advance(stamp), _advance(receive)
    usual = float(np.median(passed))
    odd = np.abs(counted - usual) > np.abs(passed - usual)
    # a clock may jump in a gap as well; not where messages had to wait, which then come at once
    calm = np.append(passed[_SIDE:], np.full(min(_SIDE, passed.size), usual)) > _CALM * usual
    in_gap = calm & (passed > _LONG * usual) & (np.abs(counted - usual) > _GAP * usual)
    return np.asarray((np.abs(passed - counted) > least) & (odd | in_gap))


def _advance(times: NDArray[np.int64]) -> Array:
    """From the median of some messages to that of as many after them [ns]."""
    near = sliding_window_view((times - times[0]).astype(np.float64), _SIDE)
    middle = np.median(near, axis=1)
    return np.asarray(middle[_SIDE:] - middle[:-_SIDE])


# ---- stamps that are wrong -------------------------------------------------------------------


def _wrong(key: NDArray[np.int64], away: Array, right: Mask) -> Mask:
    """Messages whose stamps the rhythm has no place for; away: how late they are beyond others."""
    places = np.flatnonzero(right)
    sorted_ = places[np.argsort(key[places], kind="stable")]
    change = np.diff(key[sorted_]).astype(np.float64)
    period = _periods(change)
    fits = _fits(change, period)
    wrong = np.zeros(key.size, bool)
    joined = _fits(change[1:] + change[:-1], 0.5 * (period[1:] + period[:-1]))
    ends = [False]
    lost = np.concatenate([[True], ~fits]) & np.concatenate([~fits, [True]])
    late = np.abs(away[sorted_]) > _REPEATED * np.concatenate([period[:1], period])
    between = lost & (late | np.concatenate([ends, joined, ends]))
    between[1:] &= ~between[:-1]  # of two beside one another the later waits for the next round
    wrong[sorted_[between]] = True
    same = np.flatnonzero(np.abs(change) < _NEAR * period)
    one, other = sorted_[same], sorted_[same + 1]
    later = np.where(np.abs(away[one]) > np.abs(away[other]), one, other)
    usual = away[one + other - later]
    old = np.abs(away[later] - usual) > _REPEATED * period[same]
    after = np.append(change, 0.0)[same + 1] < 1.5 * period[same]  # its own place is not empty
    wrong[later[(change[same] > 0.0) | (old & after)]] = True
    return wrong


def _displaced(
    key: NDArray[np.int64], away: Array, right: Mask, behind: NDArray[np.int64]
) -> Mask:  # fmt: skip
    """Messages far behind others, where for most of these nobody else was measured when they must
    have been by their receipts: they were then, and their stamps are wrong."""
    none = np.zeros(key.size, bool)
    period = float(np.median(_periods(np.diff(np.sort(key[right])).astype(np.float64))))
    far = np.flatnonzero(right & (behind > _REPEATED * period))
    if not far.size:
        return none
    taken, own = np.sort(key[right]), key[far] + away[far]
    after = np.clip(np.searchsorted(taken, own), 1, taken.size - 1)
    nearest = np.minimum(np.abs(taken[after] - own), np.abs(own - taken[after - 1]))
    alone = nearest > _ALONE * period
    if float(np.mean(alone)) >= _MOST_ALONE:
        none[far[alone]] = True
    return none


def _periods(change: Array) -> Array:
    """The usual interval about each [ns], as most messages near by have it; 1 of equal stamps."""
    side = _NEXT // 2
    change = np.where(change > 0.0, change, np.median(change))
    padded = np.concatenate([change[side:0:-1], change, change[-2 : -side - 2 : -1]])
    return np.asarray(np.maximum(np.median(sliding_window_view(padded, _NEXT), axis=1), 1.0))


def _fits(change: Array, period: Array) -> Mask:
    """Intervals that are a whole number of usual ones."""
    counts = np.maximum(np.round(change / period), 1.0)
    return np.asarray(np.abs(change - counts * period) <= _NEAR * period)


def _kept(key: NDArray[np.int64]) -> float | None:
    """The usual interval [ns] where stamps in order keep a rhythm, not counting those that come
    twice."""
    change = np.diff(np.sort(key)).astype(np.float64)
    change = change[change > 0.0]
    if change.size < LEAST_MESSAGES // 2:
        return None
    period = _periods(change)
    near = change < 2.5 * period
    if not near.any() or float(np.mean(~_fits(change, period)[near])) > _MOST_ODD:
        return None
    return float(np.median(change))
