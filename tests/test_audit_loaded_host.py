"""Sensors of an exact rhythm behind a host that is loaded now and then: stamps tell what happened.

Delays are gamma distributed, five times as long in episodes of seconds, so that the middle of the
messages on either side of one says little; the quickest of many do, and an interval that breaks a
rhythm of nanoseconds.  Streams are this file's own.
"""

from __future__ import annotations

import numpy as np
import pytest

from stamped_streams import of
from syncline_design.auditing.series import Array
from syncline_design.auditing.stream import Examined


def delays(rng: np.random.Generator, time_s: Array) -> Array:
    """Gamma of shape 1.7 and scale 1.2 ms, five times as long for 40 % of every 15 to 40 s."""
    found = 1e-4 + rng.gamma(1.7, 1.2e-3, time_s.size)
    begin = rng.uniform(0.0, 10.0)
    while begin < time_s[-1]:
        period = rng.uniform(15.0, 40.0)
        found[(time_s >= begin) & (time_s < begin + 0.4 * period)] *= 5.0
        begin += period
    return np.asarray(found)


def stream(rng: np.random.Generator, rate_hz: float, time_s: float = 140.0) -> tuple[Array, Array]:
    """Times of measuring, and receipts that keep their order."""
    at = np.arange(0.0, time_s, 1.0 / rate_hz)
    return at, np.maximum.accumulate(at + delays(rng, at))


def named(found: Examined) -> list[tuple[str, float]]:
    return [(f.fault, f.parameters.get("seconds", f.parameters.get("count", 0.0)))
            for f in found.faults]  # fmt: skip


@pytest.mark.parametrize("seed", [0, 4, 11])
@pytest.mark.parametrize(("rate_hz", "step_s"), [(31.0, -0.012), (25.0, -0.015)])
def test_a_step_is_told_by_the_interval_that_breaks(
    rate_hz: float, step_s: float, seed: int
) -> None:
    rng = np.random.default_rng([71, seed])
    stamp, receive = stream(rng, rate_hz)
    late = stamp >= rng.uniform(30.0, 110.0)
    ((fault, size),) = named(of(stamp + step_s * late, receive))
    assert fault == "step"
    assert size == pytest.approx(step_s, rel=0.01)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("rate_hz", [140.0, 180.0, 240.0])
def test_lost_messages_are_no_steps_of_the_clock(rate_hz: float, seed: int) -> None:
    """A message in 300 is missing: every odd interval is two of the sensor's."""
    rng = np.random.default_rng([73, seed])
    stamp, receive = stream(rng, rate_hz)
    kept = rng.random(stamp.size) > 1.0 / 300.0
    kept[[0, -1]] = True
    ((fault, count),) = named(of(stamp[kept], receive[kept]))
    assert fault == "lost_messages"
    assert count == np.sum(~kept)


@pytest.mark.parametrize("seed", range(4))
def test_a_loaded_host_alone_is_no_fault(seed: int) -> None:
    rng = np.random.default_rng([79, seed])
    for rate_hz in (31.0, 180.0):
        assert named(of(*stream(rng, rate_hz))) == []


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("bits", "unit_s"), [(16, 1e-3), (24, 1e-6), (20, 1e-4)])
@pytest.mark.parametrize("rate_hz", [40.0, 150.0])
def test_a_counter_that_wraps_once_is_named(
    bits: int, unit_s: float, rate_hz: float, seed: int
) -> None:
    """Its range is exact by the stamps' rhythm, however receipts move where it begins anew."""
    rng = np.random.default_rng([83, seed, bits, int(rate_hz)])
    range_s = 2.0**bits * unit_s
    at, receive = stream(rng, rate_hz, 1.1 * range_s)
    begun = rng.uniform(0.2, 0.7) * range_s
    found = of((at + begun) % range_s, receive)
    by_name = {f.fault: f.parameters for f in found.faults}  # its zero is an epoch of its own
    assert set(by_name) <= {"counter_wrap", "epoch_offset", "ahead_of_receipt"}
    assert by_name["counter_wrap"] == {"wrap_s": pytest.approx(range_s), "count": 1.0}


def stalled_before_a_hole(
    rng: np.random.Generator, rate_hz: float, hole_s: float, drain_s: float
) -> tuple[Array, Array, float]:
    """The host stands still for the last messages before a hole, and hands them over within it,
    one every `drain_s`; with when the hole begins."""
    at = np.arange(0.0, 70.0, 1.0 / rate_hz)
    begin = float(rng.uniform(15.0, 50.0))
    at = at[(at < begin) | (at > begin + hole_s)]
    receive = at + 0.025 + rng.gamma(2.0, 1e-3, at.size)
    first = begin - float(rng.uniform(0.1, 0.3))
    held = (at > first) & (at < begin)
    let_go = begin + float(rng.uniform(0.1, 0.4)) + drain_s * np.arange(int(held.sum()))
    receive[held] = np.maximum(receive[held], let_go)
    return at, np.maximum.accumulate(receive), begin


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(
    ("rate_hz", "drain_s"),
    [(50.0, 1e-5), (50.0, 5e-3), (100.0, 1e-4), (100.0, 3e-3), (250.0, 2e-4)],
)
def test_messages_held_up_before_a_hole_tell_no_step(
    rate_hz: float, drain_s: float, seed: int
) -> None:
    rng = np.random.default_rng([89, seed, int(rate_hz)])
    stamp, receive, _ = stalled_before_a_hole(rng, rate_hz, 3.0, drain_s)
    (fault,) = of(stamp, receive).faults
    assert fault.fault == "gap"
    assert fault.parameters["interval_s"] == pytest.approx(3.0, abs=2.0 / rate_hz)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("step_s", [0.3, 0.117])
def test_a_step_of_whole_intervals_behind_a_stall_is_named(step_s: float, seed: int) -> None:
    """Those that were not held up tell it, farther away."""
    rng = np.random.default_rng([97, seed])
    stamp, receive, begin = stalled_before_a_hole(rng, 100.0, 3.0, 1e-4)
    found = of(stamp + step_s * (stamp > begin + 1.0), receive)
    (step,) = [f for f in found.faults if f.fault == "step"]
    assert step.parameters["seconds"] == pytest.approx(step_s, abs=1e-4)
