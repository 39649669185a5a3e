"""A column follows another frame or unit convention than it should."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from syncline_design.effects.kinematics import euler_to_rotation, rotate, rotation_to_euler
from syncline_design.effects.record import (
    ActsOn,
    Array,
    Basis,
    Contribution,
    Departures,
    Effect,
    Parameter,
    Rng,
    StageRows,
    Undoing,
    Values,
)
from syncline_design.model.system import Stage

# enu: east, north, up for north, east, down (attitude: yaw from east to north, pitch up negative);
# up: height in the down column; yaw_sign, azimuth_sign, elevation_sign: turned round; yaw_180:
# facing backwards; transposed: NED to body for body to NED; radians: written where degrees are due;
# degrees: written where radians are due.
CHOICES: Mapping[ActsOn, tuple[str, ...]] = {
    "position": ("enu", "up"),
    "attitude": ("yaw_sign", "yaw_180", "transposed", "enu", "radians", "degrees"),
    "ranging": ("azimuth_sign", "elevation_sign", "radians", "degrees"),
}


def _depart(rows: StageRows, values: Values, sensor: ActsOn, _: Rng) -> Departures:
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
        held = rotation_to_euler(np.swapaxes(rows.rotation, 1, 2))
    else:
        held = rows.euler_rad * _UNIT[convention]
    return Departures(attitude_euler_rad=held - rows.euler_rad)


def _ranging(rows: StageRows, convention: str) -> Departures:
    azimuth, elevation = rows.azimuth_rad, rows.elevation_rad
    if convention == "azimuth_sign":
        return Departures(azimuth_rad=-2.0 * azimuth)
    if convention == "elevation_sign":
        return Departures(elevation_rad=-2.0 * elevation)
    factor = _UNIT[convention] - 1.0
    return Departures(azimuth_rad=factor * azimuth, elevation_rad=factor * elevation)


_UNIT = {"radians": math.pi / 180.0, "degrees": 180.0 / math.pi}


def _mended(columns: Array, sensor: ActsOn, convention: str) -> Array:
    """The columns of a sensor brought back to the package's conventions."""
    if sensor == "position":
        flipped: Array = columns * np.array([1.0, 1.0, -1.0])
        return flipped[:, [1, 0, 2]] if convention == "enu" else flipped
    if sensor == "attitude":
        return _mended_euler(columns, convention)
    return _mended_bearing(columns, convention)


def _mended_euler(euler: Array, convention: str) -> Array:
    roll, pitch, yaw = euler.T
    degree = _UNIT["radians"]
    if convention == "transposed":
        return rotation_to_euler(np.swapaxes(euler_to_rotation(euler), 1, 2))
    columns = {
        "yaw_sign": (roll, pitch, -yaw),
        "yaw_180": (roll, pitch, yaw - math.pi),
        "enu": (roll, -pitch, 0.5 * math.pi - yaw),
        "radians": (roll / degree, pitch / degree, yaw / degree),
        "degrees": (roll * degree, pitch * degree, yaw * degree),
    }[convention]
    return np.stack(columns, axis=-1)


def _mended_bearing(bearing: Array, convention: str) -> Array:
    degree = _UNIT["radians"]
    factors = {
        "azimuth_sign": (-1.0, 1.0),
        "elevation_sign": (1.0, -1.0),
        "radians": (1.0 / degree, 1.0 / degree),
        "degrees": (degree, degree),
    }
    mended: Array = bearing * np.array(factors[convention])
    return mended


def _contribute(stage: Stage, values: Values, sensor: ActsOn, basis: Basis) -> Contribution:
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
    undoing=Undoing(CHOICES, _mended),
    breaks="mounting",
)
