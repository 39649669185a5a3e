"""Tails of one sensor's noise beside the normal noise of the others.

What a log shows is the sum, which is nearer to normal than the sensor's own noise: Student's t of 4
degrees of freedom beside attitude noise of twice its size looks like one of 12.  Student's t is
normal noise of variance sigma^2 / w, w gamma distributed, so along an axis the sum has the density
    f(e) = int gamma(w; nu/2, nu/2) N(e; 0, sigma^2 / w + g) dw,   g the others' variance,
here by the trapezoidal rule over log w.  A row is that or an outlier: normal, OUTLIER_FACTOR sigma.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from scipy.special import gammaln

from syncline_design.diagnosis.fitting import Data, Model
from syncline_design.diagnosis.noise import SensorKey, white_covariance
from syncline_design.diagnosis.tails import OUTLIER_NATS
from syncline_design.effects.record import OUTLIER_FACTOR, Array
from syncline_design.machine.quick_dataclass import dataclass

MOST_ROWS = 3000
LOG_W = np.arange(-11.0, 3.2, 0.25)  # of the mixed variances: beyond, nothing is left of any t
FREEDOMS = np.geomspace(1.2, 40.0, 29)
NARROWEST, WIDEST = 0.5, 2.0  # core over the spec's, over all of the sensor's noise
COARSE, FINER = 0.25, 9  # steps of its logarithm, and how many finer ones about the best
SCALE_NATS = 10.0  # by which another width of the core has to be better than the spec's
RATE_STEPS = 15
LEAST_RATE = 1e-6


@dataclass(frozen=True, slots=True)
class SensorTails:
    """Degrees of freedom with their standard uncertainty, and the share of outliers.

    scale: width of the core over the spec's, with its standard uncertainty; wider: how much better
    that is than the spec's [nat], 0 where the core is the spec's.
    """

    degrees_of_freedom: float
    freedom_uncertainty: float
    outlier_rate: float
    scale: float = 1.0
    scale_uncertainty: float = 0.0
    wider: float = 0.0


def sensor_tails(data: Data, model: Model, sensor: SensorKey) -> SensorTails:
    """Tails of one sensor in what a model leaves, its core as wide as the spec's if it can be."""
    structure, axes = data.structure, list(data.axes)
    index = [part.sensor for part in structure.white].index(sensor)
    factor = tuple(0.0 if k == index else f for k, f in enumerate(model.level.factor))
    others = white_covariance(structure, replace(model.level, factor=factor))
    left = model.error - model.precision.slow_part(model.error)
    thin = slice(None, None, 1 + len(left) // MOST_ROWS)
    own = np.einsum("nii->ni", structure.white[index].covariance)
    error, own, rest = (v[thin][:, axes] for v in (left, own, np.einsum("nii->ni", others)))
    return tails_beside(error, own, rest, model.level.factor[index])


def tails_beside(error: Array, own: Array, others: Array, factor: float = 1.0) -> SensorTails:
    """Fit to errors (n, axes) [m], own and other noise's variances there [m2].

    factor: deviation of all of the sensor's noise over the spec's; its core is no wider.
    """
    as_stated = _profile(error, own, others)
    widest = WIDEST * max(factor, 1.0)
    scales = np.geomspace(NARROWEST, widest, 1 + math.ceil(math.log(widest / NARROWEST) / COARSE))
    found = [_profile(error, scale**2 * own, others) for scale in scales]
    best = scales[int(np.argmax([np.max(likelihood) for likelihood, _ in found]))]
    scales = best * np.exp(np.linspace(-COARSE, COARSE, FINER))
    found = [_profile(error, scale**2 * own, others) for scale in scales]
    wider = max(float(np.max(likelihood)) for likelihood, _ in found) - float(np.max(as_stated[0]))
    if wider < SCALE_NATS:
        scales, found, wider = np.ones(1), [as_stated], 0.0
    likelihood = np.array([one for one, _ in found])  # by width and freedom
    at = int(np.argmax(np.max(likelihood, axis=0)))
    chosen = int(np.argmax(likelihood[:, at]))
    freedom, spread = _peak(FREEDOMS, np.max(likelihood, axis=0), at)
    scale, off = _peak(scales, np.max(likelihood, axis=1), chosen) if wider else (1.0, 0.0)
    return SensorTails(freedom, spread, float(found[chosen][1][at]), scale, off, wider)


def _profile(error: Array, own: Array, others: Array) -> tuple[Array, Array]:
    """Log likelihood [nat] and share of outliers for all degrees of freedom."""
    inside = _log_densities(error, own, others)
    wide = OUTLIER_FACTOR**2 * own + others
    outside = -0.5 * np.sum(error**2 / wide + np.log(2.0 * np.pi * wide), axis=1)[:, None]
    rate = np.full(inside.shape[1], 0.01)
    for _ in range(RATE_STEPS):
        ratio = np.log(rate) + outside - np.log1p(-rate) - inside
        rate = np.clip(np.mean(1.0 / (1.0 + np.exp(-np.clip(ratio, -50, 50))), axis=0),
                       LEAST_RATE, 0.5)  # fmt: skip
    mixed = np.sum(np.logaddexp(np.log1p(-rate) + inside, np.log(rate) + outside), axis=0)
    plain = np.sum(inside, axis=0)
    if float(np.max(mixed)) < float(np.max(plain)) + OUTLIER_NATS:
        return plain, np.zeros_like(rate)
    return mixed, rate


def _log_densities(error: Array, own: Array, others: Array) -> Array:
    """Log density of every row (n, freedoms), its axes independent."""
    step = float(LOG_W[1] - LOG_W[0])
    half = 0.5 * FREEDOMS[:, None]
    weight = half * np.log(half) - gammaln(half) + half * LOG_W - half * np.exp(LOG_W)
    share = np.exp(weight) * step
    total = np.zeros((error.shape[0], FREEDOMS.shape[0]))
    for axis in range(error.shape[1]):
        variance = own[:, axis, None] * np.exp(-LOG_W) + others[:, axis, None]
        normal = np.exp(-0.5 * error[:, axis, None] ** 2 / variance)
        normal /= np.sqrt(2.0 * math.pi * variance)
        total += np.log(np.maximum(normal @ share.T, np.finfo(float).tiny))
    return total


def _peak(grid: Array, likelihood: Array, at: int) -> tuple[float, float]:
    """Where a parabola in the logarithm peaks, and its standard uncertainty."""
    if at in (0, len(grid) - 1):
        return float(grid[at]), math.inf
    low, middle, high = (float(v) for v in likelihood[at - 1 : at + 2])
    step = math.log(grid[1] / grid[0])
    bend = 2.0 * middle - low - high
    if not bend > 0.0:
        return float(grid[at]), math.inf
    found = float(grid[at]) * math.exp(0.5 * step * (high - low) / bend)
    return found, found * step / math.sqrt(bend)
