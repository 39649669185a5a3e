"""Stamps that are missing, that come twice, that go back, and counters that begin anew."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from syncline_design.auditing.result import Consequence, StampFault
from syncline_design.auditing.series import NS, Mask, Series, seconds
from syncline_design.logs.readers.stream import UNSET

# where counters of devices begin anew [ns]: 16, 24, 31 and 32 bits of ns, us, ms and 10 us
_BITS: Final = tuple(
    2**bits * unit for bits in (16, 24, 31, 32) for unit in (1, 1000, 10_000, 1_000_000)
)
_CALENDAR: Final = tuple(int(s * NS) for s in (60, 3600, 43_200, 86_400, 604_800))
WRAPS: Final = tuple(sorted(w for w in {*_BITS, *_CALENDAR} if w > 100_000_000))
WEEK_NS: Final = 604_800 * 10**9
BACK_NS: Final = 100_000  # receipts of several threads may be written out of order by less
MOST_SETS: Final = 20  # times that a clock is set in a log; more are another disorder
LONGEST_SPIKE: Final = 5  # messages that go back and return
MOST_SPIKES: Final = 100_000


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
            if end - begin > 2:
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


def _passing(stamp: NDArray[np.int64], zero: Mask) -> Mask:
    """Zeros of a counter that begins anew: the stamp after is the next small count."""
    usual = float(np.median(np.abs(np.diff(stamp)))) if stamp.size > 1 else 0.0
    out = np.zeros(stamp.size, bool)
    for begin, end in _runs_of(zero):
        if end - begin == 1 and end < stamp.size and 0 < stamp[end] < 5 * usual:
            out[begin] = True
    return out


def _runs_of(mask: Mask) -> Iterator[tuple[int, int]]:
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(np.int8), [0]])))
    return ((int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True))


def with_receipts_forward(series: Series) -> Repaired:
    """Receipts that go back: the recorder's clock was set back, for every message from there on."""
    if series.receive is None or series.receive.size < 3:
        return Repaired(series)
    change = np.diff(series.receive)
    falls = np.flatnonzero((change < -BACK_NS) & series.good[1:] & series.good[:-1])
    if not falls.size or falls.size > MOST_SETS:
        return Repaired(series)
    usual = int(np.median(change))
    moved = np.zeros(series.receive.size, np.int64)
    faults = []
    times = series.seconds
    for fall in falls:
        size = _set_back(series, int(fall), usual - int(change[fall]))
        moved[fall + 1 :] += size
        faults.append(StampFault(
            "recorder_clock", {"seconds": size / NS, "kind": "step"}, float(times[fall]),
            float(times[-1]),
            f"receipts go back by {-int(change[fall]) / NS:.6g} s: the recorder's clock was set",
        ))  # fmt: skip
    return Repaired(replace(series, receive=series.receive + moved), tuple(faults))


def _set_back(series: Series, fall: int, about: int) -> int:
    """By how much [ns]: the medians of receipt minus stamp before and after, where they agree."""
    assert series.receive is not None
    late = series.receive - series.stamp
    before = late[max(0, fall - 60) : fall + 1][series.good[max(0, fall - 60) : fall + 1]]
    after = late[fall + 1 : fall + 61][series.good[fall + 1 : fall + 61]]
    if before.size < 10 or after.size < 10:
        return about
    size = int(np.median(before) - np.median(after))
    return size if abs(size - about) < 0.2 * about else about


def unwrapped(series: Series) -> Repaired:
    """Counters made continuous.

    A wrap: the stamp falls by the counter's range (known, or the same at every fall) against the
    receipt, and stays inside that range.
    """
    places = series.places()
    stamp = series.stamp[places]
    change = np.diff(stamp)
    falls = np.flatnonzero(change < 0)
    if not falls.size:
        return Repaired(series)
    expected = _expected(series, places)
    fallen = (expected - change)[falls]
    tolerance = _tolerance(change - expected)
    found = _range(fallen, tolerance, stamp)
    if found is None:
        return Repaired(series)
    wrap, matching = found
    turns = np.zeros(stamp.size, np.int64)
    turns[falls[matching] + 1] = 1
    whole = series.stamp.copy()
    whole[places] = stamp + np.cumsum(turns) * wrap
    times = series.seconds[places]
    at = times[falls[matching] + 1]
    count = int(matching.sum())
    said = "once" if count == 1 else f"{count} times, each time"
    back = Consequence("backward_jump", {"count": float(count), "seconds": -wrap / NS},
                       "the stamp goes back where the counter begins anew")  # fmt: skip
    fault = StampFault(
        "counter_wrap", {"wrap_s": wrap / NS, "count": float(count)}, float(at[0]), float(at[-1]),
        f"stamps fall by {wrap / NS:.9g} s {said} while receipts go on"
        + (f": {_words(wrap)}" if _words(wrap) else ""),
        (back,),
    )  # fmt: skip
    return Repaired(replace(series, stamp=whole), (fault,))


def _expected(series: Series, places: NDArray[np.intp]) -> NDArray[np.int64]:
    """How far each stamp should be from the one before: as receipts, else the median interval."""
    if series.receive is not None:
        return np.diff(series.receive[places])
    change = np.diff(series.stamp[places])
    return np.full(change.size, int(np.median(change)), np.int64)


def _tolerance(excess: NDArray[np.int64]) -> float:
    usual = np.abs(excess[np.abs(excess) < np.quantile(np.abs(excess), 0.98) + 1])
    return max(1e6, 4.0 * float(usual.max(initial=0)))


def _range(
    fallen: NDArray[np.int64], tolerance: float, stamp: NDArray[np.int64]
) -> tuple[int, Mask] | None:
    """The range of a counter whose falls these are, and which of the falls are its wraps."""
    for wrap in WRAPS:
        matching = np.abs(fallen - wrap) < min(tolerance, 0.05 * wrap)
        inside = bool(np.all((stamp >= 0) & (stamp < wrap)))
        odd = wrap not in _CALENDAR and wrap > 4 * NS and bool(matching.all())
        if matching.any() and (inside or odd):
            return wrap, matching
    size = int(np.median(fallen))
    same = np.abs(fallen - size) < max(1e3, 1e-6 * size)
    inside = bool(np.all((stamp >= 0) & (stamp <= size)))
    if fallen.size > 1 and same.all() and inside and size > 0:
        return size, same
    return None


def _words(wrap: int) -> str:
    units = ((1, "ns"), (1000, "us"), (10_000, "10 us"), (1_000_000, "ms"))
    for bits in (16, 24, 31, 32):
        for unit, name in units:
            if 2**bits * unit == wrap:
                return f"{bits} bits of {name}"
    names = {60: "a minute", 3600: "an hour", 43_200: "half a day", 86_400: "a day",
             604_800: "a week"}  # fmt: skip
    return names.get(round(wrap / NS), "") if wrap in _CALENDAR else ""


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
        f"{count} messages carry the stamp of the message before",
    )  # fmt: skip
    return Repaired(replace(series, good=good), (fault,))


def _by_chance(stamp: NDArray[np.int64]) -> float:
    """How many stamps of an irregular sensor coincide at the resolution that they are kept in."""
    change = np.diff(stamp)
    mean = float(stamp[-1] - stamp[0]) / change.size
    low, high = np.percentile(change, [25.0, 75.0])
    if mean <= 0.0 or float(high - low) < 0.3 * mean:
        return 0.0
    step = max((s for s in (1, 10, 100, 1000, 10_000) if not np.any(stamp % s)), default=1)
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
    for fall in falls[:MOST_SPIKES]:
        span = _spike(stamp, int(fall), out)
        if span is None or not _returns(late, span):
            continue
        span = _with_partner(late, span)
        count += 1
        deepest = min(deepest, int(stamp[fall + 1] - stamp[fall]))
        out[span] = True
    if not count:
        return Repaired(series)
    good = series.good.copy()
    good[places[out]] = False
    times = series.seconds[places[out]]
    fault = StampFault(
        "backward_jump", {"count": float(count), "seconds": deepest / NS}, float(times[0]),
        float(times[-1]), f"{count} times a stamp lies before the one of the message before, by "
        f"up to {-deepest / NS:.6g} s, and the next go on as if nothing were",
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


def _with_partner(late: NDArray[np.float64], span: slice) -> slice:
    """Of two messages that changed places both are out of order."""
    before = late[max(0, span.start - 6) : span.start - 1]
    if span.start < 2 or not before.size:
        return span
    level = float(np.median(before))
    away = abs(float(np.median(late[span])) - level)
    moved = abs(float(late[span.start - 1]) - level)
    return slice(span.start - 1, span.stop) if moved > 0.6 * away else span


def remaining_falls(series: Series) -> StampFault | None:
    """Stamps that went back and stayed behind, where no other cause was found."""
    places = series.places()
    change = np.diff(series.stamp[places])
    falls = np.flatnonzero(change < 0)
    if not falls.size:
        return None
    times = series.seconds[places]
    deepest = int(change[falls].min())
    begin, end = float(times[falls[0] + 1]), float(times[falls[-1] + 1])
    back = f"{falls.size} times a stamp lies before the one of the message before, by up to "
    evidence = f"{back}{-deepest / NS:.6g} s"
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
