"""A path through knots, and what a low pass makes of it.

The low pass T dy/dt + y = x of an antenna at R l on the vehicle, x = p + R l, lags by
e = y - x, with de/dt = -e / T - dx/dt.  Linear in (p, R): a lag of the place (3) and one of the
attitude's matrix (9), kept side by side, so that any arm l has its lag.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from syncline_design.effects.kinematics import rotate
from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.simulation.chain import rotation_exp, screw_displacement

_SMALL = 0.3  # h / T below which the closed weights would cancel
_TERMS = 12  # of their series: 0.3**12 / 13! is 1e-16


@dataclass(frozen=True, slots=True)
class End:
    """A file's first or last row: when, where, velocity [m/s] and turn of the path [rad/s], NED."""

    time_s: float
    position_m: Array
    velocity_mps: Array
    turn_radps: Array

    def path(self, time_s: Array, derivative: int) -> Array:
        """Position, velocity or acceleration (n, 3) where this velocity has always turned so."""
        away_s = time_s - self.time_s
        velocity, turn = (
            np.broadcast_to(one, (away_s.shape[0], 3))
            for one in (self.velocity_mps, self.turn_radps)
        )
        if derivative == 0:
            moved: Array = self.position_m + screw_displacement(velocity, turn, away_s)
            return moved
        here = rotate(rotation_exp(turn * away_s[:, None]), velocity)
        return here if derivative == 1 else np.cross(turn, here)


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """A path through knots: cubic Hermite in position, constant body rate between knots.

    time_s (k,) rising; position_m, velocity_mps (k, 3) NED; rotation (k, 3, 3) R_nb;
    turn_rad (k - 1, 3): rotation vector from each knot to the next, body axes.
    sight: range_m, azimuth_rad, elevation_rad (k,) where the file has them.
    period_s: after which a manoeuvre that goes on for ever has velocity and attitude again.
    Times beyond the knots are those of later or earlier periods; before a file begins and after it
    ends, speed and both turns (of the path, of the body) are those of its end.
    """

    time_s: Array
    position_m: Array
    velocity_mps: Array
    rotation: Array
    turn_rad: Array
    sight: tuple[Array, Array, Array] | None = None
    period_s: float | None = None

    def locate(self, time_s: Array) -> tuple[NDArray[np.intp], Array, Array]:
        """(interval, fraction 0 to 1, its length [s]) of each time; of a file also beyond."""
        if self.period_s is not None:
            time_s = time_s - self.period_s * self._periods(time_s)
        index = np.searchsorted(self.time_s, time_s, side="right") - 1
        index = np.clip(index, 0, self.time_s.shape[0] - 2)
        length = self.time_s[index + 1] - self.time_s[index]
        return index, (time_s - self.time_s[index]) / length, length

    def position(self, time_s: Array, derivative: int = 0) -> Array:
        """Position [m] (or its first or second derivative by time), NED, (n, 3)."""
        found = self.within(*self.locate(time_s), derivative)
        if self.period_s is not None:
            if derivative == 0 and np.any(periods := self._periods(time_s)):
                found += periods[:, None] * self._advance()
            return found
        for last, beyond in ((False, time_s < self.time_s[0]), (True, time_s > self.time_s[-1])):
            if np.any(beyond):
                found[beyond] = self.end(last).path(time_s[beyond], derivative)
        return found

    def _periods(self, time_s: Array) -> Array:
        """How many whole periods of a manoeuvre each time lies beyond the knots, (n,)."""
        assert self.period_s is not None
        after = np.ceil((time_s - self.time_s[-1]) / self.period_s)
        before = np.floor((time_s - self.time_s[0]) / self.period_s)
        whole: Array = np.maximum(after, 0.0) + np.minimum(before, 0.0)
        return whole

    def _advance(self) -> Array:
        """By how much a period of a manoeuvre moves the vehicle [m], (3,)."""
        assert self.period_s is not None
        ends = self.time_s[0] + np.array([0.0, self.period_s])
        first, last = self.within(*self.locate(ends))
        moved: Array = last - first
        return moved

    def end(self, last: bool) -> End:
        """How a file begins or ends; the turn of its path is v x a / |v|^2."""
        at = -1 if last else 0
        here = self.time_s[at:] if last else self.time_s[:1]
        inside = np.array([np.mean(self.time_s[-3:-1] if last else self.time_s[1:3])])
        moving = self.position(inside, 1)[0]  # slopes at the end itself are one-sided
        speed2 = max(float(moving @ moving), np.finfo(float).tiny)
        return End(
            float(here[0]),
            self.position_m[at],
            self.position(here, 1)[0],
            np.cross(moving, self.acceleration(inside)[0]) / speed2,
        )

    def within(
        self, index: NDArray[np.intp], u: Array, length: Array, derivative: int = 0
    ) -> Array:
        """`position` at the fraction u of intervals of these lengths."""
        weights = _hermite(u, derivative)
        h = length[:, None]
        p0, p1 = self.position_m[index], self.position_m[index + 1]
        v0, v1 = self.velocity_mps[index], self.velocity_mps[index + 1]
        value = weights[0] * (p0 - p1) + h * (weights[1] * v0 + weights[2] * v1)
        if derivative == 0:
            value += p1
        scaled: Array = value / h**derivative
        return scaled

    def attitude(self, time_s: Array) -> Array:
        """R_nb, (n, 3, 3)."""
        index, u, _ = self.locate(time_s)
        turned: Array = self.rotation[index] @ rotation_exp(self.turn_rad[index] * u[:, None])
        return turned

    def acceleration(self, time_s: Array) -> Array:
        """Acceleration [m/s2], NED, (n, 3): what the velocity gains from knot to knot.

        The second derivative of the interpolant jumps at the knots and is no acceleration there.
        """
        middle = 0.5 * (self.time_s[:-1] + self.time_s[1:])
        gained = np.diff(self.velocity_mps, axis=0) / np.diff(self.time_s)[:, None]
        return np.stack([np.interp(time_s, middle, axis) for axis in gained.T], axis=-1)

    def rate(self, time_s: Array) -> Array:
        """Body rate [rad/s], (n, 3)."""
        index, _, length = self.locate(time_s)
        rate: Array = self.turn_rad[index] / length[:, None]
        return rate


def _hermite(u: Array, derivative: int) -> tuple[Array, Array, Array]:
    """Weights of p0 - p1, h v0, h v1 in the cubic Hermite interpolant, (n, 1) each."""
    u = u[:, None]
    if derivative == 0:
        return 1 + u * u * (2 * u - 3), u * (1 - u) ** 2, u * u * (u - 1)
    if derivative == 1:
        return 6 * u * (u - 1), (1 - u) * (1 - 3 * u), u * (3 * u - 2)
    return 12 * u - 6, 6 * u - 4, 6 * u - 2


def lagged(track: Track, time_s: Array, time_constant_s: float) -> tuple[Array, Array]:
    """Lag of the place [m] (n, 3) and of the attitude's matrix (n, 3, 3), NED, at these times.

    Before a file begins, the turn at its first row is the past; a manoeuvre goes on for ever.
    """
    if time_constant_s <= 0.0:
        return np.zeros((time_s.shape[0], 3)), np.zeros((time_s.shape[0], 3, 3))
    index, fraction, length = track.locate(time_s)
    state = _states(track, time_constant_s)[index]
    found = _passed(track, index, fraction * length, state, time_constant_s)
    return found[:, :3], found[:, 3:].reshape(-1, 3, 3)


@lru_cache(maxsize=4)
def _states(track: Track, time_constant_s: float) -> Array:
    """The lag (k, 12) at each knot."""
    every = np.arange(track.time_s.shape[0] - 1)
    length = np.diff(track.time_s)
    gained = _passed(track, every, length, np.zeros((every.shape[0], 12)), time_constant_s)
    kept = np.exp(-length / time_constant_s)
    states = np.zeros((every.shape[0] + 1, 12))
    if track.period_s is None:
        states[0] = _first(track, time_constant_s)
    for at in every:
        states[at + 1] = kept[at] * states[at] + gained[at]
    if track.period_s is not None:
        states += _settled(track, states, time_constant_s)
    return states


def _settled(track: Track, states: Array, time_constant_s: float) -> Array:
    """What a lag that began at zero lacks of the one that returns after each period, (k, 12)."""
    assert track.period_s is not None
    end = track.time_s[:1] + track.period_s
    index, fraction, length = track.locate(end)
    after = _passed(track, index, fraction * length, states[index], time_constant_s)
    first = after[0] / -math.expm1(-track.period_s / time_constant_s)
    lost: Array = np.exp(-(track.time_s - track.time_s[0]) / time_constant_s)[:, None] * first
    return lost


def _first(track: Track, time_constant_s: float) -> Array:
    """The lag (12,) at the first row of a file; its turn there is taken for the past.

    The velocity has been turning at v x a / |v|^2 and the body at w, for long: what they leave is
    -T (1 + T S(turn))^-1 v, never more than T |v|, and -T R (1 + T S(w))^-1 S(w).
    """
    end, rate = track.end(last=False), skew(track.rate(track.time_s[:1]))[0]
    one = np.eye(3)
    turn = skew(end.turn_radps[None, :])[0]
    place = np.linalg.solve(one + time_constant_s * turn, end.velocity_mps)
    attitude = track.rotation[0] @ np.linalg.solve(one + time_constant_s * rate, rate)
    return -time_constant_s * np.concatenate([place, attitude.ravel()])


def _passed(
    track: Track, index: NDArray[np.intp], after_s: Array, state: Array, time_constant_s: float
) -> Array:
    """The lag (n, 12) some time after knots at which it is `state`, before the next knots.

    e(s) = exp(-s / T) e(0) - integral of exp(-(s - u) / T) dx/dt(u) du over 0..s, dx/dt a
    parabola through its values at 0, s / 2 and s: exact for the place, a cubic between knots.
    """
    share = after_s / time_constant_s
    whole, first, second = _moments(share)
    weights = (whole - 3 * first + 2 * second, 4 * (first - second), 2 * second - first)
    found = np.exp(-share)[:, None] * state
    for part, weight in zip((0.0, 0.5, 1.0), weights, strict=True):
        slope = _slope(track, index, part * after_s)
        found -= time_constant_s * weight[:, None] * slope
    return found


def _moments(share: Array) -> tuple[Array, Array, Array]:
    """a times the integral of exp(-a (1 - u)) u^j du over 0..1, j = 0, 1, 2."""
    small = share < _SMALL
    safe = np.where(small, 1.0, share)
    whole = -np.expm1(-share)
    first = 1.0 - whole / safe
    closed = (whole, first, 1.0 - 2.0 * first / safe)
    few = np.where(small, share, 0.0)
    series = [
        few * math.factorial(j)
        * sum((-few) ** n / math.factorial(n + j + 1) for n in range(_TERMS))
        for j in range(3)
    ]  # fmt: skip
    return tuple(np.where(small, s, c) for s, c in zip(series, closed, strict=True))  # type: ignore[return-value]


def _slope(track: Track, index: NDArray[np.intp], after_s: Array) -> Array:
    """Slopes by time of place and attitude's matrix (n, 12), this long after these knots."""
    length = track.time_s[index + 1] - track.time_s[index]
    fraction = after_s / length
    rotation = track.rotation[index] @ rotation_exp(track.turn_rad[index] * fraction[:, None])
    turning = rotation @ skew(track.turn_rad[index] / length[:, None])
    place = track.within(index, fraction, length, 1)
    return np.concatenate([place, turning.reshape(-1, 9)], axis=1)


def skew(vector: Array) -> Array:
    """S(v), (n, 3) -> (n, 3, 3)."""
    x, y, z = vector.T
    zero = np.zeros_like(x)
    return np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1).reshape(-1, 3, 3)
