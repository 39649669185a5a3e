"""Stamps on arrival of few messages: whether late rather than early, chance hides."""

from __future__ import annotations

import numpy as np
import pytest

from syncline_design.auditing.series import Array
from tests.stamped_streams import of


def _followed(rng: np.random.Generator, stamp: Array) -> Array:
    return stamp + 1e-4 + rng.gamma(2.0, 8e-5, stamp.size)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("size", [45, 60, 90])
def test_few_arrivals_are_said_to_be_possible(size: int, seed: int) -> None:
    """At 1 Hz, 40 ms late on average; receipts follow at once."""
    rng = np.random.default_rng([241, size, seed])
    at = 0.3 + np.arange(float(size))
    stamp = at + rng.gamma(2.0, 0.02, size)
    receive = _followed(rng, stamp)
    found = of(stamp, receive)
    assert found.faults == ()
    assert found.hidden is not None
    assert "on arrival" in found.hidden.words
    assert found.residual.bound is not None
    counted = found.residual.bound + found.hidden.seconds
    assert counted == pytest.approx(float(np.ptp(receive - at)), rel=0.1)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("size", [45, 60, 240])
def test_an_even_sensor_of_few_messages_hides_no_arrivals(size: int, seed: int) -> None:
    rng = np.random.default_rng([251, size, seed])
    stamp = 0.3 + np.arange(float(size)) * 1.00002 + rng.normal(0.0, 1e-5, size)
    found = of(stamp, stamp + 0.01 + rng.gamma(2.0, 2e-3, size))
    assert found.faults == ()
    assert found.hidden is None


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("size", [250, 400])
def test_a_sensor_triggered_early_and_late_is_sound(size: int, seed: int) -> None:
    """So many messages tell that it scatters to both sides, evenly or not."""
    rng = np.random.default_rng([257, size, seed])
    scatter = rng.normal(0.0, 0.02, size) if seed % 2 else rng.uniform(-0.03, 0.03, size)
    stamp = 0.3 + np.arange(float(size)) + scatter
    assert of(stamp, _followed(rng, stamp)).faults == ()
