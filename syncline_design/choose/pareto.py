"""Dominance filters over columns of figures: which rows no other row makes superfluous."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Column = NDArray[Any]
Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Indices = NDArray[np.intp]

BLOCK = 256


@dataclass(frozen=True, slots=True)
class Guard:
    """When a row may stand in for another although a lower bound on the error is in force.

    safe: rows that satisfy the bound whatever is added to them.  An unsafe row replaces another
    only with at least its error and at most its timing bound.
    """

    safe: Bools
    error: Floats
    bound: Floats


@dataclass(frozen=True, slots=True)
class Columns:
    """keys and weak: smaller is better.  tie: order among rows equal in every key.

    A row replaces another when it is nowhere worse and either smaller in a key or earlier in the
    tie order; being smaller in a weak column alone does not settle a tie of names.
    """

    keys: Sequence[Column]
    weak: Sequence[Column] = ()
    tie: Sequence[Column] = ()
    guard: Guard | None = None

    def __len__(self) -> int:
        return len(self.keys[0])


def undominated(columns: Columns) -> Indices:
    """Indices, rising, of the rows that no other row replaces."""
    count = len(columns)
    if count <= 1:
        return np.arange(count)
    ties = tie_rank(columns.tie, count)
    order = np.lexsort((ties, *_sortable(columns.weak), *_sortable(columns.keys)))
    if len(columns.keys) == 2 and not columns.weak and columns.guard is None:
        return np.sort(order[_staircase(columns.keys[1][order])])
    table = _Sorted(columns, order, ties[order])
    return np.sort(order[table.survivors()])


def tie_rank(tie: Sequence[Column], count: int) -> Indices:
    """Place of each row in the tie order: its tie columns first, then its position."""
    places = np.arange(count)
    if not tie:
        return places
    rank = np.empty(count, dtype=np.intp)
    rank[np.lexsort((places, *_sortable(tie)))] = places
    return rank


def _sortable(columns: Sequence[Column]) -> list[Column]:
    """Columns for np.lexsort, last one first; arbitrary-size integers as their ranks."""
    return [
        np.unique(c, return_inverse=True)[1] if c.dtype == object else c for c in reversed(columns)
    ]


def _staircase(column: Column) -> Bools:
    """Rows smaller than every row before them."""
    lowest = np.minimum.accumulate(column)
    keep = np.ones(len(column), dtype=bool)
    keep[1:] = column[1:] < lowest[:-1]
    return keep


class _Sorted:
    """Rows in sorted order: a row can only be replaced by an earlier one."""

    def __init__(self, columns: Columns, order: Indices, ties: Indices) -> None:
        self.keys = [column[order] for column in columns.keys]
        self.columns = self.keys + [column[order] for column in columns.weak]
        self.ties = ties
        given = columns.guard
        self.guard = given and Guard(given.safe[order], given.error[order], given.bound[order])

    def replaces(self, first: Indices, second: Indices) -> Bools:
        """Whether rows `first` replace rows `second` (shapes broadcast)."""
        worse = np.zeros(np.broadcast_shapes(first.shape, second.shape), dtype=bool)
        for column in self.columns:
            worse |= np.asarray(column[first] > column[second], dtype=bool)
        settled = self.ties[first] < self.ties[second]
        for key in self.keys:
            settled = settled | np.asarray(key[first] < key[second], dtype=bool)
        out: Bools = settled & ~worse
        if self.guard is not None:
            g = self.guard
            alike = (g.error[first] >= g.error[second]) & (g.bound[first] <= g.bound[second])
            out = out & (g.safe[first] | alike)
        return out

    def survivors(self) -> Indices:
        """Indices into the sorted order of the rows that stay."""
        left = np.arange(len(self.ties))
        for column in self.columns[1:]:
            left = left[~self.replaces(self._lowest_before(column, left), left)]
        kept = left[:0]
        for start in range(0, len(left), BLOCK):
            block = left[start : start + BLOCK]
            if len(kept):
                block = block[~self.replaces(kept[:, None], block[None, :]).any(axis=0)]
            block = block[~self.replaces(block[:, None], block[None, :]).any(axis=0)]
            kept = np.concatenate([kept, block])
        return kept

    def _lowest_before(self, column: Column, left: Indices) -> Indices:
        """For each remaining row the row so far (itself included) that is lowest in a column."""
        values = column[left]
        place = np.where(_staircase(values), np.arange(len(left)), 0)
        return left[np.maximum.accumulate(place)]
