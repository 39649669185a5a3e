"""Files to columns, read in pieces: delimited text and Parquet, each by its literal path."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from syncline_design.effects.record import Array
from syncline_design.logs import delimited
from syncline_design.logs.cells import (
    LONGEST_CELL,
    NO_TIME,
    NOTHING,
    ONE_MARK,
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
from syncline_design.logs.refusals import refuse
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.spec.load import BadInput

if TYPE_CHECKING:
    import polars as pl

ZONE_CHECK = "POLARS_IGNORE_TIMEZONE_PARSE_ERROR"
MOST_BYTES = 4 * 1024**3
MOST_ROWS = 20_000_000
PIECE = 500_000  # rows of text held at a time: a cell of text takes up to LONGEST_CELL bytes
MOST_TEXT = 4 * LONGEST_CELL + 16  # bytes of a cell in UTF-8, its length and what goes with it
DICTIONARY = 2**21  # bytes of a chunk besides: its dictionary, the heads of its pages
NANOSECONDS = 1_000_000_000
PACKED = {b"\x1f\x8b": "gzip", b"\x28\xb5\x2f\xfd": "zstd", b"PK\x03\x04": "zip", b"BZh": "bzip2"}

Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Clock:
    """A column of times: seconds as written, or nanoseconds since 1970 where it is a calendar's.

    zoned: whether calendar times name their zone; None for numbers.
    spans: whether the seconds are durations, which need no unit in the column's name.
    """

    seconds: Array | None
    nanoseconds: StampArray | None
    zoned: bool | None = None
    spans: bool = False


class RowSource(Protocol):
    """A file whose columns can be read one pass at a time.

    cut: the line in which the file is cut off, 0 if it is whole.  notes: what was done to its
    columns before they came here.
    """

    path: Path
    header: tuple[str, ...]
    cut: int
    notes: tuple[str, ...]

    def clock(self, name: str) -> Clock:
        """The time column of every row."""
        ...

    def numbers(self, names: Sequence[str], keep: Mask) -> dict[str, Array]:
        """Columns of figures in the kept rows, in the order of the file."""
        ...

    def labels(self, name: str, keep: Mask) -> Array:
        """A column of names, as numbers that differ where the names do."""
        ...


def opened(path: Path) -> RowSource:
    """The file as a source; refuses what is no log."""
    demand_plain_file(path)
    if path.suffix.lower() in (".parquet", ".pq"):
        return ParquetSource(path)
    return TextSource(path)


def demand_plain_file(path: Path) -> None:
    try:
        if not path.is_file():
            what = "a folder" if path.is_dir() else "no regular file"
            raise refuse(path, "cannot read the log", expected="a CSV or Parquet file", found=what)
        size = path.stat().st_size
        with path.open("rb") as file:
            head = file.read(4)
    except OSError as error:
        raise refuse(path, f"cannot read the log: {error.strerror}") from None
    for magic, name in PACKED.items():
        if head.startswith(magic):
            raise refuse(path, "the log is compressed", found=name, hint="unpack it first")
    if size > MOST_BYTES:
        raise refuse(path, "the log is too large", expected="at most 4 GiB", found=f"{size} bytes")
    if size == 0:
        raise refuse(path, "the log is empty", line=1, column=1, expected="a header and rows")


class TextSource:
    """Delimited text, block by block."""

    notes: tuple[str, ...]

    def __init__(self, path: Path) -> None:
        self.path, self.notes = path, ()
        self.how = delimited.dialect(path)
        self.header = self.how.names
        self.end, self.cut = path.stat().st_size, 0
        self._mark = ""
        self._find_cut()

    def _find_cut(self) -> None:
        """Where the file was cut off in its last row: that row is left out."""
        found = delimited.last_line(self.path, self.how.body)
        if found is None:
            return
        at, text = found
        if not text.strip() or text.lstrip().startswith("#"):
            return
        cells = delimited.split_line(text, self.how.separator)
        if len(cells) < len(self.header) or cells[-1].strip() in NOTHING or _torn(cells[-1]):
            self.end, self.cut = at, -1

    def clock(self, name: str) -> Clock:
        place = [self.header.index(name)]
        seconds: list[Array] = []
        dates: list[StampArray] = []
        zoned: bool | None = None
        rows = 0
        last = self.how.body_line - 1
        for block in delimited.blocks(self.path, self.how, self.end):
            rows += block.lines.shape[0]
            last = int(block.lines[-1])
            if rows > MOST_ROWS:
                raise refuse(self.path, "too many rows", expected=f"at most {MOST_ROWS}")
            if not dates:
                fast = self._fast(block, place)
                if fast is not None:
                    seconds.append(fast[0])
                    continue
            text = self._text(block, place[0])
            if dates or (not seconds and looks_like_a_date(text)):
                stamps, zone = self._dates(block, place[0], text, zoned)
                zoned = zone if zoned is None else zoned
                dates.append(stamps)
            else:
                seconds.append(self._figures(block, place[0], text))
        if self.cut:
            self.cut = last + 1
        if dates:
            return Clock(None, np.concatenate(dates), bool(zoned))
        return Clock(np.concatenate(seconds) if seconds else np.zeros(0), None)

    def numbers(self, names: Sequence[str], keep: Mask) -> dict[str, Array]:
        places = [self.header.index(name) for name in names]
        found: list[list[Array]] = [[] for _ in names]
        at = 0
        for block in delimited.blocks(self.path, self.how, self.end):
            kept = keep[at : at + block.lines.shape[0]]
            at += block.lines.shape[0]
            if not np.any(kept):
                continue
            values = self._fast(block, places)
            if values is None:
                values = [self._figures(block, k, self._text(block, k)) for k in places]
            for own, column in zip(found, values, strict=True):
                own.append(column[kept])
        return {
            n: np.concatenate(v) if v else np.zeros(0) for n, v in zip(names, found, strict=True)
        }

    def labels(self, name: str, keep: Mask) -> Array:
        return as_labels(self._kept_text(self.header.index(name), keep))

    def _kept_text(self, place: int, keep: Mask) -> Iterator[pl.Series]:
        import polars as pl

        at = 0
        for block in delimited.blocks(self.path, self.how, self.end):
            kept = keep[at : at + block.lines.shape[0]]
            at += block.lines.shape[0]
            if np.any(kept):
                yield self._text(block, place).filter(pl.Series(kept))

    def _fast(self, block: delimited.RowBlock, places: Sequence[int]) -> list[Array] | None:
        """Columns that are plain finite figures throughout; None where one is not."""
        import polars as pl

        try:
            frame = delimited.parsed(block, self.how, places, as_text=False)
        except pl.exceptions.PolarsError:
            return None
        found = [frame.get_column(f"column_{k + 1}").to_numpy().astype(float) for k in places]
        if any(bool(np.any(np.isinf(values))) for values in found):
            return None  # `inf`, or a figure too large for a float: the text tells
        return [_finite(values) for values in found]

    def _text(self, block: delimited.RowBlock, place: int) -> pl.Series:
        import polars as pl

        try:
            frame = delimited.parsed(block, self.how, [place], as_text=True)
            return trimmed(frame.to_series(0))
        except BadCellError as bad:
            raise self._bad(block, place, bad) from None
        except pl.exceptions.PolarsError as error:
            found = (str(error).splitlines() or [type(error).__name__])[0][:160]
            raise refuse(self.path, "no readable CSV file", found=found) from None

    def _figures(self, block: delimited.RowBlock, place: int, text: pl.Series) -> Array:
        try:
            values, mark = numbers(text, self.how.comma_is_decimal)
            if mark and self._mark and mark != self._mark:
                row = int(text.str.contains(mark, literal=True).arg_max() or 0)
                raise BadCellError(row, str(text[row]), ONE_MARK)
        except BadCellError as bad:
            raise self._bad(block, place, bad) from None
        self._mark = self._mark or mark
        return values

    def _dates(
        self, block: delimited.RowBlock, place: int, text: pl.Series, zoned: bool | None
    ) -> tuple[StampArray, bool | None]:
        try:
            stamps, zone = iso_times(text)
            if zoned is not None and zone is not None and zone != zoned:
                raise BadCellError(0, str(text[0]), ONE_ZONE)
        except BadCellError as bad:
            raise self._bad(block, place, bad) from None
        return stamps, zone

    def _bad(self, block: delimited.RowBlock, place: int, bad: BadCellError) -> BadInput:
        return refuse(
            self.path,
            "text among numbers",
            line=int(block.lines[bad.row]),
            column=place + 1,
            field=self.header[place],
            expected=bad.expected,
            found=repr(bad.text[:40]),
            hint=bad.hint,
        )


def _torn(cell: str) -> bool:
    """Whether the last cell stops within a number: `-`, `1e`, `1.5e-`."""
    text = cell.strip().replace(",", ".")
    try:
        float(text)
    except ValueError:
        if text[-1:] in "+-eE.":
            try:
                float(text + "0")
            except ValueError:
                return False
            return True
    return False


def _finite(values: Array) -> Array:
    values[~np.isfinite(values)] = np.nan
    return values


@contextmanager
def any_zone() -> Iterator[None]:
    """Lets polars open columns whose zone is an offset (`+05:30`, as Arrow writes it).

    Without it polars panics over any zone that is no name of the time zone database.
    """
    before = os.environ.get(ZONE_CHECK)
    os.environ[ZONE_CHECK] = "1"
    try:
        yield
    finally:
        if before is None:
            del os.environ[ZONE_CHECK]
        else:
            os.environ[ZONE_CHECK] = before


class ParquetSource:
    """A Parquet file, column by column."""

    notes: tuple[str, ...]

    def __init__(self, path: Path) -> None:
        import polars as pl

        self.path, self.cut, self.notes = path, 0, ()
        try:
            with any_zone():
                self._frame = pl.scan_parquet(path, glob=False, hive_partitioning=False)
                self._schema = self._frame.collect_schema()
                self.rows = int(self._frame.select(pl.len()).collect().item())
        except (Exception, pl.exceptions.PanicException) as error:  # all of them the file's fault
            raise self._unreadable(error) from None
        self.header = tuple(self._schema.names())
        if len(self.header) > delimited.MOST_COLUMNS:
            most = f"at most {delimited.MOST_COLUMNS}"
            raise refuse(path, "too many columns", expected=most, found=str(len(self.header)))
        if self.rows > MOST_ROWS:
            most = f"at most {MOST_ROWS}"
            raise refuse(path, "too many rows", expected=most, found=str(self.rows))

    def _unreadable(self, error: BaseException) -> BadInput:
        found = (str(error).splitlines() or [type(error).__name__])[0][:160]
        return refuse(self.path, "no readable Parquet file", found=found)

    def _column(self, name: str, start: int = 0, rows: int | None = None) -> pl.Series:
        import polars as pl

        try:
            with any_zone():
                return self._frame.slice(start, rows).select(name).collect().to_series(0)
        except (Exception, pl.exceptions.PanicException) as error:
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
            return _finite(kept.cast(pl.Float64).to_numpy().astype(float))
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
