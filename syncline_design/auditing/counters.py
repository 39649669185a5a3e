"""Counters that begin anew: by how much stamps fall, and stamps made continuous again.

A counter of range R shows t mod R.  Each fall is R less what passed since the message before, and
no stamp leaves an interval of length R; that tells it from jumps and slips, whatever R is.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from syncline_design.auditing.grains import grain_of
from syncline_design.auditing.result import Consequence, StampFault
from syncline_design.auditing.series import NS, Array, Mask, Series, in_words, scatter
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import to_digits

# ranges by name [ns]: bits of a unit, first what is most often met; parts of the calendar
_UNITS: Final = (
    (1.0, "ns"), (1e3, "us"), (1e6, "ms"), (1e4, "10 us"), (1e5, "100 us"), (1e2, "100 ns"),
    (1e7, "10 ms"), (1e9 / 32_768, "1/32768 s"), (1e9 / 90_000, "1/90000 s"), (10.0, "10 ns"),
    (62.5, "1/16 us"), (125.0, "1/8 us"), (50.0, "50 ns"), (40.0, "40 ns"), (20.0, "20 ns"),
)  # fmt: skip
_WIDTHS: Final = (32, 16, 31, 24, 30, 48, 28, 20, 18, 15, 14, 12)
_CALENDAR: Final = {
    1: "a second", 10: "ten seconds", 60: "a minute", 100: "a hundred seconds",
    1000: "a thousand seconds", 3600: "an hour", 10_000: "ten thousand seconds",
    43_200: "half a day", 86_400: "a day", 604_800: "a week",
}  # fmt: skip
_LEAST_NS: Final = 2e7
_ODD_NS: Final = 4e9  # a known range from here on need not begin at zero
_ALIASED: Final = 0.2  # share of falls from which on the range is of the order of the interval
_INSIDE: Final = 0.995
_ALIKE: Final = 0.8  # of the falls, of a range that has no name
_NEAR: Final = 1e-3  # of a range: how far from its name what was measured may be
_TICK: Final = 0.003  # of a range: how coarse its ticks may be for it to have a name
_WITHIN: Final = 0.3  # of a range: falls that are taken for the same
_EVEN: Final = 0.35
_GRAINS: Final = 1.1  # by which intervals of an even sensor differ on a grid
_OFTEN: Final = 0.2  # of an interval
_AROUND: Final = 20
_BINS: Final = 10
_COHERENT: Final = 0.6
_PIECE: Final = 40


@dataclass(frozen=True, slots=True)
class Range:
    """A range of a counter [ns], with its name if it has one."""

    size_ns: float
    name: str


def _known() -> tuple[Range, ...]:
    named = {s * NS: Range(s * NS, words) for s, words in _CALENDAR.items()}
    for bits in _WIDTHS:
        for unit, words in _UNITS:
            named.setdefault(2.0**bits * unit, Range(2.0**bits * unit, f"{bits} bits of {words}"))
    return tuple(one for one in named.values() if _LEAST_NS < one.size_ns < 1e18)


RANGES: Final = _known()  # in the order in which they are believed


@dataclass(frozen=True, slots=True)
class Continuous:
    """Stamps of a counter made continuous, and the fault; without one the series as it was."""

    series: Series
    faults: tuple[StampFault, ...] = ()


def unwrapped(series: Series) -> Continuous:
    """Counters made continuous."""
    places = series.places()
    stamp = series.stamp[places]
    change = np.diff(stamp)
    falls = np.flatnonzero(change < 0)
    if not falls.size:
        return Continuous(series)
    grain = grain_of(stamp)
    expected, even = _expected(series, places, change, grain)
    if falls.size > _ALIASED * change.size and not (even and _as_often(series, places, change)):
        return _aliased(series, places, stamp)
    period = float(np.median(change[change > 0])) if bool(np.any(change > 0)) else 0.0
    fallen = (expected - change)[falls]
    levels = _by_levels(series, places, falls, fallen)
    noise = _noise(series, places, expected - change, even)
    found = _range(fallen, stamp, noise, grain) if even else None
    if not even:
        fallen = levels
    elif series.receive is not None and (found is None or not found[0].name):
        # messages may be lost where the counter begins anew; but levels move with a loaded host
        fallen = fallen + np.round((levels - fallen) / period) * period
        found = None
    found = found or _range(fallen, stamp, noise, grain)
    if found is None:
        return Continuous(series)
    wrap, matching = found
    if even:  # to the sensor's jitter, while levels blur where a queue is as long as the range
        by_rhythm = period - change[falls]
        matching |= np.abs(by_rhythm - wrap.size_ns) < _WITHIN * min(wrap.size_ns, period)
    turns = np.zeros(stamp.size)
    turns[falls[matching] + 1] = 1.0
    if series.receive is not None:
        late = (series.receive[places] - stamp).astype(np.float64)
        long_ = (expected > wrap.size_ns) & (change > 0)
        turns = _with_gaps(turns, expected - change, late, wrap.size_ns, long_)
    whole = series.stamp.copy()
    whole[places] = stamp + np.round(np.cumsum(turns) * wrap.size_ns).astype(np.int64)
    at = series.seconds[places][falls[matching] + 1]
    fault = _fault(wrap, int(matching.sum()), float(at[0]), float(at[-1]))
    return Continuous(replace(series, stamp=whole), (fault,))


def _as_often(
    series: Series, places: NDArray[np.intp], change: NDArray[np.int64]
) -> bool:  # fmt: skip
    """Whether messages come as often as their stamps rise: no turn lies between two of them."""
    if series.receive is None or places.size < 2 * _AROUND:
        return series.receive is None
    receive = series.receive[places]
    passed = float(np.median(receive[_AROUND:] - receive[:-_AROUND])) / _AROUND
    return abs(passed / float(np.median(change[change > 0])) - 1.0) < _OFTEN


def _with_gaps(turns: Array, excess: Array, late: Array, size_ns: float, long_: Mask) -> Array:
    """Turns with those in gaps longer than the range: messages behind one are later for good, while
    one that came late alone, and the queue behind it, are not.

    excess: how much further than its stamp each message came after the one before; long_: gaps.
    """
    more = np.round(excess / size_ns)
    more[(more == 1.0) & ~long_] = 0.0
    turned = turns.copy()
    late = late - np.cumsum(turns) * size_ns
    for k in np.flatnonzero(more > turns[1:]) + 1:
        before, after = late[max(0, k - _AROUND) : k], late[k : k + _AROUND]
        whole = max(0.0, float(np.round((np.median(after) - np.median(before)) / size_ns)))
        turned[k] += min(more[k - 1] - turns[k], whole)
    return turned


def _fault(wrap: Range, count: int, first_s: float, last_s: float) -> StampFault:
    said = "once" if count == 1 else f"{count} times, each time"
    seconds = wrap.size_ns / NS
    back = Consequence("backward_jump", {"count": float(count), "seconds": -seconds},
                       "the stamp goes back where the counter begins anew")  # fmt: skip
    name = f": {wrap.name}" if wrap.name else ""
    return StampFault(
        "counter_wrap", {"wrap_s": seconds, "count": float(count)}, first_s, last_s,
        f"stamps fall by {to_digits(seconds, 9)} s {said} while receipts go on{name}", (back,),
    )  # fmt: skip


def _expected(
    series: Series, places: NDArray[np.intp], change: NDArray[np.int64], grain: int
) -> tuple[Array, bool]:
    """How far each stamp should be from the one before [ns], and whether an even rhythm says so.

    A rhythm is exact to the stamps' own jitter, or to their grain; receipts to that of transport.
    """
    forward = change[change > 0].astype(np.float64)
    period = float(np.median(forward)) if forward.size else 0.0
    near = forward[np.abs(forward - period) < max(_EVEN * period, _GRAINS * grain)]
    even = period > 0.0 and near.size > 0.9 * forward.size
    if series.receive is None:
        return np.full(change.size, period), even
    passed = np.diff(series.receive[places]).astype(np.float64)
    if not even:
        return passed, False
    missing = np.where(passed > 3.0 * period, np.round(passed / float(near.mean())), 1.0)
    return missing * float(near.mean()), True


def _by_levels(
    series: Series, places: NDArray[np.intp], falls: NDArray[np.intp], fallen: Array
) -> Array:
    """What receipt minus stamp gains at each fall, by medians of the messages around it."""
    if series.receive is None:
        return fallen
    late = (series.receive - series.stamp)[places].astype(np.float64)
    edges = np.concatenate([[-1], falls, [late.size - 1]])
    found = fallen.copy()
    for k in range(falls.size):
        before = late[max(edges[k] + 1, falls[k] + 1 - _AROUND) : falls[k] + 1]
        after = late[falls[k] + 1 : min(edges[k + 2] + 1, falls[k] + 1 + _AROUND)]
        if before.size >= 5 and after.size >= 5:
            found[k] = np.median(after) - np.median(before)
    return found


def _noise(
    series: Series, places: NDArray[np.intp], excess: Array, even: bool
) -> float:  # fmt: skip
    """What one fall is uncertain by [ns]."""
    own = 2.0 * scatter(excess) if excess.size > 4 else 0.0
    if not even and series.receive is not None:
        late = np.diff((series.receive - series.stamp)[places]).astype(np.float64)
        own = max(own, 2.0 * scatter(late))
    return max(own, 2e3)


def _range(
    fallen: Array, stamp: NDArray[np.int64], noise: float, grain: int
) -> tuple[Range, Mask] | None:
    """The range of a counter whose falls these are, and which of the falls are its wraps."""
    for size in dict.fromkeys((float(np.median(fallen)), float(fallen.max()))):
        within = _WITHIN * size  # late messages make a fall seem larger; what is said is the median
        matching = np.abs(fallen - size) < within
        if size <= 0.0 or not matching.any():
            continue
        middle = float(np.median(fallen[matching]))
        sure = min(6.0 * noise / np.sqrt(matching.sum()) + 2e3, _NEAR * middle)
        named = _named(middle, sure, stamp, bool(matching.all()))
        if named is None and 0 < grain < _TICK * middle:
            sure += grain
            named = _named(middle, sure, stamp, bool(matching.all()))
        if named is not None:
            return named, matching
        if _fills(stamp, middle, sure, matching):
            return Range(middle, ""), matching
    return None


def _named(size: float, sure: float, stamp: NDArray[np.int64], all_match: bool) -> Range | None:
    """The known range that is so large, where stamps stay within it."""
    for one in RANGES:
        if abs(one.size_ns - size) > sure:
            continue
        inside = float(np.mean((stamp >= 0) & (stamp < one.size_ns + 1))) >= _INSIDE
        odd = "bits" in one.name and one.size_ns > _ODD_NS and all_match
        window = all_match and float(np.ptp(stamp)) < one.size_ns + 1
        if inside or odd or (window and stamp.size > 40 and _is_full(stamp, one.size_ns)):
            return one
    return None


def _fills(stamp: NDArray[np.int64], size: float, sure: float, matching: Mask) -> bool:
    """Whether stamps fill an interval of that length, and leave it at none of several falls."""
    several = matching.sum() > 1 and float(matching.mean()) >= _ALIKE
    return bool(several and _is_full(stamp, size) and np.ptp(stamp) <= size + sure)


def _is_full(stamp: NDArray[np.int64], size: float) -> bool:
    """Whether stamps lie all over an interval of that length, not at its ends alone."""
    low, high = np.percentile(stamp, [0.2, 99.8])
    ahead = np.diff(stamp)
    step = float(np.median(ahead[ahead > 0])) if bool(np.any(ahead > 0)) else 0.0
    wide = max(size / max(step, 1.0), 2.0)  # intervals
    bins = min(_BINS, max(min(3, round(wide)), int(0.5 * wide)))  # each wider than one if it can
    everywhere = np.histogram(stamp, bins=bins, range=(float(low), float(high) + 1.0))[0].all()
    return bool(everywhere and 0.9 * (size - step) < float(high - low) <= 1.001 * size)


# ---- ranges of the order of the interval -----------------------------------------------------


def _aliased(series: Series, places: NDArray[np.intp], stamp: NDArray[np.int64]) -> Continuous:
    """A counter that begins anew between most messages: only receipts tell how often."""
    if series.receive is None or stamp.size < 2 * _PIECE:
        return Continuous(series)
    late = (series.receive[places] - stamp).astype(np.float64)
    late -= late[0]
    top = float(stamp.max())
    fitting = [r for r in RANGES if top < r.size_ns < top * (1.0 + 60.0 / stamp.size)]
    fitting = [r for r in fitting if _coherence(late, r.size_ns) > _COHERENT]
    if not fitting or float(stamp.min()) < 0.0:
        return Continuous(series)
    wrap = fitting[0]
    turns = np.round((late - _course(late, wrap.size_ns)) / wrap.size_ns)
    count = int(turns[-1] - turns[0])
    whole = series.stamp.copy()
    whole[places] = stamp + np.round(turns * wrap.size_ns).astype(np.int64)
    times = series.seconds[places]
    fault = _fault(wrap, count, float(times[0]), float(times[-1]))
    evidence = f"stamps begin anew every {in_words(wrap.size_ns / NS)}, oftener than messages come"
    return Continuous(replace(series, stamp=whole), (replace(fault, evidence=evidence),))


def _coherence(late: Array, size: float) -> float:
    """|mean exp(2 pi i late / R)| of short stretches: 1 where lateness is whole ranges."""
    turn = np.exp(2j * np.pi * late / size)
    return float(np.mean([abs(p.mean()) for p in np.array_split(turn, late.size // _PIECE)]))


def _course(late: Array, size: float) -> Array:
    """How lateness within the range moves over the log, continuous [ns]."""
    pieces = np.array_split(np.arange(late.size), late.size // _PIECE)
    angle = np.unwrap([np.angle(np.mean(np.exp(2j * np.pi * late[p] / size))) for p in pieces])
    middle = np.asarray([float(p.mean()) for p in pieces])
    return np.asarray(np.interp(np.arange(late.size), middle, angle) / (2 * np.pi) * size)
