"""Columns judged beside what is held fixed, against dense least squares of the rows themselves."""

from __future__ import annotations

import numpy as np
import pytest

from syncline_design.diagnosis.recent import LastMade
from syncline_design.diagnosis.slow_sums import HeldFixed, Weighted

ROWS, PARTS, PRIOR = 60, 6, np.array([0.0, 4.0, 9.0, 0.0])


def dense(
    kept: np.ndarray, fixed: np.ndarray, group: np.ndarray, error: np.ndarray, weight: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Values and covariance of a group by one dense ridge fit of the kept rows."""
    every = np.concatenate([fixed, group], axis=1)[kept]
    root = np.sqrt(weight[kept])[:, None]
    ridge = np.diag(np.sqrt(np.concatenate([PRIOR, np.zeros(group.shape[1])])))
    stacked = np.concatenate([root * every, ridge])
    right = np.concatenate([root[:, 0] * error[kept], np.zeros(len(ridge))])
    inverse = np.linalg.pinv(stacked)
    values = inverse @ right
    return values[-group.shape[1] :], (inverse @ inverse.T)[-group.shape[1] :, -group.shape[1] :]


@pytest.mark.parametrize("shuffled", [False, True])
def test_groups_are_judged_as_by_leaving_rows_out(shuffled: bool) -> None:
    """Two groups beside four fixed columns, the last of which no row tells."""
    rng = np.random.default_rng(5)
    part = np.arange(ROWS) * PARTS // ROWS
    part = rng.permutation(part) if shuffled else part
    root = np.linalg.inv(np.linalg.cholesky(np.array([[2.0, 0.5], [0.5, 1.0]])))
    fixed, groups = rng.normal(size=(ROWS, 2, 4)), [rng.normal(size=(ROWS, 3, k)) for k in (1, 3)]
    fixed[:, :, 3] = 0.0
    error, weight = rng.normal(size=2 * ROWS), rng.uniform(0.2, 1.0, 2 * ROWS)
    white = (root @ fixed).reshape(-1, 4)
    known = Weighted((0, 2), np.broadcast_to(root, (ROWS, 2, 2)), white, error, weight, PRIOR)
    found = HeldFixed(known, [part]).judged(groups)
    of_row = np.repeat(part, 2)
    for group, one in zip(groups, found, strict=True):
        own = (root @ group[:, [0, 2]]).reshape(-1, group.shape[2])
        values, covariance = dense(of_row >= 0, white, own, error, weight)
        np.testing.assert_allclose(one.values, values, rtol=1e-9)
        np.testing.assert_allclose(one.model, covariance, rtol=1e-9)
        less = [dense(of_row != k, white, own, error, weight)[0] for k in range(PARTS)]
        off = np.array(less) - np.mean(less, axis=0)
        spread = (PARTS - 1) / PARTS * off.T @ off
        np.testing.assert_allclose(one.jackknives[0][0], spread, rtol=1e-7)
        assert one.jackknives[0][1] == PARTS


def test_what_was_made_is_kept_for_the_very_objects() -> None:
    kept: LastMade[int] = LastMade(2)
    one, other, third = [1.0], [1.0], [2.0]
    made = iter(range(10))
    assert [kept.of((x,), lambda: next(made)) for x in (one, other, one, third, other, one)] == [
        0, 1, 0, 2, 1, 3,
    ]  # fmt: skip
