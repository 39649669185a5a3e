"""Hidden effects: each one changes the physical system, never the estimate.

Signs.  Parameters describe the world: a reading is the true value plus a bias, or times one plus
a scale; a true mounting is the spec's plus the parameter, R_true = R_spec exp(S(v)); a latency is
the age of the data at their stamp.  A clock that is fast by `rate`, a stamp that jumps by
`step_s`, and stamps ahead by whole `seconds` make the data older by the same amount, since
stamp = true time + error.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from tests.world.physics import Faults
from tests.world.trajectory import Array

SOUND_MPS = 1500.0
XYZ = ("x", "y", "z")


@dataclass(frozen=True)
class Hidden:
    """One hidden effect: name, sensor it sits on, stage (None: the first that has it)."""

    effect: str
    sensor: str
    parameters: tuple[tuple[str, float | str], ...]
    stage: str | None = None

    def number(self, name: str) -> float:
        return float(dict(self.parameters)[name])

    def vector(self, unit: str) -> Array:
        """The x, y, z parameters of a unit; axes not given are zero."""
        given = dict(self.parameters)
        return np.array([float(given.get(f"{axis}_{unit}", 0.0)) for axis in XYZ])

    def with_values(self, values: dict[str, float]) -> Hidden:
        merged = {**dict(self.parameters), **values}
        return Hidden(self.effect, self.sensor, tuple(merged.items()), self.stage)


def hidden(effect: str, sensor: str, stage: str | None = None, **parameters: float | str) -> Hidden:
    """A hidden effect by its dictionary name; parameters carry their unit in the name."""
    if (effect, sensor) not in CONSTRUCTIONS:
        raise KeyError(f"no such effect in the world: {effect} of {sensor}")
    return Hidden(effect, sensor, tuple(parameters.items()), stage)


Draw = np.random.Generator
Construction = Callable[[Faults, Hidden, Array, Draw], None]


def _latency(faults: Faults, effect: Hidden, stamps_s: Array, draw: Draw) -> None:
    old = effect.number("latency_s")
    faults.age[effect.sensor].append(lambda t: np.full_like(t, old))


def _clock_drift(faults: Faults, effect: Hidden, stamps_s: Array, draw: Draw) -> None:
    rate, start = effect.number("rate"), stamps_s[0]
    # the clock shows start + (1 + rate)(true - start); its reading is the stamp
    faults.age[effect.sensor].append(lambda t: (t - start) * (1.0 - 1.0 / (1.0 + rate)))


def _timestamp_step(faults: Faults, effect: Hidden, stamps_s: Array, draw: Draw) -> None:
    step, when = effect.number("step_s"), effect.number("time_s")
    faults.age[effect.sensor].append(lambda t: np.where(t >= when, step, 0.0))


def _integer_second_slip(faults: Faults, effect: Hidden, stamps_s: Array, draw: Draw) -> None:
    seconds = effect.number("seconds")
    faults.age[effect.sensor].append(lambda t: np.full_like(t, seconds))


def _timestamp_jitter(faults: Faults, effect: Hidden, stamps_s: Array, draw: Draw) -> None:
    late = draw.normal(0.0, effect.number("std_s"), stamps_s.size)
    faults.age[effect.sensor].append(lambda t: late)


def _packetised(faults: Faults, effect: Hidden, stamps_s: Array, draw: Draw) -> None:
    """Data wait for the next packet, which stamps them all: their age is what they waited."""
    interval = effect.number("interval_s")
    waited = draw.uniform(0.0, interval, stamps_s.size)
    faults.age[effect.sensor].append(lambda t: waited)


def _filter_lag(faults: Faults, effect: Hidden, stamps_s: Array, draw: Draw) -> None:
    faults.lag_s += effect.number("time_constant_s")


def _position_arm(faults: Faults, effect: Hidden, stamps_s: Array, draw: Draw) -> None:
    faults.antenna_moved_m = faults.antenna_moved_m + effect.vector("m")


def _ranging_arm(faults: Faults, effect: Hidden, stamps_s: Array, draw: Draw) -> None:
    faults.ranging_moved_m = faults.ranging_moved_m + effect.vector("m")


def _boresight(faults: Faults, effect: Hidden, stamps_s: Array, draw: Draw) -> None:
    faults.ranging_turned = faults.ranging_turned * Rotation.from_rotvec(effect.vector("rad"))


def _mounting(faults: Faults, effect: Hidden, stamps_s: Array, draw: Draw) -> None:
    faults.attitude_turned = faults.attitude_turned * Rotation.from_rotvec(effect.vector("rad"))


def _range_bias(faults: Faults, effect: Hidden, stamps_s: Array, draw: Draw) -> None:
    bias = effect.number("bias_m")
    faults.range_added.append(lambda t, r: np.full_like(r, bias))


def _range_scale(faults: Faults, effect: Hidden, stamps_s: Array, draw: Draw) -> None:
    scale = effect.number("scale")
    faults.range_added.append(lambda t, r: scale * r)


def _sound_speed(faults: Faults, effect: Hidden, stamps_s: Array, draw: Draw) -> None:
    """The processing's sound speed is too high by a share; times and delays are as measured."""
    used = 1.0 + effect.number("relative_error")
    faults.range_added.append(lambda t, r: used * SOUND_MPS * (r / SOUND_MPS) - r)
    faults.sound_used *= used


def _turnaround(faults: Faults, effect: Hidden, stamps_s: Array, draw: Draw) -> None:
    """The transponder answers late by delay_s more than the processing takes off."""
    wait = effect.number("delay_s")
    faults.range_added.append(
        lambda t, r: 0.5 * SOUND_MPS * (2.0 * r / SOUND_MPS + wait) - r,
    )


def _azimuth_bias(faults: Faults, effect: Hidden, stamps_s: Array, draw: Draw) -> None:
    faults.azimuth_bias_rad += effect.number("bias_rad")


def _elevation_bias(faults: Faults, effect: Hidden, stamps_s: Array, draw: Draw) -> None:
    faults.elevation_bias_rad += effect.number("bias_rad")


def _heading_bias(faults: Faults, effect: Hidden, stamps_s: Array, draw: Draw) -> None:
    bias = effect.number("bias_rad")
    faults.yaw_added.append(lambda t, yaw: np.full_like(yaw, bias))


def _hard_iron(faults: Faults, effect: Hidden, stamps_s: Array, draw: Draw) -> None:
    sine, cosine = effect.number("sin_rad"), effect.number("cos_rad")
    faults.yaw_added.append(lambda t, yaw: sine * np.sin(yaw) + cosine * np.cos(yaw))


def _soft_iron(faults: Faults, effect: Hidden, stamps_s: Array, draw: Draw) -> None:
    sine, cosine = effect.number("sin_rad"), effect.number("cos_rad")
    faults.yaw_added.append(lambda t, yaw: sine * np.sin(2.0 * yaw) + cosine * np.cos(2.0 * yaw))


def _squat(faults: Faults, effect: Hidden, stamps_s: Array, draw: Draw) -> None:
    """The hull sinks, the height that is used does not: it is too high."""
    sinkage = effect.number("sinkage_m")
    faults.height_lost.append(lambda t, speed: -sinkage * speed**2)


def _tide(faults: Faults, effect: Hidden, stamps_s: Array, draw: Draw) -> None:
    rate, start = effect.number("rate_mps"), stamps_s[0]
    faults.height_lost.append(lambda t, speed: rate * (t - start))


def _heading_drift(faults: Faults, effect: Hidden, stamps_s: Array, draw: Draw) -> None:
    rate, start = effect.number("rate_radps"), stamps_s[0]
    faults.yaw_added.append(lambda t, yaw: rate * (t - start))


def _acceleration_tilt(faults: Faults, effect: Hidden, stamps_s: Array, draw: Draw) -> None:
    faults.pendulum_gain += effect.number("gain")


def _flexure(faults: Faults, effect: Hidden, stamps_s: Array, draw: Draw) -> None:
    given = dict(effect.parameters)
    bends = [float(given.get(axis, given.get(f"{axis}_m_per_mps2", 0.0))) for axis in XYZ]
    faults.ranging_bends = faults.ranging_bends + np.array(bends)


def _scan(faults: Faults, effect: Hidden, stamps_s: Array, draw: Draw) -> None:
    faults.scan_period_s += effect.number("period_s")


def _heave_arm(faults: Faults, effect: Hidden, stamps_s: Array, draw: Draw) -> None:
    faults.heave_sensor_moved_m = faults.heave_sensor_moved_m + effect.vector("m")


def _datum(faults: Faults, effect: Hidden, stamps_s: Array, draw: Draw) -> None:
    offset = np.array([effect.number(f"{axis}_m") for axis in ("north", "east", "down")])
    faults.target_listed.append(lambda p: p + offset)


def _grid_scale(faults: Faults, effect: Hidden, stamps_s: Array, draw: Draw) -> None:
    scale = effect.number("scale")
    faults.target_listed.append(lambda p: p * np.array([1.0 + scale, 1.0 + scale, 1.0]))


def _grid_convergence(faults: Faults, effect: Hidden, stamps_s: Array, draw: Draw) -> None:
    turn = Rotation.from_euler("z", effect.number("rotation_rad"))
    faults.target_listed.append(turn.apply)


def _convention(faults: Faults, effect: Hidden, stamps_s: Array, draw: Draw) -> None:
    faults.convention[effect.sensor] = str(dict(effect.parameters)["convention"])


def _understated(faults: Faults, effect: Hidden, stamps_s: Array, draw: Draw) -> None:
    faults.noise[effect.sensor].scale *= effect.number("factor")


def _correlated(faults: Faults, effect: Hidden, stamps_s: Array, draw: Draw) -> None:
    std = effect.number("std_m")
    wander = (np.full(3, std), effect.number("time_constant_s"))
    faults.noise["position"].wander.append(wander)


def _height_drift(faults: Faults, effect: Hidden, stamps_s: Array, draw: Draw) -> None:
    std = np.array([0.0, 0.0, effect.number("std_m")])
    faults.noise["position"].wander.append((std, effect.number("time_constant_s")))


def _heavy_tails(faults: Faults, effect: Hidden, stamps_s: Array, draw: Draw) -> None:
    given = dict(effect.parameters)
    if "degrees_of_freedom" in given:
        faults.noise["position"].degrees_of_freedom = float(given["degrees_of_freedom"])
    faults.noise["position"].outlier_rate = float(given.get("outlier_rate", 0.0))


STOCHASTIC = {
    "timestamp_jitter",
    "packetised_timestamps",
    "noise_understated",
    "correlated_noise",
    "heavy_tails",
    "height_drift",
}
DISCRETE = {"integer_second_slip", "frame_convention"}
CONSTRUCTIONS: dict[tuple[str, str], Construction] = {
    ("latency", "position"): _latency,
    ("latency", "attitude"): _latency,
    ("latency", "ranging"): _latency,
    ("clock_drift", "position"): _clock_drift,
    ("clock_drift", "attitude"): _clock_drift,
    ("clock_drift", "ranging"): _clock_drift,
    ("timestamp_step", "position"): _timestamp_step,
    ("timestamp_step", "attitude"): _timestamp_step,
    ("timestamp_step", "ranging"): _timestamp_step,
    ("integer_second_slip", "position"): _integer_second_slip,
    ("timestamp_jitter", "position"): _timestamp_jitter,
    ("timestamp_jitter", "attitude"): _timestamp_jitter,
    ("timestamp_jitter", "ranging"): _timestamp_jitter,
    ("packetised_timestamps", "position"): _packetised,
    ("packetised_timestamps", "attitude"): _packetised,
    ("filter_lag", "position"): _filter_lag,
    ("lever_arm", "position"): _position_arm,
    ("lever_arm", "ranging"): _ranging_arm,
    ("boresight", "ranging"): _boresight,
    ("mounting", "attitude"): _mounting,
    ("range_bias", "ranging"): _range_bias,
    ("range_scale", "ranging"): _range_scale,
    ("azimuth_bias", "ranging"): _azimuth_bias,
    ("elevation_bias", "ranging"): _elevation_bias,
    ("heading_bias", "attitude"): _heading_bias,
    ("heading_hard_iron", "attitude"): _hard_iron,
    ("heading_soft_iron", "attitude"): _soft_iron,
    ("heading_drift", "attitude"): _heading_drift,
    ("acceleration_tilt", "attitude"): _acceleration_tilt,
    ("flexure", "ranging"): _flexure,
    ("noise_understated", "position"): _understated,
    ("noise_understated", "attitude"): _understated,
    ("noise_understated", "ranging"): _understated,
    ("correlated_noise", "position"): _correlated,
    ("heavy_tails", "position"): _heavy_tails,
    ("datum_offset", "target"): _datum,
    ("height_drift", "position"): _height_drift,
    ("grid_scale", "target"): _grid_scale,
    ("grid_convergence", "target"): _grid_convergence,
    ("frame_convention", "position"): _convention,
    ("frame_convention", "attitude"): _convention,
    ("frame_convention", "ranging"): _convention,
    ("scan_distortion", "ranging"): _scan,
    ("sound_speed", "ranging"): _sound_speed,
    ("turnaround_delay", "ranging"): _turnaround,
    ("induced_heave", "position"): _heave_arm,
    ("squat", "position"): _squat,
    ("tide", "position"): _tide,
}


def apply(effects: tuple[Hidden, ...], stamps_s: Array, seed: int, stage: str) -> Faults:
    """The faults that a set of effects causes in one stage.

    Each effect draws from its own generator, so the same call gives the same faults, and a
    change of one parameter changes nothing else.
    """
    faults = Faults()
    for index, effect in enumerate(effects):
        if effect.stage == stage:
            draw = np.random.default_rng([seed, 23, index])
            CONSTRUCTIONS[effect.effect, effect.sensor](faults, effect, stamps_s, draw)
    return faults


def placed(effects: tuple[Hidden, ...], stages: tuple[str, ...]) -> tuple[Hidden, ...]:
    """Effects with their stage filled in: the first, the last for a target."""
    default = {"target": stages[-1]}
    return tuple(
        Hidden(e.effect, e.sensor, e.parameters, e.stage or default.get(e.sensor, stages[0]))
        for e in effects
    )
