"""From random numbers to draws of a system: kinematics, noise, timestamp errors."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.lever_arms import position_lever_arm
from syncline_design.model.roles import RoleName
from syncline_design.model.system import Look, Sensor, Stage, System
from syncline_design.model.timing import (
    Constant,
    Distribution,
    Empirical,
    Normal,
    TimingError,
    Uniform,
    mean,
)
from syncline_design.simulation.kernel import Draw

TimeShifts = Mapping[tuple[str, RoleName], Array]  # timestamp error mu [s] of (stage, role)


@dataclass(frozen=True, slots=True)
class RandomSource:
    """Pseudo-random numbers of one stream: `count` draws each of as many numbers as asked for.

    of: how many are drawn, of which the first `count` are used: these are the same whatever the
    count.
    """

    generator: np.random.Generator
    count: int
    of: int | None = None

    def uniform(self, rows: int) -> Array:
        """(rows, count), uniform on [0, 1)."""
        return self._used(self.generator.random((rows, self.of or self.count)))

    def normal(self, rows: int) -> Array:
        """(rows, count), standard normal."""
        return self._used(self.generator.standard_normal((rows, self.of or self.count)))

    def _used(self, drawn: Array) -> Array:
        if drawn.shape[1] == self.count:
            return drawn
        return np.ascontiguousarray(drawn[:, : self.count])


def angle(uniform: Array) -> tuple[Array, Array]:
    """(cos, sin) of an angle uniform on the circle, by t = tan(a/2): (1-t^2, 2t) / (1+t^2)."""
    t = np.tan(np.pi * (uniform - 0.5))
    scale = 1.0 / (1.0 + t * t)
    return 2.0 * scale - 1.0, 2.0 * t * scale


def directions(height: Array, turn: Array) -> Array:
    """Isotropic unit vectors from two uniforms (k, n): (k, 3, n), by Archimedes' hat box."""
    z = 2.0 * height - 1.0
    radius = np.sqrt(1.0 - z * z)
    cosine, sine = angle(turn)
    out = np.empty((z.shape[0], 3, z.shape[1]))
    np.multiply(radius, cosine, out=out[:, 0])
    np.multiply(radius, sine, out=out[:, 1])
    out[:, 2] = z
    return out


def sight(look: Look, across: Array, up: Array) -> Array:
    """Unit vectors (3, n) of a `look` at shares (n,) of its azimuth and of its height.

    The height z = -sin(elevation) is uniform where directions are (Archimedes).
    """
    least, most = look.azimuth or (-math.pi, math.pi)
    low, high = look.elevation or (-0.5 * math.pi, 0.5 * math.pi)
    azimuth = least + (most - least) * across
    z = -(math.sin(low) + (math.sin(high) - math.sin(low)) * up)
    level = np.sqrt(np.maximum(1.0 - z * z, 0.0))
    return np.stack([level * np.cos(azimuth), level * np.sin(azimuth), z])


def timing_draws(system: System, source: RandomSource) -> TimeShifts:
    """mu [s] of every sensor that enters, against true time (UTC).

    What a sensor stamped t on the host clock was valid at t + eps of that clock, and offset is
    host - UTC, so mu = eps - offset: one draw of the offset per timeline, shared by the sensors
    on it.  Between them it cancels; against UTC, as for a stage without a ranging sensor, it
    counts.
    """
    offsets: dict[str, Array] = {}
    for timeline, error in system.clock_offsets:
        offsets[timeline] = timing_draw(error, source)
    shifts: dict[tuple[str, RoleName], Array] = {}
    for stage in system.stages:
        for sensor in entering(stage):
            mu = timing_draw(sensor.timing, source)
            if sensor.timeline in offsets:
                mu = mu - offsets[sensor.timeline]
            shifts[stage.name, sensor.role] = mu
    return shifts


def entering(stage: Stage) -> tuple[Sensor, ...]:
    """Sensors that enter the estimate: without a ranging sensor only the position."""
    return tuple(s for s in stage.sensors() if stage.ranging is not None or s.role == "position")


def timing_draw(error: TimingError, source: RandomSource) -> Array:
    """n draws of mu [s].

    With the mean calibrated out, what remains of it has unknown sign and size up to
    `calibrated_s`, and so has what a clock drifted away: uniform between the two signs
    (JCGM 100:2008, 4.3.7).
    """
    drawn = _distribution_draw(error.distribution, source)
    if error.calibrated_s is not None:
        drawn = drawn - mean(error.distribution) + _either_sign(error.calibrated_s, source)
    if error.drifted_s:
        drawn = drawn + _either_sign(error.drifted_s, source)
    return drawn


def _either_sign(size_s: float, source: RandomSource) -> Array:
    """n draws [s], uniform between minus and plus a size."""
    drawn: Array = size_s * (2.0 * source.uniform(1)[0] - 1.0)
    return drawn


def _distribution_draw(distribution: Distribution, source: RandomSource) -> Array:
    drawn: Array
    match distribution:
        case Uniform(low, high):
            drawn = low + (high - low) * source.uniform(1)[0]
        case Normal(middle, std):
            drawn = middle + std * source.normal(1)[0]
        case Constant(value):
            drawn = np.full(source.count, float(value))
        case Empirical(values):
            index = (source.uniform(1)[0] * len(values)).astype(np.intp)
            drawn = np.asarray(values, dtype=np.float64)[np.minimum(index, len(values) - 1)]
    return drawn


def stage_draw(
    system: System,
    index: int,
    shifts: TimeShifts,
    source: RandomSource,
    inside: bool,
) -> Draw:
    """n draws of a stage under the envelope `limits` or `inside`."""
    stage = system.stages[index]
    d = 0.0 if stage.ranging is None else float(stage.platform.distance_m)
    free = 4 if position_lever_arm(stage, index == 0) is None else 3
    uniform = source.uniform(2 * free + 1 + 2 * inside)
    found = directions(uniform[:free], uniform[free : 2 * free])
    if stage.look is not None:
        found[0] = sight(stage.look, uniform[free], uniform[0])
    cos_yaw, sin_yaw = angle(uniform[2 * free])
    speed: float | Array = float(stage.platform.v_max_mps)
    rate: float | Array = float(stage.platform.omega_max_radps)
    if inside:
        speed, rate = speed * uniform[-2], rate * uniform[-1]
    antenna, ranging = lever_arms(stage, index == 0, found[-2])
    noise = noise_draw(stage, source)
    shaped(noise, stage.ranging, np.full(source.count, d), found[0][2])
    return Draw(
        cos_yaw=cos_yaw,
        sin_yaw=sin_yaw,
        velocity_mps=found[1] * speed,
        rate_radps=found[-1] * rate,
        range_m=np.full(source.count, d),
        bearing=found[0],
        antenna_m=antenna,
        ranging_m=ranging,
        **noise,
        **stage_shifts(system, index, shifts, source.count),
    )


def lever_arms(stage: Stage, first: bool, direction: Array) -> tuple[Array, Array]:
    """l_G and l_L [m], body; not given: length b along `direction` (3, n), and zero."""
    given = position_lever_arm(stage, first)
    antenna = direction * float(stage.platform.baseline_m) if given is None else _column(given)
    if stage.ranging is None:
        return antenna, antenna  # no object: the antenna itself is located
    arm = stage.ranging.lever_arm_m
    return antenna, _column((0.0, 0.0, 0.0) if arm is None else arm)


def ranging_shares(sensor: Sensor, range_m: Array, beam_rad: Array) -> Array | None:
    """Shares of sigma of range, azimuth and elevation (3, n) at ranges and at angles of sight from
    the down axis (n,); None where the noise depends on neither."""
    shapes = (sensor.range_shape, sensor.range_by_beam, sensor.bearing_by_beam)
    if not any(shapes):
        return None
    by_range, of_range, of_bearing = (
        np.interp(where, *np.array(shape).T) if shape else np.ones(range_m.shape)
        for shape, where in zip(shapes, (range_m, beam_rad, beam_rad), strict=True)
    )
    return np.stack([by_range * of_range, of_bearing, of_bearing])


def shaped(noise: dict[str, Array], sensor: Sensor | None, range_m: Array, down: Array) -> None:
    """Noise as drawn, in place, as it is at a range and a line of sight of so much down (n,)."""
    if sensor is None:
        return
    shares = ranging_shares(sensor, range_m, np.arccos(np.clip(down, -1.0, 1.0)))
    if shares is not None:
        noise["range_noise_m"] *= shares[0]
        noise["angle_noise_rad"][3:] *= shares[1:]


def _column(vector: tuple[float, float, float]) -> Array:
    return np.array([[float(value)] for value in vector])


def noise_draw(stage: Stage, source: RandomSource) -> dict[str, Array]:
    """Gaussian noise of the stage's sensors as fields of `Draw`."""
    n = source.count
    position = np.zeros((3, n))
    angles = np.zeros((5, n))
    distance = np.zeros(n)
    if stage.position is not None:
        position = source.normal(3)
        position *= _column(stage.position.sigma)
    if stage.ranging is not None and stage.attitude is not None:
        angles = source.normal(5)
        sigma = (*stage.attitude.sigma, *stage.ranging.sigma[1:])
        angles *= np.array([[float(s)] for s in sigma])
        distance = source.normal(1)[0]
        distance *= float(stage.ranging.sigma[0])
    return {"position_noise_m": position, "angle_noise_rad": angles, "range_noise_m": distance}


def stage_shifts(system: System, index: int, shifts: TimeShifts, count: int) -> dict[str, Array]:
    """mu [s] as fields of `Draw`; a later stage's position is stamped by the ranging before it."""
    stage = system.stages[index]
    zero = np.zeros(count)
    position: tuple[str, RoleName] = (stage.name, "position")
    if index > 0:
        position = (system.stages[index - 1].name, "ranging")
    return {
        "mu_position_s": shifts.get(position, zero),
        "mu_attitude_s": shifts.get((stage.name, "attitude"), zero),
        "mu_ranging_s": shifts.get((stage.name, "ranging"), zero),
    }


def time_margin_s(system: System) -> float:
    """A time [s] that no relative shift exceeds in practice: all bounds added, normals at 8 std."""
    total = 0.0
    errors = [error for _, error in system.clock_offsets]
    errors += [sensor.timing for stage in system.stages for sensor in entering(stage)]
    for error in errors:
        match error.distribution:
            case Normal(middle, std):
                total += abs(middle) + 8.0 * std
            case Uniform(low, high):
                total += max(abs(low), abs(high))
            case Constant(value):
                total += abs(value)
            case Empirical(values):
                total += max(abs(value) for value in values)
        total += (error.calibrated_s or 0.0) + error.drifted_s
    return total if math.isfinite(total) else 0.0
