"""Steps and slips that no rhythm tells, of irregular or few messages; clocks that stand still."""

from __future__ import annotations

import numpy as np
import pytest

from syncline_design.auditing.series import Array
from syncline_design.auditing.stream import Examined
from syncline_design.machine.random_numbers import generator
from tests.stamped_streams import of


def came(when: Array, rng: np.random.Generator) -> Array:
    return np.maximum.accumulate(when + 1e-3 + rng.gamma(2.0, 2e-3, when.size))


def events(count: int, length_s: float, seed: int) -> tuple[Array, Array]:
    """A sensor that chance sets off, and receipts."""
    rng = generator((50, count, seed))
    when = np.sort(rng.uniform(0.0, length_s, count))
    return when, came(when, rng)


def only(one: Examined, name: str) -> dict[str, float | str]:
    assert [fault.fault for fault in one.faults] == [name]
    return one.faults[0].parameters


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("size_s", [0.05, -0.05, 0.02])
def test_a_step_of_an_irregular_stream_is_one(size_s: float, seed: int) -> None:
    """Ten messages a second at random: how often they come about the step is chance."""
    when, receive = events(1200, 120.0, seed)
    one = of(when + size_s * (when > 60.0), receive)
    assert only(one, "step")["seconds"] == pytest.approx(size_s, abs=1e-3)
    at = np.flatnonzero(when > 60.0)[0]
    if when[at] + size_s > when[at - 1]:  # else the two may as well have overtaken one another
        assert one.residual.bound == pytest.approx(np.ptp(receive - when), rel=0.05)
    assert not of(when, receive).faults


@pytest.mark.parametrize("count", [12, 20, 30, 31])
@pytest.mark.parametrize("size_s", [1.0, -1.0])
def test_half_of_a_short_stream_a_second_off(count: int, size_s: float) -> None:
    for seed in range(4):
        rng = generator((51, count, seed))
        when = np.arange(count) / 10.0 + rng.uniform(0.0, 0.1)
        receive = came(when, rng)
        one = of(when + size_s * (np.arange(count) >= count // 2), receive)
        found = only(one, "whole_second_slip")
        assert found["seconds"] == size_s
        assert found["count"] == count - count // 2
        assert one.residual.bound == pytest.approx(np.ptp(receive - when), rel=0.05)


@pytest.mark.parametrize("count", [12, 20, 30])
@pytest.mark.parametrize("size_s", [0.2, -0.2])
def test_a_step_of_a_short_stream_is_known_by_its_rhythm(count: int, size_s: float) -> None:
    for seed in range(4):
        rng = generator((52, count, seed))
        when = np.arange(count) / 10.0
        receive = came(when, rng)
        after = np.arange(count) >= count // 2
        assert only(of(when + size_s * after, receive), "step")["seconds"] == pytest.approx(size_s)
        # as long a wait on the way moves no stamp
        assert not of(when, receive + max(size_s, 0.0) * after).faults


@pytest.mark.parametrize("size_s", [0.5, -0.5])
@pytest.mark.parametrize("seed", range(4))
def test_a_step_of_25_events_is_named(size_s: float, seed: int) -> None:
    when, receive = events(25, 90.0, seed)
    after = np.arange(25) >= 12
    one = of(when + size_s * after, receive)
    assert only(one, "step")["seconds"] == pytest.approx(size_s, abs=0.01)
    assert one.faults[0].from_s == pytest.approx(receive[12] - receive[0], abs=1e-6)
    assert not of(when, receive).faults


@pytest.mark.parametrize("length_s", [0.5, 2.0, 5.0])
@pytest.mark.parametrize("creeps_s", [0.0, 1e-6])
@pytest.mark.parametrize("rate", [20.0, 50.3])
def test_a_clock_that_stands_still_is_named_once(
    length_s: float, creeps_s: float, rate: float
) -> None:
    """No step that stays: what was stamped meanwhile is left out, the rest is as it was."""
    rng = generator((53, int(rate)))
    when = np.arange(int(120.0 * rate)) / rate
    receive = came(when, rng)
    still = (when > 50.0) & (when < 50.0 + length_s)
    stamp = when.copy()
    stamp[still] = when[still][0] + creeps_s * np.arange(still.sum())
    one = of(stamp, receive)
    assert only(one, "duplicates")["count"] == still.sum() - 1
    assert one.faults[0].from_s == pytest.approx(50.0, abs=0.2)
    assert one.faults[0].to_s == pytest.approx(50.0 + length_s, abs=0.2)
    assert one.residual.bound == pytest.approx(np.ptp(receive - when), rel=0.05)
