"""Stamps that are missing, that come twice, that go back, and counters that begin anew."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from syncline_design.auditing.result import Consequence, StampFault
from syncline_design.auditing.series import NS, Mask, Series, in_words, seconds, spread
from syncline_design.logs.readers.stream import UNSET
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import to_digits

WEEK_NS: Final = 604_800 * 10**9
LONGEST_SPIKE: Final = 5  # messages that go back and return
LEAST_SLIP: Final = 3  # messages
MOST_SPIKES: Final = 100_000
_RESOLUTIONS: Final = tuple(10**k for k in range(8))  # ns, to 10 ms
_SHARED: Final = 2.0  # messages of one count, and one more: no count is shared


@dataclass(frozen=True, slots=True)
class Repaired:
    """A series after one kind of fault was taken out, and what was found."""

    series: Series
    faults: tuple[StampFault, ...] = ()


def without_unset(series: Series) -> Repaired:
    """Stamps of zero among others that are far from it, and those that the reader calls unset."""
    stamp = series.stamp
    empty = stamp == UNSET
    zero = (stamp == 0) | (empty if series.receive is not None else False)
    others = stamp[~zero]
    near = others.size and float(np.median(np.abs(others))) < 5 * NS
    if near:  # a counter that begins here passes zero once
        zero = empty if series.receive is not None else np.zeros(stamp.size, bool)
        isolated = _runs_of(stamp == 0)
        for begin, end in isolated:
            if end - begin > 2 or _stands_alone(stamp, begin, end):
                zero[begin:end] = True
    zero &= ~_passing(stamp, stamp == 0)
    count = int(zero.sum())
    if not count:
        return Repaired(series)
    whole = count == stamp.size
    places = np.flatnonzero(zero)
    times = series.seconds
    fault = StampFault(
        "unset_stamps", {"count": float(count)}, None if whole else float(times[places[0]]),
        None if whole else float(times[places[-1]]),
        f"{count} of {stamp.size} stamps are zero, missing or no number",
    )  # fmt: skip
    return Repaired(replace(series, good=series.good & ~zero), (fault,))


def _stands_alone(stamp: NDArray[np.int64], begin: int, end: int) -> bool:
    """Whether a counter is far from where it begins on both sides of a zero."""
    if begin == 0 or end >= stamp.size:
        return False
    usual = float(np.median(np.abs(np.diff(stamp))))
    return min(int(stamp[begin - 1]), int(stamp[end])) > 5.0 * usual


def _passing(stamp: NDArray[np.int64], zero: Mask) -> Mask:
    """Zeros of a counter that begins anew: the stamp after is the next small count, the one before
    of the turn before.  There are as many as messages share other counts."""
    change = np.abs(np.diff(stamp))
    usual = float(np.median(change[change > 0])) if bool(change.any()) else 0.0
    heads = np.flatnonzero(np.concatenate([[True], change > 0, [True]]))
    alike = float(np.percentile(np.diff(heads), 90.0)) + 1.0
    out = np.zeros(stamp.size, bool)
    for begin, end in _runs_of(zero):
        anew = begin == 0 or stamp[begin - 1] > 5 * usual
        few = end - begin <= (alike if alike > _SHARED else 1)
        if anew and few and end < stamp.size and 0 < stamp[end] < 2 * usual:
            out[begin:end] = True
    return out


def _runs_of(mask: Mask) -> Iterator[tuple[int, int]]:
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(np.int8), [0]])))
    return ((int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True))


def without_duplicates(series: Series) -> Repaired:
    """Messages with the stamp of the one before."""
    places = series.places()
    same = np.concatenate([[False], np.diff(series.stamp[places]) == 0])
    count = int(same.sum())
    if not count or count <= _by_chance(series.stamp[places]):
        return Repaired(series)
    good = series.good.copy()
    good[places[same]] = False
    times = series.seconds[places[same]]
    fault = StampFault(
        "duplicates", {"count": float(count)}, float(times[0]), float(times[-1]),
        f"{count} message{'s carry' if count > 1 else ' carries'} the stamp of the message before",
    )  # fmt: skip
    return Repaired(replace(series, good=good), (fault,))


def _by_chance(stamp: NDArray[np.int64]) -> float:
    """How many stamps of an irregular sensor coincide at the resolution that they are kept in."""
    change = np.diff(stamp)
    mean = float(stamp[-1] - stamp[0]) / change.size
    low, high = np.percentile(change, [25.0, 75.0])
    if mean <= 0.0 or float(high - low) < 0.3 * mean:
        return 0.0
    step = max((s for s in _RESOLUTIONS if not np.any(stamp % s)), default=1)
    return 3.0 + 5.0 * stamp.size * step / mean if step > 1 else 0.0


def without_spikes(series: Series) -> Repaired:
    """Single messages whose stamps are out of order: back and at once forward again."""
    places = series.places()
    stamp = series.stamp[places]
    falls = np.flatnonzero(np.diff(stamp) < 0)
    if not falls.size:
        return Repaired(series)
    out = np.zeros(stamp.size, bool)
    late = _lateness(series, places)
    count, deepest = 0, 0
    away: list[float] = []
    for fall in falls[:MOST_SPIKES]:
        span = _spike(stamp, int(fall), out)
        if span is None or not _returns(late, span) or _is_whole(late, span):
            continue
        away.append(_away(late, span))
        span = _with_partner(late, span)
        count += 1
        deepest = min(deepest, int(stamp[fall + 1] - stamp[fall]))
        out[span] = True
    if not count:
        return Repaired(series)
    good = series.good.copy()
    good[places[out]] = False
    times = series.seconds[places[out]]
    slip = _slips(np.asarray(away), late, int(out.sum()), times)
    if slip is not None:
        return Repaired(replace(series, good=good), (slip,))
    fault = StampFault(
        "backward_jump", {"count": float(count), "seconds": deepest / NS}, float(times[0]),
        float(times[-1]), f"{count} times a stamp lies before the one of the message before, by "
        f"up to {to_digits(-deepest / NS, 6)} s, and the next go on as if nothing were",
    )  # fmt: skip
    return Repaired(replace(series, good=good), (fault,))


def without_wrong(series: Series, wrong: Mask) -> Repaired:
    """Single stamps that a sensor's rhythm has no place for, among messages in another order."""
    out = series.good & wrong
    if series.receive is None or not out.any():
        return Repaired(series)
    late = seconds(series.receive - series.stamp)
    away = late - float(np.median(late[series.good]))
    times, count = series.seconds[out], int(out.sum())
    good = series.good & ~wrong
    slip = _slips(away[out], late[good], count, times)
    fault = slip or StampFault(
        "backward_jump", {"count": float(count), "seconds": -float(away[out].max())},
        float(times[0]), float(times[-1]), f"{count} stamps lie where the sensor did not measure, "
        f"by up to {in_words(float(away[out].max()))} before the others of their time",
    )  # fmt: skip
    return Repaired(replace(series, good=good), (fault,))


def _spike(stamp: NDArray[np.int64], fall: int, out: Mask) -> slice | None:
    """The messages to leave out so that stamps rise again; None where they stay behind."""
    for length in range(1, LONGEST_SPIKE + 1):
        after = fall + 1 + length
        if after >= stamp.size:
            return slice(fall + 1, stamp.size) if length <= 2 else None
        if stamp[after] >= stamp[fall]:
            return slice(fall + 1, after)
        before = fall - length
        if before < 0:
            continue
        if stamp[fall + 1] >= stamp[before] and not out[before]:
            return slice(before + 1, fall + 1)
    return None


def _lateness(series: Series, places: NDArray[np.intp]) -> NDArray[np.float64]:
    """How late each message is against its stamp [s]; without receipts against an even rhythm."""
    stamp = series.stamp[places]
    if series.receive is not None:
        return seconds(series.receive[places] - stamp)
    usual = float(np.median(np.diff(stamp)))
    return np.asarray((np.arange(stamp.size) * usual - (stamp - stamp[0])) / NS)


def _returns(late: NDArray[np.float64], span: slice) -> bool:
    """Whether messages after a spike are as late as those before it."""
    before = late[max(0, span.start - 5) : span.start]
    after = late[span.stop : span.stop + 5]
    if not before.size or not after.size:
        return True
    away = abs(float(np.median(late[span])) - float(np.median(before)))
    return abs(float(np.median(after)) - float(np.median(before))) < 0.5 * away


def _is_whole(late: NDArray[np.float64], span: slice) -> bool:
    """Whether some messages in a row are whole seconds off, all by the same: a slip."""
    around = np.concatenate(
        [late[max(0, span.start - 8) : span.start], late[span.stop : span.stop + 8]]
    )
    if span.stop - span.start < LEAST_SLIP or not around.size:
        return False
    away = late[span] - float(np.median(around))
    whole = round(float(np.median(away)))
    return whole != 0 and float(np.max(np.abs(away - whole))) < max(0.05, 3.0 * spread(around))


def _away(late: NDArray[np.float64], span: slice) -> float:
    """How much later than the messages around it a spike is [s]."""
    beside = np.concatenate(
        [late[max(0, span.start - 5) : span.start], late[span.stop : span.stop + 5]]
    )
    return float(np.median(late[span]) - np.median(beside)) if beside.size else 0.0


def _slips(
    away: NDArray[np.float64], late: NDArray[np.float64], count: int, times: NDArray[np.float64]
) -> StampFault | None:
    """Single messages here and there that are all off by the same whole seconds: one slip."""
    whole = round(float(np.median(away)))
    near = np.abs(away - whole) < max(0.02, min(0.05, 3.0 * spread(late)))
    if whole == 0 or away.size < LEAST_SLIP or float(np.mean(near)) < 0.9:
        return None
    side = "behind" if whole > 0 else "ahead"
    falls = Consequence("backward_jump", {"count": float(away.size)},
                        "stamps go back at each of them")  # fmt: skip
    return StampFault(
        "whole_second_slip", {"seconds": float(-whole), "count": float(count)}, float(times[0]),
        float(times[-1]), f"{count} single messages are stamped {abs(whole)} s {side}", (falls,),
    )  # fmt: skip


def _with_partner(late: NDArray[np.float64], span: slice) -> slice:
    """Of two messages that changed places both are out of order."""
    before = late[max(0, span.start - 6) : span.start - 1]
    if span.start < 2 or not before.size:
        return span
    level = float(np.median(before))
    away = abs(float(np.median(late[span])) - level)
    moved = abs(float(late[span.start - 1]) - level)
    return slice(span.start - 1, span.stop) if moved > 0.6 * away else span


def remaining_falls(shifted: Series, series: Series) -> StampFault | None:
    """Stamps that went back and stayed behind, where no other cause was found.

    Only those that go back with their shifts (`shifted`) too: a drift is taken off by receipts, by
    which equal stamps of a grid seem to go back.
    """
    places = series.places()
    change = np.diff(series.stamp[places])
    falls = np.flatnonzero((change < 0) & (np.diff(shifted.stamp[places]) < 0))
    if not falls.size:
        return None
    times = series.seconds[places]
    deepest = int(change[falls].min())
    begin, end = float(times[falls[0] + 1]), float(times[falls[-1] + 1])
    back = f"{falls.size} times a stamp lies before the one of the message before, by up to "
    evidence = f"{back}{to_digits(-deepest / NS, 6)} s"
    parameters: dict[str, float | str] = {"count": float(falls.size), "seconds": deepest / NS}
    weeks = round(-deepest / (1024 * WEEK_NS))
    if weeks and abs(-deepest - weeks * 1024 * WEEK_NS) < 3600 * NS:
        follows = Consequence("backward_jump", parameters, evidence)
        return StampFault(
            "epoch_offset", {"seconds": -weeks * 1024 * WEEK_NS / NS, "kind": "week_rollover"},
            float(times[falls[int(np.argmin(change[falls]))] + 1]), float(times[-1]),
            f"stamps fall by {weeks * 1024} GPS weeks: the receiver's week number rolled over",
            (follows,),
        )  # fmt: skip
    return StampFault("backward_jump", parameters, begin, end, evidence)
