"""One way in which the columns of a log may be written, and how its rows are mended.

`Parts` are what the error of a log of one stage is made of: e = a + R m - t, see `conventions`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from syncline_design.diagnosis.scene import levers
from syncline_design.effects.kinematics import (
    bearing,
    euler_to_rotation,
    rotation_to_euler,
)
from syncline_design.effects.record import ActsOn, Array
from syncline_design.logs.log import Log, LogTrack, StageLog
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.system import System

Mend = Callable[[Log], Log]
EULER = ("roll", "pitch", "yaw")


@dataclass(frozen=True, slots=True)
class Convention:
    """One way in which columns may be written: what they hold, and the log mended.

    work: how much it changes, for ties; upright: whether the vehicle keeps its belly down;
    sentence: for people, where the effect's own says it worse.
    """

    sensor: ActsOn
    convention: str
    mend: Mend
    work: int
    size_m: float = math.inf
    upright: bool = True
    sentence: str = ""


@dataclass(frozen=True, slots=True)
class Parts:
    """Some rows of a log of one stage; see above."""

    antenna: Array
    euler: Array
    arms: Array  # (3,) body: ranging less position
    polar: Array | None  # range, azimuth, elevation (n, 3)
    target: Array

    @property
    def vector(self) -> Array:
        return vector_of(self.arms, self.polar, len(self.euler))


def parts_of(system: System, log: Log) -> Parts:
    held = log.stages[0]
    antenna, ranging = levers(system.stages[0], 0)
    polar = None if held.range_m is None else polar_of(held)
    arms = -antenna if polar is None else ranging - antenna
    assert held.antenna_m is not None
    return Parts(held.antenna_m, held.euler_rad, arms, polar, log.truth_m)


def vector_of(arms: Array, polar: Array | None, rows: int) -> Array:
    if polar is None:
        return np.broadcast_to(arms, (rows, 3))
    found: Array = arms + polar[:, :1] * bearing(polar[:, 1], polar[:, 2])
    return found


def size_of(error: Array) -> float:
    return float(sizes_of(error))


def sizes_of(error: Array) -> Array:
    """Median length of each error (..., n, 3)."""
    found: Array = np.median(np.sqrt(np.nansum(error**2, axis=-1)), axis=-1)
    return found


def turned(values: Array, matrix: Array) -> Array:
    """Rows turned; an axis that is not known stays so wherever it goes."""
    known = np.isfinite(values).astype(float)
    found = np.nan_to_num(values) @ matrix.T
    return np.where(known @ np.abs(matrix.T) > 0.0, found, np.nan)


def scaled(held: Array, scale: Array, turn: Array) -> Array:
    """Columns (n, k) as they should be: factors and zeros [rad] (k,) undone."""
    return held * scale + turn


def belly_down(rotation: Array) -> bool:
    """Whether the vehicle keeps its belly down in most rows of R (n, 3, 3), body to NED."""
    return bool(np.median(rotation[:, 2, 2]) > 0.0)


def first_changed(log: Log, change: Callable[[StageLog], StageLog]) -> Log:
    return replace(log, stages=(change(log.stages[0]), *log.stages[1:]))


def antenna_turned(back: Array) -> Mend:
    def changed(held: StageLog) -> StageLog:
        assert held.antenna_m is not None
        placed = replace(held, antenna_m=held.antenna_m @ back.T)
        return velocity_turned(placed, back) if held.follows_position else placed

    return lambda log: first_changed(log, changed)


def truth_turned(back: Array) -> Mend:
    return lambda log: replace(log, truth_m=turned(log.truth_m, back))


def everything_turned(back: Array) -> Mend:
    def mend(log: Log) -> Log:
        both = truth_turned(back)(antenna_turned(back)(log))
        if log.stages[0].follows_position:
            return both
        return first_changed(both, lambda held: velocity_turned(held, back))

    return mend


def rates_turned(held: StageLog, back: Array) -> StageLog:
    """Turn rates [rad/s, body axes] undone by a matrix (3, 3), quick ones as well."""
    track = held.rate_track
    quick = None if track is None else LogTrack(track.time_s, track.value @ back.T)
    return replace(held, rate_radps=held.rate_radps @ back.T, rate_track=quick)


def velocity_turned(held: StageLog, back: Array) -> StageLog:
    track = held.velocity_track
    quick = None if track is None else LogTrack(track.time_s, track.value @ back.T)
    return replace(held, velocity_mps=held.velocity_mps @ back.T, velocity_track=quick)


def angles_mended(mended: Callable[[Array], Array]) -> Mend:
    """mended: roll, pitch and yaw (n, 3) as they should be, of the columns."""

    def changed(held: StageLog) -> StageLog:
        return replace(held, euler_rad=mended(held.euler_rad))

    return lambda log: first_changed(log, changed)


def rotation_mended(mended: Callable[[Array], Array]) -> Mend:
    return angles_mended(lambda euler: rotation_to_euler(mended(euler_to_rotation(euler))))


def polar_mended(mended: Callable[[Array], Array]) -> Mend:
    """mended: range, azimuth and elevation (n, 3) as they should be, of the columns."""

    def changed(held: StageLog) -> StageLog:
        distance, azimuth, elevation = mended(polar_of(held)).T
        return replace(held, range_m=distance, azimuth_rad=azimuth, elevation_rad=elevation)

    return lambda log: first_changed(log, changed)


def polar_of(held: StageLog) -> Array:
    """Range, azimuth and elevation, (n, 3)."""
    assert held.range_m is not None
    assert held.azimuth_rad is not None
    assert held.elevation_rad is not None
    return np.stack([held.range_m, held.azimuth_rad, held.elevation_rad], axis=1)
