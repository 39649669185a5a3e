"""How far a low pass of the logged path lags behind it: `filter_lag` along a log.

Of T dy/dt + y = x the lag y - x is -T times the low pass of dx/dt, so velocity and rates alone
tell it.  Between stamps they are cubics f, of which f - T f' + T^2 f'' - T^3 f''' is a low pass;
what the lag lacks of it at one stamp has decayed by exp(-h / T) at the next.
"""

from __future__ import annotations

from dataclasses import field
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from syncline_design.diagnosis.trajectory import SplinePieces, pieces
from syncline_design.effects.kinematics import rotate
from syncline_design.effects.record import Array
from syncline_design.logs.log import GAP_FACTOR, LogTrack, Rows
from syncline_design.machine.quick_dataclass import dataclass

MEMORY_S = 60.0  # of the past that is looked at
AHEAD = 12  # rows after a stamp that the spline up to it feels
KEPT = 8  # time constants whose lag is kept: those that are looked for at first, and a fit's own
FORGOTTEN = 1e-18  # share of the past that no longer counts


@dataclass(frozen=True, slots=True)
class _Splined:
    """Splines of the velocity and of dR/dt, and how every stretch of the latter begins to turn."""

    velocity: SplinePieces
    turning: SplinePieces
    turns: Array


@dataclass(frozen=True, slots=True)
class LoggedPast:
    """The motion of one stage up to some stamps at_s (n,) of its log.

    velocity: NED [m/s]; rotation, rate_radps: R_nb and body rates at stamps_s.  from_positions:
    the velocity is the slope of the antenna's smoothed places, of which y - x = -T dy/dt.
    """

    at_s: Array
    velocity: LogTrack
    stamps_s: Array
    rotation: Array
    rate_radps: Array
    from_positions: bool = False
    found: dict[float, tuple[Array, Array]] = field(default_factory=dict, compare=False, repr=False)
    splined: list[_Splined] = field(default_factory=list, compare=False, repr=False)

    def part(self, index: Rows) -> LoggedPast:
        """The same past at some of the stamps."""
        return LoggedPast(
            self.at_s[index],
            self.velocity,
            self.stamps_s,
            self.rotation,
            self.rate_radps,
            self.from_positions,
        )

    def stretch_starts_s(self) -> Array:
        """Stamps at which the logged motion begins, first and after every gap."""
        time_s = np.unique(self.velocity.time_s)
        step = np.diff(time_s)
        far = step > GAP_FACTOR * float(np.median(step)) if step.size else step > 0.0
        starts: Array = time_s[np.concatenate([[True], far])]
        return starts

    def __call__(self, time_constant_s: float) -> tuple[Array, Array]:
        """Lag of the place [m], NED, (n, 3), and of R_nb (n, 3, 3).

        A fit asks for the same constant again while it moves other figures.
        """
        if time_constant_s not in self.found:
            while len(self.found) >= KEPT:
                del self.found[next(iter(self.found))]
            self.found[time_constant_s] = self._lag(time_constant_s)
        return self.found[time_constant_s]

    def _lag(self, time_constant_s: float) -> tuple[Array, Array]:
        if self.from_positions:  # the slope of the smoothed places themselves, their arm included
            velocity = pieces(self.velocity.time_s, self.velocity.value)
            lag = -time_constant_s * velocity.value(self.at_s, self.at_s)
            return lag, np.zeros((self.at_s.shape[0], 3, 3))
        if not self.splined:
            self.splined.append(self._splined())
        (own,) = self.splined
        paths = _path_turns(own.velocity, time_constant_s)
        place = self._passed(own.velocity, paths, time_constant_s)
        turn = self._passed(own.turning, own.turns, time_constant_s).reshape(-1, 3, 3)
        return -time_constant_s * place, -time_constant_s * turn

    def _splined(self) -> _Splined:
        """What the lags of all time constants are taken of."""
        near = _needed(self.velocity.time_s, self.at_s)
        velocity = pieces(self.velocity.time_s[near], self.velocity.value[near])
        near = _needed(self.stamps_s, self.at_s)
        rotation, rate = self.rotation[near], self.rate_radps[near]
        turning = pieces(self.stamps_s[near], (rotation @ _skew(rate)).reshape(-1, 9))
        begun = near[np.searchsorted(self.stamps_s[near], turning.starts)]
        return _Splined(velocity, turning, rotate(self.rotation[begun], self.rate_radps[begun]))

    def _passed(self, series: SplinePieces, turns: Array, time_constant_s: float) -> Array:
        """Low pass (n, k) of a series; turns: how each stretch has been turning before it."""
        found = np.empty((self.at_s.shape[0], series.splines[0].c.shape[2]))
        first = np.searchsorted(self.at_s, series.starts[1:])
        bounds = [0, *first.tolist(), self.at_s.shape[0]]
        for piece, (a, b) in enumerate(pairwise(bounds)):
            if b > a:
                at = np.clip(self.at_s[a:b], series.starts[piece], series.ends[piece])
                spline = series.splines[piece]
                found[a:b] = _low_pass(spline, at, time_constant_s, turns[piece])
        return found


def _needed(time_s: Array, at_s: Array) -> NDArray[np.intp]:
    """Rows of a series that the past of some stamps is made of."""
    count = np.zeros(time_s.shape[0] + 1, dtype=np.int64)
    np.add.at(count, np.searchsorted(time_s, at_s - MEMORY_S), 1)
    last = np.searchsorted(time_s, at_s, side="right") + AHEAD
    np.add.at(count, np.minimum(last, time_s.shape[0]), -1)
    return np.flatnonzero(np.cumsum(count[:-1]) > 0)


def _path_turns(velocity: SplinePieces, time_constant_s: float) -> Array:
    """Turn of the path [rad/s], NED, at the start of each stretch, (m, 3)."""
    later = np.minimum(velocity.starts + time_constant_s, velocity.ends)
    here, there = (velocity.value(at, velocity.starts) for at in (velocity.starts, later))
    size = np.linalg.norm(here, axis=1) * np.linalg.norm(there, axis=1) * (later - velocity.starts)
    turn: Array = np.cross(here, there) / np.maximum(size, np.finfo(float).tiny)[:, None]
    return turn


def _skew(vector: Array) -> Array:
    """S(w) (n, 3, 3), S(w) u = w x u."""
    return np.swapaxes(np.cross(vector[:, None, :], np.eye(3)), 1, 2)


def _low_pass(spline: Any, at_s: Array, time_constant_s: float, turn: Array) -> Array:
    """Low pass (n, k) of a spline at stamps within it, that turned at `turn` before it began.

    What has long been turning at w has the low pass (1 + T S(w))^-1 f.
    """
    knots, whole = np.asarray(spline.x), np.asarray(spline.c)
    step = np.diff(knots)
    start = _settled(whole, np.zeros(step.shape), time_constant_s)
    stop = _settled(whole, step, time_constant_s)
    kept = np.exp(-step / time_constant_s)
    gained = stop - kept[:, None] * start
    turned = np.eye(3) + time_constant_s * _skew(turn[None])[0]
    first = np.linalg.solve(turned, whole[3, 0].reshape(3, -1)).ravel()
    state = _carried(np.append(0.0, kept), np.concatenate([first[None], gained]))
    index = np.clip(np.searchsorted(knots, at_s, side="right") - 1, 0, step.shape[0] - 1)
    after = at_s - knots[index]
    lacking = np.exp(-after / time_constant_s)[:, None] * (state[index] - start[index])
    found: Array = _settled(whole[:, index], after, time_constant_s) + lacking
    return found


def _settled(cubic: Array, after_s: Array, time_constant_s: float) -> Array:
    """f - T f' + T^2 f'' - T^3 f''' of cubics (4, n, k), some time after their knots."""
    third, second, first, value = cubic
    u, t = after_s[:, None], time_constant_s
    f = ((third * u + second) * u + first) * u + value
    slope = (3.0 * third * u + 2.0 * second) * u + first
    bend = 6.0 * third * u + 2.0 * second
    found: Array = f - t * (slope - t * (bend - t * 6.0 * third))
    return found


def _carried(kept: Array, gained: Array) -> Array:
    """y_k = kept_k y_(k-1) + gained_k, over ever more rows at once."""
    reach, factor, total = 1, kept.copy(), gained.copy()
    while reach < kept.shape[0] and float(np.max(factor)) > FORGOTTEN:
        earlier = np.concatenate([np.zeros((reach, total.shape[1])), total[:-reach]])
        total = total + factor[:, None] * earlier
        factor = factor * np.concatenate([np.zeros(reach), factor[:-reach]])
        reach *= 2
    return total
