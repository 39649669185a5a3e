"""Delimited text as columns, block by block."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from syncline_design.effects.record import Array
from syncline_design.logs import delimited
from syncline_design.logs.cells import (
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
from syncline_design.logs.refusals import refuse
from syncline_design.logs.row_source import MOST_ROWS, Clock, Mask, finite
from syncline_design.logs.torn_rows import is_cut
from syncline_design.spec.load import BadInput

if TYPE_CHECKING:
    import polars as pl


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
        if is_cut(self.path, self.how, at, text):
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
        return [finite(values) for values in found]

    def _text(self, block: delimited.RowBlock, place: int) -> pl.Series:
        import polars as pl

        try:
            frame = delimited.parsed(block, self.how, [place], as_text=True)
            return trimmed(frame.to_series(0))
        except BadCellError as bad:
            raise text_among_numbers(self.path, block, place, self.header[place], bad) from None
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
            raise text_among_numbers(self.path, block, place, self.header[place], bad) from None
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
            raise text_among_numbers(self.path, block, place, self.header[place], bad) from None
        return stamps, zone


def text_among_numbers(
    path: Path, block: delimited.RowBlock, place: int, field: str, bad: BadCellError
) -> BadInput:
    """The error for a cell of a block's column that does not hold what the column holds."""
    return refuse(
        path,
        "text among numbers",
        line=int(block.lines[bad.row]),
        column=place + 1,
        field=field,
        expected=bad.expected,
        found=repr(bad.text[:40]),
        hint=bad.hint,
    )
