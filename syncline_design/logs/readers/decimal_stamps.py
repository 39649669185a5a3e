"""Times written in decimals, to whole nanoseconds without passing through floats.

Seconds since 1970 with nine decimals have 19 digits, a float holds 16: `1403636580.838555648` would
come back 64 ns off.
"""

from __future__ import annotations

from decimal import Decimal, InvalidOperation
from typing import TYPE_CHECKING

import numpy as np

from syncline_design.logs.cells import BadCellError
from syncline_design.logs.readers.epochs import NANO
from syncline_design.logs.readers.stream import UNSET, Nanoseconds

if TYPE_CHECKING:
    import polars as pl

PLAIN = r"^\+?(-?)(\d{1,18})(?:[.,](\d{0,9})(\d*))?$"
DIGITS = {"s": 9, "ms": 6, "us": 3, "ns": 0}
MOST = 2**63


def nanoseconds(text: str | bytes, unit: str = "s") -> int:
    """One figure as nanoseconds, rounded half to even; ValueError where it is none.

    What 64 bits do not hold, and what is not finite, is `UNSET`.
    """
    written = (text if isinstance(text, str) else text.decode("ascii", "replace")).strip()
    if len(written) > 60:
        raise ValueError("not a time")
    try:
        figure = Decimal(written.replace(",", "."))
    except InvalidOperation:
        raise ValueError(f"not a time: {written!r}") from None
    if not figure.is_finite() or figure.adjusted() > 20:
        return UNSET
    found = int((figure.scaleb(DIGITS[unit])).to_integral_value())
    return found if -MOST <= found < MOST else UNSET


def column(text: pl.Series, unit: str) -> Nanoseconds:
    """A column of figures; empty cells are `UNSET`.  BadCellError where one is no figure."""
    import polars as pl

    parts = text.str.extract_groups(PLAIN).struct.unnest()
    minus, whole, fraction = (parts.to_series(k) for k in range(3))
    digits = DIGITS[unit]
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
    for row in np.flatnonzero(~known & text.is_not_null().to_numpy()):
        try:
            found[row] = nanoseconds(str(text[int(row)]), unit)
        except ValueError:
            expected = "a time in decimals, or nothing"
            raise BadCellError(int(row), str(text[int(row)]), expected) from None
    return found
