"""Two trajectories whose frames nothing relates, laid onto each other; what that hides is said.

A turn about down and a shift (where neither says which way is down, any turn; where both know
north, none) by least squares, in which far points count less.  It begins at the lever arm that the
spec states.  Where a delay or a component of another lever arm clearly shows, that one is fitted
along, so that what the diagnosis is to find does not go into the frames (to first order: a lever
turning during the delay does); only turn and shift are used.  Components that do not show stay as
stated: on a vehicle that never tilts, a lever arm down and a shift down are one, and a free one
would scatter the other.  Turn and shift take up what is constant between the two, which can no
longer be found.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final, Literal

import numpy as np

from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import to_digits

Turns = Literal["none", "heading", "any"]
FREE: Final[Mapping[Turns, int]] = {"none": 0, "heading": 1, "any": 3}
ROUNDS: Final = 12
FAR: Final = 2.0  # usual distances from which a point counts less
ONE_FRAME: Final = 0.05  # of the extent: places as near as this stand in one frame already
LEAST_POINTS: Final = 10
LEAST_EXTENT_M: Final = 0.5
FALLS: Final = 0.05  # by this share the squares have to fall before delay or lever is fitted along
CLEARLY: Final = 15.0  # and by this many times what noise alone would do for each figure
BESIDE: Final = 4  # figures beside turn and shift: the delay, the lever arm's components
NO_ARM: Final = np.zeros(3)


class StillError(Exception):
    """The motion does not tell how two frames stand to each other; says why."""


@dataclass(frozen=True, slots=True)
class Laid:
    """How one trajectory came onto the other: x -> turn x + shift."""

    turn: Array
    shift_m: Array
    rms_m: float
    extent_m: float
    delay_s: float = 0.0  # by which the second come after the first, where that clearly shows

    @property
    def heading_rad(self) -> float:
        return math.atan2(float(self.turn[1, 0]), float(self.turn[0, 0]))

    @property
    def tilt_rad(self) -> float:
        return math.acos(float(np.clip(self.turn[2, 2], -1.0, 1.0)))


@dataclass(frozen=True, slots=True)
class LaidTrack:
    """What is laid: places (n, 3), velocities (n, 3), body axes (n, 3, 3) or none."""

    place: Array
    velocity: Array
    body: Array | None


def laid(moved: LaidTrack, onto: Array, turns: Turns, arm_m: Array = NO_ARM) -> Laid | None:
    """The turn and shift that bring the first places onto the second (n, 3), pair by pair.

    arm_m (3,): the stated lever arm of the second on the first's body, forward, right, down.

    None where they are in one frame already; StillError where the motion cannot tell the turn.
    Begun by Kabsch's solution (Umeyama, IEEE PAMI 13 (1991), without scale); then Gauss-Newton of
    onto = turn (place - delay velocity + body lever) + shift, with Huber's weights.
    """
    known = np.isfinite(moved.place).all(axis=1) & np.isfinite(onto).all(axis=1)
    known &= np.isfinite(moved.velocity).all(axis=1)
    if moved.body is not None:
        known &= np.isfinite(moved.body).all(axis=(1, 2))
    b = onto[known]
    if b.shape[0] < LEAST_POINTS:
        raise StillError(f"only {b.shape[0]} common positions")
    body = None if moved.body is None else moved.body[known]
    own = LaidTrack(moved.place[known], moved.velocity[known], body)
    extent = _rms(b - b.mean(axis=0))
    if _rms(own.place - b) < max(ONE_FRAME * extent, ONE_FRAME * LEAST_EXTENT_M):
        return None
    if extent < LEAST_EXTENT_M and turns != "none":
        raise StillError(f"the positions extend over {to_digits(extent, 2)} m")
    begun = _kabsch(own.place, b, turns)
    best = _shown(own, b, begun, turns, arm_m)
    return Laid(best.turn, best.shift_m, best.rms_m, extent, best.delay_s)


def _shown(
    own: LaidTrack, onto: Array, begun: tuple[Array, Array], turns: Turns, arm_m: Array
) -> _Fit:
    """The fit with those figures beside turn and shift that clearly show, one after the other."""
    start = np.concatenate([[0.0], arm_m])
    left = list(range(1 if own.body is None else BESIDE))
    free: tuple[int, ...] = ()
    best = _fitted(own, onto, begun, turns, start, free)
    while left:
        trials = {k: _fitted(own, onto, begun, turns, start, (*free, k)) for k in left}
        k = min(trials, key=lambda one: trials[one].squares)
        fell = best.squares - trials[k].squares
        noise = trials[k].squares / (3 * onto.shape[0])
        if fell <= FALLS * best.squares or fell <= CLEARLY * noise:
            break
        best, free = trials[k], (*free, k)
        left.remove(k)
    return best


@dataclass(frozen=True, slots=True)
class _Fit:
    turn: Array
    shift_m: Array
    squares: float  # of what is left, far points weighted down
    rms_m: float
    delay_s: float


def _fitted(
    own: LaidTrack, onto: Array, begun: tuple[Array, Array], turns: Turns, start: Array,
    free: tuple[int, ...],
) -> _Fit:  # fmt: skip
    """Gauss-Newton with these figures free beside turn and shift; start: delay and lever arm."""
    turn, shift = begun
    extra = start.copy()
    count = FREE[turns]
    figures = [*range(count + 3), *(count + 3 + k for k in free)]
    rest, weight = onto, np.ones(onto.shape[0])
    for _ in range(ROUNDS):
        local, slope = _slope(own, turn, extra, count)
        rest = onto - local - shift
        apart = np.linalg.norm(rest, axis=1)
        usual = max(float(np.median(apart)), 1e-9)
        weight = np.minimum(1.0, FAR * usual / np.maximum(apart, 1e-12))
        step = _step(slope[:, :, figures], rest, weight)
        axis = np.concatenate([np.zeros(3 - count), step[:count]])  # the last is about down
        turn, shift = _small(axis) @ turn, shift + step[count : count + 3]
        extra[list(free)] += step[count + 3 :]
    squares = float(np.sum(weight * np.sum(rest**2, axis=1)))
    return _Fit(turn, shift, squares, _rms(rest), float(extra[0]))


def _rms(apart: Array) -> float:
    return float(np.sqrt(np.mean(np.sum(apart**2, axis=1))))


def _kabsch(a: Array, b: Array, turns: Turns) -> tuple[Array, Array]:
    middle_a, middle_b = a.mean(axis=0), b.mean(axis=0)
    cross = (a - middle_a).T @ (b - middle_b)
    turn = np.eye(3)
    if turns == "any":
        u, _, v = np.linalg.svd(cross)
        flip = np.diag([1.0, 1.0, np.sign(np.linalg.det(v.T @ u.T))])
        turn = v.T @ flip @ u.T
    elif turns == "heading":
        angle = math.atan2(cross[0, 1] - cross[1, 0], cross[0, 0] + cross[1, 1])
        c, s = math.cos(angle), math.sin(angle)
        turn[:2, :2] = [[c, -s], [s, c]]
    return turn, middle_b - turn @ middle_a


def _slope(own: LaidTrack, turn: Array, extra: Array, count: int) -> tuple[Array, Array]:
    """The turned places with delay and lever, (n, 3), and how they move with every figure.

    Figures: turn (as many as are free), shift (3), delay, lever (3).
    """
    a = own.place
    axes = np.zeros((a.shape[0], 3, 3)) if own.body is None else turn @ own.body
    swept = own.velocity @ turn.T
    local = a @ turn.T - extra[0] * swept + axes @ extra[1:]
    x, y, z = local.T
    zero = np.zeros_like(x)
    spin = np.stack(
        [np.stack([zero, -z, y], 1), np.stack([z, zero, -x], 1), np.stack([-y, x, zero], 1)], 2
    )
    turned = spin[:, :, 3 - count :]
    shift = np.broadcast_to(np.eye(3), (a.shape[0], 3, 3))
    return local, np.concatenate([turned, shift, -swept[:, :, None], axes], axis=2)


def _step(slope: Array, rest: Array, weight: Array) -> Array:
    """One step of all figures by weighted least squares; what nothing tells stays."""
    normal = np.einsum("nki,n,nkj->ij", slope, weight, slope)
    right = np.einsum("nki,n,nk->i", slope, weight, rest)
    scale = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    found: Array = np.linalg.lstsq(normal / np.outer(scale, scale), right / scale, rcond=1e-10)[0]
    return found / scale


def _small(axis: Array) -> Array:
    """The rotation by a vector [rad] (Rodrigues)."""
    angle = float(np.linalg.norm(axis))
    if angle < 1e-15:
        return np.eye(3)
    x, y, z = axis / angle
    k = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    found: Array = np.eye(3) + math.sin(angle) * k + (1.0 - math.cos(angle)) * (k @ k)
    return found


def mean_turn(turns: Array) -> Array:
    """The rotation nearest to all of (n, 3, 3): the polar part of their sum."""
    u, _, v = np.linalg.svd(np.nansum(turns, axis=0))
    flip = np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ v))])
    found: Array = u @ flip @ v
    return found
