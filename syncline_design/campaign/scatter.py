"""How much an effect differs from run to run, and what a change weighs beside that (`changes`)."""

from __future__ import annotations

from typing import Final

import numpy as np

from syncline_design.campaign.pool import Index, inverted
from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass

RUNS_KNOWN: Final = 17.0  # runs that the noise fitted counts for, against the scatter of runs
MOST_LOG: Final = 690.0  # exp of no more stays within a double (709), with room for a sum


@dataclass(frozen=True, slots=True)
class RunScatter:
    """Of runs parted at every k from 1, and not parted, by term of a group: (look, G).

    shape: (v + f + p) / 2 and scale: v + R of the law of their variance over that fitted; R is
    taken as f at least, for what the noise inside runs makes is always there.  square, free: R, f.
    """

    shape: Array
    scale: Array
    square: Array
    free: Index
    size: int

    @classmethod
    def of(cls, squares: Array, seen: Index, size: int) -> RunScatter:
        """squares (look, G): R; seen (look, G): parameters that each run says anything of."""
        before = np.cumsum(seen, axis=0)
        after = before[-1] - before
        free = np.maximum(before - size, 0) + np.maximum(after - size, 0)
        scale = RUNS_KNOWN + np.maximum(squares, free)
        return cls(0.5 * (RUNS_KNOWN + free + size), scale, squares, free, size)

    @property
    def factor(self) -> Array:
        """The variance over that fitted, as far as it is known."""
        return self.scale / (2.0 * self.shape - self.size)


def scattered(normals: Array, inverses: Array, scores: Array) -> Array:
    """Cochran's Q of runs before k and of those from k on, together, k from 1 to all, (n, G).

    normals, inverses (n, G, p, p) of single runs and their scores (n, G, p).
    """
    square = np.einsum("rga,rgab,rgb->g", scores, inverses, scores)
    before, moved = np.cumsum(normals, axis=0), np.cumsum(scores, axis=0)
    found: Array = square - _explained(before, moved)
    found[:-1] -= _explained(before[-1] - before[:-1], moved[-1] - moved[:-1])
    return np.maximum(found, 0.0)


def freed_of(normal: Array, score: Array, index: Index, spread: Array) -> tuple[Array, Array]:
    """Information and score of runs in each of which an effect has a value of its own besides, of
    covariance `spread` about 0."""
    across, own = normal[:, :, index], normal[:, index[:, None], index]
    inner = spread @ np.linalg.inv(np.eye(index.size) + own @ spread)
    freed = across @ inner
    normal = normal - freed @ np.swapaxes(across, 1, 2)
    score = score - np.einsum("rpa,ra->rp", freed, score[:, index])
    return 0.5 * (normal + np.swapaxes(normal, 1, 2)), score


def _explained(normal: Array, score: Array) -> Array:
    """s' N^-1 s."""
    found: Array = np.einsum("kga,kgab,kgb->kg", score, inverted(normal), score)
    return found


def log_bayes(normal: Array, score: Array, reach: Array, scatter: RunScatter) -> Array:
    """log B of N (n, G, p, p), s (n, G, p) and D (G, p, p), which may have no inverse."""
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
    left = np.maximum(_explained(normal, score) - square, 0.0)
    student = scatter.shape[:-1] * np.log1p(square / (scatter.scale[:-1] + left))
    found: Array = np.minimum(student - 0.5 * size, MOST_LOG)
    return found
