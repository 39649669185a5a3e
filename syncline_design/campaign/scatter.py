"""How much an effect differs from run to run, and what a change weighs beside that (`changes`)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from syncline_design.campaign.column_sizes import column_sizes
from syncline_design.campaign.pool import Index, inverted
from syncline_design.campaign.trends import shapes
from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass

RUNS_KNOWN: Final = 17.0  # runs that the noise fitted counts for, against the scatter of runs
APART: Final = (1.0, 3.0, 10.0)  # bounds of a run by which an effect may differ from run to run
DIFFERING: Final = 0.3  # odds of some effect differing from run to run against none doing so
ROUNDED: Final = 1e-12


@dataclass(frozen=True, slots=True)
class EffectInRuns:
    """Information (n, G, p, p) of single runs about the terms of a group and its score (n, G, p),
    all that is common taken off; seen (n, G): parameters that each run says anything of; inside
    (G,): variance inside runs over that fitted."""

    normal: Array
    score: Array
    seen: Index
    inside: Array


@dataclass(frozen=True, slots=True)
class RunScatter:
    """Beside a change of every course, and of none, by term of a group: (2 look - 1, G).

    square, free: R and its free values f.  factor: their variance over that fitted as far as it is
    known, R taken as f at least, for what the noise inside runs makes is always there.
    runs: what these are of.
    """

    factor: Array
    square: Array
    free: Index
    runs: EffectInRuns

    @classmethod
    def of(cls, squares: Array, runs: EffectInRuns) -> RunScatter:
        """squares (2 look - 1, G): R."""
        seen, size = runs.seen, runs.score.shape[2]
        before = np.cumsum(seen, axis=0)
        after = before[-1] - before
        parted = np.maximum(before - size, 0) + np.maximum(after - size, 0)
        drift = np.repeat(np.maximum(before[-1:] - 2 * size, 0), len(seen) - 1, axis=0)
        free = np.concatenate([parted[:-1], drift, parted[-1:]])
        factor = (RUNS_KNOWN + np.maximum(squares, free)) / (RUNS_KNOWN + free)
        return cls(factor, squares, free, runs)

    @property
    def of_all(self) -> RunScatter:
        """Beside no change at all."""
        return RunScatter(self.factor[-1:], self.square[-1:], self.free[-1:], self.runs)


def scattered(normals: Array, inverses: Array, scores: Array) -> Array:
    """Cochran's Q of runs beside a change of every course and of none, (2 n - 1, G): of a step what
    runs before it and those from it on have, of a drift what is left of a line.

    normals, inverses (n, G, p, p) of single runs and their scores (n, G, p).
    """
    square = np.einsum("rga,rgab,rgb->g", scores, inverses, scores)
    before, moved = np.cumsum(normals, axis=0), np.cumsum(scores, axis=0)
    common = explained(before, moved)
    after = explained(before[-1] - before[:-1], moved[-1] - moved[:-1])
    drifts = common[-1] + explained(*_lines(normals, scores))
    found: Array = square - np.concatenate([common[:-1] + after, drifts, common[-1:]])
    return np.maximum(found, 0.0)


def _lines(normals: Array, scores: Array) -> tuple[Array, Array]:
    """N (n - 1, G, p, p) and s (n - 1, G, p) of drifts beside a value that all runs have."""
    over = shapes(len(normals))[len(normals) - 1 :]
    mean, whole = inverted(normals.sum(axis=0)), scores.sum(axis=0)
    later = np.tensordot(over, normals, axes=1)
    across = later @ mean
    own = np.tensordot(np.square(over), normals, axes=1) - across @ later
    return own, np.tensordot(over, scores, axes=1) - np.einsum("kgab,gb->kga", across, whole)


def freed_of(normal: Array, score: Array, index: Index, spread: Array) -> tuple[Array, Array]:
    """Information and score of runs in each of which an effect has a value of its own besides, of
    covariance `spread` about 0."""
    across, own = normal[:, :, index], normal[:, index[:, None], index]
    inner = spread @ np.linalg.inv(np.eye(index.size) + own @ spread)
    freed = across @ inner
    normal = normal - freed @ np.swapaxes(across, 1, 2)
    score = score - np.einsum("rpa,ra->rp", freed, score[:, index])
    return 0.5 * (normal + np.swapaxes(normal, 1, 2)), score


def explained(normal: Array, score: Array) -> Array:
    """s' N^-1 s of N (..., p, p) and s (..., p)."""
    found: Array = np.einsum("...a,...ab,...b->...", score, inverted(normal), score)
    return found


def log_bayes(normal: Array, score: Array, reach: Array) -> Array:
    """log B = (s' (N + D^-1)^-1 s - log|1 + N D|) / 2 of N (n, G, p, p), s (n, G, p), D (G, p, p).

    D may have no inverse.
    """
    values, vectors = np.linalg.eigh(reach)
    root = vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :]
    inner = np.eye(reach.shape[-1]) + np.swapaxes(root, -1, -2) @ normal @ root
    turned = (score[:, :, None, :] @ root)[:, :, 0, :]
    if reach.shape[-1] == 1:
        size, square = np.log(inner[..., 0, 0]), turned[..., 0] ** 2 / inner[..., 0, 0]
    else:
        size = np.linalg.slogdet(inner)[1]
        solved = np.linalg.solve(inner, turned[..., None])[..., 0]
        square = np.sum(turned * solved, axis=-1)
    found: Array = 0.5 * (square - size)
    return found


def log_odds_apart(effects: int) -> Array:
    """log of the odds that one of so many effects differs by each of APART against none doing so:
    each as likely as the next, and what is so many times as wide seldomer by the square of it."""
    rare = np.array(APART) ** -2.0
    found: Array = np.log(DIFFERING * rare / (np.sum(rare) * effects))
    return found


def log_differing(
    normal: Array,
    score: Array,
    prior: Array,
    index: Index,
    usual: Array,
    sizes: Sequence[float] = APART,
    rows: Index | None = None,
) -> Array:
    """log of how much likelier runs are where an effect has a value of its own in each, of the
    covariances sizes^2 `usual` (p, p) about what is common, than where it is one value, (S,).

    normal (n, P, P), score (n, P); prior (P, P) of what is common; rows: runs that have a value of
    their own, None for all.  With K = S (1 + N_aa S)^-1 of a run, N_aa its information of the
    effect and s its score of it,
        log L = sum (s' K s - log|1 + N_aa S|) / 2 + (g' T^-1 g - log|T|)' / 2 - (the same)_0 / 2,
    T and g the sums over runs, with the effect freed in each and as they are.
    """
    spreads = np.square(sizes)[:, None, None] * usual
    free = slice(None) if rows is None else rows
    apart = normal[free]
    across, own = apart[:, :, index], score[free][:, index]
    inner = np.eye(index.size) + apart[:, index[:, None], index] @ spreads[:, None]
    kept = spreads[:, None] @ np.linalg.inv(inner)
    moved = _side_by_side(across @ kept)
    total, scores = normal.sum(axis=0) + prior, score.sum(axis=0)
    totals = total - moved @ _side_by_side(across).T
    lefts = scores - moved @ own.ravel()
    alone = np.einsum("ra,srab,rb->s", own, kept, own)
    alone -= np.sum(np.linalg.slogdet(inner)[1], axis=-1)
    every = _fitted(np.concatenate([total[None], totals]), np.concatenate([scores[None], lefts]))
    found: Array = 0.5 * (alone + every[1:] - every[0])
    return found


def _side_by_side(blocks: Array) -> Array:
    """(..., n, P, p) as (..., P, n p)."""
    turned = np.swapaxes(blocks, -3, -2)
    return turned.reshape(*turned.shape[:-2], -1)


def _fitted(total: Array, score: Array) -> Array:
    """g' T^-1 g - log|T| of several, columns scaled alike first.

    What no run and no prior tells of, as of a vehicle at rest, adds the same to all of them.
    """
    size = column_sizes(np.diagonal(total[0]))
    scaled = 0.5 * (total + np.swapaxes(total, -1, -2)) / (size[:, None] * size)
    scaled += ROUNDED * np.eye(size.size)  # effects that are one but for rounding
    root = np.linalg.cholesky(scaled)
    white = np.linalg.solve(root, (score / size)[..., None])[..., 0]
    logs = 2.0 * np.sum(np.log(np.diagonal(root, axis1=-2, axis2=-1)), axis=-1)
    found: Array = np.sum(white**2, axis=-1) - logs
    return found
