"""What many logs name has information of its own: noise in the slopes tells no two effects apart.

Oracle: the closed form 1 - r^2 of two columns of correlation r.
"""

from __future__ import annotations

import numpy as np
import pytest

from syncline_design.campaign.naming import Naming, plausible
from syncline_design.campaign.pool import Scoped, fitted, pool_of
from watched_series import BOUND, statistics

LATE = np.array([30.0, 0, -30.0, 0, 0]) * BOUND  # a latency and a datum that undo one another


@pytest.mark.parametrize(("share", "told"), [(0.04, True), (3e-3, True), (3e-4, False)])
def test_two_that_are_nearly_one_are_not_both_named(share: float, told: bool) -> None:
    rng = np.random.default_rng(61)
    runs = [statistics(rng, LATE, float(np.sqrt(1.0 - share))) for _ in range(6)]
    pool = pool_of(runs, range(6))
    terms = [t for t in pool.terms if t.label[0] in ("latency", "datum_offset")]
    assert plausible(fitted(pool, tuple(Scoped(one, "build") for one in terms))) is told
    found = {one.scoped.term.label[0] for one in Naming(pool, 0.05, 8).named().terms}
    assert ({"latency", "datum_offset"} <= found) <= told
