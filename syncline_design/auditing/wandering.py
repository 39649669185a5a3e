"""A clock that wanders: one course to and fro, where steps and locks explain it no better.

A random walk can be told as a dozen steps, locks and drifts, none of which is there.  So what was
named is held against a walk: of what stamps show against the count of messages (`witness`),
-2 log L of a walk beside white noise, once as it is and once with every named shape taken out.
Shapes that a clock made leave next to nothing to walk, and gain far more than their figures cost;
of a walk they take a few increments, while it goes on walking.

y(t) = line + walk(t) + white, walk with a variance of q a second (Harvey 1989, Forecasting,
Structural Time Series Models and the Kalman Filter: the local level).  Differences of neighbours
have var = q dt + 2 r, cov = -r.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from syncline_design.auditing.blocks import Blocks, blocks_of
from syncline_design.auditing.cadence import Cadence, cadence
from syncline_design.auditing.naming import PLACES, wandering_rates
from syncline_design.auditing.result import StampFault
from syncline_design.auditing.series import Array, Series, in_words, seconds
from syncline_design.auditing.witness import against_count, bent, is_stamps, witness_of
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import signed, to_digits

_RATIOS: Final = np.concatenate([[0.0], np.geomspace(1e-4, 1e4, 33)])  # of q dt to r
_FIGURES: Final = 3.0  # of a shape: size, place, and an end or a time constant
_TO_AND_FRO: Final = 10.0  # of -2 log L: so much better is a walk than white noise
_BEYOND: Final = 2.0  # grains: a beat with a grid stays within one


@dataclass(frozen=True, slots=True, eq=False)
class Wandering:
    """The series without a wandering clock's course, and the fault that this is."""

    series: Series
    fault: StampFault


def wandering(
    series: Series, freed: Series, shapes: int, least_s: float
) -> Wandering | None:  # fmt: skip
    """The one course that stands for so many shapes; None where these tell more.

    freed: the series with the shapes taken out.  least_s: what a grid of the stamps may move.
    """
    if series.receive is None:
        return None
    places = series.places()
    pace = cadence(series)
    blocks = blocks_of(series.seconds[places], _late(series, places))
    if blocks is None or not np.array_equal(places, freed.places()):
        return None
    told = witness_of(series, pace, blocks)
    rest = witness_of(freed, cadence(freed), blocks)
    if told is None or rest is None or not is_stamps(told, blocks, _BEYOND * least_s):
        return None
    whole, left = _walk(told.time_s, told.level_s), _walk(rest.time_s, rest.level_s)
    cost = _FIGURES * shapes * math.log(told.time_s.size)
    if whole.fit > left.fit + cost or whole.white - whole.fit < _TO_AND_FRO:
        return None
    return _freed(series, pace, blocks, whole)


def _late(series: Series, places: NDArray[np.intp]) -> Array:
    assert series.receive is not None
    late = seconds((series.receive - series.stamp)[places])
    return np.asarray(late - np.median(late))


@dataclass(frozen=True, slots=True)
class _Walk:
    """-2 log L of a walk and of white noise alone; q: variance of the walk a second [s^2/s]."""

    fit: float
    white: float
    q: float


def _walk(time_s: Array, level_s: Array) -> _Walk:
    """The likeliest walk beside white noise, a line taken off first."""
    apart = np.diff(bent(level_s, time_s))
    dt = np.diff(time_s) / float(np.median(np.diff(time_s)))
    told = [profiled(apart, dt, float(ratio)) for ratio in _RATIOS]
    best = int(np.argmin([fit for fit, _ in told]))
    r = told[best][1]
    usual = float(np.median(np.diff(time_s)))
    return _Walk(told[best][0], told[0][0], float(_RATIOS[best]) * r / usual)


def profiled(apart: Array, dt: Array, ratio: float) -> tuple[float, float]:
    """(-2 log L, r) of differences, at the likeliest r; ratio: of q dt to r."""
    from scipy.linalg import cholesky_banded, solveh_banded

    banded = np.zeros((2, apart.size))
    banded[0] = ratio * dt + 2.0
    banded[1, :-1] = -1.0
    factor = cholesky_banded(banded, lower=True)
    square = float(apart @ solveh_banded(banded, apart, lower=True))
    r = max(square / apart.size, 1e-30)
    return apart.size * math.log(r) + 2.0 * float(np.sum(np.log(factor[0]))), r


def _freed(series: Series, pace: Cadence, blocks: Blocks, walk: _Walk) -> Wandering:
    """Stamps put back by the walk, and by the line along which receipts run away from them."""
    places = series.places()
    time_s = series.seconds[places]
    course = -smoothed(bent(against_count(series, pace), time_s), time_s, walk.q)
    use = blocks.usable
    level = blocks.low_s[use] - np.interp(blocks.time_s[use], time_s, course)
    line = np.polynomial.polynomial.polyfit(blocks.time_s[use], level, 1)
    course += line[1] * time_s
    course -= float(np.median(course[: blocks.edges[1]]))
    late = seconds((series.receive - series.stamp)[places]) - course  # type: ignore[operator]
    course -= _ahead(late, float(np.ptp(course)))
    return Wandering(series.stamped_later(course), _fault(time_s, -course))


def _ahead(late: Array, span_s: float) -> float:
    """By how much [s] the stamps are to be earlier so that none lies after its receipt, where the
    clock wandered as far: then it was ahead when the log began."""
    least = float(np.min(late))
    return -least if -span_s < least < 0.0 else 0.0


def smoothed(apart: Array, time_s: Array, q: float) -> Array:
    """The walk beside a jitter of single stamps: the local level's smoother, run both ways.

    Its weights fall by a factor of theta a message, theta + 1 / theta = 2 + q dt / r.
    """
    from scipy.signal import filtfilt

    step = q * float(time_s[-1] - time_s[0]) / max(time_s.size - 1, 1)
    jitter = max(0.5 * (float(np.var(np.diff(apart))) - step), 1e-3 * step, 1e-30)
    ratio = step / jitter
    theta = 1.0 + 0.5 * ratio - math.sqrt(ratio + 0.25 * ratio * ratio)
    return np.asarray(filtfilt([1.0 - theta], [1.0, -theta], apart))


def _fault(time_s: Array, moved: Array) -> StampFault:
    grid = np.linspace(float(time_s[0]), float(time_s[-1]), PLACES)
    parameters = wandering_rates(grid, np.interp(grid, time_s, moved))
    parameters["span_s"] = span_s = float(np.ptp(moved))
    ppm, low, high = (float(parameters[key]) for key in ("ppm", "ppm_low", "ppm_high"))
    return StampFault(
        "drift", parameters, None, None,
        f"stamps wander to and fro against receipts, within {in_words(span_s)}, and so they do "
        f"against the sensor's own rhythm; between {signed(low, 3)} and {signed(high, 3)} ppm, "
        f"{to_digits(abs(ppm), 3)} ppm {'fast' if ppm > 0 else 'slow'} in the mean",
    )  # fmt: skip
