"""Tails, quantiles and densities of the distributions that tests use, by their special functions.

The same figures as the library's distributions, whose import alone takes longer than a short log.
"Beyond" is the chance of more than x, "limit" what is exceeded with chance p.
Source: Abramowitz and Stegun, Handbook of Mathematical Functions (1964), ch. 26.
"""

from __future__ import annotations

import math
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc, chdtri, fdtrc, fdtri, gammaln, ndtr, ndtri, stdtrit

Array = NDArray[np.float64]
Values = TypeVar("Values", float, Array)
_LOG_ROOT_2PI = 0.5 * math.log(2.0 * math.pi)


def chi_square_beyond(x: float, freedom: float) -> float:
    """P(X > x), X chi-square."""
    return float(chdtrc(freedom, np.maximum(x, 0.0)))


def chi_square_log_beyond(x: Values, freedom: float) -> Values:
    """log P(X > x); -inf where the chance is below the smallest number."""
    with np.errstate(divide="ignore"):
        found: Values = np.log(chdtrc(freedom, np.maximum(x, 0.0)))
    return found


def chi_square_limit(p: float, freedom: Values) -> Values:
    """x with P(X > x) = p."""
    found: Values = chdtri(freedom, p)
    return found


def student_limit(p: float, freedom: float) -> float:
    """t with P(T > t) = p."""
    return -float(stdtrit(freedom, p))


def student_log_density(x: Array, freedom: float, scale: float) -> Array:
    """log of the density of Student's t times a scale."""
    half = 0.5 * (freedom + 1.0)
    constant = float(gammaln(half) - gammaln(0.5 * freedom)) - 0.5 * math.log(freedom * math.pi)
    found: Array = constant - math.log(scale) - half * np.log1p((x / scale) ** 2 / freedom)
    return found


def fisher_log_beyond(x: Array, first: float, second: Array) -> Array:
    """log P(F > x), F of first and second degrees of freedom."""
    with np.errstate(divide="ignore"):
        found: Array = np.log(fdtrc(first, second, np.maximum(x, 0.0)))
    return found


def fisher_limit(p: float, first: float, second: float) -> float:
    """x with P(F > x) = p."""
    return float(fdtri(first, second, 1.0 - p))


def normal_beyond(x: float) -> float:
    """P(N > x), N standard normal."""
    return float(ndtr(-x))


def normal_limit(p: Values) -> Values:
    """x with P(N > x) = p."""
    found: Values = -ndtri(p)
    return found


def normal_log_density(x: Array, sigma: float) -> Array:
    """log of the density of a normal distribution about zero."""
    return -0.5 * (x / sigma) ** 2 - _LOG_ROOT_2PI - math.log(sigma)
