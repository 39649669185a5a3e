"""A faster estimator: what is Gaussian given the kinematics is integrated, not sampled.

Given directions, timestamp errors and yaw, the error is a mean m, exact and nonlinear, plus sensor
noise, which is Gaussian with a covariance C, linear in the noise.  Then
P(|m + L g| <= q), C = L L', is an average over directions u of g: |m + s L u| <= q is an interval
of s, whose chi-square probability with three degrees of freedom is known.  Directions and
kinematics are points of randomly shifted lattices; the spread of the copies gives the interval.

What it leaves out is the second order of the angular noise, at most half of its square times the
range; `noise_curvature_m` says how much that is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from syncline_design.effects.record import Array
from syncline_design.model.system import SimulationError, Stage, System
from syncline_design.simulation import kernel
from syncline_design.simulation.draws import Shifts, Source, generator, stage_draw, timing_draws
from syncline_design.simulation.quadrature import (
    LatticeSource,
    chi3_cdf,
    generating_vector,
    student_quantile,
)
from syncline_design.simulation.results import (
    Histogram,
    MonteCarlo,
    ProportionEstimate,
    QuantileEstimate,
)
from syncline_design.simulation.settings import SimulationSettings
from syncline_design.simulation.worst_case import WorstCase

CONDITIONED_STREAM = 3  # first word of the stream key, see draws.generator
COPIES = 16
LARGEST_LATTICE = 512
Covariance = tuple[Array, Array, Array, Array, Array, Array]  # nn, ne, nd, ee, ed, dd (n,)


@dataclass(frozen=True, slots=True)
class Rays:
    """Lines |m + s w|^2 = a s^2 + 2 b s + c through the error's distribution, s both ways.

    a, b, c (copies, points); s is chi-distributed with three degrees of freedom, its sign free.
    """

    a: Array
    b: Array
    c: Array

    def probability(self, q_m: float) -> tuple[Array, Array]:
        """(P(|error| <= q), its derivative by q) of each copy, (copies,).

        The sphere of radius q cuts a line at s1 <= s2; between them lies half the difference of
        sign(s) P(chi_3 <= |s|).
        """
        square = self.b * self.b
        square -= self.a * (self.c - q_m * q_m)
        hits = square > 0.0
        root = np.sqrt(np.where(hits, square, 1.0))
        ends = np.stack([-root, root])
        ends -= self.b
        ends /= self.a
        np.clip(ends, -1e3, 1e3, out=ends)  # without noise the ends are as good as infinite
        length = np.abs(ends)
        length_square = ends * ends
        factor = np.exp(-0.5 * length_square)
        below = chi3_cdf(length, factor)
        np.copysign(below, ends, out=below)
        inside = (below[1] - below[0]) * hits
        length_square *= factor
        slope = length_square.sum(axis=0)
        slope /= root
        slope *= hits
        shares: tuple[Array, Array] = (
            0.5 * inside.mean(axis=1),
            math.sqrt(0.5 / math.pi) * q_m * slope.mean(axis=1),
        )
        return shares

    def quantile(self, quantile: float) -> Array:
        """The quantile [m] of all copies together, as values (copies,) that average to it.

        q solves mean F_c(q) = p, by Newton's method inside a bracket; copy c's value is
        q + (p - F_c(q)) / f, f the mean density there, so that the values' spread is that of q
        to first order.  (Solving copy by copy would bias q, as each holds few points.)
        """
        q = math.sqrt(float(self.c.mean()) + 3.0 * float(self.a.mean()))
        low, high = 0.0, 40.0 * q + 1e-300
        for _ in range(80):
            shares, slopes = self.probability(q)
            missing, slope = quantile - float(shares.mean()), float(slopes.mean())
            low, high = (low, q) if missing <= 0.0 else (q, high)
            step = missing / slope if slope > 0.0 else math.inf
            if abs(step) <= 1e-6 * q or high - low <= 1e-12 * high:
                break
            q = q + step if low < q + step < high else 0.5 * (low + high)
        if not slope > 0.0:
            return np.full(shares.shape, q)
        values: Array = q + (quantile - shares) / slope
        return values


def rays(system: System, settings: SimulationSettings, points: int, group: int) -> Rays:
    """The rays of one group of COPIES copies of the lattice."""
    source = LatticeSource(
        generator(settings.seed, CONDITIONED_STREAM, group),
        points,
        COPIES,
        generating_vector(_dimensions(system), points),
    )
    ray = _ray_directions(source)
    mean, covariance = conditional_moments(system, settings, source)
    along = _factor_times(covariance, ray)
    shape = (COPIES, points)
    return Rays(
        a=np.maximum(_dot(along, along), 1e-300).reshape(shape),
        b=_dot(mean, along).reshape(shape),
        c=_dot(mean, mean).reshape(shape),
    )


def conditioned_monte_carlo(
    system: System, settings: SimulationSettings, worst: WorstCase
) -> MonteCarlo:
    """Quantiles and P(|error| <= limit) with Student intervals over the lattice's copies.

    `settings.samples` points, rounded up to whole groups of copies.
    """
    demand_conditionable(system, settings)
    points, groups = lattice_size(settings.samples)
    drawn = [rays(system, settings, points, group) for group in range(groups)]
    quantiles = []
    for quantile in settings.quantiles:
        copies = np.concatenate([group.quantile(quantile) for group in drawn])
        quantiles.append(QuantileEstimate(quantile, *_interval(copies, settings.confidence)))
    within = None
    if settings.limit_m is not None:
        copies = np.concatenate([group.probability(settings.limit_m)[0] for group in drawn])
        shares = (min(max(x, 0.0), 1.0) for x in _interval(copies, settings.confidence))
        within = ProportionEstimate(settings.limit_m, *shares)
    return MonteCarlo(
        samples=points * COPIES * groups,
        seed=settings.seed,
        envelope=settings.envelope,
        estimator="conditioned",
        effective_samples=_effective_samples(drawn, settings.quantiles),
        confidence=settings.confidence,
        quantiles=tuple(quantiles),
        within_target=within,
        worst_case=worst,
        histogram=_histogram(drawn[0]),
    )


def lattice_size(samples: int) -> tuple[int, int]:
    """(points of a copy, groups of COPIES copies): a power of two of 16 to 512 points."""
    wanted = max(samples // COPIES, 1)
    points = min(max(1 << (wanted.bit_length() - 1), 16), LARGEST_LATTICE)
    return points, -(-samples // (points * COPIES))


def _interval(copies: Array, confidence: float) -> tuple[float, float, float]:
    """(mean, low, high) of independent copies of an estimate, by Student's t."""
    middle = float(copies.mean())
    deviation = float(copies.std(ddof=1)) / math.sqrt(copies.shape[0])
    reach = student_quantile(0.5 + 0.5 * confidence, copies.shape[0] - 1) * deviation
    return middle, middle - reach, middle + reach


def _effective_samples(drawn: list[Rays], quantiles: tuple[float, ...]) -> int:
    """Plain samples with the same standard error of a quantile: p (1 - p) / (f se)^2.

    f: density at the quantile; the asymptotic variance of a sample quantile (H. A. David,
    H. N. Nagaraja, Order Statistics, 3rd ed., 10.2).  For 0.95, or else the last one asked for.
    """
    p = 0.95 if 0.95 in quantiles or not quantiles else quantiles[-1]
    found = [group.quantile(p) for group in drawn]
    copies = np.concatenate(found)
    middle = float(copies.mean())
    density = float(np.mean([group.probability(middle)[1].mean() for group in drawn]))
    error = float(copies.std(ddof=1)) / math.sqrt(copies.shape[0])
    spread = (density * error) ** 2
    return round(p * (1.0 - p) / spread) if spread > 0.0 else copies.shape[0]


def _histogram(group: Rays, bins: int = 60) -> Histogram:
    """Density over equal bins up to the quantile 0.9999, from the first points of each copy."""
    group = Rays(*(part[:, :64] for part in (group.a, group.b, group.c)))
    top = float(group.quantile(0.9999).mean())
    edges = np.linspace(0.0, top if top > 0.0 else 1.0, bins + 1)
    share = [float(group.probability(float(edge))[0].mean()) for edge in edges]
    density = np.diff(share) / np.diff(edges)
    return Histogram(tuple(float(e) for e in edges), tuple(float(d) for d in density))


def demand_conditionable(system: System, settings: SimulationSettings) -> None:
    """Raise SimulationError where the conditioned estimator does not hold."""
    if system.effects or settings.envelope == "trajectory":
        raise SimulationError(
            "estimator: 'conditioned' takes neither effects nor a trajectory; use 'plain'"
        )


def noise_curvature_m(system: System) -> float:
    """Second order of the angular noise [m]: sum of d (sigma_Theta^2 + sigma_u^2) / 2."""
    total = 0.0
    for stage in system.stages:
        if stage.attitude is not None and stage.ranging is not None:
            square = math.hypot(*stage.attitude.sigma, *stage.ranging.sigma[1:]) ** 2
            total += 0.5 * stage.platform.distance_m * square
    return total


def _dimensions(system: System) -> int:
    """Dimensions of the cube: rays 2, per stage up to 11, per sensor up to 2, per clock up to 3."""
    sensors = sum(len(stage.sensors()) for stage in system.stages)
    return 2 + 11 * len(system.stages) + 2 * sensors + 3 * len(system.clock_offsets)


def _ray_directions(source: Source) -> Array:
    """Isotropic directions (3, n)."""
    height, turn = source.uniform(2)
    z = 2.0 * height - 1.0
    radius = np.sqrt(1.0 - z * z)
    return np.stack([radius * np.cos(2 * np.pi * turn), radius * np.sin(2 * np.pi * turn), z])


def conditional_moments(
    system: System, settings: SimulationSettings, source: Source
) -> tuple[Array, Covariance]:
    """(mean (3, n) [m], covariance [m^2]) of the chain's error given the kinematics, NED."""
    shifts: Shifts = timing_draws(system, source)
    mean: Array | None = None
    total: Covariance | None = None
    for index, stage in enumerate(system.stages):
        draw = stage_draw(system, index, shifts, source, settings.envelope == "inside", False, True)
        mean = kernel.stage_error(draw, mean)
        own = _stage_covariance(stage, draw)
        total = own if total is None else tuple(p + q for p, q in zip(total, own, strict=True))  # type: ignore[assignment]
    assert mean is not None
    assert total is not None
    return mean, total


def _stage_covariance(stage: Stage, draw: kernel.Draw) -> Covariance:
    """Covariance of a stage's noise: every noise times the direction it moves the estimate in."""
    count = draw.bearing.shape[1]
    parts = [np.zeros(count) for _ in range(6)]
    if stage.position is not None:
        for part, sigma in zip((0, 3, 5), stage.position.sigma, strict=True):
            parts[part] += float(sigma) ** 2
    if stage.ranging is not None and stage.attitude is not None:
        columns = _noise_columns(stage, draw)
        for part, (i, j) in enumerate(((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))):
            parts[part] += np.einsum("kn,kn->n", columns[i], columns[j])
    return tuple(parts)  # type: ignore[return-value]


def _noise_columns(stage: Stage, draw: kernel.Draw) -> Array:
    """Error [m] per standard deviation of each of the six noises, NED, (3, 6, n).

    Euler angles turn about z (yaw), the heading's y axis (pitch) and the body's x axis (roll);
    the bearing moves along dn/d az and dn/d el, the range along n.
    """
    assert stage.attitude is not None
    assert stage.ranging is not None
    n = draw.bearing
    angles = kernel.attitude_angles(draw.rate_radps * (draw.mu_attitude_s - draw.mu_ranging_s))
    flat = np.sqrt(n[0] ** 2 + n[1] ** 2)
    safe = np.where(flat > 0.0, flat, 1.0)
    sigma_r, sigma_az, sigma_el = (float(s) for s in stage.ranging.sigma)
    body = np.empty((3, 4, n.shape[1]))
    np.multiply(n, sigma_r, out=body[:, 0])
    across = draw.range_m * sigma_az
    body[0, 1], body[1, 1], body[2, 1] = -n[1] * across, n[0] * across, 0.0
    across = draw.range_m * sigma_el
    body[0, 2], body[1, 2] = n[2] * n[0] / safe * across, n[2] * n[1] / safe * across
    body[2, 2] = -flat * across
    np.multiply(draw.range_m, n, out=body[:, 3])
    body[:, 3] += draw.ranging_m - draw.antenna_m
    for axis, (sine, cosine) in enumerate(angles):
        kernel.turn_columns(body, axis, sine, cosine)
    columns = np.empty((3, 6, n.shape[1]))
    columns[:, :3] = body[:, :3]
    columns[:, 3:] = kernel.cross(_euler_axes(angles), body[:, 3:])
    columns[:, 3:] *= np.array([[float(sigma)] for sigma in stage.attitude.sigma])
    kernel.turn_columns(columns, 2, draw.sin_yaw, draw.cos_yaw)
    return columns


def _euler_axes(angles: tuple[tuple[Array, Array], ...]) -> Array:
    """The axes about which roll, pitch and yaw turn, level axes, (3, 3, n): [:, k] is one."""
    _, (sin_pitch, cos_pitch), (sin_yaw, cos_yaw) = angles
    axes = np.zeros((3, 3, sin_yaw.shape[0]))
    axes[0, 0], axes[1, 0], axes[2, 0] = cos_pitch * cos_yaw, cos_pitch * sin_yaw, -sin_pitch
    axes[0, 1], axes[1, 1] = -sin_yaw, cos_yaw
    axes[2, 2] = 1.0
    return axes


def _factor_times(covariance: Covariance, vector: Array) -> Array:
    """L v with L L' the covariance (Cholesky; zero columns where it is singular)."""
    xx, xy, xz, yy, yz, zz = covariance
    l11 = np.sqrt(xx)
    safe = np.where(l11 > 0.0, l11, 1.0)
    l21, l31 = xy / safe, xz / safe
    l22 = np.sqrt(np.maximum(yy - l21 * l21, 0.0))
    safe = np.where(l22 > 0.0, l22, 1.0)
    l32 = np.where(l22 > 0.0, (yz - l31 * l21) / safe, 0.0)
    l33 = np.sqrt(np.maximum(zz - l31 * l31 - l32 * l32, 0.0))
    x, y, z = vector
    return np.stack([l11 * x, l21 * x + l22 * y, l31 * x + l32 * y + l33 * z])


def _dot(first: Array, second: Array) -> Array:
    total: Array = np.sum(first * second, axis=0)
    return total
