"""When, where and how steep: what effects look at besides the motion, drawn over the horizon.

Every sample is a mission of its own: a time since the start uniform in 0 .. duration, an object
uniform in the level disc of radius `extent` about the origin, and, where an effect acts by tilt,
for each vehicle a down axis uniform in the cone of half-angle `tilt` about the vertical.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from syncline_design.effects.kinematics import bearing, cross, euler_to_rotation, rotate
from syncline_design.effects.record import Array, StageRows
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.horizon import Horizon
from syncline_design.simulation.chain import ChainNoise, ConstantTwist
from syncline_design.simulation.draws import RandomSource, angle
from syncline_design.simulation.kernel import Draw, noise_rows


@dataclass(frozen=True, slots=True)
class Moment:
    """When and where the samples are, common to all stages.

    elapsed_s (n,): time since the mission's start; place_m (2, n): north and east of the object.
    """

    elapsed_s: Array
    place_m: Array


def moment_draw(horizon: Horizon, source: RandomSource) -> Moment:
    """n times uniform in the duration, n places uniform in the disc."""
    time, area, turn = source.uniform(3)
    cosine, sine = angle(turn)
    radius = horizon.extent_m * np.sqrt(area)
    return Moment(horizon.duration_s * time, np.stack([radius * cosine, radius * sine]))


def moment_at(horizon: Horizon, point: Mapping[str, Array], count: int) -> Moment:
    """When and where: unit interval `time` and disc `place` stretched to the horizon, or origin."""
    time, place = point.get("time"), point.get("place")
    if time is None or place is None:
        return Moment(np.zeros(count), np.zeros((2, count)))
    return Moment(horizon.duration_s * 0.5 * (1.0 + time[0]), horizon.extent_m * place)


def leaning(horizon: Horizon, disc: Array) -> Array:
    """(roll, pitch) [rad] (2, n) of points of the unit disc: as far out, as steep."""
    length = np.sqrt(disc[0] ** 2 + disc[1] ** 2)
    along, across = disc / np.where(length > 0.0, length, 1.0)
    tilt = horizon.tilt_rad * np.minimum(length, 1.0)
    return lean(np.sin(tilt), np.cos(tilt), along, across)


def tilt_draw(horizon: Horizon, source: RandomSource) -> Array:
    """(roll, pitch) [rad] (2, n) of down axes uniform in the cone of the horizon's tilt.

    Uniform on the cap by Archimedes' hat box: the cosine of the tilt is uniform.
    """
    height, turn = source.uniform(2)
    lift = 2.0 * math.sin(0.5 * horizon.tilt_rad) ** 2 * height  # 1 - cos of the tilt
    return lean(np.sqrt(lift * (2.0 - lift)), 1.0 - lift, *angle(turn))


def lean(sine: Array, cosine: Array, along: Array, across: Array) -> Array:
    """(roll, pitch) [rad] (2, n) of a vehicle whose vertical is (sine along, sine across, cosine).

    In the body's axes the vertical is (-sin pitch, sin roll cos pitch, cos roll cos pitch).
    """
    pitch = -np.arcsin(np.clip(sine * along, -1.0, 1.0))
    return np.stack([np.arctan2(sine * across, cosine), pitch])


def placed_rows(
    draw: Draw, moment: Moment, lean_rad: Array
) -> tuple[StageRows, ConstantTwist, ChainNoise]:
    """A draw for the row-wise chain, at its moment and with roll and pitch (2, n)."""
    count = draw.bearing.shape[1]
    roll, pitch = lean_rad
    euler = np.stack([roll, pitch, np.arctan2(draw.sin_yaw, draw.cos_yaw)], axis=-1)
    rotation = euler_to_rotation(euler)
    azimuth = np.arctan2(draw.bearing[1], draw.bearing[0])
    elevation = np.arctan2(-draw.bearing[2], np.hypot(draw.bearing[0], draw.bearing[1]))
    antenna, ranging = (
        np.broadcast_to(lever, (3, count)).T for lever in (draw.antenna_m, draw.ranging_m)
    )
    velocity, rate = draw.velocity_mps.T, draw.rate_radps.T
    target = on_the_level(moment)
    vector = ranging + draw.range_m[:, None] * bearing(azimuth, elevation)
    rows = StageRows(
        time_s=moment.elapsed_s,
        position_m=target - rotate(rotation, vector),
        rotation=rotation,
        euler_rad=euler,
        velocity_mps=velocity,
        acceleration_mps2=cross(rate, velocity),
        rate_radps=rate,
        range_m=draw.range_m,
        azimuth_rad=azimuth,
        elevation_rad=elevation,
        antenna_m=antenna,
        ranging_m=ranging,
        target_m=target,
        start_s=0.0,
        independent=True,
    )
    return rows, ConstantTwist(rotation, velocity, rate), noise_rows(draw)


def on_the_level(moment: Moment) -> Array:
    """The object's place [m], NED, down 0, (n, 3)."""
    return np.stack([*moment.place_m, np.zeros(moment.elapsed_s.shape[0])], axis=-1)
