"""The nonlinear measurement chain: true pose to georeferenced position minus the true one.

Every row is one stamp of the ranging sensor.  Nothing here is linearised: rotations are exact,
position and attitude are taken at their own shifted times, lever arms rotate.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np

from syncline_design.effects.kinematics import (
    bearing,
    cross,
    euler_to_rotation,
    rotate,
    rotation_to_euler,
)
from syncline_design.effects.record import NOTHING, Array, Departures, StageRows
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.syncline import Sigma


class ChainMotion(Protocol):
    """Where the vehicle is a while before or after each row's stamp."""

    def displacement(self, shift_s: Array) -> Array:
        """p(s) - p(0) [m], NED, (n, 3), for shifts (n,)."""

    def rotation(self, shift_s: Array) -> Array:
        """R_nb at s, (n, 3, 3)."""


_SMALL_RAD = 1e-2


def _sinc(angle: Array) -> Array:
    """sin a / a, by series where a is small."""

    def series(a: Array) -> Array:
        a2 = a * a
        return 1 - a2 / 6 + a2**2 / 120

    return _by_size(angle, series, lambda a: np.sin(a) / a)


def _versed(angle: Array) -> Array:
    """(1 - cos a) / a^2, by series where a is small."""

    def series(a: Array) -> Array:
        a2 = a * a
        return 0.5 - a2 / 24 + a2**2 / 720

    # 1 - cos a = 2 sin^2(a/2): no cancellation where a is small but above the series' limit
    return _by_size(angle, series, lambda a: 2 * np.sin(0.5 * a) ** 2 / a**2)


def _lag(angle: Array) -> Array:
    """(a - sin a) / a^3, by series where a is small."""

    def series(a: Array) -> Array:
        a2 = a * a
        return 1 / 6 - a2 / 120 + a2**2 / 5040

    return _by_size(angle, series, lambda a: (a - np.sin(a)) / a**3)


def _by_size(
    angle: Array, series: Callable[[Array], Array], exact: Callable[[Array], Array]
) -> Array:
    """A function of angles by its series where they are small; neither is computed for nothing."""
    small = angle < _SMALL_RAD
    if np.all(small):
        return series(angle)
    if not np.any(small):
        return exact(angle)
    found: Array = np.where(small, series(angle), exact(np.where(small, 1.0, angle)))
    return found


def rotation_exp(vector: Array) -> Array:
    """exp(S(v)), (n, 3) -> (n, 3, 3): Rodrigues' formula.

    With S^2 = v v' - a^2 I, a = |v|: (1 - a^2 (1 - cos a)/a^2) I + (sin a / a) S
    + ((1 - cos a)/a^2) v v'.
    """
    x, y, z = vector[..., 0], vector[..., 1], vector[..., 2]
    square = x * x + y * y + z * z
    angle = np.sqrt(square)
    once, twice = _sinc(angle), _versed(angle)
    matrix = np.empty((*vector.shape[:-1], 3, 3))
    diagonal, ax, ay, az = 1.0 - twice * square, once * x, once * y, once * z
    bx, by = twice * x, twice * y
    matrix[..., 0, 0] = diagonal + bx * x
    matrix[..., 1, 1] = diagonal + by * y
    matrix[..., 2, 2] = diagonal + twice * z * z
    xy, xz, yz = bx * y, bx * z, by * z
    matrix[..., 0, 1], matrix[..., 1, 0] = xy - az, xy + az
    matrix[..., 0, 2], matrix[..., 2, 0] = xz + ay, xz - ay
    matrix[..., 1, 2], matrix[..., 2, 1] = yz - ax, yz + ax
    return matrix


def screw_displacement(velocity_mps: Array, rate_radps: Array, shift_s: Array) -> Array:
    """(integral of exp(S(w) u) du from 0 to s) v [m], body axes, (n, 3).

    With a = |w s|: s (I + (1 - cos a)/a^2 S + (a - sin a)/a^3 S^2) v, S = S(w s).
    """
    turn = rate_radps * shift_s[:, None]
    angle = np.sqrt(np.einsum("ni,ni->n", turn, turn))
    once = cross(turn, velocity_mps)
    twice = cross(turn, once)
    once *= _versed(angle)[:, None]
    twice *= _lag(angle)[:, None]
    return shift_s[:, None] * (velocity_mps + once + twice)


@dataclass(frozen=True, slots=True)
class ConstantTwist:
    """Constant body velocity and rate through each row's pose: R(s) = R exp(S(w) s)."""

    attitude: Array  # (n, 3, 3)
    velocity_mps: Array  # (n, 3) body
    rate_radps: Array  # (n, 3) body

    def displacement(self, shift_s: Array) -> Array:
        body = screw_displacement(self.velocity_mps, self.rate_radps, shift_s)
        return rotate(self.attitude, body)

    def rotation(self, shift_s: Array) -> Array:
        turned: Array = self.attitude @ rotation_exp(self.rate_radps * shift_s[:, None])
        return turned


@dataclass(frozen=True, slots=True)
class ChainNoise:
    """One draw of a stage's sensor noise and timestamp errors; zeros mean none.

    position_m (n, 3) NED; attitude_rad (n, 3) roll, pitch, yaw; range_m, azimuth_rad,
    elevation_rad (n,); mu_*_s (n,): timestamp error of each sensor against true time.
    mu_position_s of a later stage is the timestamp error of the ranging sensor before it.
    """

    position_m: Array
    attitude_rad: Array
    range_m: Array
    azimuth_rad: Array
    elevation_rad: Array
    mu_position_s: Array
    mu_attitude_s: Array
    mu_ranging_s: Array


@dataclass(frozen=True, slots=True)
class SensorSigma:
    """One-sigma figures of a stage's sensors, zeros for one it does not have.

    position_m: north, east, down; attitude_rad: roll, pitch, yaw; ranging: range [m], azimuth
    [rad], elevation [rad], or row by row (n, 1, 3).
    """

    position_m: Sigma = (0.0, 0.0, 0.0)
    attitude_rad: Sigma = (0.0, 0.0, 0.0)
    ranging: Sigma | Array = (0.0, 0.0, 0.0)


def stage_error(
    rows: StageRows,
    motion: ChainMotion,
    noise: ChainNoise,
    departures: Departures = NOTHING,
    carried_m: Array | None = None,
) -> Array:
    """Georeferenced position minus the true (or surveyed) one [m], NED, (n, 3).

    estimate = antenna - R_hat l_G + R_hat (l_L + r_hat n_hat); error = estimate - (p + R (l_L + b))
    (model.md, the paper's eq. analytic_direct_georef with eq. meas_gnss, meas_ins, meas_lidar).
    Shifts are relative to the moment at which the ranging sensor measured.  `carried_m` (n, 3) is
    the error of the chain before, which the reading of a later stage's antenna inherits.
    """
    mu_ranging = noise.mu_ranging_s + departures.ranging_shift_s
    shift_p = noise.mu_position_s + departures.position_shift_s - mu_ranging
    shift_a = noise.mu_attitude_s + departures.attitude_shift_s - mu_ranging
    antenna_error = (
        motion.displacement(shift_p)
        + rotate(motion.rotation(shift_p), rows.antenna_m + departures.antenna_m)
        + noise.position_m * (1 + departures.position_noise[:, None])
        + departures.position_m
    )
    if carried_m is not None:
        antenna_error = antenna_error + carried_m
    r_hat = _measured_rotation(motion.rotation(shift_a), noise, departures)
    direction = bearing(rows.azimuth_rad, rows.elevation_rad)
    true_vector = rows.range_m[:, None] * direction
    believed = rows.ranging_m - rows.antenna_m
    believed = believed + _measured_vector(rows, noise, departures, direction)
    true = rotate(rows.rotation, rows.ranging_m + departures.ranging_m + true_vector)
    error: Array = antenna_error + rotate(r_hat, believed) - true - departures.target_m
    return error


def _measured_rotation(rotation: Array, noise: ChainNoise, departures: Departures) -> Array:
    """R_hat: the turned attitude sensor's Euler angles plus their noise."""
    if np.any(departures.attitude_rotation_rad):
        rotation = rotation @ rotation_exp(departures.attitude_rotation_rad)
    scatter = noise.attitude_rad * (1 + departures.attitude_noise[:, None])
    offset = scatter + departures.attitude_euler_rad
    if not np.any(offset):
        return rotation
    return euler_to_rotation(rotation_to_euler(rotation) + offset)


def noise_slopes(
    rows: StageRows,
    motion: ChainMotion,
    noise: ChainNoise,
    departures: Departures,
    sigma: SensorSigma,
) -> Array:
    """How each noise, at one standard deviation, moves the error [m], NED: (n, 3, 9).

    de/dz where `noise` holds timestamp errors alone; columns: position north, east, down; roll,
    pitch, yaw; range, azimuth, elevation.  With the measured rotation R of Euler angles
    (phi, theta, psi) and its lever q = l_L - l_G + r n:
    de/dphi = R (x cross q), de/dtheta = (Rz(psi) y) cross R q, de/dpsi = z cross R q,
    de/dr = R n, de/daz = r R dn/daz, de/del = r R dn/del; times sigma (1 + noise departure).
    """
    mu_ranging = noise.mu_ranging_s + departures.ranging_shift_s
    shift_a = noise.mu_attitude_s + departures.attitude_shift_s - mu_ranging
    r_hat = _measured_rotation(motion.rotation(shift_a), noise, departures)
    slopes = np.zeros((len(rows), 3, 9))
    slopes[:, :, :3] = np.diag(sigma.position_m)
    slopes[:, :, :3] *= _column(1 + departures.position_noise)
    direction = bearing(rows.azimuth_rad, rows.elevation_rad)
    lever = rows.ranging_m - rows.antenna_m
    lever = lever + _measured_vector(rows, noise, departures, direction)
    slopes[:, :, 3:6] = _euler_slopes(r_hat, lever) * np.asarray(sigma.attitude_rad)
    slopes[:, :, 3:6] *= _column(1 + departures.attitude_noise)
    slopes[:, :, 6:] = r_hat @ _polar_slopes(rows, noise, departures) * np.asarray(sigma.ranging)
    slopes[:, :, 6:7] *= _column(1 + departures.ranging_noise + departures.range_noise)
    slopes[:, :, 7:] *= _column(1 + departures.ranging_noise)
    return slopes


def _column(values: Array) -> Array:
    return values[:, None, None]


def _euler_slopes(rotation: Array, lever: Array) -> Array:
    """d(R q) by roll, pitch, yaw of R, (n, 3, 3): axes in NED times R q."""
    turned = rotate(rotation, lever)
    x, y, z = turned[:, 0], turned[:, 1], turned[:, 2]
    yaw = rotation_to_euler(rotation)[:, 2]
    sine, cosine = np.sin(yaw), np.cos(yaw)
    slopes = np.zeros((*turned.shape, 3))
    slopes[:, :, 0] = cross(rotation[:, :, 0], turned)
    # by pitch about (-sin psi, cos psi, 0), by yaw about (0, 0, 1)
    slopes[:, 0, 1], slopes[:, 1, 1], slopes[:, 2, 1] = cosine * z, sine * z, -sine * y - cosine * x
    slopes[:, 0, 2], slopes[:, 1, 2] = -y, x
    return slopes


def _polar_slopes(rows: StageRows, noise: ChainNoise, departures: Departures) -> Array:
    """d(r n) by range, azimuth, elevation as measured, body axes, (n, 3, 3)."""
    distance, azimuth, elevation = _measured_polar(rows, noise, departures)
    cos_el = np.cos(elevation)
    zero = np.zeros_like(azimuth)
    east = np.stack([-np.sin(azimuth) * cos_el, np.cos(azimuth) * cos_el, zero], axis=-1)
    up = np.stack(
        [-np.cos(azimuth) * np.sin(elevation), -np.sin(azimuth) * np.sin(elevation), -cos_el],
        axis=-1,
    )
    far = distance[:, None]
    return np.stack([bearing(azimuth, elevation), far * east, far * up], axis=-1)


def _measured_vector(
    rows: StageRows, noise: ChainNoise, departures: Departures, direction: Array
) -> Array:
    """r_hat n_hat [m] in the axes the spec believes, (n, 3); direction: n as it is."""
    distance, azimuth, elevation = _measured_polar(rows, noise, departures)
    same = np.array_equal(azimuth, rows.azimuth_rad)
    if not (same and np.array_equal(elevation, rows.elevation_rad)):
        direction = bearing(azimuth, elevation)
    return distance[:, None] * direction


def _measured_polar(
    rows: StageRows, noise: ChainNoise, departures: Departures
) -> tuple[Array, Array, Array]:
    """Range [m], azimuth and elevation [rad] as measured, (n,) each."""
    azimuth, elevation = rows.azimuth_rad, rows.elevation_rad
    if np.any(departures.bearing_rotation_rad):
        turned = rotate(
            np.broadcast_to(rotation_exp(-departures.bearing_rotation_rad), (len(rows), 3, 3)),
            bearing(azimuth, elevation),
        )
        azimuth = np.arctan2(turned[:, 1], turned[:, 0])
        elevation = -np.arcsin(np.clip(turned[:, 2], -1.0, 1.0))
    scatter = 1 + departures.ranging_noise
    distance = (
        rows.range_m * (1 + departures.range_scale)
        + departures.range_m
        + noise.range_m * (scatter + departures.range_noise)
    )
    return (
        distance,
        azimuth + noise.azimuth_rad * scatter + departures.azimuth_rad,
        elevation + noise.elevation_rad * scatter + departures.elevation_rad,
    )
