"""Cells as people write them: decimal commas, ISO 8601 times, names of targets."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from syncline_design.effects.record import Array

if TYPE_CHECKING:
    import polars as pl

StampArray = NDArray[np.int64]

LONGEST_CELL = 200  # characters; no figure and no name of a target is longer
NOTHING = ("", "nan", "NaN", "NAN", "NA", "N/A", "null")
NO_TIME = np.iinfo(np.int64).min
ISO = (
    r"^(\d{4})-?(\d\d)-?(\d\d)[Tt ](\d\d):?(\d\d):?(\d\d)(?:[.,](\d{1,9})\d*)?"
    r"\s*(Z|z|[+-](?:0\d|1[0-8])(?::?[0-5]\d)?)?$"
)
YEARS = (1678, 2261)  # which 64 bits of nanoseconds since 1970 hold whole
LEAP = "UTC's leap seconds have no place of their own; give seconds that go on, as time_s"
COMMA, POINT = ",", "."
ONE_ZONE = "a zone (Z or +01:00) in every row or in none"
ONE_MARK = "one decimal mark, point or comma, in all of a file"


class BadCellError(Exception):
    """A cell that is not what its column holds: its row, and what was expected instead."""

    def __init__(self, row: int, text: str, expected: str, hint: str = "") -> None:
        super().__init__(f"row {row}: {text!r}")
        self.row, self.text, self.expected, self.hint = row, text, expected, hint


def trimmed(series: pl.Series) -> pl.Series:
    """Text without blanks at its ends; null where a cell says that there is nothing."""
    import polars as pl

    lengths = series.str.len_bytes().fill_null(0)
    if len(lengths) and int(lengths.max() or 0) > LONGEST_CELL:  # type: ignore[arg-type]
        row = int(lengths.arg_max() or 0)
        short = str(series.str.slice(0, 40)[row])
        raise BadCellError(row, short, f"at most {LONGEST_CELL} characters")
    text = series.str.strip_chars()
    return text.set(text.is_in(list(NOTHING)).fill_null(True), None).cast(pl.String)


def as_labels(pieces: Iterable[pl.Series]) -> Array:
    """Names as numbers that differ where the names do: their own value where all are figures.

    Else 52 bits of a hash of each (exact as floats), so that no more than one piece of text is held
    at a time; two names of one scan are taken for one in one of 4.5e15 pairs.
    """
    import polars as pl

    values: list[Array] = []
    hashes: list[Array] = []
    named = False
    for text in pieces:
        figures = text.cast(pl.Float64, strict=False)
        named = named or figures.null_count() > text.null_count()
        values = [] if named else [*values, figures.to_numpy().astype(float)]
        own = (text.hash(seed=0).to_numpy() >> np.uint64(12)).astype(float)
        own[text.is_null().to_numpy()] = np.nan
        hashes.append(own)
    chosen = hashes if named else values
    return np.concatenate(chosen) if chosen else np.zeros(0)


def numbers(text: pl.Series, comma: bool) -> tuple[Array, str]:
    """Figures of trimmed text, NaN where a cell is empty; and which decimal mark was met.

    comma: whether a comma may be one, which it is where it does not separate columns.
    """
    import polars as pl

    mark = ""
    if comma:
        commas, points = (text.str.contains(m, literal=True) for m in (COMMA, POINT))
        mark = COMMA if commas.any() else (POINT if points.any() else "")
        if mark == COMMA and points.any():
            raise _two_marks(text, commas.fill_null(False), points.fill_null(False))
        text = text.str.replace(COMMA, POINT, literal=True)
    found = text.cast(pl.Float64, strict=False)
    bad = (found.is_null() & text.is_not_null()).arg_true()
    if len(bad):
        row = int(bad[0])
        mark_name = "point or comma" if comma else "point"
        raise BadCellError(row, str(text[row]), f"a number with a decimal {mark_name}, or nothing")
    endless = found.is_infinite().fill_null(False)
    if endless.any():  # `inf` is nothing known; a figure too large for a float is a fault
        rows = (endless & ~text.str.to_lowercase().str.contains("inf", literal=True)).arg_true()
        if len(rows):
            raise BadCellError(int(rows[0]), str(text[int(rows[0])]), "a figure below 1e308")
    values: Array = found.to_numpy().astype(float)
    values[~np.isfinite(values)] = np.nan
    return values, mark


def _two_marks(text: pl.Series, commas: pl.Series, points: pl.Series) -> BadCellError:
    """The cell that holds both marks, else the first with the rarer one."""
    both = commas & points
    rarer = commas if int(commas.sum()) <= int(points.sum()) else points
    row = int((both if both.any() else rarer).arg_true()[0])
    return BadCellError(row, str(text[row]), ONE_MARK)


def looks_like_a_date(text: pl.Series) -> bool:
    """Whether any cell is an ISO 8601 time."""
    return bool(text.str.contains(ISO).any())


def iso_times(text: pl.Series) -> tuple[StampArray, bool | None]:
    """Nanoseconds since 1970 UTC, NO_TIME for empty cells; and whether they name their zone."""
    import polars as pl

    parts = text.str.extract_groups(ISO).struct.unnest()
    fields = [parts.to_series(k) for k in range(8)]
    year, month, day, hour, minute, second, fraction, zone = fields
    plain = year + "-" + month + "-" + day + "T" + hour + ":" + minute + ":" + second
    at = plain.str.strptime(pl.Datetime("us"), "%Y-%m-%dT%H:%M:%S", strict=False)
    zoned = zone.is_not_null()
    bad = text.is_not_null() & at.is_null()
    mixed = at.is_not_null() & (zoned != bool(zoned.any()))
    wanted = "an ISO 8601 time such as 2026-03-01T12:00:00.125Z"
    far = at.is_not_null() & ~at.dt.year().is_between(*YEARS)
    years = f"a year from {YEARS[0]} to {YEARS[1]}"
    leaps = (second == "60").fill_null(False)
    faults = ((leaps, wanted, LEAP), (bad, wanted, ""), (mixed, ONE_ZONE, ""), (far, years, ""))
    for wrong, expected, hint in faults:
        rows = wrong.fill_null(True).arg_true()
        if len(rows):
            raise BadCellError(int(rows[0]), str(text[int(rows[0])]), expected, hint)
    seconds = at.dt.epoch("s") - _offset_s(zone)
    nanoseconds = fraction.fill_null("0").str.pad_end(9, "0").cast(pl.Int64)
    stamps = (seconds * 1_000_000_000 + nanoseconds).fill_null(NO_TIME)
    return stamps.to_numpy().astype(np.int64), bool(zoned.any()) if at.count() else None


def _offset_s(zone: pl.Series) -> pl.Series:
    """Seconds by which a zone is ahead of UTC."""
    import polars as pl

    digits = zone.str.replace_all("[^0-9]", "").str.pad_end(4, "0")
    hours = digits.str.slice(0, 2).cast(pl.Int64, strict=False).fill_null(0)
    minutes = digits.str.slice(2, 2).cast(pl.Int64, strict=False).fill_null(0)
    behind = zone.str.starts_with("-").fill_null(False).cast(pl.Int64)
    return (3600 * hours + 60 * minutes) * (1 - 2 * behind)
