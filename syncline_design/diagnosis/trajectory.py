"""The vehicle's motion around every stamp, from the logged velocity and rates.

Displacements integrate a spline of the velocity and turns integrate a spline of the rates.  Poses
themselves are never interpolated: averaging two noisy neighbours would make noise depend on the
time shift, and a fit would prefer shifts half way between rows.
"""

from __future__ import annotations

from dataclasses import field, replace
from functools import lru_cache
from itertools import pairwise
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from syncline_design.diagnosis.recent import Recent
from syncline_design.effects.record import ActsOn, Array
from syncline_design.logs.log import GAP_FACTOR
from syncline_design.logs.smoothing import LEAST_SMOOTHED, MOST_TRIED, Smoothing, penalty
from syncline_design.logs.stamps import per_stamp
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.simulation.chain import rotation_exp

Index = NDArray[np.int64]
NEAR_S = 5.0  # of a series around the stamps, that their slopes rest on
SHIFTS = 48  # of the stamps, whose turns and displacements are kept, and what they are made of
FAR_S = 1.5  # beyond such shifts poses are looked up, not carried along


@dataclass(frozen=True, slots=True)
class SplinePieces:
    """Cubic splines of a series (n, k), one per stretch without a gap.

    Beyond a stretch's ends the values there are held.  All stretches are one table of polynomials
    in (t - knot): coefficients (m, 4, k) and those of the antiderivative (m, 5, k), highest power
    first; first, last: intervals of each stretch.
    """

    starts: Array  # first stamp of each stretch
    ends: Array
    first: Index
    last: Index
    knots_s: Array
    values: Array
    integrals: Array
    splines: tuple[Any, ...]

    def value(self, at_s: Array, home_s: Array) -> Array:
        """Series at times at_s (n,), each in the stretch of its home stamp."""
        stretch = self._stretch(home_s)
        inside = np.clip(at_s, self.starts[stretch], self.ends[stretch])
        return self._evaluated(self.values, inside, stretch)

    def integral(self, from_s: Array, to_s: Array, home_s: Array) -> Array:
        """Integral of the series from from_s to to_s, in the stretch of the home stamp."""
        return self.summed(to_s, home_s) - self.summed(from_s, home_s)

    def summed(self, at_s: Array, home_s: Array) -> Array:
        """Integral of the series up to at_s, but for a constant of the home stamp's stretch."""
        return self._summed(at_s, self._stretch(home_s))

    def slope(self, at_s: Array, home_s: Array) -> Array:
        """First derivative of the series."""
        slopes = self.values[:, :-1] * np.array([3.0, 2.0, 1.0])[:, None]
        return self._evaluated(slopes, at_s, self._stretch(home_s))

    def bend(self, at_s: Array, home_s: Array) -> Array:
        """Second derivative of the series."""
        bends = self.values[:, :-2] * np.array([6.0, 2.0])[:, None]
        return self._evaluated(bends, at_s, self._stretch(home_s))

    def _stretch(self, home_s: Array) -> Index:
        return np.maximum(np.searchsorted(self.starts, home_s, side="right") - 1, 0)

    def _summed(self, at_s: Array, stretch: Index) -> Array:
        inside = np.clip(at_s, self.starts[stretch], self.ends[stretch])
        total = self._evaluated(self.integrals, inside, stretch)
        beyond = at_s - inside
        if np.any(beyond):
            total += beyond[:, None] * self._evaluated(self.values, inside, stretch)
        return total

    def _evaluated(self, coefficients: Array, at_s: Array, stretch: Index) -> Array:
        found = np.searchsorted(self.knots_s, at_s, side="right") - 1
        interval = np.clip(found, self.first[stretch], self.last[stretch])
        off = (at_s - self.knots_s[interval])[:, None]
        own = coefficients[interval]
        total: Array = own[:, 0]
        for power in range(1, own.shape[1]):
            total = total * off + own[:, power]
        return total


def pieces(time_s: Array, series: Array) -> SplinePieces:
    """Splines of a series (n, k) over rising stamps, cut at gaps; one value a stamp, the mean."""
    both = (np.ascontiguousarray(values, dtype=float).tobytes() for values in (time_s, series))
    return _pieces(*both, series.shape[1])


@lru_cache(maxsize=8)  # the same velocities and rates, whichever gross fault is undone
def _pieces(time_bytes: bytes, series_bytes: bytes, width: int) -> SplinePieces:
    from scipy.interpolate import CubicSpline

    series = np.frombuffer(series_bytes).reshape(-1, width)
    time_s, series = per_stamp(np.frombuffer(time_bytes), series)
    step = np.diff(time_s)
    cuts = np.flatnonzero(step > GAP_FACTOR * np.median(step)) + 1
    bounds = [0, *cuts.tolist(), time_s.shape[0]]
    splines, starts, ends = [], [], []
    for a, b in pairwise(bounds):
        times, values = time_s[a:b], series[a:b]
        if b - a == 1:  # a lone row: constant
            times = np.array([times[0], times[0] + 1.0])
            values = np.repeat(values, 2, axis=0)
        splines.append(CubicSpline(times, values, bc_type="not-a-knot" if b - a > 3 else "natural"))
        starts.append(time_s[a])
        ends.append(time_s[b - 1])
    counts = np.cumsum([0, *(s.c.shape[1] for s in splines)])
    return SplinePieces(
        np.array(starts),
        np.array(ends),
        counts[:-1],
        counts[1:] - 1,
        np.concatenate([s.x[:-1] for s in splines]),
        _by_interval([s.c for s in splines]),
        _by_interval([s.antiderivative().c for s in splines]),
        tuple(splines),
    )


def _by_interval(coefficients: list[Array]) -> Array:
    """Coefficients (m, powers, k) of all intervals, those of one side by side in memory."""
    return np.ascontiguousarray(np.moveaxis(np.concatenate(coefficients, axis=1), 0, 1))


def smooth_slope(time_s: Array, series: Array, at_s: Array) -> Array:
    """Slope of a noisy series (n, k) at some stamps, by smoothing splines, one per stretch.

    Noise in a regressor makes its effect too small (errors in variables), and slopes from row to
    row are mostly noise.  A spline minimises sum (y - f)^2 + lambda int f''^2; lambda is the one by
    which every second row best foretells the others, so a series without noise keeps its slope.
    Source: Craven and Wahba, Numerische Mathematik 31 (1979), for cross-validation.
    """
    return _smooth(time_s, series, at_s, "slope")


def smooth_bend(time_s: Array, series: Array, at_s: Array, part: Array | None = None) -> Array:
    """Second derivative of the same splines: the acceleration of places.

    That of a velocity which was itself derived of the places would be hardly smoothed at all: its
    noise is alike from row to row, so that it foretells every second row as motion does.  part
    (n, k): what a part of the series, as its noise, is worth in it.
    """
    return _smooth(time_s, series, at_s, "bend", part)


Derivative = Literal["slope", "bend"]


def _smooth(
    time_s: Array, series: Array, at_s: Array, wanted: Derivative, part: Array | None = None
) -> Array:
    """A derivative of the series, or of a part of it by the smoothness of the whole."""
    near = np.searchsorted(at_s, time_s + NEAR_S) > np.searchsorted(at_s, time_s - NEAR_S)
    taken = series if part is None else part
    asked = (time_s[near], series[near], taken[near], at_s)
    keys = (np.ascontiguousarray(v).tobytes() for v in asked)
    return _smoothed(*keys, series.shape[1], wanted).copy()


@lru_cache(maxsize=8)  # the scene of one log is set many times, each gross fault once
def _smoothed(
    time_bytes: bytes,
    series_bytes: bytes,
    taken_bytes: bytes,
    at_bytes: bytes,
    width: int,
    wanted: Derivative,
) -> Array:
    rows_s, at_s = np.frombuffer(time_bytes), np.frombuffer(at_bytes)
    time_s, series = per_stamp(rows_s, np.frombuffer(series_bytes).reshape(-1, width))
    _, taken = per_stamp(rows_s, np.frombuffer(taken_bytes).reshape(-1, width))
    exact = pieces(time_s, taken)
    found = (exact.slope if wanted == "slope" else exact.bend)(at_s, at_s)
    step = np.diff(time_s)
    cuts = np.flatnonzero(step > GAP_FACTOR * np.median(step)) + 1
    bounds = [0, *cuts.tolist(), time_s.shape[0]]
    longest = max(pairwise(bounds), key=lambda ends: ends[1] - ends[0])
    chosen = slice(longest[0], min(longest[1], longest[0] + MOST_TRIED))
    for k in range(width):
        lam = penalty(time_s[chosen], series[chosen, k])
        for a, b in pairwise(bounds) if lam else ():
            own = (at_s >= time_s[a]) & (at_s <= time_s[b - 1])
            if b - a >= LEAST_SMOOTHED and np.any(own):
                smooth = Smoothing(time_s[a:b], at_s[own])
                of = smooth.slopes if wanted == "slope" else smooth.bends
                found[own, k] = of(taken[a:b, k], lam)
    return found


@dataclass(frozen=True, slots=True)
class LoggedMotion:
    """Motion of one stage: velocity [m/s] in NED and rate [rad/s] in the body, as functions.

    stamps_s, attitude (m,), (m, 3, 3): the logged poses, for shifts of many rows.
    follows_position, follows_attitude: the velocity carries the stamps of the positions, the rate
    those of the attitudes, so that they are late by what these are late by.
    """

    time_s: Array
    velocity: SplinePieces
    rate: SplinePieces
    stamps_s: Array
    attitude: Array
    follows_position: bool = False
    follows_attitude: bool = False
    recent: Recent = field(default_factory=lambda: Recent(SHIFTS), repr=False, compare=False)

    def at(self, time_s: Array) -> LoggedMotion:
        """The same motion, asked about at other stamps."""
        return replace(self, time_s=time_s, recent=Recent(SHIFTS))

    def keeping_time(self, sensor: ActsOn) -> LoggedMotion:
        """The same motion, its columns not as late as the poses of a sensor are."""
        own = replace(self, recent=Recent(SHIFTS))
        if sensor == "position":
            return replace(own, follows_position=False)
        return replace(own, follows_attitude=False)

    def displacement(self, from_s: Array, to_s: Array, position_shift_s: Array) -> Array:
        """p(to) - p(from) [m], NED, (n, 3)."""
        own = position_shift_s if self.follows_position else np.zeros(1)
        start_s, stop_s = from_s - own, to_s - own
        return self.recent.of(
            ("displacement", start_s.tobytes(), stop_s.tobytes()),
            lambda: self._passed("velocity", start_s, stop_s),
        )

    def _passed(self, what: Literal["velocity", "rate"], from_s: Array, to_s: Array) -> Array:
        """Integral of a series between two times of every stamp; one of them was asked before."""
        series: SplinePieces = getattr(self, what)

        def summed(at_s: Array) -> Array:
            asked = (what, "summed", at_s.tobytes())
            return self.recent.of(asked, lambda: series.summed(at_s, self.time_s))

        return summed(to_s) - summed(from_s)

    def _rate(self, at_s: Array) -> Array:
        asked = ("rate", at_s.tobytes())
        return self.recent.of(asked, lambda: self.rate.value(at_s, self.time_s))

    def turn(self, from_s: Array, to_s: Array) -> Array:
        """Rotation vector theta [rad], R(to) = R(from) exp(S(theta)), (n, 3).

        Magnus series to second order: the integral of w plus h^2/12 w(from) x w(to).
        Source: Iserles et al., Lie-group methods, Acta Numerica 9 (2000), sec. 4.
        """
        first = self._passed("rate", from_s, to_s)
        start, stop = self._rate(from_s), self._rate(to_s)
        second: Array = ((to_s - from_s) ** 2 / 12.0)[:, None] * np.cross(start, stop)
        return first + second

    def turned(self, rotation: Array, from_s: Array, to_s: Array, attitude_shift_s: Array) -> Array:
        """R(to) from R(from) (n, 3, 3)."""
        if np.array_equal(from_s, to_s):
            return rotation
        if self.follows_attitude:
            from_s, to_s = from_s - attitude_shift_s, to_s - attitude_shift_s
        if float(np.max(np.abs(to_s - from_s))) > FAR_S:
            return self._far(to_s)
        carried: Array = rotation @ self._carried(from_s, to_s)
        return carried

    def _carried(self, from_s: Array, to_s: Array) -> Array:
        """exp(S(theta)), (n, 3, 3)."""
        return self.recent.of(
            ("turn", from_s.tobytes(), to_s.tobytes()),
            lambda: rotation_exp(self.turn(from_s, to_s)),
        )

    def _far(self, to_s: Array) -> Array:
        """R(to) from the logged pose next to it; over many seconds the series does not hold."""
        middle = 0.5 * (self.stamps_s[1:] + self.stamps_s[:-1])
        near = np.searchsorted(middle, to_s)
        carried: Array = self.attitude[near] @ rotation_exp(self.turn(self.stamps_s[near], to_s))
        return carried
