"""Cramer-Rao bound of hidden parameters on one very log, by the world's own finite differences."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tests.world.estimate import georeference
from tests.world.hidden import Hidden, apply, placed
from tests.world.noise import Noise, wanders, white_sigmas
from tests.world.physics import Faults
from tests.world.scenarios import Scenario
from tests.world.sensing import Reading, listed_truth, read_all
from tests.world.trajectory import Array

STEPS = {"_s": 1e-4, "_m": 1e-3, "_rad": 1e-5, "_radps": 1e-7}
Key = tuple[int, str]  # (index of the effect, parameter)


def all_faults(run: Scenario, effects: tuple[Hidden, ...]) -> tuple[Faults, ...]:
    names = tuple(carrier.name for carrier in run.carriers)
    known = placed(effects, names)
    return tuple(apply(known, run.stamps_s, run.seed, name) for name in names)


def noise_free_error(run: Scenario, effects: tuple[Hidden, ...]) -> Array:
    """Estimate minus listed truth (n, 3) that the effects alone cause."""
    faults = all_faults(run, effects)
    estimate = georeference(run.carriers, read_all(run, faults))
    return estimate - listed_truth(run, faults[-1])


def step_of(parameter: str) -> float:
    for ending in sorted(STEPS, key=len, reverse=True):
        if parameter.endswith(ending):
            return STEPS[ending]
    return 1e-6  # rates, scales and gains have no unit


def slopes(run: Scenario, effects: tuple[Hidden, ...], keys: Sequence[Key]) -> Array:
    """Central differences (n, 3, p) of the noise-free error in the parameters of the keys."""
    columns = []
    for index, parameter in keys:
        step = step_of(parameter)
        at = effects[index].number(parameter)
        if parameter == "time_constant_s":  # a lag cannot be negative
            at = max(at, 2.0 * step)
        ends = []
        for value in (at + step, at - step):
            moved = list(effects)
            moved[index] = effects[index].with_values({parameter: value})
            ends.append(noise_free_error(run, tuple(moved)))
        columns.append((ends[0] - ends[1]) / (2.0 * step))
    return np.stack(columns, axis=2)


def row_covariance(run: Scenario, faults: tuple[Faults, ...], noise: Noise) -> Array:
    """Covariance (n, 3, 3) of the estimate from the white noise of every sensor."""
    readings = read_all(run, faults)
    total = np.zeros((run.stamps_s.size, 3, 3))
    for stage, (carrier, fault) in enumerate(zip(run.carriers, faults, strict=True)):
        sigma = white_sigmas(carrier, noise, run.kind == "position")
        scales = {role: fault.noise[role].scale for role in sigma}
        if (position := sigma["position"]) is not None:
            total += np.diag((position * scales["position"]) ** 2)
        for role, channel in (("attitude", "euler_rad"), ("ranging", "polar")):
            size = sigma[role]
            if size is None:
                continue
            turned = _reading_slope(run, readings, stage, channel) * size * scales[role]
            total += turned @ turned.transpose(0, 2, 1)
    if run.kind == "position":
        total += np.eye(3) * noise.reference_m**2
    return total


def _reading_slope(run: Scenario, readings: tuple[Reading, ...], stage: int, channel: str) -> Array:
    columns = []
    for axis in range(3):
        ends = []
        for sign in (1.0, -1.0):
            values = getattr(readings[stage], channel).copy()
            values[:, axis] += sign * 1e-5
            moved = list(readings)
            moved[stage] = replace(readings[stage], **{channel: values})
            ends.append(georeference(run.carriers, tuple(moved)))
        columns.append((ends[0] - ends[1]) / 2e-5)
    return np.stack(columns, axis=2)


def whitened(
    stamps_s: Array, covariance: Array, wander: list[tuple[Array, float]], signal: Array
) -> Array:
    """Signals (n, 3, p) in units of the noise, as innovations of a filter that knows the noise.

    covariance (n, 3, 3): white part of each row; wander: Gauss-Markov parts per NED axis.
    The sum of squares of the result is the signal's squared Mahalanobis norm.
    """
    if not wander:
        return np.asarray(np.linalg.solve(np.linalg.cholesky(covariance), signal))
    power = np.concatenate([std**2 for std, _ in wander])
    time_s = np.repeat([time for _, time in wander], 3)
    look = np.tile(np.eye(3), len(wander))
    state = np.zeros((power.size, signal.shape[2]))
    spread = np.diag(power)
    result = np.empty_like(signal)
    for row, observed in enumerate(signal):
        if row:
            keep = np.exp(-(stamps_s[row] - stamps_s[row - 1]) / time_s)
            state = keep[:, None] * state
            spread = keep[:, None] * spread * keep + np.diag(power * (1.0 - keep**2))
        cross = spread @ look.T
        lower = np.linalg.cholesky(look @ cross + covariance[row])
        fresh = observed - look @ state
        result[row] = np.linalg.solve(lower, fresh)
        gain = np.linalg.solve(lower, cross.T)
        state = state + gain.T @ result[row]
        spread = spread - gain.T @ gain
    return result


def information(
    run: Scenario, effects: tuple[Hidden, ...], noise: Noise, keys: Sequence[Key]
) -> Array:
    """Fisher information (p, p) of the parameters on this log."""
    faults = all_faults(run, effects)
    slope = slopes(run, effects, keys)
    covariance = row_covariance(run, faults, noise)
    wander = wanders(run.carriers[0], noise, faults[0])
    white = whitened(run.stamps_s, covariance, wander, slope)
    flat = white.reshape(-1, slope.shape[2])
    return np.asarray(flat.T @ flat)


def fitted_keys(effects: tuple[Hidden, ...]) -> list[Key]:
    """Parameters that are numbers and have a slope; the instant of a step has none."""
    return [
        (index, name)
        for index, effect in enumerate(effects)
        for name, value in effect.parameters
        if isinstance(value, float) and not (effect.effect == "timestamp_step" and name == "time_s")
    ]


def cramer_rao(run: Scenario, effects: tuple[Hidden, ...], noise: Noise) -> dict[Key, float]:
    """Smallest standard deviation of each parameter, all of them unknown together, noise known."""
    keys = fitted_keys(effects)
    spread = np.linalg.inv(information(run, effects, noise, keys))
    return {key: float(np.sqrt(spread[i, i])) for i, key in enumerate(keys)}
