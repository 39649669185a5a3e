"""Vehicles and their manoeuvres: seeded true motions of varied character."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import gaussian_filter1d

from tests.world.trajectory import (
    GRAVITY_MPS2,
    GRID_S,
    MARGIN_S,
    Leg,
    Path,
    body_acceleration,
    fit,
    grid,
    level_course,
    profile,
    waves,
)

DEGREE = np.pi / 180.0
Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Sensors:
    """What the spec knows of a stage's sensors: standard deviations and arms, SI."""

    position_m: Vector | None = (0.012, 0.012, 0.02)
    attitude_rad: Vector | None = (0.03 * DEGREE, 0.03 * DEGREE, 0.06 * DEGREE)
    ranging: Vector | None = (0.02, 0.02 * DEGREE, 0.02 * DEGREE)  # m, rad, rad
    antenna_arm_m: Vector = (0.25, -0.1, -0.4)  # on a later stage: the transponder's arm
    ranging_arm_m: Vector = (0.15, 0.05, 0.2)
    ranging_type: str = "lidar"


@dataclass(frozen=True)
class Motion:
    """A vehicle's true motion and where its targets are."""

    path: Path
    offsets_m: tuple[float, float]  # horizontal distance of targets, nearest and farthest
    levels_m: tuple[float, float]  # targets' down coordinate
    sensors: Sensors
    limits: tuple[float, float, float]  # v_max, omega_max, distance of the spec's platform


def _fill(rng: np.random.Generator, span_s: float, block: Callable[[], list[Leg]]) -> list[Leg]:
    legs: list[Leg] = []
    while sum(leg.duration_s for leg in legs) < span_s:
        legs.extend(block())
    return legs


def _multirotor(rng: np.random.Generator, duration_s: float) -> Motion:
    """Survey lines of varied speed, turns on the spot both ways, some legs flown sideways."""

    def block() -> list[Leg]:
        turn = rng.uniform(20.0, 45.0) * DEGREE * rng.choice([-1.0, 1.0])
        angle = rng.choice([0.5, 1.0]) * np.pi
        crab = rng.choice([0.0, 0.0, 0.0, 0.5, -0.5, 1.0]) * np.pi
        line = Leg(rng.uniform(7.0, 14.0), rng.uniform(2.0, 9.0), 0.0, crab)
        slow = Leg(abs(angle / turn), rng.uniform(0.2, 1.5), turn, crab)
        return [line, slow, Leg(rng.uniform(1.0, 3.0), 0.3)]

    time_s = grid(duration_s)
    legs = _fill(rng, time_s[-1] - time_s[0], block)
    speed, turn, crab = profile(legs, time_s, 1.4)
    heading, velocity, place = level_course(speed, turn, crab, rng.uniform(-np.pi, np.pi))
    forward, right = body_acceleration(velocity, heading)
    down = -32.0 + waves(rng, time_s, 1.5, (0.01, 0.08))
    pitch = -forward / GRAVITY_MPS2 + waves(rng, time_s, 1.2 * DEGREE, (0.2, 0.9))
    roll = right / GRAVITY_MPS2 + waves(rng, time_s, 1.2 * DEGREE, (0.2, 0.9))
    yaw = heading + waves(rng, time_s, 0.8 * DEGREE, (0.1, 0.6))
    path = fit(time_s, np.column_stack([place, down]), np.column_stack([yaw, pitch, roll]))
    return Motion(path, (8.0, 35.0), (-3.0, 2.0), Sensors(), (9.0, 50.0 * DEGREE, 40.0))


def _fixed_wing(rng: np.random.Generator, duration_s: float) -> Motion:
    """Circuits with banked turns both ways, a cross wind and slowly varied speed."""

    def block() -> list[Leg]:
        bank = rng.uniform(18.0, 32.0) * DEGREE * rng.choice([-1.0, 1.0])
        speed = rng.uniform(17.0, 26.0)
        rate = GRAVITY_MPS2 * np.tan(bank) / speed
        angle = rng.uniform(0.5, 1.2) * np.pi
        crab = rng.uniform(-6.0, 6.0) * DEGREE
        return [
            Leg(rng.uniform(6.0, 14.0), rng.uniform(17.0, 26.0), 0.0, crab),
            Leg(abs(angle / rate), speed, rate, crab),
        ]

    time_s = grid(duration_s)
    legs = _fill(rng, time_s[-1] - time_s[0], block)
    speed, turn, crab = profile(legs, time_s, 1.2)
    heading, _velocity, place = level_course(speed, turn, crab, rng.uniform(-np.pi, np.pi))
    down = -80.0 + waves(rng, time_s, 4.0, (0.01, 0.04))
    roll = np.arctan(speed * turn / GRAVITY_MPS2) + waves(rng, time_s, 1.0 * DEGREE, (0.1, 0.6))
    pitch = 3.0 * DEGREE + waves(rng, time_s, 1.2 * DEGREE, (0.1, 0.5))
    yaw = heading + waves(rng, time_s, 0.5 * DEGREE, (0.1, 0.4))
    path = fit(time_s, np.column_stack([place, down]), np.column_stack([yaw, pitch, roll]))
    sensors = Sensors(
        position_m=(0.015, 0.015, 0.03),
        attitude_rad=(0.015 * DEGREE, 0.015 * DEGREE, 0.04 * DEGREE),
        ranging=(0.015, 0.01 * DEGREE, 0.01 * DEGREE),
        antenna_arm_m=(0.3, 0.0, -0.25),
        ranging_arm_m=(0.1, 0.0, 0.15),
    )
    return Motion(path, (20.0, 70.0), (-4.0, 4.0), sensors, (26.0, 40.0 * DEGREE, 100.0))


def _car(rng: np.random.Generator, duration_s: float) -> Motion:
    """Town driving: stops, bends both ways, now and then in reverse."""

    def block() -> list[Leg]:
        speed = rng.uniform(4.0, 17.0)
        slow = rng.uniform(2.0, 5.0)
        turn = rng.uniform(12.0, 28.0) * DEGREE * rng.choice([-1.0, 1.0])
        angle = rng.uniform(0.3, 0.6) * np.pi
        last = Leg(rng.uniform(2.0, 5.0), rng.choice([0.0, 0.0, -1.5]))
        return [Leg(rng.uniform(5.0, 12.0), speed), Leg(abs(angle / turn), slow, turn), last]

    time_s = grid(duration_s)
    legs = _fill(rng, time_s[-1] - time_s[0], block)
    speed, turn, crab = profile(legs, time_s, 0.9)
    heading, velocity, place = level_course(speed, turn, crab, rng.uniform(-np.pi, np.pi))
    forward, right = body_acceleration(velocity, heading)
    down = waves(rng, time_s, 0.5, (0.01, 0.05))
    pitch = 0.01 * forward + waves(rng, time_s, 1.2 * DEGREE, (0.05, 0.8))
    roll = -0.012 * right + waves(rng, time_s, 1.2 * DEGREE, (0.05, 0.8))
    path = fit(time_s, np.column_stack([place, down]), np.column_stack([heading, pitch, roll]))
    sensors = Sensors(antenna_arm_m=(-0.4, 0.3, -1.1), ranging_arm_m=(0.6, 0.0, -1.2))
    return Motion(path, (8.0, 40.0), (-6.0, 0.5), sensors, (18.0, 40.0 * DEGREE, 30.0))


def _vessel(rng: np.random.Generator, duration_s: float) -> Motion:
    """A boat in waves: lines and figure eights at varied speed, sounding the bottom."""

    def block() -> list[Leg]:
        turn = rng.uniform(5.0, 11.0) * DEGREE * rng.choice([-1.0, 1.0])
        speed = rng.uniform(0.8, 4.5)
        loop = Leg(2.0 * np.pi / abs(turn), speed, turn)
        back = replace(loop, turn_radps=-turn)
        line = Leg(rng.uniform(8.0, 25.0), rng.uniform(0.5, 4.5))
        return [loop, back, line] if rng.random() < 0.4 else [replace(loop, duration_s=15.0), line]

    time_s = grid(duration_s)
    legs = _fill(rng, time_s[-1] - time_s[0], block)
    speed, turn, crab = profile(legs, time_s, 2.0)
    heading, _velocity, place = level_course(speed, turn, crab, rng.uniform(-np.pi, np.pi))
    down = waves(rng, time_s, 0.25, (0.08, 0.2))
    roll = waves(rng, time_s, 4.0 * DEGREE, (0.1, 0.22))
    pitch = waves(rng, time_s, 2.0 * DEGREE, (0.1, 0.25))
    yaw = heading + waves(rng, time_s, 1.0 * DEGREE, (0.05, 0.15))
    path = fit(time_s, np.column_stack([place, down]), np.column_stack([yaw, pitch, roll]))
    sensors = Sensors(
        position_m=(0.015, 0.015, 0.025),
        attitude_rad=(0.02 * DEGREE, 0.02 * DEGREE, 0.05 * DEGREE),
        ranging=(0.03, 0.05 * DEGREE, 0.05 * DEGREE),
        antenna_arm_m=(-1.5, 0.6, -3.5),
        ranging_arm_m=(1.0, 0.0, 1.2),
        ranging_type="mbes",
    )
    return Motion(path, (6.0, 45.0), (25.0, 32.0), sensors, (4.5, 15.0 * DEGREE, 40.0))


def _steady(legs: list[Leg], rng: np.random.Generator, duration_s: float) -> Motion:
    """Constant forward speed along given legs, small motions of the attitude only."""
    time_s = grid(duration_s)
    speed, turn, crab = profile(legs, time_s, 1.0)
    heading, _velocity, place = level_course(speed, turn, crab, rng.uniform(-np.pi, np.pi))
    down = np.full_like(time_s, -30.0)
    roll, pitch = (waves(rng, time_s, 0.15 * DEGREE, (0.1, 0.4)) for _ in range(2))
    path = fit(time_s, np.column_stack([place, down]), np.column_stack([heading, pitch, roll]))
    sensors = Sensors(antenna_arm_m=(0.0, 0.0, -0.4))
    return Motion(path, (8.0, 35.0), (-3.0, 2.0), sensors, (11.0, 70.0 * DEGREE, 40.0))


def _straight(rng: np.random.Generator, duration_s: float) -> Motion:
    """One straight line at one speed."""
    return _steady([Leg(duration_s + 2 * MARGIN_S + 1.0, 8.0)], rng, duration_s)


def _reciprocal(rng: np.random.Generator, duration_s: float) -> Motion:
    """Reciprocal lines with half turns, forward speed never changed."""

    def block() -> list[Leg]:
        turn = 20.0 * DEGREE
        return [Leg(20.0, 8.0), Leg(9.0, 8.0, turn), Leg(20.0, 8.0), Leg(9.0, 8.0, -turn)]

    return _steady(_fill(rng, duration_s + 2 * MARGIN_S, block), rng, duration_s)


def _eights(rng: np.random.Generator, duration_s: float) -> Motion:
    """Figure eights, forward speed never changed."""

    def block() -> list[Leg]:
        return [Leg(24.0, 8.0, 15.0 * DEGREE), Leg(24.0, 8.0, -15.0 * DEGREE)]

    return _steady(_fill(rng, duration_s + 2 * MARGIN_S, block), rng, duration_s)


def survey_chain(rng: np.random.Generator, duration_s: float) -> tuple[Motion, Motion]:
    """An underwater vehicle on lines, and the vessel that follows it in waves."""

    def block() -> list[Leg]:
        turn = rng.uniform(5.0, 9.0) * DEGREE * rng.choice([-1.0, 1.0])
        line = Leg(rng.uniform(10.0, 30.0), rng.uniform(0.6, 2.2))
        return [line, Leg(np.pi / abs(turn), rng.uniform(0.8, 1.5), turn)]

    time_s = grid(duration_s)
    speed, turn, crab = profile(_fill(rng, time_s[-1] - time_s[0], block), time_s, 2.0)
    heading, _velocity, place = level_course(speed, turn, crab, rng.uniform(-np.pi, np.pi))
    depth = 40.0 + waves(rng, time_s, 1.0, (0.01, 0.04))
    roll, pitch = (waves(rng, time_s, 1.5 * DEGREE, (0.05, 0.25)) for _ in range(2))
    auv = fit(time_s, np.column_stack([place, depth]), np.column_stack([heading, pitch, roll]))
    follow = gaussian_filter1d(place, 12.0 / GRID_S, axis=0, mode="nearest")
    wander = np.column_stack([waves(rng, time_s, 14.0, (0.01, 0.03)) for _ in range(2)])
    surface = follow + wander
    course = np.unwrap(np.arctan2(*np.gradient(surface, GRID_S, axis=0).T[::-1]))
    yaw = gaussian_filter1d(course, 6.0 / GRID_S, mode="nearest")
    heave = waves(rng, time_s, 0.25, (0.08, 0.2))
    rolls = waves(rng, time_s, 3.0 * DEGREE, (0.1, 0.22))
    pitches = waves(rng, time_s, 1.5 * DEGREE, (0.1, 0.25))
    ship = fit(time_s, np.column_stack([surface, heave]), np.column_stack([yaw, pitches, rolls]))
    usbl = Sensors(
        position_m=(0.02, 0.02, 0.03),
        attitude_rad=(0.02 * DEGREE, 0.02 * DEGREE, 0.05 * DEGREE),
        ranging=(0.03, 0.06 * DEGREE, 0.06 * DEGREE),
        antenna_arm_m=(-3.0, 1.0, -9.0),
        ranging_arm_m=(2.0, -0.5, 3.0),
        ranging_type="usbl",
    )
    mbes = Sensors(
        position_m=None,
        attitude_rad=(0.02 * DEGREE, 0.02 * DEGREE, 0.05 * DEGREE),
        ranging=(0.02, 0.05 * DEGREE, 0.05 * DEGREE),
        antenna_arm_m=(-0.6, 0.0, -0.3),
        ranging_arm_m=(0.5, 0.0, 0.2),
        ranging_type="mbes",
    )
    vessel = Motion(ship, (0.0, 0.0), (0.0, 0.0), usbl, (4.0, 15.0 * DEGREE, 50.0))
    return vessel, Motion(auv, (5.0, 25.0), (58.0, 64.0), mbes, (2.5, 9.0 * DEGREE, 30.0))


MOTIONS: dict[str, Callable[[np.random.Generator, float], Motion]] = {
    "multirotor_lines": _multirotor,
    "fixed_wing_circuits": _fixed_wing,
    "car_stops": _car,
    "vessel_figure_eights": _vessel,
    "straight_constant_speed": _straight,
    "reciprocal_lines": _reciprocal,
    "constant_speed_eights": _eights,
}
