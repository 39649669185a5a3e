"""Constant distances between stamps and receipts that have a name: units, scales, epochs, zones."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

import numpy as np

from syncline_design.auditing.result import StampFault
from syncline_design.auditing.series import NS, UNIX_S, Array, Series, in_words, seconds
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import rounded, signed, to_digits

GPS_EPOCH_S: Final = 315_964_800.0  # 1980-01-06 since 1970
LEAP_S: Final = 18.0  # GPS minus UTC since 2017
TAI_S: Final = 37.0
WEEK_S: Final = 604_800.0
MOST_LATENCY_S: Final = 0.6  # a constant lag up to this is no reason to doubt the epoch
EARLY_S: Final = 0.05  # how far ahead of its receipt a stamp of the right epoch may be
LONGEST_UP_S: Final = 400 * 86_400.0
_SCALES: Final = (
    (TAI_S, "tai", "stamps in TAI, receipts in UTC: 37 leap seconds"),
    (-TAI_S, "tai", "stamps in UTC, receipts in TAI: 37 leap seconds"),
    (LEAP_S, "gps", "stamps in GPS time, receipts in UTC: 18 leap seconds"),
    (-LEAP_S, "gps", "stamps in UTC, receipts in GPS time: 18 leap seconds"),
    (TAI_S - LEAP_S, "tai_gps", "stamps in TAI, receipts in GPS time: 19 s"),
    (LEAP_S - TAI_S, "tai_gps", "stamps in GPS time, receipts in TAI: 19 s"),
    (TAI_S - 1.0, "tai", "stamps in TAI by 36 leap seconds, as they were from July 2015 to 2016"),
    (1.0 - TAI_S, "tai", "receipts in TAI by 36 leap seconds, as they were from July 2015 to 2016"),
    (LEAP_S - 1.0, "gps", "stamps in GPS time by 17 leap seconds, those of July 2015 to 2016"),
    (1.0 - LEAP_S, "gps", "receipts in GPS time by 17 leap seconds, those of July 2015 to 2016"),
)
_EPOCHS: Final = (
    (-GPS_EPOCH_S, "gps_epoch", "stamps count from 1980-01-06, receipts from 1970"),
    (-1e9 - GPS_EPOCH_S, "adjusted_gps", "stamps are GPS seconds less 1e9"),
    (2_208_988_800.0, "ntp_epoch", "stamps count from 1900, receipts from 1970"),
    (
        -1024 * WEEK_S,
        "week_rollover",
        "stamps are 1024 GPS weeks back: a rollover",
    ),
    (-2048 * WEEK_S, "week_rollover", "stamps are 2048 GPS weeks back"),
)
DAY_S: Final = 86_400.0
_QUARTER_S: Final = 900.0  # zones are multiples of it
# what is counted from, on the clock of UTC or of GPS (a week begins on Sunday, 1970 on a Thursday)
_COUNTED: Final = (
    (WEEK_S, ("gps",), "week_seconds", "stamps are seconds of the GPS week"),
    (DAY_S, ("utc", "gps"), "day_seconds", "stamps are seconds of the day"),
    (3600.0, ("utc", "gps"), "hour_seconds", "stamps are seconds of the hour"),
)
_TELLING: Final = 2  # messages: one alone may be old
_FEW_FALLS: Final = 3
_SLOWEST, _FASTEST = 0.98, 1.02  # no clock runs so: counts of another unit
_LEAST_FOR_A_RATE: Final = 40  # messages: a slip within fewer looks as another rate
_STEADY: Final = 0.005  # how alike the rates of short and long stretches are
# ticks that are taken for others: 1/1024 s, 2^-20 s, hundredths, ten thousandths, minutes
_FACTORS: Final = tuple(sorted({
    one for value in (1.024, 2.0**20 / 1e6, 2.0**30 / 1e9, 10.0, 100.0, 1e4, 1e5, 1e7, 60.0, 3600.0)
    for one in (value, 1.0 / value)
}))  # fmt: skip
_YEAR_S: Final = 365.25 * 86_400.0
LARGE_SLIP_S: Final = 15.0  # from here on another epoch, no pulse of the wrong second
_WHOLE_LATENCY_S: Final = 0.1  # of a stream that is whole seconds off


@dataclass(frozen=True, slots=True)
class InSeconds:
    """A series whose stamps run like its receipts; step_ns: what one count of the file is."""

    series: Series
    fault: StampFault | None
    step_ns: float
    rate: float | None  # of stamps against receipts, once in one unit


def in_one_unit(series: Series, known: float = 1.0) -> InSeconds:
    """Stamps that run a power of a thousand too fast or too slow, in their right unit.

    known: a factor that the reader divided by, as 64 bits did not hold the figures.  Stamps that
    run some per cent too fast count something else than seconds as well: no clock drifts so far.
    """
    ratio = _rate(series)
    factor = 1.0 if ratio is None or ratio <= 0.0 else _factor(series, ratio)
    if factor == 1.0 and known == 1.0:
        return InSeconds(series, None, 1.0, ratio)
    if abs(factor * known - 1.0) < 1e-9:
        return _of_far_years(series, known, ratio)
    good = series.good
    stamp = series.stamp.copy()
    if factor >= 10.0 and float(factor).is_integer():
        stamp[good] = stamp[good] // round(factor)
    elif factor <= 0.1 and abs(1.0 / factor - round(1.0 / factor)) < 1e-9:
        stamp[good] = stamp[good] * round(1.0 / factor)
    elif factor != 1.0:
        stamp[good] = np.round(stamp[good].astype(np.longdouble) / factor).astype(np.int64)
    whole = factor * known
    runs = to_digits((ratio or 1.0) * known, 7)
    fault = StampFault(
        "epoch_offset", {"kind": "unit", "factor": whole}, None, None,
        f"stamps run {runs} times as fast as receipts: {_unit_words(whole)}",
    )  # fmt: skip
    rate = None if ratio is None else ratio / factor
    return InSeconds(replace(series, stamp=stamp), fault, max(1.0, float(round(1.0 / whole))), rate)


def _of_far_years(series: Series, known: float, ratio: float | None) -> InSeconds:
    """Stamps in the right unit that 64 bits of nanoseconds do not hold: no clock is so far off.

    They are put to where the receipts begin, as no other epoch can be told.
    """
    assert series.receive is not None  # nothing else tells a rate
    good, stamp = series.good, series.stamp.copy()
    first = int(np.flatnonzero(good)[0])
    begins, received = int(stamp[first]), int(series.receive[first])
    stamp[good] = (stamp[good] - begins) * round(known) + received
    ahead = float(begins) * known / NS - received / NS
    fault = StampFault(
        "epoch_offset", {"kind": "unknown", "seconds": ahead}, None, None,
        f"stamps are {to_digits(abs(ahead) / _YEAR_S, 4)} years "
        f"{'after' if ahead > 0 else 'before'} their receipts: no time of any calendar",
    )  # fmt: skip
    return InSeconds(replace(series, stamp=stamp), fault, float(round(known)), 1.0)


def _factor(series: Series, ratio: float) -> float:
    """What stamps are to be divided by so that they run like receipts; 1 where they do."""
    power = round(math.log10(ratio) / 3.0)
    if power and abs(power) <= 3 and abs(math.log10(ratio) - 3 * power) < 0.05:
        return float(10.0 ** (3 * power))
    if _SLOWEST < ratio < _FASTEST or not 1e-10 < ratio < 1e10:
        return 1.0
    if series.good.sum() < _LEAST_FOR_A_RATE:
        return 1.0
    rates = _rates(series)
    if len(rates) < 2 or max(rates) > (1.0 + _STEADY) * min(rates):
        return 1.0
    if min(rates) < _FASTEST and max(rates) > _SLOWEST:
        return 1.0
    near = [one for one in _FACTORS if abs(rates[-1] / one - 1.0) < _STEADY]
    return near[0] if near else rounded(rates[-1], 5)


def _unit_words(factor: float) -> str:
    power = math.log10(factor) / 3.0
    if abs(power - round(power)) > 1e-6:
        return "they count another unit than the one that was read"
    names = {-3: "seconds read as nanoseconds", -2: "milliseconds read as nanoseconds, or the like",
             -1: "a unit a thousand times too small was read"}  # fmt: skip
    return names.get(round(power), f"a unit {to_digits(factor, 1)} times too large was read")


def _rate(series: Series) -> float | None:
    """How fast stamps run against receipts: median over pairs about a second, else half a log."""
    if series.receive is None or series.good.sum() < 4:
        return None
    best: float | None = None
    size = int(series.good.sum())
    for lag in (_lag_of(series, 1.0), size // 2):
        pairs = _pairs(series, lag)
        if pairs is None:
            continue
        counted, passed = pairs
        best = float(np.median(counted / passed))
        if abs(float(np.median(counted))) >= 50.0 and passed.max() > 2e8:
            return best
    return best


def _rates(series: Series) -> list[float]:
    """The same over stretches of a second, of five, of a quarter and of half of the log."""
    size = int(series.good.sum())
    lags = {_lag_of(series, 1.0), _lag_of(series, 5.0), size // 4, size // 2}
    found = [pairs for lag in sorted(lags) if (pairs := _pairs(series, lag)) is not None]
    return [float(np.median(counted / passed)) for counted, passed in found]


def _lag_of(series: Series, stretch_s: float) -> int:
    """Messages of so many seconds; fewer where stamps fall all the time, as a counter's do."""
    places = series.places()
    assert series.receive is not None
    whole = float(series.receive[places[-1]] - series.receive[places[0]])
    lag = int(places.size * min(0.5, stretch_s * NS / whole)) if whole > 0.0 else 1
    falls = int(np.sum(np.diff(series.stamp[places]) < 0))
    return max(1, min(lag, places.size // (2 * falls + 2)) if falls > _FEW_FALLS else lag)


def _pairs(series: Series, lag: int) -> tuple[Array, Array] | None:
    """(counted by stamps, passed by receipts) [ns] of messages so far apart, stamps never falling
    between them; None where these are few."""
    places = series.places()
    assert series.receive is not None
    stamp, receive = series.stamp[places], series.receive[places]
    if not 0 < lag < places.size:
        return None
    falls = np.concatenate([[0], np.cumsum(np.diff(stamp) < 0)])
    passed = (receive[lag:] - receive[:-lag]).astype(np.float64)
    use = (passed > 0) & (falls[lag:] == falls[:-lag])
    if use.sum() < max(1, 0.05 * use.size):
        use = passed > 0
    if not use.any():
        return None
    counted = (stamp[lag:] - stamp[:-lag]).astype(np.float64)
    return counted[use], passed[use]


def epoch_fault(series: Series) -> StampFault | None:
    """The name of a constant distance, None where it may be latency or is not known."""
    if series.receive is None or not series.good.any():
        return None
    stamp, receive = series.stamp[series.good], series.receive[series.good]
    ahead = seconds(stamp - receive)
    middle = float(np.median(ahead))
    found = _scale(middle) or _zone(middle) or _far(stamp, receive, middle)
    if found is None:
        return None
    shift, kind, words = found
    if middle < 0.0 and stamp.size < _TELLING and kind in ("time_zone", "unknown"):
        return None  # a latched message may be of long before the recording
    return StampFault("epoch_offset", {"seconds": shift, "kind": kind}, None, None,
                      f"stamps are {_spoken(middle)} their receipts: {words}")  # fmt: skip


def _spoken(ahead_s: float) -> str:
    """`37.004 s behind`, never with an exponent."""
    return f"{in_words(abs(ahead_s))} {'before' if ahead_s < 0 else 'after'}"


def constant_fault(series: Series, known_s: float) -> StampFault | None:
    """A constant lag or lead that no transport has and no epoch explains.

    Whole seconds below 15, with a latency below 0.1 s beside: the pulse of another second.  Else a
    lag beyond 0.6 s is a clock of its own, or a latency that `diagnose` tells from it.
    """
    if series.receive is None or not series.good.any():
        return None
    late = seconds((series.receive - series.stamp)[series.good]) + known_s
    least = float(np.percentile(late, 1.0))
    if least > 0.0 and late.size < _TELLING:
        return None
    whole = math.floor(least + 1e-4)
    apart = in_words(abs(least - whole))
    if 0 < abs(whole) < LARGE_SLIP_S and least - whole < _WHOLE_LATENCY_S:
        side = "before" if whole > 0 else "after"
        return StampFault(
            "whole_second_slip", {"seconds": float(-whole), "count": float(late.size)}, None, None,
            f"every stamp lies {abs(whole)} s {side} its receipt, but for {apart}",
        )  # fmt: skip
    if least <= MOST_LATENCY_S:
        return None
    return StampFault(
        "epoch_offset", {"seconds": -least, "kind": "unknown"}, None, None,
        f"even the fastest receipts come {in_words(least)} after their stamps: more than transport "
        "takes, a clock that was set wrong or a latency to be known",
    )  # fmt: skip


def _fits(middle: float, shift: float, late: float = MOST_LATENCY_S) -> bool:
    return shift - late <= middle <= shift + EARLY_S


def _scale(middle: float) -> tuple[float, str, str] | None:
    for shift, kind, words in _SCALES:
        if _fits(middle, shift):
            return shift, kind, words
    return None


def _zone(middle: float) -> tuple[float, str, str] | None:
    """Hours of a time zone: multiples of a quarter of an hour, up to 14 h; leap seconds besides."""
    if not 800.0 < abs(middle) < 50_500.0:
        return None
    for extra in (0.0, TAI_S, LEAP_S, -TAI_S, -LEAP_S):
        quarters = round((middle - extra) / 900.0)
        if quarters and _fits(middle, quarters * 900.0 + extra, 2.0):
            words = f"{signed(quarters / 4)} h: local time against UTC"
            if extra:
                words += f", and {signed(extra)} leap seconds"
            return quarters * 900.0 + extra, "time_zone", words
    return None


def _far(
    stamp: np.ndarray, receive: np.ndarray, middle: float
) -> tuple[float, str, str] | None:  # fmt: skip
    """Another epoch: counted from something else than 1970, or from the device's start."""
    if abs(middle) < 60.0:
        return None
    if float(np.median(receive)) / NS < UNIX_S:
        return None  # the recorder has no calendar: nothing to hold stamps against
    for shift, kind, words in _EPOCHS:
        for leap in (0.0, LEAP_S):
            if _fits(middle, shift + leap, 2.0):
                return shift + leap, kind, words
    counted = _counted(stamp, receive)
    if counted is not None:
        return middle, *counted
    if int(stamp.min()) >= 0 and float(stamp.max()) / NS < LONGEST_UP_S:
        return middle, "boot", "stamps count since the device's start"
    return middle, "unknown", "no epoch that is known: a clock that was never set?"


def _counted(stamp: np.ndarray, receive: np.ndarray) -> tuple[str, str] | None:
    since = {"gps": seconds(receive) - GPS_EPOCH_S + LEAP_S, "utc": seconds(receive)}
    for period, clocks, kind, words in _COUNTED:
        if float(stamp.max()) / NS >= 1.2 * period or stamp.min() < 0:
            continue
        for clock in clocks:
            off = (seconds(stamp) - since[clock] + period / 2) % period - period / 2
            if _fits(float(np.median(off)), 0.0, 1.0):
                return kind, words
    return _local_day(stamp, receive)


def _local_day(stamp: np.ndarray, receive: np.ndarray) -> tuple[str, str] | None:
    """Seconds of the day of a time zone."""
    if float(stamp.max()) / NS >= 1.2 * DAY_S or stamp.min() < 0:
        return None
    off = float(np.median((seconds(stamp) - seconds(receive)) % DAY_S))
    quarters = round((off + 0.5 * MOST_LATENCY_S) / _QUARTER_S)
    if not _fits(off, quarters * _QUARTER_S):
        return None
    hours = (quarters / 4 + 12.0) % 24.0 - 12.0
    return (
        "day_seconds",
        f"stamps are seconds of the day of a time zone, {signed(hours)} h from UTC",
    )
