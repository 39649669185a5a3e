"""A smoothed position in a log: the low pass of the motion that the log holds.

Oracle: on a sinusoid the filter T dy/dt + y = x has a closed form, A (sin W t - W T cos W t) /
(1 + W^2 T^2); on others scipy.signal.lfilter at a millisecond, from long before the first row.
"""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from syncline_design.diagnosis.past import LoggedPast
from syncline_design.diagnosis.trajectory import SplinePieces, pieces
from syncline_design.effects.kinematics import euler_to_rotation
from syncline_design.logs.log import LogTrack

Array = NDArray[np.float64]
SWAY, TURN = 0.9, 0.35  # rad/s


def sinusoid(t: Array, lag_s: float) -> Array:
    """Place, so smoothed (n, 3)."""

    def passed(w: float, size: float) -> Array:
        wt = w * lag_s
        return size * (np.sin(w * t) - wt * np.cos(w * t)) / (1.0 + wt * wt)

    return np.stack([passed(SWAY, 12.0), passed(2.0 * SWAY, 6.0), passed(0.4, 2.0)], axis=1)


def speed(t: Array) -> Array:
    north, east = (12.0 * SWAY * np.cos(k * SWAY * t) for k in (1.0, 2.0))
    return np.stack([north, east, 0.8 * np.cos(0.4 * t)], axis=1)


def turned(t: Array) -> tuple[Array, Array]:
    """R_nb and body rates of a level vehicle that turns steadily."""
    euler = np.stack([0.0 * t, 0.0 * t, TURN * t], axis=1)
    return euler_to_rotation(euler), np.tile([0.0, 0.0, TURN], (t.shape[0], 1))


def past(t: Array, from_positions: bool = False) -> LoggedPast:
    rotation, rate = turned(t)
    return LoggedPast(t, LogTrack(t, speed(t)), t, rotation, rate, from_positions)


@pytest.mark.parametrize("lag_s", [0.02, 0.3, 1.5])
@pytest.mark.parametrize("rows", [1, 3])
def test_lag_of_a_path_that_changes_its_turn(lag_s: float, rows: int) -> None:
    """0.2 mm of a lag of metres, once the past before the log is forgotten; 1e-4 of the arm."""
    rng = np.random.default_rng(4)
    t = np.repeat(np.arange(0.0, 60.0, 0.1) + rng.uniform(-0.02, 0.02, 600), rows)
    place, turn = past(t)(lag_s)
    settled = t > 15.0 * lag_s + 0.5
    wanted = sinusoid(t, lag_s) - sinusoid(t, 0.0)
    np.testing.assert_allclose(place[settled], wanted[settled], atol=2e-4)
    w = TURN * lag_s
    ahead = np.stack([np.cos(TURN * t), np.sin(TURN * t)], axis=1)
    across = np.stack([np.sin(TURN * t), -np.cos(TURN * t)], axis=1)
    first = (ahead + w * across) / (1.0 + w * w) - ahead
    np.testing.assert_allclose(turn[:, :2, 0], first, atol=1e-4)


def test_lag_of_some_rows_is_theirs_in_the_whole_log() -> None:
    t = np.arange(0.0, 300.0, 0.25)
    t[800:] += 40.0  # a gap
    whole = past(t)
    some = np.concatenate([np.arange(500, 520), np.arange(900, 1000)])
    for found, wanted in zip(whole.part(some)(0.7), whole(0.7), strict=True):
        np.testing.assert_allclose(found, wanted[some], atol=1e-6)


def test_velocity_of_the_smoothed_places_themselves() -> None:
    """T dy/dt = x - y."""
    t = np.arange(0.0, 20.0, 0.1)
    place, _ = past(t, from_positions=True)(0.4)
    np.testing.assert_allclose(place, -0.4 * speed(t), atol=1e-12)


def test_lag_at_another_rate_of_the_velocity() -> None:
    """Velocities at 40 Hz of a path of uneven rhythm, asked for between them."""
    fine = np.arange(-20.0, 30.0, 1e-3)
    path = 5.0 * np.sin(fine + 0.8 * np.sin(0.7 * fine))
    kept = float(np.exp(-1e-3 / 0.6))
    mean = (1.0 - kept) * 0.6 / 1e-3
    start = [path[0] * (1.0 - (1.0 - mean))]
    smooth = lfilter([1.0 - mean, mean - kept], [1.0, -kept], path, zi=start)[0]
    at = np.arange(0.0, 29.0, 0.333)
    stamps = np.arange(-5.0, 30.0, 0.025)
    slope = np.gradient(path, fine)
    velocity = np.zeros((stamps.shape[0], 3))
    velocity[:, 0] = np.interp(stamps, fine, slope)
    rotation, rate = turned(at)
    place, _ = LoggedPast(at, LogTrack(stamps, velocity), at, rotation, rate)(0.6)
    wanted = np.interp(at, fine, smooth - path)
    np.testing.assert_allclose(place[8:, 0], wanted[8:], atol=2e-3)
    assert float(np.max(np.abs(wanted))) > 2.0


def test_splines_are_made_once_for_all_time_constants(monkeypatch: pytest.MonkeyPatch) -> None:
    """And each lag is the one that a past asked for nothing else gives, to the last digit."""
    made = []

    def counted(*given: Array) -> SplinePieces:
        made.append(1)
        return pieces(*given)

    monkeypatch.setattr("syncline_design.diagnosis.past.pieces", counted)
    t, constants_s = np.arange(0.0, 30.0, 0.1), (0.25, 0.5, 1.0, 2.0)
    one = past(t)
    found = [one(constant_s) for constant_s in constants_s]
    assert len(made) == 2  # of the velocity, and of dR/dt
    for constant_s, lags in zip(constants_s, found, strict=True):
        for lag, alone in zip(lags, past(t)(constant_s), strict=True):
            np.testing.assert_array_equal(lag, alone)
