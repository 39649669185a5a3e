"""Quantiles of few numbers are numpy's to the bit."""

from __future__ import annotations

import numpy as np
import pytest

from syncline_design.auditing import series
from syncline_design.auditing.series import Array, median, percentile, scatter, spread
from syncline_design.model.normal import OF_MEDIAN_DEVIATION


def drawn(rng: np.random.Generator, size: int, kind: int) -> Array:
    """Spread out, with ties, of very unlike sizes, or with an infinity or a NaN among them."""
    values = rng.standard_normal(size) * 10.0 ** rng.integers(-9, 9)
    if kind == 1:
        values = np.round(rng.standard_normal(size))
    if kind == 2:
        values = values * 10.0 ** rng.uniform(-12, 12, size)
    if kind >= 3:
        values[rng.integers(size)] = (np.inf, -np.inf, np.nan)[kind - 3]
    return np.asarray(values)


def same(found: float, wanted: object) -> bool:
    return bool(np.array_equal(found, np.float64(wanted), equal_nan=True))  # type: ignore[arg-type]


@pytest.mark.parametrize("kind", range(6))
@pytest.mark.filterwarnings("ignore:invalid value")
def test_they_are_those_of_numpy(kind: int) -> None:
    rng = np.random.default_rng(12 + kind)
    for size in (*range(1, 80), 255, 256, 257, 300):
        values = drawn(rng, size, kind)
        low, high = np.percentile(values, [25, 75])
        assert same(spread(values), high - low), size
        for percent in (0.0, 5.0, 37.5, 99.8, 100.0, float(rng.uniform(0.0, 100.0))):
            assert same(percentile(values, percent), np.percentile(values, percent)), size
        assert same(median(values), np.median(values)), size
        around = np.median(np.abs(values - np.median(values)))
        assert same(scatter(values), OF_MEDIAN_DEVIATION * around), size


def test_numpy_is_not_asked_for_few_numbers(monkeypatch: pytest.MonkeyPatch) -> None:
    """Most of the time of an audit's quantiles is numpy's way to the numbers."""

    def never(*_: object) -> None:
        raise AssertionError

    for name in ("percentile", "median"):
        monkeypatch.setattr(series.np, name, never)
    values = np.arange(100.0)
    assert (spread(values), percentile(values, 5.0), median(values)) == (49.5, 4.95, 49.5)
    assert scatter(values) == OF_MEDIAN_DEVIATION * 25.0
