"""Sizes of slow noise against dense normal densities."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from syncline_design.diagnosis.slow_sizes import FLAT, LEAST, SIZES, SWEEPS, Channel, Sizing
from syncline_design.effects.record import Array

ROLES: tuple[Channel, ...] = ((("", "position"), 0), (("", "attitude"), 2))
WAVES = 4


def _courses(generator: np.random.Generator, rows: int) -> Array:
    """Columns (n, 2 (1 + WAVES)) of two channels, the second by a lever that varies."""
    phase = np.pi * np.arange(rows) / rows
    waves = np.cos(phase[:, None] * np.arange(WAVES + 1))
    return np.hstack([waves, generator.normal(size=rows)[:, None] * waves])


@pytest.mark.parametrize("free", [0, 2])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_expected_size_is_the_mean_by_the_dense_density(seed: int, free: int) -> None:
    """E[v] by N(0, I + C V C'), every row's covariance written out."""
    generator = np.random.default_rng([7, seed, free])
    columns = _courses(generator, 90)
    wave = np.tile(np.arange(WAVES + 1.0), 2)
    channel = np.repeat([0, 1], WAVES + 1)
    sizing = Sizing(ROLES, channel, wave, np.array([1.0, 2.25]))
    true = np.where(wave > 0, np.array([0.3, 0.02])[channel] / np.maximum(wave, 1), 1.0)
    error = columns @ (np.sqrt(true) * generator.normal(size=len(true)))
    error += generator.normal(size=len(error))
    beside = generator.normal(size=(len(error), free))
    every = np.hstack([beside, columns])
    found = sizing.expected(every.T @ every, every.T @ error, free, sizing.start)

    def log_density(size2: Array) -> float:
        variance = np.where(wave > 0, size2[channel] / np.maximum(wave, 1), FLAT)
        covariance = np.eye(len(error)) + (columns * variance) @ columns.T
        covariance += 1e6 * beside @ beside.T
        return float(multivariate_normal(cov=covariance).logpdf(error))

    slow = sizing.start
    for c in np.tile([0, 1], SWEEPS):
        sizes = np.geomspace(LEAST**2, sizing.limit[c], SIZES)
        logs = np.array([log_density(np.where(np.arange(2) == c, v, slow)) for v in sizes])
        likely = np.exp(logs - logs.max())
        slow[c] = sizes @ likely / likely.sum()
    assert found == pytest.approx(slow, rel=1e-4)


def test_expected_sizes_hold_their_truth_on_average() -> None:
    """Sizes drawn alike likely by their logarithm: the mean of what is expected is the mean of the
    truth, the seed's draws within three standard errors (a chance of 0.3 %)."""
    generator = np.random.default_rng(11)
    wave, channel = np.tile(np.arange(WAVES + 1.0), 2), np.repeat([0, 1], WAVES + 1)
    sizing = Sizing(ROLES, channel, wave, np.ones(2))
    columns = _courses(generator, 60)
    normal = columns.T @ columns
    apart = []
    for _ in range(300):
        size2 = LEAST**2 * (1.0 / LEAST**2) ** generator.uniform(size=2)
        drawn = np.where(wave > 0, size2[channel] / np.maximum(wave, 1), 1.0)
        error = columns @ (np.sqrt(drawn) * generator.normal(size=len(drawn)))
        error += generator.normal(size=len(error))
        apart.append(sizing.expected(normal, columns.T @ error, 0, sizing.start) - size2)
    mean, scatter = np.mean(apart, axis=0), np.std(apart, axis=0) / np.sqrt(len(apart))
    assert np.all(np.abs(mean) < 3.0 * scatter + 0.02)


def test_a_channel_that_the_rows_do_not_see_is_what_it_may_be_on_average() -> None:
    """No information: the mean of the sizes that are weighed."""
    wave, channel = np.tile(np.arange(WAVES + 1.0), 2), np.repeat([0, 1], WAVES + 1)
    sizing = Sizing(ROLES, channel, wave, np.ones(2))
    found = sizing.expected(np.zeros((10, 10)), np.zeros(10), 0, sizing.start)
    assert found == pytest.approx(np.mean(np.geomspace(LEAST**2, 1.0, SIZES)), rel=1e-6)
