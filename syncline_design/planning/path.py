"""Commands to motion: where a vehicle is, how it is turned and how it moves, at every step.

A course is speed ahead, sideways and down, and turn rate, on a grid of STEP_S.  Corners are rounded
(Gaussian), headings and places are integrals, attitudes follow from the accelerations by the kind
of motion: a multirotor leans by atan(a / g), an aeroplane banks by atan(v turn / g), a ship is
moved by the sea, the others stay as level as their path.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields

import numpy as np

from syncline_design.effects.kinematics import euler_to_rotation, rotate
from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import to_digits
from syncline_design.planning.vehicle import GRAVITY_MPS2, SEA_RATE_SHARE, SEA_TILT, Vehicle

STEP_S = 0.05
SEA_HZ = (0.09, 0.13, 0.16, 0.21)  # swell and wind sea
ROLL_SHARE, PITCH_SHARE = 1.0, 0.5  # of the sea's tilt
ROAD_RAD = 0.006  # how far a road or a current tilts a vehicle, rms
SEA_HEAVE_M = 0.15
PHASES = (0.3, 2.1, 4.4, 5.6)


@dataclass(frozen=True, slots=True)
class CourseCommands:
    """Commands at every step: speeds ahead, to the right and down [m/s], turn rate [rad/s]."""

    ahead: Array
    right: Array
    down: Array
    turn: Array

    def __len__(self) -> int:
        return int(self.ahead.shape[0])

    @property
    def duration_s(self) -> float:
        return len(self) * STEP_S


def joined(courses: Sequence[CourseCommands]) -> CourseCommands:
    """One course after the other."""
    return CourseCommands(
        **{
            f.name: np.concatenate([getattr(c, f.name) for c in courses])
            for f in fields(CourseCommands)
        }
    )


@dataclass(frozen=True, slots=True)
class PathStates:
    """Motion at moments time_s (n,): place [m] NED, velocity and acceleration NED, attitude
    (roll, pitch, yaw) [rad], body rates [rad/s], (n, 3) each."""

    time_s: Array
    position_m: Array
    velocity_mps: Array
    acceleration_mps2: Array
    euler_rad: Array
    rate_radps: Array

    @property
    def rotation(self) -> Array:
        return euler_to_rotation(self.euler_rad)

    def at(self, time_s: Array) -> PathStates:
        """The motion at other moments, between the steps by cubic splines."""
        from scipy.interpolate import CubicSpline

        values = np.hstack([getattr(self, f.name).reshape(len(self.time_s), -1)
                            for f in fields(PathStates)[1:]])  # fmt: skip
        found = CubicSpline(self.time_s, values)(time_s)
        return PathStates(time_s, *np.split(found, 5, axis=1))


def rounded(vehicle: Vehicle, command: Array) -> Array:
    """What becomes of a command: no vehicle changes its speed or its turn at once."""
    from scipy.ndimage import gaussian_filter1d

    return np.asarray(gaussian_filter1d(command, vehicle.rounding_s / STEP_S, mode="nearest"))


def travelled(
    vehicle: Vehicle, course: CourseCommands, heading_rad: float = 0.0, start_s: float = 0.0
) -> PathStates:
    """The motion that a course makes, from the origin; start_s: since when the sea moves."""
    time_s = start_s + STEP_S * np.arange(len(course), dtype=np.float64)
    ahead, right, down, turn = (
        rounded(vehicle, v) for v in (course.ahead, course.right, course.down, course.turn)
    )
    yaw = heading_rad + _integral(turn)
    velocity = np.stack(
        [
            ahead * np.cos(yaw) - right * np.sin(yaw),
            ahead * np.sin(yaw) + right * np.cos(yaw),
            down,
        ],
        axis=1,
    )
    roll, pitch, heave = _tilts(vehicle, time_s, ahead, right, down, turn)
    velocity[:, 2] += np.gradient(heave, STEP_S)
    euler = np.stack([roll, pitch, yaw], axis=1)
    acceleration: Array = np.gradient(velocity, STEP_S, axis=0)
    place = np.stack([_integral(velocity[:, k]) for k in range(3)], axis=1)
    return PathStates(time_s, place, velocity, acceleration, euler, _body_rates(euler))


def _integral(rate: Array) -> Array:
    """Running trapezoidal integral over the steps."""
    total = np.zeros_like(rate)
    total[1:] = np.cumsum(0.5 * (rate[1:] + rate[:-1])) * STEP_S
    return total


def _tilts(
    vehicle: Vehicle, time_s: Array, ahead: Array, right: Array, down: Array, turn: Array
) -> tuple[Array, Array, Array]:
    """Roll and pitch [rad] that go with the motion, and heave [m]."""
    forward = np.gradient(ahead, STEP_S) - right * turn
    sideways = np.gradient(right, STEP_S) + ahead * turn
    zero = np.zeros_like(ahead)
    slope = np.arctan2(-down, np.maximum(np.abs(ahead), 0.1 * vehicle.v_max_mps))
    match vehicle.motion:
        case "multirotor":
            return np.arctan(sideways / GRAVITY_MPS2), -np.arctan(forward / GRAVITY_MPS2), zero
        case "fixed_wing":
            return np.arctan(sideways / GRAVITY_MPS2), slope, zero
        case "surface":
            return (zero, zero, zero) if vehicle.calm else _sea(vehicle, time_s)
        case "ground":
            roll, pitch = _uneven(time_s)
            return roll - 0.01 * sideways, pitch + 0.01 * forward, zero
        case "underwater":
            roll, pitch = _uneven(time_s)
            return roll, pitch + slope, zero
        case _:
            return zero, zero, zero


def _sea(vehicle: Vehicle, time_s: Array) -> tuple[Array, Array, Array]:
    """Roll, pitch and heave in a sea that tilts the ship by the horizon's tilt at most.

    The largest is taken for three standard deviations; the turn rate stays a small part of
    omega_max.
    """
    std = sea_tilt_rad(vehicle.tilt_rad, vehicle.omega_max_radps)
    roll = ROLL_SHARE * std * _swell(time_s, 1.0)
    pitch = PITCH_SHARE * std * _swell(time_s, 1.13)
    return roll, pitch, SEA_HEAVE_M * _swell(time_s, 0.91)


def sea_tilt_rad(tilt_rad: float, omega_max_radps: float) -> float:
    """Standard deviation of the sea's tilt."""
    rate = 2.0 * np.pi * float(np.sqrt(np.mean(np.square(SEA_HZ))))
    return min(tilt_rad / SEA_TILT, SEA_RATE_SHARE * omega_max_radps / rate)


def unasked(vehicle: Vehicle) -> str | None:
    """What moves a vehicle besides its commands, in words: the drive counts on it."""
    match vehicle.motion:
        case "surface":
            tilt = sea_tilt_rad(vehicle.tilt_rad, vehicle.omega_max_radps)
            roll, pitch = (f"{to_digits(np.degrees(share * tilt), 2)} deg"
                           for share in (ROLL_SHARE, PITCH_SHARE))  # fmt: skip
            return (
                f"waves that roll it by {roll}, pitch it by {pitch} and heave it by "
                f"{to_digits(100.0 * SEA_HEAVE_M, 2)} cm (standard deviations); in calm water the "
                "drive tells less"
            )
        case "ground" | "underwater":
            moved = "a road" if vehicle.motion == "ground" else "currents"
            size = to_digits(np.degrees(ROAD_RAD), 2)
            verb = "rolls and pitches" if vehicle.motion == "ground" else "roll and pitch"
            return f"{moved} that {verb} it by {size} deg (standard deviation)"
        case _:
            return None


def _uneven(time_s: Array) -> tuple[Array, Array]:
    return ROAD_RAD * _swell(time_s, 0.83), ROAD_RAD * _swell(time_s, 1.21)


def _swell(time_s: Array, pace: float) -> Array:
    """A sum of sines of unit variance, the same every time."""
    waves = [
        np.sin(2.0 * np.pi * pace * hz * time_s + pace * 3.0 + phase)
        for hz, phase in zip(SEA_HZ, PHASES, strict=True)
    ]
    return np.asarray(np.sqrt(2.0 / len(waves)) * np.sum(waves, axis=0))


def _body_rates(euler: Array) -> Array:
    """Turn rate in the body of (roll, pitch, yaw) and their slopes by time."""
    (roll, pitch, _), slopes = euler.T, np.gradient(euler, STEP_S, axis=0)
    d_roll, d_pitch, d_yaw = slopes.T
    return np.stack(
        [
            d_roll - d_yaw * np.sin(pitch),
            d_pitch * np.cos(roll) + d_yaw * np.cos(pitch) * np.sin(roll),
            -d_pitch * np.sin(roll) + d_yaw * np.cos(pitch) * np.cos(roll),
        ],
        axis=1,
    )


def point_of(states: PathStates, arm_m: Array) -> Array:
    """Where a point fixed in the body is [m], NED, (n, 3)."""
    return states.position_m + rotate(states.rotation, arm_m)
