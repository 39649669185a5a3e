"""Fronts of long chains of vehicles: what is ruled out ahead against enumeration and without it."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from plain_front import front_by_enumeration
from syncline_design.choice import outlook, remaining, stage_timings
from syncline_design.choice.front import front
from syncline_design.choice.table import Problem

sys.path.insert(0, str(Path(__file__).parent.parent / "benchmarks"))

from choice_instances import instance

ALWAYS, NEVER = 1, 99


@contextmanager
def looking_ahead(from_stages: int) -> Iterator[None]:
    """Chains of so many stages look ahead."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(stage_timings, "LONG", from_stages)
        yield


def same(problem: Problem) -> bool:
    """Whether looking ahead changes nothing."""
    with looking_ahead(ALWAYS):
        ahead = front(problem)
    with looking_ahead(NEVER):
        return tuple(front(problem)) == tuple(ahead)


@pytest.mark.parametrize(
    ("vehicles", "methods", "seed", "boards"), [(2, 3, 1, True), (3, 2, 2, False)]
)
def test_looking_ahead_agrees_with_enumeration(
    vehicles: int, methods: int, seed: int, boards: bool
) -> None:
    problem = instance(vehicles, 1, methods, seed, vehicles=vehicles, clocks=3, boards=boards)
    with looking_ahead(ALWAYS):
        found = front(problem)
    wanted = front_by_enumeration(problem)
    assert [(p.amount, p.error_m, p.design) for p in found] == [
        (p.amount, p.error_m, p.design) for p in wanted
    ]


@pytest.mark.parametrize(("vehicles", "boards"), [(1, True), (2, True), (4, False), (4, True)])
def test_looking_ahead_changes_no_front(vehicles: int, boards: bool) -> None:
    assert same(instance(4, 2, 6, seed=0, vehicles=vehicles, clocks=3, boards=boards))


def test_what_is_stamped_badly_is_no_way_to_end_cheap_and_accurate() -> None:
    """One role to come: for 1 EUR and 16 ms, or for 200 EUR and 1 us; 10 m/s, 1 m either way."""
    part = outlook.RoleOptions(
        np.array([1.0, 200.0]), np.ones(2), np.array([16e-3, 1e-6]), np.zeros(2, dtype=np.intp)
    )
    way = outlook.Timed((1, 0, 0.0, False), 0.0, np.zeros(1), (part,), 0, ())
    made = outlook.Outlook([[way]], 10.0, 2.0)
    known = remaining.Ceiling(np.array([10.0, 110.0]), np.array([2.1, 2.05]))

    def may(error_m: float, bound_s: float) -> bool:
        found = made.may_beat(
            known, 0, None, 0, np.array([9.0 + 1e-6]), np.array([error_m]), np.array([bound_s])
        )
        return bool(found[0])

    assert not may(1.06, 0.0)  # 2.06 + 0.16 > 2.1 for 10 EUR, 2.06 > 2.05 for 209 EUR
    assert may(1.04, 0.0)  # 2.04 < 2.05 for 209 EUR
    assert not may(0.95, 20e-3)  # 1.95 + 0.2 > 2.1 > 2.05, whichever comes
    assert may(0.89, 20e-3)  # 1.89 + 0.2 < 2.1 for 10 EUR


def test_bands_have_every_bound_once() -> None:
    bounds = np.array([1e-6, 2e-6, 1e-3, 3e-3, 16e-3])
    part = outlook.RoleOptions(np.ones(5), np.ones(5), bounds, np.zeros(5, dtype=np.intp))
    way = outlook.Timed((1, 0, 0.0, False), 0.0, np.array([5e-3]), (part,), 0, ())
    made = outlook.Outlook([[way]], 10.0, 1.0)
    for bound in (0.0, *bounds, 5e-3, 1.0):
        under = np.append(-np.inf, made.high[:-1])
        assert np.sum((under < bound) & (bound <= made.high)) == 1
    assert all(low in (0.0, 5e-3, *bounds) for low in made.low)
