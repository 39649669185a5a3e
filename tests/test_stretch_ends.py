"""Where a stretch begins and ends, and whether what is left is one: against made courses."""

from __future__ import annotations

import numpy as np
import pytest

from syncline_design.diagnosis.one_course import MOST_OF_IT, one_course
from syncline_design.diagnosis.stretch_ends import MARGIN, ends
from syncline_design.diagnosis.stretch_windows import BlockSums, cumulated
from syncline_design.effects.record import Array

LABEL = ("lever_arm", "position", 0)
ROWS = 1000


def saved(noise: Array, size: float, first: int, last: int) -> tuple[Array, Array]:
    """g and x' W x of rows of unit noise, of which some are off by `size`."""
    row = np.arange(len(noise))
    left = noise + size * ((row >= first) & (row <= last))
    return size * (left - size / 2.0), np.full(len(noise), size**2)


@pytest.mark.parametrize("size", [0.6, 1.5, 6.0])
def test_the_ends_are_found_within_their_margin(size: float) -> None:
    """Of 300 windows that are off by up to a quarter at either end, 19 of 20 at least."""
    rng = np.random.default_rng(4)
    held, off = 0, []
    for _ in range(300):
        first, length = int(rng.integers(100, 500)), int(rng.integers(100, 300))
        last = first + length - 1
        window = np.array([first, last]) + rng.integers(-length // 4, length // 4, 2)
        found = ends(*saved(rng.standard_normal(ROWS), size, first, last), *map(int, window))
        away = max(abs(found.first - first), abs(found.last - last))
        held += away <= found.margin
        off.append(away)
        assert found.margin <= MARGIN * (found.last - found.first + 1) + 3
    assert held >= 285
    assert np.median(off) <= 6.0 / size**2 + 1.0


def test_a_stretch_that_reaches_the_end_of_a_log_ends_there() -> None:
    rng = np.random.default_rng(5)
    found = ends(*saved(rng.standard_normal(ROWS), 3.0, 700, ROWS - 1), 650, 960)
    assert abs(found.first - 700) <= 2
    assert found.last >= ROWS - 3


def sums(error: Array) -> BlockSums:
    """Of a constant of every component, in unit noise."""
    n = len(error)
    eye = np.broadcast_to(np.eye(3), (n, 3, 3))
    edges = np.arange(n + 1)
    parts = (eye, error[:, None, :], np.sum(error**2, axis=1), np.full(n, 3.0))
    normal, score, square, count = (cumulated(part, edges) for part in parts)
    return BlockSums(normal, score, square, count, edges, np.arange(n) / 10.0)


def wandering(rng: np.random.Generator, times: float, constant_rows: float) -> Array:
    """Gauss-Markov noise beside white noise of one, (n, 3)."""
    kept = np.exp(-1.0 / constant_rows)
    course = np.empty((ROWS, 3))
    course[0] = rng.standard_normal(3)
    for k in range(1, ROWS):
        course[k] = kept * course[k - 1] + np.sqrt(1.0 - kept**2) * rng.standard_normal(3)
    return times * course + rng.standard_normal((ROWS, 3))


@pytest.mark.parametrize(("from_row", "to_row"), [(300, 600), (400, ROWS), (0, 250)])
def test_a_knock_is_one_course(from_row: int, to_row: int) -> None:
    """Also where a constant of the whole log has taken its part of it already."""
    rng = np.random.default_rng(6)
    row = np.arange(ROWS)
    for size in (1.5, 6.0):
        knock = np.where((row >= from_row) & (row < to_row), size, 0.0)
        for constant in (0.0, knock.mean()):
            error = rng.standard_normal((ROWS, 3))
            error[:, 1] += knock - constant
            found = one_course([(LABEL, sums(error))])
            assert found is not None
            assert found.share > 0.8
            assert {round(found.from_s, -1), round(found.to_s, -1)} & {from_row / 10, to_row / 10}


@pytest.mark.parametrize(("times", "constant_rows"), [(3.0, 0.01), (3.0, 30.0), (4.0, 60.0)])
def test_noise_is_none(times: float, constant_rows: float) -> None:
    """White, or a course of time constants of 3 and 6 s in 100 s: none of 60 logs."""
    rng = np.random.default_rng(7)
    for _ in range(20):
        assert one_course([(LABEL, sums(wandering(rng, times, constant_rows)))]) is None


def test_of_noise_within_the_spec_nothing_is_said() -> None:
    rng = np.random.default_rng(8)
    assert one_course([(LABEL, sums(rng.standard_normal((ROWS, 3))))]) is None
    assert MOST_OF_IT < 1.0
