"""True motion of a vehicle: smooth splines of position and attitude, asked at any time.

Frames: north-east-down (NED); body forward-right-down; attitude yaw-pitch-roll.  Everything here
is made with scipy's splines and rotations only.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline, make_interp_spline
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]
GRAVITY_MPS2 = 9.80665
GRID_S = 0.05
KNOT_S = 0.2
MARGIN_S = 40.0  # the truth exists this long before the first and after the last stamp


@dataclass(frozen=True)
class Path:
    """Where a vehicle's reference point truly was and how it was truly turned."""

    place: BSpline
    angles: BSpline  # yaw, pitch, roll [rad], yaw unwrapped

    def position(self, time_s: Array) -> Array:
        return np.asarray(self.place(time_s))

    def velocity(self, time_s: Array) -> Array:
        return np.asarray(self.place(time_s, 1))

    def acceleration(self, time_s: Array) -> Array:
        return np.asarray(self.place(time_s, 2))

    def euler(self, time_s: Array) -> Array:
        return np.asarray(self.angles(time_s))

    def rotation(self, time_s: Array) -> Rotation:
        return Rotation.from_euler("ZYX", self.angles(time_s))

    def body_rate(self, time_s: Array, half_s: float = 1e-4) -> Array:
        """Angular rate in body axes [rad/s], from the turn between two instants."""
        before, after = self.rotation(time_s - half_s), self.rotation(time_s + half_s)
        return np.asarray((before.inv() * after).as_rotvec() / (2.0 * half_s))


@dataclass(frozen=True)
class Leg:
    """A piece of a manoeuvre: forward speed, rate of turn and crab (course minus heading)."""

    duration_s: float
    speed_mps: float
    turn_radps: float = 0.0
    crab_rad: float = 0.0


def grid(duration_s: float) -> Array:
    """Instants of the construction grid, the margin before and after included."""
    count = int(np.ceil((duration_s + 2.0 * MARGIN_S) / GRID_S)) + 1
    return np.arange(count, dtype=np.float64) * GRID_S - MARGIN_S


def profile(legs: Sequence[Leg], time_s: Array, smooth_s: float) -> tuple[Array, Array, Array]:
    """Speed, turn rate and crab over the grid; corners are rounded over `smooth_s`."""
    ends = np.cumsum([leg.duration_s for leg in legs]) + time_s[0]
    which = np.minimum(np.searchsorted(ends, time_s, side="right"), len(legs) - 1)
    table = np.array([(leg.speed_mps, leg.turn_radps, leg.crab_rad) for leg in legs])[which]
    rounded = gaussian_filter1d(table, smooth_s / GRID_S, axis=0, mode="nearest")
    return rounded[:, 0], rounded[:, 1], rounded[:, 2]


def accumulate(rate: Array) -> Array:
    """Running trapezoidal integral over the grid, zero at the first instant."""
    total = np.zeros_like(rate)
    total[1:] = np.cumsum(0.5 * (rate[1:] + rate[:-1]), axis=0) * GRID_S
    return total


def waves(
    rng: np.random.Generator, time_s: Array, rms: float, band_hz: tuple[float, float]
) -> Array:
    """Sum of eight sines of random phase and frequency within a band, with the given rms."""
    frequency = rng.uniform(*band_hz, 8)
    phase = rng.uniform(0.0, 2.0 * np.pi, 8)
    size = rng.uniform(0.5, 1.5, 8)
    size *= rms * np.sqrt(2.0 / np.sum(size**2))
    angle = 2.0 * np.pi * np.outer(time_s, frequency) + phase
    return np.asarray(np.sin(angle) @ size)


def fit(time_s: Array, place: Array, angles: Array) -> Path:
    """Quintic splines through every knot of the construction grid."""
    step = round(KNOT_S / GRID_S)
    knots = time_s[::step]
    return Path(
        make_interp_spline(knots, place[::step], k=5),
        make_interp_spline(knots, angles[::step], k=5),
    )


def level_course(
    speed: Array, turn: Array, crab: Array, heading_rad: float
) -> tuple[Array, Array, Array]:
    """Heading, horizontal velocity and horizontal place of a vehicle that follows a profile."""
    heading = heading_rad + accumulate(turn)
    course = heading + crab
    velocity = np.stack([speed * np.cos(course), speed * np.sin(course)], axis=1)
    return heading, velocity, accumulate(velocity)


def body_acceleration(velocity: Array, heading: Array) -> tuple[Array, Array]:
    """Forward and rightward horizontal acceleration over the grid."""
    north, east = np.gradient(velocity, GRID_S, axis=0).T
    forward = north * np.cos(heading) + east * np.sin(heading)
    right = -north * np.sin(heading) + east * np.cos(heading)
    return forward, right
