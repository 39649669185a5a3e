"""Stamps on a grid: cut off to milliseconds and the like, or taken when a packet comes."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from syncline_design.auditing.alternations import FINE, alternates, skips_evenly, turns_of
from syncline_design.auditing.cadence import Cadence, about_rhythm
from syncline_design.auditing.result import Consequence, StampFault
from syncline_design.auditing.series import NS, Array, Series, spread
from syncline_design.auditing.tick_words import Paced, told_by_receipts
from syncline_design.auditing.ticks import ONE_RATE, rates_apart, tick_of
from syncline_design.logs.readers.stream import Nanoseconds
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import to_digits

GRAINS: Final = (
    10**9, 5 * 10**8, 2 * 10**8, 10**8, 5 * 10**7, 2 * 10**7, 15_625_000, 10**7, 5 * 10**6,
    2 * 10**6, 10**6,
)  # fmt: skip
ROUNDING_NS: Final = 600  # of a file that keeps microseconds, or doubles of Unix seconds
_ON_GRID: Final = 0.995  # of all times
TIMERS: Final = (0.016, 0.008, 0.004, 0.005, 0.01, 0.02, 0.0125, 0.025, 0.032, 0.04, 0.05, 0.1)
FTDI_S: Final = 0.016
_MOST_MOMENTS: Final = 200_000
_ALONE: Final = 1.15  # ticks between messages, from which on no two of them share one
_FAR: Final = 5.0  # ticks: what is longer is a gap or a jump
_REACH: Final = 0.6  # of a grain, by receipts
_TURNS: Final = 1.5  # grains
_MOST_OF: Final = 0.9  # of what receipts of one grain lie apart
_HALF: Final = 0.02  # how near to two messages a grain their number is
_WIDEST: Final = 1.3  # of a tick: how far from an even rhythm stamps on ticks are
_STRICT: Final = 0.97
_DISORDER: Final = 0.02  # of all stamps: transport that changes their order
_COHERENT: Final = 0.75
_EXACT: Final = 0.002  # of a tick
_EVEN: Final = 0.1  # of what neighbours are uneven by
_COARSE_STEPS: Final = 3.0
_BUNCHED: Final = 0.25  # share of neighbours that come together
_QUICK_READ_S, _SLOW_READ_S = 4e-4, 2e-3  # that a host takes to read a message of a packet
_EVENLY: Final = 0.2  # of what they are apart
_TOGETHER: Final = 0.1  # of the mean interval


@dataclass(frozen=True, slots=True)
class Grain:
    """Stamps on a grid of so many seconds, as a fault."""

    fault: StampFault
    size_s: float
    explains_duplicates: bool


def grain_of(times: Nanoseconds) -> int:
    """The coarsest grid of a millisecond or more that times lie on [ns]; 0 of finer ones."""
    for grain in GRAINS:
        rest = times % grain
        if float(np.mean(np.minimum(rest, grain - rest) <= ROUNDING_NS)) >= _ON_GRID:
            return grain
    return 0


def truncated(
    series: Series, pace: Cadence, file_step_ns: float, told: Nanoseconds | None = None
) -> Grain | None:
    """All stamps on a grid of a millisecond or more, while the sensor keeps none of it.

    A sensor that measures at exact epochs is on the grid as well, but its intervals are all alike:
    what shows truncation is intervals that alternate between neighbouring places of the grid.
    told: stamps before a counter was made continuous, whose range may be no whole number of grains.
    """
    stamp = series.stamp[pace.places]
    if stamp.size < 20:
        return None
    grain = grain_of(stamp if told is None else told[pace.places])
    if grain <= file_step_ns or not alternates(series, pace, grain) or _ticks(stamp, grain):
        return None
    if _in_bunches(series, pace, grain) or not _shown_by_receipts(series, pace, grain):
        return None
    by = told_by_receipts(series, pace, grain / NS)
    return None if by is not None and (by.followed or by.open) else _grain(series, pace, grain)


def may_be_cut(series: Series, pace: Cadence) -> float:
    """The grid [s] that a sensor whose interval changes may keep, or that may cut off its stamps:
    receipts do not say which; 0 of others."""
    grain = grain_of(series.stamp[pace.places]) if pace.places.size >= 20 else 0
    if not grain or not alternates(series, pace, grain):
        return 0.0
    if _in_bunches(series, pace, grain) or not _shown_by_receipts(series, pace, grain):
        return 0.0
    by = told_by_receipts(series, pace, grain / NS)
    return grain / NS if by is not None and by.open else 0.0


def cut_to_one_interval(series: Series, pace: Cadence) -> float:
    """The coarsest grid [s] of which all intervals are one and the same number of grains; 0 without
    one.  Cut off to it, a sensor's own interval shows only over an edge of the grid."""
    stamp = series.stamp[pace.places]
    passed = np.diff(stamp)
    if passed.size < 2 or int(passed.min()) <= 0:
        return 0.0
    grain = grain_of(stamp)
    usual = int(np.median(passed))
    exact = grain > 0 and usual >= grain and not np.any(passed % usual)
    return grain / NS if exact else 0.0


def without_turns(series: Series, pace: Cadence) -> tuple[Series, float]:
    """The series without the turns of a grid that stamps lie on, whether it cut them off or not,
    nor what these make good for; with what turns may still look like [s], 0 without them."""
    if not pace.places.size:
        return series, 0.0
    grain = grain_of(series.stamp[pace.places])
    turns = turns_of(series, pace, grain)
    if turns is None or not turns.explained:
        return series, 0.0
    stamp = series.stamp.copy()
    stamp[pace.places] += np.round(turns.course * grain).astype(np.int64)
    return replace(series, stamp=stamp), _TURNS * grain / NS


def _shown_by_receipts(series: Series, pace: Cadence, grain: int) -> bool:
    """Whether receipt minus stamp reaches over most of a grain, as what was cut off does.

    Stamps that lie on a grid because their sensor measures there are as late as transport alone.
    """
    if series.receive is None:
        return True
    late = (series.receive - series.stamp)[pace.places].astype(np.float64)
    pieces = np.array_split(late, max(1, min(16, late.size // 40)))
    reach = [float(np.subtract(*np.percentile(piece, [97.0, 3.0]))) for piece in pieces]
    stamp = series.stamp[pace.places]
    heads = max(1, np.count_nonzero(np.diff(stamp)))
    whole = 1.0 - heads / (stamp.size - 1)  # of a grain, by its first and last message, both whole
    if whole >= 0.5 - _HALF and max(reach) > _MOST_OF * whole * grain:
        return True
    return max(reach) > _REACH * grain


def _in_bunches(series: Series, pace: Cadence, grain: int) -> bool:
    """Whether messages of one coarse stamp also come together, and others apart: packets, or
    several messages of one epoch."""
    same = np.diff(series.stamp[pace.places]) == 0
    if float(np.mean(same)) < 0.2:
        return False
    if series.receive is None:
        return grain > FINE
    passed = np.diff(series.receive[pace.places])
    together = float(np.median(passed[same])) < 0.3 * float(passed.mean())
    return together and (grain > FINE or float(np.median(passed[~same])) > 0.5 * grain)


def _ticks(stamp: np.ndarray, grain: int) -> bool:
    """Whether stamps on a grid are in truth ticks of a slower timer, such as 16 ms."""
    timers = [round(t * NS) for t in TIMERS if round(t * NS) not in GRAINS]
    return any(t > grain and not np.any((stamp - stamp[0]) % t) for t in timers)


def _strictly(counts: Array) -> bool:
    """Whether places are left out in one and the same distance: a count, or another rate.

    A beat's distances are two that follow one another, unless both rates are whole multiples.
    """
    apart = np.diff(np.flatnonzero(counts == 2))
    values, often = np.unique(apart, return_counts=True)
    return bool(values.size and often.max() > _STRICT * apart.size)


def _grain(series: Series, pace: Cadence, grain: int) -> Grain:
    stamp = series.stamp[pace.places]
    same = int(np.sum(np.diff(stamp) == 0))
    same = same if _share_ticks(np.diff(stamp).astype(np.float64), grain) else 0
    twice = Consequence("duplicates", {"count": float(same)},
                        f"{same} messages within the resolution of the one before")  # fmt: skip
    size = grain / NS
    name = " (1/64 s, the tick of a system clock)" if grain == 15_625_000 else ""
    fault = StampFault(
        "truncated_stamps", {"resolution_s": size}, None, None,
        f"every stamp is a multiple of {to_digits(size * 1e3, 6)} ms{name}, though messages are "
        f"not: up to that far off, which is in `as_recorded` alone",
        (twice,) if same else (),
    )  # fmt: skip
    return Grain(fault, size, same > 0)


def _share_ticks(interval: Array, tick: float) -> bool:
    """Whether two messages may carry one tick; where they come less often equal stamps are
    repeated ones."""
    return float(np.mean(np.clip(interval, 0.0, _FAR * tick))) < _ALONE * tick


def packetised(
    series: Series, pace: Cadence, file_step_ns: float = 1.0, told: Paced | None = None
) -> Grain | None:
    """Stamps that come in bunches, or on the grid of a timer with a phase of its own.

    Without receipts only of the one timer that no scheduler has: a task of a flight controller
    stamps at its own ticks and is right.
    """
    stamp = series.stamp[pace.places]
    if stamp.size < 40:
        return None
    found = _packetised(series, pace, stamp)
    if found is None and told is not None and told.sure:
        found = _on_ticks(series, pace, told)
    if found is not None and found.size_s * NS < _COARSE_STEPS * file_step_ns:
        return None  # ticks of what the file keeps
    known = found is not None and found.size_s == FTDI_S
    return found if series.receive is not None or known else None


def _on_ticks(series: Series, pace: Cadence, told: Paced) -> Grain:
    """Messages of a sensor whose rhythm waits for ticks of any length."""
    size = max(1.0, told.tick_s / told.period_s)
    return _packets(series, pace.interval, told.tick_s, True, size, pace)


def _packetised(series: Series, pace: Cadence, stamp: np.ndarray) -> Grain | None:
    when = (stamp - stamp[0]) / NS
    interval = np.diff(when)
    mean = float(when[-1]) / (when.size - 1)
    if mean <= 0.0 or float(np.mean(interval < 0.0)) > _DISORDER:
        return None
    together = interval < _TOGETHER * mean
    bunched = float(np.mean(together))
    if bunched >= _BUNCHED:
        return _bunches(series, when, interval, together, pace)
    found = _timer(series, when, interval, pace)
    tick = tick_of(series, pace.places) if found is None else None
    found = found if tick is None else _packets(series, interval, tick, True, 1.0, pace)
    if found is None or found.size_s == FTDI_S:
        return found
    return None if rates_apart(interval, found.size_s) > ONE_RATE else found  # pings as it likes


def _bunches(
    series: Series, when: Array, interval: Array, together: np.ndarray, pace: Cadence
) -> Grain | None:
    heads = when[np.concatenate([[True], ~together])]
    apart = np.diff(heads)
    if apart.size < 20 or _measured_apart(interval[together]):
        return None
    sizes = np.diff(np.flatnonzero(np.concatenate([[True], ~together])))
    size, often = np.unique(sizes, return_counts=True)
    constant = often.max() > 0.97 * sizes.size
    timer = best_timer(heads)
    if timer is None and (sizes.mean() < 1.8 or spread(apart) > 0.5 * np.median(apart)):
        return None  # messages that wait for one another
    usual = int(size[int(np.argmax(often))])
    alike = float(np.mean(interval[together] == 0.0)) > 0.9
    if constant and usual == 2 and not alike and timer not in (0.016, 0.008, 0.004):
        return None  # pairs, as designed
    middle = float(np.median(apart))
    # packets that always come so far apart are no ticks of a part of it: none is ever empty
    other = timer is not None and spread(apart) < 0.02 * middle and middle > 1.01 * timer
    grid = middle if timer is None or other else timer
    sure = timer is not None and not other
    return _packets(series, interval, grid, sure, float(sizes.mean()), pace)


def _measured_apart(within: Array) -> bool:
    """Whether messages of a bunch are as far apart as a sensor measures that does so in bursts.

    What a packet holds is handed over at once: reading it takes a message far less than a frame of
    USB, and a time of its own each.
    """
    usual = float(np.median(within))
    evenly = spread(within) < _EVENLY * usual
    return usual > _SLOW_READ_S or (evenly and usual > _QUICK_READ_S)


def _timer(series: Series, when: Array, interval: Array, pace: Cadence) -> Grain | None:
    """A slow stream: every stamp is a tick of the timer, its intervals alternate."""
    about = about_rhythm(when)
    neighbours = interval[np.diff(pace.places) == 1]
    if np.ptp(neighbours) < 0.25 * min(TIMERS):
        return None  # of one length: no sensor that a timer delays
    beat = _beat(pace, interval)
    if beat is not None:
        return _packets(series, interval, beat, True, 1.0, pace)
    if about is None:
        known = _of_ftdi(when, interval, neighbours)
        return _packets(series, interval, FTDI_S, True, 1.0, pace) if known else None
    usual = float(np.median(interval[interval > 0.0]))
    period = float(interval[interval < 2.5 * usual].mean())
    uneven = float(np.percentile(about, 95) - np.percentile(about, 5))
    if uneven < 0.5 * min(TIMERS):
        return None
    timer = best_timer(when)
    if timer is not None and abs(usual / timer - 1.0) < 0.002:
        return None  # the rhythm itself, with messages left out
    if timer is None or timer > 1.5 * period or not 0.5 < uneven / timer < _WIDEST:
        return None
    if _in_turn(when, period) and not (timer == FTDI_S and _exactly(interval, timer)):
        return None  # publishers in turn, or a sensor that measures in turn, near some ticks
    return _packets(series, interval, timer, True, 1.0, pace)


def _of_ftdi(when: Array, interval: Array, neighbours: Array) -> bool:
    """Whether most intervals are one of two numbers of the known timer's ticks, be one far rarer:
    no rhythm is seen about such stamps."""
    low, high = np.percentile(neighbours, [5.0, 95.0])
    alternate = abs(float(high - low) / FTDI_S - 1.0) < _TOGETHER
    return alternate and best_timer(when) == FTDI_S and _exactly(interval, FTDI_S)


def _in_turn(when: Array, period: float) -> bool:
    """Whether every second, third or fourth stamp comes evenly though neighbours do not."""
    scattered = spread(np.diff(when))
    even = [spread(when[lag:] - when[:-lag]) for lag in (2, 3, 4)]
    return min(even) < _EVEN * min(scattered, period)


def _exactly(interval: Array, timer: float) -> bool:
    """Whether intervals are whole ticks, to what those of one kind scatter by."""
    off = np.abs(interval - np.round(interval / timer) * timer)
    alike = min(spread(interval[::2]), spread(interval[::3]), spread(interval[::4]))
    return float(np.median(off)) < _EXACT * timer + alike


def _beat(pace: Cadence, interval: Array) -> float | None:
    """The timer of a sensor that is a little slower than it: now and then a tick stays empty."""
    interval = interval[np.diff(pace.places) == 1]
    for timer in TIMERS:
        counts = np.round(interval / timer)
        one = interval[counts == 1]
        if one.size < 0.5 * interval.size or abs(float(np.median(one)) / timer - 1.0) > 0.002:
            continue
        two = interval[counts == 2]
        if two.size and abs(float(np.median(two)) / (2.0 * timer) - 1.0) > 0.002:
            continue  # ticks of a part of this one
        if np.count_nonzero(counts == 0) > 0.5 * two.size:
            return None  # stamps that came twice: no tick was left out
        known = timer == FTDI_S  # no sensor measures so often
        return timer if skips_evenly(counts) and (known or not _strictly(counts)) else None
    return None


def best_timer(when: Array) -> float | None:
    """The timer that all moments are ticks of; the longest of those that fit best."""
    return next(iter(timers(when)), None)


def timers(when: Array) -> tuple[float, ...]:
    """Those that all moments are ticks of, fitting about as well, the longest first."""
    when = when[:_MOST_MOMENTS]
    fits = {t: _coherence(when, t) for t in TIMERS}
    best = max(fits.values())
    if best < _COHERENT:
        return ()
    return tuple(sorted((t for t, c in fits.items() if c > best - 0.03), reverse=True))


def _coherence(when: Array, period: float) -> float:
    """|mean exp(2 pi i t / T)|: 1 where all moments are ticks of T; the best of short stretches,
    for a timer that drifts."""
    turns = np.exp(2j * np.pi * (when / period))
    pieces = np.array_split(turns, max(1, min(8, turns.size // 40)))
    return float(np.mean([abs(np.mean(piece)) for piece in pieces]))


def _packets(
    series: Series, interval: Array, grid: float, sure: bool, size: float, pace: Cadence
) -> Grain:
    same = int(np.sum(interval == 0.0)) if _share_ticks(interval, grid) else 0
    twice = Consequence("duplicates", {"count": float(same)},
                        f"{same} messages share their packet's stamp")  # fmt: skip
    known = " (the latency timer of FTDI's serial chips)" if abs(grid - 0.016) < 1e-5 else ""
    words = f"stamps are ticks of {to_digits(grid * 1e3, 4)} ms{known}" if sure else (
        f"stamps come in bunches, {to_digits(grid * 1e3, 4)} ms apart in the median")  # fmt: skip
    if size > 1.05:
        words += f", {to_digits(size, 3)} messages to a packet"
    fault = StampFault("packetised", {"interval_s": grid}, None, None, words,
                       (twice,) if same else ())  # fmt: skip
    return Grain(fault, grid, same > 0)
