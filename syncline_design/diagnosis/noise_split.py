"""How much noise each sensor has, with an interval that counts what they can be taken for.

With S_i = F_i + sum_a t_a C_ai the covariance of row i, t_a a sensor's variance over the spec's,
    I_ab = tr(S^-1 C_a S^-1 C_b) / 2,   g_a = e' S^-1 C_a S^-1 e / 2 - tr(S^-1 C_a S^-1 F) / 2,
summed over the rows, t = I^-1 g, again until it rests (Fisher scoring of normal variance
components).  Its covariance is that of leaving out one of sixteen stretches after the other, so
slow noise and tails count.  Source: Searle, Casella, McCulloch, Variance Components (1992), ch. 6.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t

from syncline_design.diagnosis.fitting import Data, Model
from syncline_design.diagnosis.noise import as_specified, white_covariance
from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass

BLOCKS: Final = 16
ROUNDS: Final = 6
LEAST: Final = 1e-3  # of the spec's variance, while weights are found
LEAST_ROWS: Final = 64


@dataclass(frozen=True, slots=True)
class NoiseFactor:
    """A sensor's standard deviation over the spec's, white and slow together, at 95 %."""

    value: float
    low: float
    high: float


def factors(data: Data, model: Model) -> Mapping[str, NoiseFactor]:
    """Of every sensor that the log's error is made of, by `stage/sensor`."""
    white = data.structure.white
    if len(data.view) < LEAST_ROWS or not white or not data.axes:
        return {}
    axes = list(data.axes)
    error = np.nan_to_num(model.error)[:, axes]
    parts = np.stack([_on(w.covariance, axes) for w in white])
    whole = white_covariance(data.structure, as_specified(data.structure))
    fixed = _on(whole, axes) - parts.sum(0)
    block = np.arange(len(error)) * BLOCKS // len(error)
    share = np.ones(len(white))
    for _ in range(ROUNDS):
        information, score = _sums(error, parts, fixed, share, block)
        share = np.maximum(_solved(information.sum(0), score.sum(0)), LEAST)
    values = _solved(information.sum(0), score.sum(0))
    less = [_solved(information.sum(0) - i, score.sum(0) - s)
            for i, s in zip(information, score, strict=True)]  # fmt: skip
    off = np.array(less) - np.mean(less, axis=0)
    spread = np.sqrt((BLOCKS - 1) / BLOCKS * np.sum(off**2, axis=0))
    reach = float(t.isf(0.025, BLOCKS - 1)) * spread
    return {
        "/".join(w.sensor): NoiseFactor(_root(v), _root(v - r), _root(v + r))
        for w, v, r in zip(white, values, reach, strict=True)
    }


def _on(covariance: Array, axes: Sequence[int]) -> Array:
    found: Array = covariance[:, axes][:, :, axes]
    return found


def _root(share: float) -> float:
    return math.sqrt(max(float(share), 0.0))


def _sums(
    error: Array, parts: Array, fixed: Array, share: Array, block: NDArray[np.int64]
) -> tuple[Array, Array]:
    """I (G, m, m) and g (G, m) of every stretch."""
    total = fixed + np.einsum("a,anij->nij", share, parts)
    inverse = np.linalg.inv(total)
    weighted = np.einsum("nij,nj->ni", inverse, error)
    turned = inverse @ parts  # S^-1 C_a
    own = 0.5 * np.einsum("anij,bnji->nab", turned, turned)
    score = 0.5 * np.einsum("ni,anij,nj->na", weighted, parts, weighted)
    score -= 0.5 * np.einsum("anij,nji->na", turned, inverse @ fixed)
    groups = [np.flatnonzero(block == k) for k in range(BLOCKS)]
    return np.array([own[g].sum(0) for g in groups]), np.array([score[g].sum(0) for g in groups])


def _solved(information: Array, score: Array) -> Array:
    scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
    inverse = np.linalg.pinv(information / scale[:, None] / scale, rcond=1e-9, hermitian=True)
    found: Array = inverse @ (score / scale) / scale
    return found
