"""Slopes of noisy motion columns: what accelerations are made of."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import make_smoothing_spline

from syncline_design.diagnosis.trajectory import smooth_bend, smooth_slope
from syncline_design.logs.smoothing import PENALTIES, Smoothing, penalty

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


def test_an_acceleration_of_places_is_smoothed_by_the_places_own_noise() -> None:
    """From row to row 5 cm at 10 Hz make 12 m/s2, the slope of a slope half of it; the fortieth of
    the former is left at most."""
    noise = 0.05 * np.random.default_rng(4).standard_normal(SPEED.shape)
    bend = np.stack([-2.0 * np.sin(0.5 * TIME_S), 0.04 + 0.0 * TIME_S, 0.0 * TIME_S], axis=1)
    inner = (TIME_S > 2.0) & (TIME_S < 57.0)  # at its ends a spline is straight
    assert smooth_bend(TIME_S, SPEED, TIME_S)[inner] == pytest.approx(bend[inner], abs=0.03)
    found = smooth_bend(TIME_S, SPEED + noise, TIME_S)
    assert float(np.sqrt(np.mean((found - bend)[inner] ** 2))) < 12.0 / 40.0


def test_a_series_bends_as_its_parts_do_together() -> None:
    noise = 0.05 * np.random.default_rng(4).standard_normal(SPEED.shape)
    both = [smooth_bend(TIME_S, SPEED + noise, TIME_S, part) for part in (SPEED, noise)]
    whole = smooth_bend(TIME_S, SPEED + noise, TIME_S)
    assert both[0] + both[1] == pytest.approx(whole, abs=1e-9)


def test_some_rows_have_the_slopes_of_all() -> None:
    whole = smooth_slope(TIME_S, SPEED, TIME_S)
    assert smooth_slope(TIME_S, SPEED, TIME_S[200:400:7]) == pytest.approx(
        whole[200:400:7], abs=5e-3
    )


def test_what_is_foretold_is_what_another_librarys_splines_say() -> None:
    """Uneven stamps; the two ways lose digits, the more the smoother the spline is."""
    rng = np.random.default_rng(11)
    time_s = np.cumsum(rng.uniform(0.05, 0.4, 300))
    series = 3e3 + np.sin(time_s) + rng.normal(0.0, 0.2, 300)
    known, asked, unit = slice(0, None, 2), slice(1, -1, 2), float(np.median(np.diff(time_s))) ** 3
    foretold = Smoothing(time_s[known], time_s[asked])
    errors = []
    for share in PENALTIES:
        other = make_smoothing_spline(time_s[known], series[known], lam=unit * share)
        own = foretold.values(series[known], unit * share)
        assert own == pytest.approx(other(time_s[asked]), abs=1e-7)
        slope = foretold.slopes(series[known], unit * share)
        assert slope == pytest.approx(other(time_s[asked], 1), abs=1e-7)
        bend = foretold.bends(series[known], unit * share)
        assert bend == pytest.approx(other(time_s[asked], 2), abs=1e-6)
        errors.append(np.sum((other(time_s[asked]) - series[asked]) ** 2))
    best = int(np.argmin(errors))
    assert 0 < best < len(PENALTIES) - 1
    assert penalty(time_s, series) == pytest.approx(2.0 * unit * PENALTIES[best])
