"""Parquet as a stream: columns by the names as in text, times by their type or their name."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from syncline_design.logs.cells import NO_TIME, BadCellError, trimmed
from syncline_design.logs.delimited import RowBlock
from syncline_design.logs.parquet_source import ParquetSource
from syncline_design.logs.readers.csv_names import TimeColumn
from syncline_design.logs.readers.csv_text import CsvRecording
from syncline_design.logs.readers.reader import BY_MAGIC, NO, FileHead, Reader
from syncline_design.logs.readers.stream import UNSET, Nanoseconds, Recording
from syncline_design.logs.refusals import refuse

if TYPE_CHECKING:
    import polars as pl

MAGIC = b"PAR1"
ROWS = 100_000  # read at a time


class ParquetRecording(CsvRecording):
    """A table whose columns are read piece by piece, as the text that they would be written as."""

    format = "Parquet file"
    kind = "Parquet"
    _comma = False

    def _opened(self, path: Path) -> tuple[Sequence[str], int]:
        self._table = ParquetSource(path)
        return self._table.header, 0

    def _blocks(self) -> Iterator[RowBlock]:
        for start in range(0, self._table.rows, ROWS):
            lines = np.arange(start, min(start + ROWS, self._table.rows))
            yield RowBlock(b"", lines)

    def _damage(self) -> str:
        return ""

    def _times(self, block: RowBlock, column: TimeColumn | None) -> Nanoseconds | None:
        if column is None or not self._table.is_calendar(column.name):
            return super()._times(block, column)
        self._calendar = True
        stamps = self._table.calendar(column.name, int(block.lines[0]), len(block.lines))
        found: Nanoseconds = np.where(stamps == NO_TIME, UNSET, stamps)
        return found

    def _cells(self, block: RowBlock, place: int) -> pl.Series:
        name, start = self._names[place], int(block.lines[0])
        try:
            return trimmed(self._table.text(name, start, len(block.lines)))
        except BadCellError as bad:
            raise self._bad(block, place, bad) from None

    def _bad(self, block: RowBlock, place: int, bad: BadCellError) -> Exception:
        return refuse(
            self.path,
            f"text among numbers in row {int(block.lines[bad.row]) + 1}",
            field=self._names[place],
            expected=bad.expected,
            found=repr(bad.text[:40]),
            hint=bad.hint,
        )


def _recognises(head: FileHead) -> int:
    return BY_MAGIC if head.start.startswith(MAGIC) else NO


def _open(path: Path) -> Recording:
    return ParquetRecording(path)


READER = Reader(ParquetRecording.format, _recognises, _open)
