"""u-blox messages: layouts of those that measure, their times, and the GPS week of the others.

Layouts by u-blox's interface descriptions (protocol versions 15 to 33).  iTOW is milliseconds of
the GPS week of the epoch, rounded; `nano` and `fTOW` hold what was rounded away.
"""

from __future__ import annotations

from datetime import date
from typing import Any

import numpy as np
from numpy.typing import NDArray

from syncline_design.logs.readers.epochs import (
    NANO,
    UNIX_DAY,
    WEEK_NS,
    gps_minus_utc_s,
    week_start_ns,
)
from syncline_design.logs.readers.stream import UNSET

MS = 1_000_000
FULL_DAY_AND_TIME = 0b11  # of `valid`: validDate and validTime
_UTC = [
    ("year", "<u2"),
    ("month", "u1"),
    ("day", "u1"),
    ("hour", "u1"),
    ("min", "u1"),
    ("sec", "u1"),
]
_LLH = [("lon", "<i4"), ("lat", "<i4"), ("height", "<i4"), ("hMSL", "<i4")]
_ACC = [("hAcc", "<u4"), ("vAcc", "<u4")]
_NED = [("velN", "<i4"), ("velE", "<i4"), ("velD", "<i4")]
_ATT = [("roll", "<i4"), ("pitch", "<i4"), ("heading", "<i4")]
_INS = [(f"{a}{k}", "<i4") for k in ("AngRate", "Accel") for a in "xyz"]
_TOW = ("iTOW", "<u4")
Fields = list[tuple[str, str]]


def _pad(name: str, size: int) -> tuple[str, str]:
    return (name, f"S{size}")


LAYOUTS: dict[bytes, tuple[str, Fields]] = {
    b"\x01\x07": (
        "NAV-PVT",
        [_TOW, *_UTC, ("valid", "u1"), ("tAcc", "<u4"), ("nano", "<i4"), ("fixType", "u1"),
         ("flags", "u1"), ("flags2", "u1"), ("numSV", "u1"), *_LLH, *_ACC, *_NED,
         ("gSpeed", "<i4"), ("headMot", "<i4"), ("sAcc", "<u4")],
    ),
    b"\x01\x17": (
        "NAV-PVAT",
        [_TOW, _pad("r0", 1), ("valid", "u1"), *_UTC, _pad("r1", 3), ("tAcc", "<u4"),
         ("nano", "<i4"), ("fixType", "u1"), ("flags", "u1"), ("flags2", "u1"), ("numSV", "u1"),
         *_LLH, *_ACC, *_NED, ("gSpeed", "<i4"), ("sAcc", "<u4"), *_ATT],
    ),
    b"\x28\x00": (
        "HNR-PVT",
        [_TOW, *_UTC, ("valid", "u1"), ("nano", "<i4"), ("fixType", "u1"), ("flags", "u1"),
         _pad("r1", 2), *_LLH, ("gSpeed", "<i4"), ("speed", "<i4"), ("headMot", "<i4"),
         ("headVeh", "<i4"), *_ACC, ("sAcc", "<u4")],
    ),
    b"\x01\x05": ("NAV-ATT", [_TOW, _pad("r0", 4), *_ATT]),
    b"\x28\x01": ("HNR-ATT", [_TOW, _pad("r0", 4), *_ATT]),
    b"\x01\x02": ("NAV-POSLLH", [_TOW, *_LLH, *_ACC]),
    b"\x01\x12": ("NAV-VELNED", [_TOW, *_NED]),
    b"\x01\x14": (
        "NAV-HPPOSLLH",
        [_pad("r0", 3), ("flags", "u1"), _TOW, *_LLH, ("lonHp", "i1"), ("latHp", "i1"),
         ("heightHp", "i1"), ("hMSLHp", "i1"), *_ACC],
    ),
    b"\x01\x20": (
        "NAV-TIMEGPS",
        [_TOW, ("fTOW", "<i4"), ("week", "<i2"), ("leapS", "i1"), ("valid", "u1"), ("tAcc", "<u4")],
    ),
    b"\x01\x21": (
        "NAV-TIMEUTC", [_TOW, ("tAcc", "<u4"), ("nano", "<i4"), *_UTC, ("validflags", "u1")]
    ),
    b"\x01\x06": ("NAV-SOL", [_TOW, ("fTOW", "<i4"), ("week", "<i2"), ("fixType", "u1")]),
    b"\x10\x15": ("ESF-INS", [("flags", "<u4"), _pad("r0", 4), _TOW, *_INS]),
    b"\x28\x02": ("HNR-INS", [("flags", "<u4"), _pad("r0", 4), _TOW, *_INS]),
    b"\x02\x10": ("RXM-RAW", [("iTOW", "<i4"), ("week", "<i2")]),
    b"\x02\x15": ("RXM-RAWX", [("rcvTow", "<f8"), ("week", "<u2"), ("leapS", "i1")]),
    b"\x10\x02": ("ESF-MEAS", [("timeTag", "<u4"), ("flags", "<u2"), ("id", "<u2")]),
    b"\x10\x03": ("ESF-RAW", [_pad("r0", 4)]),
}  # fmt: skip
DTYPES = {key: (name, np.dtype(fields)) for key, (name, fields) in LAYOUTS.items()}
SCALES = {"lon": 1e-7, "lat": 1e-7, "roll": 1e-5, "pitch": 1e-5, "heading": 1e-5}
NAMES = {
    **{"lat": "latitude_deg", "lon": "longitude_deg", "height": "height_m"},
    **{"hMSL": "height_msl_m", "velN": "velocity_north_mps", "velE": "velocity_east_mps"},
    **{"velD": "velocity_down_mps", "roll": "roll_deg", "pitch": "pitch_deg"},
    **{"heading": "yaw_deg", "hAcc": "sigma_horizontal_m", "vAcc": "sigma_up_m"},
    **{"sAcc": "sigma_speed_mps", "numSV": "satellites", "fixType": "fix_type", "flags": "flags"},
}
MILLIMETRES = frozenset(
    ("height", "hMSL", "velN", "velE", "velD", "hAcc", "vAcc", "sAcc")  # mm and mm/s
)
TENTH_MM = frozenset({"hAcc", "vAcc"})  # of NAV-HPPOSLLH


def quantity_of(name: str) -> tuple[str, ...]:
    """What a message measures."""
    found = next((fields for own, fields in LAYOUTS.values() if own == name), [])
    names = {field for field, _ in found}
    said = (("position", "lat"), ("velocity", "velN"), ("attitude", "roll"), ("rate", "xAngRate"))
    return tuple(what for what, field in said if field in names)


def rows_of(key: bytes, payloads: list[bytes]) -> NDArray[Any] | None:
    """The beginnings of messages as rows; None where the layout is not known or one is short."""
    if key not in DTYPES:
        return None
    dtype = DTYPES[key][1]
    size = dtype.itemsize
    if any(len(payload) < size for payload in payloads):
        return None
    rows: NDArray[Any] = np.frombuffer(b"".join(p[:size] for p in payloads), dtype=dtype)
    return rows


def columns_of(name: str, rows: NDArray[Any]) -> dict[str, NDArray[Any]]:
    """Figures in the names of the contract."""
    columns: dict[str, NDArray[Any]] = {}
    fields = rows.dtype.names or ()
    for field in fields:
        if field not in NAMES:
            continue
        per = round(1 / SCALES[field]) if field in SCALES else 1000 if field in MILLIMETRES else 1
        if name == "NAV-HPPOSLLH" and field in TENTH_MM:
            per = 10_000
        columns[NAMES[field]] = rows[field] / per
    if "latHp" in fields:
        for field, own, fine in (("lat", "latitude_deg", 1e9), ("lon", "longitude_deg", 1e9)):
            columns[own] = (rows[field].astype(np.int64) * 100 + rows[f"{field}Hp"]) / fine
        for field, own in (("height", "height_m"), ("hMSL", "height_msl_m")):
            columns[own] = (rows[field].astype(np.int64) * 10 + rows[f"{field}Hp"]) / 1e4
    if "height" in fields and "hMSL" in fields:
        columns["separation_m"] = columns["height_m"] - columns["height_msl_m"]
    if "xAngRate" in fields:
        for a in "xyz":
            columns[f"rate_{a}_degps"] = rows[f"{a}AngRate"] / 1e3
            columns[f"acceleration_{a}_mps2"] = rows[f"{a}Accel"] / 1e2
    return columns


class WeekClock:
    """The GPS week of times of the week: that nearest to the last message that said one."""

    def __init__(self, first_ns: int | None) -> None:
        self.at = first_ns
        self.leaps_wrong: int | None = None

    def moment(self, key: bytes, row: NDArray[Any] | None, tow_ns: int) -> int:
        """A time of the week as `gps` counts, or from the week's start where no week is known."""
        said = said_moment(key, row, tow_ns) if row is not None else None
        if said is not None:
            self.at = said
        elif self.at is not None:
            start = self.at - (self.at - week_start_ns(0)) % WEEK_NS
            same = start + tow_ns
            self.at = same + WEEK_NS * round((self.at - same) / WEEK_NS)
        return tow_ns if self.at is None else self.at


def said_moment(key: bytes, row: Any, tow_ns: int) -> int | None:
    """What a message that says its week, or its day in UTC, says of a time of the week."""
    names = row.dtype.names or ()
    if "week" in names:
        if int(row["week"]) <= 0 or ("valid" in names and not int(row["valid"]) & 0b10):
            return None
        return week_start_ns(int(row["week"])) + tow_ns
    utc = utc_ns(row)
    if utc is None:
        return None
    gps = utc + gps_minus_utc_s(utc) * NANO
    start = gps - (gps - week_start_ns(0)) % WEEK_NS
    same = start + tow_ns
    return same + WEEK_NS * round((gps - same) / WEEK_NS)


def utc_ns(row: Any) -> int | None:
    """The UTC of a message that says it and calls it valid; `nano` may be negative."""
    names = row.dtype.names or ()
    if "year" not in names:
        return None
    mask = 0b100 if "validflags" in names else FULL_DAY_AND_TIME
    if int(row["validflags" if "validflags" in names else "valid"]) & mask != mask:
        return None
    year, month, day, hour, minute, second = (int(row[n]) for n, _ in _UTC)
    try:
        days = date(year, month, day).toordinal() - UNIX_DAY
    except ValueError:
        return None
    if hour > 23 or minute > 59 or second > 60:
        return None
    seconds = days * 86_400 + hour * 3600 + minute * 60 + second
    return seconds * NANO + int(row["nano"])


def tow_ns(key: bytes, row: Any) -> int:
    """The time of the week of a message with all its digits; UNSET where it has none."""
    names = row.dtype.names or ()
    if "rcvTow" in names:
        tow = float(row["rcvTow"])
        return round(tow * NANO) if 0 <= tow < 604_801 else UNSET
    if "iTOW" not in names:
        return UNSET
    tow_ms = int(row["iTOW"])
    if not 0 <= tow_ms <= 604_800_000:
        return UNSET
    rest = 0
    if "fTOW" in names and abs(int(row["fTOW"])) < MS:
        rest = int(row["fTOW"])
    elif "nano" in names and utc_ns(row) is not None:
        rest = _taken_away(tow_ms * MS, int(row["nano"]))
    return tow_ms * MS + rest


def _taken_away(tow_ns: int, nano: int) -> int:
    """What iTOW lacks of the moment [ns], whether it was rounded to a millisecond or cut off there.

    UTC and the time of the week differ by whole seconds, so that `nano` tells the fraction.  Of a
    fraction that is further off only the digits below a millisecond count.
    """
    apart = (nano - tow_ns + NANO // 2) % NANO - NANO // 2
    return apart if abs(apart) <= MS else (nano + MS // 2) % MS - MS // 2
