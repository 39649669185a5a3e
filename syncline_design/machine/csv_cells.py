"""Comma-separated text (RFC 4180) taken apart: the one place that reads it cell by cell."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Iterator
from typing import Final

LONGEST_CELL: Final = 131_072  # characters; a longer one is no cell but a quote left open


class NotCellsError(ValueError):
    """Text that cannot be taken apart; what is wrong in words."""


def cells_of(line: str, separator: str = ",", longest: int = LONGEST_CELL) -> list[str]:
    """The cells of one line."""
    return next((cells for _, cells in rows_of([line], separator, longest)), [])


def rows_of(
    lines: Iterable[str], separator: str = ",", longest: int = LONGEST_CELL
) -> Iterator[tuple[int, list[str]]]:
    """The rows of some lines, each with the line that it ends in; a quoted cell may hold more."""
    csv.field_size_limit(longest)
    reader = csv.reader(lines, delimiter=separator)
    try:
        for cells in reader:
            yield reader.line_num, cells
    except csv.Error as error:
        raise NotCellsError(str(error)) from None
