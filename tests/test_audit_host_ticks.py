"""Receipts at ticks of a host: a message that arrives a little later comes a whole tick later."""

from __future__ import annotations

import numpy as np
import pytest

from syncline_design.auditing.series import Array
from tests.stamped_streams import of

TICK_S = 0.01


def _received(rng: np.random.Generator, at: Array) -> Array:
    """Up to 4 ms of transport, the last of which miss the tick from the middle on."""
    arrived = at + 0.0137 + rng.uniform(0.0, 0.004, at.size)
    ticks = np.ceil(arrived / TICK_S) * TICK_S
    return np.asarray(ticks + np.abs(rng.normal(0.0, 5e-5, at.size)))


@pytest.mark.parametrize("seed", range(4))
def test_a_later_measurement_under_a_hosts_ticks_is_no_step(seed: int) -> None:
    """A 50 Hz sensor that measures at ticks of 4 ms takes one interval of 24 ms: it is on time, and
    four of ten messages miss the host's tick from then on."""
    rng = np.random.default_rng([111, seed])
    at = np.arange(0.0, 100.0, 0.02)
    at = at + 0.004 * (at > 27.0)
    receive = _received(rng, at)
    assert 0.35 < float(np.mean((receive - at)[at > 27.0] > 0.02)) < 0.5
    found = of(at, receive)
    assert found.faults == ()
    assert found.residual.bound == pytest.approx(float(np.ptp(receive - at)), rel=0.02)
    assert found.smallest.step_s == pytest.approx(TICK_S, rel=0.01)


@pytest.mark.parametrize("begin_s", [27.0, 60.0])
@pytest.mark.parametrize("first_s", [0.0, 0.003])  # all meet one tick, or one in five the next
@pytest.mark.parametrize("seed", range(2))
def test_a_step_under_a_hosts_ticks_is_one(seed: int, first_s: float, begin_s: float) -> None:
    """As many messages miss a tick before it as after."""
    rng = np.random.default_rng([113, seed])
    at = first_s + np.arange(0.0, 100.0, 0.02)
    receive = _received(rng, at)
    found = of(at + 0.004 * (at > begin_s), receive)
    assert [fault.fault for fault in found.faults] == ["step"]
    assert found.faults[0].parameters["seconds"] == pytest.approx(0.004, abs=1e-4)
