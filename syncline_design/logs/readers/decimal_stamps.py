"""Times in decimals or of a calendar, to whole nanoseconds without passing through floats.

Seconds since 1970 with nine decimals have 19 digits, a float holds 16: `1403636580.838555648` would
come back 64 ns off.
"""

from __future__ import annotations

import re
from datetime import date
from decimal import Decimal, InvalidOperation
from typing import TYPE_CHECKING

import numpy as np

from syncline_design.logs.cells import ISO, BadCellError
from syncline_design.logs.readers.epochs import DAY_NS, NANO, UNIX_DAY, held
from syncline_design.logs.readers.stream import UNSET, Nanoseconds

if TYPE_CHECKING:
    import polars as pl

PLAIN = r"^\+?(-?)(\d{1,18})(?:[.,](\d{0,9})(\d*))?$"
_ISO = re.compile(ISO)
DIGITS = {"s": 9, "ms": 6, "us": 3, "ns": 0}
MOST = 2**63
_LOOKED_AT = 200  # figures that tell a column's unit
MOST_POWER = 3  # of a thousand: nanoseconds in a column of seconds


def nanoseconds(text: str | bytes, unit: str = "s", power: int = 0) -> int:
    """One figure as nanoseconds over 1000^power, rounded half to even; ValueError where it is none.

    What 64 bits do not hold, and what is not finite, is `UNSET`.
    """
    written = (text if isinstance(text, str) else text.decode("ascii", "replace")).strip()
    if len(written) > 60:
        raise ValueError("not a time")
    try:
        figure = Decimal(written.replace(",", "."))
    except InvalidOperation:
        raise ValueError(f"not a time: {written!r}") from None
    if not figure.is_finite() or figure.adjusted() > 30:
        return UNSET
    found = int((figure.scaleb(DIGITS[unit] - 3 * power)).to_integral_value())
    return found if -MOST <= found < MOST else UNSET


def calendar_ns(text: str) -> int:
    """An ISO 8601 date and time as nanoseconds since 1970; ValueError where it is none.

    Without a zone it is UTC, a second 60 is the one after 59, and what 64 bits do not hold `UNSET`.
    """
    found = _ISO.match(text.strip()[:60])
    if found is None:
        raise ValueError(f"not a time: {text[:40]!r}")
    year, month, day, hour, minute, second = map(int, found.groups()[:6])
    if hour > 23 or minute > 59 or second > 60:
        raise ValueError(f"not a time of day: {text[:40]!r}")
    days = date(year, month, day).toordinal() - UNIX_DAY
    seconds = 3600 * hour + 60 * minute + second - _ahead_s(found[8])
    return held(days * DAY_NS + seconds * NANO + int((found[7] or "0").ljust(9, "0")))


def _ahead_s(zone: str | None) -> int:
    """Seconds by which `Z`, `+01:00` or `+01` is ahead of UTC."""
    digits = (zone or "").strip("Zz+-").replace(":", "").ljust(4, "0")
    ahead = 3600 * int(digits[:2]) + 60 * int(digits[2:])
    return -ahead if zone and zone.startswith("-") else ahead


def power_of(text: pl.Series, unit: str) -> int:
    """By how many thousands most figures have to be divided so that 64 bits hold them.

    0 of times in the unit that the column names; 1 where a column of seconds holds milliseconds
    since 1970, and so on.  Figures that no unit explains are left to `column`.
    """
    given = text.drop_nulls()
    told = given.filter(given.str.contains("[1-9]"))[:_LOOKED_AT].to_list()  # zeros tell nothing
    for power in range(MOST_POWER + 1):
        if 2 * sum(_fits(str(cell), unit, power) for cell in told) > len(told):
            return power
    return 0


def _fits(cell: str, unit: str, power: int) -> bool:
    try:
        return nanoseconds(cell, unit, power) != UNSET
    except ValueError:
        return True  # said with its place when the column is read


def column(text: pl.Series, unit: str, power: int = 0) -> Nanoseconds:
    """A column of figures; empty cells are `UNSET`.  BadCellError where one is no figure.

    power: of a thousand, by which all are divided (`power_of`).
    """
    import polars as pl

    parts = text.str.extract_groups(PLAIN).struct.unnest()
    minus, whole, fraction = (parts.to_series(k) for k in range(3))
    digits = DIGITS[unit] - 3 * power
    if digits < 0:
        return _one_by_one(text, unit, power, np.full(len(text), UNSET, np.int64), text.is_null())
    usual = whole.is_not_null() & (whole.str.len_bytes() <= 18 - digits)
    padded = fraction.fill_null("").str.pad_end(9, "0")
    usual &= padded.str.slice(digits).str.replace_all("0", "") == ""
    usual &= parts.to_series(3).fill_null("").str.replace_all("0", "") == ""
    high = whole.cast(pl.Int64, strict=False).fill_null(0).to_numpy().astype(np.int64)
    low = padded.str.slice(0, digits).cast(pl.Int64, strict=False).fill_null(0).to_numpy()
    known = usual.fill_null(False).to_numpy()
    scale = np.int64(NANO // 10 ** (9 - digits))
    found: Nanoseconds = np.where(known, high, 0) * scale + np.where(known, low, 0)
    found = np.where((minus == "-").fill_null(False).to_numpy(), -found, found)
    found = np.where(known, found, np.int64(UNSET))
    return _one_by_one(text, unit, power, found, pl.Series(known) | text.is_null())


def _one_by_one(
    text: pl.Series, unit: str, power: int, found: Nanoseconds, done: pl.Series
) -> Nanoseconds:
    """The figures that are written in another way, or hold more digits than 64 bits."""
    for row in np.flatnonzero(~done.to_numpy()):
        try:
            found[row] = nanoseconds(str(text[int(row)]), unit, power)
        except ValueError:
            expected = "a time in decimals, or nothing"
            raise BadCellError(int(row), str(text[int(row)]), expected) from None
    return found
