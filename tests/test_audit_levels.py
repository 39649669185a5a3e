"""Levels and jumps together: what is known to have jumped, and what levels say of it."""

from __future__ import annotations

import numpy as np
import pytest

from syncline_design.auditing.blocks import blocks_of
from syncline_design.auditing.levels import shapes_of
from tests.stamped_streams import of


@pytest.mark.parametrize("seed", range(6))
def test_a_lock_that_does_not_settle_leaves_no_shape(seed: int) -> None:
    rng = np.random.default_rng([101, seed])
    time_s = np.arange(0.0, 75.0, 0.08)
    blocks = blocks_of(time_s, rng.uniform(0.01, 0.014, time_s.size))
    assert blocks is not None
    assert shapes_of(blocks, settling_s=(30.0,)) == ()


@pytest.mark.parametrize("seed", range(4))
def test_a_step_within_a_slip_leaves_the_slip_whole(seed: int) -> None:
    """One second ahead for 28 s, 0.4 s more from its middle on: two clocks' doing, not three."""
    rng = np.random.default_rng([103, seed])
    at = np.arange(0.0, 80.0, 0.02)
    receive = np.maximum.accumulate(at + 0.01 + rng.gamma(2.0, 1.5e-3, at.size))
    slipped = (at > 22.0) & (at < 50.0)
    found = of(at + slipped + 0.4 * (at > 36.0), receive)
    faults = {fault.fault: fault for fault in found.faults}
    assert set(faults) == {"whole_second_slip", "step"}
    assert faults["whole_second_slip"].parameters["count"] == int(slipped.sum())
    assert faults["step"].parameters["seconds"] == pytest.approx(0.4, abs=1e-4)
    assert found.residual.bound == pytest.approx(float(np.ptp(receive - at)), rel=0.02)


@pytest.mark.parametrize("times", [2.5, 3.0, 4.0])
@pytest.mark.parametrize("seed", range(2))
def test_a_load_that_begins_at_a_longer_interval_is_no_step(seed: int, times: float) -> None:
    """A sensor at ticks of its own takes 9 ms instead of 8 where delays grow for 4 s: the rhythm
    breaks by 1 ms, receipts shift by 15 to 30, and after it they are as they were."""
    rng = np.random.default_rng([107, seed])
    ticks = np.ceil(np.arange(0.0, 75.0, 0.008) * (1.0 + 2e-5) / 1e-3 + 0.05)
    at = ticks * 1e-3 * (1.0 + 4.5e-5) + 3.7e-4
    delay = 0.01 + rng.gamma(2.0, 8e-4, at.size)
    retried = rng.random(at.size) < 0.02
    delay[retried] += rng.exponential(6.4e-3, int(retried.sum()))
    first = at[1:][np.diff(at) > 0.0085]
    begin = float(first[np.argmin(np.abs(first - 45.0))])
    delay[(at >= begin) & (at < begin + 4.0)] *= times
    found = of(at, np.maximum.accumulate(at + delay))
    assert found.faults == ()


@pytest.mark.parametrize("seed", range(3))
def test_a_jump_by_more_than_an_interval_stays_one_beside_a_load(seed: int) -> None:
    """Whole intervals are counted by the level, and a load later on does not take them back."""
    rng = np.random.default_rng([109, seed])
    at = np.arange(0.0, 75.0, 0.008)
    delay = 0.01 + rng.gamma(2.0, 8e-4, at.size)
    delay[(at > 50.0) & (at < 54.0)] *= 3.0
    found = of(at - 0.023 * (at > 47.0), np.maximum.accumulate(at + delay))
    assert [fault.fault for fault in found.faults] == ["step"]
    assert found.faults[0].parameters["seconds"] == pytest.approx(-0.023, abs=1e-4)
