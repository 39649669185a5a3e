"""Heavier tails than normal: how much better Student's t describes the scaled white remainder."""

from __future__ import annotations

import math

import numpy as np

from syncline_design.diagnosis.axes import Axes
from syncline_design.diagnosis.fitting import Data, Model
from syncline_design.diagnosis.noise import NoiseLevel, Structure, white_covariance
from syncline_design.effects.record import OUTLIER_FACTOR, Array
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.distributions import normal_log_density, student_log_density

FREEDOMS = np.geomspace(1.2, 30.0, 25)
FAR = 5.0  # core standard deviations beyond which a row is taken for an outlier at first
OUTLIER_NATS = 5.0  # what outliers beside Student's t have to be worth to be reported
MIXTURE_STEPS = 12


@dataclass(frozen=True, slots=True)
class Tails:
    """gain: log likelihood [nat] of Student's t over the normal; the fit behind it.

    outlier_rate: share of the rows that Student's t does not explain.
    """

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
    values = z.ravel()
    if not float(np.median(np.abs(values))) > 0.0:  # more than half are zero: no noise to judge
        return Tails(0.0, math.inf, math.inf, 0.0)
    plain = float(np.sum(normal_log_density(values, float(np.std(values)))))
    found = []
    for freedom in FREEDOMS:
        scale = _scale(values, float(freedom))
        found.append(float(np.sum(student_log_density(values, float(freedom), scale))))
    gain = max(found) - plain
    mixed = [_mixture(z, float(freedom)) for freedom in FREEDOMS]
    rate = 0.0
    if max(likelihood for likelihood, _ in mixed) > max(found) + OUTLIER_NATS:
        found = [likelihood for likelihood, _ in mixed]
        rate = mixed[int(np.argmax(found))][1]
    best = int(np.argmax(found))
    return Tails(gain, float(FREEDOMS[best]), _spread(found, best), rate)


def _mixture(z: Array, freedom: float) -> tuple[float, float]:
    """(log likelihood [nat], share of outliers) of the mixture that `heavy_tails` is.

    A row is Student's t of one scale or, with some probability, normal with OUTLIER_FACTOR times
    that scale, so that what one part explains the other does not count again.  By expectation and
    maximisation, from the rows far outside the core.
    """
    square, axes = z**2, z.shape[1]
    peak = math.lgamma(0.5 * (freedom + 1.0)) - math.lgamma(0.5 * freedom)
    peak -= 0.5 * math.log(freedom * math.pi)  # log density of Student's t of scale 1 at 0
    scale2 = float(np.median(square)) / 0.455
    rate = float(np.clip(np.mean(square.max(axis=1) > FAR**2 * scale2), 1e-4, 0.5))
    for step in range(MIXTURE_STEPS + 1):
        log_scale = 0.5 * math.log(scale2)
        spread = np.sum(np.log1p(square / (freedom * scale2)), axis=1)
        inside = axes * (peak - log_scale) - 0.5 * (freedom + 1.0) * spread + math.log1p(-rate)
        flat = axes * (log_scale + math.log(OUTLIER_FACTOR * math.sqrt(2.0 * math.pi)))
        outside = (
            math.log(rate) - flat - 0.5 * np.sum(square, axis=1) / (OUTLIER_FACTOR**2 * scale2)
        )
        likely = np.logaddexp(inside, outside)
        if step == MIXTURE_STEPS:
            break
        struck = np.exp(outside - likely)[:, None]
        weight = (1.0 - struck) * (freedom + 1.0) / (freedom + square / scale2)
        scale2 = float(np.mean((weight + struck / OUTLIER_FACTOR**2) * square))
        rate = float(np.clip(struck.mean(), 1e-6, 0.5))
    return float(np.sum(likely)), rate


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
