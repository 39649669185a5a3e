"""Tails of one sensor beside the noise of others: its own degrees of freedom, not those of the sum.

Oracle: the convolution integral by scipy.integrate.quad, and draws of known tails by numpy.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats
from scipy.integrate import quad

from syncline_design.diagnosis.sensor_tails import FREEDOMS, _log_densities, tails_beside

SIGMA_M = 0.012


@pytest.mark.parametrize("error", [0.0, 0.7, 3.0, 12.0])
@pytest.mark.parametrize("others", [1e-6, 0.5, 4.0])
def test_density_is_the_convolution(error: float, others: float) -> None:
    ones = np.ones((1, 1))
    found = _log_densities(error * ones, ones, others * ones)[0]
    for k in (2, 8, 20):
        nu, spread = float(FREEDOMS[k]), math.sqrt(others)

        def density(x: float, nu: float = nu, spread: float = spread) -> float:
            return float(stats.t.pdf(x, nu) * stats.norm.pdf(error - x, scale=spread))

        reach = 9.0 * spread
        wanted = quad(density, error - reach, error + reach, points=[error], limit=200)[0]
        assert found[k] == pytest.approx(math.log(wanted), abs=2e-3)


@pytest.mark.parametrize(
    ("freedom", "rate", "others"), [(2.5, 0.0, 1.0), (3.2, 0.01, 1.0), (4.0, 0.0, 4.0)]
)
def test_freedom_and_outliers_are_those_of_the_sensor(
    freedom: float, rate: float, others: float
) -> None:
    """1500 rows of three axes, other noise as large as the sensor's or twice that."""
    rng = np.random.default_rng(3)
    drawn = rng.standard_t(freedom, (1500, 3))
    struck = rng.random(1500) < rate
    drawn[struck] = 10.0 * rng.standard_normal((int(struck.sum()), 3))
    drawn += math.sqrt(others) * rng.standard_normal(drawn.shape)
    own = np.full(drawn.shape, SIGMA_M**2)
    found = tails_beside(SIGMA_M * drawn, own, others * own)
    assert found.freedom_uncertainty < 0.12 * freedom
    assert abs(found.degrees_of_freedom - freedom) < 3.0 * found.freedom_uncertainty
    assert found.outlier_rate == pytest.approx(rate, abs=0.006)


@pytest.mark.parametrize(("freedom", "core"), [(6.0, 7.0), (4.0, 3.0)])
def test_a_core_wider_than_the_spec_says_is_no_flood_of_outliers(
    freedom: float, core: float
) -> None:
    """Held to the spec's width, half of the rows would be outliers of a very heavy tail."""
    rng = np.random.default_rng(11)
    drawn = core * rng.standard_t(freedom, (1500, 2))
    own = np.full(drawn.shape, SIGMA_M**2)
    others = 9.0 * own
    noise = SIGMA_M * (drawn + 3.0 * rng.standard_normal(drawn.shape))
    found = tails_beside(noise, own, others, factor=core * math.sqrt(freedom / (freedom - 2.0)))
    assert found.outlier_rate == 0.0
    assert found.scale == pytest.approx(core, rel=0.1)
    assert found.wider > 10.0
    assert found.freedom_uncertainty < 0.35 * freedom
    assert abs(found.degrees_of_freedom - freedom) < 3.0 * found.freedom_uncertainty
