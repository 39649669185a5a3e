"""Scores of whole effects against what is left of a log, and how far clean logs go by chance.

Scores of a right model are normal with a known covariance, so their least p over all (correlated)
candidates is drawn directly; that takes the noise as known.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache

import numpy as np

from syncline_design.diagnosis.candidates import Signature, slopes
from syncline_design.diagnosis.fitting import Data, Model, inverse_scaled, solve_scaled
from syncline_design.diagnosis.noise import (
    NoiseLevel,
    common_loading,
    loadings,
    precision,
    row_covariance,
    white_covariance,
)
from syncline_design.diagnosis.positive import pseudo_inverse
from syncline_design.effects.kinematics import gauss_markov
from syncline_design.effects.record import Array
from syncline_design.logs.stamps import groups
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.distributions import chi_square_log_beyond

DRAWS = 3000  # clean scores drawn for the distribution of the largest
MOST_ROWS = 6000  # of a longer log the noise is known well enough
RIDGE = 1e-8
LOST = 1e-7  # share of a signature's information below which the model's own effects hold it all


@dataclass(frozen=True, slots=True)
class Gram:
    """Scores of all signatures: g = X' C^-1 e and M = X' C^-1 X, freed of the model's effects."""

    score: Array
    normal: Array
    groups: tuple[slice, ...]
    nll: float

    def gains(self) -> list[tuple[float, Array]]:
        """NLL saved [nat] by each signature alone, and its parameters, to first order."""
        result = []
        for g in self.groups:
            values = solve_scaled(self.normal[g, g], self.score[g])
            result.append((0.5 * float(self.score[g] @ values), values))
        return result


def possible(found: Signature, values: Array) -> bool:
    """Whether first-order parameters are at most twice what the effect can have."""
    slopes_of = found.candidate.effect.slopes()
    return all(abs(v) <= 2.0 * p.high for v, p in zip(values, slopes_of, strict=True))


def gram(data: Data, model: Model, found: Sequence[Signature], level: NoiseLevel) -> Gram:
    """Scores of signatures under a noise level."""
    own = np.nan_to_num(slopes(data.view, model.acting))
    width = own.shape[2]
    groups, at = [], 0
    for s in found:
        groups.append(slice(at, at + s.columns.shape[2]))
        at = groups[-1].stop
    error = model.error[:, :, None]
    columns = np.concatenate([own, *(np.nan_to_num(s.columns) for s in found), error], axis=2)
    known = model.precision if level is model.level else precision(data.structure, level)
    normal = known.information(columns)
    nll = known.likelihood_of(float(normal[-1, -1]))
    normal, score = normal[:-1, :-1], normal[:-1, -1]
    if width:
        inverse = inverse_scaled(normal[:width, :width])
        cross = normal[:width, width:]
        score = score[width:] - cross.T @ inverse @ score[:width]
        whole = np.diag(normal)[width:]
        normal = normal[width:, width:] - cross.T @ inverse @ cross
        lost = np.diag(normal) < LOST * whole  # the model's own effects can do all of it
        score[lost], normal[lost], normal[:, lost] = 0.0, 0.0, 0.0
    return Gram(score, normal, tuple(groups), nll)


def clean_threshold(scores: Gram, rate: float, rng: np.random.Generator) -> float:
    """Quantile of the least log p over all signatures when there is nothing but noise."""
    return float(np.quantile(clean_least(scores, rng), rate))


def clean_least(scores: Gram, rng: np.random.Generator) -> Array:
    """Draws of the least log p over all signatures when there is nothing but noise.

    g is normal with covariance M when the model is right, so the least p over all (correlated)
    candidates is drawn without simulating a log.
    """
    scale = np.sqrt(np.diag(scores.normal))
    scale[scale == 0.0] = 1.0
    correlation = scores.normal / scale[:, None] / scale
    values, vectors = np.linalg.eigh(correlation)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    draws = root @ rng.standard_normal((root.shape[1], DRAWS))
    least = np.zeros(DRAWS)
    for g in scores.groups:
        inverse = pseudo_inverse(correlation[g, g], RIDGE)
        squares = np.sum(draws[g] * (inverse @ draws[g]), axis=0)
        least = np.minimum(least, _log_p(squares, g.stop - g.start))
    return least


_GRID = np.linspace(0.0, 80.0, 401)


@cache
def _log_p_grid(freedom: int) -> Array:
    return chi_square_log_beyond(_GRID, freedom)


def _log_p(squares: Array, freedom: int) -> Array:
    """log of the upper tail of chi-square, by interpolation (it is nearly straight)."""
    log_p: Array = np.interp(squares, _GRID, _log_p_grid(freedom))
    return log_p


def log_p_of(statistic: float, freedom: int) -> float:
    """log of the upper tail of chi-square, by its asymptote where the library's underflows."""
    found = float(chi_square_log_beyond(max(statistic, 0.0), freedom))
    if math.isfinite(found):
        return found
    half = 0.5 * statistic
    return -half + (0.5 * freedom - 1.0) * math.log(half) - math.lgamma(0.5 * freedom)


def clean_errors(data: Data, model: Model, rng: np.random.Generator, count: int) -> Array:
    """Errors of clean logs drawn from the fitted noise, (count, n, 3) [m]."""
    n = len(data.view)
    structure, level = data.structure, model.level
    white = row_covariance if structure.shared else white_covariance
    lower = np.linalg.cholesky(white(structure, level))
    draws = np.einsum("nij,bnj->bni", lower, rng.standard_normal((count, n, 3)))
    loading, times = loadings(structure, level)
    for k, time_s in enumerate(times):
        walk = gauss_markov(structure.time_s, float(time_s), rng.standard_normal((n, count)))
        draws += walk.T[:, :, None] * loading[None, :, :, k]
    if structure.shared:
        common, group = common_loading(structure, level), groups(structure.time_s)
        for k in range(common.shape[2]):
            drawn = rng.standard_normal((count, int(group[-1]) + 1))[:, group]
            draws += drawn[:, :, None] * common[None, :, :, k]
    return np.asarray(draws)
