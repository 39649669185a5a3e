"""Low-discrepancy points and the few special functions that the conditioned estimator needs."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cache
from statistics import NormalDist

import numpy as np

from syncline_design.effects.record import Array

# erf on [0, inf): M. Abramowitz, I. A. Stegun, Handbook of Mathematical Functions, 7.1.26,
# |error| <= 1.5e-7
_ERF_P = 0.3275911
_ERF_A = (0.254829592, -0.284496736, 1.421413741, -1.453152027, 1.061405429)
# normal quantile: P. J. Acklam's rational approximation, |relative error| <= 1.15e-9
_TAIL = 0.02425
_CENTRE_UP = (
    -3.969683028665376e01, 2.209460984245205e02, -2.759285104469687e02,
    1.383577518672690e02, -3.066479806614716e01, 2.506628277459239e00,
)  # fmt: skip
_CENTRE_DOWN = (
    -5.447609879822406e01, 1.615858368580409e02, -1.556989798598866e02,
    6.680131188771972e01, -1.328068155288572e01, 1.0,
)  # fmt: skip
_TAIL_UP = (
    -7.784894002430293e-03, -3.223964580411365e-01, -2.400758277161838e00,
    -2.549732539343734e00, 4.374664141464968e00, 2.938163982698783e00,
)  # fmt: skip
_TAIL_DOWN = (
    7.784695709041462e-03, 3.224671290700398e-01, 2.445134137142996e00,
    3.754408661907416e00, 1.0,
)  # fmt: skip


def normal_quantile(probability: Array) -> Array:
    """z with Phi(z) = p, 0 < p < 1, any shape; relative error at most 1.2e-9.

    Source: P. J. Acklam, "An algorithm for computing the inverse normal cumulative distribution
    function" (2003), rational approximations in p - 1/2 and in sqrt(-2 ln p).
    """
    centre = probability - 0.5
    square = centre * centre
    z = centre * _polynomial(_CENTRE_UP, square) / _polynomial(_CENTRE_DOWN, square)
    smaller = np.minimum(probability, 1.0 - probability)
    in_tail = smaller < _TAIL
    if np.any(in_tail):
        far = np.sqrt(-2.0 * np.log(smaller[in_tail]))
        tail = _polynomial(_TAIL_UP, far) / _polynomial(_TAIL_DOWN, far)
        z[in_tail] = np.where(centre[in_tail] < 0.0, tail, -tail)
    return z


def chi3_cdf(length: Array, density_factor: Array) -> Array:
    """P(chi_3 <= s), s >= 0: erf(s / sqrt 2) - sqrt(2/pi) s exp(-s^2 / 2), within 1.5e-7.

    density_factor: exp(-s^2 / 2), which the caller has already.  The length of a standard normal
    3-vector; the Maxwell distribution.
    """
    t = 1.0 / (1.0 + (_ERF_P / math.sqrt(2.0)) * length)
    result = t * _polynomial(tuple(reversed(_ERF_A)), t)
    result += math.sqrt(2.0 / math.pi) * length
    result *= -density_factor
    result += 1.0
    return result


def _polynomial(coefficients: tuple[float, ...], x: Array) -> Array:
    """Horner's scheme, highest power first."""
    total = np.full_like(x, coefficients[0])
    for coefficient in coefficients[1:]:
        total *= x
        total += coefficient
    return total


@cache
def generating_vector(dimensions: int, points: int) -> tuple[int, ...]:
    """Generating vector of a rank-1 lattice, component by component.

    Each component minimises P_2 = -1 + mean over k of prod_j (1 + gamma_j 2 pi^2 B_2({k z_j/n})),
    B_2(x) = x^2 - x + 1/6 (J. Dick, F. Y. Kuo, I. H. Sloan, Acta Numerica 22 (2013) 133-288,
    section 5), with weights gamma_j = 0.1/j, chosen by trial on the paper's two examples.
    """
    step = np.arange(points)
    candidates = np.arange(1, max(points // 2, 2), 2)
    product = np.ones(points)
    vector: list[int] = []
    for j in range(1, dimensions + 1):
        weight = 0.2 * math.pi**2 / j
        phase = (candidates[:, None] * step) % points / points
        kernels = 1.0 + weight * (phase * phase - phase + 1.0 / 6.0)
        best = 1 if j == 1 else int(candidates[np.argmin(kernels @ product)])
        phase_best = (best * step) % points / points
        product *= 1.0 + weight * (phase_best * phase_best - phase_best + 1.0 / 6.0)
        vector.append(best)
    return tuple(vector)


@dataclass(slots=True)
class LatticeSource:
    """Randomly shifted copies of one lattice, side by side: count = copies * points.

    Every request takes the next dimensions; each copy has its own shift, so copies are
    independent and unbiased, and points within one cover the cube evenly.  The tent map
    1 - |2u - 1| makes the integrand periodic (F. J. Hickernell, "Obtaining O(N^(-2+eps))
    convergence for lattice quadrature rules", in Monte Carlo and Quasi-Monte Carlo Methods 2000).
    """

    generator: np.random.Generator
    points: int
    copies: int
    vector: tuple[int, ...]
    used: int = field(default=0)

    @property
    def count(self) -> int:
        """Points of all copies."""
        return self.points * self.copies

    def uniform(self, rows: int) -> Array:
        """(rows, count) on [0, 1]."""
        components = np.array(self.vector[self.used : self.used + rows])
        self.used += rows
        lattice = np.outer(components, np.arange(self.points)) % self.points / self.points
        shift = self.generator.random((rows, self.copies, 1))
        cube = lattice[:, None, :] + shift
        cube -= np.floor(cube)
        tent: Array = 1.0 - np.abs(2.0 * cube - 1.0)
        return tent.reshape(rows, -1)

    def normal(self, rows: int) -> Array:
        """(rows, count), standard normal."""
        tiny = 1e-16
        return normal_quantile(np.clip(self.uniform(rows), tiny, 1.0 - tiny))


def student_quantile(probability: float, freedom: int) -> float:
    """t with P(T <= t) = p for Student's T; absolute error below 0.002 from 15 degrees on.

    Cornish-Fisher expansion (Abramowitz and Stegun 26.7.5) about the normal quantile.
    """
    x = NormalDist().inv_cdf(probability)
    n = float(freedom)
    terms = (
        (x**3 + x) / 4.0,
        (5 * x**5 + 16 * x**3 + 3 * x) / 96.0,
        (3 * x**7 + 19 * x**5 + 17 * x**3 - 15 * x) / 384.0,
        (79 * x**9 + 776 * x**7 + 1482 * x**5 - 1920 * x**3 - 945 * x) / 92160.0,
    )
    return x + sum(term / n ** (k + 1) for k, term in enumerate(terms))
