"""Exact intervals and the special functions they need."""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest
from scipy import stats

from syncline_design.simulation.intervals import (
    binomial_cdf,
    binomial_quantile,
    incomplete_beta,
    proportion_interval,
    quantile_ranks,
)
from tests.simulation_systems import fixed_wing, survey


@pytest.mark.parametrize("scale", [1.0, 10.0, 1e3, 1e5, 1e6])
def test_incomplete_beta_against_mpmath(scale: float) -> None:
    """Stated: error below 1e-9 up to a + b = 2e5, 5e-9 up to 2e6."""
    mpmath.mp.dps = 40
    for a, b in ((0.5, 1.0), (1.0, 0.05), (0.3, 0.7)):
        p, q = a * scale, b * scale
        middle, spread = p / (p + q), math.sqrt(p * q / (p + q) ** 2 / (p + q + 1))
        for shift in (-3.0, -0.5, 0.0, 0.5, 2.0):
            x = min(max(middle + shift * spread, 1e-9), 1 - 1e-9)
            exact = stats.beta.cdf(x, p, q)
            if scale <= 1e3:
                exact = float(mpmath.betainc(p, q, 0, x, regularized=True))
            assert abs(incomplete_beta(p, q, x) - exact) < (1e-9 if scale < 1e6 else 5e-9)


def test_incomplete_beta_of_many_samples() -> None:
    """Stated: error below 1e-6 at a + b = 1e8."""
    for x in (0.94998, 0.95, 0.95002):
        exact = stats.beta.cdf(x, 95e6, 5e6)
        assert abs(incomplete_beta(95e6, 5e6, x) - exact) < 1e-6
    assert incomplete_beta(2.0, 3.0, 0.0) == 0.0
    assert incomplete_beta(2.0, 3.0, 1.0) == 1.0


def test_binomial_against_scipy() -> None:
    for n in (1, 2, 10, 333, 100_000):
        for p in (0.003, 0.5, 0.95, 0.997):
            law = stats.binom(n, p)
            for k in {0, n // 2, round(n * p), n - 1, n}:
                assert binomial_cdf(k, n, p) == pytest.approx(law.cdf(k), abs=1e-9)
            for level in (0.025, 0.4, 0.975):
                assert binomial_quantile(level, n, p) == law.ppf(level)


def test_clopper_pearson_against_scipy() -> None:
    for n, k in ((1, 0), (1, 1), (10, 0), (10, 3), (10, 10), (5000, 4700), (200_000, 199_999)):
        for confidence in (0.9, 0.95, 0.9875):
            exact = stats.binomtest(k, n).proportion_ci(confidence, "exact")
            found = proportion_interval(k, n, confidence)
            np.testing.assert_allclose(found, (exact.low, exact.high), atol=1e-9)


def test_quantile_ranks_enclose_with_the_stated_probability_and_no_more() -> None:
    """Exact coverage P(low <= B < high), B ~ Bin(n, p), and neither end can move inward."""
    for n in (40, 1000, 12_345):
        for p in (0.5, 0.95):
            low, middle, high = quantile_ranks(p, n)
            law = stats.binom(n, p)
            assert law.cdf(high - 1) - law.cdf(low - 1) >= 0.95
            assert law.cdf(low) > 0.025
            assert law.cdf(high - 2) < 0.975
            assert low <= middle <= high


SYSTEMS = {"wing": fixed_wing(), "survey": survey()}
