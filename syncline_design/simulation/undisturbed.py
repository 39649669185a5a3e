"""The error of a system on which no effect acts, at points of its blocks, in closed form.

With R the attitude, v and w velocity and turn rate in the body's axes, s_p and s_a how much later
position and attitude were valid than the range, l_G the antenna's arm and q = l_L - l_G + r n the
lever from it to the object, a stage errs by

    e = R [s_p J(w s_p) v + (E(w s_p) - I) l_G + (E(w s_a) - I) q],

E(t) = exp(S(t)), J(t) = integral of E(t u) du from 0 to 1; stages add.  The same as
`chain.stage_error` and `chain.noise_slopes` without departures, of which a point's state is worked
out once for all of its nodes.  Columns: vectors (3, n, M), n points, M nodes, 1 where all nodes
agree.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from syncline_design.effects.kinematics import euler_to_rotation, rotation_to_euler
from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.system import Stage, System
from syncline_design.simulation.ascent import FreeVector, chosen
from syncline_design.simulation.draws import lever_arms, ranging_shares
from syncline_design.simulation.kernel import cross, rotation_terms
from syncline_design.simulation.sights import bearings, ranges_m
from syncline_design.simulation.surroundings import leaning
from syncline_design.simulation.timing_variables import StampKey, SystemTiming

Terms = tuple[Array, ...]


@dataclass(frozen=True, slots=True)
class Sight:
    """Where a stage looks: azimuth, elevation [rad] and distance [m] (n,); as a frame.

    frame (3, 3, n): unit vectors along the sight and, by azimuth and by elevation, across, body;
    polar (3, 3, n): d(r n) by range, azimuth, elevation; scale (3, n): sigma of these three.
    """

    elevation: Array
    range_m: Array
    frame: Array
    polar: Array
    scale: Array


@dataclass(frozen=True, slots=True)
class StageState:
    """A stage at n points: R (3, 3, n), v, w, l_G, q (3, n, 1)."""

    stage: Stage
    picked: dict[str, Array]
    euler: Array
    rotation: Array
    velocity: Array
    rate: Array
    antenna: Array
    lever: Array
    sight: Sight | None


def state_of(
    system: System, blocks: tuple[FreeVector, ...], index: int, point: Array
) -> StageState:
    """The stage at its limits of speed and turn rate in the directions of points (p, n)."""
    stage, picked = system.stages[index], chosen(blocks, point, index)
    count = point.shape[1]
    roll, pitch = leaning(system.horizon, picked["lean"])
    euler = np.stack([roll, pitch, np.arctan2(picked["yaw"][1], picked["yaw"][0])], axis=-1)
    arms = lever_arms(stage, index == 0, picked.get("lever_arm", np.zeros((3, count))))
    antenna, ranging = (np.broadcast_to(arm, (3, count)) for arm in arms)
    sight = None if stage.ranging is None else _sight(stage, picked, count)
    lever = ranging - antenna
    if sight is not None:
        lever = lever + sight.range_m * sight.frame[:, 0]
    return StageState(
        stage=stage,
        picked=picked,
        euler=euler,
        rotation=np.ascontiguousarray(np.moveaxis(euler_to_rotation(euler), 0, -1)),
        velocity=(picked["velocity"] * float(stage.platform.v_max_mps))[:, :, None],
        rate=(picked["rate"] * float(stage.platform.omega_max_radps))[:, :, None],
        antenna=np.ascontiguousarray(antenna)[:, :, None],
        lever=lever[:, :, None],
        sight=sight,
    )


def _sight(stage: Stage, picked: dict[str, Array], count: int) -> Sight:
    """frame[:, 0] = n = [cos az cos el, sin az cos el, -sin el]; then dn/daz / cos el, dn/del."""
    x, y, z = bearings(stage, picked, count)
    azimuth, elevation = np.arctan2(y, x), np.arctan2(-z, np.hypot(x, y))
    cos_az, sin_az, cos_el, sin_el = (
        np.cos(azimuth),
        np.sin(azimuth),
        np.cos(elevation),
        np.sin(elevation),
    )
    frame = np.empty((3, 3, count))
    frame[:, 0] = cos_az * cos_el, sin_az * cos_el, -sin_el
    frame[:, 1] = -sin_az, cos_az, np.zeros(count)
    frame[:, 2] = -cos_az * sin_el, -sin_az * sin_el, -cos_el
    distance = ranges_m(stage, picked, count)
    polar = frame * np.stack([np.ones(count), distance * cos_el, distance])
    assert stage.ranging is not None
    scale = np.repeat(np.array([stage.ranging.sigma], dtype=np.float64).T, count, axis=1)
    shares = ranging_shares(stage.ranging, distance, elevation + 0.5 * np.pi)
    if shares is not None:
        scale = scale * shares
    return Sight(elevation, distance, frame, polar, scale)


@dataclass(frozen=True, slots=True)
class Shifted:
    """A shift s (n, M) [s] of a stage: turn w s, |w s|^2, and A, B, C of `rotation_terms`."""

    shift_s: Array
    turn: Array
    square: Array
    terms: Terms

    def turned(self, vector: Array, back: bool = False) -> Array:
        """(E(t) - I) u = t x (A u + B t x u), or of -t; u (3, n, 1) or (3, n, M)."""
        a, b, _ = self.terms
        across = cross(self.turn, vector)
        twice = b * cross(self.turn, across)
        found: Array = twice - a * across if back else twice + a * across
        return found

    def rotation(self) -> Array:
        """E(t) = (1 - B |t|^2) I + A S(t) + B t t', (3, 3, n, M)."""
        a, b, _ = self.terms
        matrix = (b * self.turn)[:, None] * self.turn
        matrix[(0, 1, 2), (0, 1, 2)] += 1.0 - b * self.square
        around = a * self.turn
        matrix[(2, 0, 1), (1, 2, 0)] += around
        matrix[(1, 2, 0), (2, 0, 1)] -= around
        return matrix

    def averaged(self, vector: Array, back: bool = False) -> Array:
        """J(t) u = u + B t x u + C t x (t x u), or of -t."""
        _, b, c = self.terms
        across = cross(self.turn, vector)
        twice = vector + c * cross(self.turn, across)
        found: Array = twice - b * across if back else twice + b * across
        return found


def shifted(rate: Array, shift_s: Array) -> Shifted:
    """The turn of a rate (3, n, 1) [rad/s] during a shift (n, M) [s]."""
    turn = rate * shift_s
    square = turn[0] * turn[0] + turn[1] * turn[1] + turn[2] * turn[2]
    return Shifted(shift_s, turn, square, rotation_terms(square))


@dataclass(frozen=True, slots=True)
class Attitudes:
    """The attitude as measured at some nodes, and how its noise moves the object.

    rotation (3, 3, n, M): R E(w s_a); object (3, n, M): that times q; axes (3, 3, n, M): about
    which roll, pitch and yaw turn it, NED; sight (3, 3, n, M): R E times the polar slopes.
    """

    at: Shifted
    rotation: Array
    object: Array
    axes: Array
    sight: Array


@dataclass(frozen=True, slots=True)
class StageRun:
    """A stage's error (3, n, M) at n points and M nodes; attitudes: at the nodes whose slopes are
    asked, of which there are `sloped`."""

    state: StageState
    position: Shifted
    attitude: Shifted
    error: Array
    sloped: int
    attitudes: Attitudes | None

    def slopes(self) -> Array:
        """What each noise does at one sigma, (3, 9, n, M): as `chain.noise_slopes`."""
        stage, found = self.state.stage, self.attitudes
        slopes = np.zeros((3, 9, self.error.shape[1], self.sloped))
        if stage.position is not None:
            for axis, sigma in enumerate(stage.position.sigma):
                slopes[axis, axis] = sigma
        if found is None or self.state.sight is None or stage.attitude is None:
            return slopes
        for k, sigma in enumerate(stage.attitude.sigma):
            slopes[:, 3 + k] = cross(found.axes[:, k], found.object)
            slopes[:, 3 + k] *= sigma
        slopes[:, 6:] = found.sight * self.state.sight.scale[:, :, None]
        return slopes


def stage_run(state: StageState, shifts: tuple[Array, Array], slopes_at: slice) -> StageRun:
    """A stage at shifts (n, M) of position and attitude; slopes at some of the nodes."""
    position, attitude = (shifted(state.rate, shift_s) for shift_s in shifts)
    body = position.averaged(state.velocity)
    body *= position.shift_s
    body += position.turned(state.antenna)
    attitudes, at_slopes = None, shifts[1][:, slopes_at]
    if state.sight is not None:
        body += attitude.turned(state.lever)
        attitudes = _attitudes(state, at_slopes)
    error = rotated(state.rotation, body)
    return StageRun(state, position, attitude, error, at_slopes.shape[1], attitudes)


def _attitudes(state: StageState, shift_s: Array) -> Attitudes:
    assert state.sight is not None
    at = shifted(state.rate, shift_s)
    rotation = np.einsum("ijn,jknm->iknm", state.rotation, at.rotation())
    lever = np.einsum("ijnm,jn->inm", rotation, state.lever[:, :, 0])
    sight = np.einsum("ijnm,jkn->iknm", rotation, state.sight.polar)
    axes = np.zeros_like(rotation)
    axes[:, 0], axes[2, 2] = rotation[:, 0], 1.0
    axes[1, 1], axes[0, 1] = _heading(rotation)
    axes[0, 1] *= -1.0
    return Attitudes(at, rotation, lever, axes, sight)


def _heading(rotation: Array) -> tuple[Array, Array]:
    """(cos, sin) of the yaw of R (3, 3, n, M), as `rotation_to_euler` has it."""
    x, y = rotation[0, 0], rotation[1, 0]
    level = np.hypot(x, y)
    if level.min(initial=1.0) > 1e-8:
        return x / level, y / level
    rows = np.moveaxis(rotation.reshape(3, 3, -1), -1, 0)
    yaw = rotation_to_euler(rows)[:, 2].reshape(x.shape)
    return np.cos(yaw), np.sin(yaw)


def rotated(rotation: Array, vector: Array, back: bool = False) -> Array:
    """R u or, back, R' u: (3, 3, n) times (3, n, M)."""
    found: Array = np.einsum("jin,jnm->inm" if back else "ijn,jnm->inm", rotation, vector)
    return found


def sum_of_errors(runs: Sequence[StageRun]) -> Array:
    """The error of a system [m], (3, n, M): each stage takes over that of the one before."""
    total = runs[0].error
    for run in runs[1:]:
        total = total + run.error
    return total


@dataclass(frozen=True, slots=True)
class RelativeShifts:
    """s_p and s_a of a stage: their means (2,) [s], and how they follow each variable (2, v)."""

    mean_s: Array
    signs: Array

    def at(self, values: Array) -> tuple[Array, Array]:
        """Both (n, M) [s] at values (v, n, M) of the variables."""
        position, attitude = np.einsum("kv,vnm->knm", self.signs, values)
        return position + self.mean_s[0], attitude + self.mean_s[1]


def relative_shifts(system: System, timing: SystemTiming, index: int) -> RelativeShifts:
    """Position (a later stage's: the ranging before it) and attitude against the ranging."""
    stage = system.stages[index]
    position: StampKey = (stage.name, "position")
    if index > 0:
        position = (system.stages[index - 1].name, "ranging")
    keys: tuple[StampKey, ...] = (position, (stage.name, "attitude"))
    ranging: StampKey = (stage.name, "ranging")
    mean, signs = timing.mean_s, timing.signs
    return RelativeShifts(
        np.array([mean.get(key, 0.0) - mean.get(ranging, 0.0) for key in keys]),
        np.array([signs(key) - signs(ranging) for key in keys]),
    )
