"""How likely noise alone makes the values of a group of columns, against Hotelling's T squared."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from syncline_design.diagnosis.judged import Judged

VALUES = np.array([1.0, -2.0, 0.5])
MODEL = np.diag([0.04, 0.09, 0.01])
WIDER = 4.0 * MODEL


@pytest.mark.parametrize("groups", [4, 7, 30])
def test_groups_of_rows_judge_by_their_own_scatter(groups: int) -> None:
    square = float(np.sum(VALUES**2 / np.diag(WIDER)))
    share = square * (groups - 3) / (3 * (groups - 1))
    by_hand = stats.f.logsf(share, 3, groups - 3)
    assert Judged(VALUES, MODEL, ((WIDER, groups),)).log_p == pytest.approx(by_hand, rel=1e-6)


@pytest.mark.parametrize("groups", [2, 3])
def test_no_more_groups_than_values_say_nothing(groups: int) -> None:
    """A short drive by few targets: their scatter has no inverse, and there was a division by 0."""
    alone = stats.chi2.logsf(float(np.sum(VALUES**2 / np.diag(MODEL))), 3)
    judged = Judged(VALUES, MODEL, ((WIDER, groups),))
    assert judged.log_p == pytest.approx(alone, rel=1e-6)
    assert math.isfinite(judged.coverage)
