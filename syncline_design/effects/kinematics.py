"""Rows to the vectors that effects are made of: b, q, V, W of the dictionary."""

from __future__ import annotations

import numpy as np

from syncline_design.effects.record import ActsOn, Array, Departures, StageRows, Values

GRAVITY_MPS2 = 9.80665


def bearing(azimuth_rad: Array, elevation_rad: Array) -> Array:
    """Unit vectors n = [cos az cos el, sin az cos el, -sin el], shape (n, 3).

    Source: the paper's bearing vector (before eq. bear_posvec).
    """
    cos_el = np.cos(elevation_rad)
    found = np.empty((*cos_el.shape, 3))
    found[..., 0] = np.cos(azimuth_rad) * cos_el
    found[..., 1] = np.sin(azimuth_rad) * cos_el
    found[..., 2] = -np.sin(elevation_rad)
    return found


def within_half_a_turn(angle_rad: Array) -> Array:
    """Angles [rad] of any shape, from -pi to below pi."""
    found: Array = np.remainder(angle_rad + np.pi, 2.0 * np.pi) - np.pi
    return found


def cross(a: Array, b: Array) -> Array:
    """a x b row by row, (n, 3) or (3,) each; for few rows in a third of numpy's time."""
    ax, ay, az = a[..., 0], a[..., 1], a[..., 2]
    bx, by, bz = b[..., 0], b[..., 1], b[..., 2]
    x = ay * bz - az * by
    found = np.empty((*x.shape, 3))
    found[..., 0] = x
    found[..., 1] = az * bx - ax * bz
    found[..., 2] = ax * by - ay * bx
    return found


def rotate(rotation: Array, vector: Array) -> Array:
    """R v row by row: (n, 3, 3) times (n, 3) or (3,) gives (n, 3)."""
    turned: Array = np.einsum("nij,nj->ni", rotation, np.broadcast_to(vector, rotation.shape[:2]))
    return turned


def euler_to_rotation(euler_rad: Array) -> Array:
    """R_nb of (roll, pitch, yaw), (n, 3) -> (n, 3, 3); the paper's eq. R_nb."""
    (sr, sp, sy), (cr, cp, cy) = np.sin(euler_rad).T, np.cos(euler_rad).T
    found = np.empty((*sr.shape, 3, 3))
    srsp, crsp = sr * sp, cr * sp
    found[..., 0, 0], found[..., 1, 0], found[..., 2, 0] = cp * cy, cp * sy, -sp
    found[..., 0, 1], found[..., 0, 2] = srsp * cy - cr * sy, crsp * cy + sr * sy
    found[..., 1, 1], found[..., 1, 2] = srsp * sy + cr * cy, crsp * sy - sr * cy
    found[..., 2, 1], found[..., 2, 2] = sr * cp, cr * cp
    return found


def rotation_to_euler(rotation: Array) -> Array:
    """(roll, pitch, yaw) of R_nb, (n, 3, 3) -> (n, 3); at gimbal lock roll is taken as 0."""
    sp = np.clip(-rotation[:, 2, 0], -1.0, 1.0)
    cp = np.hypot(rotation[:, 2, 1], rotation[:, 2, 2])
    locked = cp < 1e-9
    roll = np.where(locked, 0.0, np.arctan2(rotation[:, 2, 1], rotation[:, 2, 2]))
    yaw = np.where(
        locked,
        np.arctan2(-rotation[:, 0, 1], rotation[:, 1, 1]),
        np.arctan2(rotation[:, 1, 0], rotation[:, 0, 0]),
    )
    return np.stack([roll, np.arctan2(sp, cp), yaw], axis=-1)


def ranging_vector(rows: StageRows) -> Array:
    """b = r n [m], body axes, (n, 3)."""
    return rows.range_m[:, None] * bearing(rows.azimuth_rad, rows.elevation_rad)


def antenna_to_object(rows: StageRows) -> Array:
    """q = l + b with l = l_L - l_G [m], body axes, (n, 3)."""
    return rows.ranging_m - rows.antenna_m + ranging_vector(rows)


def antenna_velocity(rows: StageRows) -> Array:
    """V = R (v + w x l_G) [m/s], NED, (n, 3); the paper's eq. meas_gnss."""
    lever = np.broadcast_to(rows.antenna_m, rows.velocity_mps.shape)
    return rotate(rows.rotation, rows.velocity_mps + cross(rows.rate_radps, lever))


def sweep_velocity(rows: StageRows) -> Array:
    """W = R (w x q) [m/s], NED, (n, 3); the paper's eq. meas_ins times the lever q."""
    return rotate(rows.rotation, cross(rows.rate_radps, antenna_to_object(rows)))


def down_axis_sweep(rows: StageRows) -> Array:
    """z x R q [m per rad of heading], NED, z down, (n, 3)."""
    return np.cross(np.array([0.0, 0.0, 1.0]), rotate(rows.rotation, antenna_to_object(rows)))


def column(value: float, rows: StageRows) -> Array:
    """A constant as (n,) rows."""
    return np.full(len(rows), value)


def row_vector(x: float, y: float, z: float) -> Array:
    """A constant vector as one (1, 3) row, for broadcasting."""
    return np.array([[x, y, z]])


def shifted(sensor: ActsOn, shift_s: Array) -> Departures:
    """mu of one sensor changed by shift_s (n,)."""
    if sensor == "position":
        return Departures(position_shift_s=shift_s)
    if sensor == "attitude":
        return Departures(attitude_shift_s=shift_s)
    return Departures(ranging_shift_s=shift_s)


def shift_slope(rows: StageRows, sensor: ActsOn) -> Array:
    """d error / d mu of a sensor [m/s], NED, (n, 3): V, W, or -(V + W) for the reference."""
    if sensor == "position":
        return antenna_velocity(rows)
    if sensor == "attitude":
        return sweep_velocity(rows)
    return -(antenna_velocity(rows) + sweep_velocity(rows))


def elapsed(rows: StageRows) -> Array:
    """t - t0 [s] since the mission's start (of a log: its first row), (n,)."""
    start = rows.time_s[0] if rows.start_s is None else rows.start_s
    since: Array = rows.time_s - start
    return since


def gauss_markov(time_s: Array, time_constant_s: float, draws: Array) -> Array:
    """First-order Gauss-Markov process of unit variance at the stamps, (n, k), from normal draws.

    x_i = phi x_{i-1} + sqrt(1 - phi^2) draw_i, phi = exp(-dt / T).
    """
    phi = np.exp(-np.abs(np.diff(time_s)) / time_constant_s)
    fresh = np.sqrt(1.0 - phi * phi)[:, None] * draws[1:]
    walk = np.empty_like(draws)
    walk[0] = draws[0]
    for i in range(1, len(draws)):
        walk[i] = phi[i - 1] * walk[i - 1] + fresh[i - 1]
    return walk


def wander(rows: StageRows, time_constant_s: float, draws: Array) -> Array:
    """A Gauss-Markov process of unit variance along a log, (n, k), from normal draws (n, k).

    Rows that are samples of missions of their own have its stationary distribution each.
    """
    return draws if rows.independent else gauss_markov(rows.time_s, time_constant_s, draws)


def heading_departure(rows: StageRows, values: Values, turns: int) -> Departures:
    """Yaw read too large by sin_rad sin(turns yaw) + cos_rad cos(turns yaw) [rad]."""
    angle = turns * rows.euler_rad[:, 2]
    added = np.zeros((len(rows), 3))
    added[:, 2] = values["sin_rad"] * np.sin(angle) + values["cos_rad"] * np.cos(angle)
    return Departures(attitude_euler_rad=added)


def heading_slope(rows: StageRows, turns: int) -> Array:
    """d error / d (sin_rad, cos_rad) = (z x R q) (sin, cos)(turns yaw) [m/rad]; (n, 3, 2)."""
    angle = turns * rows.euler_rad[:, 2]
    wave = np.stack([np.sin(angle), np.cos(angle)], axis=-1)
    slope: Array = down_axis_sweep(rows)[:, :, None] * wave[:, None, :]
    return slope


def specific_force(rows: StageRows) -> Array:
    """f = a - g [m/s2], body, (n, 3): what an accelerometer feels and what loads the mount.

    At rest and level f = (0, 0, -9.81): the spec's arm is that of the unloaded mount.
    """
    down = GRAVITY_MPS2 * rows.rotation[:, 2, :]  # R' (0, 0, g)
    force: Array = rows.acceleration_mps2 - down
    return force
