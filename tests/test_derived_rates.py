"""Rates that a log does not hold: those of the attitudes' motion, not those of their noise."""

from __future__ import annotations

import numpy as np
import pytest

from syncline_design.logs.derivatives import derived_rate

Pair = tuple[np.ndarray, np.ndarray]


def swaying(time_s: np.ndarray) -> Pair:
    """Euler angles [rad] and body rates [rad/s] by the textbook's relation between their slopes."""
    size, period_s = np.array([0.15, 0.1, 0.8]), np.array([5.0, 7.0, 31.0])
    turn = 2.0 * np.pi / period_s
    euler = size * np.sin(turn * time_s[:, None]) + np.array([0.0, 0.05, 2.9])
    slope = size * turn * np.cos(turn * time_s[:, None])
    (roll, pitch, _), (droll, dpitch, dyaw) = euler.T, slope.T
    rate = np.stack(
        [
            droll - dyaw * np.sin(pitch),
            dpitch * np.cos(roll) + dyaw * np.cos(pitch) * np.sin(roll),
            -dpitch * np.sin(roll) + dyaw * np.cos(pitch) * np.cos(roll),
        ],
        axis=1,
    )
    return (euler + np.pi) % (2.0 * np.pi) - np.pi, rate


@pytest.mark.parametrize("rows_a_stamp", [1, 3])
def test_without_noise_they_are_the_motions_own(rows_a_stamp: int) -> None:
    """Yaw passes 180 deg; over a gap of 20 s nothing is known."""
    time_s = np.concatenate([np.arange(0.0, 30.0, 0.1), np.arange(50.0, 80.0, 0.1)])
    time_s = np.repeat(time_s, rows_a_stamp)
    euler, rate = swaying(time_s)
    inner = (np.abs(time_s - 40.0) > 10.5) & (time_s > 0.5) & (time_s < 79.0)
    found = derived_rate(time_s, euler)
    assert float(np.max(np.abs(found - rate)[inner])) < 2e-4  # rad/s, of 0.2


def test_noise_is_hardly_in_the_rate_and_its_slope() -> None:
    """Turns from row to row would be off by sqrt(2) sigma / h, averaged over two: 7 mrad/s.

    Their slope would be off by (n_(i+1) - 2 n_i + n_(i-1)) / h^2, sqrt(6) sigma / h^2 = 245 mrad/s2
    of a motion's 150, most of it the noise of the very row, which is in the row's error as well.
    """
    time_s, sigma = np.arange(0.0, 120.0, 0.1), 1e-3
    euler, rate = swaying(time_s)
    noise = sigma * np.random.default_rng(4).standard_normal(euler.shape)
    off = (derived_rate(time_s, euler + noise) - rate)[20:-20]
    assert float(np.std(off)) < 0.25 * np.sqrt(2.0) / 2.0 * sigma / 0.1
    assert float(np.std(np.diff(off, axis=0) / 0.1)) < 0.05 * np.sqrt(6.0) * sigma / 0.1**2
    assert np.all(derived_rate(time_s[:1], euler[:1]) == 0.0)
