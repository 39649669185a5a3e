"""Rows that share a stamp: targets of one scan are kept, what is there twice is counted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from syncline_design.effects.record import Array
from syncline_design.logs.columns import GEODETIC, TARGET, TARGET_ID, TIME
from syncline_design.logs.refusals import refuse
from syncline_design.logs.stamps import Index, starts
from syncline_design.logs.tables import LogTable

MOST_TWINS = 0.5  # share of the rows
GIVEN_TWICE, SAME_STAMP = "row given twice", "duplicate stamp"
SAME_TARGET = "second row of a target at one stamp"


def without_twins(table: LogTable) -> LogTable:
    """One row for every stamp and target; what is left out is counted with its reason.

    The target is told by its id, else by its place; a log without targets has one row a stamp.
    """
    stamps = table.columns[TIME]
    same = stamps[1:] == stamps[:-1]
    if not np.any(same):
        return table
    beside = np.zeros(stamps.shape[0], dtype=bool)
    beside[1:] |= same
    beside[:-1] |= same
    rows = np.flatnonzero(beside)
    kept = np.ones(stamps.shape[0], dtype=bool)
    kept[rows] = _firsts(table, rows, [TIME, *target_names(table.columns)])
    left = int(np.count_nonzero(~kept))
    _demand_progress(table, left)
    again = int(np.count_nonzero(~_firsts(table, rows, list(table.columns)) & ~kept[rows]))
    other = SAME_TARGET if target_names(table.columns) else SAME_STAMP
    reasons = {reason: n for reason, n in ((GIVEN_TWICE, again), (other, left - again)) if n}
    rejected = {**table.rejected, **reasons}
    columns = {name: values[kept] for name, values in table.columns.items()}
    return replace(table, columns=columns, rejected=rejected)


def target_names(columns: Mapping[str, Array]) -> tuple[str, ...]:
    """Columns that tell the targets of one stamp apart."""
    if TARGET_ID in columns:
        return (TARGET_ID,)
    return tuple(n for n in (*TARGET, *(f"target_{g}" for g in GEODETIC)) if n in columns)


def one_a_stamp(table: LogTable) -> LogTable:
    """The first row of every stamp, of a file that is interpolated."""
    first = starts(table.columns[TIME])
    left = len(table) - first.shape[0]
    if not left:
        return table
    columns = {name: values[first] for name, values in table.columns.items()}
    return replace(table, columns=columns, rejected={**table.rejected, SAME_STAMP: left})


def _demand_progress(table: LogTable, left: int) -> None:
    if left > MOST_TWINS * len(table):
        raise refuse(
            table.path,
            "time stands still",
            field=TIME,
            found=f"{left} of {len(table)} rows have the stamp and target of another",
            hint="are the stamps cut short? Several targets at one stamp need a target_id each",
        )


def _firsts(table: LogTable, rows: Index, names: Sequence[str]) -> NDArray[np.bool_]:
    """Which of the rows are the first with their values in these columns (NaN equals NaN)."""
    order = np.lexsort([table.columns[name][rows] for name in reversed(names)])
    new = np.zeros(rows.shape[0], dtype=bool)
    new[:1] = True
    for name in names:
        values = table.columns[name][rows[order]]
        equal = (values[1:] == values[:-1]) | (np.isnan(values[1:]) & np.isnan(values[:-1]))
        new[1:] |= ~equal
    first = np.zeros(rows.shape[0], dtype=bool)
    first[order[new]] = True  # the sort is stable: of its like, the first in the file
    return first
