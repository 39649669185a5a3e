"""Stamps without a rhythm whose messages several threads note in another order.

Every world is written down here: when a sensor measured, what its driver stamped, when each thread
noted it.  The file is in order of the notes, as recorders write it.
"""

from __future__ import annotations

import numpy as np
import pytest

from syncline_design.auditing.stream import Examined, examined
from syncline_design.logs.readers.stream import Stamps, Stream

START = 1_780_000_000_000_000_000


def audited(stamp: np.ndarray, noted: np.ndarray) -> Examined:
    order = np.argsort(noted, kind="stable")
    whole = (START + np.round(t[order] * 1e9).astype(np.int64) for t in (stamp, noted))
    stamps = Stamps("header.stamp", "log time", *whole)
    return examined(Stream("x", (), noted.size, stamps))


def named(one: Examined) -> list[str]:
    return [f.fault for f in one.faults]


def in_packets(rate_hz: float, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """(moments measured, moments stamped) of 60 s behind a chip that hands on every 16 ms; the
    sensor's clock moves by 1.2 ms against the chip's."""
    true = 3e-4 + np.arange(int(min(60.0 * rate_hz, 20_000))) / rate_hz * (1.0 + 2e-5)
    handed = np.ceil((true + 4.3e-3) / 0.016) * 0.016
    return true, handed + 1e-4 + rng.gamma(2.0, 5e-5, true.size)


@pytest.mark.parametrize("rate_hz", [100.0, 200.0, 400.0, 1000.0])
@pytest.mark.parametrize("threads_s", [6e-5, 2e-4, 6e-4])
def test_packets_are_named_whatever_order_their_messages_were_noted_in(
    rate_hz: float, threads_s: float
) -> None:
    rng = np.random.default_rng(1)
    true, stamp = in_packets(rate_hz, rng)
    noted = stamp + 1e-3 + rng.gamma(2.0, threads_s, true.size)
    one = audited(stamp, noted)
    assert named(one) == ["packetised"]
    assert one.faults[0].parameters["interval_s"] == 0.016
    assert one.overtaken.falls > 100
    assert one.residual.bound == pytest.approx(np.ptp(noted - true), rel=0.1)


@pytest.mark.parametrize("rate_hz", [200.0, 250.0, 333.0])
def test_packets_whose_messages_are_read_one_after_the_other_are_packets_and_no_more(
    rate_hz: float,
) -> None:
    """30 us apart, noted up to 1 ms later: every fourth keeps a rhythm, which is the packets'."""
    rng = np.random.default_rng(6)
    true, _ = in_packets(rate_hz, rng)
    tick = np.ceil((true + 4.3e-3) / 0.016)
    _, first, inverse = np.unique(tick, return_index=True, return_inverse=True)
    stamp = 0.016 * tick + (rng.gamma(2.0, 2e-5, first.size))[inverse]
    stamp += 3e-5 * (np.arange(true.size) - first[inverse])
    noted = stamp + 2e-4 + rng.uniform(0.0, 1e-3, true.size)
    one = audited(stamp, noted)
    assert named(one) == ["packetised"]
    assert one.residual.bound == pytest.approx(np.ptp(noted - true), rel=0.15)


@pytest.mark.parametrize("rate_hz", [20.0, 47.3, 50.0, 62.5, 125.0, 200.0, 333.0, 400.0])
def test_frames_of_usb_that_threads_noted_are_no_steps_and_no_drift(rate_hz: float) -> None:
    """Receipts scatter over a frame of 1 ms, so stamps on arrival are not named, but their frames
    are said and counted; the sensor's clock moves over two frames."""
    rng = np.random.default_rng(7)
    true = 3e-4 + np.arange(int(75.0 * rate_hz)) / rate_hz * (1.0 + 3e-5)
    stamp = np.ceil(true / 1e-3) * 1e-3 + 1e-4 + rng.gamma(2.0, 2e-5, true.size)
    noted = stamp + 2e-4 + rng.uniform(0.0, 1e-3, true.size)
    one = audited(stamp, noted)
    assert named(one) == []
    assert one.hidden is not None
    assert one.residual.bound is not None
    assert one.residual.bound + one.hidden.seconds > 0.9 * np.ptp(noted - true)


@pytest.mark.parametrize(("rate_hz", "ppm", "seed"), [(62.5, -12.0, 1), (125.0, 12.0, 8)])
def test_one_edge_of_a_frame_is_no_step_where_the_interval_holds_longer_ticks_too(
    rate_hz: float, ppm: float, seed: int
) -> None:
    """A clock 12 ppm off passes one edge of a frame of 1 ms within the log; receipts scatter over
    the frame, by chance as a step does."""
    rng = np.random.default_rng(seed)
    true = 4.5e-4 + np.arange(int(75.0 * rate_hz)) / rate_hz * (1.0 + 1e-6 * ppm)
    stamp = np.ceil(true / 1e-3) * 1e-3 + 1e-4 + rng.gamma(2.0, 2e-5, true.size)
    assert np.sum(np.abs(np.diff(stamp) - 1.0 / rate_hz) > 5e-4) == 1
    assert named(audited(stamp, stamp + 2e-4 + rng.uniform(0.0, 1e-3, true.size))) == []


@pytest.mark.parametrize(("rate_hz", "timer_s"), [(62.5, 0.016), (125.0, 0.008)])
def test_a_tick_left_out_by_a_sensor_of_a_tick_is_said_and_no_loss(
    rate_hz: float, timer_s: float
) -> None:
    """30 ppm slower than the timer: once a tick comes before the message that it was for."""
    rng = np.random.default_rng(8)
    true = np.arange(int(75.0 * rate_hz)) / rate_hz * (1.0 + 3e-5) - 1e-3
    stamp = np.ceil(true / timer_s) * timer_s + 1e-4 + rng.gamma(2.0, 2e-5, true.size)
    one = audited(stamp, stamp + 1e-4 + rng.gamma(2.0, 8e-5, true.size))
    assert np.sum(np.diff(stamp) > 1.5 * timer_s) == 1
    assert named(one) == []
    assert one.hidden is not None
    assert one.hidden.seconds == timer_s
    assert "left 1 of them empty" in one.hidden.words


def test_wrong_stamps_among_packets_that_threads_noted_stay_wrong() -> None:
    rng = np.random.default_rng(2)
    true, stamp = in_packets(200.0, rng)
    noted = stamp + 1e-3 + rng.gamma(2.0, 2e-4, true.size)
    stamp[[2000, 5000, 9000]] -= 0.3
    one = audited(stamp, noted)
    assert sorted(named(one)) == ["backward_jump", "packetised"]
    fault = next(f for f in one.faults if f.fault == "backward_jump")
    assert fault.parameters["count"] == 3.0


@pytest.mark.parametrize("rate_hz", [20.0, 50.0, 137.0])
@pytest.mark.parametrize("begins_s", [0.0, 40.0])
def test_arrivals_that_threads_noted_are_arrivals_and_no_more(
    rate_hz: float, begins_s: float
) -> None:
    rng = np.random.default_rng(3)
    true = np.arange(int(90.0 * rate_hz)) / rate_hz
    came = np.maximum.accumulate(true + 5e-3 + rng.gamma(2.0, 3e-3, true.size))
    noted = came + rng.gamma(2.0, 5e-5, true.size)
    one = audited(np.where(true >= begins_s, came, true), noted)
    assert named(one) == ["stamped_on_arrival"]
    begin = one.faults[0].from_s
    assert (begin is None) if begins_s == 0.0 else begin == pytest.approx(begins_s, abs=0.2)


@pytest.mark.parametrize(("rate_hz", "grain_s"), [(400.0, 1e-3), (137.0, 1e-2), (53.0, 1e-2)])
def test_stamps_cut_off_to_a_grid_that_threads_noted(rate_hz: float, grain_s: float) -> None:
    rng = np.random.default_rng(4)
    true = 3e-4 + np.arange(int(60.0 * rate_hz)) / rate_hz
    noted = true + 2e-3 + rng.gamma(2.0, 3e-4, true.size)
    one = audited(np.floor(true / grain_s + 1e-9) * grain_s, noted)
    assert named(one) == ["truncated_stamps"]
    assert one.residual.bound == pytest.approx(np.ptp(noted - true), rel=0.1)


def test_stamps_of_events_that_go_back_are_no_threads() -> None:
    rng = np.random.default_rng(5)
    true = np.cumsum(rng.exponential(0.3, 400))
    noted = np.maximum.accumulate(true + 2e-3 + rng.gamma(2.0, 1e-3, true.size))
    stamp = true.copy()
    places = np.array([60, 170, 320])
    stamp[places] = true[places - 1] - 0.05
    assert named(audited(stamp, noted)) == ["backward_jump"]


@pytest.mark.parametrize("seed", range(3))
def test_events_that_overtake_one_another_within_their_delays(seed: int) -> None:
    """Moments at random, 20 ms apart in the mean, and delays of 4 ms: no stamp is wrong."""
    rng = np.random.default_rng(seed)
    true = np.cumsum(rng.exponential(0.02, 4000))
    assert named(audited(true, true + 2e-3 + rng.gamma(2.0, 4e-4, true.size))) == []
