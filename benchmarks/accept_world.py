"""Made logs of built systems whose faults are known: a world for `benchmarks/accept.py`.

It shares no code with the package.  A vehicle follows splines through random slow motion; places,
angles, ranges and bearings are read off at their stamps (less what they are late), and scattered.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

Array = NDArray[np.float64]
Vector = tuple[float, float, float]
GRAVITY = 9.81
NOISES = ("white", "slow", "tails", "uneven", "flicker")
MOTIONS = ("loops", "lanes", "errands")
BEFORE_S = 5.0  # of motion on either side of a log
COLUMNS = (
    "time_s,position_north_m,position_east_m,position_down_m,roll_deg,pitch_deg,yaw_deg,"
    "velocity_north_mps,velocity_east_mps,velocity_down_mps,rate_x_degps,rate_y_degps,rate_z_degps,"
    "range_m,azimuth_deg,elevation_deg,target_north_m,target_east_m,target_down_m,target_id"
)


@dataclass(frozen=True)
class Vehicle:
    """What is bought: limits of the platform, sigmas (m, deg), arms (m); sway: its own tilts."""

    v_max: float
    turn_dps: float
    distance_m: float
    sigma_position: Vector
    sigma_attitude: Vector
    sigma_range: float
    sigma_bearing: float
    arm_position: Vector
    arm_ranging: Vector
    limit_m: float
    above_m: float
    sway_deg: float
    sway_s: float
    banks: bool = False


VEHICLES = {
    "quadrotor": Vehicle(11.0, 60.0, 45.0, (0.015, 0.015, 0.025), (0.04, 0.04, 0.08), 0.02, 0.03,
                         (0.10, 0.05, -0.25), (0.12, 0.0, 0.15), 0.35, 28.0, 2.5, 4.0, True),
    "launch": Vehicle(6.0, 20.0, 35.0, (0.02, 0.02, 0.03), (0.04, 0.04, 0.08), 0.03, 0.08,
                      (-1.1, 0.2, -2.4), (0.8, 0.0, -1.2), 0.40, 0.0, 4.0, 5.0),
    "glider": Vehicle(2.4, 15.0, 30.0, (0.04, 0.04, 0.05), (0.06, 0.06, 0.12), 0.04, 0.12,
                      (-0.9, 0.0, -0.3), (0.7, 0.0, 0.35), 0.55, 14.0, 2.0, 9.0),
    "van": Vehicle(18.0, 28.0, 40.0, (0.015, 0.015, 0.025), (0.03, 0.03, 0.06), 0.02, 0.06,
                   (-0.6, 0.3, -1.8), (1.0, 0.0, -2.0), 0.35, 0.0, 1.2, 3.4),
}  # fmt: skip


@dataclass(frozen=True)
class Fault:
    """What is wrong: late by role (s, or a function of time), arms and turns off, noise as times
    the figure by group (position, roll, pitch, yaw, range, bearing).  slopes_too: velocities are as
    late as the position, rates as the attitude; else they come at their stamps.
    """

    late_s: dict[str, float | Callable[[Array], Array]] = field(default_factory=dict)
    slopes_too: bool = False
    arm_m: dict[str, Vector] = field(default_factory=dict)
    turn_deg: dict[str, Vector] = field(default_factory=dict)
    times: dict[str, float] = field(default_factory=dict)
    longer_m: float = 0.0
    faster: float = 1.0  # times v_max that it reaches


def spec_text(name: str, one: Vehicle) -> str:
    """The spec of a sound system of this kind."""

    def row(values: Vector, unit: str) -> str:
        return "[" + ", ".join(f"{v} {unit}" for v in values) + "]"

    stamps = (
        "      primitive: pps\n"
        "      timestamping: {error: {distribution: uniform, low: -20 us, high: 20 us}}"
    )
    platform = (
        f"v_max: {one.v_max} m/s, omega_max: {one.turn_dps} deg/s, "
        f"distance: {one.distance_m} m, baseline: 1 m"
    )
    bearing = f"[{one.sigma_bearing} deg, {one.sigma_bearing} deg]"
    sensors = {
        "position": f"type: gnss, sigma_position: {row(one.sigma_position, 'm')}",
        "attitude": f"type: ins, sigma_attitude: {row(one.sigma_attitude, 'deg')}",
        "ranging": f"type: lidar, sigma_range: {one.sigma_range} m, sigma_bearing: {bearing}",
    }
    arms = {"position": one.arm_position, "ranging": one.arm_ranging}
    lines = [
        "syncline: 1",
        f"name: {name}",
        "requirements:",
        f"  - {{id: ACC-1, kind: accuracy, limit: {one.limit_m} m}}",
        "horizon: {duration: 10 min}",
        "stages:",
        f"  - name: {name}",
        f"    platform: {{{platform}}}",
    ]
    for role, figures in sensors.items():
        lines += [
            f"    {role}:",
            f"      sensor: {{modality: {role}, {figures}, primitives: [pps]}}",
            stamps,
        ]
        lines += [f"      lever_arm: {row(arms[role], 'm')}"] if role in arms else []
    return "\n".join(lines) + "\n"


def turned(euler: Array) -> Array:
    """Body to NED (n, 3, 3): first about x, then y, then z."""
    total = np.broadcast_to(np.eye(3), (len(euler), 3, 3))
    for axis, angle in zip((2, 1, 0), (euler[:, 2], euler[:, 1], euler[:, 0]), strict=True):
        own = np.zeros((len(euler), 3, 3))
        i, j = (axis + 1) % 3, (axis + 2) % 3
        own[:, axis, axis] = 1.0
        own[:, i, i] = own[:, j, j] = np.cos(angle)
        own[:, i, j], own[:, j, i] = -np.sin(angle), np.sin(angle)
        total = total @ own
    return np.asarray(total)


def _waves(source: np.random.Generator, time_s: Array, periods: tuple[float, ...]) -> Array:
    """A sum of sines of random phase, of unit variance."""
    parts = [np.sin(2 * np.pi * (time_s / p + source.uniform())) for p in periods]
    return np.asarray(np.sum(parts, axis=0) * math.sqrt(2.0 / len(periods)))


def path(one: Vehicle, motion: str, length_s: float, source: np.random.Generator,
         faster: float = 1.0) -> tuple[CubicSpline, CubicSpline]:  # fmt: skip
    """Splines of the place (NED, m) and of roll, pitch and yaw (rad)."""
    time_s = np.arange(-BEFORE_S, length_s + BEFORE_S, 0.02)
    usual, most = 0.7 * one.v_max * faster, math.radians(0.45 * one.turn_dps)
    if motion == "loops":
        speed = usual * (1.0 + 0.16 * _waves(source, time_s, (23.0, 41.0)))
        turn = 0.5 * most * _waves(source, time_s, (19.0, 37.0, 61.0))
    elif motion == "lanes":
        leg, bend = 24.0, np.pi / (0.8 * most)
        part = np.mod(time_s + BEFORE_S, leg + bend)
        count = ((time_s + BEFORE_S) // (leg + bend)).astype(int)
        round_ = np.clip((part - leg) / bend, 0.0, 1.0)
        turn = np.where(count % 2, -1.0, 1.0) * np.pi / bend * 2.0 * np.sin(np.pi * round_) ** 2
        speed = usual * np.array([0.75, 1.0, 1.2])[count % 3]
        kernel = np.hanning(301) / np.sum(np.hanning(301))
        speed = np.convolve(np.pad(speed, 150, "edge"), kernel, "valid")
    else:  # errands: it slows down nearly to a stop and goes on
        speed = usual * (0.62 + 0.42 * _waves(source, time_s, (29.0, 53.0)) / 1.5)
        speed = np.maximum(speed, 0.05 * usual)
        turn = 0.5 * most * _waves(source, time_s, (13.0, 31.0))
    yaw = np.cumsum(turn) * 0.02 + source.uniform(-3.0, 3.0)
    sway = math.radians(one.sway_deg)
    slow = one.sway_s
    roll = sway * _waves(source, time_s, (slow, 1.7 * slow, 6.1 * slow))
    pitch = 0.7 * sway * _waves(source, time_s, (1.2 * slow, 2.9 * slow, 8.3 * slow))
    if one.banks:
        roll = roll + np.arctan(speed * turn / GRAVITY)
    heave = (0.2 if one.above_m == 0.0 else 1.0) * _waves(source, time_s, (5.7, 27.0))
    course = yaw + math.radians(2.5) * _waves(source, time_s, (35.0,))
    north, east = (np.cumsum(speed * f(course)) * 0.02 for f in (np.cos, np.sin))
    place = np.stack([north, east, heave - one.above_m], axis=1)
    return CubicSpline(time_s, place), CubicSpline(time_s, np.stack([roll, pitch, yaw], axis=1))


def _walk(source: np.random.Generator, time_s: Array, width: int, memory_s: float) -> Array:
    """First-order Gauss-Markov of unit variance."""
    keep = math.exp(-float(np.median(np.diff(time_s))) / memory_s)
    steps = source.normal(size=(len(time_s), width))
    out = np.empty_like(steps)
    out[0] = steps[0]
    for k in range(1, len(steps)):
        out[k] = keep * out[k - 1] + math.sqrt(1.0 - keep**2) * steps[k]
    return out


def _flicker(source: np.random.Generator, count: int, width: int) -> Array:
    """Density 1/f over four decades, of unit variance."""
    length = max(10_000, 4 * count)
    frequency = np.fft.rfftfreq(length)
    shape = np.zeros(frequency.shape)
    shape[1:] = frequency[1:] ** -0.5
    phases = source.normal(size=(width, 2, shape.size))
    made = np.fft.irfft((phases[:, 0] + 1j * phases[:, 1]) * shape, length)
    made /= math.sqrt(float(np.mean(made**2)))
    begin = int(source.integers(0, length - count))
    return np.asarray(made[:, begin : begin + count].T)


def scatter(source: np.random.Generator, time_s: Array, width: int, kind: str) -> Array:
    """Noise of unit variance (n, width)."""
    count = len(time_s)
    white = source.normal(size=(count, width))
    if kind == "slow":
        return 0.8 * white + 0.6 * _walk(source, time_s, width, 25.0)
    if kind == "quick":
        return math.sqrt(0.5) * (white + _walk(source, time_s, width, 5.0))
    if kind == "tails":
        return np.asarray(source.standard_t(5.0, (count, width)) / math.sqrt(5.0 / 3.0))
    if kind == "uneven":
        loud = np.sin(2 * np.pi * (time_s / 70.0 + source.uniform())) > 0.5
        return white * np.where(loud, 1.5, 0.75)[:, None]
    if kind == "flicker":
        return _flicker(source, count, width)
    return white


@dataclass(frozen=True)
class Drive:
    """A vehicle, how it moves, which noise, for how long and how often it is logged, the seed."""

    vehicle: str
    motion: str
    noise: str
    seed: int
    length_s: float = 200.0
    rate_hz: float = 5.0


def write(drive: Drive, fault: Fault, folder: Path) -> tuple[Path, Path]:
    """Spec and log."""
    one = VEHICLES[drive.vehicle]
    spec, log = folder / "spec.yaml", folder / "log.csv"
    spec.write_text(spec_text(drive.vehicle, one), "utf-8")
    table = _table(drive, one, fault)
    np.savetxt(log, table, delimiter=",", fmt=["%.9g"] * 19 + ["%d"], header=COLUMNS, comments="")
    return spec, log


def _table(drive: Drive, one: Vehicle, fault: Fault) -> Array:
    source = np.random.default_rng([drive.seed, 17])
    place, angle = path(one, drive.motion, drive.length_s, source, fault.faster)
    time_s = np.arange(0.0, drive.length_s, 1.0 / drive.rate_hz)
    time_s = time_s + source.uniform(0.0, 0.3 / drive.rate_hz, time_s.shape)

    def at(role: str) -> Array:
        late = fault.late_s.get(role, 0.0)
        return time_s - (late(time_s) if callable(late) else late)

    def arm(role: str, own: Vector) -> Array:
        return np.array(own) + np.array(fault.arm_m.get(role, (0.0, 0.0, 0.0)))

    def noise(sigma: tuple[float, ...], times: tuple[str, ...]) -> Array:
        made = scatter(source, time_s, len(sigma), drive.noise)
        return made * np.array(sigma) * [fault.times.get(key, 1.0) for key in times]

    there = turned(angle(at("position")))
    position = place(at("position")) + there @ arm("position", one.arm_position)
    position += noise(one.sigma_position, ("position",) * 3)
    euler = angle(at("attitude")) + np.radians(fault.turn_deg.get("attitude", (0.0, 0.0, 0.0)))
    euler += np.radians(noise(one.sigma_attitude, ("roll", "pitch", "yaw")))
    head = place(at("ranging"))
    body = turned(angle(at("ranging")))
    number, target = _seen(source, one, head, place)
    kept = number >= 0
    view = np.einsum("nji,nj->ni", body, target - head) - arm("ranging", one.arm_ranging)
    length = np.linalg.norm(view, axis=1)
    bearing = np.stack([np.arctan2(view[:, 1], view[:, 0]), np.arcsin(-view[:, 2] / length)], 1)
    bearing += np.radians(fault.turn_deg.get("ranging", (0.0, 0.0, 0.0))[:2])
    bearing += np.radians(noise((one.sigma_bearing,) * 2, ("bearing",) * 2))
    length = length + fault.longer_m + noise((one.sigma_range,), ("range",))[:, 0]
    turned_at, moved_at = (
        at(role) if fault.slopes_too else time_s for role in ("attitude", "position")
    )
    now, slope = angle(turned_at), angle(turned_at, 1)
    rate = _body_rate(now, slope) + np.radians(0.02) * source.normal(size=now.shape)
    speed = place(moved_at, 1) + 0.005 * source.normal(size=now.shape)
    euler[:, 2] = np.mod(euler[:, 2] + np.pi, 2 * np.pi) - np.pi
    columns = (time_s, position, np.degrees(euler), speed, np.degrees(rate), length,
               np.degrees(bearing), target, number)  # fmt: skip
    return np.column_stack(columns)[kept]


def _body_rate(euler: Array, slope: Array) -> Array:
    """Turn rates about the body's axes from the slopes of its angles."""
    roll, pitch = euler[:, 0], euler[:, 1]
    down = slope[:, 2]
    return np.stack([
        slope[:, 0] - np.sin(pitch) * down,
        np.cos(roll) * slope[:, 1] + np.sin(roll) * np.cos(pitch) * down,
        -np.sin(roll) * slope[:, 1] + np.cos(roll) * np.cos(pitch) * down,
    ], axis=1)  # fmt: skip


def _seen(
    source: np.random.Generator, one: Vehicle, head: Array, place: CubicSpline
) -> tuple[NDArray[np.int64], Array]:
    """Of every row a surveyed target within reach, by its number (-1: none), and where it is."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(head, axis=0), axis=1))])
    near = np.interp(np.arange(0.0, along[-1] + 1e-9, 12.0), along, np.arange(len(head)))
    centre = head[near.astype(int)]
    if len(centre) > 300:
        centre = centre[:: len(centre) // 300 + 1]
    wide = 0.45 * one.distance_m
    targets = centre + source.uniform(-wide, wide, centre.shape)
    low, high = (-2.0, 2.0) if one.above_m else (-8.0, -0.5)
    targets[:, 2] = source.uniform(low, high, len(centre))
    targets = np.round(targets, 3)
    number = np.full(len(head), -1)
    for k, spot in enumerate(head):
        away = np.linalg.norm(targets - spot, axis=1)
        free = np.flatnonzero((away < one.distance_m) & (away > 4.0))
        if free.size:
            number[k] = source.choice(free)
    return number, targets[number]
