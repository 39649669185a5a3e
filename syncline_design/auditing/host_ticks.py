"""Receipts that keep to ticks of the host: what they make of a sensor's beat, and of its steps."""

from __future__ import annotations

from typing import Final

import numpy as np

from syncline_design.auditing.grains import timers
from syncline_design.auditing.series import Array, Series, seconds

_TAIL: Final = 0.15  # skewness of quantiles; of gamma delays about 0.4, of a wait for a tick 0
_OTHER_TICKS: Final = 3  # receipts that show a tick
_MOST_OF_TICK: Final = 0.5  # that waits fill, where whole ticks are to be told from others
_MET: Final = 0.8  # of those that missed a tick; by chance at most half
_COHERENT: Final = 0.75  # of intervals that are whole ticks; 1 without scatter
_SIDE: Final = 256  # messages on each side of a jump
_LEAST: Final = 12
_SAME: Final = 0.1  # of a tick: waits for one that are alike
_CHANCE: Final = 2.0  # of Kolmogorov and Smirnov: 7e-4


def ticks_of(series: Series, late: Array) -> float:
    """The host's tick [s] where receipts keep to one, and delays are not those of transport; or 0.

    A sensor whose interval is nearly a multiple of the host's tick waits a little less each time:
    a beat, which looks like drift, of a tick at most.  An even sensor is on many grids itself; what
    shows a tick is a receipt that comes whole ticks sooner or later than the sensor's interval.
    Transport's delays have a tail, waits for a tick have none.
    """
    assert series.receive is not None
    receive = np.sort(series.receive[series.good])
    when = seconds(receive - receive[0])
    kept = (t for t in timers(when) if not _has_tail(_within_tick(late, t)) and _shows(when, t))
    return next(kept, 0.0)


def _shows(when: Array, tick_s: float) -> bool:
    """Whether some receipts come whole ticks sooner or later than usual."""
    counts = np.round(np.diff(when) / tick_s)
    values, often = np.unique(counts, return_counts=True)
    usual = values[int(np.argmax(often))]
    whole = counts % usual == 0.0 if usual > 0.0 else np.zeros(counts.size, bool)
    return int(np.sum(~whole | (counts == 0.0))) >= _OTHER_TICKS


def _within_tick(late: Array, tick_s: float) -> Array:
    """Delays without whole ticks, where those that are longer are so by whole ticks: messages that
    missed one, and no tail of transport."""
    middle = np.sort(late)[late.size // 2]  # one of them: halfway between two, none may be near it
    turns = np.round((late - middle) / tick_s)
    folded = late - turns * tick_s
    usual = np.percentile(folded[turns == 0.0], [1.0, 99.0])
    missed = folded[turns != 0.0]
    if missed.size < _OTHER_TICKS or float(np.ptp(usual)) > _MOST_OF_TICK * tick_s:
        return late
    met = float(np.mean((missed >= usual[0]) & (missed <= usual[1])))
    return folded if met > _MET else late


def _has_tail(late: Array) -> bool:
    """Whether delays reach further above their median than below it, block by block."""
    skews = []
    pieces = np.array_split(late, max(4, late.size // 64))
    for piece in pieces[:: max(1, len(pieces) // 1000)]:
        k = np.arange(piece.size) - 0.5 * (piece.size - 1)
        low, middle, high = np.percentile(piece - k * float(k @ piece) / float(k @ k), [5, 50, 95])
        if high > low:
            skews.append(((high - middle) - (middle - low)) / (high - low))
    return bool(skews) and float(np.median(skews)) > _TAIL


def longest_tick(series: Series) -> float:
    """The longest tick [s] that receipts also keep to where they come sooner or later; or 0."""
    assert series.receive is not None
    receive = np.sort(series.receive[series.good])
    when = seconds(receive - receive[0])
    return next((t for t in timers(when) if _kept_by_others(when, t)), 0.0)


def _kept_by_others(when: Array, tick_s: float) -> bool:
    """Whether intervals that hold no multiple of the usual number of ticks (else messages are
    missing) are whole ticks as well: those of a load are of any length."""
    interval = np.diff(when)
    counts = np.round(interval / tick_s)
    values, often = np.unique(counts, return_counts=True)
    usual = values[int(np.argmax(often))]
    if usual < 1.0:
        return False
    other = interval[counts % usual != 0.0]
    met = abs(np.mean(np.exp(2j * np.pi * other / tick_s))) if other.size >= _OTHER_TICKS else 0.0
    return float(met) > _COHERENT


def moved_together(late: Array, place: int, size_s: float, tick_s: float) -> bool:
    """Whether stamps and what they stamp moved together where stamps seem to jump alone.

    Receipts at ticks tell of messages that arrive later only by those that miss a tick.  A clock
    that jumps leaves receipts where they are: as many miss it before as after.  late: receipt minus
    stamp (n,) [s], which changes by size_s with the message at `place`.
    """
    before, after = late[max(0, place - _SIDE) : place], late[place : place + _SIDE]
    if abs(size_s) >= tick_s or min(before.size, after.size) < _LEAST:
        return False
    chance = _CHANCE * float(np.sqrt(1.0 / before.size + 1.0 / after.size))
    alike = _apart(before, after - size_s, _SAME * tick_s) <= chance
    return not alike and _apart(before, after, tick_s) <= chance


def _apart(one: Array, other: Array, slack_s: float) -> float:
    """By how much two distributions differ where values may lie slack_s apart."""
    one, other = np.sort(one), np.sort(other)
    sides = []
    for low, high in ((one, other), (other, one)):
        share = np.arange(1, low.size + 1) / low.size
        reached = np.searchsorted(high, low + slack_s, side="right") / high.size
        sides.append(float(np.max(share - reached)))
    return max(sides)
