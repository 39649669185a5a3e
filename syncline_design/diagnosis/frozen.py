"""Readings that a device gives over and over while the vehicle moves on: ever older data.

A receiver that hangs repeats its last places to the last digit.  Rows j+1 to k repeat row j where
all components are the same, so that the data of row k are t_k - t_j old.  A vehicle that stands
still gives such rows as well (a receiver that holds its place, a coarse figure): what counts are
runs in which the motion moved the reading by more than MOVED standard deviations,
    d = |integral of v dt| (places), D |integral of w dt| (angles, D the range),
of the velocities v and turn rates w logged beside it, of a range and bearing both.  A log at a
higher rate than its sensor holds every reading for some rows: a run has to be USUAL times as long
as those that the log is made of.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

import numpy as np

from syncline_design.diagnosis.scene import Scene
from syncline_design.effects.record import ActsOn, Array
from syncline_design.logs.log import StageLog
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.system import Stage

LEAST_ROWS: Final = 3  # that repeat a reading
USUAL: Final = 3.0  # times the usual run of a log
MOVED: Final = 5.0  # standard deviations of the reading
SAME: Final = 1e-9  # of a reading's size, which interpolation between two equal ones leaves


@dataclass(frozen=True, slots=True)
class Frozen:
    """Rows [first, last] that repeat the reading before them: the age of the last one [s], and how
    far the reading is off in the target's place, row by row [m]."""

    sensor: ActsOn
    stage: int
    first: int
    last: int
    age_s: float
    off_m: Array


def frozen(view: Scene) -> list[Frozen]:
    """All such runs of all sensors of a log, by sensor and time."""
    found: list[Frozen] = []
    for index, (stage, logged) in enumerate(zip(view.system.stages, view.log.stages, strict=True)):
        for sensor, reading, sigma_m in _readings(stage, logged):
            moved_m = _path(view, index, sensor, logged)
            found += _runs(view.log.time_s, sensor, index, reading, moved_m, sigma_m)
    return found


def _readings(stage: Stage, logged: StageLog) -> Iterator[tuple[ActsOn, Array, float]]:
    """Columns (n, p) of every sensor, and what they scatter at the target by the spec [m]."""
    reach_m = 1.0 if logged.range_m is None else float(np.median(logged.range_m))
    if logged.antenna_m is not None and stage.position is not None:
        yield "position", logged.antenna_m, max(stage.position.sigma)
    if stage.attitude is not None:
        yield "attitude", logged.euler_rad, reach_m * max(stage.attitude.sigma)
    beam = (logged.range_m, logged.azimuth_rad, logged.elevation_rad)
    known = [column for column in beam if column is not None]
    if len(known) == len(beam) and stage.ranging is not None:
        sigma = stage.ranging.sigma
        yield "ranging", np.column_stack(known), max(sigma[0], reach_m * max(sigma[1:]))


def _path(view: Scene, index: int, sensor: ActsOn, logged: StageLog) -> Array:
    """Place (n, 3) that a reading would have gone through, so that differences say how far."""
    time_s = view.log.time_s
    reach_m = 1.0 if logged.range_m is None else float(np.median(logged.range_m))
    place = _summed(time_s, logged.velocity_mps)
    swung = reach_m * _summed(time_s, logged.rate_radps)
    if sensor == "position":
        return place
    return swung if sensor == "attitude" else np.hstack([place, swung])


def _summed(time_s: Array, slope: Array) -> Array:
    """Integral by the trapezoidal rule, (n, p)."""
    step = np.diff(time_s)[:, None]
    parts = 0.5 * step * (slope[1:] + slope[:-1])
    return np.concatenate([np.zeros((1, slope.shape[1])), np.cumsum(parts, axis=0)])


def _runs(
    time_s: Array, sensor: ActsOn, stage: int, reading: Array, path: Array, sigma_m: float
) -> Iterator[Frozen]:
    size = np.maximum(np.abs(reading[1:]), 1.0)
    same = np.all(np.abs(np.diff(reading, axis=0)) <= SAME * size, axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], same, [False]]).astype(int)))
    runs = [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]  # a: the fresh
    usual = _usual_run(len(reading), runs)
    for fresh, last in runs:
        off = np.linalg.norm(path[fresh + 1 : last + 1] - path[fresh], axis=1)
        long_enough = last - fresh >= max(LEAST_ROWS, math.ceil(USUAL * usual))
        if long_enough and float(np.max(off)) > MOVED * sigma_m:
            age_s = float(time_s[last] - time_s[fresh])
            yield Frozen(sensor, stage, fresh + 1, last, age_s, off)


def _usual_run(rows: int, runs: list[tuple[int, int]]) -> float:
    """How many rows repeat each reading, in the median reading."""
    repeats = [last - fresh for fresh, last in runs]
    alone = rows - sum(repeats) - len(runs)
    return float(np.median(np.concatenate([np.zeros(max(alone, 0)), repeats])))
