"""The measurement chain once more, for tests: SciPy's rotations, quadrature, no product code.

A situation is a point x of the unit cube's corner-to-corner range [-1, 1]^k; `admissible` turns
vectors into balls.  Everything acts at most at its one-sigma (or charged) size.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]
AGES, SHARES = np.polynomial.laguerre.laggauss(8)
GRAVITY = 9.80665
SOUND_MPS = 1500.0


@dataclass(frozen=True)
class PlainStage:
    """v, w, d; arms l_G (None: length b, any direction), l_L; norms of the noises; effects."""

    v: float
    w: float
    d: float
    arm: tuple[float, float, float] | None
    ranging_arm: tuple[float, float, float] = (0.0, 0.0, 0.0)
    b: float = 0.0
    position: float = 0.0
    attitude: float = 0.0
    range: float = 0.0
    bearing: float = 0.0
    effects: dict[tuple[str, str], dict[str, float]] = field(default_factory=dict)

    def of(self, name: str, sensor: str, parameter: str) -> float:
        return self.effects.get((name, sensor), {}).get(parameter, 0.0)

    def vector(self, name: str, sensor: str, unit: str, axes: Sequence[str] = "xyz") -> Array:
        return np.array([self.of(name, sensor, f"{axis}{unit}") for axis in axes])


@dataclass(frozen=True)
class PlainHorizon:
    duration: float
    extent: float
    tilt: float


SIZES = {
    "v": 3, "w": 3, "n": 3, "arm": 3, "position": 3, "attitude": 3, "bearing": 2, "range": 1,
    "shift_p": 1, "shift_a": 1, "lean": 2, "yaw": 1, "scatter": 3, "wander": 3, "packet_p": 1,
    "packet_a": 1, "jitter_p": 1, "jitter_a": 1,
    "packet_r": 1, "jitter_r": 1,
}  # fmt: skip
SPHERES = ("n", "arm")
SHARED = 3  # time, place


def size(stages: list[PlainStage]) -> int:
    return SHARED + len(stages) * sum(SIZES.values())


def parts(x: Array) -> dict[str, Array]:
    """Named blocks (n, k) of one stage's part of x (n, K): balls, or spheres."""
    found: dict[str, Array] = {}
    at = 0
    for name, width in SIZES.items():
        block = x[:, at : at + width]
        length = np.linalg.norm(block, axis=1, keepdims=True)
        floor = 1e-12 if name in SPHERES else 1.0
        found[name] = block / np.maximum(length, floor)
        at += width
    return found


def chain_error(stages: list[PlainStage], horizon: PlainHorizon, tau: float, x: Array) -> Array:
    """|e| [m] of situations x (n, K)."""
    time = horizon.duration * 0.5 * (1.0 + np.clip(x[:, 0], -1.0, 1.0))
    place = x[:, 1:3] / np.maximum(np.linalg.norm(x[:, 1:3], axis=1, keepdims=True), 1.0)
    place = np.column_stack([horizon.extent * place, np.zeros(len(x))])
    error, stamped = np.zeros((len(x), 3)), np.zeros(len(x))
    width = sum(SIZES.values())
    for k, stage in enumerate(stages):
        block = parts(x[:, SHARED + k * width : SHARED + (k + 1) * width])
        error, stamped = _stage(stage, horizon, tau, block, (time, place, error, stamped))
    return np.linalg.norm(error, axis=1)


def _stage(
    s: PlainStage,
    horizon: PlainHorizon,
    tau: float,
    c: dict[str, Array],
    before: tuple[Array, Array, Array, Array],
) -> tuple[Array, Array]:
    time, place, carried, stamped = before
    v, w, yaw = s.v * c["v"], s.w * c["w"], math.pi * c["yaw"][:, 0]
    lean = horizon.tilt * np.column_stack([c["lean"], np.zeros(len(yaw))])
    pose = Rotation.from_rotvec(lean) * Rotation.from_rotvec(yaw[:, None] * [0.0, 0.0, 1.0])
    antenna = s.b * c["arm"] if s.arm is None else np.tile(s.arm, (len(yaw), 1))
    azimuth, _ = _angles(c["n"])
    way = s.of("echo_delay", "ranging", "share") * s.d / SOUND_MPS
    scan = s.of("scan_distortion", "ranging", "period_s") * azimuth / (2.0 * math.pi)
    reference = scan - way + _late(s, "ranging", time, c)
    shift_p = tau * c["shift_p"][:, 0] + _late(s, "position", time, c) + stamped - reference
    shift_a = tau * c["shift_a"][:, 0] + _late(s, "attitude", time, c) - reference
    reading = _antenna(pose, v, w, shift_p, antenna + s.vector("lever_arm", "position", "_m"))
    reading += _position_errors(s, pose, v, w, antenna, c, time) + carried
    measured = pose * Rotation.from_rotvec(w * shift_a[:, None])
    body = s.vector("mounting", "attitude", "_rad") + _lean_of_acceleration(s, pose, v, w)
    measured = measured * Rotation.from_rotvec(body)
    euler = measured.as_euler("ZYX")[:, ::-1]
    euler = euler + s.attitude * _noise(s, "attitude", time) * c["attitude"]
    euler[:, 2] += _heading(s, time, _true_yaw(pose))
    measured = Rotation.from_euler("ZYX", euler[:, ::-1])
    force = np.cross(w, v) - pose.inv().apply([0.0, 0.0, GRAVITY])
    flexed = force * [s.of("flexure", "ranging", axis) for axis in "xyz"]
    mount = np.array(s.ranging_arm) + s.vector("lever_arm", "ranging", "_m") + flexed
    seen = _seen(s, c, time)
    estimate = reading + measured.apply(np.array(s.ranging_arm) - antenna + seen)
    truth = pose.apply(mount + s.d * c["n"])
    return estimate - truth - _survey(s, place), reference


def _antenna(pose: Rotation, v: Array, w: Array, shift: Array, arm: Array) -> Array:
    """Where the antenna is after `shift` [s] of constant body velocity and rate, from p."""
    way = np.zeros_like(v)
    turn = float(np.max(np.abs(shift) * np.linalg.norm(w, axis=1), initial=0.0))
    for node, weight in zip(*np.polynomial.legendre.leggauss(4 + int(2.0 * turn)), strict=True):
        at = 0.5 * shift * (1.0 + node)
        way += 0.5 * weight * Rotation.from_rotvec(w * at[:, None]).apply(v)
    turned = Rotation.from_rotvec(w * shift[:, None]).apply(arm)
    return pose.apply(way * shift[:, None] + turned)


def _late(s: PlainStage, sensor: str, time: Array, c: dict[str, Array]) -> Array:
    key = sensor[0]
    mu = -s.of("latency", sensor, "latency_s") - s.of("clock_drift", sensor, "rate") * time
    mu = mu - s.of("integer_second_slip", sensor, "seconds")
    mu = mu - s.of("timestamp_step", sensor, "step_s") * (
        time >= s.of("timestamp_step", sensor, "time_s")
    )
    mu = mu + 3.0 * s.of("timestamp_jitter", sensor, "std_s") * c[f"jitter_{key}"][:, 0]
    age = 0.5 * (1.0 + c[f"packet_{key}"][:, 0])
    return mu - s.of("packetised_timestamps", sensor, "interval_s") * age


def _position_errors(
    s: PlainStage,
    pose: Rotation,
    v: Array,
    w: Array,
    antenna: Array,
    c: dict[str, Array],
    time: Array,
) -> Array:
    error = s.position * _noise(s, "position", time) * c["position"]
    error[:, 2] += s.of("tide", "position", "rate_mps") * time
    error[:, 2] -= s.of("squat", "position", "sinkage_m") * np.sum(v * v, axis=1)
    wander = math.sqrt(3.0) * s.of("correlated_noise", "position", "std_m")
    error = error + wander * c["scatter"]
    error[:, 2] += s.of("height_drift", "position", "std_m") * c["wander"][:, 2]
    lever = s.vector("induced_heave", "position", "_m")
    error[:, 2] += pose.apply(lever)[:, 2] - lever[2]
    lag = s.of("filter_lag", "position", "time_constant_s")
    if lag:
        now = _antenna(pose, v, w, np.zeros(len(v)), antenna)
        for age, share in zip(AGES, SHARES, strict=True):
            past = _antenna(pose, v, w, np.full(len(v), -lag * age), antenna)
            error += share * (past - now)
    return error


def _lean_of_acceleration(s: PlainStage, pose: Rotation, v: Array, w: Array) -> Array:
    across = np.cross([0.0, 0.0, 1.0], pose.apply(np.cross(w, v))) / GRAVITY
    return s.of("acceleration_tilt", "attitude", "gain") * pose.inv().apply(across)


def _true_yaw(pose: Rotation) -> Array:
    found: Array = pose.as_euler("ZYX")[:, 0]
    return found


def _heading(s: PlainStage, time: Array, yaw: Array) -> Array:
    iron, soft = ("heading_hard_iron", "attitude"), ("heading_soft_iron", "attitude")
    return (
        s.of("heading_bias", "attitude", "bias_rad")
        + s.of("heading_drift", "attitude", "rate_radps") * time
        + s.of(*iron, "sin_rad") * np.sin(yaw)
        + s.of(*iron, "cos_rad") * np.cos(yaw)
        + s.of(*soft, "sin_rad") * np.sin(2.0 * yaw)
        + s.of(*soft, "cos_rad") * np.cos(2.0 * yaw)
    )


def _angles(n: Array) -> tuple[Array, Array]:
    return np.arctan2(n[:, 1], n[:, 0]), np.arcsin(np.clip(-n[:, 2], -1.0, 1.0))


def _noise(s: PlainStage, sensor: str, time: Array) -> Array:
    """Standard deviations over the stated ones (n, 1)."""
    factor = s.effects.get(("noise_understated", sensor), {}).get("factor", 1.0)
    for_a_while = s.effects.get(("noise_episode", sensor))
    grown = np.full(time.shape, factor)
    if for_a_while:
        inside = (time >= for_a_while["from_s"]) & (time <= for_a_while["to_s"])
        grown = np.where(inside, for_a_while["factor"] * factor, factor)
    return grown[:, None]


def _seen(s: PlainStage, c: dict[str, Array], time: Array) -> Array:
    """Measured vector to the object in the axes that the spec believes."""
    turned = Rotation.from_rotvec(-s.vector("boresight", "ranging", "_rad")).apply(c["n"])
    azimuth, elevation = _angles(turned)
    factor = _noise(s, "ranging", time)[:, 0]
    sound = s.of("sound_speed", "ranging", "relative_error")
    if sound:
        level = np.minimum(np.cos(_angles(c["n"])[1]) * (1.0 + sound), 1.0)
        elevation = elevation + np.copysign(np.arccos(level), elevation) - elevation
    azimuth = azimuth + s.bearing * factor * c["bearing"][:, 0]
    azimuth = azimuth + s.of("azimuth_bias", "ranging", "bias_rad")
    elevation = elevation + s.bearing * factor * c["bearing"][:, 1]
    elevation = elevation + s.of("elevation_bias", "ranging", "bias_rad")
    r = s.d * (1.0 + s.of("range_scale", "ranging", "scale") + sound)
    r = r + s.of("range_bias", "ranging", "bias_m") + s.range * factor * c["range"][:, 0]
    r = r + 750.0 * s.of("turnaround_delay", "ranging", "delay_s")
    flat = np.cos(elevation)
    n = np.column_stack([np.cos(azimuth) * flat, np.sin(azimuth) * flat, -np.sin(elevation)])
    seen: Array = r[:, None] * n
    return seen


def _survey(s: PlainStage, place: Array) -> Array:
    """Surveyed object minus the true one."""
    moved = np.tile(
        s.vector("datum_offset", "target", "_m", ("north", "east", "down")), (len(place), 1)
    )
    gamma = s.of("grid_convergence", "target", "rotation_rad")
    scale = s.of("grid_scale", "target", "scale")
    turned = Rotation.from_euler("z", gamma).apply(place)
    survey: Array = moved + (turned - place) + scale * place
    return survey
