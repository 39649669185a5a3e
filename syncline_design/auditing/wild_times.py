"""Single messages one of whose times is wrong by any amount: a damaged figure, a clock that was
wrong for an instant or not set yet.

How late messages are is level but for delays.  Where a message lies far from that level and its
stamp lies between those around it, its receipt is late or wrong: wrong where it comes before the
message can have been measured, or after receipts of messages that follow it.  Stamps that lie
elsewhere are wrong, or of messages that were overtaken, which their rhythm tells (`disorder`); at
the ends of a log, where none comes after or before, only how far they lie.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from syncline_design.auditing.order import LONGEST_SPIKE, WEEK_NS, Repaired, without_unset
from syncline_design.auditing.result import FaultName, StampFault
from syncline_design.auditing.series import NS, Array, Mask, Series, in_words, seconds, spread
from syncline_design.auditing.wrong_receipts import MOST_IN_ROW

_LEAST_MESSAGES: Final = 40
_AROUND: Final = 60  # messages on each side that tell the level
_FAR_S: Final = 0.05
_SPREADS: Final = 20.0  # of the delays
_MOST: Final = 0.05  # of all messages: more are how the stream is
_WIDE, _LOW = 600, 5.0  # messages, per cent of them: no host holds up all of so many
_AT_ONCE: Final = 1 << 14  # windows, each of which is held whole while its middle is looked for
_HELD_UP: Final = 2.0  # times as long as any other message of the log
_AT_END: Final = 3  # messages: a clock that was set is told by four
_OLD_S: Final = 5.0  # by which a message may be held up on its way while others pass
_STEADY: Final = 0.5  # of an interval
_SLIP_S, _WHOLE_S = 15.0, 0.05
_FALLS: Final = 3  # receipts that fall, beside the wrong ones; threads note more of them so
_LATE_AT_END_S: Final = 0.5  # that no message waits for which none follows
_ANEW: Final = 0.05  # of the stamp before: a counter that begins anew is near nothing


def without_wild_times(series: Series) -> Repaired:
    """The stream without single messages that were received nowhere near the others, some in a row
    at most, or at its ends are stamped so."""
    if series.receive is None:
        return Repaired(series)
    places = without_unset(series).series.places()
    if places.size < _LEAST_MESSAGES:
        return Repaired(series)
    stamp, receive = series.stamp[places], series.receive[places]
    late = receive - stamp
    usual = float(np.median(np.abs(np.diff(stamp)))) / NS
    calm = spread(seconds(np.diff(late)))
    far = max(_FAR_S, _SPREADS * calm, 2.0 * usual)
    away = seconds(late - _level(late))
    if not 0 < int(np.sum(np.abs(away) > far)) <= _MOST * places.size:
        return Repaired(series)
    stamps, receipts = np.zeros(away.size, bool), np.zeros(away.size, bool)
    for begin, end in _runs(np.abs(away), far):
        own = _wrong_of(stamp, receive, away, (begin, end), far, usual)
        if own is not None:
            (stamps if own == "stamp" else receipts)[begin:end] = True
    if _falls(receive[~receipts]) > _FALLS:
        receipts[:] = False  # as threads note messages
    return _left_out(series, places, away, (stamps, receipts))


def _level(late: NDArray[np.int64]) -> NDArray[np.int64]:
    """The middle of how late messages around each are [ns], one of these; of both sides where
    there are two, so that a step is met by half a window on each of its sides."""
    size = 2 * _AROUND + 1
    if late.size <= size:
        return np.full(late.size, np.sort(late)[late.size // 2])
    windows = np.lib.stride_tricks.sliding_window_view(late, size)
    middle = np.concatenate([
        np.partition(windows[at : at + _AT_ONCE], _AROUND, axis=1)[:, _AROUND].copy()
        for at in range(0, windows.shape[0], _AT_ONCE)
    ])  # fmt: skip
    return np.concatenate(
        [np.full(_AROUND, middle[0]), middle, np.full(_AROUND, middle[-1])]
    )  # fmt: skip


def _runs(off: Array, far: float) -> Iterator[tuple[int, int]]:
    """Messages in a row of which one at least is far off, and all by half as much."""
    near = off > 0.5 * far
    edges = np.flatnonzero(np.diff(np.concatenate([[0], near.astype(np.int8), [0]])))
    for begin, end in edges.reshape(-1, 2).tolist():
        at_end = begin == 0 or end == off.size
        if off[begin:end].max() > far and end - begin <= (_AT_END if at_end else MOST_IN_ROW):
            yield begin, end


def _wrong_of(
    stamp: NDArray[np.int64], receive: NDArray[np.int64], away: Array, run: tuple[int, int],
    far: float, usual: float,
) -> str | None:  # fmt: skip
    """Whose time of a run is wrong; None where it may be transport, a slip or a counter."""
    begin, end = run
    beside = [k for k in (begin - 1, end) if 0 <= k < stamp.size]
    off, own = away[begin:end], stamp[begin:end]
    reach = round((_STEADY + (end - begin) * (len(beside) == 1)) * usual * NS)
    low, high = int(stamp[beside].min()) - reach, int(stamp[beside].max()) + reach
    if np.any(own < low) or np.any(own > high):
        known = _is_another(own, stamp[beside], off)
        return None if known or not _is_no_transport(away, run) else "stamp"
    put_back = own + np.round(off * NS).astype(np.int64)
    if np.all((put_back >= low) & (put_back <= high)) and _is_slip(off):
        return None  # of events that come seldom: their stamps may be as wrong
    if not _receipts_jump(stamp, receive, run, usual):
        return None
    if np.all(off < 0.0):
        late = seconds(receive - stamp)
        wide = np.concatenate([late[max(0, begin - _WIDE) : begin], late[end : end + _WIDE]])
        early = float(late[begin:end].max()) < float(np.percentile(wide, _LOW)) - 0.5 * far
        return "receipt" if early else None  # the others may have waited for a host
    if end == stamp.size:
        return "receipt" if np.all(off > max(_LATE_AT_END_S, far)) else None
    overtakes = int(receive[end - 1]) - int(receive[end]) > 0.5 * float(off.min()) * NS
    return "receipt" if np.all(off > 0.0) and overtakes else None


def _receipts_jump(
    stamp: NDArray[np.int64], receive: NDArray[np.int64], run: tuple[int, int], usual: float
) -> bool:  # fmt: skip
    """Whether receipts leave the usual interval where a run begins and ends, more than stamps: a
    clock that is set ahead and settles keeps its stamps in order as well."""
    edges = [k for k in run if 0 < k < stamp.size]
    odd = [
        [abs(float(times[k] - times[k - 1]) / NS - usual) for k in edges]
        for times in (stamp, receive)
    ]
    return all(of_stamps < of_receipts for of_stamps, of_receipts in zip(*odd, strict=True))


def _is_no_transport(away: Array, run: tuple[int, int]) -> bool:
    """Whether stamps lie farther off than messages that were held up, or overtaken, do.

    The first of a log may have waited for what held up others of it as well.
    """
    begin, end = run
    off = away[begin:end]
    if float(np.abs(off).min()) > _OLD_S:
        return end - begin <= LONGEST_SPIKE or bool(np.all(off > 0.0))
    if begin == 0:
        return bool(np.any(off < 0.0)) or float(off.max()) > _HELD_UP * float(away[end:].max())
    return end == away.size and bool(np.all(off < 0.0))


def _is_another(own: NDArray[np.int64], beside: NDArray[np.int64], off: Array) -> bool:
    """Whether such stamps are whole seconds or 1024 weeks off, or of a counter that began anew."""
    if _is_slip(off):
        return True
    weeks = seconds(np.abs(own - int(beside[0]))) * NS / (1024 * WEEK_NS)
    turned = np.abs(weeks - np.round(weeks)) * 1024 * WEEK_NS / NS < 3600.0
    if np.all(turned & (np.round(weeks) > 0)):
        return True
    return bool(np.all((own >= 0) & (own < _ANEW * float(np.abs(beside).min()))))


def _is_slip(off: Array) -> bool:
    whole = np.round(off)
    return bool(np.all((np.abs(off - whole) < _WHOLE_S) & (np.abs(whole) < _SLIP_S)))


def _falls(receive: NDArray[np.int64]) -> int:
    return int(np.sum(np.diff(receive) < 0))


def _left_out(
    series: Series, places: NDArray[np.intp], away: Array, wrong: tuple[Mask, Mask]
) -> Repaired:
    """The series without either kind; a message is received when the one before it was."""
    stamps, receipts = wrong
    if not stamps.any() and not receipts.any():
        return Repaired(series)
    assert series.receive is not None
    good, receive = series.good.copy(), series.receive.copy()
    good[places[stamps | receipts]] = False
    right = np.flatnonzero(~receipts)
    before = right[np.clip(np.searchsorted(right, np.flatnonzero(receipts)) - 1, 0, None)]
    receive[places[receipts]] = receive[places[before]]
    start = series.start
    if receipts[0] and start == int(series.receive[places[0]]):
        start = int(receive[places[0]])
    left = replace(series, good=good, receive=receive, start=start)
    named: tuple[tuple[FaultName, Mask, Array], ...] = (
        ("backward_jump", stamps, -away), ("wrong_receipts", receipts, away),
    )  # fmt: skip
    faults = [_fault(name, left.seconds[places], one, off) for name, one, off in named if one.any()]
    return Repaired(left, tuple(faults))


def _fault(name: FaultName, times: Array, wrong: Mask, off: Array) -> StampFault:
    """seconds: by how much the farthest is off, after its neighbours positive."""
    deepest = float(off[wrong][np.argmax(np.abs(off[wrong]))])
    count = int(wrong.sum())
    what = "stamp" if name == "backward_jump" else "receipt"
    lies = f"{count} {what}s lie" if count > 1 else f"1 {what} lies"
    other = "receipts" if name == "backward_jump" else "stamps"
    found = times[wrong]
    return StampFault(
        name, {"count": float(count), "seconds": deepest}, float(found[0]), float(found[-1]),
        f"{lies} far from those of the messages around, by up to {in_words(abs(deepest))} "
        f"{'after' if deepest > 0 else 'before'} them, while the {other} go on as if nothing were",
    )  # fmt: skip
