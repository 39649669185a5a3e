"""Stamps taken at the ticks of a serial chip's timer, of streams of about a message a tick or less.

Such a chip hands over what it has every so many milliseconds (FTDI's latency timer: 16 ms unless
set to 1 to 255, AN232B-04), and the host reads its clock some 10 us later, never earlier.  A
sensor's message measured at a + k T is stamped at the next tick, number ceil((a + k T) / tick): of
all whole numbers those that stay nearest to a line, which lost messages do not (balanced or
Sturmian sequences: Morse and Hedlund 1940).  Ticks show unless T is a whole number of them.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from syncline_design.auditing.coarse_rhythm import evenly
from syncline_design.auditing.frames import late_by, on_comb
from syncline_design.auditing.series import Array, Mask, Series, seconds, spread

TICKS_S: Final = (0.016, 0.01, 0.008, 0.005, 0.004)
_LONGEST: Final = 1.5  # of a usual interval: what holds more messages comes in bunches
_WINDOW: Final = 64  # messages over which ticks are counted
_BALANCED: Final = 0.33  # ticks; rounding alone leaves 0.29, a tenth of messages lost at random 0.6
_RARE: Final = 0.1  # how near to a whole number of ticks an interval is so that turns are rare
_NEAR_LINE: Final = 0.9  # of all windows without rare turns
_NOISY: Final = 0.05  # of a tick: interrupts that come later than that hide it
_TIGHT: Final = 0.2  # of a tick: scatter of receipts about stamps
_PHASE: Final = 0.003  # of a tick: how near to ticks stamps that come in turn are on average
_SIGMA: Final = 4.0  # of the uncertainty of a median
_TURNS: Final = (2, 3, 4)
_STRETCH, _LEAST = 24, 4  # messages, and stretches of them
_AS_USUAL: Final = 0.6  # of an interval: one that is usual
ONE_RATE: Final = 0.1  # of a tick; a tick more or less leaves 0.08


def tick_of(series: Series, places: NDArray[np.intp]) -> float | None:
    """The timer's tick [s] that stamps show, the longest; None of others, where the interval is a
    whole number of ticks, and where receipts do not follow the stamps closely."""
    if series.receive is None or places.size < 2 * _WINDOW:
        return None
    when = seconds(series.stamp[places] - series.stamp[places[0]])
    late = seconds((series.receive - series.stamp)[places])
    follow_s = min(spread(late), spread(np.diff(late)))
    passed = np.diff(when)
    for tick in TICKS_S:
        if tick > _LONGEST * float(np.median(passed)) or follow_s > _TIGHT * tick:
            continue
        noise = late_by(when, tick) if on_comb(passed, tick) else None
        if noise is None or noise > _NOISY * tick:
            continue
        counts = np.round(passed / tick)
        if _by_a_line(counts) and _on_average(when, counts, tick, noise):
            return tick
    return None


def _by_a_line(counts: Array) -> bool:
    """Whether ticks are numbered as an even rhythm that waits for them numbers them."""
    near, slope = near_a_line(counts)
    if float(np.mean(near)) < 0.5:
        return False
    interval = float(np.median(slope))
    if abs(interval - round(interval)) > _RARE:
        return True
    rare = np.flatnonzero(counts != round(interval))
    return float(np.mean(near)) > _NEAR_LINE and evenly(rare)


def near_a_line(counts: Array, window: int = _WINDOW) -> tuple[Mask, Array]:
    """Which stretches of so many messages number their ticks as an even rhythm does, to within
    rounding, and ticks a message in each; counts: ticks between neighbours."""
    number = np.concatenate([[0.0], np.cumsum(counts)])
    windows = number[: number.size // window * window].reshape(-1, window)
    k = np.arange(window) - 0.5 * (window - 1)
    slope = windows @ k / float(k @ k)
    left = windows - windows.mean(axis=1, keepdims=True) - np.outer(slope, k)
    return np.std(left, axis=1) < _BALANCED, slope


def rates_apart(passed: Array, tick: float) -> float:
    """By how many ticks the mean interval of stretches without losses differs; nan without such.

    A sensor that pings as fast as the depth lets it has many; passed: between neighbours [s].
    """
    usual = float(np.median(passed))
    rows = passed[: passed.size // _STRETCH * _STRETCH].reshape(-1, _STRETCH)
    rows = rows[np.all(np.abs(rows - usual) < _AS_USUAL * usual, axis=1)]
    if rows.shape[0] < _LEAST:
        return float("nan")
    return float(np.subtract(*np.percentile(rows.mean(axis=1) / tick, [95.0, 5.0])))


def _on_average(when: Array, counts: Array, tick: float, noise: float) -> bool:
    """Whether stamps of every turn lie on the ticks, and not near them as those of publishers in
    turn may by chance."""
    away = when - tick * np.concatenate([[0.0], np.cumsum(counts)])
    for turns in _TURNS:
        rows = away[: away.size // turns * turns].reshape(-1, turns)
        usual = np.median(rows - rows.mean(axis=1, keepdims=True), axis=0)
        known = _SIGMA * noise / float(np.sqrt(rows.shape[0]))
        if float(np.ptp(usual)) > _PHASE * tick + known:
            return False
    return True
