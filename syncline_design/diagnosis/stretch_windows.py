"""Windows of all lengths over a log: how clear one candidate is in each.

The squares b' (X' W X) b of `stretches` from running sums, and the chance of each of them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.distributions import (
    chi_square_limit,
    chi_square_log_beyond,
    fisher_log_beyond,
)

LEAST_ROWS: Final = 3  # of a window
GROWTH: Final = math.sqrt(2.0)  # from one length to the next
LONGEST: Final = 0.5  # of the log; what acts longer than that is looked for by the search
FEW: Final = 8.0  # windows side by side, below which their median says nothing
MEDIAN_SPREAD: Final = 2.33  # of the median of m squares of a normal, relative: over root m
PLACES: Final = 3.0  # windows that differ, for one that does not overlap
DOUBT: Final = 0.005  # chance that a sound log has such a window, of one candidate: a doubt
FLANK: Final = 30  # blocks before and after a window, at least, that say how loud it is there
FLANK_LEAST: Final = 24  # components of a side that says so
ALONE: Final = 32  # blocks of a window, beyond which one of them decides nothing
LOUDER: Final = 1.5  # variance in a window over the usual one, up to which it is usual


@dataclass(frozen=True, slots=True)
class Windows:
    """Windows of one length in blocks: their log p, and what is needed to tell more of the best."""

    length: int
    log_p: Array  # (k,) paid for
    clear: Array  # (k,) the same with all blocks, which tells best where something begins and ends
    scale2: float
    alone: Array  # (k, p) information on each parameter alone


@dataclass(frozen=True, slots=True)
class BlockSums:
    """Sums up to each block (B + 1, ...): X'WX, X'We of the remainder and of drawn ones, e'We and
    components compared; blocks' ends."""

    normal: Array
    score: Array
    square: Array
    count: Array
    first: Array
    time_s: Array

    def inside(self, length: int) -> tuple[Array, Array, Array, Array]:
        """The same of every window of so many blocks."""
        parts = (self.normal, self.score, self.square, self.count)
        found = tuple(part[length:] - part[:-length] for part in parts)
        return found[0], found[1], found[2], found[3]


def cumulated(part: Array, edges: Array) -> Array:
    total = np.concatenate([np.zeros((1, *part.shape[1:])), np.cumsum(part, axis=0)])
    found: Array = total[edges]
    return found


def _lengths(sums: BlockSums) -> list[int]:
    blocks = len(sums.first) - 1
    least = max(1, math.ceil(LEAST_ROWS * blocks / sums.first[-1]))
    found, length = [], float(least)
    while length <= LONGEST * blocks:
        found.append(round(length))
        length *= GROWTH
    return sorted(set(found))


def scanned(sums: BlockSums, width: int) -> Iterator[Windows]:
    """All windows, length by length; the noise of a length is at least that of the shorter ones."""
    lengths = _lengths(sums)
    blocks = len(sums.first) - 1
    middle = float(chi_square_limit(0.5, width))
    base = floor2 = 0.0
    usual = math.inf
    for length in lengths:
        normal, score, square, rows = sums.inside(length)
        gains, seen = squares(normal, score, width)
        own = gains[:, 0]
        shown = float(np.median(own[seen])) / middle if np.any(seen) else 1.0
        drawn = float(np.mean(gains[seen, 1:])) / width if np.any(seen) else 1.0
        base = base or shown / max(drawn, 1e-300)
        count = blocks / length
        doubt = 1.0 + 2.0 * MEDIAN_SPREAD / math.sqrt(width * count)
        beyond = shown / doubt if count >= FEW else 0.0
        floor2 = max(floor2, base * drawn, beyond)
        left = np.maximum(square - own, 0.0) / np.maximum(rows - width, 1.0)
        usual = min(usual, float(np.median(left[seen])) if np.any(seen) else 1.0)
        local = ((left, np.maximum(rows - width, 1.0)), _beside(sums, length))
        log_p = _chances(own, width, floor2, usual, local)
        charge = math.log(len(lengths) * PLACES * count)
        clear = np.where(seen, log_p + charge, 0.0)
        doubted = np.logical_and(seen, log_p + charge < math.log(DOUBT))
        if np.any(doubted) and length <= ALONE:
            least = own.copy()
            least[doubted] = _without_one(sums, length, np.flatnonzero(doubted), width)
            log_p = np.maximum(log_p, log_chi2(least / floor2, width))
        log_p = np.where(seen, np.minimum(log_p + charge, 0.0), 0.0)
        yield Windows(length, log_p, clear, floor2, np.einsum("kpp->kp", normal))


def _chances(
    own: Array, width: int, floor2: float, usual: float, local: Sequence[tuple[Array, Array]]
) -> Array:
    """log p of the squares of windows of one length, none paid for.

    local: variances found in and beside each window, with their degrees of freedom; one beyond
    LOUDER times the usual variance makes the noise louder.
    """
    log_p = log_chi2(own / floor2, width)
    for variance, freedom in local:
        louder = np.maximum(variance / max(LOUDER * usual, 1e-300), 1.0)
        by_usual = log_chi2(own / (floor2 * louder), width)
        by_local = _log_f(own / (width * np.maximum(variance, 1e-300)), width, freedom)
        log_p = np.where(louder > 1.0, np.maximum(log_p, np.maximum(by_usual, by_local)), log_p)
    return log_p


def _beside(sums: BlockSums, length: int) -> tuple[Array, Array]:
    """Mean square next to every window, on its louder side, and the components it is of."""
    blocks = len(sums.first) - 1
    first = np.arange(blocks - length + 1)
    reach = max(length, FLANK)
    edges = ((np.maximum(first - reach, 0), first),
             (first + length, np.minimum(first + length + reach, blocks)))  # fmt: skip
    found, known = np.zeros(len(first)), np.ones(len(first))
    for start, end in edges:
        rows = sums.count[end] - sums.count[start]
        mean = (sums.square[end] - sums.square[start]) / np.maximum(rows, 1.0)
        more = (rows >= FLANK_LEAST) & (mean > found)
        found, known = np.where(more, mean, found), np.where(more, rows, known)
    return found, known


def _without_one(sums: BlockSums, length: int, which: NDArray[np.int64], width: int) -> Array:
    """The least b' M b of some windows without any one of their blocks; of one block none."""
    normal = sums.normal[which + length] - sums.normal[which]
    score = sums.score[which + length, :1] - sums.score[which, :1]
    least = np.full(len(which), 0.0 if length == 1 else math.inf)
    for k in range(length if length > 1 else 0):
        at = which + k
        fewer = normal - (sums.normal[at + 1] - sums.normal[at])
        gains, _ = squares(fewer, score - (sums.score[at + 1, :1] - sums.score[at, :1]), width)
        least = np.minimum(least, gains[:, 0])
    return least


def log_chi2(square: Array, freedom: int) -> Array:
    """log of the upper tail of chi-square, by its leading term where the library's underflows."""
    found = chi_square_log_beyond(square, freedom)
    return np.where(np.isfinite(found), found, -0.5 * square)


def _log_f(share: Array, first: int, second: Array) -> Array:
    """The same of F: -(n2 / 2) log(1 + n1 F / n2)."""
    found = fisher_log_beyond(share, first, second)
    return np.where(np.isfinite(found), found, -0.5 * second * np.log1p(first * share / second))


def squares(normal: Array, score: Array, width: int) -> tuple[Array, Array]:
    """b' M b of every window and log (k, 1 + draws), and whether all parameters are seen in it."""
    diagonal = np.einsum("kpp->kp", normal)
    scale = np.sqrt(np.maximum(diagonal, 1e-300))
    scaled = normal / scale[:, :, None] / scale[:, None, :]
    scaled = scaled + 1e-9 * np.eye(width)
    right = np.swapaxes(score / scale[:, None, :], 1, 2)
    values = np.linalg.solve(scaled, right)
    typical = np.median(diagonal, axis=0)
    seen = np.all(diagonal > 1e-6 * np.maximum(typical, 1e-300), axis=1)
    return np.sum(values * right, axis=1), seen
