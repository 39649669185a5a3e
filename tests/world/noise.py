"""Noise that the world puts on every reading."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tests.world.physics import Faults, NoiseFault
from tests.world.scenarios import Carrier, Scenario
from tests.world.sensing import Reading
from tests.world.trajectory import Array

DEGREE = np.pi / 180.0


@dataclass(frozen=True)
class Noise:
    """How large and of which kind; the defaults are the spec's figures, white and normal.

    wander_share: share of the position variance that is a first-order Gauss-Markov process.
    attitude_wander_share: the same of the attitude.
    family: "normal", "student" (5 degrees of freedom), "uniform" or "laplace", all of the spec's
    standard deviation.  velocity_mps, rate_radps: noise of the motion columns.
    reference_m, reference_rad: noise of the better system of a position log.
    """

    scale: float = 1.0
    wander_share: float = 0.0
    wander_time_s: float = 30.0
    attitude_wander_share: float = 0.0
    attitude_wander_time_s: float = 60.0
    family: str = "normal"
    velocity_mps: float = 0.01
    rate_radps: float = 0.03 * DEGREE
    reference_m: float = 0.001
    reference_rad: float = 0.004 * DEGREE


SILENT = Noise(scale=0.0, velocity_mps=0.0, rate_radps=0.0, reference_m=0.0, reference_rad=0.0)


def unit_draws(rng: np.random.Generator, family: str, shape: tuple[int, ...]) -> Array:
    """Draws of zero mean and unit variance."""
    if family == "normal":
        return rng.standard_normal(shape)
    if family == "student":
        return np.asarray(rng.standard_t(5.0, shape) * np.sqrt(3.0 / 5.0))
    if family == "uniform":
        return rng.uniform(-np.sqrt(3.0), np.sqrt(3.0), shape)
    if family == "laplace":
        return rng.laplace(0.0, np.sqrt(0.5), shape)
    raise KeyError(family)


def gauss_markov(rng: np.random.Generator, stamps_s: Array, std: Array, time_s: float) -> Array:
    """Stationary first-order Gauss-Markov noise (n, k) at uneven stamps."""
    keep = np.exp(-np.diff(stamps_s) / time_s)
    steps = rng.standard_normal((stamps_s.size, std.size))
    walk = np.empty_like(steps)
    walk[0] = steps[0]
    fresh = np.sqrt(1.0 - keep**2)
    for index in range(1, stamps_s.size):
        walk[index] = keep[index - 1] * walk[index - 1] + fresh[index - 1] * steps[index]
    return walk * std


def _white(
    rng: np.random.Generator, sigma: Array, rows: int, noise: Noise, fault: NoiseFault
) -> Array:
    if fault.degrees_of_freedom is not None:
        draws = rng.standard_t(fault.degrees_of_freedom, (rows, sigma.size))
    else:
        draws = unit_draws(rng, noise.family, (rows, sigma.size))
    if fault.outlier_rate > 0.0:
        struck = rng.random(rows) < fault.outlier_rate
        draws[struck] *= rng.uniform(6.0, 15.0, (int(struck.sum()), 1))
    return draws * sigma * fault.scale


def white_sigmas(carrier: Carrier, noise: Noise, position_log: bool) -> dict[str, Array | None]:
    """White standard deviations that the world really puts in, before any noise fault."""
    sensors = carrier.sensors
    position = None if sensors.position_m is None else np.array(sensors.position_m) * noise.scale
    if position is not None:
        position = position * np.sqrt(1.0 - noise.wander_share)
    if position_log:
        attitude = np.full(3, noise.reference_rad)
    else:
        stated = np.array(sensors.attitude_rad)[::-1]  # yaw, pitch, roll
        attitude = stated * noise.scale * np.sqrt(1.0 - noise.attitude_wander_share)
    ranging = None if sensors.ranging is None else np.array(sensors.ranging) * noise.scale
    return {"position": position, "attitude": attitude, "ranging": ranging}


def wanders(carrier: Carrier, noise: Noise, faults: Faults) -> list[tuple[Array, float]]:
    """Gauss-Markov parts of the position noise: (standard deviation per axis, time constant)."""
    listed = list(faults.noise["position"].wander)
    if carrier.sensors.position_m is not None and noise.wander_share > 0.0 and noise.scale > 0.0:
        size = np.array(carrier.sensors.position_m) * noise.scale * np.sqrt(noise.wander_share)
        listed.append((size * faults.noise["position"].scale, noise.wander_time_s))
    return listed


def disturb(run: Scenario, stage: int, reading: Reading, faults: Faults, noise: Noise) -> Reading:
    """The reading with the world's noise on it."""
    carrier, rows = run.carriers[stage], run.stamps_s.size
    sigma = white_sigmas(carrier, noise, run.kind == "position")
    rng = np.random.default_rng([run.seed, 37, stage])
    if reading.antenna_m is not None and sigma["position"] is not None:
        position = _white(rng, sigma["position"], rows, noise, faults.noise["position"])
        for std, time_s in wanders(carrier, noise, faults):
            position = position + gauss_markov(rng, run.stamps_s, std, time_s)
        reading = replace(reading, antenna_m=reading.antenna_m + position)
    attitude = _white(rng, _some(sigma["attitude"]), rows, noise, faults.noise["attitude"])
    if noise.attitude_wander_share > 0.0 and carrier.sensors.attitude_rad is not None:
        size = np.array(carrier.sensors.attitude_rad)[::-1] * np.sqrt(noise.attitude_wander_share)
        time_s = noise.attitude_wander_time_s
        attitude = attitude + gauss_markov(rng, run.stamps_s, size * noise.scale, time_s)
    reading = replace(reading, euler_rad=reading.euler_rad + attitude)
    if reading.polar is not None and sigma["ranging"] is not None:
        ranging = _white(rng, sigma["ranging"], rows, noise, faults.noise["ranging"])
        reading = replace(reading, polar=reading.polar + ranging)
    return reading


def _some(value: Array | None) -> Array:
    assert value is not None
    return value
