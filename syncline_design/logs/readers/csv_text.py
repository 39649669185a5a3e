"""CSV and its relatives as a stream: one file is one stream, named by the file's stem."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from syncline_design.logs import delimited
from syncline_design.logs.cells import (
    NO_TIME,
    ONE_ZONE,
    BadCellError,
    iso_times,
    looks_like_a_date,
    numbers,
    trimmed,
)
from syncline_design.logs.readers.batches import Batch, BatchRecording, StreamFacts, scaled
from syncline_design.logs.readers.csv_names import Layout, TimeColumn, layout_of, time_columns
from syncline_design.logs.readers.decimal_stamps import column as exact_stamps
from syncline_design.logs.readers.decimal_stamps import power_of
from syncline_design.logs.readers.epochs import WEEK_NS, WEEK_SECONDS, week_start_ns
from syncline_design.logs.readers.reader import NO, FileHead, Reader
from syncline_design.logs.readers.stream import UNSET, Nanoseconds, Recording, Timeline
from syncline_design.logs.readers.timelines import timeline_of
from syncline_design.logs.refusals import refuse
from syncline_design.logs.sources import demand_plain_file
from syncline_design.logs.text_source import TextSource, text_among_numbers

if TYPE_CHECKING:
    import polars as pl

BY_HEADER = 2
NAMED: dict[str, Timeline] = {"gps": "gps", "tai": "tai", "boot": "boot"}


class CsvRecording(BatchRecording):
    """Delimited text with a header."""

    format = "CSV file"
    kind = "CSV"

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        demand_plain_file(path)
        self._names, self._title_line = self._opened(path)
        self._layout = layout_of(self._names)
        self._name = path.stem
        self._demand_times()
        self._text: set[int] = set()  # places of columns that hold names, not figures
        self._first_line = -1  # of the first row
        self._calendar = False
        self._zoned: bool | None = None  # whether calendar times name their zone
        self._powers: dict[int, int] = {}  # of a thousand, by which a column of times is divided
        self._seen: Nanoseconds = np.zeros(0, dtype=np.int64)

    def _opened(self, path: Path) -> tuple[Sequence[str], int]:
        """The names of the columns, and the line that they stand in."""
        self._source = TextSource(path)
        self._how = self._source.how
        self._comma = self._how.comma_is_decimal
        return self._how.names, self._how.line

    def _blocks(self) -> Iterator[delimited.RowBlock]:
        self._losses = delimited.Losses(self._stamps)
        return delimited.blocks(self.path, self._how, self._source.end, self._losses)

    def _stamps(self, block: delimited.RowBlock) -> tuple[Nanoseconds | None, Nanoseconds | None]:
        """Both times of the rows of a block."""
        primary = self._times(block, self._layout.primary)
        return primary, self._times(block, self._layout.secondary)

    def _demand_times(self) -> None:
        """One unit of the stamps, and something besides them or two of them."""
        for stem in ("stamp", "receive"):
            several = time_columns(self._names, stem)
            if len(several) > 1:
                raise refuse(
                    self.path,
                    f"two columns of {stem}s",
                    line=self._title_line,
                    column=several[1].place + 1,
                    expected=f"one of {stem}_s, {stem}_ms, {stem}_us, {stem}_ns",
                    found=", ".join(c.name for c in several)[:80],
                )
        layout = self._layout
        if layout.primary is None and "target" not in layout.quantity:
            raise refuse(
                self.path,
                "no column of times",
                line=self._title_line,
                column=1,
                expected="stamp_<unit> and receive_<unit>, or time_s, time_ms, time_us, time_ns, "
                "or ISO 8601 times in a column `time`",
                found=", ".join(self._names[:12])[:200],
            )

    def _batches(self, wanted: str | None) -> Iterator[Batch]:
        seen: list[Nanoseconds] = []
        rows = 0
        for block in self._blocks():
            rows += int(block.lines.shape[0])
            primary, secondary = self._stamps(block)
            if primary is not None and self._layout.week is not None:
                primary = self._with_week(block, primary)
            columns = self._columns(block) if wanted is not None or not seen else {}
            if primary is not None and len(seen) < 50:
                seen.append(primary)
            yield Batch(self._name, int(block.lines.shape[0]), primary, secondary, columns)
        if wanted is None:
            self._finish(rows, seen)

    def _finish(self, rows: int, seen: list[Nanoseconds]) -> None:
        if not rows:
            raise refuse(self.path, "no rows below the header", line=self._title_line, column=1)
        self._seen = np.concatenate(seen) if seen else np.zeros(0, dtype=np.int64)
        reason = self._damage()
        if reason:
            self._cut(reason, rows)

    def _damage(self) -> str:
        """What could not be read of the file; empty where all of it could."""
        cut = "the last row is cut" if self._source.cut else ""
        return "; ".join(part for part in (self._losses.said(), cut) if part)

    def _times(self, block: delimited.RowBlock, column: TimeColumn | None) -> Nanoseconds | None:
        if column is None:
            return None
        text = self._cells(block, column.place)
        try:
            if not column.unit and (self._calendar or looks_like_a_date(text)):
                self._calendar = True
                stamps, zoned = iso_times(text)
                self._demand_zone(text, zoned)
                found: Nanoseconds = np.where(stamps == NO_TIME, UNSET, stamps)
                return found
            unit = column.unit or self._refuse_bare(column)
            if column.place not in self._powers:  # the first block tells
                self._powers[column.place] = power_of(text, unit)
            return exact_stamps(text, unit, self._powers[column.place])
        except BadCellError as bad:
            raise self._bad(block, column.place, bad) from None

    def _demand_zone(self, text: pl.Series, zoned: bool | None) -> None:
        """A zone in every row of the file, or in none."""
        if self._zoned is None:
            self._zoned = zoned
        elif zoned is not None and zoned != self._zoned:
            row = int(text.is_not_null().arg_max() or 0)
            raise BadCellError(row, str(text[row]), ONE_ZONE)

    def _refuse_bare(self, column: TimeColumn) -> str:
        raise refuse(
            self.path,
            "times without a unit",
            line=self._title_line,
            column=column.place + 1,
            field=column.name,
            expected="a unit in the name, as in time_s or stamp_us, or ISO 8601 times",
        )

    def _with_week(self, block: delimited.RowBlock, tow: Nanoseconds) -> Nanoseconds:
        place = self._layout.week
        week = self._figures(block, place if place is not None else 0, True)
        if week is None:
            return tow
        known = np.isfinite(week) & (week >= 0) & (week < 10_000) & (tow != UNSET)
        known &= (tow >= -WEEK_NS) & (tow <= 2 * WEEK_NS)
        start = np.array([week_start_ns(int(w)) for w in np.where(known, week, 0)], dtype=np.int64)
        stamps: Nanoseconds = np.where(known, start + np.where(known, tow, 0), UNSET)
        return stamps

    def _columns(self, block: delimited.RowBlock) -> dict[str, NDArray[Any]]:
        columns: dict[str, NDArray[Any]] = {}
        for column in self._layout.columns:
            if column.name == "target_id":
                columns[column.name] = _labels(self._cells(block, column.place))
                continue
            values = self._figures(block, column.place, column.known)
            if values is not None:
                columns[column.name] = scaled(values, column.factor)
        return columns

    def _figures(
        self, block: delimited.RowBlock, place: int, known: bool
    ) -> NDArray[np.float64] | None:
        """A column of figures; None for an unknown one of names, which the first block tells."""
        if place in self._text:
            return None
        cells = self._cells(block, place)
        try:
            return numbers(cells, self._comma)[0]
        except BadCellError as bad:
            if not known and self._first_block(block) and any(c.isalpha() for c in bad.text):
                self._text.add(place)
                return None
            raise self._bad(block, place, bad) from None

    def _first_block(self, block: delimited.RowBlock) -> bool:
        if self._first_line < 0:
            self._first_line = int(block.lines[0])
        return int(block.lines[0]) == self._first_line

    def _cells(self, block: delimited.RowBlock, place: int) -> pl.Series:
        import polars as pl

        try:
            return trimmed(delimited.parsed(block, self._how, [place], as_text=True).to_series(0))
        except BadCellError as bad:
            raise self._bad(block, place, bad) from None
        except pl.exceptions.PolarsError as error:
            found = (str(error).splitlines() or [type(error).__name__])[0][:160]
            raise refuse(self.path, "no readable CSV file", found=found) from None

    def _bad(self, block: delimited.RowBlock, place: int, bad: BadCellError) -> Exception:
        return text_among_numbers(self.path, block, place, self._names[place], bad)

    def _facts(self, name: str) -> StreamFacts:
        layout: Layout = self._layout
        timeline, label, notes = self._timeline()
        skipped = [self._names[place] for place in sorted(self._text)]
        if skipped:
            notes = (*notes, f"not read, as they hold text: {', '.join(skipped)[:200]}")
        return StreamFacts(
            quantity=layout.quantity,
            frame=layout.frame,
            timeline=timeline,
            primary=label,
            primary_factor=1000.0 ** self._power(layout.primary),
            secondary=layout.secondary.name if layout.secondary else None,
            notes=(*notes, *self._too_large()),
            body="frd" if "attitude" in layout.quantity or "rate" in layout.quantity else "unknown",
            kind=self.kind,
        )

    def _power(self, column: TimeColumn | None) -> int:
        return self._powers.get(column.place, 0) if column is not None else 0

    def _too_large(self) -> tuple[str, ...]:
        """Columns whose figures are too large for their unit, and what they were divided by."""
        columns = (self._layout.primary, self._layout.secondary)
        return tuple(
            f"{c.name} holds figures too large for times in {c.unit}: read as if a unit 1e"
            f"{3 * power} smaller"
            for c in columns if c is not None and (power := self._power(c))
        )  # fmt: skip

    def _timeline(self) -> tuple[Timeline, str, tuple[str, ...]]:
        """Of the names of the columns, else of the size of the stamps."""
        column = self._layout.primary
        if column is None:
            return "unknown", "", ()
        if self._layout.week is not None:
            return "gps", column.name, ("GPS week and time of week, as the columns say",)
        if self._calendar:
            return "utc", column.name, ()
        low = column.name.lower()
        if "tow" in low or "time_of_week" in low:
            return "unknown", WEEK_SECONDS, ("seconds of the GPS week, whose number is not there",)
        for word, named in NAMED.items():
            if word in low:
                return named, column.name, ()
        timeline, notes = timeline_of(self._seen, "utc")
        if timeline == "utc" and "utc" not in low:
            notes = (*notes, f"{column.name} was taken to count from 1970-01-01 UTC")
        return timeline, column.name, notes


def _labels(cells: pl.Series) -> NDArray[np.float64]:
    """Names as figures, the same in every file: a figure is itself, a name 52 bits of its hash."""
    import polars as pl

    figures = cells.cast(pl.Float64, strict=False).to_numpy().astype(float)
    hashed = (cells.hash(seed=0).to_numpy() >> np.uint64(12)).astype(float)
    labels: NDArray[np.float64] = np.where(np.isnan(figures), hashed, figures)
    labels[cells.is_null().to_numpy()] = np.nan
    return labels


def _recognises(head: FileHead) -> int:
    """Text whose first line that is no comment, or last comment, holds names we know."""
    start = head.start
    text = start.removeprefix(b"\xef\xbb\xbf").decode("utf-8", errors="replace")
    lines = [line for line in text.splitlines()[:200] if line.strip()]
    above = [line.lstrip("# \t") for line in lines if line.lstrip().startswith("#")][-1:]
    first = [line for line in lines if not line.lstrip().startswith("#")][:2]
    for line in (*above, *first):
        names, mark = delimited.split_names(line)
        if "\0" in line:
            return NO
        if len(names) > 1 or mark != ",":
            layout = layout_of(names)
            if layout.primary is not None or "target" in layout.quantity:
                return BY_HEADER
    return NO


def _open(path: Path) -> Recording:
    return CsvRecording(path)


READER = Reader(CsvRecording.format, _recognises, _open)
