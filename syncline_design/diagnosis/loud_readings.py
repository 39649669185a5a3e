"""Whose noise is larger than the spec's: of a sensor as a whole, or of some of its readings.

A bearing that is too noisy looks much like a roll and pitch that are, and one factor for range and
bearings together fits neither of them.  With S_i = F_i + sum_c t_c C_ci the covariance of row i and
t_c the variance over the spec's of what c scatters, the likelihood
    L(t) = -sum_i (log |S_i| + e_i' S_i^-1 e_i) / 2
is compared: t_c of one sensor free, or of some of its readings, all others at most the spec's.
What gains most is taken, again until nothing gains; the readings of a sensor are unlike where they
beat every sensor as a whole in most of the log's blocks.  What scatters along the motion, as jitter
of stamps does, is free throughout: it is no noise of the readings that lie along it.
Source: Searle, Casella, McCulloch, Variance Components (1992), ch. 6.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations
from typing import Final

import numpy as np

from syncline_design.diagnosis.noise import FACTOR_LIMIT, OPEN, SensorKey
from syncline_design.diagnosis.noise_fit import FACTOR_LEAST
from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.distributions import student_limit

MOST_ROWS: Final = 3000
BLOCKS: Final = 16
GAIN: Final = 15.0  # nat that a louder part saves at least
BETTER: Final = 5.0  # nat by which some readings beat every sensor as a whole
CHANCE: Final = 1e-3  # that blocks of one size favour them so much
LOUD: Final = 1.3  # times the spec's deviation that they have
QUIET: Final = 0.7  # of theirs, at most, that the sensor's other readings have
MOST_ROUNDS: Final = 4
Readings = tuple[int, ...]


@dataclass(frozen=True, slots=True)
class ReadingsNoise:
    """Some readings of one sensor and what they scatter: squares (n, a, a) [m2] by the spec."""

    sensor: SensorKey
    readings: Readings
    squares: Array
    is_open: bool = False


VarianceParts = tuple[ReadingsNoise, ...]


@dataclass(frozen=True, slots=True)
class VarianceFit:
    """Deviations over the spec's of every part, and the cost of every row [nat]."""

    parts: VarianceParts
    times: Array
    costs: Array

    @property
    def cost(self) -> float:
        return float(np.sum(self.costs))


@dataclass(frozen=True, slots=True)
class LoudSensor:
    """Deviations of the readings of one sensor over the spec's.

    spread: standard uncertainty of the largest, relative.  gain: nat beside a sensor as a whole.
    """

    sensor: SensorKey
    times: tuple[float, ...]
    spread: float
    gain: float


def loud_readings(
    error: Array, slopes: dict[SensorKey, Array], fixed: Array, motions: Sequence[Array] = ()
) -> tuple[LoudSensor, ...]:
    """Sensors of which some readings alone are too loud.

    error (n, a) [m]; slopes (n, a, k) a sensor: what one standard deviation of a reading does;
    fixed (n, a, a) [m2]: what else scatters; motions (n, a, 1): along what stamps would scatter,
    in any unit.
    """
    thin = slice(None, None, 1 + (len(error) - 1) // MOST_ROWS)
    parts = tuple(_part(sensor, range(own.shape[2]), own[thin]) for sensor, own in slopes.items())
    parts += _motion_parts(parts, [own[thin] for own in motions])
    now, loud = fitted(error[thin], parts, fixed[thin]), dict[SensorKey, float]()
    for _ in range(MOST_ROUNDS):
        wholes = [fitted(error[thin], one, fixed[thin], now) for one in _wholes(now.parts)]
        some = [
            fitted(error[thin], one, fixed[thin], now)
            for one in _some(now.parts, {key: own[thin] for key, own in slopes.items()})
        ]
        whole = min(wholes, key=lambda one: one.cost, default=now)
        best = min(some, key=lambda one: one.cost, default=now)
        if now.cost - min(whole.cost, best.cost) < GAIN:
            break
        sensor = _split(now, best)
        if sensor is not None and _beats(best, whole if whole.cost < now.cost else now):
            loud[sensor] = loud.get(sensor, 0.0) + min(whole.cost, now.cost) - best.cost
            now = best
        elif whole.cost < now.cost - GAIN:
            now = whole
        else:
            break
    if not loud:
        return ()
    spreads = relative_spreads(now, fixed[thin]) / np.sqrt(len(error) / len(error[thin]))
    found = (_loud(now, spreads, sensor, gain) for sensor, gain in loud.items())
    return tuple(one for one in found if one is not None)


def each_reading(slopes: dict[SensorKey, Array], motions: Sequence[Array]) -> VarianceParts:
    """Every reading of every sensor, and every motion, free to be of a size of its own."""
    parts = tuple(
        _part(sensor, (reading,), own, is_open=True)
        for sensor, own in slopes.items()
        for reading in range(own.shape[2])
    )
    return (*parts, *_motion_parts(parts, motions))


def _motion_parts(parts: VarianceParts, motions: Sequence[Array]) -> VarianceParts:
    size = np.sqrt(np.mean([np.trace(np.mean(one.squares, axis=0)) for one in parts]))
    return tuple(_along(place, own, size) for place, own in enumerate(motions))


def _part(
    sensor: SensorKey, readings: Sequence[int], slopes: Array, is_open: bool = False
) -> ReadingsNoise:
    own = slopes[:, :, list(readings)]
    return ReadingsNoise(sensor, tuple(readings), own @ np.swapaxes(own, 1, 2), is_open)


def _along(place: int, motion: Array, size: float) -> ReadingsNoise:
    """Scatter along a motion, of any size: one unit of it as large as a sensor's noise."""
    scale = size / max(float(np.sqrt(np.mean(np.sum(motion**2, axis=1)))), np.finfo(float).tiny)
    own = scale * motion
    return ReadingsNoise(("", f"motion {place}"), (0,), own @ np.swapaxes(own, 1, 2), is_open=True)


def _wholes(parts: Sequence[ReadingsNoise]) -> Iterator[tuple[ReadingsNoise, ...]]:
    """The parts with all of one sensor's free."""
    for sensor in dict.fromkeys(one.sensor for one in parts):
        if not all(one.is_open for one in parts if one.sensor == sensor):
            yield tuple(
                replace(one, is_open=True) if one.sensor == sensor else one for one in parts
            )


def _some(
    parts: Sequence[ReadingsNoise], slopes: dict[SensorKey, Array]
) -> Iterator[tuple[ReadingsNoise, ...]]:
    """The parts with one of them split, some of its readings free."""
    for k, one in enumerate(parts):
        rest = (*parts[:k], *parts[k + 1 :])
        for count in range(1, len(one.readings)):
            for chosen in combinations(one.readings, count):
                others = [r for r in one.readings if r not in chosen]
                own = slopes[one.sensor]
                yield (
                    *rest,
                    _part(one.sensor, others, own, one.is_open),
                    _part(one.sensor, chosen, own, True),
                )


def _split(now: VarianceFit, best: VarianceFit) -> SensorKey | None:
    """Whose readings a fit splits so that some are loud beside the others."""
    if best is now:
        return None
    quiet, loud = sorted(best.times[-2:])
    return best.parts[-1].sensor if loud > LOUD and quiet < QUIET * loud else None


def _beats(one: VarianceFit, other: VarianceFit) -> bool:
    """Whether one is cheaper than another, and that in most of the log's blocks."""
    saved = np.array([np.sum(b) for b in np.array_split(other.costs - one.costs, BLOCKS)])
    total, spread = float(np.sum(saved)), float(np.std(saved, ddof=1)) * np.sqrt(BLOCKS)
    return total > BETTER and total > student_limit(CHANCE, BLOCKS - 1) * spread


def _loud(found: VarianceFit, spreads: Array, sensor: SensorKey, gain: float) -> LoudSensor | None:
    own = [k for k, part in enumerate(found.parts) if part.sensor == sensor]
    times = {reading: float(found.times[k]) for k in own for reading in found.parts[k].readings}
    loudest = max(own, key=lambda k: float(found.times[k]))
    if not found.times[loudest] > LOUD:
        return None
    spread = float(spreads[loudest])
    return LoudSensor(sensor, tuple(times[k] for k in sorted(times)), spread, gain)


def relative_spreads(found: VarianceFit, fixed: Array) -> Array:
    """Standard uncertainty of the logarithm of every part's deviation, by its information.

    I_cd = sum_i tr(S_i^-1 C_ci S_i^-1 C_di) / 2 of the variances.
    """
    squares = np.stack([one.squares for one in found.parts])
    sizes = found.times**2
    total = fixed + (sizes @ squares.reshape(len(sizes), -1)).reshape(fixed.shape)
    turned = sizes[:, None, None, None] * (np.linalg.inv(total) @ squares)
    information = 0.5 * np.einsum("cnij,dnji->cd", turned, turned)
    variance = np.diag(np.linalg.pinv(information, rcond=1e-9, hermitian=True))
    return np.asarray(0.5 * np.sqrt(np.maximum(variance, 0.0)))


def fitted(
    error: Array, parts: Sequence[ReadingsNoise], fixed: Array, start: VarianceFit | None = None
) -> VarianceFit:
    """The deviations of largest likelihood, of what is not open at most the spec's."""
    from scipy.optimize import minimize

    squares = np.stack([_rows_last(one.squares) for one in parts])
    at_rows, by_axis = _rows_last(fixed), np.ascontiguousarray(error.T)
    known = {(one.sensor, one.readings): s for one, s in zip(start.parts, start.times, strict=True)
             } if start is not None else {}  # fmt: skip
    limits = [(np.log(FACTOR_LEAST**2), np.log((OPEN if p.is_open else FACTOR_LIMIT) ** 2))
              for p in parts]  # fmt: skip
    begin = [np.clip(2.0 * np.log(known.get((p.sensor, p.readings), 1.5 if p.is_open else 1.0)),
                     *limit) for p, limit in zip(parts, limits, strict=True)]  # fmt: skip

    def cost(logs: Array) -> tuple[float, Array]:
        costs, slope = _costs(by_axis, squares, at_rows, np.exp(logs))
        return float(np.sum(costs)), slope * np.exp(logs)

    result = minimize(cost, np.array(begin), jac=True, method="L-BFGS-B", bounds=limits,
                      options={"maxiter": 60, "ftol": 1e-7})  # fmt: skip
    costs, _ = _costs(by_axis, squares, at_rows, np.exp(result.x))
    return VarianceFit(tuple(parts), np.exp(0.5 * result.x), costs)


def _rows_last(blocks: Array) -> Array:
    """Blocks (n, a, a) as (a, a, n): every entry of all rows side by side."""
    return np.ascontiguousarray(np.moveaxis(blocks, 0, 2))


def _costs(error: Array, squares: Array, fixed: Array, sizes: Array) -> tuple[Array, Array]:
    """Cost of every row [nat], and the slope of their sum by every variance.

    error (a, n), squares (c, a, a, n), fixed (a, a, n).
    """
    flat = squares.reshape(len(sizes), -1)
    total = fixed + (sizes @ flat).reshape(fixed.shape)
    inverse, logs = _swept(total)
    weighted = np.sum(inverse * error, axis=1)
    costs = 0.5 * (logs + np.sum(error * weighted, axis=0))
    left = inverse - weighted[:, None] * weighted
    return costs, 0.5 * flat @ left.ravel()


def _swept(blocks: Array) -> tuple[Array, Array]:
    """Inverses (a, a, n) and log determinants (n,) of positive blocks, by the sweep operator.

    A library takes a block at a time, which costs more than its few figures do.
    Source: Goodnight, The American Statistician 33 (1979).
    """
    found, logs = blocks.copy(), np.zeros(blocks.shape[2])
    for k in range(len(blocks)):
        pivot, column = found[k, k].copy(), found[:, k].copy()
        logs += np.log(pivot)
        found[k] /= pivot
        row = found[k].copy()
        found -= column[:, None] * row
        found[k], found[:, k] = row, -column / pivot
        found[k, k] = 1.0 / pivot
    return found, logs
