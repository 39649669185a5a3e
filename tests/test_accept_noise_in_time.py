"""Sizes of noise of sensors that are hardly told apart: intervals hold the truth in slow noise too.

Two sensors, one alike in all directions, one louder in one direction than in another; each has
white noise and a first-order Gauss-Markov process in each of its three readings.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from syncline_design.diagnosis.noise import NoiseLevel, Slow, Structure, White
from syncline_design.diagnosis.noise_in_time import UNIT, sizes_from
from tests.world.trajectory import Array

ROWS, STEP_S, STUDIES = 400, 0.2, 60
TRUTH = (0.8, 1.3)  # variances over the spec's


def _loadings(rng: np.random.Generator) -> list[Array]:
    alike = np.broadcast_to(np.eye(3), (ROWS, 3, 3))
    weight = np.sqrt(np.array([1.7, 1.0, 0.3]) * (1.0 + 0.1 * rng.uniform(-1.0, 1.0, (ROWS, 3))))
    return [alike, weight[:, :, None] * np.eye(3)]


def _courses(rng: np.random.Generator, share: float, memory_s: float) -> Array:
    """White noise and a share of the variance that is slow, (n, 3)."""
    white, slow = rng.standard_normal((2, ROWS, 3))
    keep = math.exp(-STEP_S / memory_s)
    for k in range(1, ROWS):
        slow[k] = keep * slow[k - 1] + math.sqrt(1.0 - keep**2) * slow[k]
    found: Array = math.sqrt(1.0 - share) * white + math.sqrt(share) * slow
    return found


def _made(rng: np.random.Generator, share: float, memory_s: float) -> tuple[list[Array], Array]:
    own = _loadings(rng)
    error = np.zeros((ROWS, 3))
    for loading, size in zip(own, TRUTH, strict=True):
        error += math.sqrt(size) * np.einsum("nij,nj->ni", loading, _courses(rng, share, memory_s))
    return own, error


def _asked(own: list[Array], error: Array) -> list[tuple[float, float, float]]:
    keys = [("vessel", f"sensor {k}") for k in range(len(own))]
    white = [White(key, UNIT**2 * each @ np.swapaxes(each, 1, 2))
             for key, each in zip(keys, own, strict=True)]  # fmt: skip
    slow = [Slow(key, UNIT * each, True, (1e6,) * 3) for key, each in zip(keys, own, strict=True)]
    structure = Structure(
        np.arange(ROWS) * STEP_S,
        tuple(white),
        tuple(slow),
        np.full((ROWS, 3, 3), 1e-12) * np.eye(3),
    )
    start = NoiseLevel((0.9 / UNIT,) * 2, ((0.1,) * 3,) * 2, ((25.0,) * 3,) * 2)
    return [(s.value, s.low, s.high) for s in sizes_from(structure, error, start)]


@pytest.mark.parametrize(("share", "memory_s"), [(0.0, 1.0), (0.36, 10.0)])
def test_intervals_hold_the_truth_in_white_and_in_slow_noise(share: float, memory_s: float) -> None:
    """19 of 20 of 120 intervals; fewer than 107 by chance in one choice of seeds in 300."""
    rng = np.random.default_rng(11)
    held = 0
    for _ in range(STUDIES):
        found = _asked(*_made(rng, share, memory_s))
        held += sum(low <= true <= high for (_, low, high), true in zip(found, TRUTH, strict=True))
    assert held >= 107, held


def test_an_interval_is_no_narrower_than_the_stretches_of_a_log_agree() -> None:
    """Noise that is loud for a sixteenth of the log: normal noise would be known five times as
    well as what so few loud rows leave."""
    rng = np.random.default_rng(13)
    own, error = _made(rng, 0.0, 1.0)
    error[: ROWS // 16] *= 6.0
    even = _asked(own, _made(np.random.default_rng(13), 0.0, 1.0)[1])
    for (_, low, high), (_, less, more) in zip(_asked(own, error), even, strict=True):
        assert high - low > 3.0 * (more - less)
