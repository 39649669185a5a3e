"""The distribution of simulated errors: all values while they fit, else counts in fine bins."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass

KEPT_VALUES = 1_000_000  # 8 MB; beyond, memory must not grow with the number of samples
_BITS = 12  # bins per octave: 2^12, so a bin is 0.024 % wide, and values spread within it
_LEAST_EXPONENT = -64  # below 5e-20 m counts as that
_OCTAVES = 96
_BINS = _OCTAVES << _BITS
_BASE = (1023 + _LEAST_EXPONENT) << _BITS
Counts = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class ErrorValues:
    """Every error [m], in the order of drawing."""

    errors_m: Array

    @property
    def count(self) -> int:
        return int(self.errors_m.shape[0])

    def order_statistics(self, ranks: Sequence[int]) -> tuple[float, ...]:
        """The rank-th smallest errors [m], 1 the smallest; 0 below the first, inf above the last.

        NaN counts as larger than any number.
        """
        inside = sorted({rank - 1 for rank in ranks if 1 <= rank <= self.count})
        parted = np.partition(self.errors_m, inside) if inside else self.errors_m
        return tuple(
            float(parted[rank - 1]) if 1 <= rank <= self.count else _beyond(rank) for rank in ranks
        )

    def within(self, limit_m: float) -> int:
        """How many errors are at most limit_m (NaN is not)."""
        return int(np.count_nonzero(self.errors_m <= limit_m))

    def histogram(self, bins: int) -> tuple[Array, Array]:
        """(edges [m] (bins + 1,), density [1/m] (bins,)) over the finite errors."""
        finite = self.errors_m
        if not np.all(np.isfinite(finite)):
            finite = finite[np.isfinite(finite)]
        top = float(finite.max(initial=0.0)) or 1.0
        edges = np.linspace(0.0, top, bins + 1)
        index = np.minimum((finite * (bins / top)).astype(np.intp), bins - 1)
        counts = np.bincount(index, minlength=bins)
        return edges, counts / (self.count * np.diff(edges))


def _beyond(rank: int) -> float:
    return 0.0 if rank < 1 else math.inf


@dataclass(frozen=True, slots=True)
class Binned:
    """Counts of errors by the leading bits of their floating-point pattern."""

    counts: Counts

    @property
    def count(self) -> int:
        return int(self.counts.sum())

    def order_statistics(self, ranks: Sequence[int]) -> tuple[float, ...]:
        """The rank-th smallest errors [m], spread evenly within their bins; see `Values`."""
        total = np.cumsum(self.counts)
        return tuple(self._order_statistic(rank, total) for rank in ranks)

    def _order_statistic(self, rank: int, total: Counts) -> float:
        if not 1 <= rank <= int(total[-1]):
            return _beyond(rank)
        index = int(np.searchsorted(total, rank))
        if index == _BINS - 1:
            return math.inf
        before = int(total[index]) - int(self.counts[index])
        low, high = bin_edges(np.array([index, index + 1]))
        return float(low + (high - low) * (rank - before - 0.5) / int(self.counts[index]))

    def within(self, limit_m: float) -> int:
        """How many errors are at most limit_m, its own bin shared out in proportion."""
        index = int(bin_index(np.array([limit_m]))[0])
        low, high = (float(edge) for edge in bin_edges(np.array([index, index + 1])))
        share = min(max((limit_m - low) / (high - low), 0.0), 1.0)
        return int(self.counts[:index].sum()) + int(share * int(self.counts[index]))

    def histogram(self, bins: int) -> tuple[Array, Array]:
        """(edges [m], density [1/m]), from the bins' counts."""
        used = np.flatnonzero(self.counts[:-1])
        top = float(bin_edges(np.array([used[-1] + 1]))[0]) if used.size else 1.0
        edges = np.linspace(0.0, top, bins + 1)
        below = np.array([self.within(float(edge)) for edge in edges])
        below[0] = 0
        return edges, np.diff(below) / (self.count * np.diff(edges))


def bin_index(errors_m: Array) -> NDArray[np.int64]:
    """Index of each error's bin; NaN and what is too large fall into the last."""
    pattern = np.ascontiguousarray(errors_m).view(np.int64) >> (52 - _BITS)
    pattern -= _BASE
    clipped: NDArray[np.int64] = np.clip(pattern, 0, _BINS - 1, out=pattern)
    return clipped


def bin_edges(index: NDArray[np.int64]) -> Array:
    """Lower edge [m] of each bin, 0 for the first."""
    edges = ((index.astype(np.int64) + _BASE) << (52 - _BITS)).view(np.float64)
    return np.where(index == 0, 0.0, edges)


def no_counts() -> Counts:
    """Bins without a count yet."""
    return np.zeros(_BINS, dtype=np.int64)


def add_counts(counts: Counts, errors_m: Array) -> None:
    """Count errors into `counts`, in place."""
    index = bin_index(errors_m)
    least = int(index.min())
    found = np.bincount(index - least)
    counts[least : least + found.shape[0]] += found
