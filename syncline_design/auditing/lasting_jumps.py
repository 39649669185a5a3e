"""What becomes of a jump: the level stays, settles, or goes back though stamps went on evenly.

The rhythm of the stamps shows a jump but for whole intervals of the sensor, which only the level of
receipt minus stamp counts; and a load of the host lifts levels as well.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from syncline_design.auditing.cadence import Cadence
from syncline_design.auditing.pauses import LONG_GAP
from syncline_design.auditing.series import Array
from syncline_design.machine.quick_dataclass import dataclass

_BESIDE: Final = 12  # messages on each side that tell a level
_LEAST: Final = 3
_BROKEN: Final = 0.05  # of an interval: what does not fit the rhythm
_BACK: Final = 0.3  # of a jump: what returns by more settles, and is no step


@dataclass(frozen=True, slots=True)
class Jump:
    """Stamps gain `size_s` with the message at `place` (among the good ones), until `end`.

    again: one of many by one size, of a clock that is set again and again.  doubted: by whole
    intervals, and only messages near it show it.
    """

    place: int
    size_s: float
    end: int | None = None
    again: bool = False
    doubted: bool = False


def of_the_clock(found: list[Jump], times: Array, late: Array, pace: Cadence) -> list[Jump]:
    """Those but for jumps by more than half an interval that levels take back while the stamps go
    on evenly: the host was busy, and one interval was a little longer meanwhile."""
    if not found:
        return []
    level, ends = _levelled(found, times, late)
    return [
        j
        for j, end in zip(found, ends, strict=True)
        if j.again
        or abs(j.size_s) < 0.5 * pace.period_s
        or not (_kept_pace(j, end, pace) and abs(_back(j, level[j.place : end]) - 1.0) < _BACK)
    ]


def _levelled(found: list[Jump], times: Array, late: Array) -> tuple[Array, list[int]]:
    """Receipt minus stamp without jumps and the drift of the whole log, and where each jump's part
    of it ends."""
    level = late.copy()
    for jump in found:
        level[jump.place :] += jump.size_s
    level = level - _slope(times, level) * (times - times[0])
    return level, [*(jump.place for jump in found[1:]), late.size]


def lasting(found: list[Jump], times: Array, late: Array, pace: Cadence) -> list[Jump]:
    """Those after which the level stays, but for a drift of the whole log: the others settle."""
    level, ends = _levelled(found, times, late)
    both = zip(found, ends, strict=True)
    return [
        j
        for j, end in both
        if j.again or _kept_pace(j, end, pace) or not _settles(j, level[j.place : end])
    ]


def _kept_pace(jump: Jump, end: int, pace: Cadence) -> bool:
    """Whether the stamps after it went on as evenly as before, to less than what settling takes
    back: a clock that is slewed home stretches the sensor's intervals by as much."""
    apart = abs(jump.size_s - round(jump.size_s / pace.period_s) * pace.period_s)
    if apart < _BROKEN * pace.period_s:
        return False  # by whole intervals, which nobody counts
    own = slice(jump.place, end - 1)
    off = np.cumsum(pace.interval[own] - pace.steps[own] * pace.period_s)
    return off.size >= _BESIDE and float(np.ptp(off)) < _BACK * abs(jump.size_s)


def went_on(jump: Jump, settling: list[Jump], pace: Cadence) -> bool:
    """Whether a jump is how a lock went on to settle while no message came."""
    before = [s for s in settling if s.place < jump.place]
    hole = float(pace.steps[jump.place - 1]) > LONG_GAP
    return hole and bool(before) and -1.0 < jump.size_s / before[-1].size_s < 0.0


def _settles(jump: Jump, level: Array) -> bool:
    return _back(jump, level) > _BACK


def _back(jump: Jump, level: Array) -> float:
    """The share of a jump that the level takes back before the next one."""
    part = max(_LEAST, min(_BESIDE, level.size // 3))
    if level.size < 2 * part:
        return 0.0
    last = level[-max(part, level.size // 4) :]
    return float(np.median(last) - np.median(level[:part])) / jump.size_s


def _slope(times: Array, level: Array) -> float:
    lag = max(1, level.size // 10)
    passed = times[lag:] - times[:-lag]
    use = passed > 0.0
    return float(np.median((level[lag:] - level[:-lag])[use] / passed[use])) if use.any() else 0.0
