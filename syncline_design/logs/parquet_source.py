"""A Parquet file as columns, in pieces."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from syncline_design.effects.record import Array
from syncline_design.logs import delimited
from syncline_design.logs.cells import (
    LONGEST_CELL,
    NO_TIME,
    ONE_ZONE,
    BadCellError,
    StampArray,
    as_labels,
    iso_times,
    looks_like_a_date,
    numbers,
    trimmed,
)
from syncline_design.logs.parquet_footer import FooterError, chunks
from syncline_design.logs.parquet_times import FarTimeError, calendar, spans
from syncline_design.logs.parquet_unpacking import UnpackedColumns, UnreadableError
from syncline_design.logs.refusals import refuse
from syncline_design.logs.row_source import MOST_ROWS, PIECE, Clock, Mask, finite
from syncline_design.spec.load import BadInput

if TYPE_CHECKING:
    import polars as pl

MOST_TEXT = 4 * LONGEST_CELL + 16  # bytes of a cell in UTF-8, its length and what goes with it
DICTIONARY = 2**21  # bytes of a chunk besides: its dictionary, the heads of its pages


class ParquetSource:
    """A Parquet file, column by column."""

    notes: tuple[str, ...]

    def __init__(self, path: Path) -> None:
        self.path, self.cut, self.notes = path, 0, ()
        try:
            self._columns = UnpackedColumns(path)
        except UnreadableError as error:
            raise self._unreadable(error) from None
        self._schema, self.rows = self._columns.schema, self._columns.rows
        self.header = tuple(self._schema.names())
        if len(self.header) > delimited.MOST_COLUMNS:
            most = f"at most {delimited.MOST_COLUMNS}"
            raise refuse(path, "too many columns", expected=most, found=str(len(self.header)))
        if self.rows > MOST_ROWS:
            most = f"at most {MOST_ROWS}"
            raise refuse(path, "too many rows", expected=most, found=str(self.rows))

    def _unreadable(self, error: Exception) -> BadInput:
        return refuse(self.path, "no readable Parquet file", found=str(error))

    def _column(self, name: str, start: int = 0, rows: int | None = None) -> pl.Series:
        try:
            return self._columns.column(name, start, rows)
        except UnreadableError as error:
            raise self._unreadable(error) from None

    def _pieces(self, name: str) -> Iterator[tuple[int, pl.Series]]:
        """A column of text piece by piece, each with its first row."""
        import polars as pl

        self._demand_short(name)
        for start in range(0, max(self.rows, 1), PIECE):
            text = self._column(name, start, PIECE).cast(pl.String)
            yield start, self._trimmed(name, text, start)

    def _demand_short(self, name: str) -> None:
        """Refuse text that unpacks to more than figures or names do: few kB may hold gigabytes."""
        try:
            for values, size in chunks(self.path, name):
                if size > values * MOST_TEXT + DICTIONARY:
                    found = f"{size} bytes in {values} rows"
                    most = f"at most {LONGEST_CELL} characters a cell"
                    raise refuse(self.path, "text too long", field=name, expected=most, found=found)
        except FooterError as error:
            raise self._unreadable(error) from None

    def clock(self, name: str) -> Clock:
        import polars as pl

        kind = self._schema[name]
        if self.is_calendar(name):
            zoned = isinstance(kind, pl.Datetime) and kind.time_zone is not None
            return Clock(None, self.calendar(name), zoned)
        if kind == pl.Duration:
            return Clock(spans(self._column(name)), None, spans=True)
        if self._is_text(name):
            return self._text_clock(name)
        return Clock(self._figures(name), None)

    def is_calendar(self, name: str) -> bool:
        """Whether a column holds times of a calendar by its type."""
        import polars as pl

        return self._schema[name] == pl.Datetime or self._schema[name] == pl.Date

    def text(self, name: str, start: int, rows: int) -> pl.Series:
        """Some cells as they would be written: of figures every digit, of durations seconds."""
        import polars as pl

        kind = self._schema[name]
        if kind.is_nested() or kind == pl.Binary or kind == pl.Object:
            return pl.Series([str(kind)] * rows, dtype=pl.String)
        if kind in (pl.String, pl.Categorical, pl.Enum):
            self._demand_short(name)
        column = self._column(name, start, rows)
        if kind == pl.Duration:
            return pl.Series(spans(column)).fill_nan(None).cast(pl.String)
        return column.cast(pl.String)

    def calendar(self, name: str, start: int = 0, rows: int | None = None) -> StampArray:
        """Calendar times [ns since 1970]."""
        try:
            return calendar(self._column(name, start, rows))
        except FarTimeError as far:
            raise refuse(
                self.path,
                f"no time of a log in row {start + far.row + 1}",
                field=name,
                expected="a year from 1678 to 2261, or nothing",
                found=far.found,
            ) from None

    def _text_clock(self, name: str) -> Clock:
        seconds: list[Array] = []
        dates: list[StampArray] = []
        zoned: bool | None = None
        for start, text in self._pieces(name):
            try:
                blank = all(bool(np.all(np.isnan(piece))) for piece in seconds)
                if dates or (blank and looks_like_a_date(text)):
                    dates += [np.full(len(piece), NO_TIME) for piece in seconds]
                    seconds = []
                    stamps, zone = iso_times(text)
                    if zoned is not None and zone is not None and zone != zoned:
                        raise BadCellError(0, str(text[0]), ONE_ZONE)
                    zoned = zone if zoned is None else zoned
                    dates.append(stamps)
                else:
                    seconds.append(numbers(text, comma=False)[0])
            except BadCellError as bad:
                raise self._bad(name, bad, start) from None
        if dates:
            return Clock(None, np.concatenate(dates), zoned)
        return Clock(np.concatenate(seconds), None)

    def numbers(self, names: Sequence[str], keep: Mask) -> dict[str, Array]:
        return {name: self._figures(name, keep) for name in names}

    def labels(self, name: str, keep: Mask) -> Array:
        import polars as pl

        if not self._is_text(name):
            return self._figures(name, keep)
        pieces = self._pieces(name)
        return as_labels(text.filter(pl.Series(keep[at : at + PIECE])) for at, text in pieces)

    def _is_text(self, name: str) -> bool:
        """Text, not numbers; anything else is refused."""
        import polars as pl

        kind = self._schema[name]
        if kind == pl.Categorical or kind == pl.Enum or kind == pl.String:
            return True
        if kind == pl.Null or kind.is_numeric():
            return False
        raise refuse(self.path, "not a column of numbers", field=name, found=str(kind))

    def _trimmed(self, name: str, series: pl.Series, start: int) -> pl.Series:
        try:
            return trimmed(series)
        except BadCellError as bad:
            raise self._bad(name, bad, start) from None

    def _figures(self, name: str, keep: Mask | None = None) -> Array:
        """A column of numbers, or of text that says numbers."""
        import polars as pl

        if not self._is_text(name):
            series = self._column(name)
            kept = series if keep is None else series.filter(pl.Series(keep))
            return finite(kept.cast(pl.Float64).to_numpy().astype(float))
        found: list[Array] = []
        for start, text in self._pieces(name):
            try:
                values, _ = numbers(text, comma=False)
            except BadCellError as bad:
                raise self._bad(name, bad, start) from None
            found.append(values if keep is None else values[keep[start : start + PIECE]])
        return np.concatenate(found)

    def _bad(self, name: str, bad: BadCellError, start: int) -> BadInput:
        return refuse(
            self.path,
            f"text among numbers in row {start + bad.row + 1}",
            field=name,
            expected=bad.expected,
            found=repr(bad.text[:40]),
        )
