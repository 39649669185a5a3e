"""Levels in which something is known to have jumped, and nothing is seen to settle."""

from __future__ import annotations

import numpy as np
import pytest

from syncline_design.auditing.blocks import blocks_of
from syncline_design.auditing.levels import shapes_of


@pytest.mark.parametrize("seed", range(6))
def test_a_lock_that_does_not_settle_leaves_no_shape(seed: int) -> None:
    rng = np.random.default_rng([101, seed])
    time_s = np.arange(0.0, 75.0, 0.08)
    blocks = blocks_of(time_s, rng.uniform(0.01, 0.014, time_s.size))
    assert blocks is not None
    assert shapes_of(blocks, settling_s=(30.0,)) == ()
