"""Timers slower than the sensor's rhythm allows to see, grids that turn once or twice, and arrivals
late by many intervals: what stamps say of them, and what they leave open."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from syncline_design.auditing.run import audit
from syncline_design.auditing.stream import Examined
from syncline_design.machine.random_numbers import generator
from tests.stamped_streams import EPOCH_NS, of

Array = NDArray[np.float64]
LENGTH_S = 80.0


def measured(rate_hz: float, ppm: float, first_s: float = 0.0031) -> Array:
    return first_s + np.arange(int(LENGTH_S * rate_hz)) / rate_hz * (1.0 + 1e-6 * ppm)


def late(count: int, seed: int) -> Array:
    return 3e-3 + generator((51, seed)).gamma(2.0, 2e-3, count)


def names(one: Examined) -> set[str]:
    return {fault.fault for fault in one.faults}


def counted(one: Examined) -> float:
    """The bound with what may hide [s]."""
    assert one.residual.bound is not None
    return one.residual.bound + (one.hidden.seconds if one.hidden is not None else 0.0)


@pytest.mark.parametrize("phase_s", [0.0, 0.0113])
@pytest.mark.parametrize(
    ("rate_hz", "tick_s"), [(20.0, 0.04), (30.0, 0.04), (24.0, 0.04), (10.0, 0.03), (60.0, 0.0125)]
)
def test_ticks_whose_messages_are_received_evenly_are_packets(
    rate_hz: float, tick_s: float, phase_s: float
) -> None:
    when = measured(rate_hz, 17.0)
    stamp = np.floor((when - phase_s) / tick_s) * tick_s + phase_s
    receive = np.maximum.accumulate(when + late(when.size, int(rate_hz)))
    one = of(stamp, receive)
    assert names(one) == {"packetised"}
    assert one.faults[0].parameters["interval_s"] == pytest.approx(tick_s, rel=1e-3)
    assert one.residual.bound == pytest.approx(float(np.ptp(receive - when)), rel=0.1)


@pytest.mark.parametrize(("rate_hz", "tick_s"), [(20.0, 0.04), (15.0, 0.04), (30.0, 0.04)])
def test_ticks_that_a_count_of_messages_makes_too_are_said_and_counted(
    rate_hz: float, tick_s: float
) -> None:
    """20 Hz on 40 ms, or 25 Hz without every fifth: the same two columns."""
    when = measured(rate_hz, 17.0)
    stamp = np.ceil(when / tick_s) * tick_s
    receive = np.maximum.accumulate(stamp + late(when.size, int(rate_hz)))
    one = of(stamp, receive)
    assert names(one) <= {"duplicates"}
    assert one.hidden is not None
    assert "40 ms" in one.hidden.words
    true = float(np.ptp(receive - when))
    assert 0.97 * true < counted(one) < true + (5e-5 + 17e-6) * LENGTH_S  # two clocks' rates


def test_ticks_that_never_repeat_themselves_are_packets() -> None:
    """29.97 Hz on 20 ms: no count of messages leaves out so."""
    when = measured(29.97, 9.0)
    stamp = np.ceil((when - 0.0071) / 0.02) * 0.02 + 0.0071
    receive = np.maximum.accumulate(stamp + late(when.size, 3))
    one = of(stamp, receive)
    assert names(one) == {"packetised"}
    assert one.residual.bound == pytest.approx(float(np.ptp(receive - when)), rel=0.1)


def spread_late(count: int, seed: int) -> Array:
    """Delays that reach over more than a grain of 20 ms."""
    return 0.02 + generator((53, seed)).gamma(2.0, 4e-3, count)


@pytest.mark.parametrize("rate_hz", [15.0, 30.0])
@pytest.mark.parametrize("seed", [1, 2])
def test_a_sensor_that_measures_on_a_grid_cuts_nothing_off(rate_hz: float, seed: int) -> None:
    """Nothing tells it from ticks of a timer: said, and the bound holds both."""
    schedule = measured(rate_hz, 17.0)
    when = np.ceil(schedule / 0.02) * 0.02
    receive = np.maximum.accumulate(when + spread_late(when.size, seed))
    one = of(when, receive)
    assert names(one) == set()
    assert one.hidden is not None
    for true in (receive - when, receive - schedule):
        assert counted(one) > 0.97 * float(np.ptp(true))


@pytest.mark.parametrize("rate_hz", [12.0, 15.0, 23.7, 30.0])
@pytest.mark.parametrize("seed", [1, 2])
def test_stamps_that_were_cut_off_are_told_by_what_receipts_keep(rate_hz: float, seed: int) -> None:
    when = measured(rate_hz, 17.0)
    receive = np.maximum.accumulate(when + spread_late(when.size, seed))
    one = of(np.floor(when / 0.02) * 0.02, receive)
    assert names(one) == {"truncated_stamps"}
    assert one.residual.bound == pytest.approx(float(np.ptp(receive - when)), rel=0.1)


def test_ticks_whose_receipts_are_spread_are_no_cut_off_stamps() -> None:
    """29.97 Hz on the host's own 20 ms."""
    when = measured(29.97, 9.0)
    stamp = np.ceil(when / 0.02) * 0.02
    receive = np.maximum.accumulate(stamp + spread_late(when.size, 3))
    one = of(stamp, receive)
    assert names(one) == {"packetised"}
    assert one.residual.bound == pytest.approx(float(np.ptp(receive - when)), rel=0.1)


@pytest.mark.parametrize("turns", [(0.03, 0.07), (0.01, 0.09), (0.05, 0.05, 0.17)])
def test_publishers_in_turn_hide_no_ticks(turns: tuple[float, ...]) -> None:
    when = np.cumsum(np.tile(turns, 400))
    one = of(when, np.maximum.accumulate(when + late(when.size, 5)))
    assert names(one) == set()
    assert one.hidden is None


@pytest.mark.parametrize("share", [0.02, 0.05, 0.1])
def test_losses_at_random_hide_no_ticks(share: float) -> None:
    when = np.arange(2000) * 0.04
    when = when[generator((52, int(100 * share))).random(when.size) > share]
    one = of(when, np.maximum.accumulate(when + late(when.size, 6)))
    assert names(one) == {"lost_messages"}
    assert one.hidden is None


@pytest.mark.parametrize("ppm", [-33.0, -15.7, 21.0])
@pytest.mark.parametrize("rate_hz", [50.0, 100.0])
def test_a_grid_that_turns_once_or_twice_is_no_step_and_no_lock(rate_hz: float, ppm: float) -> None:
    """A whole number of ms, but for a sensor's ppm: one edge or two are crossed in 80 s."""
    when = measured(rate_hz, ppm, 0.00143)
    stamp = np.floor(when / 1e-3 + 1e-6) * 1e-3
    one = of(stamp, np.maximum.accumulate(when + late(when.size, int(rate_hz - ppm))))
    turns = np.round(np.abs(np.diff(stamp) - 1.0 / rate_hz) / 1e-3).sum()
    assert names(one) == ({"truncated_stamps"} if turns > 1 else set())


def test_a_grid_of_tens_of_milliseconds_that_turns_once_is_no_step() -> None:
    when = measured(10.0, 16.4, 0.0093)
    one = of(np.floor(when / 0.01 + 1e-6) * 0.01, when + late(when.size, 8))
    assert names(one) == set()


def test_a_step_of_one_grain_of_a_clock_that_keeps_time_is_a_step() -> None:
    when = measured(100.0, 0.0, 0.0)
    stamp = when + np.where(when > 31.0, 2e-3, 0.0)
    found = of(stamp, np.maximum.accumulate(when + late(when.size, 9) / 4.0))
    assert names(found) == {"step"}


@pytest.mark.parametrize("intervals", [3.0, 8.0, 16.0])
@pytest.mark.parametrize("rate_hz", [30.0, 100.0])
@pytest.mark.parametrize("apart_s", [2e-7, 1e-4])
def test_arrivals_late_by_many_intervals(rate_hz: float, intervals: float, apart_s: float) -> None:
    """In order: most wait for one that is late, and then come at once."""
    rng = generator((53, int(rate_hz), int(intervals)))
    when = measured(rate_hz, 12.0)
    waits = rng.gamma(2.0, 0.5 * intervals / rate_hz, when.size)
    queue = apart_s * np.arange(when.size)
    stamp = np.maximum.accumulate(when + waits - queue) + queue
    receive = stamp + 1e-4 + rng.gamma(2.0, 8e-5, when.size)
    one = of(stamp, np.maximum.accumulate(receive))
    assert names(one) == {"stamped_on_arrival"}
    assert one.residual.bound == pytest.approx(float(np.ptp(receive - when)), rel=0.1)


def test_events_at_random_that_come_at_once_are_not_accused() -> None:
    """Bursts of any number after times of any length keep to no line."""
    rng = generator((54,))
    bursts = np.cumsum(rng.exponential(0.05, 1600))
    sizes = rng.integers(1, 9, bursts.size)
    when = np.sort(np.repeat(bursts, sizes) + 1e-4 * np.concatenate([np.arange(n) for n in sizes]))
    assert names(of(when, when + 1e-4 + rng.gamma(2.0, 8e-5, when.size))) == set()


def edged(first_tick: float, ppm: float) -> Array:
    """25 Hz on the ticks of 10 ms; the first message so far behind one, in ticks."""
    return np.ceil(measured(25.0, ppm, first_tick * 0.01) / 0.01 - 1e-6) * 0.01


@pytest.mark.parametrize(("first_tick", "ppm"), [(0.1, -20.0), (0.04, -30.0), (0.9, 20.0)])
@pytest.mark.parametrize("seed", range(3))
def test_a_turn_that_receipts_follow_was_measured_or_waited_for(
    first_tick: float, ppm: float, seed: int
) -> None:
    """Taken for an edge of a grid that cuts, it put stamps behind their receipts."""
    stamp = edged(first_tick, ppm)
    assert np.unique(np.round(np.diff(stamp), 6)).size == 2
    receive = np.maximum.accumulate(stamp + late(stamp.size, seed))
    one = of(stamp, receive)
    assert names(one) == set()
    assert one.hidden is not None
    assert "10 ms" in one.hidden.words
    assert one.residual.bound == pytest.approx(float(np.ptp(receive - stamp)), rel=0.01)
    waited = receive - measured(25.0, ppm, first_tick * 0.01)
    assert counted(one) > 0.97 * float(np.ptp(waited))


def test_a_drift_that_a_grid_may_make_says_so(tmp_path: Path) -> None:
    """25 Hz, 40 ppm slow, cut off to 10 ms, over none of whose edges it drifts."""
    when = measured(25.0, 40.0, 0.0031)
    receive = np.maximum.accumulate(when + late(when.size, 1))
    times = (np.rint(1e9 * t).astype(np.int64) for t in (np.floor(when / 0.01) * 0.01, receive))
    rows = "".join(f"{EPOCH_NS + s},{EPOCH_NS + r}\n" for s, r in zip(*times, strict=True))
    path = tmp_path / "x.csv"
    path.write_text("stamp_ns,receive_ns\n" + rows, "utf-8")
    (stream,) = audit([path]).streams
    assert [fault.fault for fault in stream.faults] == ["drift"]
    assert any("a grid of up to 20 ms cuts off" in said for said in stream.cannot_show)


def with_losses(rate_hz: float, seed: int) -> Array:
    when = measured(rate_hz, 17.0)
    return np.asarray(when[generator((57, seed)).random(when.size) > 0.01])


@pytest.mark.parametrize(
    ("rate_hz", "tick_s"), [(15.0, 0.02), (23.0, 0.01), (29.97, 0.02), (20.0, 0.04)]
)
@pytest.mark.parametrize("seed", range(3))
def test_losses_hide_no_ticks(rate_hz: float, tick_s: float, seed: int) -> None:
    """One message in a hundred missing: named, or said, and the bound holds the ticks."""
    when = with_losses(rate_hz, seed)
    stamp = np.ceil((when - 0.0071) / tick_s) * tick_s + 0.0071
    taken = generator((59, seed)).gamma(2.0, 2e-4, when.size)
    one = of(stamp, np.maximum.accumulate(stamp + taken))
    assert one.hidden is not None or "packetised" in names(one)
    assert counted(one) > 0.95 * float(np.ptp(stamp + taken - when))
    even = np.maximum.accumulate(when + tick_s + late(when.size, seed))
    one = of(stamp, even)
    assert names(one) == {"packetised", "lost_messages"}
    lost = next(f for f in one.faults if f.fault == "lost_messages")
    assert lost.parameters["count"] == round((when[-1] - when[0]) * rate_hz) + 1 - when.size
    assert one.residual.bound == pytest.approx(float(np.ptp(even - when)), rel=0.1)


@pytest.mark.parametrize("seed", range(3))
def test_losses_within_a_packet_are_put_where_receipts_have_them(seed: int) -> None:
    """100 Hz in ticks of 16 ms: stamps alone tell no place of a loss within a tick."""
    when = with_losses(100.0, seed)
    stamp = np.ceil((when - 0.0071) / 0.016) * 0.016 + 0.0071
    receive = np.maximum.accumulate(when + 0.016 + late(when.size, seed) / 3.0)
    one = of(stamp, receive)
    assert names(one) == {"packetised", "lost_messages"}
    assert one.residual.bound == pytest.approx(float(np.ptp(receive - when)), rel=0.1)
