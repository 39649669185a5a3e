"""Heavier tails than normal: how much better Student's t describes the scaled white remainder."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from syncline_design.diagnose.axes import Axes
from syncline_design.diagnose.fitting import Data, Model
from syncline_design.diagnose.noise import NoiseLevel, Structure, white_covariance
from syncline_design.effects.base import Array

FREEDOMS = np.geomspace(1.2, 30.0, 25)
FAR = 5.0  # core standard deviations beyond which a row is an outlier
MAD_TO_STD = 1.4826  # of a normal distribution


@dataclass(frozen=True, slots=True)
class Tails:
    """gain: log likelihood [nat] of Student's t over the normal; the fit behind it."""

    gain: float
    degrees_of_freedom: float
    freedom_uncertainty: float
    outlier_rate: float


def tails_in(data: Data, model: Model) -> Tails:
    """Tails of the white part of what a model leaves."""
    slow = model.precision.slow_part(model.error)
    return tails_of(scaled_remainder(data.structure, model.level, model.error, slow, data.axes))


def scaled_remainder(
    structure: Structure, level: NoiseLevel, error: Array, slow_part: Array, axes: Axes
) -> Array:
    """z = L^-1 (e - slow), L L' the white covariance of the axes that the log compares.

    Standard normal if all is normal, (n, axes): an axis that is not known or never varies has no
    noise, and its zeros would pass for the core of a heavy-tailed distribution.
    """
    kept = list(axes)
    covariance = white_covariance(structure, level)[:, kept][:, :, kept]
    lower = np.linalg.cholesky(covariance)
    left = (error - slow_part)[:, kept]
    z: Array = np.linalg.solve(lower, left[:, :, None])[:, :, 0]
    return z


def tails_of(z: Array) -> Tails:
    """Fit Student's t with a scale to standardised components (n, axes)."""
    from scipy.stats import norm, t

    values = z.ravel()
    if not float(np.median(np.abs(values))) > 0.0:  # more than half are zero: no noise to judge
        return Tails(0.0, math.inf, math.inf, 0.0)
    plain = float(np.sum(norm.logpdf(values, scale=float(np.std(values)))))
    found = []
    for freedom in FREEDOMS:
        scale = _scale(values, float(freedom))
        found.append(float(np.sum(t.logpdf(values, freedom, scale=scale))))
    best = int(np.argmax(found))
    core = MAD_TO_STD * float(np.median(np.abs(values)))
    struck = np.max(np.abs(z), axis=1) > FAR * core
    return Tails(
        found[best] - plain,
        float(FREEDOMS[best]),
        _spread(found, best),
        float(np.mean(struck)),
    )


def _scale(values: Array, freedom: float) -> float:
    """Scale of Student's t by iterated weights w = (nu + 1) / (nu + z^2 / s^2) (Lange 1989)."""
    square = float(np.median(values**2)) / 0.455
    for _ in range(30):
        weights = (freedom + 1.0) / (freedom + values**2 / square)
        square = float(np.mean(weights * values**2))
    return float(np.sqrt(square))


def _spread(found: list[float], best: int) -> float:
    """Standard uncertainty of the freedom from the curvature in its logarithm."""
    if best in (0, len(found) - 1):
        return float("inf")
    step = float(np.log(FREEDOMS[1] / FREEDOMS[0]))
    curvature = -(found[best - 1] - 2.0 * found[best] + found[best + 1]) / step**2
    return float(FREEDOMS[best] / np.sqrt(curvature)) if curvature > 0 else float("inf")
