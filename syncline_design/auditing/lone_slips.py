"""Single messages whose stamps are whole seconds off, a pulse taken for the one before or after.

Such a message comes among its neighbours and is stamped among others: put back by whole seconds
its stamp takes the place of the rhythm between its neighbours that is empty.  One that was held up
by transport would fall onto a place that another message took.  Without a rhythm it is the order of
messages that tells.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from syncline_design.auditing.cadence import cadence
from syncline_design.auditing.order import LEAST_SLIP, Repaired
from syncline_design.auditing.result import Consequence, StampFault
from syncline_design.auditing.series import Array, Mask, Series, seconds, spread

_LEAST_MESSAGES: Final = 40
_LARGEST_S: Final = 15.0
_APART_S: Final = 0.5
_SIDE: Final = 10  # messages on each side whose median is the level
_NEAR_S: Final = 0.02  # from whole seconds
_FAR_S: Final = 0.05  # from them, where delays scatter
_MOST: Final = 0.25  # of all messages
_STRAY_S: Final = 0.1  # of single messages: later or sooner than delays explain
_CHANCE: Final = 3.0  # times as many as those that are off by no whole seconds
_NEXT: Final = 4  # intervals on each side, most of which are usual
_PLACED: Final = 0.25  # of an interval
_CHUNK: Final = 50_000


def without_lone_slips(series: Series) -> Repaired:
    """The stream without single stamps (two in a row at most, but where many are) that are whole
    seconds off, by the size that most have named; the others are left to be found as episodes."""
    places = series.places()
    if series.receive is None or places.size < _LEAST_MESSAGES:
        return Repaired(series)
    late = seconds(series.receive[places] - series.stamp[places])
    if not np.any(np.abs(np.diff(late)) > _APART_S):
        return Repaired(series)
    away = late - _running_median(late, _SIDE)
    turns = _turns(away)
    off = (turns != 0.0) & _lone(turns != 0.0)
    if not 0 < int(off.sum()) <= _MOST * places.size:
        return Repaired(series)
    placed = _fills_its_place(series.stamp[places], turns, off)
    if not cadence(series).regular:
        placed |= _out_of_order(series.stamp[places], turns, off)
    off &= placed
    off &= _returns(off)
    others = _lone((turns == 0.0) & (np.abs(away) > _STRAY_S))
    if int(off.sum()) <= _CHANCE * int(others.sum()):
        return Repaired(series)  # of stamps that are wrong by any amount some are off by seconds
    faults = []
    good = series.good.copy()
    for turn in np.unique(turns[off]):
        one = off & (turns == turn)
        good[places[one]] = False
        faults.append(_fault(series, places[one], float(turn)))
    return Repaired(replace(series, good=good), tuple(faults))


def _turns(away: Array) -> Array:
    """By how many whole seconds each message is later than those around it; 0 where not whole."""
    turns = np.round(away)
    rest = np.abs(away - turns)
    near = max(_NEAR_S, min(_FAR_S, 3.0 * spread(away[turns == 0.0])))
    whole = (rest < near) & (np.abs(turns) < _LARGEST_S)
    return np.where(whole, turns, 0.0)


def _running_median(values: NDArray[np.float64], side: int) -> Array:
    """The median of each value and those beside it; in pieces, as windows take memory."""
    padded = np.pad(values, side, mode="reflect")
    windows = sliding_window_view(padded, 2 * side + 1)
    pieces = [np.median(windows[k : k + _CHUNK], axis=1) for k in range(0, values.size, _CHUNK)]
    return np.concatenate(pieces)


def _lone(off: Mask) -> Mask:
    """Those of runs too short for an episode; longer ones too, where most are short."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], off, [False]]).astype(np.int8)))
    begins, lengths = edges[::2], edges[1::2] - edges[::2]
    short = lengths < LEAST_SLIP
    if int(lengths[short].sum()) > int(lengths[~short].sum()) * LEAST_SLIP:
        short |= lengths < 2 * LEAST_SLIP
    out = np.zeros(off.size, bool)
    for begin, length in zip(begins[short], lengths[short], strict=True):
        out[begin : begin + length] = True
    return out


def _fills_its_place(stamp: NDArray[np.int64], turns: Array, off: Mask) -> Mask:
    """Whether each, put back, lies in the rhythm between its neighbours, where none else is; not
    those that repeat the very stamp of the message before, as a stale message does."""
    back = stamp + np.where(off, np.round(turns), 0.0).astype(np.int64) * 10**9
    change = np.diff(back).astype(np.float64)
    period = _running_median(change, _NEXT)
    counts = np.maximum(np.round(change / np.maximum(period, 1.0)), 1.0)
    fits = np.abs(change - counts * period) < _PLACED * period
    placed = np.concatenate([[True], fits]) & np.concatenate([fits, [True]])
    stale = np.concatenate([[False], np.diff(stamp) == 0]) & (turns > 0.0)
    return np.asarray(placed & ~stale)


def _out_of_order(stamp: NDArray[np.int64], turns: Array, off: Mask) -> Mask:
    """Of sensors without rhythm: those that put back bring all stamps in order, and others by as
    much.  A message that transport held up by a second would have held up those behind it."""
    back = stamp + np.where(off, np.round(turns), 0.0).astype(np.int64) * 10**9
    if np.any(np.diff(back) <= 0):
        return np.zeros(off.size, bool)
    before = np.concatenate([[False], np.diff(stamp) < 0]) & (turns > 0.0)
    after = np.concatenate([np.diff(stamp) < 0, [False]]) & (turns < 0.0)
    return np.asarray(np.isin(turns, turns[off & (before | after)]) & off)


def _returns(off: Mask) -> Mask:
    """Those with stamps as usual before and after: at an end they may be a counter begun anew."""
    usual = np.flatnonzero(~off)
    out = np.zeros(off.size, bool)
    out[usual[0] : usual[-1]] = True
    return out


def _fault(series: Series, places: NDArray[np.intp], turn: float) -> StampFault:
    times, count = series.seconds[places], int(places.size)
    side = "behind" if turn > 0 else "ahead"
    who = f"{count} single messages are" if count > 1 else "a single message is"
    falls = Consequence("backward_jump", {"count": float(count)}, "stamps go back at each of them")
    return StampFault(
        "whole_second_slip", {"seconds": -turn, "count": float(count)}, float(times[0]),
        float(times[-1]), f"{who} stamped {abs(round(turn))} s {side}", (falls,),
    )  # fmt: skip
