"""Slips: stretches of messages whose stamps are whole seconds off, a pulse taken for the next."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from typing import Final

import numpy as np

from syncline_design.auditing.cadence import Cadence, cadence
from syncline_design.auditing.naming import slipped
from syncline_design.auditing.result import StampFault
from syncline_design.auditing.series import NS, Array, Series, seconds, spread
from syncline_design.auditing.shifts import Shift, Shifts
from syncline_design.auditing.witness import Side

_WHOLE: Final = 0.1  # s that a slip may be from whole seconds
_LEAST_RUN: Final = 3  # messages of a slip
_ENTERS: Final = 0.45  # s that the first message of a slip may be from whole seconds
_EARLY: Final = 10.0  # percent of a slip's messages that may come sooner than any other
_TRANSPORT_S: Final = 0.05
_BLUR_S: Final = 0.2  # interquartile range of delays: from here on whole seconds are no mark
_DRIFTING_S: Final = 0.03  # over the log: slower drifts do not blur whole seconds


def without_slips(series: Series, known_s: float | None) -> Shifts:
    """Stretches whose stamps are off by whole seconds; known_s: constant offset of the stream.

    Which stretch is right: the one whose stamps lie just before their receipts, where the constant
    is known; else the longest.
    """
    nothing = Shifts(series, (), (), None)
    if series.receive is None or series.good.sum() < 2 * _LEAST_RUN:
        return nothing
    places = series.places()
    late = seconds((series.receive - series.stamp)[places])
    middle = _usual(late)
    late = late - _slope(series.seconds[places], late)
    if spread(late - np.round(late - middle)) > _BLUR_S:
        return nothing  # delays that are as long as a slip
    turns = np.round(late - middle)
    if not turns.any():
        return nothing
    base = _right(late + (known_s or 0.0), turns, known_s is not None)
    turns = np.round(late - _usual(late[turns == base]))
    single = 1 + np.flatnonzero((turns[1:-1] != turns[:-2]) & (turns[:-2] == turns[2:]))
    turns[single] = turns[single - 1]  # one late message ends no stretch
    pace = cadence(series)
    found = [r for r in _runs(turns) if _is_slip(late, turns, r, pace, series, places)]
    if not found:
        return nothing
    own = [r for r in found if _side_of(series, places, pace, r[0], r[1]) != "receipt"]
    moved = series.stamp.copy()
    for begin, end in own:
        moved[places[begin:end]] += round(turns[begin]) * 10**9
    faults = tuple(_slip(series.seconds[places], turns, run, series.stamp[places]) for run in own)
    others = tuple(
        Shift(float(series.seconds[places[b]]), None, float(turns[b]), "receipt", 1.0)
        for b, e in found if (b, e) not in own and e == places.size
    )  # fmt: skip
    return Shifts(replace(series, stamp=moved), faults, others, None)


def _usual(late: Array) -> float:
    """The middle of them [s], one that is among them: between two levels lies none."""
    return float(np.sort(late)[late.size // 2])


def _slope(time_s: Array, late: Array) -> Array:
    """The drift of most messages, as seconds from the middle of the log; 0 where it is small."""
    lag = max(1, late.size // 10)
    passed = time_s[lag:] - time_s[:-lag]
    use = passed > 0.0
    if not use.any():
        return np.zeros(late.size)
    slope = float(np.median((late[lag:] - late[:-lag])[use] / passed[use]))
    drift = slope * (time_s - time_s[time_s.size // 2])
    return drift if abs(slope) * float(np.ptp(time_s)) > _DRIFTING_S else np.zeros(late.size)


def _right(late: Array, turns: Array, known: bool) -> float:
    values, often = np.unique(turns, return_counts=True)
    frequent = values[often >= max(_LEAST_RUN, 0.01 * turns.size)]
    if known and frequent.size:
        lows = [(float(np.percentile(late[turns == v], 10)), v) for v in frequent]
        causal = [(low, v) for low, v in lows if low > -_TRANSPORT_S]
        if causal:
            return float(min(causal)[1])
    return float(values[int(np.argmax(often))])


def _runs(turns: Array) -> Iterator[tuple[int, int]]:
    """Stretches of one number of seconds that is not 0."""
    edges = np.flatnonzero(np.diff(np.concatenate([[np.nan], turns, [np.nan]])) != 0)
    for begin, end in pairwise(edges):
        if turns[begin] != 0:
            yield int(begin), int(end)


def _is_slip(
    late: Array, turns: Array, run: tuple[int, int], pace: Cadence, series: Series,
    places: np.ndarray,
) -> bool:  # fmt: skip
    """Long enough, whole seconds off, and level: waiting messages come ever less late, and put
    right they would come sooner than any other."""
    begin, end = run
    if end - begin < _LEAST_RUN:
        return False
    right = late[turns == 0]
    inside = late[begin:end] - turns[begin]
    apart = abs(float(np.median(inside)) - float(np.median(right)))
    calm = max(3.0 * spread(right), 1e-3)
    level = spread(inside) < max(3.0 * spread(right), 0.02)
    change = turns[begin] - turns[begin - 1]
    enters = begin == 0 or abs(late[begin] - late[begin - 1] - change) < _ENTERS
    possible = float(np.percentile(inside, _EARLY)) > float(np.min(right)) - _WHOLE
    return apart < min(_WHOLE, max(calm, 0.01)) and level and enters and possible


def _side_of(
    series: Series, places: np.ndarray, pace: Cadence, begin: int, end: int
) -> Side:  # fmt: skip
    """Whose interval is odd where a slip begins (or, of one that begins the log, ends)."""
    assert series.receive is not None
    k = begin if begin > 0 else end
    if not 0 < k < places.size:
        return "unknown"
    a, b = places[k - 1], places[k]
    stamp = (series.stamp[b] - series.stamp[a]) / NS
    receive = (series.receive[b] - series.receive[a]) / NS
    expected = float(b - a) * pace.period_s  # messages between may be left out, as duplicates are
    if not pace.regular:
        return "unknown"
    odd_stamp, odd_receive = abs(stamp - expected), abs(receive - expected)
    if odd_receive > 0.6 and odd_stamp < 0.4:
        return "receipt"
    return "stamp"


def _slip(times: Array, turns: Array, run: tuple[int, int], stamp: np.ndarray) -> StampFault:
    begin, end = run
    ends = end < times.size
    change = np.diff(stamp[max(0, begin - 1) : end + 1])
    span = float(times[begin]), float(times[end] if ends else times[-1])
    return slipped(-round(turns[begin]), end - begin, span, int(np.sum(change < 0)), ends=ends)
