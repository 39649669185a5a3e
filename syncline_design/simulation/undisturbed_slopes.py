"""The slopes of a figure by what is chosen, from its slopes by errors and by their noise's part.

Reverse differentiation of `undisturbed` by hand: a bar over x, here `pull` on x, is the derivative
of the figure by x (Griewank and Walther, Evaluating Derivatives, 2nd ed. 2008, ch. 3).  What turns
by dphi moves as du = dphi x u, so that a pull f on u is a torque u x f; exp(S(t + dt)) turns
exp(S(t)) by J(t) dt.  Vectors (3, n, M), n points, M nodes.
"""

from __future__ import annotations

import numpy as np

from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.horizon import Horizon
from syncline_design.model.system import Sensor
from syncline_design.simulation.kernel import cross
from syncline_design.simulation.sights import reach_m
from syncline_design.simulation.undisturbed import (
    Attitudes,
    Shifted,
    Sight,
    StageRun,
    StageState,
    rotated,
)

_TINY = 1e-300


@dataclass(frozen=True, slots=True)
class StagePull:
    """Slopes of a figure by the blocks of one stage, by name, and by its shifts s_p, s_a (2, n),
    were these to change at all nodes alike."""

    blocks: dict[str, Array]
    on_shifts: Array


def pulled(run: StageRun, on_error: Array, on_slopes: Array, horizon: Horizon) -> StagePull:
    """Slopes by what one stage chooses.

    on_error (3, n, M): of the figure by the error at each node; on_slopes (3, 9, n, m): by
    `StageRun.slopes` at the first m of the nodes.
    """
    state = run.state
    body = rotated(state.rotation, on_error, back=True)
    torque = np.sum(cross(run.error, on_error), axis=2)  # on the attitude, NED
    velocity, antenna, on_turn, by_position = _by_antenna(run.position, state, body)
    rate = np.sum(on_turn * run.position.shift_s, axis=2)
    blocks: dict[str, Array] = {}
    by_attitude = np.zeros_like(by_position)
    if run.attitudes is not None and state.sight is not None:
        lever, sight, twist = _by_slopes(state, run.attitudes, on_slopes)
        lever += np.sum(run.attitude.turned(body, back=True), axis=2)
        torque += np.sum(twist, axis=2)
        whole = cross(state.lever + run.attitude.turned(state.lever), body)
        whole[:, :, : twist.shape[2]] += rotated(state.rotation, twist, back=True)
        rate += np.sum(run.attitude.averaged(whole, back=True) * run.attitude.shift_s, axis=2)
        by_attitude = np.sum(whole * state.rate, axis=0)
        antenna -= lever
        blocks |= _by_sight(state, state.sight, lever, sight)
    blocks |= _by_lean_and_yaw(state, torque, horizon)
    blocks["velocity"] = velocity * float(state.stage.platform.v_max_mps)
    blocks["rate"] = rate * float(state.stage.platform.omega_max_radps)
    blocks["lever_arm"] = antenna * float(state.stage.platform.baseline_m)
    return StagePull(blocks, np.sum(np.stack([by_position, by_attitude]), axis=2))


def _by_antenna(at: Shifted, state: StageState, body: Array) -> tuple[Array, Array, Array, Array]:
    """Pulls on v (3, n), l_G (3, n), the turn t (3, n, M) and, with its turn, the shift s (n, M)
    of s J(t) v + (E(t) - I) l_G, pulled by `body` (3, n, M)."""
    shift, turn = at.shift_s, at.turn
    a, b, c = at.terms
    velocity = np.sum(at.averaged(body, back=True) * shift, axis=2)
    antenna = np.sum(at.turned(body, back=True), axis=2)
    # J(t) v = v + B t x v + C t x (t x v); by |t|^2, B has the slope (A - 2 B) / 2 |t|^2 and
    # C that of (B - 3 C) / 2 |t|^2
    once = cross(turn, state.velocity)
    twice = cross(turn, once)
    half = 0.5 / np.maximum(at.square, _TINY)
    along = (a - 2.0 * b) * half * np.sum(body * once, axis=0)
    along += (b - 3.0 * c) * half * np.sum(body * twice, axis=0)
    on_turn = 2.0 * turn * along + b * cross(state.velocity, body)
    on_turn += c * (cross(once, body) + cross(state.velocity, cross(body, turn)))
    on_turn *= shift
    moved = state.antenna + at.turned(state.antenna)
    on_turn += at.averaged(cross(moved, body), back=True)
    # d/ds of both is E(t) (v + w x l_G)
    swept = state.velocity + cross(state.rate, state.antenna)
    by_shift = np.sum(body * (swept + at.turned(swept)), axis=0)
    return velocity, antenna, on_turn, by_shift


def _by_slopes(state: StageState, found: Attitudes, on_slopes: Array) -> tuple[Array, Array, Array]:
    """Pulls on q (3, n), on the scaled polar slopes (3, 3, n), and the torque on R E (3, n, m)."""
    stage, sight = state.stage, state.sight
    assert sight is not None
    twist = np.zeros_like(found.object)
    if stage.attitude is None:
        return np.zeros_like(sight.frame[:, 0]), np.zeros_like(sight.frame), twist
    on_object, twist = _by_axes(stage.attitude, found, on_slopes[:, 3:6])
    twist += cross(found.object, on_object)
    lever = np.einsum("jinm,jnm->in", found.rotation, on_object)
    on_sight = on_slopes[:, 6:]
    twist_of = found.sight * sight.scale[:, :, None]
    for k in range(3):
        twist += cross(twist_of[:, k], on_sight[:, k])
    polar = np.einsum("jinm,jknm->ikn", found.rotation, on_sight)
    return lever, polar, twist


def _by_axes(attitude: Sensor, found: Attitudes, pull: Array) -> tuple[Array, Array]:
    """Pull on R E q and torque on R E of the slopes sigma a x R E q by roll, pitch and yaw."""
    on_object = np.zeros_like(found.object)
    on_axis = []
    for k, sigma in enumerate(attitude.sigma):
        on_object += sigma * cross(pull[:, k], found.axes[:, k])
        on_axis.append(sigma * cross(found.object, pull[:, k]))
    # the axis of pitch turns with the yaw of the first axis alone
    x, y, _ = first = found.axes[:, 0]
    by_yaw = -found.axes[1, 1] * on_axis[1][0] + found.axes[0, 1] * on_axis[1][1]
    by_yaw /= np.maximum(x * x + y * y, _TINY)
    on_first = on_axis[0]
    on_first[0] -= y * by_yaw
    on_first[1] += x * by_yaw
    return on_object, cross(first, on_first)


def _by_sight(state: StageState, sight: Sight, lever: Array, scaled: Array) -> dict[str, Array]:
    """Slopes by the blocks of the line of sight and of the distance.

    lever (3, n): pull on q; scaled (3, 3, n): on the polar slopes times sigma.
    """
    along, across, up = (sight.frame[:, k] for k in range(3))
    far, sine, cosine = sight.range_m, -along[2], -up[2]
    by_scale = np.sum(scaled * sight.polar, axis=0)
    polar = scaled * sight.scale
    level = cosine * along - sine * up
    azimuth = -far * (cosine * _dot(polar[:, 1], level) + sine * _dot(polar[:, 2], across))
    elevation = -far * (sine * _dot(polar[:, 1], across) + _dot(polar[:, 2], along))
    distance = _dot(lever, along) + cosine * _dot(polar[:, 1], across) + _dot(polar[:, 2], up)
    assert state.stage.ranging is not None
    shaped = _by_shares(state.stage.ranging, sight, by_scale)
    elevation, distance = elevation + shaped[0], distance + shaped[1]
    towards = far * lever + polar[:, 0]
    blocks = {"distance": distance * reach_m(state.stage)}
    if state.stage.look is not None:
        azimuth += cosine * _dot(towards, across)
        elevation += _dot(towards, up)
        return blocks | _by_look(state, azimuth, elevation, cosine)
    x, y, z = chosen = state.picked["bearing"]
    flat = np.maximum(np.hypot(x, y), _TINY)
    square = _dot(chosen, chosen)
    found = (towards - along * _dot(along, towards)) / np.sqrt(square)
    found[:2] += azimuth * np.stack([-y, x]) / flat / flat
    found += elevation / square * np.stack([z * x / flat, z * y / flat, -flat])
    return blocks | {"bearing": found}


def _by_look(
    state: StageState, azimuth: Array, elevation: Array, cosine: Array
) -> dict[str, Array]:
    """Slopes by the azimuth and the height of a `look`, see `draws.sight`."""
    look, picked = state.stage.look, state.picked["azimuth"]
    assert look is not None
    least, most = look.azimuth or (-np.pi, np.pi)
    low, high = look.elevation or (-0.5 * np.pi, 0.5 * np.pi)
    if look.azimuth is None:
        square = np.maximum(picked[0] ** 2 + picked[1] ** 2, _TINY)
        around = np.stack([-picked[1], picked[0]]) * ((most - least) / (2.0 * np.pi) / square)
    else:
        around = np.full(picked.shape, 0.5 * (most - least))
    # sin el = sin low + (sin high - sin low) (1 + x) / 2; straight up and down it is no slope
    by_height = 0.5 * (np.sin(high) - np.sin(low)) / np.maximum(cosine, 1e-12)
    return {"azimuth": azimuth * around, "elevation": (elevation * by_height)[None]}


def _by_shares(sensor: Sensor, sight: Sight, by_scale: Array) -> tuple[Array, Array]:
    """Slopes (n,) by elevation and distance of what sigma follows, see `ranging_shares`."""
    beam = sight.elevation + 0.5 * np.pi
    sigma = np.array(sensor.sigma)[:, None]
    by_range, d_range = _line(sensor.range_shape, sight.range_m)
    of_range, d_of_range = _line(sensor.range_by_beam, beam)
    _, d_of_bearing = _line(sensor.bearing_by_beam, beam)
    by_share = sigma * by_scale
    elevation = by_share[0] * by_range * d_of_range + (by_share[1] + by_share[2]) * d_of_bearing
    return elevation, by_share[0] * d_range * of_range


def _line(shape: tuple[tuple[float, float], ...], where: Array) -> tuple[Array, Array]:
    """Value and slope of straight lines between points, constant beyond them; 1 without any."""
    if not shape:
        return np.ones(where.shape), np.zeros(where.shape)
    at, values = np.array(shape).T
    steps = np.concatenate([[0.0], np.diff(values) / np.diff(at), [0.0]])
    return np.interp(where, at, values), steps[np.searchsorted(at, where, side="right")]


def _by_lean_and_yaw(state: StageState, torque: Array, horizon: Horizon) -> dict[str, Array]:
    """Slopes by where a vehicle leans and heads, of a torque (3, n) on its attitude.

    Roll turns about its first axis, pitch about (-sin yaw, cos yaw, 0), yaw about down.
    """
    yaw, picked = state.euler[:, 2], state.picked["yaw"]
    heading = np.stack([-picked[1], picked[0]]) / np.maximum(_dot(picked, picked), _TINY)
    pitch = np.cos(yaw) * torque[1] - np.sin(yaw) * torque[0]
    roll = _dot(state.rotation[:, 0], torque)
    return {
        "yaw": torque[2] * heading,
        "lean": _by_disc(state.picked["lean"], roll, pitch, horizon.tilt_rad),
    }


def _by_disc(disc: Array, roll: Array, pitch: Array, tilt_rad: float) -> Array:
    """Slopes by a point of the unit disc, see `surroundings.leaning`.

    With s = disc sin(T |disc|) / |disc|: pitch = -asin s_0, roll = atan2(s_1, cos(T |disc|)).
    """
    length = np.maximum(np.sqrt(_dot(disc, disc)), _TINY)
    inside = np.where(length <= 1.0 + 1e-9, tilt_rad, 0.0)  # on the rim: of the way inwards
    tilt = tilt_rad * np.minimum(length, 1.0)
    out = disc / length
    part = np.sin(tilt) / length
    bent = inside * np.cos(tilt) - part
    first, second = part * disc
    square = second * second + np.cos(tilt) ** 2
    by_first = -pitch / np.sqrt(np.maximum(1.0 - first * first, 1e-12))
    by_second = roll * np.cos(tilt) / square
    by_cosine = -roll * second / square
    found: Array = part * np.stack([by_first, by_second])
    found += out * bent * (by_first * out[0] + by_second * out[1])
    found -= out * by_cosine * np.sin(tilt) * inside
    return found


def _dot(first: Array, second: Array) -> Array:
    found: Array = np.sum(first * second, axis=0)
    return found
