"""Ranges that are far off now and then: heavy tails along the line of sight alone.

With R_i the covariance of all but the range in row i, every reading of the size that the log shows,
l_i what one standard deviation of the range does and R = L L',
    y = l' R^-1 e / |L^-1 l|,   lambda = |L^-1 l|^2,
y is 1 + t^2 lambda in variance if ranges are normal, t times the spec's; what is across it says
nothing of them.  Student's t or outliers have to beat that, and by more than the same of any other
sensor, whose noise lies in other directions.  They also have to beat normal noise of another size
in every sixteenth of each covariate: noise that grows with the range or is loud for a while has no
tails.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from syncline_design.diagnosis.fitting import Data, Model, data_of
from syncline_design.diagnosis.loud_readings import MOST_ROWS, VarianceParts, each_reading, fitted
from syncline_design.diagnosis.motion_scatter import lasting
from syncline_design.diagnosis.noise import SensorKey, as_specified, white_covariance
from syncline_design.diagnosis.regimes import covariates
from syncline_design.diagnosis.sensor_tails import (
    SensorTails,
    expected_variance,
    tails_of_any_outliers,
)
from syncline_design.diagnosis.steady import goes_on
from syncline_design.diagnosis.tails import tails_of
from syncline_design.diagnosis.unlike_readings import (
    LEAST_ROWS,
    known_scatter,
    slopes_of_readings,
)
from syncline_design.effects import registry
from syncline_design.effects.record import Array, Effect
from syncline_design.machine.quick_dataclass import dataclass

GAIN: Final = 15.0  # nat by which tails have to beat normal noise, of any size in any regime
BETTER: Final = 5.0  # nat by which tails of ranges beat those of another sensor
PARTS: Final = 16  # of the rows, by a covariate, each with a size of its own
SIZES: Final = np.geomspace(0.2, 50.0, 60)  # times the spec's deviation
RANGE: Final = 0  # place of the range among a ranging sensor's readings


@dataclass(frozen=True, slots=True)
class RangeTails:
    """Tails of one ranging sensor's ranges; gain: nat saved beside normal noise.

    growth (n,): deviation of the range in every row over the spec's, as its error tells.
    """

    sensor: SensorKey
    tails: SensorTails
    gain: float
    growth: Array


@dataclass(frozen=True, slots=True)
class _Along:
    """A sensor's noise beside all other: error (n, k) along axes on which that is one, and the
    sensor's own variance there by the spec (n, k)."""

    error: Array
    own: Array

    def normal(self, times: Array) -> Array:
        """Log density of every row (n, sizes) of normal noise so many times the spec's."""
        variance = 1.0 + times**2 * self.own[:, :, None]
        square = self.error[:, :, None] ** 2 / variance
        total: Array = -0.5 * np.sum(square + np.log(2.0 * np.pi * variance), axis=1)
        return total

    def gain(self, most: float) -> tuple[SensorTails, float]:
        """Tails, and by how much they beat normal noise of one size [nat]; most: of that."""
        found = tails_of_any_outliers(self.error, self.own, np.ones_like(self.own), most)
        return found, found.nats - float(np.max(np.sum(self.normal(SIZES), axis=0)))

    def uneven(self, order: Array) -> float:
        """Log likelihood of normal noise with another size in every part of the rows by order."""
        parts = np.array_split(np.argsort(order, kind="stable"), PARTS)
        density = self.normal(SIZES)
        return float(sum(np.max(np.sum(density[rows], axis=0)) for rows in parts))


def range_tails(data: Data, model: Model, wanted: Collection[SensorKey]) -> tuple[RangeTails, ...]:
    """Tails of the ranges of the sensors that are wanted, in what a model leaves."""
    axes = list(data.axes)
    asked = [part.sensor for part in data.structure.white if part.sensor in wanted]
    if len(data.view) < LEAST_ROWS or not asked:
        return ()
    left = (model.error - lasting(data, model))[:, axes]
    slopes = {sensor: own[:, axes] for sensor, own in slopes_of_readings(data).items()}
    if not _promises(data, left, [slopes[one][:, :, RANGE] for one in asked]):
        return ()
    if goes_on(data.structure.time_s, left, slopes.values()):
        return ()
    fixed = known_scatter(data.structure)[:, axes][:, :, axes]
    motions = [one.direction[:, axes] for one in data.structure.directed]
    seen = _seen(data, left, slopes, motions, fixed)
    found = (_in_ranges(seen, sensor) for sensor in asked)
    return tuple(one for one in found if one is not None)


def with_range_tails(data: Data, found: Sequence[RangeTails]) -> Data:
    """The data with ranges as uncertain in every row as their tails make them."""
    usual, known = slopes_of_readings(data), {one.sensor: one.growth for one in found}
    white = []
    for part in data.structure.white:
        if part.sensor in known:
            slopes = usual[part.sensor].copy()
            slopes[:, :, RANGE] *= known[part.sensor][:, None]
            part = replace(part, unlike=(1.0,) * slopes.shape[2], slopes=slopes)
        white.append(part)
    uneven = data_of(data.view, replace(data.structure, white=tuple(white)))
    return replace(uneven, axes=data.axes, noisier=data.noisier, explained=data.explained)


def _promises(data: Data, left: Array, ranges: Sequence[Array]) -> bool:
    """Whether the error along any line of sight has heavier tails than normal noise at all."""
    axes = list(data.axes)
    spec = white_covariance(data.structure, as_specified(data.structure))
    inverse = np.linalg.inv(spec[:, axes][:, :, axes])
    for along in ranges:
        weighted = np.einsum("nij,nj->ni", inverse, along)
        size = np.sqrt(np.maximum(np.sum(weighted * along, axis=1), np.finfo(float).tiny))
        score = np.sum(weighted * left, axis=1) / size
        if tails_of(score[_thin(score), None]).gain > GAIN:
            return True
    return False


@dataclass(frozen=True, slots=True)
class _Seen:
    """What is left of a log (n, a), what readings do (n, a, k), and the sizes of all noise.

    parts: every reading with its covariance; times: its deviation over the spec's, as fitted.
    fixed (n, a, a) [m2]: what else scatters.  orders: of the rows, by covariates.
    """

    left: Array
    slopes: dict[SensorKey, Array]
    parts: VarianceParts
    times: Array
    fixed: Array
    orders: tuple[Array, ...]

    def rows(self, index: slice) -> _Seen:
        return replace(
            self,
            left=self.left[index],
            slopes={sensor: own[index] for sensor, own in self.slopes.items()},
            parts=tuple(replace(one, squares=one.squares[index]) for one in self.parts),
            fixed=self.fixed[index],
            orders=tuple(one[index] for one in self.orders),
        )

    def beside(self, sensor: SensorKey, readings: Sequence[int]) -> _Along:
        """Some readings of a sensor beside all other noise."""
        total = self.fixed.copy()
        for part, times in zip(self.parts, self.times, strict=True):
            if part.sensor != sensor or part.readings[0] not in readings:
                total += times**2 * part.squares
        lower = np.linalg.cholesky(total)
        alone = np.linalg.solve(lower, self.left[:, :, None])
        own = np.linalg.solve(lower, self.slopes[sensor][:, :, list(readings)])
        turned, size, _ = np.linalg.svd(own, full_matrices=False)
        return _Along((np.swapaxes(turned, 1, 2) @ alone)[:, :, 0], size**2)

    def most(self, sensor: SensorKey, readings: Sequence[int]) -> float:
        """The largest of the readings' deviations over the spec's."""
        pairs = zip(self.parts, self.times, strict=True)
        return max(float(t) for p, t in pairs if p.sensor == sensor and p.readings[0] in readings)


def _seen(
    data: Data, left: Array, slopes: dict[SensorKey, Array], motions: list[Array], fixed: Array
) -> _Seen:
    """The same, of sizes that are fitted to some of the rows."""
    orders = tuple(one.values for one in covariates(data.view))
    parts = each_reading(slopes, motions)
    seen = _Seen(left, slopes, parts, np.ones(len(parts)), fixed, orders)
    few = seen.rows(_thin(left))
    return replace(seen, times=fitted(few.left, few.parts, few.fixed).times)


def _thin(rows: Array) -> slice:
    return slice(None, None, 1 + (len(rows) - 1) // MOST_ROWS)


def _in_ranges(seen: _Seen, sensor: SensorKey) -> RangeTails | None:
    few = seen.rows(_thin(seen.left))
    ranges = few.beside(sensor, (RANGE,))
    tails, gain = ranges.gain(few.most(sensor, (RANGE,)))
    if not gain > GAIN or not is_possible(tails):
        return None
    if any(tails.nats < ranges.uneven(order) + GAIN for order in few.orders):
        return None
    if any(rival > gain - BETTER for rival in _rivals(few, sensor)):
        return None
    every = seen.beside(sensor, (RANGE,))
    variance = expected_variance(every.error, every.own, np.ones_like(every.own), tails)
    return RangeTails(sensor, tails, gain, np.sqrt(variance))


def _rivals(seen: _Seen, sensor: SensorKey) -> Iterator[float]:
    """What tails of all other readings gain, sensor by sensor [nat]."""
    for other, own in seen.slopes.items():
        readings = [k for k in range(own.shape[2]) if (other, k) != (sensor, RANGE)]
        yield seen.beside(other, readings).gain(seen.most(other, readings))[1]


def is_possible(tails: SensorTails) -> bool:
    """Whether tails are such as the effect can have."""
    freedom, rate = tails_effect().parameters
    return tails.degrees_of_freedom >= freedom.low and tails.outlier_rate <= rate.high


def tails_effect() -> Effect:
    """The effect of the dictionary that heavy tails are."""
    return next(one for one in registry().values() if one.opens == "tails")
