"""Sensors that change their rate, counters of a few messages, locks that settle within few
messages, clocks that are set too little to be seen every time.

Every world is written down here: when a sensor measured, what its clock said, when the message
came.  What is expected is what was written down.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from syncline_design.auditing.result import StampFault, StreamAudit
from syncline_design.auditing.run import audit

BEGAN_NS = 1_750_000_000 * 10**9


def ns(t: np.ndarray) -> np.ndarray:
    return np.rint(t * 1e9).astype(np.int64)


def said(folder: Path, stamp_ns: np.ndarray, receive_ns: np.ndarray) -> StreamAudit:
    rows = [f"{s},{r}" for s, r in zip(stamp_ns.tolist(), receive_ns.tolist(), strict=True)]
    path = folder / "x.csv"
    path.write_text("\n".join(["stamp_ns,receive_ns", *rows, ""]), "utf-8")
    return audit([path]).streams[0]


def counted(row: StreamAudit) -> list[StampFault]:
    return [fault for fault in row.faults if fault.counts]


def delayed(t: np.ndarray, rng: np.random.Generator, scale: float) -> np.ndarray:
    """Receipts in order, after 4 ms and a delay with a tail [s]."""
    return np.maximum.accumulate(t + 0.004 + rng.gamma(2.0, scale, t.size))


def test_a_sonar_whose_range_scale_switches_hides_no_waits(tmp_path: Path) -> None:
    """Its intervals differ by more than its delays: nothing in them waited, and the bound is that
    of the delays."""
    rng = np.random.default_rng(5)
    interval = np.repeat(rng.choice([0.02, 0.04, 0.05, 0.1], 30), rng.integers(40, 160, 30))
    t = np.cumsum(interval)
    receive = delayed(t, rng, 4e-4)
    row = said(tmp_path, BEGAN_NS + ns(t), BEGAN_NS + ns(receive))
    assert not row.faults
    assert row.residual_s.bound == pytest.approx(np.ptp(receive - t), rel=0.02)


@pytest.mark.parametrize("rate", [10.0, 200.0])
@pytest.mark.parametrize("messages", [3.0, 3.5, 4.0, 6.5, 8.0, 10.0, 16.0])
def test_a_counter_that_begins_anew_every_few_messages(
    tmp_path: Path, rate: float, messages: float
) -> None:
    """One message in twenty is held up, and others wait behind it."""
    rng = np.random.default_rng(7)
    t = 0.3 / rate + np.arange(int(60 * rate)) / rate
    held = (rng.random(t.size) < 0.05) * rng.gamma(2.0, 0.5 / rate, t.size)
    receive = np.maximum.accumulate(t + 0.004 + rng.gamma(2.0, 0.02 / rate, t.size) + held)
    turn = round(messages / rate * 1e9)
    row = said(tmp_path, ns(t) % turn, BEGAN_NS + ns(receive))
    assert [fault.fault for fault in counted(row)] == ["counter_wrap"]
    assert row.faults[0].parameters["wrap_s"] == pytest.approx(turn / 1e9, rel=1e-6)
    assert row.faults[0].parameters["count"] == pytest.approx(60 * rate / messages, abs=1.5)
    assert row.residual_s.bound == pytest.approx(np.ptp(receive - t), rel=0.1)


def turning(tmp_path: Path, rate: float, grain_ns: int, turn_ns: int) -> tuple[StreamAudit, float]:
    """A counter that begins anew after 42 s, read in coarse ticks; with how far delays reach."""
    rng = np.random.default_rng(14)
    t = 0.3 / rate + np.arange(int(120 * rate)) / rate
    receive = delayed(t, rng, 1e-3)
    count = (ns(t) + turn_ns - 42 * 10**9) % turn_ns
    return said(tmp_path, count // grain_ns * grain_ns, BEGAN_NS + ns(receive)), float(
        np.ptp(receive - t)
    )


@pytest.mark.parametrize("rate", [9.7, 53.0, 137.0])
@pytest.mark.parametrize(
    ("grain_ns", "turn_ns"),
    [(10**7, 2**32 * 1000), (10**6, 60 * 10**9), (10**8, 60 * 10**9), (10**7, 2**16 * 10**6)],
)
def test_a_counter_whose_ticks_are_coarse(
    tmp_path: Path, rate: float, grain_ns: int, turn_ns: int
) -> None:
    """Its range is known by name, though each fall is off by a tick, and though many messages
    carry the zero of a new turn."""
    row, reach = turning(tmp_path, rate, grain_ns, turn_ns)
    assert {fault.fault for fault in counted(row)} == {"counter_wrap", "truncated_stamps"}
    wrap = next(fault for fault in row.faults if fault.fault == "counter_wrap")
    assert wrap.parameters["wrap_s"] == turn_ns / 1e9
    assert wrap.from_s == pytest.approx(42.0, abs=0.2)
    assert row.residual_s.bound == pytest.approx(reach, rel=0.05)


@pytest.mark.parametrize("rate", [20.0, 100.0])
def test_ticks_that_a_turn_moves_are_no_step(tmp_path: Path, rate: float) -> None:
    """The sensor keeps to the ticks, but 2^32 us are no whole number of 10 ms."""
    row, _ = turning(tmp_path, rate, 10**7, 2**32 * 1000)
    assert [fault.fault for fault in counted(row)] == ["counter_wrap"]


def test_a_short_counter_in_a_gap_of_many_turns(tmp_path: Path) -> None:
    rng = np.random.default_rng(8)
    t = np.arange(6000) / 100.0
    t = t[(t < 20.0) | (t > 31.37)]
    receive = delayed(t, rng, 2e-4)
    row = said(tmp_path, ns(t) % 160_000_000, BEGAN_NS + ns(receive))
    assert {fault.fault for fault in counted(row)} == {"counter_wrap", "gap"}
    assert row.residual_s.bound == pytest.approx(np.ptp(receive - t), rel=0.05)


@pytest.mark.parametrize("forward", [True, False])
def test_a_sensor_that_measures_ever_faster_leaves_out_nothing(
    tmp_path: Path, forward: bool
) -> None:
    rng = np.random.default_rng(12)
    interval = 0.02 + 0.1 * np.exp(-np.arange(4000) * 0.02 / 4.0)
    t = np.cumsum(interval if forward else interval[::-1])
    row = said(tmp_path, BEGAN_NS + ns(t), BEGAN_NS + ns(delayed(t, rng, 5e-4)))
    assert not counted(row)


def test_gaps_between_single_messages_are_gaps(tmp_path: Path) -> None:
    rng = np.random.default_rng(13)
    t = np.arange(5000) / 50.0
    held = (t < 20.0) | (t > 32.0) | np.isin(np.arange(5000), [1200, 1400])
    row = said(tmp_path, BEGAN_NS + ns(t[held]), BEGAN_NS + ns(delayed(t[held], rng, 5e-4)))
    assert [fault.fault for fault in counted(row)] == ["gap", "gap", "gap"]


def test_receipts_of_one_moment_are_no_internal_error(tmp_path: Path) -> None:
    t = np.arange(400) / 10.0
    row = said(tmp_path, BEGAN_NS + ns(t), np.full(400, BEGAN_NS))
    assert row.messages == 400


@pytest.mark.parametrize(
    ("rate", "size", "settling"), [(5.0, 0.09, 3.1), (5.0, -0.125, 2.75), (10.0, -0.19, 4.5),
                                   (10.0, 0.06, 4.4)],
)  # fmt: skip
def test_a_lock_that_settles_within_few_messages_of_tight_delays(
    tmp_path: Path, rate: float, size: float, settling: float
) -> None:
    """Its course is steeper than the delays' scatter: that is no busy host."""
    rng = np.random.default_rng(9)
    t = 0.07 + np.arange(int(rate * 100.0)) / rate
    begin = 44.6
    clock = t + np.where(t >= begin, size * np.exp(-(t - begin) / settling), 0.0)
    receive = delayed(t, rng, 2e-5)
    row = said(tmp_path, BEGAN_NS + ns(clock), BEGAN_NS + ns(receive))
    assert [fault.fault for fault in counted(row)] == ["relock"]
    assert row.faults[0].parameters["seconds"] == pytest.approx(size, rel=0.1)
    assert row.faults[0].parameters["settling_s"] == pytest.approx(settling, rel=0.1)
    assert row.residual_s.bound < 0.02 * abs(size)
    assert not any("to and fro" in words for words in row.cannot_show)


def test_a_clock_that_is_set_in_a_beat_of_which_some_show(tmp_path: Path) -> None:
    """Set back by 0.2 ms at multiples of 3.365 s, as many of them as the log happens to show."""
    rng = np.random.default_rng(10)
    t = np.arange(3000) / 30.0
    moments = 3.365 * np.array([2, 4, 7, 9, 13, 20, 21, 23])
    clock = t - 2e-4 * np.searchsorted(moments, t, "right")
    row = said(tmp_path, BEGAN_NS + ns(clock), BEGAN_NS + ns(delayed(t, rng, 2e-5)))
    steps = [fault for fault in counted(row) if fault.fault == "step"]
    assert len(steps) == 1
    assert steps[0].parameters["count"] == moments.size
    assert steps[0].parameters["interval_s"] == pytest.approx(3.365, rel=0.01)
    assert steps[0].parameters["seconds"] == pytest.approx(-2e-4, rel=0.1)


@pytest.mark.parametrize("tick_s", [0.004, 0.008, 0.016])
def test_half_of_the_messages_wait_for_two_ticks_more(tmp_path: Path, tick_s: float) -> None:
    """No delay is near the median of all: it lies between the two that there are."""
    t = 0.0007 + np.arange(600) * 0.05
    missed = np.random.default_rng(1).permutation(600) % 2 == 0
    receive = (np.ceil(t / tick_s) + np.where(missed, 3, 1)) * tick_s
    row = said(tmp_path, BEGAN_NS + ns(t), BEGAN_NS + ns(receive))
    assert not counted(row)
