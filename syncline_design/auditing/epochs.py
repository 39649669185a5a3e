"""Constant distances between stamps and receipts that have a name: units, scales, epochs, zones."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from syncline_design.auditing.result import StampFault
from syncline_design.auditing.series import NS, UNIX_S, Series, seconds

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
_COUNTED: Final = (
    (WEEK_S, "week_seconds", "stamps are seconds of the GPS week"),
    (86_400.0, "day_seconds", "stamps are seconds of the day"),
    (3600.0, "hour_seconds", "stamps are seconds of the hour"),
)


@dataclass(frozen=True, slots=True)
class InSeconds:
    """A series whose stamps run like its receipts; step_ns: what one count of the file is."""

    series: Series
    fault: StampFault | None
    step_ns: float
    rate: float | None  # of stamps against receipts, once in one unit


def in_one_unit(series: Series) -> InSeconds:
    """Stamps that run a power of a thousand too fast or too slow, in their right unit."""
    ratio = _rate(series)
    if ratio is None or ratio <= 0.0:
        return InSeconds(series, None, 1.0, ratio)
    power = round(math.log10(ratio) / 3.0)
    if power == 0 or abs(power) > 3 or abs(math.log10(ratio) - 3 * power) > 0.05:
        return InSeconds(series, None, 1.0, ratio)
    factor = 10.0 ** (3 * power)
    good = series.good
    stamp = series.stamp.copy()
    if power > 0:
        stamp[good] = stamp[good] // round(factor)
    else:
        stamp[good] = stamp[good] * round(1.0 / factor)
    fault = StampFault(
        "epoch_offset", {"kind": "unit", "factor": factor}, None, None,
        f"stamps run {ratio:.6g} times as fast as receipts: {_unit_words(power)}",
    )  # fmt: skip
    return InSeconds(
        replace(series, stamp=stamp), fault, max(1.0, float(round(1.0 / factor))), ratio / factor
    )


def _unit_words(power: int) -> str:
    names = {-3: "seconds read as nanoseconds", -2: "milliseconds read as nanoseconds, or the like",
             -1: "a unit a thousand times too small was read"}  # fmt: skip
    return names.get(power, f"a unit 1e{3 * power} too large was read")


def _rate(series: Series) -> float | None:
    """How fast stamps run against receipts: median over pairs about a second, else half a log."""
    if series.receive is None:
        return None
    places = series.places()
    if places.size < 4:
        return None
    stamp, receive = series.stamp[places], series.receive[places]
    whole = float(receive[-1] - receive[0])
    if whole <= 0.0:
        return None
    near = max(1, int(places.size * min(0.5, NS / whole)))
    best: float | None = None
    for lag in (near, places.size // 2):
        passed = (receive[lag:] - receive[:-lag]).astype(np.float64)
        counted = (stamp[lag:] - stamp[:-lag]).astype(np.float64)
        use = passed > 0
        if not use.any():
            continue
        best = float(np.median(counted[use] / passed[use]))
        if abs(float(np.median(counted[use]))) >= 50.0 and passed[use].max() > 2e8:
            return best
    return best


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
    return StampFault("epoch_offset", {"seconds": shift, "kind": kind}, None, None,
                      f"stamps are {middle:.9g} s from their receipts: {words}")  # fmt: skip


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
            words = f"{quarters / 4:+g} h: local time against UTC"
            if extra:
                words += f", and {extra:+g} leap seconds"
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
    since = (seconds(receive) - GPS_EPOCH_S + LEAP_S, seconds(receive))
    for period, kind, words in _COUNTED:
        if float(stamp.max()) / NS >= 1.2 * period or stamp.min() < 0:
            continue
        for clock in since:
            off = (seconds(stamp) - clock + period / 2) % period - period / 2
            if _fits(float(np.median(off)), 0.0, 1.0):
                return kind, words
    return None
