"""What figures of the residuals need: where on the track they were, with what motion, how white."""

from __future__ import annotations

import itertools

import numpy as np

from syncline_design.diagnosis.fitting import Data
from syncline_design.diagnosis.noise import white_covariance
from syncline_design.diagnosis.plotted import (
    Arrow,
    NormalPlot,
    PlottedTrack,
    Spectrum,
)
from syncline_design.diagnosis.regimes import covariates
from syncline_design.diagnosis.search import SearchResult
from syncline_design.effects.record import Array
from syncline_design.logs.stamps import per_stamp
from syncline_design.model.distributions import chi_square_limit, normal_limit
from syncline_design.model.figure_text import rounded

ARROWS = 60  # stretches of the log, an arrow each
BANDS = 60  # of the spectrum
LEAST_ROWS = 32
AT_ONCE = 128  # frequencies
SHARES = (0.0005, 0.001, 0.002, 0.005, 0.01, 0.02, 0.05, *(k / 20 for k in range(2, 10)), 0.5)
DIGITS = 6


def listed(values: Array) -> tuple[float, ...]:
    """Plain numbers, as precise as a plot can show."""
    return tuple(rounded(v, DIGITS) for v in values)


def track_of(data: Data, before: Array, after: Array, index: Array) -> PlottedTrack:
    """The way and the mean residuals of stretches of it, horizontal."""
    place = data.view.rows[-1].position_m
    ends = np.unique(np.linspace(0, len(place), ARROWS + 1).astype(int))
    arrows = []
    for a, b in itertools.pairwise(ends):
        middle, first, last = (np.mean(v[a:b, :2], axis=0) for v in (place, before, after))
        arrows.append(Arrow(*listed(np.concatenate([middle, first, last]))))
    rows = index.astype(int)
    return PlottedTrack(listed(place[rows, 0]), listed(place[rows, 1]), tuple(arrows))


def motion_of(data: Data, index: Array) -> dict[str, tuple[float, ...]]:
    """Speed [m/s], turn rate [deg/s], range [m], heading [deg] at the rows that are shown."""
    rows = index.astype(int)
    return {
        one.name: listed(one.values[rows])
        for one in covariates(data.view)
        if one.name in ("speed", "turn_rate", "range", "heading")
    }


def _white(data: Data, result: SearchResult) -> Array:
    """What the named effects and slow noise leave, in its standard deviations (n, a)."""
    model, axes = result.model, list(data.axes)
    covariance = white_covariance(data.structure, model.level)[:, axes][:, :, axes]
    left = (model.error - model.precision.slow_part(model.error))[:, axes]
    white: Array = np.linalg.solve(np.linalg.cholesky(covariance), left[:, :, None])[:, :, 0]
    return white


def spectrum_of(data: Data, result: SearchResult) -> Spectrum | None:
    """Mean power of the whitened remainder in bands of frequency, 1 for white noise (Lomb 1976).

    most: what the highest of the bands of white noise seldom exceeds (one log in a hundred).
    """
    time_s, series = per_stamp(data.view.log.time_s, _white(data, result))
    count = len(time_s)
    if count < LEAST_ROWS:
        return None
    series = series - series.mean(axis=0)
    time_s = time_s - time_s[0]
    cycles = np.arange(1, count // 2) / time_s[-1]
    power = _powers(time_s / time_s[-1], series, cycles.size)
    ends = np.unique(np.geomspace(1, cycles.size + 1, BANDS + 1).astype(int)) - 1
    bands = list(itertools.pairwise(ends))
    wide = np.array([b - a for a, b in bands])
    freedom = 2.0 * wide * series.shape[1]
    limit = chi_square_limit(0.01 / len(bands), freedom) / freedom
    mean = [float(np.mean(power[a:b])) for a, b in bands]
    at = [float(np.sqrt(cycles[a] * cycles[b - 1])) for a, b in bands]
    return Spectrum(listed(np.array(at)), listed(np.array(mean)), listed(limit))


def _powers(share: Array, series: Array, most: int) -> Array:
    """Mean of |sum_t s_t exp(2 pi i k share_t)|^2 / n over a series (n, a), k = 1 to most.

    Turns of AT_ONCE frequencies are made once, and turned on by the first one of every lot.
    """
    count = min(AT_ONCE, most)
    turns = np.exp(2j * np.pi * np.arange(count)[:, None] * share)
    power = [
        np.mean(np.abs(turns @ (np.exp(2j * np.pi * first * share)[:, None] * series)) ** 2, axis=1)
        for first in range(1, most + 1, count)
    ]
    return np.concatenate(power)[:most] / len(series)


def normal_of(data: Data, result: SearchResult) -> NormalPlot:
    """Quantiles of the whitened remainder beside those of the standard normal."""
    shares = np.array([*SHARES, *(1.0 - s for s in reversed(SHARES[:-1]))])
    found = _white(data, result).ravel()
    return NormalPlot(listed(normal_limit(1.0 - shares)), listed(np.quantile(found, shares)))
