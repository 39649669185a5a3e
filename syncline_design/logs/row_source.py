"""What columns are read from, whatever the file: rows, their clock, figures and names."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from syncline_design.effects.record import Array
from syncline_design.logs.cells import StampArray
from syncline_design.machine.quick_dataclass import dataclass

MOST_ROWS = 20_000_000
PIECE = 500_000  # rows of text held at a time: a cell of text takes up to LONGEST_CELL bytes
NANOSECONDS = 1_000_000_000

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


def finite(values: Array) -> Array:
    """Figures, with NaN for what is none."""
    values[~np.isfinite(values)] = np.nan
    return values
