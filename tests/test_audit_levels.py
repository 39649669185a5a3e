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
