"""Velocity and rates that a log does not hold, from its positions and attitudes."""

from __future__ import annotations

import itertools

import numpy as np

from syncline_design.effects.kinematics import euler_to_rotation
from syncline_design.effects.record import Array
from syncline_design.logs.log import GAP_FACTOR
from syncline_design.logs.stamps import Index, groups, per_stamp, starts

WINDOW_S = 1.0  # a parabola is fitted over this long, or five stamps
LEAST_WINDOW = 5
MOST_CELLS = 500_000  # rows times window that are worked on at once


def derived_velocity(time_s: Array, place_m: Array) -> Array:
    """Slope of positions (n, 3) by a moving parabola [m/s]; cut at gaps.

    Noise of a derived velocity enters every sensitivity, so the window is a second or five stamps,
    whichever is longer.  Rows of one stamp count once, with their mean, and share the slope.
    Source: Savitzky and Golay, Anal. Chem. 36 (1964), for uneven stamps.
    """
    group = groups(time_s)
    time_s, place_m = per_stamp(time_s, place_m)
    step = np.diff(time_s)
    usual = float(np.median(step))
    half = max(LEAST_WINDOW // 2, round(0.5 * WINDOW_S / usual))
    cuts = np.flatnonzero(step > GAP_FACTOR * usual) + 1
    bounds = [0, *cuts.tolist(), time_s.shape[0]]
    parts = [_slope(time_s[a:b], place_m[a:b], half) for a, b in itertools.pairwise(bounds)]
    slope: Array = np.concatenate(parts)[group]
    return slope


def _slope(time_s: Array, place_m: Array, half: int) -> Array:
    """Slope at every row of a parabola through the rows within `half` of it."""
    n = time_s.shape[0]
    if n < 2:
        return np.zeros_like(place_m)
    if n < 3:
        return np.gradient(place_m, time_s, axis=0)
    width = min(2 * half + 1, n)
    start = np.clip(np.arange(n) - width // 2, 0, n - width)
    most = max(MOST_CELLS // width, 1)
    parts = [_parabola(time_s, place_m, a, start[a : a + most], width) for a in range(0, n, most)]
    return np.concatenate(parts)


def _parabola(time_s: Array, place_m: Array, at: int, start: Index, width: int) -> Array:
    """Slopes of the rows from `at` on, each from the `width` rows that begin at its start."""
    index = start[:, None] + np.arange(width)
    u = time_s[index] - time_s[at : at + start.shape[0], None]
    powers = np.stack([np.ones_like(u), u, u * u], axis=-1)
    normal = np.swapaxes(powers, 1, 2) @ powers
    right = np.swapaxes(powers, 1, 2) @ place_m[index]
    slope: Array = np.linalg.solve(normal, right)[:, 1, :]
    return slope


def derived_rate(time_s: Array, euler_rad: Array) -> Array:
    """Body rates (n, 3) [rad/s] from attitudes: the slope of the turns added up, smoothed.

    The turns between neighbours, each in the body's axes, add up to the integral of the rate with
    the attitudes' own noise on top, white as it was.  Unsmoothed, that noise would be in every
    sensitivity and in the error at once, and the one would seem to explain the other.  Rows of one
    stamp have one attitude, the first row's, and share the rate.
    """
    from scipy.spatial.transform import Rotation

    from syncline_design.logs.smoothing import velocity_of

    first = starts(time_s)
    pose = Rotation.from_matrix(euler_to_rotation(euler_rad[first]))
    turn = np.zeros((first.shape[0], 3))
    turn[1:] = np.cumsum((pose[:-1].inv() * pose[1:]).as_rotvec(), axis=0)
    rate: Array = velocity_of(time_s[first], turn)[groups(time_s)]
    return rate
