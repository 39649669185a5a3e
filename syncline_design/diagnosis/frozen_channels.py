"""One reading of a sensor that hangs while its others go on: a heading without roll and pitch.

What `frozen` asks of all readings of a sensor at once is asked of each alone, along the course that
the rest of the log says it should have taken:
    places: integral of v dt + R l (l the antenna's lever arm),
    angles: integral of the Euler rates of the turn rates w = (p, q, r),
        roll' = p + (q sin roll + r cos roll) tan pitch,  pitch' = q cos roll - r sin roll,
        yaw' = (q sin roll + r cos roll) / cos pitch,
    a range and bearing: of the surveyed target, from the place and the attitude of that row.
One reading rests by itself more often than three: a coarse figure does within its grid, and one
whose motion is logged in other axes.  So the course has to be borne out: over as many rows
elsewhere nine of ten readings are nearer to it than half of what the one that hangs is off.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from syncline_design.diagnosis.frozen import Frozen, LogOfSystem, Repeats, runs, summed
from syncline_design.diagnosis.scene import levers
from syncline_design.effects.kinematics import euler_to_rotation, rotate, within_half_a_turn
from syncline_design.effects.record import ActsOn, Array
from syncline_design.logs.log import StageLog
from syncline_design.machine.quick_dataclass import dataclass

BORNE_OUT: Final = 0.9  # of the readings elsewhere
NEARER: Final = 0.5  # of what the hanging one is off
PLACES: Final = ("north", "east", "down")
ANGLES: Final = ("roll", "pitch", "yaw")
BEAM: Final = ("range", "azimuth", "elevation")


@dataclass(frozen=True, slots=True)
class _Channel:
    """A reading (n,), the course that it should have taken (n,), both in m or rad, and its standard
    deviation; to_m: what one unit of it is at the target [m].  angle: whether it is one."""

    sensor: ActsOn
    name: str
    reading: Array
    course: Array
    sigma: float
    to_m: float
    angle: bool

    def off(self, rows: int) -> Array:
        """How far readings that many rows apart are from the course between them."""
        moved = self.reading[rows:] - self.reading[:-rows]
        off = moved - (self.course[rows:] - self.course[:-rows])
        return np.abs(within_half_a_turn(off) if self.angle else off)


def frozen_channels(view: LogOfSystem, whole: Sequence[Frozen]) -> Iterator[Frozen]:
    """Runs in which one reading hangs; whole: those of all readings of a sensor, told already."""
    for stage in range(len(view.system.stages)):
        for channel in _channels(view, stage):
            for run in runs(_repeats(view, channel), channel.sensor, stage):
                if not any(_is_in(run, other) for other in whole) and _is_sure(channel, run):
                    yield replace(run, off_m=channel.to_m * run.off_m, reading=channel.name)


def _is_in(run: Frozen, other: Frozen) -> bool:
    same = (run.sensor, run.stage) == (other.sensor, other.stage)
    return same and run.first <= other.last and other.first <= run.last


def _is_sure(channel: _Channel, run: Frozen) -> bool:
    """Whether the course is borne out elsewhere."""
    rows, most = run.last - run.first + 1, float(np.max(run.off_m))
    if 2 * rows >= len(channel.reading):
        return False
    off = channel.off(rows)
    begins = np.arange(len(off))
    elsewhere = (begins + rows < run.first - 1) | (begins > run.last)
    if not np.any(elsewhere):
        return False
    return float(np.quantile(off[elsewhere], BORNE_OUT)) < NEARER * most


def _repeats(view: LogOfSystem, channel: _Channel) -> Repeats:
    reading, course = channel.reading[:, None], channel.course[:, None]
    sigma = np.array([channel.sigma])
    return Repeats(view.log.time_s, reading, sigma, course, channel.sigma, angle=channel.angle)


def _channels(view: LogOfSystem, stage: int) -> Iterator[_Channel]:
    logged, own = view.log.stages[stage], view.system.stages[stage]
    turns = euler_to_rotation(logged.euler_rad)
    arm, lever = levers(own, stage)
    reach_m = 1.0 if logged.range_m is None else float(np.median(logged.range_m))
    if logged.antenna_m is not None and own.position is not None:
        course = summed(view.log.time_s, logged.velocity_mps) + rotate(turns, arm)
        for k, name in enumerate(PLACES):
            sigma = own.position.sigma[k]
            yield _Channel("position", name, logged.antenna_m[:, k], course[:, k], sigma, 1.0,
                           angle=False)  # fmt: skip
    if own.attitude is not None:
        course = summed(view.log.time_s, euler_rates(logged))
        for k, name in enumerate(ANGLES):
            reading, sigma = logged.euler_rad[:, k], own.attitude.sigma[k]
            yield _Channel("attitude", name, reading, course[:, k], sigma, reach_m, angle=True)
    if own.ranging is None or logged.antenna_m is None or view.log.kind != "georeference":
        return
    if len(view.system.stages) > 1 or not np.all(np.isfinite(view.log.truth_m)):
        return
    origin = logged.antenna_m + rotate(turns, lever - arm)
    seen = rotate(np.swapaxes(turns, 1, 2), view.log.truth_m - origin)
    beam = (logged.range_m, logged.azimuth_rad, logged.elevation_rad)
    for k, (name, column) in enumerate(zip(BEAM, beam, strict=True)):
        if column is not None:
            to_m = 1.0 if k == 0 else reach_m
            yield _Channel("ranging", name, column, _told_of(seen)[k], own.ranging.sigma[k], to_m,
                           angle=k > 0)  # fmt: skip


def _told_of(seen: Array) -> tuple[Array, Array, Array]:
    """Range, azimuth and elevation of places in the body (n, 3)."""
    x, y, z = seen.T
    return np.linalg.norm(seen, axis=1), np.arctan2(y, x), np.arctan2(-z, np.hypot(x, y))


def euler_rates(logged: StageLog) -> Array:
    """Of roll, pitch and yaw (n, 3) [rad/s]; source: Stevens and Lewis, Aircraft Control and
    Simulation, eq. 1.4-4."""
    roll, pitch, _ = logged.euler_rad.T
    p, q, r = logged.rate_radps.T
    level = q * np.sin(roll) + r * np.cos(roll)
    steep = np.maximum(np.abs(np.cos(pitch)), 1e-3) * np.where(np.cos(pitch) < 0.0, -1.0, 1.0)
    rates = (p + level * np.sin(pitch) / steep, q * np.cos(roll) - r * np.sin(roll), level / steep)
    return np.stack(rates, axis=1)
