"""Whether what stands out in a stretch is a constant there, or slow noise of a sensor.

Noise of an angle that lasts for seconds turns what it tells as a mounting does, and on a curve a
turn looks like a delay.  A stretch is cut into blocks, in which
    e = Z b(t) + X a + w,
X a constant of p parameters (a delay, a turn), Z what one standard deviation of each reading of a
sensor does, w the row's noise, and b(t) first-order Gauss-Markov:
    cov(b_j, b_k) = c^2 exp(-|t_j - t_k| / T) in every reading.
With s = Z' W e, N = Z' W Z (block diagonal), K = L L' of all blocks and M = 1 + L' N L,
    log p(e) = (1/2) s' L M^-1 L' s - (1/2) log det M + what is the same of all sensors and sizes,
and a constant beside the course adds (1/2) u' J^+ u - (p/2) log m of m blocks,
    J = sum X' W X - H' L M^-1 L' H,   u = sum X' W e - H' L M^-1 L' s,   H = Z' W X inside.
The best course of any sensor is held against the best constant beside the best course.  Within the
stretch a louder while shows whether it goes on as one value, and in four lengths around it whether
it comes and goes at once: noise may do either, so that the lesser gain counts.
Sources: Rasmussen and Williams, Gaussian Processes (2006), sec. 2.7 (a basis of vague prior
beside a process) and 4.2.1 (exponential covariance); Schwarz, Ann. Statist. 6 (1978).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass

Indices = NDArray[np.int64]
BLOCKS: Final = 10  # of the stretch
AROUND: Final = 1.5  # of its length, on either side
SIZES: Final = (0.02, 0.06, 0.2, 0.4, 0.7, 1.0, 1.7, 3.0)  # of the course, over what stands out
MEMORIES: Final = (0.06, 0.12, 0.25, 0.5, 1.0, 2.0, 4.0)  # of the course, over the stretch's length
JITTER: Final = 1e-9  # keeps courses of long memory invertible


@dataclass(frozen=True, slots=True)
class CourseRows:
    """Whitened rows: stamps (n,), what is left (n, 3), what every sensor's noise does (n, 3, q),
    and what every constant that is asked does (n, 3, p)."""

    time_s: Array
    left: Array
    noises: tuple[Array, ...]
    constants: tuple[Array, ...]


@dataclass(frozen=True, slots=True)
class _Sums:
    """Of m blocks, by one sensor: N (m, q, q), s (m, q), and of all constants side by side
    H (m, q, P), X'WX (P, P), X'We (P,) within the stretch."""

    normal: Array
    score: Array
    across: Array
    own: Array
    told: Array


@dataclass(frozen=True, slots=True)
class OverNoise:
    """Nat that the best constant gains over the best course of noise alone, its figures paid for;
    what each sensor's course is behind the best of them."""

    gain: float
    behind: tuple[float, ...]


def over_noise(rows: CourseRows, from_s: float, to_s: float) -> OverNoise:
    """The constants in a stretch against every sensor's slow noise; too few rows show no noise."""
    inside = np.flatnonzero((rows.time_s >= from_s) & (rows.time_s <= to_s))
    if len(inside) < BLOCKS or not to_s > from_s or not rows.noises:
        return OverNoise(math.inf, tuple(math.inf for _ in rows.noises))
    first, last = int(inside[0]), int(inside[-1]) + 1
    edges = np.round(np.linspace(first, last, BLOCKS + 1)).astype(np.int64)
    within = _gain(rows, edges, (first, last))
    reach_s = AROUND * (to_s - from_s)
    low = int(np.searchsorted(rows.time_s, from_s - reach_s))
    high = int(np.searchsorted(rows.time_s, to_s + reach_s, "right"))
    per = max((last - first) // BLOCKS, 1)
    before, after = np.arange(first, low, -per)[:0:-1], np.arange(last, high, per)[1:]
    if not before.size and not after.size:
        return within
    wide = _gain(rows, np.concatenate([before, edges, after]), (first, last))
    return min(within, wide, key=lambda one: one.gain)


def _gain(rows: CourseRows, edges: Indices, ends: tuple[int, int]) -> OverNoise:
    """Over some blocks, of a stretch between the rows `ends`."""
    length_s = float(rows.time_s[ends[1] - 1] - rows.time_s[ends[0]])
    middle_s = 0.5 * (rows.time_s[edges[:-1]] + rows.time_s[edges[1:] - 1])
    apart = np.abs(middle_s[:, None] - middle_s) / length_s
    roots = [np.linalg.cholesky(np.exp(-apart / memory) + JITTER * np.eye(len(apart)))
             for memory in MEMORIES]  # fmt: skip
    widths = [each.shape[2] for each in rows.constants]
    alone, beside = [-math.inf] * len(rows.noises), np.full(len(widths), -math.inf)
    for k, noise in enumerate(rows.noises):
        sums = _sums(rows, noise, edges, ends)
        size = _as_large(sums, widths[0])
        for root, over in itertools.product(roots, SIZES):
            found, more = _likelihoods(sums, over * size * root, widths)
            alone[k], beside = max(alone[k], found), np.maximum(beside, found + more)
    charge = 0.5 * np.array(widths) * math.log(len(middle_s))
    best = max(alone)
    return OverNoise(float(np.max(beside - charge)) - best, tuple(best - one for one in alone))


def _sums(rows: CourseRows, noise: Array, edges: Indices, ends: tuple[int, int]) -> _Sums:
    part, starts = slice(int(edges[0]), int(edges[-1])), edges[:-1] - edges[0]
    stamp = np.arange(part.start, part.stop)
    inside = ((stamp >= ends[0]) & (stamp < ends[1]))[:, None, None]
    noise, left = noise[part], rows.left[part]
    constant = np.concatenate([each[part] for each in rows.constants], axis=2) * inside
    return _Sums(
        np.add.reduceat(np.einsum("nij,nik->njk", noise, noise), starts),
        np.add.reduceat(np.einsum("nij,ni->nj", noise, left), starts),
        np.add.reduceat(np.einsum("nij,nik->njk", noise, constant), starts),
        np.einsum("nij,nik->jk", constant, constant),
        np.einsum("nij,ni->j", constant, left),
    )


def _as_large(sums: _Sums, width: int) -> float:
    """The size of a course that makes as much of the stretch as the first constant does alone."""
    told, own = sums.told[:width], sums.own[:width, :width]
    made = float(told @ np.linalg.pinv(own, hermitian=True) @ told)
    inside = np.any(sums.across != 0.0, axis=(1, 2))
    most = float(np.einsum("kpp->", sums.normal[inside]))
    return math.sqrt(max(made, 0.0) / max(most, 1e-300))


def _likelihoods(sums: _Sums, root: Array, widths: Sequence[int]) -> tuple[float, Array]:
    """Log-likelihood of a course alone, and what each constant beside it adds."""
    blocks, q = sums.score.shape
    whole = np.kron(root, np.eye(q))
    both = np.concatenate([sums.score[:, :, None], sums.across], axis=2).reshape(blocks * q, -1)
    spread = np.einsum("kij,kjl->kil", sums.normal, whole.reshape(blocks, q, -1))
    inner = np.eye(blocks * q) + whole.T @ spread.reshape(blocks * q, -1)
    low = np.linalg.cholesky(inner)
    half = np.linalg.solve(low, whole.T @ both)
    alone = 0.5 * float(half[:, 0] @ half[:, 0]) - float(np.sum(np.log(np.diag(low))))
    told = sums.told - half[:, 1:].T @ half[:, 0]
    known = sums.own - half[:, 1:].T @ half[:, 1:]
    ends = np.cumsum([0, *widths])
    parts = [slice(int(a), int(b)) for a, b in itertools.pairwise(ends)]
    more = [0.5 * float(told[p] @ np.linalg.pinv(known[p, p], hermitian=True) @ told[p])
            for p in parts]  # fmt: skip
    return alone, np.array(more)
