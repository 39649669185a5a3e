"""Where timelines count from, and the leap seconds between GPS time and UTC.

Stamps of the timelines `utc`, `gps` and `tai` are nanoseconds since 1970-01-01 00:00 as that
timeline's own calendar reads: a fix of one moment is stamped 18 s later in `gps` than in `utc`
(since 2017), 37 s later in `tai`.  `boot` counts from where the sensor's clock began.  Stamps
without their week or their day are `unknown`; the name of the stamp says from where they count.
"""

from __future__ import annotations

from bisect import bisect_right
from datetime import UTC, date, datetime

import numpy as np

from syncline_design.logs.readers.stream import UNSET, Nanoseconds

NANO = 1_000_000_000
WEEK_S = 604_800
UNIX_DAY = date(1970, 1, 1).toordinal()
DAY_NS = 86_400 * NANO
WEEK_NS = WEEK_S * NANO
GPS_EPOCH_S = 315_964_800  # 1980-01-06 00:00 as a calendar reads it, s since 1970-01-01
ADJUSTED_S = 1_000_000_000  # what LAS takes off GPS seconds
TAI_MINUS_GPS_S = 19  # both atomic, fixed
WEEK_SECONDS = "seconds of the GPS week"  # name of a stamp that lacks its week
DAY_SECONDS = "time of day (UTC)"  # name of a stamp that lacks its date

# When UTC fell behind GPS time by one more second; IERS Bulletin C, RINEX and ICD-GPS-200 agree.
LEAPS = (
    *("1981-07-01", "1982-07-01", "1983-07-01", "1985-07-01", "1988-01-01", "1990-01-01"),
    *("1991-01-01", "1992-07-01", "1993-07-01", "1994-07-01", "1996-01-01", "1997-07-01"),
    *("1999-01-01", "2006-01-01", "2009-01-01", "2012-07-01", "2015-07-01", "2017-01-01"),
)
_LEAPS_UTC_NS = [
    int(datetime.fromisoformat(day).replace(tzinfo=UTC).timestamp()) * NANO for day in LEAPS
]
_LEAPS_GPS_NS = [at + (k + 1) * NANO for k, at in enumerate(_LEAPS_UTC_NS)]


def gps_minus_utc_s(utc_ns: int) -> int:
    """Leap seconds between GPS time and UTC at a moment of UTC [s]."""
    return bisect_right(_LEAPS_UTC_NS, utc_ns)


def gps_to_utc(gps_ns: Nanoseconds) -> Nanoseconds:
    """`gps` stamps as `utc` ones; UNSET stays."""
    leaps = np.searchsorted(np.array(_LEAPS_GPS_NS), gps_ns, side="right")
    utc: Nanoseconds = np.where(gps_ns == UNSET, UNSET, gps_ns - leaps * NANO)
    return utc


def utc_to_gps(utc_ns: Nanoseconds) -> Nanoseconds:
    """`utc` stamps as `gps` ones; UNSET stays."""
    leaps = np.searchsorted(np.array(_LEAPS_UTC_NS), utc_ns, side="right")
    gps: Nanoseconds = np.where(utc_ns == UNSET, UNSET, utc_ns + leaps * NANO)
    return gps


def week_start_ns(week: int) -> int:
    """The start of a GPS week, as `gps` counts."""
    return (GPS_EPOCH_S + week * WEEK_S) * NANO


def held(nanoseconds: int) -> int:
    """Nanoseconds as 64 bits hold them, else UNSET."""
    return nanoseconds if -(2**63) <= nanoseconds < 2**63 else UNSET


def nanoseconds_of(seconds: np.typing.ArrayLike) -> Nanoseconds:
    """Seconds as whole nanoseconds; what is not finite or beyond 64 bits is UNSET."""
    values = np.asarray(seconds, dtype=np.float64)
    with np.errstate(invalid="ignore"):  # of bit patterns that a damaged file holds
        fits = np.isfinite(values) & (np.abs(values) < 9.2e9)
    safe = np.where(fits, values, 0.0)
    whole = np.floor(safe)
    rest = safe - whole  # exact, so that no digit of the file is lost
    found = whole.astype(np.int64) * NANO + np.rint(rest * NANO).astype(np.int64)
    stamps: Nanoseconds = np.where(fits, found, UNSET)
    return stamps
