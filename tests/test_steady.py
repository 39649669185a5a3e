"""What goes on from row to row is no white noise, in whichever sensor's frame it does."""

from __future__ import annotations

import numpy as np
import pytest

from syncline_design.diagnosis.steady import goes_on

ROWS = 300
TIME_S = np.arange(ROWS) * 0.2


def beams(rng: np.random.Generator) -> np.ndarray:
    """Unit vectors (n, 3, 1) to ever other targets."""
    ways = rng.normal(size=(ROWS, 3, 1))
    found: np.ndarray = ways / np.linalg.norm(ways, axis=1, keepdims=True)
    return found


PLACES = np.broadcast_to(0.01 * np.eye(3), (ROWS, 3, 3))


@pytest.mark.parametrize("seed", range(5))
def test_a_place_that_drifts_off_goes_on_though_ranges_to_other_targets_do_not(seed: int) -> None:
    rng = np.random.default_rng(seed)
    ways = beams(rng)
    course = np.outer(np.linspace(0.0, 1.0, ROWS) ** 2, [-0.4, -0.8, -0.4])
    left = course + 0.1 * rng.normal(size=course.shape)
    assert not goes_on(TIME_S, left, [ways])
    assert goes_on(TIME_S, left, [ways, PLACES])


@pytest.mark.parametrize("seed", range(5))
def test_ranges_that_are_off_go_on_though_places_do_not(seed: int) -> None:
    rng = np.random.default_rng(seed)
    ways = beams(rng)
    left = 0.3 * ways[:, :, 0] + 0.05 * rng.normal(size=(ROWS, 3))
    assert not goes_on(TIME_S, left, [PLACES])
    assert goes_on(TIME_S, left, [PLACES, ways])


@pytest.mark.parametrize("seed", range(5))
def test_noise_of_ranges_or_of_places_does_not_go_on(seed: int) -> None:
    rng = np.random.default_rng(seed)
    ways = beams(rng)
    of_ranges = ways[:, :, 0] * rng.normal(size=(ROWS, 1))
    of_places = rng.normal(size=(ROWS, 3))
    for left in (of_ranges, of_places):
        assert not goes_on(TIME_S, left, [PLACES, ways])


def test_rows_of_one_stamp_share_the_noise_of_the_place() -> None:
    """Ten targets at a stamp: that is no course."""
    rng = np.random.default_rng(1)
    left = np.repeat(rng.normal(size=(ROWS // 10, 3)), 10, axis=0)
    assert not goes_on(np.repeat(np.arange(ROWS // 10) * 1.0, 10), left, [PLACES])
    assert goes_on(TIME_S, left, [PLACES])
