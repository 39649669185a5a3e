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


@pytest.mark.parametrize("seed", [306, 416, 924])
def test_a_second_of_later_receipts_at_a_hosts_ticks_is_no_step_of_nothing(seed: int) -> None:
    """A 30 Hz sensor at ticks of 10 ms, read at others: for a second seven messages in ten are
    a tick late, and no stretch tells by how much between the moments that messages tell."""
    rng = np.random.default_rng(seed)
    at = np.ceil(np.arange(1800) / 30.0 / TICK_S - 1e-6) * TICK_S
    delay = rng.gamma(2.0, 0.002, at.size)
    begin_s, length_s = rng.uniform(10.0, 50.0), rng.uniform(0.3, 1.2)
    during = (at > begin_s) & (at < begin_s + length_s)
    later = rng.uniform(0.003, 0.012)
    delay[during] += later * (rng.random(int(during.sum())) < 0.7)
    arrived = np.maximum.accumulate(at + 0.07 + delay)
    ticks = np.ceil(arrived / TICK_S) * TICK_S
    receive = np.sort(ticks + np.abs(rng.normal(0.0, 6e-5, at.size)))
    found = [f for f in of(at, receive).faults if f.fault == "step"]
    assert all(abs(float(f.parameters["seconds"])) > 5e-4 for f in found)
    assert all((f.to_s or 0.0) > (f.from_s or 0.0) for f in found)
