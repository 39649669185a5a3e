"""The rhythm of a regular sensor behind stamps that are late by up to a tick: packets, grids.

A message measured at a + k T is stamped at a + k T + w_i, w_i within a tick and often more than T
itself, so that no single interval tells a lost message.  Where one rhythm explains all stamps but
for long holes, nothing else is missing.  Else messages are counted by the least of w_i over some of
them, which is nearly the same everywhere: a missing message lifts it by T for all that come after.
Where T is shorter than about a tick, waits creep, and floors with them: then that T is taken by
which the fewest are missing so that no wait is longer than a tick.
"""

from __future__ import annotations

import math
from collections.abc import Set
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from syncline_design.auditing.fewest_losses import fewest_losses
from syncline_design.auditing.result import FaultName
from syncline_design.auditing.series import Array, Series, seconds, spread
from syncline_design.machine.quick_dataclass import dataclass

_TICKS: Final = 8.0  # of waits that differ, in what tells a floor
_LEAST: Final = 8  # messages that tell one
_MOST: Final = 512
_FLOORS: Final = 8  # that tell a rhythm
_CLEAN: Final = 20.0  # % of floors: so many lie beside one that no message is missing before
_ROUNDS: Final = 4
_OFF: Final = 0.3  # of an interval: how near to whole ones floors are
_MOST_OFF: Final = 0.25  # of the floors; without a rhythm 0.4
_SLACK: Final = 0.1  # of the shorter of tick and interval, about what waits fill
_FILLED: Final = 98.0  # % of waits
_LEAST_PLACES: Final = 6
_EVENLY: Final = 0.25  # scatter of their distance
_FULL: Final = 1.03  # of a tick
_APART: Final = 1.5  # ticks: messages further apart are counted by floors
_FAR_APART: Final = 3.0  # ticks: rounding counts what is missing
_WITHIN: Final = 64  # messages that pass until a loss shows
_HOLE_TICKS: Final = 3.0
_HOLE: Final = 5.0  # intervals
_MOST_HOLES: Final = 20
_BESIDE: Final = 400  # messages on each side of a hole that tell what is missing in it
_SEARCH: Final = 60
_FINER: Final = 0.1  # of a grain: by how much receipts may be late to tell more than stamps
_LEAST_WAIT: Final = 0.2  # of an interval
WHOLE_TICK: Final = 2.5  # ticks: stamps further from a rhythm keep none that a grid hides
_EVENER: Final = 0.7  # of the scatter of receipts about their stamps


@dataclass(frozen=True, slots=True, eq=False)
class Counted:
    """Messages numbered as if none were missing; lost: missing between neighbours.

    tick_s: by how much their stamps may be late.
    """

    number: Array
    lost: Array
    period_s: float
    tick_s: float

    def waits(self, when: Array) -> Array:
        """How late stamps are after an even rhythm [s], but for a constant."""
        return np.asarray(when - self.period_s * self.number)


def counted_behind(series: Series, names: Set[FaultName], tick_s: float) -> Counted | None:
    """Messages of coarse stamps counted; by receipts, where these show the rhythm more finely."""
    places = series.places()
    when = seconds(series.stamp[places] - series.stamp[places[0]])
    if "truncated_stamps" in names and series.receive is not None:
        came = series.receive[places]
        by_receipts = _by_floors(seconds(came - came[0]), _FINER * tick_s)
        if by_receipts is not None and float(np.ptp(by_receipts.waits(when))) < WHOLE_TICK * tick_s:
            return replace(by_receipts, tick_s=tick_s)
    return counted(when, tick_s)


def timed_by_receipts(count: Counted, series: Series) -> Counted:
    """Messages of packets with the interval of their receipts, where these come more evenly than
    they follow the stamps; within a tick stamps leave many intervals open."""
    assert series.receive is not None
    places = series.places()
    when = seconds(series.stamp[places] - series.stamp[places[0]])
    came = seconds(series.receive[places] - series.receive[places[0]])
    timed = replace(count, period_s=best_period(came, count.number))
    if not evener(timed.waits(came), came - when):
        return count
    placed = _placed_by(timed, came, when)
    low, high = periods_within(when, placed.number, _FULL * count.tick_s)
    return placed if low <= placed.period_s <= high else count


def _placed_by(count: Counted, came: Array, when: Array) -> Counted:
    """Losses put where receipts, which come evenly, have them: stamps tell no place in a tick."""
    behind = count.waits(came)  # of delays, or a whole interval more
    first = float(behind.min()) - _SLACK * count.period_s
    number = count.number + np.floor((behind - first) / count.period_s)
    placed = Counted(number, np.diff(number) - 1.0, best_period(came, number), count.tick_s)
    nearer = float(np.ptp(placed.waits(came))) < float(np.ptp(behind))
    full = float(np.ptp(placed.waits(when))) <= _FULL * count.tick_s
    return placed if nearer and full and not np.any(placed.lost < 0.0) else count


def evener(behind: Array, late: Array) -> bool:
    """Whether receipts keep a rhythm more closely than they follow their stamps; behind: the
    rhythm, and the stamps [s]."""
    return spread(behind) < _EVENER * spread(late)


def counted(when: Array, tick_s: float) -> Counted | None:
    """Messages of times `when` [s], late by up to `tick_s`, numbered; None without a rhythm."""
    if when.size < _LEAST * _FLOORS or when[-1] <= when[0]:
        return None
    if np.any(np.diff(when) < -_FULL * tick_s):
        return None  # messages in another order
    whole = _but_for_holes(when, tick_s)
    if whole is not None:
        return whole
    if _mean(when) > _FAR_APART * tick_s:
        return _by_rounding(when, tick_s)
    if _mean(when) > _APART * tick_s:
        by_floors = _by_floors(when, tick_s)
        full = by_floors is None or float(np.ptp(by_floors.waits(when))) <= _FULL * tick_s
        return by_floors if full else _by_fewest(when, tick_s) or by_floors
    return _by_fewest(when, tick_s)


def _by_rounding(when: Array, tick_s: float) -> Counted | None:
    """Messages so far apart that each interval tells how many are missing in it; None of waits
    longer than a tick."""
    apart = when[_LEAST:] - when[:-_LEAST]
    period = float(np.percentile(apart, _CLEAN)) / _LEAST
    interval = np.diff(when)
    for _ in range(_ROUNDS):
        lost = np.maximum(np.round(interval / period), 1.0) - 1.0
        found = _with(lost, period, tick_s)
        period = best_period(when, found.number)
    found = replace(found, period_s=period)
    return found if float(np.ptp(found.waits(when))) <= _FULL * tick_s else None


def _by_fewest(when: Array, tick_s: float) -> Counted | None:
    """Messages counted so that the fewest are missing."""
    found = fewest_losses(when, _FULL * tick_s)
    if found is None:
        return None
    period, lost = found
    lost = _in_holes(lost, np.diff(when), _WITHIN, tick_s, period)
    found_so = _with(lost, period, tick_s)
    return replace(found_so, period_s=best_period(when, found_so.number))


def evenly(places: NDArray[np.intp]) -> bool:
    """Whether places come at even distances, as a beat makes them."""
    if places.size < _LEAST_PLACES:
        return False
    apart = np.diff(places)
    return bool(spread(apart) <= max(1.0, _EVENLY * float(np.median(apart))))


def _mean(when: Array) -> float:
    """The usual interval [s], of messages between which few are missing."""
    size = min(_MOST, when.size // _FLOORS)
    return float(np.percentile(when[size:] - when[:-size], _CLEAN)) / size


def _with(lost: Array, period: float, tick_s: float) -> Counted:
    number = np.arange(lost.size + 1) + np.concatenate([[0.0], np.cumsum(lost)])
    return Counted(number, lost, period, tick_s)


def _but_for_holes(when: Array, tick_s: float) -> Counted | None:
    """All messages but those of a few long holes, where one even rhythm explains them.

    A beat between interval and tick leaves out ticks as lost messages do: nothing is missing where
    nothing has to be.
    """
    interval = np.diff(when)
    usual = _mean(when)
    holes = np.flatnonzero(interval > max(_HOLE_TICKS * tick_s, _HOLE * usual))
    if holes.size > _MOST_HOLES:
        return None
    lost = np.zeros(interval.size)
    longest = max(np.split(when, holes + 1), key=lambda piece: piece.size)
    period = best_period(longest, np.arange(longest.size, dtype=np.float64))
    for hole in holes:
        left, right = when[max(0, hole + 1 - _BESIDE) : hole + 1], when[hole + 1 :][:_BESIDE]
        number = np.concatenate([np.arange(left.size), left.size + np.arange(right.size)])
        both = np.concatenate([left, right])
        about = round(float(interval[hole]) / period) - 1
        reach = math.ceil(tick_s / period) + 1
        ways = [n for n in range(about - reach, about + reach + 1) if n > 0]
        after = number >= left.size
        lost[hole] = min(ways, key=lambda n: _reach(both, number + n * after, period))
    found = _with(lost, period, tick_s)
    found = replace(found, period_s=best_period(when, found.number))
    return found if float(np.ptp(found.waits(when))) <= _FULL * tick_s else None


def _reach(when: Array, number: Array, period: float) -> float:
    return float(np.ptp(when - period * number))


def best_period(when: Array, number: Array) -> float:
    """The interval [s] with which waits of numbered messages reach least far: a convex search."""
    steps = float(number[-1] - number[0])
    first = float(when[-1] - when[0]) / steps
    low, high = first - _reach(when, number, first) / steps, first
    high += _reach(when, number, first) / steps
    for _ in range(_SEARCH):
        one, other = low + (high - low) / 3.0, high - (high - low) / 3.0
        if _reach(when, number, one) <= _reach(when, number, other):
            high = other
        else:
            low = one
    return 0.5 * (low + high)


def periods_within(when: Array, number: Array, longest_s: float) -> tuple[float, float]:
    """The shortest and the longest interval [s] with which waits are no further apart than that.

    Where few places of a tick are met the stamps are the same for all of them.  The reach of waits
    is convex in the interval: both ends are found by halving.
    """
    best = best_period(when, number)
    level = max(longest_s, _reach(when, number, best))
    steps = float(number[-1] - number[0])
    ends = []
    for side in (-1.0, 1.0):
        inside, outside = best, best + 2.0 * side * level / steps
        for _ in range(_SEARCH):
            middle = 0.5 * (inside + outside)
            if _reach(when, number, middle) <= level:
                inside = middle
            else:
                outside = middle
        ends.append(inside)
    return ends[0], ends[1]


def _by_floors(when: Array, tick_s: float) -> Counted | None:
    """Messages counted by the least waits of some at a time."""
    if when.size < _LEAST * _FLOORS or when[-1] <= when[0]:
        return None
    mean = float(when[-1] - when[0]) / (when.size - 1)
    size = int(min(max(_LEAST, round(_TICKS * tick_s / mean)), _MOST))
    if when.size < _FLOORS * size:
        return None
    period = _first_guess(when, size)
    index = np.arange(when.size, dtype=np.float64)
    lost: Array = np.zeros(0)
    for _ in range(_ROUNDS):
        floor, place = _floors(when - period * index, size)
        steps = np.maximum(np.round(np.diff(floor) / period), 0.0)
        lost = np.concatenate([[0.0], np.cumsum(steps)])
        period = float(np.polynomial.polynomial.polyfit(place + lost, when[place], 1)[1])
        if not 0.5 * mean < period < 2.0 * mean:
            return None
    floor, _ = _floors(when - period * index, size)
    rise = np.diff(floor)
    whole = np.maximum(np.round(rise / period), 0.0) * period
    if float(np.mean(np.abs(rise - whole) > _OFF * period)) > _MOST_OFF:
        return None
    return _numbered(when - period * index, floor, lost, period, tick_s)


def _first_guess(when: Array, size: int) -> float:
    """The interval between messages [s] where none is missing."""
    index = np.arange(when.size, dtype=np.float64)
    period = float(np.percentile(when[size:] - when[:-size], _CLEAN)) / size
    for _ in range(_ROUNDS - 1):
        floor, _ = _floors(when - period * index, size)
        period += float(np.percentile(np.diff(floor), _CLEAN)) / size
    return period


def _floors(deviation: Array, size: int) -> tuple[Array, NDArray[np.intp]]:
    """The least of every `size` messages, and which it is."""
    pieces = deviation[: deviation.size // size * size].reshape(-1, size)
    within = np.argmin(pieces, axis=1)
    rows = np.arange(pieces.shape[0])
    return pieces[rows, within], rows * size + within


def _numbered(deviation: Array, floor: Array, lost: Array, period: float, tick_s: float) -> Counted:
    """Every message counted: losses lie where waits would be longer than they ever are."""
    size = deviation.size // floor.size
    block = np.minimum(np.arange(deviation.size) // size, lost.size - 1)
    before, after = np.append(0.0, lost)[block], np.append(lost, lost[-1])[block + 1]
    waits = deviation - float(np.median(floor - lost * period))
    calm = before == after
    usual = (waits - lost[block] * period)[calm]
    shortest = min(tick_s, period)
    filled = float(np.percentile(usual, _FILLED)) if usual.size else tick_s
    filled = min(max(filled, _LEAST_WAIT * shortest), tick_s)
    longest = max(filled + _SLACK * shortest, 0.5 * (filled + period))
    missing = np.clip(np.ceil((waits - longest) / period), before, after)
    lost = np.diff(np.maximum.accumulate(missing))
    lost = _in_holes(lost, np.diff(deviation) + period, size, tick_s, period)
    return _with(lost, period, tick_s)


def _in_holes(lost: Array, interval: Array, size: int, tick_s: float, period: float) -> Array:
    """Losses longer than a tick [intervals] put where nothing came, some messages before they
    show; what shows beside is of the same hole, where no wait is longer then."""
    if tick_s <= period:
        return lost
    placed = lost.copy()
    for k in np.flatnonzero(lost * period > tick_s):
        near = slice(max(0, int(k) - size), int(k) + size)
        there = np.zeros(placed[near].size)
        there[int(np.argmax(interval[near]))] = placed[near].sum()
        before, after = (_reach_of(interval[near] - period * (1.0 + n))
                         for n in (placed[near], there))  # fmt: skip
        if after <= max(before, _FULL * tick_s):
            placed[near] = there
    return placed


def _reach_of(steps: Array) -> float:
    """By how much waits differ [s] that change so from message to message."""
    return float(np.ptp(np.concatenate([[0.0], np.cumsum(steps)])))
