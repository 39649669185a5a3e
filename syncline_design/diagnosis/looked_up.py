"""Rows put beside readings of other rows: what is left of a log if a device was late in some rows.

With D the device that is late by L in some rows, and d its reading,
    d(s) is what it measured at t = s - L(s).
Where D is late for a while, d(t + L) is in the log for most rows t of it, so that row t with d of
that stamp is sound: a place or an attitude is looked up between its neighbours (cubic spline) and
put beside all else of row t; a range and bearing is of one target, and the poses of t are looked up
for it.  Of single rows that are late among sound ones the sound neighbours say what D ought to
have told at t:
    e = p_s - p(t) (places),   (R_s - R(t)) q (angles),   p(t) + R(t) q - T (ranges and bearings),
q from the antenna to the object in the body.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import NDArray

from syncline_design.diagnosis.expected_noise import structure_of
from syncline_design.diagnosis.noise import as_specified, white_covariance
from syncline_design.diagnosis.scene import Scene, levers
from syncline_design.effects.kinematics import bearing, euler_to_rotation, rotate
from syncline_design.effects.record import ActsOn, Array
from syncline_design.logs.log import GAP_FACTOR
from syncline_design.logs.stamps import per_stamp, usual_step_s
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.distributions import chi_square_limit

LEAST_ROWS: Final = 5  # that are looked at
ROWS: Final = 200  # of more some
ENOUGH: Final = 0.6  # of the rows that are late, whose readings have to be found
STEEPEST: Final = 0.5  # that a delay grows or falls by, s in s
Mask = NDArray[np.bool_]
Index = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Weighed:
    """A log of one vehicle with the noise of its rows, as loud as the median row of some shows it.

    root (n, 3, 3) of the inverse of every row's covariance, zero where nothing is compared; square
    (n,) of every row over its noise, of `freedom` components; beside (n, 3): what the spec's own
    effects make of it [m].  louder: the variance of that noise over the spec's.
    """

    view: Scene
    root: Array
    square: Array
    freedom: Array
    beside: Array
    louder: float

    @classmethod
    def of(cls, view: Scene, among: Mask | None = None) -> Weighed:
        """among: the rows that say how loud it is; None: all."""
        error = np.nan_to_num(view.error())
        structure = structure_of(view)
        known = np.isfinite(view.log.truth_m)
        hidden = ~known
        covariance = white_covariance(structure, as_specified(structure))
        covariance = np.where(hidden[:, :, None] | hidden[:, None, :], 0.0, covariance)
        covariance += np.eye(3) * hidden[:, None, :]
        root = np.linalg.inv(np.linalg.cholesky(covariance)) * known[:, :, None]
        freedom = np.maximum(np.sum(known, axis=1), 1)
        square = np.sum(np.einsum("nij,nj->ni", root, error) ** 2, axis=1)
        over = square / chi_square_limit(0.5, freedom)
        louder = max(float(np.median(over if among is None else over[among])), 1.0)
        antenna_m = view.log.stages[0].antenna_m
        assert antenna_m is not None
        swung = rotate(euler_to_rotation(view.log.stages[0].euler_rad), vector_of(view))
        beside = error - np.nan_to_num(antenna_m + swung - view.log.truth_m)
        return cls(view, root / math.sqrt(louder), square / louder, freedom, beside, louder)

    @property
    def time_s(self) -> Array:
        return self.view.log.time_s


def vector_of(view: Scene) -> Array:
    """From the antenna to what is compared, in the body (n, 3)."""
    one, rows = view.log.stages[0], len(view.log)
    antenna, ranging = levers(view.system.stages[0], 0)
    if one.range_m is None or one.azimuth_rad is None or one.elevation_rad is None:
        level: Array = np.broadcast_to(-antenna, (rows, 3))
        return level
    beam = one.range_m[:, None] * bearing(one.azimuth_rad, one.elevation_rad)
    vector: Array = ranging - antenna + beam
    return vector


@dataclass(frozen=True, slots=True)
class LateRows:
    """Rows of which one device is late: of a while, or single ones among sound rows.

    elsewhere: rows that are no witness.  by_turns: whether single rows are all of a pattern.
    """

    of: Weighed
    inside: Mask
    elsewhere: Mask
    single: bool = False
    by_turns: bool = False

    @property
    def ends_s(self) -> tuple[float, float]:
        at = np.flatnonzero(self.inside)
        return float(self.of.time_s[at[0]]), float(self.of.time_s[at[-1]])


@dataclass(frozen=True, slots=True)
class _Course:
    """Delays at both ends of a while [s], evenly between them."""

    at_first_s: float
    at_last_s: float
    first_s: float
    last_s: float

    @property
    def _rate(self) -> float:
        """s in s; beyond STEEPEST readings would not come in the order that they were made in."""
        rate = (self.at_last_s - self.at_first_s) / max(self.last_s - self.first_s, 1e-9)
        return min(max(rate, -STEEPEST), STEEPEST)

    def measured_s(self, stamp_s: Array) -> Array:
        """When readings of these stamps were made."""
        late_s = self.at_first_s + self._rate * (stamp_s - self.first_s)
        made: Array = stamp_s - late_s
        return made

    def stamp_s(self, time_s: Array) -> Array:
        """Stamps of the readings that were made then."""
        late_s = self.at_first_s + self._rate * (time_s - self.first_s)
        stamps: Array = time_s + late_s / (1.0 - self._rate)
        return stamps


@dataclass(frozen=True, slots=True)
class _Series:
    """Places and turns (m, 12) along their stamps, to be looked up between them."""

    times_s: Array
    spline: Callable[[Array], Array]
    gap_s: float

    @classmethod
    def of(cls, time_s: Array, values: Array, gap_s: float) -> _Series | None:
        from scipy.interpolate import CubicSpline

        times, own = per_stamp(time_s, values)
        if len(times) < LEAST_ROWS:
            return None
        return cls(times, CubicSpline(times, own), gap_s)

    def covers(self, at_s: Array) -> Mask:
        """Whether a stamp lies between two that follow one another closely."""
        right = np.clip(np.searchsorted(self.times_s, at_s), 1, len(self.times_s) - 1)
        near = self.times_s[right] - self.times_s[right - 1] <= self.gap_s
        inside = (at_s >= self.times_s[0]) & (at_s <= self.times_s[-1])
        found: Mask = near & inside
        return found


@dataclass(frozen=True, slots=True)
class LookedUp:
    """What delays of a device leave of its late rows."""

    late: LateRows
    sensor: ActsOn
    poses: _Series
    turns: Array
    vector: Array

    @classmethod
    def of(cls, late: LateRows, sensor: ActsOn) -> LookedUp | None:
        """None where the log has too few readings."""
        log = late.of.view.log
        one = log.stages[0]
        assert one.antenna_m is not None
        turns = euler_to_rotation(one.euler_rad)
        kept = ~late.elsewhere
        if late.single:
            kept &= ~late.inside
        elif sensor != "ranging":
            kept = late.inside
        series = np.hstack([one.antenna_m, turns.reshape(len(log), 9)])[kept]
        poses = _Series.of(log.time_s[kept], series, GAP_FACTOR * usual_step_s(log.time_s))
        return None if poses is None else cls(late, sensor, poses, turns, vector_of(late.of.view))

    @property
    def _by_stamp(self) -> bool:
        """Whether the rows that are put right are those that are late."""
        return self.late.single or self.sensor == "ranging"

    def _at_s(self, delays: Array, time_s: Array) -> Array:
        course = _Course(float(delays[0]), float(delays[-1]), *self.late.ends_s)
        return course.measured_s(time_s) if self._by_stamp else course.stamp_s(time_s)

    def rows(self, delays: Array) -> Index | None:
        """Whose error delays make known, [s] at both ends or one; None of too few."""
        rows = self.known(delays, self.late.inside if self._by_stamp else ~self.late.elsewhere)
        if len(rows) < max(ENOUGH * float(np.sum(self.late.inside)), LEAST_ROWS):
            return None
        return rows[:: max(1, len(rows) // ROWS)]

    def known(self, delays: Array, of: Mask) -> Index:
        """Those of some rows that have their readings in the log."""
        return np.flatnonzero(self.poses.covers(self._at_s(delays, self.late.of.time_s)) & of)

    def left(self, delays: Array, rows: Index) -> Array:
        """Errors over their noise (n, 3), of two readings that of both."""
        weighed = self.late.of
        log, turns, vector = weighed.view.log, self.turns[rows], self.vector[rows]
        looked = self.poses.spline(self._at_s(delays, log.time_s[rows]))
        place, turned = looked[:, :3], looked[:, 3:].reshape(-1, 3, 3)
        antenna_m = log.stages[0].antenna_m
        assert antenna_m is not None
        if self.late.single and self.sensor != "ranging":
            twice = antenna_m[rows] - place
            if self.sensor == "attitude":
                twice = rotate(turns - turned, vector)
            error = twice / math.sqrt(2.0)
        else:
            place = antenna_m[rows] if self.sensor == "attitude" else place
            turned = turns if self.sensor == "position" else turned
            error = np.nan_to_num(place + rotate(turned, vector) - log.truth_m[rows])
            error = error + weighed.beside[rows]
        found: Array = np.einsum("nij,nj->ni", weighed.root[rows], error)
        return found

    def mean_square(self, delays: Array) -> float:
        """Of the rows; infinite where nothing is told."""
        rows = self.rows(delays)
        return math.inf if rows is None else float(np.sum(self.left(delays, rows) ** 2)) / len(rows)

    def components(self, rows: Index) -> int:
        """How many are compared in some rows."""
        return int(np.sum(np.isfinite(self.late.of.view.log.truth_m[rows])))
