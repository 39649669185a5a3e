"""The noise level of largest likelihood within its bounds, by exact slopes."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.linalg import LinAlgError

from syncline_design.diagnosis.box_newton import CostHere, least
from syncline_design.diagnosis.covariance import Precision
from syncline_design.diagnosis.noise import (
    FACTOR_LIMIT,
    OPEN,
    SLOW_LEAST,
    TIME_USUAL_S,
    Bounds,
    NoiseLevel,
    Structure,
    precision,
)
from syncline_design.diagnosis.noise_bend import average_information, by_times, damped
from syncline_design.diagnosis.noise_slopes import Slopes, noise_slopes, summed_over
from syncline_design.effects.record import Array

TIME_LEAST_S = 0.2
TIME_LEAST_STAMPS = 2.0  # between stamps: noise that is quicker is white in the log
TIME_MOST_S = 120.0
FACTOR_SPREAD = 0.15  # of the prior on log factor, below the limit
TIME_SPREAD = 1.0  # its standard deviation in log T
LONG_SHARE = 1e3  # time constants over the span, from which a series is exact
MEAN_SPREAD = 0.1  # in log variance, by which a mean over the log may exceed what courses show
FACTOR_LEAST = 0.05
LEAST_BEND = 1e-3  # [nat] along any logarithm, of which the log may tell nothing
WORTH = 0.1  # nat that a step has to promise
LOOKS = 40
BEHIND = 2e-3  # of how far one fit is behind another, to which that matters


class Packing:
    """Noise level <-> vector of logarithms, with bounds."""

    def __init__(self, structure: Structure, bounds: Bounds, free_sizes: tuple[int, ...]) -> None:
        self.structure = structure
        self.bounds = bounds
        self.free_sizes = free_sizes
        between = np.diff(np.unique(structure.time_s))
        usual_s = float(np.median(between)) if between.size else 0.0
        self.least_s = float(np.clip(TIME_LEAST_STAMPS * usual_s, TIME_LEAST_S, TIME_USUAL_S))
        self.span_s = max(float(structure.time_s[-1] - structure.time_s[0]), self.least_s)

    def pack(self, level: NoiseLevel) -> Array:
        values = [*level.factor]
        for slow in level.slow:
            values += [max(v, 10 * SLOW_LEAST) for v in slow]
        for part, times in zip(self.structure.slow, level.time_constant_s, strict=True):
            values += times[:1] if part.shared_time else times
        values += [max(level.size[i], 1e-6) for i in self.free_sizes]
        logs = np.log(np.array(values))
        low, high = np.array(self.limits()).T
        packed: Array = np.clip(logs, low, high)
        return packed

    def limits(self) -> list[tuple[float, float]]:
        limits = [(np.log(FACTOR_LEAST), np.log(b)) for b in self.bounds.factor]
        for slow in self.bounds.slow:
            limits += [(np.log(SLOW_LEAST), np.log(b)) for b in slow]
        for part in self.structure.slow:
            count = 1 if part.shared_time else part.columns
            limits += [(np.log(self.least_s), np.log(TIME_MOST_S))] * count
        limits += [(np.log(1e-7), np.log(10.0))] * len(self.free_sizes)
        return limits

    def unpack(self, vector: Array) -> NoiseLevel:
        values = [float(v) for v in np.exp(vector)]
        factor = tuple(values[: len(self.structure.white)])
        at = len(factor)
        slow: list[tuple[float, ...]] = []
        times: list[tuple[float, ...]] = []
        for part in self.structure.slow:
            slow.append(tuple(values[at : at + part.columns]))
            at += part.columns
        for part in self.structure.slow:
            count = 1 if part.shared_time else part.columns
            own = values[at : at + count]
            times.append(tuple(own * part.columns if part.shared_time else own))
            at += count
        size = [0.0] * len(self.structure.directed)
        for i, value in zip(self.free_sizes, values[at:], strict=True):
            size[i] = value
        return NoiseLevel(factor, tuple(slow), tuple(times), tuple(size))

    def slopes_at(self, level: NoiseLevel, known: Precision, error: Array) -> Slopes:
        """Slopes of the NLL by what the covariance is made of."""
        return noise_slopes(known, error, self.structure.time_s, self._constants(level, known))

    def slopes(self, level: NoiseLevel, found: Slopes) -> Array:
        """Slopes of the NLL and the prior by the packed logarithms."""
        factor, slow, sizes = self._sized(level, found.white, found.column)
        inside = np.array(level.factor) < FACTOR_LIMIT
        factor += np.where(inside, np.log(level.factor), 0.0) / FACTOR_SPREAD**2
        usual = [
            np.log(t / TIME_USUAL_S) / TIME_SPREAD**2
            for part, chosen in zip(self.structure.slow, level.time_constant_s, strict=True)
            for t in (chosen[:1] if part.shared_time else chosen)
        ]
        excess, by_time = self._excess_slopes(level)
        constants = np.array(self._of_times(found.time.tolist())) + usual + by_time
        return np.concatenate([factor, slow + excess, constants, sizes])

    def bend(self, level: NoiseLevel, known: Precision, found: Slopes) -> Array:
        """About how the NLL and the prior bend along the packed logarithms, (p, p)."""
        information = average_information(known, self.moved(level, known, found))
        expected = np.concatenate(self._sized(level, found.expected_white, found.expected_column))
        told = np.concatenate(self._sized(level, found.white, found.column))
        times = len(information) - len(expected)
        at = len(expected) - len(self.free_sizes)
        wanted, shown = (np.insert(v, [at] * times, 0.0) for v in (expected, expected - told))
        total = damped(information, wanted, shown) + self._prior_bend(level)
        bend: Array = total + LEAST_BEND * np.eye(len(total))
        return bend

    def moved(self, level: NoiseLevel, known: Precision, found: Slopes) -> Array:
        """C_j C^-1 e (n, 3, p) by every packed logarithm."""
        made = known.loading * found.states[:, None, :]  # by the logarithm of half a scale

        def of_white(covariance: Array) -> Array:
            product: Array = (covariance @ found.weighted[:, :, None])[:, :, 0]
            return product

        def of_columns(columns: slice) -> Array:
            total: Array = 2.0 * np.sum(made[:, :, columns], axis=2)
            return total

        factor, slow, sizes = self._by_size(level, of_white, of_columns)
        constants = self._constants(level, known)
        by_time = by_times(known, found, self.structure.time_s, constants)
        times = self._of_times(list(np.moveaxis(by_time, 2, 0)))
        none = np.zeros(found.weighted.shape)
        return np.stack([none + one for one in (*factor, *slow, *times, *sizes)], axis=2)

    def _prior_bend(self, level: NoiseLevel) -> Array:
        """Second slopes of the prior, as far as they are positive."""
        factors = (np.array(level.factor) < FACTOR_LIMIT) / FACTOR_SPREAD**2
        columns = sum(part.columns for part in self.structure.slow)
        at_time, excess = len(factors) + columns, []
        size = len(self.limits())
        own = np.zeros(size)
        own[: len(factors)] = factors
        k = 0
        for part, over, times in zip(
            self.structure.slow, self._excess(level), level.time_constant_s, strict=True
        ):
            for j, one in enumerate(over):
                slope = np.zeros(size)
                slope[len(factors) + k + j] = 1.0 / MEAN_SPREAD
                place = at_time + (0 if part.shared_time else j)
                slope[place] = mean_share_slope(times[j], self.span_s) / MEAN_SPREAD
                own[place] = TIME_SPREAD**-2
                excess += [np.outer(slope, slope)] if one > 0.0 else []
            k += part.columns
            at_time += 1 if part.shared_time else part.columns
        total: Array = np.diag(own) + sum(excess)
        return total

    def _constants(self, level: NoiseLevel, known: Precision) -> Array:
        """Time constant of every column of the loading [s], 0 of what is new at every stamp."""
        times = [t for own in level.time_constant_s for t in own]
        return np.concatenate([times, np.zeros(known.loading.shape[2] - len(times))])

    def _of_times(self, columns: list[Any]) -> list[Any]:
        """What belongs to the slow columns, summed where these share a time constant."""
        at = 0
        found: list[Any] = []
        for part in self.structure.slow:
            held = columns[at : at + part.columns]
            at += part.columns
            found += [sum(held)] if part.shared_time else held
        return found

    def _sized(self, level: NoiseLevel, white: Array, column: Array) -> tuple[Array, Array, Array]:
        """By the logarithms of factors, slow variances and sizes: from the slopes by covariances.

        white (n, 3, 3): by each row's; column (m,): by the logarithm of each column's scale.
        """
        factor, slow, sizes = self._by_size(
            level, lambda own: summed_over(white, own), lambda own: float(np.sum(column[own]))
        )
        return np.array(factor), np.array(slow), np.array(sizes)

    def _by_size(
        self,
        level: NoiseLevel,
        of_white: Callable[[Array], Any],
        of_columns: Callable[[slice], Any],
    ) -> tuple[list[Any], list[Any], list[Any]]:
        """What goes with the logarithms of factors, slow variances and sizes.

        of_white: what goes with a white covariance (n, 3, 3); of_columns: with the logarithm of the
        scale of some columns of the loading.
        """
        structure = self.structure
        own = np.cumsum([0, *(part.columns for part in structure.slow)]).tolist()
        factor: list[Any] = [
            2.0 * f**2 * of_white(w.grown(level).covariance)
            if not structure.shared or w.loading is None
            else 0.0
            for w, f in zip(structure.white, level.factor, strict=True)
        ]
        for k, part in enumerate(structure.slow):
            index = [w.sensor for w in structure.white].index(part.sensor)
            if level.factor[index] > 1.0:
                factor[index] = factor[index] + of_columns(slice(own[k], own[k + 1]))
        slow = [0.5 * of_columns(slice(k, k + 1)) for k in range(own[-1])]
        if structure.shared:
            return factor, slow, self._shared(level, own[-1], factor, of_columns)
        parts = [(level.size[i], structure.directed[i].direction) for i in self.free_sizes]
        sizes = [2.0 * s**2 * of_white(d @ np.swapaxes(d, 1, 2)) for s, d in parts]
        return factor, slow, sizes

    def _shared(
        self, level: NoiseLevel, at: int, factor: list[Any], of_columns: Callable[[slice], Any]
    ) -> list[Any]:
        """The same of the columns that rows of a stamp share, from column `at` on: added to the
        factors; by the sizes."""
        structure = self.structure
        sizes: dict[int, Any] = dict.fromkeys(self.free_sizes, 0.0)
        at += 0 if structure.stamped is None else structure.stamped.shape[2]
        for k, part in enumerate(structure.white):
            if part.loading is not None:
                width = part.loading.shape[2]
                factor[k] = factor[k] + of_columns(slice(at, at + width))
                at += width
        for i, (directed, size) in enumerate(zip(structure.directed, level.size, strict=True)):
            if size > 0.0:
                width = directed.direction.shape[2]
                if i in sizes:
                    sizes[i] = of_columns(slice(at, at + width))
                at += width
        return list(sizes.values())

    def prior(self, level: NoiseLevel) -> float:
        """Weak prior [nat]: where the log does not tell, factors are 1 and time constants usual."""
        logs = [np.log(min(f, FACTOR_LIMIT)) for f in level.factor]
        total = float(sum(0.5 * (value / FACTOR_SPREAD) ** 2 for value in logs))
        for part, times in zip(self.structure.slow, level.time_constant_s, strict=True):
            used = times[:1] if part.shared_time else times
            total += sum(0.5 * (np.log(t / TIME_USUAL_S) / TIME_SPREAD) ** 2 for t in used)
        return total + sum(0.5 * x**2 for own in self._excess(level) for x in own)

    def _excess(self, level: NoiseLevel) -> list[list[float]]:
        """By how many deviations the means of the slow noise exceed what the log shows of them."""
        found = []
        for k, part in enumerate(self.structure.slow):
            both = zip(level.slow[k], level.time_constant_s[k], part.means, strict=True)
            most = self.bounds.slow[k]
            found.append(
                [
                    max(math.log(v * mean_share(t, self.span_s) / limit) / MEAN_SPREAD, 0.0)
                    if math.isfinite(limit) and open_to < OPEN
                    else 0.0
                    for (v, t, limit), open_to in zip(both, most, strict=True)
                ]
            )
        return found

    def _excess_slopes(self, level: NoiseLevel) -> tuple[Array, Array]:
        """Slopes of their cost by the logarithms of the variances and of the time constants."""
        by_slow: list[float] = []
        by_time: list[float] = []
        for k, own in enumerate(self._excess(level)):
            cost = np.array(own) / MEAN_SPREAD
            times = level.time_constant_s[k]
            held = cost * [mean_share_slope(t, self.span_s) for t in times]
            by_slow += cost.tolist()
            by_time += (
                [float(np.sum(held))] if self.structure.slow[k].shared_time else held.tolist()
            )
        return np.array(by_slow), np.array(by_time)


def mean_share(time_constant_s: float, span_s: float) -> float:
    """Variance that the mean over a span has of unit Gauss-Markov noise, 2r - 2r^2 (1 - e^(-1/r)).

    r = T / span: the integral of exp(-|t - s| / T) over both, over the span squared.
    """
    r = time_constant_s / span_s
    if r > LONG_SHARE:  # the difference below cancels
        return 1.0 - 1.0 / (3.0 * r)
    return 2.0 * r + 2.0 * r * r * math.expm1(-1.0 / r)


def mean_share_slope(time_constant_s: float, span_s: float) -> float:
    """d log mean_share / d log T."""
    r = time_constant_s / span_s
    if r > LONG_SHARE:
        return 1.0 / (3.0 * r - 1.0)
    slope = 2.0 + 4.0 * r * math.expm1(-1.0 / r) + 2.0 * math.exp(-1.0 / r)
    return r * slope / mean_share(time_constant_s, span_s)


def fit_noise(
    structure: Structure,
    error: Array,
    bounds: Bounds,
    start: NoiseLevel,
    free_sizes: tuple[int, ...] = (),
    looks: int = LOOKS,
    behind: float = 0.0,
) -> tuple[NoiseLevel, float]:
    """Noise level of largest likelihood within bounds, and the NLL [nat] reached (no prior in it).

    error (n, 3) [m] on the structure's rows, which holds no errors of a survey; free_sizes: which
    directed parts are fitted; looks: at levels, at most; behind: nat by which what is
    fitted is behind what it is held against, and known to BEHIND of that and no better.
    """
    packing = Packing(structure, bounds, free_sizes)

    def look(place: Array) -> CostHere | None:
        level = packing.unpack(place)
        try:
            known = precision(structure, level)
            found = packing.slopes_at(level, known, error)
        except LinAlgError:
            return None
        total = known.likelihood_of(found.squares) + packing.prior(level)
        slope = packing.slopes(level, found)
        return CostHere(total, slope, lambda: packing.bend(level, known, found))

    def worth(gained: float) -> float:
        return max(WORTH, BEHIND * (behind - gained))

    low, high = np.array(packing.limits()).T
    place, total = least(look, packing.pack(start), (low, high), worth, looks)
    level = packing.unpack(place)
    return level, total - packing.prior(level)
