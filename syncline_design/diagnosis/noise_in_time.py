"""How large noise is, white and slow together, by the likelihood of a series in time.

A course of slow noise of one sensor looks for minutes like noise of another: rows taken for
independent lay it on either, and say far too surely how much.  So every part a has white noise of
f_a^2 times the spec's variance and first-order Gauss-Markov noise of s_ak times as much as that in
each of its m readings, with one time constant T_a, all free, and
    v_a = f_a^2 (1 + sum_k s_ak / m)
is what it scatters.  Its variance is g' (AI + P)^-1 g, g its slopes by the logarithms, AI the
average information (`noise_bend`), P the prior of the time constants.  Rows whose white noise has
tails, or is louder for a while, tell less: what sixteen stretches of its score differ by, over what
normal noise leaves, is added.  The interval is that of a cube root, which of a mean of squares is
nearly normal.
Sources: Gilmour, Thompson and Cullis, Biometrics 51 (1995); Wilson and Hilferty, Proc. Natl. Acad.
Sci. 17 (1931).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from syncline_design.diagnosis.fitting import Data, Model, finely
from syncline_design.diagnosis.noise import (
    OPEN,
    Bounds,
    NoiseLevel,
    Slow,
    Structure,
    White,
    precision,
)
from syncline_design.diagnosis.noise_bend import average_information
from syncline_design.diagnosis.noise_fit import TIME_SPREAD, Packing, fit_noise
from syncline_design.diagnosis.noise_parts import NoisePart
from syncline_design.effects.record import Array
from syncline_design.logs.log import Rows
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.distributions import student_limit
from syncline_design.model.normal import NORMAL_95

BLOCKS: Final = 16
UNIT: Final = 0.1  # of the spec's deviations, in which factors are far from the prior of the fit
LEAST_FACTOR: Final = 0.2  # of the spec's, to start from
LEAST_SLOW: Final = 0.02  # of the white variance: what is less is as uncertain as that


@dataclass(frozen=True, slots=True)
class SizeInTime:
    """The variance of a part over the spec's, with the ends of its 95 % interval."""

    value: float
    low: float
    high: float


def sizes_in_time(data: Data, model: Model, parts: Sequence[NoisePart]) -> tuple[SizeInTime, ...]:
    """Of every part, white and slow noise together."""
    index = finely(data).noise_rows
    error = np.nan_to_num(model.scatter)[index]
    structure, start = _opened(data, model, parts, index)
    return sizes_from(structure, error, start)


def sizes_from(structure: Structure, error: Array, start: NoiseLevel) -> tuple[SizeInTime, ...]:
    """The same of a structure in units of UNIT, its error (n, 3) [m] and where to start."""
    bounds = Bounds(
        tuple(OPEN for _ in structure.white), tuple((OPEN,) * s.columns for s in structure.slow)
    )
    level, _ = fit_noise(structure, error, bounds, start)
    return _sized(structure, Packing(structure, bounds, ()), level, error)


def _opened(
    data: Data, model: Model, parts: Sequence[NoisePart], index: Rows
) -> tuple[Structure, NoiseLevel]:
    """The log's structure with a white and a slow part of every part, and the model's noise in it.

    In units of UNIT factors are beyond what the fit's prior draws to the spec's.
    """
    usual, level = data.structure.rows(index), model.level
    white: list[White] = []
    slow: list[Slow] = []
    factors, shares, times = [], [], []
    known = {w.sensor: f for w, f in zip(usual.white, level.factor, strict=True)}
    courses = {s.sensor: k for k, s in enumerate(usual.slow)}
    for number, part in enumerate(parts):
        key = (part.sensor[0], f"{part.sensor[1]} {number}")
        one, factor = part.rows(index), max(known[part.sensor], LEAST_FACTOR)
        once = None if one.loading is None else UNIT * one.loading
        white.append(White(key, UNIT**2 * one.covariance, once))
        factors.append(factor / UNIT)
        if (k := courses.get(part.sensor)) is None:
            continue
        own, count = list(part.readings), len(part.readings)
        loading = UNIT * usual.slow[k].loading[:, :, own]
        slow.append(Slow(key, loading, True, (OPEN,) * count, (math.inf,) * count))
        grown = (max(known[part.sensor], 1.0) / factor) ** 2
        shares.append(tuple(grown * level.slow[k][j] for j in own))
        times.append((level.time_constant_s[k][0],) * count)
    structure = replace(usual, white=tuple(white), slow=tuple(slow), directed=(), survey=None)
    return structure, NoiseLevel(tuple(factors), tuple(shares), tuple(times))


def _sized(
    structure: Structure, packing: Packing, level: NoiseLevel, error: Array
) -> tuple[SizeInTime, ...]:
    slow = tuple(tuple(max(v, LEAST_SLOW) for v in own) for own in level.slow)
    at = replace(level, slow=slow)
    known = precision(structure, at)
    found = packing.slopes_at(at, known, error)
    moved = packing.moved(at, known, found)
    information = average_information(known, moved)
    count, columns = len(structure.white), sum(len(own) for own in slow)
    of_times = np.arange(len(information)) >= count + columns
    covariance = _inverse(information + np.diag(of_times / TIME_SPREAD**2))
    scores = _white_scores(structure, at, found.white, moved, found.weighted)
    sizes = []
    values = [value for value, _ in _values(structure, level)]
    for value, (_, slopes) in zip(values, _values(structure, at), strict=True):
        reach = covariance @ slopes
        whites = reach[:count]
        usual = float(whites @ information[:count, :count] @ whites)
        more = _by_stretch(scores @ whites) - usual
        sizes.append(_with_ends(value, float(slopes @ reach) + max(more, 0.0)))
    return tuple(sizes)


def _values(structure: Structure, level: NoiseLevel) -> list[tuple[float, Array]]:
    """v of every part and its slopes by the logarithms that the fit packs."""
    ends = np.cumsum([len(structure.white), *(len(own) for own in level.slow)]).tolist()
    keys = [s.sensor for s in structure.slow]
    found = []
    for number, (white, factor) in enumerate(zip(structure.white, level.factor, strict=True)):
        square = (UNIT * factor) ** 2
        slopes = np.zeros(ends[-1] + len(keys))
        share = 0.0
        if white.sensor in keys:
            k = keys.index(white.sensor)
            own = np.array(level.slow[k])
            share = float(np.mean(own))
            slopes[ends[k] : ends[k + 1]] = square * own / len(own)
        value = square * (1.0 + share)
        slopes[number] = 2.0 * value
        found.append((value, slopes))
    return found


def _white_scores(
    structure: Structure, level: NoiseLevel, white: Array, moved: Array, weighted: Array
) -> Array:
    """What every row adds to the slopes of the NLL by the logarithms of the factors, (n, m).

    Of noise that rows of a stamp share only what its size says, less the mean of all rows.
    """
    found = []
    for k, (part, factor) in enumerate(zip(structure.white, level.factor, strict=True)):
        if structure.shared and part.loading is not None:
            own = -0.5 * np.einsum("ni,ni->n", moved[:, :, k], weighted)
        else:
            own = 2.0 * factor**2 * np.einsum("nij,nij->n", white, part.covariance)
        found.append(own - np.mean(own))
    return np.stack(found, axis=1)


def _by_stretch(score: Array) -> float:
    """Variance of a sum over rows by what stretches of it differ, as wide as so few tell it."""
    sums = np.array([np.sum(own) for own in np.array_split(score, BLOCKS)])
    times = student_limit(0.025, BLOCKS - 1) / NORMAL_95
    return float(times**2 * np.sum(sums**2) * BLOCKS / (BLOCKS - 1))


def _with_ends(value: float, variance: float) -> SizeInTime:
    """The interval of a variance whose cube root is nearly normal; what is less than its own
    standard deviation is no better known than if it were as large as that."""
    deviation = math.sqrt(variance)
    low, high = max(value, 1e-300), max(value, deviation)
    reach = NORMAL_95 * deviation / 3.0
    return SizeInTime(
        value,
        max(math.cbrt(low) - reach / math.cbrt(low) ** 2, 0.0) ** 3,
        (math.cbrt(high) + reach / math.cbrt(high) ** 2) ** 3,
    )


def _inverse(information: Array) -> Array:
    """Of columns scaled alike; nothing for directions that are not seen."""
    scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
    scaled = information / scale[:, None] / scale
    inverse: Array = np.linalg.pinv(scaled, rcond=1e-9, hermitian=True) / scale[:, None] / scale
    return inverse
