"""What the sensors of a stage read, free of noise: the truth at the moment each really measured."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from tests.world.physics import Faults
from tests.world.scenarios import Carrier, Scenario
from tests.world.trajectory import GRAVITY_MPS2, Array, Path


@dataclass(frozen=True)
class Reading:
    """Readings of one stage, one row per stamp.  Parts a stage does not have are None."""

    antenna_m: Array | None  # (n, 3) NED
    euler_rad: Array  # (n, 3) yaw, pitch, roll
    polar: Array | None  # (n, 3) range [m], azimuth [rad], elevation [rad]


def antenna_track(path: Path, arm_m: Array, time_s: Array) -> Array:
    """Where a point fixed in the body at `arm_m` truly was (n, 3)."""
    return np.asarray(path.position(time_s) + path.rotation(time_s).apply(arm_m))


def lagged_track(path: Path, arm_m: Array, time_s: Array, lag_s: float, step_s: float) -> Array:
    """The antenna's track through a first-order low pass, run from 20 time constants before.

    The output y obeys lag dy/dt = x - y; between grid points x is taken as a straight line, for
    which the step is exact.
    """
    start = time_s[0] - 20.0 * lag_s
    count = int(np.ceil((time_s[-1] - start) / step_s)) + 2
    grid = start + np.arange(count) * step_s
    inside = antenna_track(path, arm_m, grid)
    decay = np.exp(-step_s / lag_s)
    slope = np.diff(inside, axis=0) / step_s
    drive = inside[1:] - lag_s * slope - decay * (inside[:-1] - lag_s * slope)
    output = lfilter([1.0], [1.0, -decay], np.vstack([inside[:1], drive]), axis=0)
    lag = output - inside
    smooth = np.column_stack([np.interp(time_s, grid, lag[:, axis]) for axis in range(3)])
    return np.asarray(antenna_track(path, arm_m, time_s) + smooth)


def read_position(carrier: Carrier, faults: Faults, stamps_s: Array) -> Array:
    """The position sensor's output (n, 3)."""
    when = stamps_s - faults.age_of("position", stamps_s)
    arm = np.array(carrier.sensors.antenna_arm_m) + faults.antenna_moved_m
    if faults.lag_s > 0.0:
        order = np.argsort(when)
        step = min(max(faults.lag_s / 10.0, 0.002), 0.01)
        place = np.empty((when.size, 3))
        place[order] = lagged_track(carrier.path, arm, when[order], faults.lag_s, step)
    else:
        place = antenna_track(carrier.path, arm, when)
    if faults.heave_sensor_moved_m.any():
        # heave is read where the sensor sits, relative to its own level at rest
        turned = carrier.path.rotation(when).apply(faults.heave_sensor_moved_m)
        place[:, 2] += turned[:, 2] - faults.heave_sensor_moved_m[2]
    speed = np.linalg.norm(carrier.path.velocity(when), axis=1)
    for lost in faults.height_lost:
        place[:, 2] += lost(stamps_s, speed)
    return np.asarray(place)


def _position_convention(place: Array, convention: str | None) -> Array:
    if convention is None:
        return place
    if convention == "enu":  # the columns hold east, north, up
        return np.column_stack([place[:, 1], place[:, 0], -place[:, 2]])
    if convention == "up":  # the third column holds up
        return np.asarray(place * np.array([1.0, 1.0, -1.0]))
    raise KeyError(convention)


def read_attitude(carrier: Carrier, faults: Faults, stamps_s: Array) -> Array:
    """The attitude sensor's yaw, pitch, roll [rad] (n, 3)."""
    when = stamps_s - faults.age_of("attitude", stamps_s)
    true = carrier.path.rotation(when)
    if faults.pendulum_gain != 0.0:
        true = _leaning(true, carrier.path.acceleration(when), faults.pendulum_gain)
    euler = (true * faults.attitude_turned).as_euler("ZYX")
    yaw = carrier.path.euler(when)[:, 0]
    for added in faults.yaw_added:
        euler[:, 0] += added(stamps_s, yaw)
    return np.asarray(euler)


def _leaning(true: Rotation, acceleration: Array, gain: float) -> Rotation:
    """Attitude whose vertical leans by `gain` towards the line a pendulum hangs along.

    A pendulum hangs along gravity minus acceleration; the sensor takes the direction in between
    for the vertical, so what it reports is the truth turned by the turn that brings that
    direction onto the vertical.
    """
    hanging = np.array([0.0, 0.0, GRAVITY_MPS2]) - gain * acceleration
    hanging /= np.linalg.norm(hanging, axis=1, keepdims=True)
    axis = np.cross(hanging, [0.0, 0.0, 1.0])
    sine = np.linalg.norm(axis, axis=1, keepdims=True)
    angle = np.arctan2(sine, hanging[:, 2:])
    scale = np.where(sine > 0.0, angle / np.where(sine > 0.0, sine, 1.0), 0.0)
    lean: Rotation = Rotation.from_rotvec(axis * scale) * true
    return lean


def _attitude_convention(euler: Array, convention: str | None) -> Array:
    if convention is None:
        return euler
    yaw, pitch, roll = euler.T
    if convention == "yaw_sign":
        return np.column_stack([-yaw, pitch, roll])
    if convention == "yaw_180":
        return np.column_stack([np.angle(-np.exp(1j * yaw)), pitch, roll])
    if convention == "transposed":
        return np.asarray(Rotation.from_euler("ZYX", euler).inv().as_euler("ZYX"))
    if convention == "radians":  # radians written where degrees are due
        return euler * np.pi / 180.0
    if convention == "enu":  # yaw counted from east to north, pitch up negative
        return np.column_stack([np.angle(np.exp(1j * (np.pi / 2 - yaw))), -pitch, roll])
    raise KeyError(convention)


def read_ranging(carrier: Carrier, faults: Faults, stamps_s: Array, points_m: Array) -> Array:
    """Range, azimuth and elevation (n, 3) of points, sighted from where the sensor truly was."""
    when = stamps_s - faults.age_of("ranging", stamps_s)
    if faults.scan_period_s == 0.0:
        return _sight(carrier, faults, stamps_s, when, points_m)
    moment = when
    for _ in range(6):  # the beam passes a bearing at its own moment of the scan
        azimuth = _sight(carrier, faults, stamps_s, moment, points_m)[:, 1]
        moment = when + faults.scan_period_s * azimuth / (2.0 * np.pi)
    return _sight(carrier, faults, stamps_s, moment, points_m)


def _sight(
    carrier: Carrier, faults: Faults, stamps_s: Array, when: Array, points_m: Array
) -> Array:
    turn = carrier.path.rotation(when)
    arm = np.array(carrier.sensors.ranging_arm_m) + faults.ranging_moved_m
    felt = carrier.path.acceleration(when) - [0.0, 0.0, GRAVITY_MPS2]  # by an accelerometer
    bend = faults.ranging_bends * turn.inv().apply(felt)
    eye = carrier.path.position(when) + turn.apply(arm + bend)
    seen = (turn * faults.ranging_turned).inv().apply(points_m - eye)
    reach = np.linalg.norm(seen, axis=1)
    if faults.sound_used != 1.0:
        seen = reach[:, None] * _by_phase(seen / reach[:, None], faults.sound_used)
    azimuth = np.arctan2(seen[:, 1], seen[:, 0]) + faults.azimuth_bias_rad
    elevation = np.arcsin(-seen[:, 2] / reach) + faults.elevation_bias_rad
    added = sum((add(stamps_s, reach) for add in faults.range_added), np.zeros_like(reach))
    return np.column_stack([reach + added, azimuth, elevation])


def _by_phase(pointing: Array, sound_used: float) -> Array:
    """The direction that a flat array in its x-y plane makes of the sound of a far point.

    Two elements 10 cm apart along x and two along y hear it one after the other by the path's
    difference over the water's sound speed; the processing multiplies by its own.
    """
    apart, speed = 0.1, 1500.0
    delays = apart * pointing[:, :2] / speed
    level = delays * speed * sound_used / apart
    rest = np.sqrt(np.maximum(1.0 - np.sum(level**2, axis=1), 0.0))
    return np.column_stack([level, np.copysign(rest, pointing[:, 2])])


def _ranging_convention(polar: Array, convention: str | None) -> Array:
    if convention is None:
        return polar
    if convention == "azimuth_sign":
        return np.asarray(polar * np.array([1.0, -1.0, 1.0]))
    if convention == "elevation_sign":
        return np.asarray(polar * np.array([1.0, 1.0, -1.0]))
    if convention == "radians":
        return np.asarray(polar * np.array([1.0, np.pi / 180.0, np.pi / 180.0]))
    raise KeyError(convention)


def read_all(run: Scenario, faults: tuple[Faults, ...]) -> tuple[Reading, ...]:
    """Noise-free readings of every stage; a stage's ranging sights the next one's transponder."""
    readings = []
    for index, (carrier, fault) in enumerate(zip(run.carriers, faults, strict=True)):
        antenna = None
        if carrier.sensors.position_m is not None:
            antenna = read_position(carrier, fault, run.stamps_s)
        polar = None
        if carrier.sensors.ranging is not None:
            points = _sighted_points(run, faults, index)
            polar = read_ranging(carrier, fault, run.stamps_s, points)
        readings.append(Reading(antenna, read_attitude(carrier, fault, run.stamps_s), polar))
    return tuple(readings)


def as_written(reading: Reading, faults: Faults) -> Reading:
    """The readings as the log's columns hold them, in whatever convention that is."""
    antenna, polar = reading.antenna_m, reading.polar
    if antenna is not None:
        antenna = _position_convention(antenna, faults.convention.get("position"))
    if polar is not None:
        polar = _ranging_convention(polar, faults.convention.get("ranging"))
    euler = _attitude_convention(reading.euler_rad, faults.convention.get("attitude"))
    return Reading(antenna, euler, polar)


def _sighted_points(run: Scenario, faults: tuple[Faults, ...], index: int) -> Array:
    if index + 1 == len(run.carriers):
        return run.targets_m[run.sighted]
    carrier = run.carriers[index + 1]
    when = run.stamps_s - faults[index].age_of("ranging", run.stamps_s)
    arm = np.array(carrier.sensors.antenna_arm_m) + faults[index + 1].antenna_moved_m
    return antenna_track(carrier.path, arm, when)


def listed_truth(run: Scenario, fault: Faults) -> Array:
    """What the log gives as truth (n, 3): surveyed targets, or the better system's position."""
    if run.kind == "position":
        points = run.carriers[-1].path.position(run.stamps_s)
    else:
        points = run.targets_m[run.sighted]
    for listed in fault.target_listed:
        points = listed(points)
    return points
