"""The interval of messages whose waits are within a tick that it leaves the fewest missing.

With an interval T and waits up to w, message i cannot be number k before when_i - b >= (k - i) T,
b the longest wait: the least numbers are running maxima.  A T too long leaves waits that are too
short, one too short losses that nothing asks for.  T is tried finely over some hundred messages,
then more finely over ever more of them about what was best.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from syncline_design.auditing.series import Array
from syncline_design.machine.deadline import in_force

_FIRST: Final = 400  # messages
_FINE: Final = 0.01  # of the longest wait, over all messages: how finely intervals are tried
_SHORTEST: Final = 0.85  # of the usual interval
_APART: Final = 0.4  # of an interval or wait, over the messages: intervals kept for the next round
_ABOUT: Final = 0.5
_KEPT: Final = 6
_NEXT: Final = 3
_AT_ONCE: Final = 16
_PHASES: Final = (0.0, 0.1, 0.2, 0.35, 0.5, 0.65, 0.8)  # of the shorter of both
_LEAST_CYCLE: Final = 16  # messages
_CYCLE: Final = 8.0  # longest waits, in which one is nearly shortest
_TOO_DEEP: Final = 2500.0  # losses that one more longest wait is worth
_MOST_DEEP: Final = 1.2  # longest waits: more is no such rhythm


def fewest_losses(when: Array, longest_s: float) -> tuple[float, Array] | None:
    """(interval [s], messages missing between neighbours); None where no interval does.

    longest_s: how much later than measured a message of `when` is stamped at most.
    """
    count = min(_FIRST, when.size)
    starts = np.arange(0, when.size - count + 1, max(1, count // 4))
    first = int(starts[np.argmin(when[starts + count - 1] - when[starts])])
    part = when[first : first + count]
    longest = float(part[-1] - part[0] + longest_s) / (count - 1)
    shortest = _SHORTEST * float(part[-1] - part[0]) / (count - 1)
    tried = np.arange(shortest, longest, _FINE * longest_s / count)
    costs = _costs(part, tried, longest_s)
    least = min(longest, longest_s)
    kept: list[float] = []
    for k in np.lexsort((-tried, costs)):
        if all(abs(tried[k] - other) > _APART * least / count for other in kept):
            kept.append(float(tried[k]))
        if len(kept) >= _KEPT:
            break
    while count < when.size:
        before, count = count, min(2 * count, when.size)
        first = min(max(0, first - before // 2), when.size - count)
        kept = _refined(when[first : first + count], kept, before, longest_s, least)
    costs = _costs(when, np.asarray(kept), longest_s)
    period = kept[int(np.argmin(costs))]
    number, deep = _numbers(when, np.asarray([period]), longest_s)
    if float(deep[0]) > _MOST_DEEP * longest_s:
        return None
    return period, np.diff(number[0])


def _refined(
    part: Array, kept: list[float], before: int, longest_s: float, least: float
) -> list[float]:  # fmt: skip
    """The best intervals about those kept from fewer messages."""
    about = np.arange(
        -_ABOUT * least / before, _ABOUT * least / before, _FINE * longest_s / part.size
    )
    found = []
    for period in kept:
        costs = _costs(part, period + about, longest_s)
        best = int(np.argmin(costs))
        found.append((float(costs[best]), period + float(about[best])))
    found.sort()
    return [period for _, period in found[:_NEXT]]


def _costs(when: Array, periods: Array, longest_s: float) -> Array:
    """Losses, and what waits reach beyond the longest, of every interval tried."""
    out: Array = np.zeros(periods.size)
    for begin in range(0, periods.size, _AT_ONCE):
        in_force().check()
        some = slice(begin, begin + _AT_ONCE)
        number, deep = _numbers(when, periods[some], longest_s)
        out[some] = _cost(number, deep, longest_s)
    return out


def _numbers(when: Array, periods: Array, longest_s: float) -> tuple[Array, Array]:
    """(messages missing before each, how far waits reach [s]) of every interval, the best of some
    phases of the first messages."""
    period = periods[:, None]
    bare = when - when[0] - period * np.arange(when.size)
    cycle = max(_LEAST_CYCLE, round(_CYCLE * longest_s / float(periods.mean())))
    floor = bare[:, :cycle].min(axis=1, keepdims=True)
    cost: Array = np.full(periods.size, np.inf)
    best, deepest = np.zeros((periods.size, when.size)), np.zeros(periods.size)
    for phase in _PHASES:
        top = floor - phase * np.minimum(period, longest_s) + longest_s
        number = np.maximum(np.maximum.accumulate(np.ceil((bare - top) / period), axis=1), 0.0)
        deep = (top - bare + period * number).max(axis=1)
        better = (now := _cost(number, deep, longest_s)) < cost
        cost[better], best[better], deepest[better] = now[better], number[better], deep[better]
    return best, deepest


def _cost(number: Array, deep: Array, longest_s: float) -> Array:
    return np.asarray(number[:, -1] + _TOO_DEEP * np.maximum(deep / longest_s - 1.0, 0.0))
