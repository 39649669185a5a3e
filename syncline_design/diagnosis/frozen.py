"""Readings that a device gives over and over while the vehicle moves on: ever older data.

A receiver that hangs repeats its last places to the last digit, or a filter behind it lets them
tremble.  Rows j+1 to k repeat row j where no component is further from it than RESTS standard
deviations of the sensor, which noise does in one row of 400, so that the data of row k are
t_k - t_j old.  A vehicle that stands
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
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from syncline_design.effects.kinematics import within_half_a_turn
from syncline_design.effects.record import ActsOn, Array
from syncline_design.logs.log import Log, StageLog
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.system import Stage, System

LEAST_ROWS: Final = 3  # that repeat a reading
USUAL: Final = 3.0  # times the usual run of a log
MOVED: Final = 5.0  # standard deviations of the reading
RESTS: Final = 0.25  # standard deviations from the reading that is repeated
SAME: Final = 1e-9  # of a reading's size, which interpolation between two equal ones leaves


class LogOfSystem(Protocol):
    """A log beside the system that made it."""

    @property
    def system(self) -> System: ...
    @property
    def log(self) -> Log: ...


@dataclass(frozen=True, slots=True)
class Frozen:
    """Rows [first, last] that repeat the reading before them: the age of the last one [s], and how
    far the reading is off in the target's place, row by row [m].  reading: which one, where others
    of the sensor go on; "" of all."""

    sensor: ActsOn
    stage: int
    first: int
    last: int
    age_s: float
    off_m: Array
    reading: str = ""


def frozen(view: LogOfSystem) -> list[Frozen]:
    """All such runs of all sensors of a log, by sensor and time."""
    found: list[Frozen] = []
    for index, (stage, logged) in enumerate(zip(view.system.stages, view.log.stages, strict=True)):
        for sensor, reading, sigma, sigma_m in _readings(stage, logged):
            moved_m = _path(view, index, sensor, logged)
            repeats = Repeats(view.log.time_s, reading, sigma, moved_m, sigma_m)
            found += runs(repeats, sensor, index)
    return found


@dataclass(frozen=True, slots=True)
class Repeats:
    """Readings (n, p) along their stamps with their standard deviations (p,), the place that they
    would have gone through (n, q) [m] and what they scatter at the target [m].  angle: whether
    both are of one angle in its own unit [rad]."""

    time_s: Array
    reading: Array
    sigma: Array
    path: Array
    sigma_m: float
    angle: bool = False

    def off(self, fresh: int, last: int) -> Array:
        """How far the course leaves a reading behind in the rows that repeat it."""
        moved = self.path[fresh + 1 : last + 1] - self.path[fresh]
        if self.angle:
            moved = within_half_a_turn(moved)
        off: Array = np.linalg.norm(moved, axis=1)
        return off

    def last(self, fresh: int, most: int) -> int:
        """The last row up to one that repeats a reading."""
        size = np.maximum(np.abs(self.reading[fresh]), 1.0)
        off = np.abs(self.reading[fresh : most + 1] - self.reading[fresh])
        far = np.any(off > np.maximum(SAME * size, RESTS * self.sigma), axis=1)
        return fresh + (int(np.argmax(far)) - 1 if np.any(far) else most - fresh)


def _readings(stage: Stage, logged: StageLog) -> Iterator[tuple[ActsOn, Array, Array, float]]:
    """Columns (n, p) of every sensor, what they scatter by the spec, and that at the target [m]."""
    reach_m = 1.0 if logged.range_m is None else float(np.median(logged.range_m))
    if logged.antenna_m is not None and stage.position is not None:
        sigma = np.array(stage.position.sigma)
        yield "position", logged.antenna_m, sigma, float(np.max(sigma))
    if stage.attitude is not None:
        sigma = np.array(stage.attitude.sigma)
        yield "attitude", logged.euler_rad, sigma, reach_m * float(np.max(sigma))
    beam = (logged.range_m, logged.azimuth_rad, logged.elevation_rad)
    known = [column for column in beam if column is not None]
    if len(known) == len(beam) and stage.ranging is not None:
        sigma = np.array(stage.ranging.sigma)
        at_target_m = max(float(sigma[0]), reach_m * float(np.max(sigma[1:])))
        yield "ranging", np.column_stack(known), sigma, at_target_m


def _path(view: LogOfSystem, index: int, sensor: ActsOn, logged: StageLog) -> Array:
    """Place (n, 3) that a reading would have gone through, so that differences say how far."""
    time_s = view.log.time_s
    reach_m = 1.0 if logged.range_m is None else float(np.median(logged.range_m))
    place = summed(time_s, logged.velocity_mps)
    swung = reach_m * summed(time_s, logged.rate_radps)
    if sensor == "position":
        return place
    return swung if sensor == "attitude" else np.hstack([place, swung])


def summed(time_s: Array, slope: Array) -> Array:
    """Integral by the trapezoidal rule, (n, p)."""
    step = np.diff(time_s)[:, None]
    parts = 0.5 * step * (slope[1:] + slope[:-1])
    return np.concatenate([np.zeros((1, slope.shape[1])), np.cumsum(parts, axis=0)])


def runs(of: Repeats, sensor: ActsOn, stage: int) -> Iterator[Frozen]:
    """Rows that repeat a reading while its course goes on."""
    size = np.maximum(np.abs(of.reading[1:]), 1.0)
    step = np.abs(np.diff(of.reading, axis=0))
    usual = _usual_run(len(of.reading), _side_by_side(np.all(step <= SAME * size, axis=1)))
    least = max(LEAST_ROWS, math.ceil(USUAL * usual))
    near = np.all(step <= np.maximum(SAME * size, 2.0 * RESTS * of.sigma), axis=1)
    for first, most in _side_by_side(near):
        fresh = first
        while most - fresh >= least:
            last = of.last(fresh, most)
            off = of.off(fresh, last)
            if last - fresh >= least and float(np.max(off)) > MOVED * of.sigma_m:
                age_s = float(of.time_s[last] - of.time_s[fresh])
                yield Frozen(sensor, stage, fresh + 1, last, age_s, off)
                fresh = last
            fresh += 1


def _side_by_side(same: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """The fresh row and the last one of runs of rows that are the same as the row before."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], same, [False]]).astype(int)))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _usual_run(rows: int, runs: list[tuple[int, int]]) -> float:
    """How many rows repeat each reading, in the median reading."""
    repeats = [last - fresh for fresh, last in runs]
    alone = rows - sum(repeats) - len(runs)
    return float(np.median(np.concatenate([np.zeros(max(alone, 0)), repeats])))
