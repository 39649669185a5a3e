"""Which effects runs show as constants: no two that are one to first order."""

from __future__ import annotations

import numpy as np

from syncline_design.campaign.changes import Changes
from syncline_design.campaign.constants import PLAUSIBLE, shown_constants
from syncline_design.campaign.pool import pool_of
from syncline_design.diagnosis.sufficient import Sufficient
from syncline_design.effects import registry

LAG = registry()["filter_lag"].slopes()[0].name
LABELS = (("latency", "position", 0, "latency_s"), ("filter_lag", "position", 0, LAG))
BOUND = 0.5e-3  # of a run, s
SINGLE = ((np.array([0, 1]), np.array([[0], [1]])),)  # two effects of one parameter each


def day(rng: np.random.Generator, latency: float, curved: float) -> Sufficient:
    """A run in which lag and latency are one but for a share of their slopes, by which those of a
    lag that is not 0 differ (2 T a over the speed)."""
    root = np.array([[1.0, 1.0 - curved], [0.0, 0.15 * curved]]) / BOUND
    score = root.T @ (root @ [latency, 0.0] + rng.standard_normal(2))
    return Sufficient(LABELS, root.T @ root, score, 0.0, np.eye(2), ())


def test_a_delay_of_one_day_is_no_sum_of_huge_constants() -> None:
    """20 bounds from the seventh day on: the day itself rings, whatever its own search linearised.

    With both effects free a latency of -0.4 s and a lag of as much would explain that day alone:
    their slopes differ where the lag was found, by 2.2 % as the 12 ms of a log did.
    """
    for seed in range(10):
        rng = np.random.default_rng([18, seed])
        quiet = [day(rng, 2e-3, 0.0) for _ in range(6)]
        changes = Changes(pool_of([*quiet, day(rng, 12e-3, 0.022)], range(7)))
        assert all(changes.log_evidence(n)[0] < np.log(20.0) for n in range(2, 7))
        assert changes.log_evidence(7)[0] > np.log(20.0)


def test_two_constants_that_runs_tell_apart_are_both_shown() -> None:
    """A correlation of 0.99, each 100 bounds: the second is another thing, and is free."""
    root = np.array([[1.0, 0.99], [0.0, 0.141]])
    total = root.T @ root
    found = shown_constants(total, total @ [100.0, 100.0], SINGLE, np.ones(2))
    assert {one.term for one in found} == {0, 1}
    assert all(not one.prior.any() for one in found)


def test_of_an_effect_only_the_direction_that_is_another_is_free() -> None:
    """Forward and right of an arm, forward one with what was shown first: held, right is not."""
    slopes = np.array([[2.0, 3.0, 0.0], [0.04, 0.0, 0.0], [0.0, 0.0, 5.0]])  # a share of 0.0004
    total, groups = slopes.T @ slopes, ((np.array([0]), np.array([[0]])),
                                        (np.array([1]), np.array([[1, 2]])))  # fmt: skip
    found = shown_constants(total, total @ [2500.0, 0.0, 1.0], groups, np.ones(2))
    assert [one.term for one in found] == [0, 1]
    np.testing.assert_allclose(found[1].prior, np.diag([9.0, 0.0]) / PLAUSIBLE**2, atol=1e-9)
    np.testing.assert_array_equal(found[1].index, [1, 2])


def test_as_many_constants_are_shown_as_there_are() -> None:
    """Twelve effects of ten standard deviations each, apart from one another: all are free.

    With only some of them free, a day that is driven otherwise makes a change of the others: of 75
    series of a hundred runs with every effect of the dictionary at some 1.5 bounds of a run, 57
    rang where eight effects at most were free.
    """
    count = 12
    singles = ((np.arange(count), np.arange(count)[:, None]),)
    total = np.eye(count) + 0.1
    found = shown_constants(total, total @ np.full(count, 10.0), singles, np.ones(count))
    assert {one.term for one in found} == set(range(count))
