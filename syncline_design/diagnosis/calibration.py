"""How far clean logs go: the distribution of the best candidate's score when nothing is missing.

Two ways.  Scores of a right model are normal with a known covariance, so their least p over all
(correlated) candidates is drawn directly; that takes the noise as known.  Near the threshold clean
logs are simulated from the current model on this very trajectory, their noise fitted anew before
and after each one's best candidate, and the threshold is moved by what that adds.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from syncline_design.diagnosis.candidates import Signature, slopes
from syncline_design.diagnosis.fitting import Data, Model, inner, solve_scaled
from syncline_design.diagnosis.noise import (
    common_loading,
    fit_noise,
    loadings,
    precision,
    row_covariance,
    white_covariance,
)
from syncline_design.effects.kinematics import gauss_markov
from syncline_design.effects.record import Array
from syncline_design.logs.stamps import groups

LOGS = 16  # clean logs simulated
MOST_ROWS = 6000  # of a longer log the noise is known well enough
ITERATIONS = 6

LogP = Callable[[float, int], float]
Gains = Callable[[Model], list[float]]


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


def refit_factor(
    data: Data,
    model: Model,
    free: Sequence[Signature],
    rng: np.random.Generator,
    gains: Gains,
    log_p: LogP,
    expected: float,
) -> float:
    """Mean least log p of simulated clean logs, noise refitted, over what known noise gives.

    expected: the mean of the direct draws.  At least 1: the threshold is never loosened.
    """
    if len(data.view) > MOST_ROWS or not free:
        return 1.0
    own = np.nan_to_num(slopes(data.view, model.acting))
    least = [
        _least_log_p(data, model, free, own, error, gains, log_p)
        for error in clean_errors(data, model, rng, LOGS)
    ]
    return max(1.0, float(np.mean(least)) / expected)


def _least_log_p(
    data: Data,
    model: Model,
    free: Sequence[Signature],
    own: Array,
    error: Array,
    gains: Gains,
    log_p: LogP,
) -> float:
    """log p of one clean log's best candidate, with the noise fitted before and after it."""
    clean = _refitted(data, model, _without(model, own, error))
    found = gains(clean)
    freedoms = [s.columns.shape[2] for s in free]
    scored = [log_p(2.0 * g, f) for g, f in zip(found, freedoms, strict=True)]
    best = int(np.argmin(scored))
    columns = np.concatenate([own, np.nan_to_num(free[best].columns)], axis=2)
    after = _refitted(data, clean, _without(clean, columns, error))
    gain = max(clean.nll - after.nll, 0.0)
    return log_p(2.0 * gain, freedoms[best])


def _without(model: Model, columns: Array, error: Array) -> Array:
    """The error with columns fitted and taken out."""
    if columns.shape[2] == 0:
        return error
    weighted = model.precision.solve(columns)
    values = solve_scaled(inner(columns, weighted), inner(weighted, error[:, :, None])[:, 0])
    left: Array = error - columns @ values
    return left


def _refitted(data: Data, model: Model, error: Array) -> Model:
    rows = data.noise_rows
    level, _ = fit_noise(
        data.noise_structure, error[rows], model.bounds, model.level, model.free_sizes, ITERATIONS
    )
    known = precision(data.structure, level)
    nll = known.negative_log_likelihood(error)
    return replace(model, level=level, error=error, precision=known, nll=nll)
