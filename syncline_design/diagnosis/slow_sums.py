"""Sums of whitened, weighted rows, by parts of a log: what columns say beside those held fixed.

With X the fixed columns (a model's own effects and the slow courses, prior precision D) and Z some
columns that are judged beside them, W the rows' weights, of all rows less one part
    I = Z'WZ - Z'WX (X'WX + D)^-1 X'WZ,   g = Z'We - Z'WX (X'WX + D)^-1 X'We.
X'WX + D of every part is factored once for whatever is judged beside it.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from syncline_design.diagnosis.judged import Judged
from syncline_design.diagnosis.positive import solver
from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass

LEAST_BLOCKS = 5
STEADY = 1e-2  # of the model's variance: blocks of an axis without noise agree by far better
LOST = 1e-7  # share of a column's information below which others hold it all


@dataclass(frozen=True, slots=True)
class Weighted:
    """Rows of the compared axes, whitened, N of them, with the weights of a robust fit.

    root (n, a, a): inverse root of each row's white covariance; fixed (N, f): columns that every
    fit holds, with their prior precision (f,), zero of what is free.
    """

    axes: tuple[int, ...]
    root: Array
    fixed: Array
    error: Array
    weight: Array
    prior: Array

    def whitened(self, columns: Array) -> Array:
        """Columns (n, 3, p) as (N, p)."""
        white: Array = self.root @ columns[:, list(self.axes)]
        return white.reshape(len(self.error), columns.shape[2])

    def sums(self, part: NDArray[np.int64]) -> tuple[Array, Array]:
        """X'WX (G, f, f) and X'We (G, f) of every part (n,) of the log."""
        found = _grouped(self, part)
        return found.normal, found.score


@dataclass(frozen=True, slots=True)
class _Grouped:
    """Fixed columns by parts: rows (N,) in the order of the parts, which end at `ends` (G + 1,)."""

    rows: NDArray[np.int64] | slice
    ends: NDArray[np.int64]
    weighted: Array  # W X (N, f) in that order
    normal: Array
    score: Array

    def across(self, columns: Array, weight: Array, error: Array) -> tuple[Array, Array, Array]:
        """X'WZ (G, f, p), Z'WZ (G, p, p) and Z'We (G, p), of Z (N, p)."""
        own, error = columns[self.rows], error[self.rows]
        weighted = weight[self.rows, None] * own
        parts = [slice(a, b) for a, b in itertools.pairwise(self.ends)]
        cross = [self.weighted[r].T @ own[r] for r in parts]
        normal = [weighted[r].T @ own[r] for r in parts]
        score = [weighted[r].T @ error[r] for r in parts]
        return np.array(cross), np.array(normal), np.array(score)


def _grouped(known: Weighted, part: NDArray[np.int64]) -> _Grouped:
    of_row = np.repeat(part, len(known.axes))
    order = np.argsort(of_row, kind="stable")
    ends = np.searchsorted(of_row[order], np.arange(int(of_row.max()) + 2))
    rows = slice(None) if np.all(order == np.arange(order.size)) else order
    own, error = known.fixed[rows], known.error[rows]
    weighted = known.weight[rows, None] * own
    parts = [slice(a, b) for a, b in itertools.pairwise(ends)]
    normal = np.array([weighted[r].T @ own[r] for r in parts])
    score = np.array([weighted[r].T @ error[r] for r in parts])
    return _Grouped(rows, ends, weighted, normal, score)


@dataclass(frozen=True, slots=True)
class _Held:
    """Fixed columns held by some of the rows: solve is (X'WX + D)^-1, values that of X'We."""

    solve: Callable[[Array], Array]
    values: Array

    def freed(self, cross: Array, normal: Array, score: Array) -> tuple[Array, Array]:
        """I and g of columns, freed of what is held."""
        return normal - cross.T @ self.solve(cross), score - cross.T @ self.values


def _held(normal: Array, score: Array, prior: Array) -> _Held:
    inner = normal + np.diag(prior)
    scale = np.sqrt(np.maximum(np.diag(inner), 0.0))
    scale[scale == 0.0] = 1.0
    scaled = inner / scale[:, None] / scale
    unseen = np.diag(inner) <= 0.0  # of which no row tells: it is held at zero
    scaled[unseen, unseen] = 1.0
    solve = solver(scaled, 1e-12)

    def solved(right: Array) -> Array:
        found: Array = solve(right / scale[:, None]) / scale[:, None]
        return found

    return _Held(solved, solved(score[:, None])[:, 0])


class HeldFixed:
    """Columns judged beside what is held fixed: by all rows, and by these less one part each."""

    def __init__(self, known: Weighted, groupings: Sequence[NDArray[np.int64]]) -> None:
        self._known = known
        self._groups = [_grouped(known, part) for part in groupings]
        first = self._groups[0]
        self._whole = _held(first.normal.sum(0), first.score.sum(0), known.prior)
        self._less = [_less(one, known.prior) for one in self._groups]

    def judged(self, groups: Sequence[Array]) -> list[Judged]:
        """Each group of columns (n, 3, p) alone."""
        known = self._known
        ends = np.cumsum([0, *(g.shape[2] for g in groups)])
        none = np.zeros((known.root.shape[0], 3, 0))
        columns = known.whitened(np.concatenate([none, *map(np.nan_to_num, groups)], axis=2))
        sums = [g.across(columns, known.weight, known.error) for g in self._groups]
        total = tuple(part.sum(0) for part in sums[0])
        whole = self._whole.freed(*total)
        seen = np.diag(whole[0]) > LOST * np.diag(total[1])
        less = [
            _each(held, own)
            for held, own in zip(self._less, sums, strict=True)
            if len(held) >= LEAST_BLOCKS
        ]
        places = [slice(a, b) for a, b in itertools.pairwise(ends)]
        return [_one(place, whole, less, seen) for place in places]


def _less(grouped: _Grouped, prior: Array) -> list[_Held]:
    """What is held by the rows less one part each; none where the parts are few."""
    if len(grouped.normal) < LEAST_BLOCKS:
        return []
    normal, score = grouped.normal.sum(0), grouped.score.sum(0)
    both = zip(grouped.normal, grouped.score, strict=True)
    return [_held(normal - n, score - s, prior) for n, s in both]


def _each(held: Sequence[_Held], parts: tuple[Array, Array, Array]) -> tuple[Array, Array]:
    """I (G, p, p) and g (G, p) of the log less each part."""
    total = [one.sum(0) for one in parts]
    found = [
        one.freed(*(whole - part for whole, part in zip(total, own, strict=True)))
        for one, own in zip(held, zip(*parts, strict=True), strict=True)
    ]
    return np.array([normal for normal, _ in found]), np.array([score for _, score in found])


def _one(
    place: slice,
    whole: tuple[Array, Array],
    less: Sequence[tuple[Array, Array]],
    seen: NDArray[np.bool_],
) -> Judged:
    """One group of columns: its values, and what the log less each part makes of them."""
    values, covariance = _solved(*whole, place, seen)
    jackknives = []
    for normals, scores in less:
        off, _ = _solved(normals, scores, place, seen)
        off -= off.mean(axis=0)
        count = len(off)
        spread = (count - 1) / count * off.T @ off
        least = np.maximum(STEADY * np.diag(covariance) - np.diag(spread), 0.0)
        jackknives.append((spread + np.diag(least), count))
    return Judged(values, covariance, tuple(jackknives))


def _solved(
    normal: Array, score: Array, place: slice, seen: NDArray[np.bool_]
) -> tuple[Array, Array]:
    """Values (..., p) and covariance of some columns; zero for those that are not seen."""
    both = seen[place, None] & seen[place]
    normal = np.where(both, normal[..., place, place], 0.0)
    scale = np.sqrt(np.maximum(np.diagonal(normal, axis1=-2, axis2=-1), 0.0))
    scale = np.where(scale == 0.0, 1.0, scale)
    squares = scale[..., :, None] * scale[..., None, :]
    if normal.shape[-1] == 1 and np.all(normal > 0.0):
        inverse = 1.0 / normal
    else:
        inverse = np.linalg.pinv(normal / squares, rcond=1e-10, hermitian=True) / squares
    return np.einsum("...ab,...b->...a", inverse, score[..., place] * seen[place]), inverse
