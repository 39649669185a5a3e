"""Bounds of timestamp errors against probabilities, extremes and hand-computed figures."""

from __future__ import annotations

import math
import random

import mpmath
import pytest
from hypothesis import given
from hypothesis import strategies as st

from syncline_design.model import timing
from syncline_design.model.timing import Constant, Empirical, Normal, TimingError, Uniform

SECONDS = st.floats(-1.0, 1.0, allow_nan=False, width=32)
WIDTHS = st.floats(0.0, 1.0, allow_nan=False, width=32)


@pytest.mark.parametrize(
    ("error", "k", "expected"),
    [
        (TimingError(Uniform(-16e-3, 0.0)), 3.0, 16e-3),  # data that wait up to 16 ms in a buffer
        (TimingError(Uniform(-10e-9, 10e-9)), 3.0, 10e-9),
        (TimingError(Uniform(2e-3, 5e-3)), 3.0, 5e-3),
        (TimingError(Normal(-6.92e-6, 1.72e-6)), 3.0, 12.08e-6),
        (TimingError(Normal(-6.92e-6, 1.72e-6)), 2.0, 10.36e-6),
        (TimingError(Constant(-0.1)), 3.0, 0.1),
        (TimingError(Empirical((-3e-3, 1e-3, 2e-3))), 3.0, 3e-3),
        # the mean calibrated out: half a width, k std, nothing, the centred extreme; plus the rest
        (TimingError(Uniform(-16e-3, 0.0), 2e-3), 3.0, 10e-3),
        (TimingError(Normal(-0.5, 1e-3), 0.0), 3.0, 3e-3),
        (TimingError(Constant(-0.1), 2e-3), 3.0, 2e-3),
        (TimingError(Empirical((-4e-3, 1e-3, 0.0)), 1e-3), 3.0, 4e-3),
    ],
)
def test_bounds_computed_by_hand(error: TimingError, k: float, expected: float) -> None:
    assert timing.bound(error, k) == pytest.approx(expected, rel=1e-12)


def test_no_error_has_no_bound() -> None:
    assert timing.bound(timing.NO_ERROR) == 0.0


@given(SECONDS, WIDTHS, st.floats(0.5, 6.0))
def test_normal_bound_covers_at_least_the_one_sided_probability(
    mean: float, std: float, k: float
) -> None:
    """P(|mu| <= |mean| + k std) >= 2 Phi(k) - 1, from mpmath's normal distribution."""
    std += 1e-6
    bound = timing.bound(TimingError(Normal(mean, std)), k)
    inside = mpmath.ncdf(bound, mean, std) - mpmath.ncdf(-bound, mean, std)
    assert inside >= (2 * mpmath.ncdf(k) - 1) * (1 - mpmath.mpf("1e-9"))


@given(SECONDS, WIDTHS, st.none() | WIDTHS)
def test_uniform_bound_is_reached_and_never_passed(
    low: float, width: float, calibrated: float | None
) -> None:
    """Every draw stays inside, and the worst end with the worst remainder reaches the bound."""
    high = low + width
    error = TimingError(Uniform(low, high), calibrated)
    remains = 0.0 if calibrated is None else calibrated
    removed = 0.0 if calibrated is None else (low + high) / 2
    generator = random.Random(7)
    draws = [generator.uniform(low, high) for _ in range(50)] + [low, high]
    worst = max(abs(draw - removed + sign * remains) for draw in draws for sign in (-1, 1))
    assert timing.bound(error) == pytest.approx(worst, rel=1e-9, abs=1e-15)


@given(st.lists(SECONDS, min_size=1, max_size=20))
def test_mean_of_measured_values(values: list[float]) -> None:
    exact = mpmath.fsum(values) / len(values)
    assert timing.mean(Empirical(tuple(values))) == pytest.approx(float(exact), abs=1e-15)
    assert timing.bound(TimingError(Empirical(tuple(values)))) == max(map(abs, values))


def test_means_of_the_other_distributions() -> None:
    assert timing.mean(Uniform(-16e-3, 0.0)) == pytest.approx(-8e-3)
    assert timing.mean(Normal(-2.0, 1.0)) == -2.0
    assert timing.mean(Constant(3.0)) == 3.0


def test_nan_is_not_swallowed() -> None:
    assert math.isnan(timing.bound(TimingError(Normal(0.0, math.nan))))
    assert math.isnan(timing.bound(TimingError(Constant(math.nan))))


def test_bound_grows_with_the_coverage_factor_only_for_normal_errors() -> None:
    normal, uniform = TimingError(Normal(1e-3, 1e-3)), TimingError(Uniform(-1e-3, 2e-3))
    assert timing.bound(normal, 3.0) > timing.bound(normal, 2.0)
    assert timing.bound(uniform, 3.0) == timing.bound(uniform, 2.0)
