"""How late messages of an even rhythm came, whatever their delays: above a floor, never below.

Of messages measured at a + k T that wait d_k, s_k - k T = a + d_k never falls below a, so the least
of every dozen in a row lies on one line (passive synchronisation: Olson 2010), however far they
scatter above it.  What a sensor without rhythm measures walks away from any line, and a sensor that
scatters about its rhythm does so to both sides.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from syncline_design.auditing.series import Array, scatter, spread
from syncline_design.machine.quick_dataclass import dataclass

_BLOCK: Final = 12  # messages, of which the fastest hardly waits
_LONGER: Final = (24, 48, 96, 192)
_TOGETHER: Final = 0.1  # of the mean interval
_BUNCHED: Final = 0.25  # of all messages
_READ_S: Final = 4e-4  # that a host takes to read a message at most
_UNLIKE: Final = 0.3  # of what bunches are apart: publishers in turn are alike
_LEAST_BLOCKS: Final = 12
_LAG: Final = 64
_WALKS: Final = 0.45  # of a block's spread: how far floors differ; of a random walk 1.2
_ONE_SIDED: Final = 0.55  # floors against ceilings; of a scatter to both sides 1
_CHANCE: Final = 5.7  # over sqrt(n), in logarithms: 3.5 sigma of two scatters of n edges each
_SHARP: Final = 0.3  # floors that are the edge of something, such as of a wait for the next turn
_WALKED: Final = 0.5  # of how far messages reach above their floor
_MOST_WALKED: Final = 0.02  # of all dozens
_LAGS: Final = tuple(range(1, 13))
_PATTERN: Final = 0.4  # of the scatter of intervals: what repeats itself is no chance


@dataclass(frozen=True, slots=True, eq=False)
class Waits:
    """Delays [s] of messages, each against the middle of its dozen.

    reach_s: the longest but few, above the floor.  late: they reach further above it than they come
    near to it.  edged: whether the floor is sharp, which a scatter to both sides has not, and
    stays where it is, which that of a sensor at another rate does not.
    """

    about_s: Array
    reach_s: float
    late: bool
    edged: bool


def waits_of(when: Array) -> Waits | None:
    """None where stamps [s] keep to no line, or repeat a pattern."""
    waits = _over(when, _BLOCK, _LAG)
    return None if waits is None or _repeats(np.diff(when)) else waits


def long_waits_of(when: Array) -> Waits | None:
    """Of delays of several intervals, which no dozen of messages is without: of more messages the
    fastest hardly waited.  What walks does so over any number of them.

    Where messages come at once, after those that they waited for, and no sensor measures so, they
    were late however their delays are distributed.
    """
    at_once = come_at_once(when)
    for block in _LONGER:
        waits = _over(when, block, 4 * block)
        if waits is not None and (at_once or not _repeats(np.diff(when))):
            return replace(waits, late=waits.late or at_once, edged=False)
    return None


def come_at_once(when: Array) -> bool:
    """Whether many messages follow others faster than any sensor measures, after unlike times."""
    if when.size < _LEAST_BLOCKS * _BLOCK:
        return False
    passed = np.diff(when)
    together = passed < _TOGETHER * float(np.mean(passed))
    if float(np.mean(together)) < _BUNCHED or float(np.median(passed[together])) > _READ_S:
        return False
    apart = np.diff(when[1:][~together])
    return spread(apart) > _UNLIKE * float(np.median(apart))


def _over(when: Array, block: int, lag: int) -> Waits | None:
    """By the least of every `block` messages; the interval by messages so many apart."""
    if when.size < max(_LEAST_BLOCKS * block, 2 * lag):
        return None
    period = float(np.median(when[lag:] - when[:-lag])) / lag
    if period <= 0.0:
        return None
    away = when - period * np.arange(when.size)
    blocks = away[: away.size // block * block].reshape(-1, block)
    low, middle, high = (np.percentile(blocks, p, axis=1) for p in (0.0, 50.0, 100.0))
    width = float(np.median(np.subtract(*np.percentile(blocks, [75.0, 25.0], axis=1))))
    floors, ceilings = (scatter(np.diff(edge)) / float(np.sqrt(2.0)) for edge in (low, high))
    if width <= 0.0 or floors > _WALKS * width:
        return None
    about = (blocks - middle[:, None]).ravel()
    reach = float(np.percentile(blocks - low[:, None], 99.5))
    edged = floors < _SHARP * width and not _other_rates(low, high - low)
    below = _ONE_SIDED
    if reach < period:  # as a sensor may scatter that is triggered: of few edges by chance
        below = min(below, float(np.exp(-_CHANCE / np.sqrt(low.size))))
    return Waits(about, reach, floors < below * ceilings, edged)


def _other_rates(low: Array, reach: Array) -> bool:
    """Whether floors walk away by as much as messages scatter above them: in more dozens than
    losses explain the sensor measured more or less often, and nothing waited."""
    walked = np.abs(np.diff(low)) > _WALKED * np.minimum(reach[:-1], reach[1:])
    return float(np.mean(walked)) > _MOST_WALKED


def _repeats(passed: Array) -> bool:
    """Whether intervals come back after some messages: publishers in turn, brackets, decimation."""
    scattered = [spread(passed[lag:] - passed[:-lag]) for lag in _LAGS]
    return min(scattered) < _PATTERN * float(np.median(scattered))
