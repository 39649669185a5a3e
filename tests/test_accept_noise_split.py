"""Noise split between sensors that are hardly told apart: its intervals hold the truth."""

from __future__ import annotations

import numpy as np

from syncline_design.diagnosis.noise_split import BLOCKS, estimated
from tests.world.trajectory import Array

ROWS, STUDIES = 480, 400


def _parts(rng: np.random.Generator) -> Array:
    """A sensor alike in all directions, and one of other shape by a third, row by row."""
    alike = np.broadcast_to(np.eye(3), (ROWS, 3, 3))
    weight = 1.0 + 0.33 * rng.uniform(-1.0, 1.0, (ROWS, 3))
    return np.stack([alike, weight[:, :, None] * np.eye(3)])


def test_intervals_of_sensors_that_are_hardly_told_apart_hold_the_truth() -> None:
    """19 of 20 normal logs of the spec's own noise, as the page says; two of 100 less by chance."""
    rng = np.random.default_rng(3)
    held = np.zeros(2)
    for _ in range(STUDIES):
        parts = _parts(rng)
        error = np.sqrt(np.einsum("anii->ni", parts)) * rng.standard_normal((ROWS, 3))
        values, reach = estimated(error, parts, np.zeros((ROWS, 3, 3)))
        held += np.abs(values - 1.0) <= reach
    assert np.all(held / STUDIES > 0.94), held / STUDIES


def test_stretches_that_happen_to_agree_make_no_estimate_surer_than_normal_noise_can() -> None:
    """One stretch sixteen times over: leaving out any of them changes nothing."""
    rng = np.random.default_rng(5)
    own = _parts(rng)[:, : ROWS // BLOCKS]
    error = np.sqrt(np.einsum("anii->ni", own)) * rng.standard_normal((ROWS // BLOCKS, 3))
    parts, every = np.tile(own, (1, BLOCKS, 1, 1)), np.tile(error, (BLOCKS, 1))
    _, reach = estimated(every, parts, np.zeros((ROWS, 3, 3)))
    alone = 1.96 * np.sqrt(2.0 / (3.0 * ROWS))  # of one sensor, of 3 n readings
    assert np.all(reach > 2.0 * alone)
