"""Sensors that measure as fast as something lets them: a sonar that pings when its echo is back.

Their interval changes slowly with the depth.  One that pings at ticks of its own has stamps on a
grid as one has whose stamps were cut off to it; receipts come after the ping, cut off or not.
"""

from __future__ import annotations

import time

import numpy as np
import pytest

from syncline_design.auditing.series import Array
from syncline_design.auditing.stream import Examined
from tests.stamped_streams import of

DEPTHS = ("smooth", "clamped", "walking")


def pings(rng: np.random.Generator, depth: str) -> Array:
    number = np.arange(2000.0)
    swell = np.sin(number / rng.uniform(25.0, 80.0) + rng.uniform(0.0, 6.0))
    if depth == "smooth":
        apart = 0.07 * (1.3 + 0.3 * swell)
    elif depth == "clamped":  # never more often than 12.5 Hz
        apart = np.maximum(0.08, 0.085 + 0.04 * swell)
    else:
        apart = 0.1 + 0.03 * np.clip(np.cumsum(rng.normal(0.0, 0.02, number.size)), -1.0, 1.0)
    at = np.cumsum(apart)
    return np.asarray(at[at < 90.0])


def received(rng: np.random.Generator, at: Array, scale_s: float) -> Array:
    return np.maximum.accumulate(at + 0.01 + rng.gamma(2.0, scale_s, at.size))


def names(one: Examined) -> list[str]:
    return [fault.fault for fault in one.faults]


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("depth", DEPTHS)
@pytest.mark.parametrize(
    ("grid_s", "scale_s"), [(0.005, 1e-3), (0.005, 1e-4), (0.01, 3e-3), (0.02, 3e-3), (0.004, 4e-3)]
)
def test_pings_at_ticks_of_their_own_are_no_fault(
    grid_s: float, scale_s: float, depth: str, seed: int
) -> None:
    rng = np.random.default_rng([211, seed, DEPTHS.index(depth)])
    at = np.ceil(pings(rng, depth) / grid_s) * grid_s
    receive = received(rng, at, scale_s)
    began = time.process_time()
    one = of(at, receive)
    assert time.process_time() - began < 6.0  # a second alone; it took ten and more
    assert names(one) == []
    assert one.residual.bound == pytest.approx(float(np.ptp(receive - at)), rel=0.02)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("grid_s", "scale_s"), [(0.01, 1e-3), (0.01, 3e-3), (0.02, 2e-3)])
def test_pings_cut_off_to_a_grid_are_named(grid_s: float, scale_s: float, seed: int) -> None:
    """And nothing beside: no rhythm says when they were, so that the bound holds a grain."""
    rng = np.random.default_rng([223, seed])
    at = pings(rng, "smooth")
    receive = received(rng, at, scale_s)
    one = of(np.floor(at / grid_s) * grid_s, receive)
    assert names(one) == ["truncated_stamps"]
    true = float(np.ptp(receive - at))
    assert one.residual.bound is not None
    assert true - 1e-6 < one.residual.bound < true + 1.02 * grid_s


@pytest.mark.parametrize("seed", range(4))
def test_what_receipts_do_not_tell_is_said(seed: int) -> None:
    """Most pings a whole number of grains apart: few show whether the grid cut them off."""
    rng = np.random.default_rng([229, seed])
    at = pings(rng, "clamped")
    one = of(np.floor(at / 0.01) * 0.01, received(rng, at, 4e-3))
    assert set(names(one)) <= {"truncated_stamps"}
    assert names(one) or (one.hidden is not None and "10 ms" in one.hidden.words)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(("grid_s", "scatter_s"), [(0.002, 1.5e-3), (0.001, 1e-3)])
def test_pings_that_keep_no_course_are_not_accused(
    grid_s: float, scatter_s: float, seed: int
) -> None:
    """Their own scatter is larger than a grain: nothing tells what the grid would cut off."""
    rng = np.random.default_rng([239, seed])
    at = pings(rng, "smooth")
    at = np.ceil((at + rng.normal(0.0, scatter_s, at.size)) / grid_s) * grid_s
    receive = received(rng, at, 1e-3)
    one = of(at, receive)
    assert names(one) == []
    assert one.hidden is not None
    assert one.hidden.seconds == pytest.approx(grid_s)
    assert one.residual.bound == pytest.approx(float(np.ptp(receive - at)), rel=0.02)


@pytest.mark.parametrize("seed", range(3))
def test_losses_beside_a_coarse_grid_leave_its_bound_as_it_is(seed: int) -> None:
    """12.7 Hz on 20 ms, one message in fifty missing: counted by their intervals alone."""
    rng = np.random.default_rng([227, seed])
    at = np.arange(0.003, 75.0, 1.0 / 12.7)
    at = at[rng.random(at.size) > 0.02]
    receive = received(rng, at, 5e-4)
    one = of(np.floor(at / 0.02) * 0.02, receive)
    assert names(one) == ["truncated_stamps", "lost_messages"]
    assert one.residual.bound == pytest.approx(float(np.ptp(receive - at)), rel=0.1)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("rate_hz", [70.0, 130.0])
def test_a_step_hides_no_grid(rate_hz: float, seed: int) -> None:
    """An even sensor stays one where its clock jumps."""
    rng = np.random.default_rng([233, seed])
    at = 0.003 + np.arange(0.0, 70.0, 1.0 / rate_hz) * (1.0 + 2e-5)
    receive = received(rng, at, 1e-3)
    one = of(np.floor(at / 0.001) * 0.001 - 0.4 * (at > 31.0), receive)
    assert sorted(names(one)) == ["step", "truncated_stamps"]
