"""Slopes of noisy motion columns: what accelerations are made of."""

from __future__ import annotations

import numpy as np
import pytest

from syncline_design.diagnosis.trajectory import smooth_slope

TIME_S = np.concatenate([np.arange(0.0, 60.0, 0.1), np.arange(75.0, 120.0, 0.1)])
SPEED = np.stack([8.0 * np.sin(0.5 * TIME_S), 0.02 * TIME_S**2, np.zeros(TIME_S.size)], axis=1)
SLOPE = np.stack([4.0 * np.cos(0.5 * TIME_S), 0.04 * TIME_S, np.zeros(TIME_S.size)], axis=1)


def test_a_series_without_noise_keeps_its_slope() -> None:
    assert smooth_slope(TIME_S, SPEED, TIME_S) == pytest.approx(SLOPE, abs=5e-3)


def test_noise_hardly_shows_in_the_slope() -> None:
    """From row to row 5 cm/s at 10 Hz make 0.35 m/s2; the sixth of that is left at most.

    Of 1000 values a root mean square is within 10 % of its expectation but once in 10 000 times.
    """
    noise = 0.05 * np.random.default_rng(4).standard_normal(SPEED.shape)
    found = smooth_slope(TIME_S, SPEED + noise, TIME_S)
    assert float(np.sqrt(np.mean((found - SLOPE) ** 2))) < 0.35 / 6.0


def test_some_rows_have_the_slopes_of_all() -> None:
    whole = smooth_slope(TIME_S, SPEED, TIME_S)
    assert smooth_slope(TIME_S, SPEED, TIME_S[200:400:7]) == pytest.approx(
        whole[200:400:7], abs=5e-3
    )
