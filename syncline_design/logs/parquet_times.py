"""Calendar times and durations of Parquet columns, by the unit that the column itself has."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from syncline_design.effects.record import Array
from syncline_design.logs.cells import NO_TIME, StampArray

if TYPE_CHECKING:
    import polars as pl

UNIT_NS = {"ns": 1, "us": 1_000, "ms": 1_000_000, "days": 86_400_000_000_000}


class FarTimeError(ValueError):
    """A time that no log has. row: from 0; found: the column's own figure."""

    def __init__(self, row: int, found: str) -> None:
        super().__init__(found)
        self.row, self.found = row, found


def calendar(column: pl.Series) -> StampArray:
    """Nanoseconds since 1970 (UTC, whatever the zone): 64 bits of them reach from 1677 to 2262."""
    import polars as pl

    unit = column.dtype.time_unit if isinstance(column.dtype, pl.Datetime) else "days"
    counts = column.to_physical().cast(pl.Int64)
    known = counts.is_not_null().to_numpy()
    figures = counts.fill_null(0).to_numpy()
    most = np.iinfo(np.int64).max // UNIT_NS[unit]
    far = known & ((figures > most) | (figures < -most))
    if np.any(far):
        row = int(np.argmax(far))
        raise FarTimeError(row, f"{figures[row]} {unit} since 1970")
    return np.where(known, figures * UNIT_NS[unit], NO_TIME)


def spans(column: pl.Series) -> Array:
    """Durations [s]; NaN where there is none."""
    import polars as pl

    assert isinstance(column.dtype, pl.Duration)
    known = column.is_not_null().to_numpy()
    figures = column.to_physical().fill_null(0).to_numpy()
    seconds = figures / (1_000_000_000 // UNIT_NS[column.dtype.time_unit])
    return np.where(known, seconds, np.nan)
