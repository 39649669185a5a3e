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
from syncline_design.model.normal import NORMAL_95

Interval = tuple[float, float] | None
MOST_ROWS = 3000
LOG_W = np.arange(-11.0, 3.2, 0.25)  # of the mixed variances: beyond, nothing is left of any t
FREEDOMS = np.geomspace(1.2, 40.0, 29)
NARROWEST, WIDEST = 0.5, 2.0  # core over the spec's, over all of the sensor's noise
COARSE, FINER = 0.25, 9  # steps of its logarithm, and how many finer ones about the best
SCALE_NATS = 10.0  # by which another width of the core has to be better than the spec's
RATE_STEPS = 15
NO_DEVIATION = 2.0  # degrees of freedom of Student's t, up to which it has none
OUTLIERS = (OUTLIER_FACTOR, 2.0 * OUTLIER_FACTOR, 4.0 * OUTLIER_FACTOR)
LEAST_RATE = 1e-6
SEEN = 1e-6  # of the others' variance, below which a sensor's own does not show in a row
LEAST_SHARE = 0.01  # of the spec's variance
RATES = np.exp(np.linspace(-3.0, 1.5, 37))  # times the likeliest, between which its interval ends
WITHIN_95 = 0.5 * NORMAL_95**2  # nat below the peak of a profile, where its 95 % interval ends


@dataclass(frozen=True, slots=True)
class SensorTails:
    """Degrees of freedom with their standard uncertainty, and the share of outliers.

    scale: width of the core over the spec's, with its standard uncertainty; wider: how much better
    that is than the spec's [nat], 0 where the core is the spec's.  freedom95, rate95: intervals of
    the first and the share, None where nothing bounds them.  nats: log likelihood.
    outliers: how many times the spec's their deviation is.
    """

    degrees_of_freedom: float
    freedom_uncertainty: float
    outlier_rate: float
    scale: float = 1.0
    scale_uncertainty: float = 0.0
    wider: float = 0.0
    freedom95: Interval = None
    rate95: Interval = None
    nats: float = 0.0
    outliers: float = OUTLIER_FACTOR

    @property
    def rate_uncertainty(self) -> float:
        """Standard uncertainty of the share of outliers, infinite where it has no interval."""
        if self.rate95 is None:
            return math.inf
        return (self.rate95[1] - self.rate95[0]) / (2.0 * NORMAL_95)


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
    return _of_outliers(_Beside(error, own, others), factor)


def tails_of_any_outliers(
    error: Array, own: Array, others: Array, factor: float = 1.0
) -> SensorTails:
    """The same with outliers that may be further out than the effect's, where that is clearly
    better, or better at all than tails that have no deviation."""
    found = [_of_outliers(_Beside(error, own, others, k), factor) for k in OUTLIERS]
    best, usual = max(found, key=lambda one: one.nats), found[0]
    least = 0.0 if usual.degrees_of_freedom <= NO_DEVIATION else SCALE_NATS
    return best if best.nats > usual.nats + least else usual


@dataclass(frozen=True, slots=True)
class _Beside:
    """Errors (n, axes) [m] with the variances of own and other noise [m2]; how far outliers are."""

    error: Array
    own: Array
    others: Array
    outliers: float = OUTLIER_FACTOR

    def wide(self, scale: float) -> _Beside:
        """The same with a core so many times the spec's."""
        return replace(self, own=scale**2 * self.own)


def _of_outliers(one: _Beside, factor: float) -> SensorTails:
    as_stated = _profile(one)
    widest = WIDEST * max(factor, 1.0)
    scales = np.geomspace(NARROWEST, widest, 1 + math.ceil(math.log(widest / NARROWEST) / COARSE))
    found = [_profile(one.wide(scale)) for scale in scales]
    best = scales[int(np.argmax([np.max(likelihood) for likelihood, _ in found]))]
    scales = best * np.exp(np.linspace(-COARSE, COARSE, FINER))
    found = [_profile(one.wide(scale)) for scale in scales]
    wider = max(float(np.max(likelihood)) for likelihood, _ in found) - float(np.max(as_stated[0]))
    if wider < SCALE_NATS:
        scales, found, wider = np.ones(1), [as_stated], 0.0
    likelihood = np.array([each for each, _ in found])  # by width and freedom
    at = int(np.argmax(np.max(likelihood, axis=0)))
    chosen = int(np.argmax(likelihood[:, at]))
    freedom, spread = _peak(FREEDOMS, np.max(likelihood, axis=0), at)
    scale, off = _peak(scales, np.max(likelihood, axis=1), chosen) if wider else (1.0, 0.0)
    rate = float(found[chosen][1][at])
    return SensorTails(
        freedom, spread, rate, scale, off, wider,
        _ends(FREEDOMS, np.max(likelihood, axis=0)),
        _rate_ends(one.wide(scales[chosen]), rate) if rate > 0.0 else None,
        float(np.max(likelihood)), one.outliers,
    )  # fmt: skip


def expected_variance(error: Array, own: Array, others: Array, tails: SensorTails) -> Array:
    """Variance over the spec's (n,) of a sensor's noise along one axis, in rows of known error.

    Of all its w and the outliers' as likely as the error makes them: what has the mean weight
    1 / (variance + others).  error, own, others (n, 1) as in `tails_beside`.
    """
    half = 0.5 * tails.degrees_of_freedom
    core = tails.scale**2 * own
    variance = np.concatenate([core * np.exp(-LOG_W), tails.outliers**2 * core], axis=1) + others
    log = half * (LOG_W - np.exp(LOG_W))
    inside = math.log1p(-tails.outlier_rate) + log - np.logaddexp.reduce(log)
    share = np.append(inside, math.log(max(tails.outlier_rate, np.finfo(float).tiny)))
    likely = share - 0.5 * (error**2 / variance + np.log(variance))
    likely = np.exp(likely - np.max(likely, axis=1, keepdims=True))
    weight = np.sum(likely / variance, axis=1) / np.sum(likely, axis=1)
    told = own[:, 0] > SEEN * others[:, 0]
    grown = (1.0 / weight - others[:, 0]) / np.maximum(own[:, 0], np.finfo(float).tiny)
    found: Array = np.where(told, np.maximum(grown, LEAST_SHARE), 1.0)
    return found


def _profile(one: _Beside) -> tuple[Array, Array]:
    """Log likelihood [nat] and share of outliers for all degrees of freedom."""
    inside, outside = _log_densities(one.error, one.own, one.others), _log_outside(one)
    rate = np.full(inside.shape[1], 0.01)
    for _ in range(RATE_STEPS):
        ratio = np.log(rate) + outside - np.log1p(-rate) - inside
        rate = np.clip(np.mean(1.0 / (1.0 + np.exp(-np.clip(ratio, -50, 50))), axis=0),
                       LEAST_RATE, 0.5)  # fmt: skip
    mixed = _mixed(inside, outside, rate)
    plain = np.sum(inside, axis=0)
    if float(np.max(mixed)) < float(np.max(plain)) + OUTLIER_NATS:
        return plain, np.zeros_like(rate)
    return mixed, rate


def _log_outside(one: _Beside) -> Array:
    """Log density of every row (n, 1) as an outlier."""
    wide = one.outliers**2 * one.own + one.others
    found: Array = -0.5 * np.sum(one.error**2 / wide + np.log(2.0 * np.pi * wide), axis=1)[:, None]
    return found


def _mixed(inside: Array, outside: Array, rate: Array | float) -> Array:
    """Log likelihood [nat] of a share of outliers, by freedom."""
    both = np.logaddexp(np.log1p(-rate) + inside, np.log(rate) + outside)
    total: Array = np.sum(both, axis=0)
    return total


def _rate_ends(one: _Beside, rate: float) -> Interval:
    """The 95 % interval of the share of outliers, any degrees of freedom beside it."""
    inside, outside = _log_densities(one.error, one.own, one.others), _log_outside(one)
    rates = np.minimum(rate * RATES, 0.9)
    return _ends(rates, np.array([np.max(_mixed(inside, outside, float(r))) for r in rates]))


def _ends(grid: Array, likelihood: Array) -> Interval:
    """Where a profile falls WITHIN_95 below its peak on both sides; None: it does not."""
    below = likelihood - np.max(likelihood) + WITHIN_95
    at, outside = int(np.argmax(likelihood)), np.flatnonzero(below < 0.0)
    before, after = outside[outside < at], outside[outside > at]
    if not (len(before) and len(after)):
        return None
    ends = []
    for k, j in ((int(before[-1]), int(before[-1]) + 1), (int(after[0]), int(after[0]) - 1)):
        share = below[k] / (below[k] - below[j])
        ends.append(float(grid[k]) * float(grid[j] / grid[k]) ** float(share))
    return ends[0], ends[1]


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
