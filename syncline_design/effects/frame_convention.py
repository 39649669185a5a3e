"""A column follows another frame or unit convention than it should."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from syncline_design.effects.kinematics import rotate
from syncline_design.effects.record import (
    Array,
    Basis,
    Contribution,
    Departures,
    Effect,
    Parameter,
    Rng,
    StageRows,
    Target,
    Values,
)
from syncline_design.model.system import Stage

CHOICES: Mapping[Target, tuple[str, ...]] = {
    "position": ("enu", "up"),
    "attitude": ("yaw_sign", "yaw_180", "transposed", "enu", "radians", "degrees"),
    "ranging": ("azimuth_sign", "elevation_sign", "radians", "degrees"),
}


def conventions(sensor: Target) -> tuple[str, ...]:
    """Conventions that a sensor's columns may be in by mistake.

    enu: east, north, up for north, east, down (attitude: yaw from east to north, pitch up
    negative); up: height in the down column; yaw_sign, azimuth_sign, elevation_sign: turned round;
    yaw_180: facing backwards; transposed: NED to body for body to NED; radians: written where
    degrees are due; degrees: written where radians are due.
    """
    return CHOICES.get(sensor, ())


def _depart(rows: StageRows, values: Values, sensor: Target, _: Rng) -> Departures:
    convention = str(values["convention"])
    if sensor == "position":
        return _position(rows, convention)
    return _attitude(rows, convention) if sensor == "attitude" else _ranging(rows, convention)


def _position(rows: StageRows, convention: str) -> Departures:
    """What the columns hold instead of the antenna's place, minus that place."""
    place = rows.position_m + rotate(rows.rotation, rows.antenna_m)
    held = place * np.array([1.0, 1.0, -1.0])
    if convention == "enu":
        held = held[:, [1, 0, 2]]
    return Departures(position_m=held - place)


def _attitude(rows: StageRows, convention: str) -> Departures:
    """What the columns hold instead of roll, pitch, yaw, minus these."""
    roll, pitch, yaw = rows.euler_rad.T
    if convention == "yaw_sign":
        held = np.stack([roll, pitch, -yaw], axis=-1)
    elif convention == "yaw_180":
        held = np.stack([roll, pitch, yaw + math.pi], axis=-1)
    elif convention == "enu":
        held = np.stack([roll, -pitch, 0.5 * math.pi - yaw], axis=-1)
    elif convention == "transposed":
        held = _euler(np.swapaxes(rows.rotation, 1, 2))
    else:
        held = rows.euler_rad * _UNIT[convention]
    return Departures(attitude_euler_rad=held - rows.euler_rad)


def _euler(rotation: Array) -> Array:
    """Roll, pitch, yaw of R, (n, 3, 3) -> (n, 3)."""
    pitch = -np.arcsin(np.clip(rotation[:, 2, 0], -1.0, 1.0))
    roll = np.arctan2(rotation[:, 2, 1], rotation[:, 2, 2])
    return np.stack([roll, pitch, np.arctan2(rotation[:, 1, 0], rotation[:, 0, 0])], axis=-1)


def _ranging(rows: StageRows, convention: str) -> Departures:
    azimuth, elevation = rows.azimuth_rad, rows.elevation_rad
    if convention == "azimuth_sign":
        return Departures(azimuth_rad=-2.0 * azimuth)
    if convention == "elevation_sign":
        return Departures(elevation_rad=-2.0 * elevation)
    factor = _UNIT[convention] - 1.0
    return Departures(azimuth_rad=factor * azimuth, elevation_rad=factor * elevation)


_UNIT = {"radians": math.pi / 180.0, "degrees": 180.0 / math.pi}


def _contribute(stage: Stage, values: Values, sensor: Target, basis: Basis) -> Contribution:
    """Twice what is turned round: such a fault is mended, not budgeted.

    Positions: the antenna's distance from the origin, at most extent + d + arms; attitude: d and
    the arms; ranging: d.
    """
    reach = basis.distance_m
    if sensor != "ranging":
        reach += basis.arm_m
    if sensor == "position":
        reach += basis.horizon.extent_m
    return Contribution(systematic_m=2.0 * reach)


EFFECT = Effect(
    name="frame_convention",
    sensors=("position", "attitude", "ranging"),
    kind="discrete",
    parameters=(Parameter("convention", 0.0, 0.0, choices=CHOICES),),
    sentence="the {sensor} columns follow another convention: {convention}",
    confused_with="nothing of its size",
    separated_by="nothing needs to: mend the columns and diagnose again",
    source="package conventions: NED, forward-right-down, yaw-pitch-roll",
    depart=_depart,
    sensitivity=None,
    contribute=_contribute,
)
