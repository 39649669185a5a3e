"""Where a trajectory from a file leaves what the budget and the bounds are about."""

from __future__ import annotations

import math

import numpy as np

from syncline_design.effects.acting import by_stage
from syncline_design.effects.kinematics import bearing, rotate
from syncline_design.effects.record import Array
from syncline_design.model.figure_text import format_duration, to_digits
from syncline_design.model.system import Stage, System
from syncline_design.simulation.settings import SimulationSettings
from syncline_design.simulation.track import Track
from syncline_design.simulation.trajectory import MANOEUVRES, stage_track

_SLACK = 1.01  # of speed and turn rate: derivatives of a rounded file are no better


def follows_a_file(settings: SimulationSettings) -> bool:
    """Whether times, places and motion are a file's."""
    chosen = settings.trajectory
    along = settings.envelope == "trajectory" and chosen is not None
    return along and str(chosen) not in MANOEUVRES


def excursions(system: System, settings: SimulationSettings) -> tuple[str, ...]:
    """What of a file lies outside the platform's limits or the horizon, in words.

    The Syncline and the worst case stop at these limits, the simulated errors do not: they run
    along the file as it is.  Named manoeuvres keep the limits.
    """
    if not follows_a_file(settings):
        return ()
    found: list[str] = []
    acting = by_stage(system)
    for index, stage in enumerate(system.stages):
        track = stage_track(system, settings, index)
        if index == 0 and system.effects:
            found += _duration(track, system.horizon.duration_s)
        found += _motion(stage, track)
        if any(one.effect.accelerated for one in acting.get(stage.name, ())):
            found += _acceleration(stage, track)
        tilt = float(np.max(np.arccos(np.clip(track.rotation[:, 2, 2], -1.0, 1.0))))
        if tilt > system.horizon.tilt_rad + 1e-9:
            found.append(_over(stage, "tilts", tilt, system.horizon.tilt_rad, "deg", math.pi / 180))
    if system.effects:
        found += _extent(system, settings)
    return tuple(found)


def _duration(track: Track, allowed_s: float) -> list[str]:
    lasts = float(track.time_s[-1] - track.time_s[0])
    if lasts <= allowed_s * (1.0 + 1e-9):
        return []
    return [f"lasts {format_duration(lasts)}, horizon.duration is {format_duration(allowed_s)}"]


def _motion(stage: Stage, track: Track) -> list[str]:
    """Speed, turn rate and range against the platform's, at the rows and between them."""
    between = 0.5 * (track.time_s[:-1] + track.time_s[1:])
    times = np.concatenate([track.time_s, between])
    speed = _largest(np.linalg.norm(track.position(times, 1), axis=1))
    turn = _largest(np.linalg.norm(track.rate(between), axis=1))
    v, omega = float(stage.platform.v_max_mps), float(stage.platform.omega_max_radps)
    found = []
    if speed > v * _SLACK:
        found.append(_over(stage, "moves at", speed, v, "m/s"))
    if turn > omega * _SLACK:
        found.append(_over(stage, "turns at", turn, omega, "deg/s", math.pi / 180.0))
    if track.sight is not None and stage.ranging is not None:
        reach, d = _largest(track.sight[0]), float(stage.platform.distance_m)
        if reach > d * (1.0 + 1e-9):
            found.append(_over(stage, "looks over", reach, d, "m"))
    return found


def _acceleration(stage: Stage, track: Track) -> list[str]:
    """Acceleration against v_max omega_max, the hardest turn's, which effects are charged for."""
    between = 0.5 * (track.time_s[:-1] + track.time_s[1:])
    found = _largest(np.linalg.norm(track.acceleration(between), axis=1))
    allowed = float(stage.platform.v_max_mps * stage.platform.omega_max_radps)
    if found <= allowed * _SLACK**2:
        return []
    return [_over(stage, "accelerates at", found, allowed, "m/s2")]


def _extent(system: System, settings: SimulationSettings) -> list[str]:
    """The last stage's object, which grids are charged for, against the extent."""
    index = len(system.stages) - 1
    stage, track = system.stages[index], stage_track(system, settings, index)
    away = _object_away_m(stage, track)
    if away <= system.horizon.extent_m * (1.0 + 1e-9):
        return []
    return [_over(stage, "reaches objects at", away, system.horizon.extent_m, "m")]


def _object_away_m(stage: Stage, track: Track) -> float:
    """Largest level distance of an object from the origin; of a look at random, its largest."""
    position = track.position_m
    if stage.ranging is None:
        return _largest(np.hypot(position[:, 0], position[:, 1]))
    arm = stage.ranging.lever_arm_m or (0.0, 0.0, 0.0)
    if track.sight is None:
        reach = float(stage.platform.distance_m) + math.hypot(*arm)
        return _largest(np.hypot(position[:, 0], position[:, 1])) + reach
    range_m, azimuth, elevation = track.sight
    vector = np.asarray(arm) + range_m[:, None] * bearing(azimuth, elevation)
    target = position + rotate(track.rotation, vector)
    return _largest(np.hypot(target[:, 0], target[:, 1]))


def _largest(values: Array) -> float:
    return float(np.max(values))


def _over(
    stage: Stage, does: str, found: float, allowed: float, unit: str, size: float = 1.0
) -> str:
    """`uav moves at up to 12 m/s, 10 is allowed for`."""
    texts = ([to_digits(one / size, n) for one in (found, allowed)] for n in range(4, 18))
    up_to, at_most = next(pair for pair in texts if pair[0] != pair[1])
    return f"{stage.name} {does} up to {up_to} {unit}, {at_most} is allowed for"
