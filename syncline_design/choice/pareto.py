"""Dominance filters over columns of figures: which rows no other row makes superfluous."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from syncline_design.choice.options import Bools, Column, Floats, Indices
from syncline_design.machine.deadline import in_force
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.random_numbers import generator

Also = Callable[[int, int], bool] | None

BLOCK = 256
MOST_GROUPS = 32  # combinations of columns of few values
THIN_ABOVE = 3000  # rows from which a sample thins them out first
SAMPLE = 1000
DUST = 1e-13  # share by which sums of the same floats differ with the order of adding, and more
ROWS_PER_LOOK = 8192  # rows between two looks at the clock


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
    """keys and weak: smaller is better.  tie: order among rows equal in amount and error.

    keys: the amount first, the error last, limited amounts between.  weak: where it starts with an
    error, that of the row as it stands beside the one that only adds up.  A row replaces another
    when it is nowhere worse and either smaller in the amount, smaller in every error, or earlier in
    the tie order.  Less of a limited amount, or of the error that may not count in the end, does
    not settle a tie: whatever follows, both may end with the same amount and error.

    unknown: whether what follows may make the sum of a tie column unknown, which then no longer
    tells rows apart; amount_unknown: the same of the amount.
    """

    keys: Sequence[Column]
    weak: Sequence[Column] = ()
    tie: Sequence[Column] = ()
    guard: Guard | None = None
    unknown: bool = False
    amount_unknown: bool = False

    def __len__(self) -> int:
        return len(self.keys[0])

    def without_dust(self) -> Columns:
        """The same rows, with errors that only the order of adding keeps apart as the same."""
        keys, weak = list(self.keys), list(self.weak)
        if keys[-1].dtype == np.float64:
            keys[-1] = without_dust(keys[-1])
        if _is_error(weak):
            weak[0] = without_dust(weak[0])
        return replace(self, keys=keys, weak=weak)

    def take(self, rows: Indices) -> Columns:
        """Some of the rows."""
        guard = self.guard
        if guard is not None:
            guard = Guard(guard.safe[rows], guard.error[rows], guard.bound[rows])
        return Columns(
            [column[rows] for column in self.keys],
            [column[rows] for column in self.weak],
            [column[rows] for column in self.tie],
            guard,
            self.unknown,
            self.amount_unknown,
        )


def undominated(columns: Columns) -> Indices:
    """Indices, rising, of the rows that no other row replaces."""
    count = len(columns)
    if count <= 1:
        return np.arange(count)
    if count > THIN_ABOVE:
        left = _thinned(columns)
        return left[_exactly_undominated(columns.take(left))]
    return _exactly_undominated(columns)


def without_dust(errors: Floats) -> Floats:
    """Errors of which those that only the order of adding keeps apart are the same.

    Each takes the least of its cluster, so that equal errors are decided by the tie order.
    """
    if len(errors) < 2:
        return errors
    order = np.argsort(errors, kind="stable")
    rising = errors[order]
    starts = np.ones(len(errors), dtype=bool)
    starts[1:] = rising[:-1] < rising[1:] * (1.0 - DUST)
    if starts.all():
        return errors
    place = np.maximum.accumulate(np.where(starts, np.arange(len(errors)), 0))
    out = np.empty_like(errors)
    out[order] = rising[place]
    return out


def _exactly_undominated(columns: Columns) -> Indices:
    columns, count = columns.without_dust(), len(columns)
    ties = tie_rank(columns.tie, count)
    order = np.lexsort((ties, *_sortable(columns.weak), *_sortable(columns.keys)))
    plain = not columns.weak and not columns.amount_unknown and columns.guard is None
    if len(columns.keys) == 2 and plain and not columns.unknown:
        return np.sort(order[_staircase(columns.keys[1][order])])
    table = _Sorted(columns, order, ties[order])
    return np.sort(order[table.survivors()])


def _thinned(columns: Columns) -> Indices:
    """Rows left after those that the front of a sample replaces: most, at little cost."""
    count = len(columns)
    sample = np.unique(generator(0, bits=np.random.PCG64).integers(0, count, SAMPLE))
    best = sample[_exactly_undominated(columns.take(sample))]
    amount = columns.keys[0]
    best = best[np.argsort(amount[best], kind="stable")]
    place = np.searchsorted(amount[best], amount, side="right") - 1
    left = np.flatnonzero(place >= 0)
    kept = np.flatnonzero(place < 0)
    for column in (*columns.keys[1:], *columns.weak):
        values = column[best]
        lowest = np.maximum.accumulate(np.where(_staircase(values), np.arange(len(best)), 0))
        left = left[~_clearly_replaces(columns, best[lowest[place[left]]], left)]
    return np.sort(np.concatenate([kept, left]))


def _clearly_replaces(columns: Columns, first: Indices, second: Indices) -> Bools:
    """Whether rows replace others without any question of ties."""
    out = _settled(columns, first, second, DUST)
    for column in (*columns.keys, *columns.weak):
        out &= np.asarray(column[first] <= column[second], dtype=bool)
    guard = columns.guard
    if guard is not None:
        alike = guard.error[first] >= guard.error[second]
        alike &= guard.bound[first] <= guard.bound[second]
        out &= guard.safe[first] | alike
    return out


def _settled(columns: Columns, first: Indices, second: Indices, margin: float = 0.0) -> Bools:
    """Whether rows that are nowhere worse end smaller in amount or error than others for sure."""
    keys, weak = columns.keys, columns.weak
    errors = [keys[-1], *weak[: 1 if _is_error(weak) else 0]]
    below = [_below(column[first], column[second], margin) for column in errors]
    out = np.logical_and.reduce(below)
    if not columns.amount_unknown:
        out = out | np.asarray(keys[0][first] < keys[0][second], dtype=bool)
    return np.asarray(out)


def _below(first: Column, second: Column, margin: float) -> Bools:
    """Whether figures are smaller by more than a share of themselves."""
    if margin and second.dtype == np.float64:
        second = second * (1.0 - margin)  # errors are not negative
    return np.asarray(first < second, dtype=bool)


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


def _one_staircase(
    amount: list[Any], first: list[float], second: list[float], ties: list[int], also: Also
) -> list[int]:
    """Rows by rising amount that no earlier row replaces: the inner loop of the merge."""
    one_at: list[float] = []
    two_at: list[float] = []
    row_at: list[int] = []
    kept: list[int] = []
    for row, (one, two) in enumerate(zip(first, second, strict=True)):
        place = bisect_right(one_at, one)
        if place and two_at[place - 1] <= two:
            other = row_at[place - 1]
            less = first[other] < one and second[other] < two
            ahead = ties[other] < ties[row] and (also is None or also(other, row))
            if not (less or amount[other] < amount[row] or ahead):
                kept.append(row)
            continue
        kept.append(row)
        end = place
        while end < len(two_at) and two_at[end] >= two:
            end += 1
        if place and one_at[place - 1] == one:
            place -= 1
        one_at[place:end] = [one]
        two_at[place:end] = [two]
        row_at[place:end] = [row]
    return kept


def _is_error(weak: Sequence[Column]) -> bool:
    return bool(weak) and weak[0].dtype == np.float64


_Steps = tuple[list[float], list[float], list[int]]  # first rising, second falling, row


def _add(steps: _Steps, one: float, two: float, row: int) -> None:
    """Take a row into pairs none of which is smaller in both, without those it replaces."""
    first, second, rows = steps
    start = end = bisect_right(first, one)
    if start and second[start - 1] <= two:
        return
    if start and first[start - 1] == one:
        start -= 1
    while end < len(first) and second[end] >= two:
        end += 1
    first[start:end] = [one]
    second[start:end] = [two]
    rows[start:end] = [row]


class _Sorted:
    """Rows in sorted order: a row can only be replaced by an earlier one."""

    def __init__(self, columns: Columns, order: Indices, ties: Indices) -> None:
        self.given, self.place, self.ties = columns.take(order), order, ties
        self.keys = self.given.keys
        self.columns = [*self.keys, *self.given.weak]
        # The error, and the weak column beside it (the error again where there is none).
        value = len(self.keys) - 1
        self.stepped = (value, len(self.keys) if _is_error(columns.weak) else value)
        self.guard = self.given.guard

    def replaces(self, first: Indices, second: Indices) -> Bools:
        """Whether rows `first` replace rows `second` (shapes broadcast)."""
        worse = np.zeros(np.broadcast_shapes(first.shape, second.shape), dtype=bool)
        for column in self.columns:
            worse |= np.asarray(column[first] > column[second], dtype=bool)
        out: Bools = (_settled(self.given, first, second) | self._ahead(first, second)) & ~worse
        if self.guard is not None:
            g = self.guard
            alike = (g.error[first] >= g.error[second]) & (g.bound[first] <= g.bound[second])
            out = out & (g.safe[first] | alike)
        return out

    def _ahead(self, first: Indices, second: Indices) -> Bools:
        """Whether rows come before others in the tie order, whichever sums end unknown."""
        out = np.asarray(self.ties[first] < self.ties[second])
        if self.given.unknown:
            out &= self.place[first] < self.place[second]
            for column in self.given.tie:
                out &= np.asarray(column[first] <= column[second], dtype=bool)
        return out

    def _also_ahead(self, left: Indices) -> Also:
        """What `_ahead` asks besides the rank of two of the remaining rows; None: nothing."""
        if not self.given.unknown:
            return None
        columns = [c[left].tolist() for c in (self.place, *self.given.tie)]
        return lambda first, second: all(c[first] <= c[second] for c in columns)

    def survivors(self) -> Indices:
        """Indices into the sorted order of the rows that stay."""
        left = np.arange(len(self.ties))
        for column in self.columns[1:]:
            left = left[~self.replaces(self._lowest_before(column, left), left)]
        groups = self._groups(left)
        return self._in_blocks(left) if groups is None else self._in_staircases(left, *groups)

    def _in_blocks(self, left: Indices) -> Indices:
        """Each block of rows against all rows kept before it; OutOfTime between two blocks."""
        kept = left[:0]
        deadline = in_force()
        for start in range(0, len(left), BLOCK):
            block = left[start : start + BLOCK]
            for before in range(0, len(kept), ROWS_PER_LOOK):
                deadline.check()
                some = kept[before : before + ROWS_PER_LOOK]
                block = block[~self.replaces(some[:, None], block[None, :]).any(axis=0)]
            block = block[~self.replaces(block[:, None], block[None, :]).any(axis=0)]
            kept = np.concatenate([kept, block])
        return kept

    def _groups(self, left: Indices) -> tuple[list[int], list[list[int]]] | None:
        """Group of each row by its columns of few values, and the groups that may replace each.

        None where there are too many, or a guard: then rows are compared in blocks.
        """
        if self.guard is not None:
            return None
        few = [column for k, column in enumerate(self.columns) if k not in (0, *self.stepped)]
        if not few:
            return [0] * len(left), [[0]]
        if any(column.dtype == object for column in few):
            return None
        kinds, group = np.unique(
            np.column_stack([c[left] for c in few]), axis=0, return_inverse=True
        )
        if len(kinds) > MOST_GROUPS:
            return None
        below = [np.flatnonzero((kinds <= kind).all(axis=1)).tolist() for kind in kinds]
        return group.reshape(-1).tolist(), below

    def _in_staircases(self, left: Indices, group: list[int], below: list[list[int]]) -> Indices:
        """Rows by rising first key against the staircases of the other two columns so far."""
        first, second = (self.columns[k][left].tolist() for k in self.stepped)
        ties, also = self.ties[left].tolist(), self._also_ahead(left)
        amount = [0] * len(left) if self.given.amount_unknown else self.keys[0][left].tolist()
        if len(below) == 1:
            return left[_one_staircase(amount, first, second, ties, also)]
        stairs: list[_Steps] = [([], [], []) for _ in below]
        asked = [[stairs[g] for g in kinds] for kinds in below]
        kept = []
        deadline = in_force()
        for row, (one, two) in enumerate(zip(first, second, strict=True)):
            if row % ROWS_PER_LOOK == 0 and row:
                deadline.check()
            for ones, twos, rows in asked[group[row]]:
                place = bisect_right(ones, one) - 1
                if place < 0 or twos[place] > two:
                    continue
                other = rows[place]
                if (
                    amount[other] < amount[row]
                    or (first[other] < one and second[other] < two)
                    or (ties[other] < ties[row] and (also is None or also(other, row)))
                ):
                    break
            else:
                kept.append(row)
                _add(stairs[group[row]], one, two, row)
        return left[kept]

    def _lowest_before(self, column: Column, left: Indices) -> Indices:
        """For each remaining row the row so far (itself included) that is lowest in a column."""
        values = column[left]
        place = np.where(_staircase(values), np.arange(len(left)), 0)
        return left[np.maximum.accumulate(place)]
