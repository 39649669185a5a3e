"""Locks that settle in streams of few messages, whose delays scatter by much of the jump."""

from __future__ import annotations

import numpy as np
import pytest

from syncline_design.auditing.series import Array
from tests.stamped_streams import of

SIZE_S, SETTLE_S = 0.03, 3.0


def _measured(seed: int, jitter_s: float = 0.0) -> tuple[np.random.Generator, Array, Array]:
    rng = np.random.default_rng([117, seed])
    at = np.arange(0.0, 60.0, 0.2)
    receive = at + 0.01 + rng.gamma(2.0, 0.004, at.size)
    return rng, at + rng.normal(0.0, jitter_s, at.size), receive


def _lock(at: Array, begin_s: float) -> Array:
    return SIZE_S * np.exp(-np.maximum(at - begin_s, 0.0) / SETTLE_S) * (at >= begin_s)


@pytest.mark.parametrize("jitter_s", [0.0, 1e-4])
@pytest.mark.parametrize("seed", [0, 2, 3, 7, 12, 16])
def test_a_lock_of_few_messages_is_told_by_its_stamps(seed: int, jitter_s: float) -> None:
    """Its size is that at the first message, up to an interval after it began."""
    rng, at, receive = _measured(seed, jitter_s)
    begin_s = rng.uniform(12.0, 24.0)
    found = of(at + _lock(at, begin_s), receive)
    assert [fault.fault for fault in found.faults] == ["relock"]
    (fault,) = found.faults
    first_s = float(at[at >= begin_s][0])
    assert fault.parameters["seconds"] == pytest.approx(
        SIZE_S * np.exp(-(first_s - begin_s) / SETTLE_S), rel=0.001 if jitter_s == 0.0 else 0.02
    )
    assert fault.parameters["settling_s"] == pytest.approx(SETTLE_S, rel=0.05)
    assert fault.from_s == pytest.approx(first_s, abs=0.05)
    assert found.residual.bound == pytest.approx(float(np.ptp(receive - at)), rel=0.03)


@pytest.mark.parametrize("seed", [0, 2, 3])
def test_a_lock_of_a_clock_that_drifts_is_one_beside_the_drift(seed: int) -> None:
    _, at, receive = _measured(seed)
    found = of(at * (1.0 + 5e-4) + _lock(at, 20.0), receive)
    assert sorted(fault.fault for fault in found.faults) == ["drift", "relock"]
    sizes = {fault.fault: fault.parameters for fault in found.faults}
    assert sizes["relock"]["seconds"] == pytest.approx(SIZE_S, rel=0.05)
    assert sizes["drift"]["ppm"] == pytest.approx(500.0, rel=0.2)


@pytest.mark.parametrize("seed", range(4))
def test_a_step_of_few_messages_stays_one(seed: int) -> None:
    rng, at, receive = _measured(seed)
    found = of(at + SIZE_S * (at >= rng.uniform(12.0, 24.0)), receive)
    assert [fault.fault for fault in found.faults] == ["step"]


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("size_s", [0.5, -0.49, 1.0])
def test_a_lock_by_whole_intervals_is_placed_by_receipts(size_s: float, seed: int) -> None:
    """2 Hz: stamps jump by an interval or two, which nobody counts."""
    rng = np.random.default_rng([119, seed])
    at = np.arange(0.0, 120.0, 0.5)
    receive = at + 0.01 + rng.gamma(2.0, 0.004, at.size)
    lock = size_s * np.exp(-np.maximum(at - 40.0, 0.0) / 5.0) * (at >= 40.0)
    found = of(at + lock, receive)
    assert [fault.fault for fault in found.faults] == ["relock"]
    assert found.faults[0].parameters["seconds"] == pytest.approx(size_s, rel=0.01)
    assert found.residual.bound == pytest.approx(float(np.ptp(receive - at)), rel=0.05)


@pytest.mark.parametrize("seed", range(3))
def test_a_sensor_whose_own_rhythm_settles_is_sound(seed: int) -> None:
    """It measures so: receipts go with the stamps."""
    rng, at, _ = _measured(seed)
    at = at + _lock(at, 20.0)
    receive = at + 0.01 + rng.gamma(2.0, 0.004, at.size)
    assert of(at, receive).faults == ()
