"""Stamps that say when a message came: over frames of USB, and after waits as long as an interval.

Every world says itself when a sensor measured, when a bus handed the message over and when the
recorder took it; the residual is held against the planted delays.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from syncline_design.auditing.result import StreamAudit
from tests.test_audit_transport import even, found, queued, said

FRAME = 1e-3


def on_frames(t: np.ndarray, rng: np.random.Generator, frame: float = FRAME) -> np.ndarray:
    """When a host that is handed messages at the ends of frames reads its clock."""
    phase = rng.uniform(0.0, frame)
    taken = np.ceil((t - phase) / frame) * frame + phase
    return np.maximum.accumulate(taken + 5e-6 + rng.exponential(3e-5, t.size))


def recorded(stamp: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    return np.maximum.accumulate(stamp + 2e-5 + rng.exponential(5e-5, stamp.size))


def hides(row: StreamAudit, words: str) -> bool:
    return any("stamped on arrival" in said and words in said for said in row.cannot_show)


@pytest.mark.parametrize(
    ("rate", "ppm", "frame"),
    [(100.0, 40.0, 1e-3), (97.3, 0.0, 1e-3), (10.0, 60.0, 1e-3), (134.1, 5.0, 5e-4)],
)
def test_arrivals_at_the_ends_of_usb_frames(
    tmp_path: Path, rate: float, ppm: float, frame: float
) -> None:
    rng = np.random.default_rng(31)
    t = even(rate, 60.0) * (1 + ppm * 1e-6)
    stamp = on_frames(t + rng.gamma(2.0, 2e-5, t.size), rng, frame)
    receive = recorded(stamp, rng)
    row = said(tmp_path, stamp, receive)
    fault = found(row)["stamped_on_arrival"]
    assert set(found(row)) == {"stamped_on_arrival"}
    assert fault.parameters["interval_s"] == frame
    assert row.residual_s.bound == pytest.approx(np.ptp(receive - t), rel=0.1)


@pytest.mark.parametrize(
    ("rate", "tick"),
    [(200.0, 1e-3), (100.0, 2e-3), (50.0, 4e-3), (125.0, 8e-3), (25.0, 8e-3), (62.5, 16e-3)],
)
def test_ticks_that_a_whole_interval_hides_are_said_and_counted(
    tmp_path: Path, rate: float, tick: float
) -> None:
    """Read by a host that is late by an interrupt: no tick's edge lies within the log, and the
    longest tick that a whole number of makes the interval may have held messages back."""
    rng = np.random.default_rng(32)
    t = 0.0171 + np.arange(3000) / rate
    stamp = t + 3e-4 + rng.exponential(3e-5, t.size)
    receive = recorded(stamp, rng)
    row = said(tmp_path, stamp, receive)
    assert not found(row)
    assert hides(row, f"{1e3 * tick:.0f} ms")
    assert row.residual_s.bound == pytest.approx(np.ptp(receive - stamp) + tick, abs=1e-6)


@pytest.mark.parametrize(
    ("rate", "tick", "ppm"),
    [(62.5, 4e-3, -45.0), (62.5, 2e-3, 35.0), (100.0, 1e-3, -45.0), (25.0, 4e-3, 40.0)],
)
def test_one_edge_of_a_tick_tells_its_length(
    tmp_path: Path, rate: float, tick: float, ppm: float
) -> None:
    """The sensor drifts over one edge: stamps move on by one tick and stay, so that no longer one
    held them back, though the interval is a whole number of such."""
    rng = np.random.default_rng(33)
    t = np.arange(round(60.0 * rate)) / rate * (1 + ppm * 1e-6)
    at = 0.5 * (t[-1] - t[0]) * ppm * 1e-6  # the edge that it drifts over at half of the log
    stamp = np.ceil((t - at) / tick - 1e-3) * tick + 5e-6 + rng.exponential(2e-5, t.size)
    receive = recorded(stamp, rng)
    assert 1 <= np.unique(np.round(np.diff(stamp) / tick)).size - 1 <= 2
    row = said(tmp_path, stamp, receive)
    assert not found(row)
    assert row.residual_s.bound == pytest.approx(np.ptp(receive - stamp) + tick, abs=1e-6)
    assert row.residual_s.bound == pytest.approx(np.ptp(receive - t), rel=0.12)


@pytest.mark.parametrize(("rate", "tick", "ppm"), [(200.0, 2e-3, -20.0), (40.0, 2e-3, 12.0)])
def test_the_bound_counts_what_frames_hide_between_their_places(
    tmp_path: Path, rate: float, tick: float, ppm: float
) -> None:
    """Two and a half frames an interval, twelve and a half: messages come at two places of them."""
    for seed in range(6):
        rng = np.random.default_rng([34, seed])
        t = np.arange(round(min(60.0 * rate, 4000.0))) / rate * (1 + ppm * 1e-6)
        stamp = on_frames(t + rng.uniform(0.0, tick), rng, tick)
        receive = recorded(stamp, rng)
        row = said(tmp_path, stamp, receive)
        assert set(found(row)) == {"stamped_on_arrival"}
        bound, true = row.residual_s.bound, np.ptp(receive - t)
        assert bound is not None
        assert 0.95 * true < bound < max(true, tick) + 1.1 * np.ptp(receive - stamp)


@pytest.mark.parametrize("rate", [47.3, 20.2, 30.1])
def test_intervals_near_whole_frames_hide_none(tmp_path: Path, rate: float) -> None:
    """A tenth of a frame off: over frames they would be a frame more and less apart."""
    rng = np.random.default_rng(39)
    t = even(rate, 60.0)
    stamp = t + 3e-4 + rng.exponential(3e-5, t.size)
    receive = recorded(stamp, rng)
    row = said(tmp_path, stamp, receive)
    assert not found(row)
    assert not hides(row, "frames")
    assert not hides(row, "ticks")
    assert row.residual_s.bound == pytest.approx(np.ptp(receive - stamp), abs=1e-6)


# timer, rates whose interval is no whole number of its ticks, a threads' delay
SERIAL = [
    (8e-3, 20.0, 0.0), (8e-3, 47.3, 1e-3), (8e-3, 50.0, 1e-3), (8e-3, 100.0, 0.0),
    (8e-3, 100.0, 1e-3), (8e-3, 115.2, 1e-3), (16e-3, 25.0, 1e-3), (16e-3, 50.0, 0.0),
]  # fmt: skip


@pytest.mark.parametrize(("timer", "rate", "threads"), SERIAL)
def test_ticks_of_a_serial_chip_are_named_at_any_rate(
    tmp_path: Path, timer: float, rate: float, threads: float
) -> None:
    rng = np.random.default_rng(40)
    t = even(rate * (1 + 2e-5), 75.0)
    stamp = np.ceil((t - 3.1e-3) / timer) * timer + 3.1e-3 + 1e-4 + rng.gamma(2.0, 2e-5, t.size)
    receive = recorded(stamp, rng) + rng.uniform(0.0, threads, t.size)
    row = said(tmp_path, stamp, receive)
    assert set(found(row)) == {"packetised"}
    assert found(row)["packetised"].parameters["interval_s"] == timer
    bound = row.residual_s.bound
    assert bound is not None
    # of few places in a tick it is not seen how far the sensor's clock moved between them
    assert 0.97 * np.ptp(receive - t) < bound < np.ptp(receive - t) + 5e-5 * 75.0
    assert bound < timer + 1.1 * np.ptp(receive - stamp)


@pytest.mark.parametrize("share", [0.02, 0.1])
def test_lost_messages_of_a_sensor_that_a_host_stamps_are_no_ticks(
    tmp_path: Path, share: float
) -> None:
    """125 Hz is a tick of 8 ms: what is missing at random follows no line."""
    rng = np.random.default_rng(41)
    t = even(125.0, 75.0)
    t = t[rng.random(t.size) > share]
    stamp = t + 3e-4 + rng.exponential(3e-5, t.size)
    row = said(tmp_path, stamp, recorded(stamp, rng))
    assert set(found(row)) == {"lost_messages"}


def test_publishers_in_turn_that_a_host_stamps_are_no_ticks(tmp_path: Path) -> None:
    """8.2 and 11.8 ms apart by turns, a fifth of a millisecond off ticks of 4 ms."""
    rng = np.random.default_rng(42)
    t = 0.02 * np.repeat(np.arange(2000.0), 2) + np.tile([0.0, 0.0082], 2000)
    stamp = t + 3e-4 + rng.exponential(3e-5, t.size)
    assert "packetised" not in found(said(tmp_path, stamp, recorded(stamp, rng)))


@pytest.mark.parametrize("ticks", [1e-3, 1.25e-4])
def test_a_sensor_on_ticks_of_its_own_task_is_sound(tmp_path: Path, ticks: float) -> None:
    rng = np.random.default_rng(33)
    stamp = np.ceil(even(97.3, 60.0) / ticks) * ticks + 3.17e-4 + rng.normal(0.0, 1e-6, 5838)
    row = said(tmp_path, stamp, recorded(stamp, rng))
    assert not found(row)
    assert not hides(row, "")


def test_receipts_over_usb_of_stamps_of_the_sensor_are_sound(tmp_path: Path) -> None:
    rng = np.random.default_rng(34)
    t = even(100.0, 60.0) * (1 + 25e-6)
    row = said(tmp_path, t + rng.normal(0.0, 2e-6, t.size), on_frames(t + 3e-4, rng))
    assert not found(row)
    assert not hides(row, "")


@pytest.mark.parametrize("law", ["gamma", "exponential", "lognormal"])
@pytest.mark.parametrize("share", [0.5, 1.2])
def test_waits_as_long_as_an_interval(tmp_path: Path, law: str, share: float) -> None:
    rng = np.random.default_rng(35)
    t = even(100.0, 25.0)
    draw = {
        "gamma": lambda: rng.gamma(2.0, 0.5 * share / 100.0, t.size),
        "exponential": lambda: rng.exponential(share / 100.0, t.size),
        "lognormal": lambda: share / 100.0 * rng.lognormal(0.0, 0.7, t.size),
    }
    queue = 2e-5 * np.arange(t.size)  # one message after the other
    stamp = np.maximum.accumulate(t + 1e-3 + draw[law]() - queue) + queue
    receive = recorded(stamp, rng)
    row = said(tmp_path, stamp, receive)
    assert set(found(row)) == {"stamped_on_arrival"}
    assert row.residual_s.bound == pytest.approx(np.ptp(receive - t), rel=0.1)


@pytest.mark.parametrize(("rate", "seed"), [(8.0, 51), (15.0, 52), (45.0, 53)])
def test_arrivals_with_a_heavy_tail_are_named_beside_receipts_that_scatter(
    tmp_path: Path, rate: float, seed: int
) -> None:
    """Most delays of such a tail are hardly longer than receipts scatter; the others tell."""
    rng = np.random.default_rng(seed)
    t = even(rate, 1800.0 / rate)
    stamp = np.maximum.accumulate(t + 1e-3 + 1e-3 * rng.pareto(2.2, t.size))
    receive = np.maximum.accumulate(stamp + 5e-5 + rng.gamma(2.0, 1e-4, t.size))
    row = said(tmp_path, stamp, receive)
    assert set(found(row)) == {"stamped_on_arrival"}
    assert row.residual_s.bound == pytest.approx(np.ptp(receive - t), rel=0.1)


def test_stamps_of_the_sensor_whose_transport_has_a_heavy_tail_are_sound(tmp_path: Path) -> None:
    rng = np.random.default_rng(54)
    t = even(15.0, 120.0)
    stamp = t + rng.gamma(2.0, 1e-4, t.size)
    receive = np.maximum.accumulate(stamp + 1e-3 + 1e-3 * rng.pareto(2.2, t.size))
    assert not found(said(tmp_path, stamp, receive))


def test_waits_as_long_as_an_interval_from_some_message_on(tmp_path: Path) -> None:
    rng = np.random.default_rng(36)
    t = even(50.0, 70.0)
    queue = 2e-5 * np.arange(t.size)
    came = np.maximum.accumulate(t + 1e-3 + rng.gamma(2.0, 8e-3, t.size) - queue) + queue
    row = found(said(tmp_path, np.where(t > 31.0, came, t), recorded(came, rng)))
    assert set(row) == {"stamped_on_arrival"}
    assert row["stamped_on_arrival"].from_s == pytest.approx(31.0, abs=0.3)


@pytest.mark.parametrize("law", ["poisson", "even", "walk", "both sides"])
def test_sensors_without_rhythm_are_not_accused(tmp_path: Path, law: str) -> None:
    rng = np.random.default_rng(37)
    n = 2500
    t = {
        "poisson": lambda: np.cumsum(rng.exponential(0.01, n)),
        "even": lambda: np.cumsum(rng.gamma(8.0, 0.01 / 8.0, n)),
        "walk": lambda: np.cumsum(0.01 * (1 + 0.4 * np.sin(np.arange(n) / 200.0))),
        "both sides": lambda: np.sort(np.arange(n) * 0.01 + rng.normal(0.0, 0.003, n)),
    }[law]()
    assert not found(said(tmp_path, t, recorded(t, rng)))


def test_waits_for_a_turn_that_a_trigger_makes_too_are_said_and_counted(tmp_path: Path) -> None:
    rng = np.random.default_rng(38)
    t = even(50.0, 60.0)
    stamp = t + rng.uniform(0.0, 0.012, t.size)
    row = said(tmp_path, stamp, recorded(stamp, rng))
    assert not found(row)
    assert hides(row, "sharp edge")
    assert row.residual_s.bound == pytest.approx(0.012, rel=0.1)


@pytest.mark.parametrize(("rate", "scale", "out"), [(75.0, 6e-3, 228), (20.0, 6e-3, 31)])
def test_arrivals_about_a_gap_are_late_by_no_more_than_they_were(
    tmp_path: Path, rate: float, scale: float, out: int
) -> None:
    """A gap of whole intervals, over which counted intervals that scatter would go astray."""
    rng = np.random.default_rng(37)
    t = even(rate, 80.0)
    stamp = np.maximum.accumulate(t + rng.gamma(2.0, scale, t.size))
    receive = recorded(stamp, rng)
    kept = np.ones(t.size, dtype=bool)
    kept[t.size // 2 : t.size // 2 + out] = False
    row = said(tmp_path, stamp[kept], receive[kept])
    assert set(found(row)) == {"stamped_on_arrival", "gap"}
    assert row.residual_s.bound == pytest.approx(np.ptp((receive - t)[kept]), rel=0.1)


def test_lost_messages_of_a_drifting_clock_are_no_waits_for_a_turn(tmp_path: Path) -> None:
    """What is missing lengthens no wait: nothing is counted in the bound beside transport."""
    rng = np.random.default_rng(0)
    t = 0.01 + np.arange(1471) / 15.0 + rng.normal(0.0, 2e-5, 1471)
    delay = 0.03 + np.where(rng.random(t.size) < 0.97, rng.gamma(4.0, 6e-4, t.size),
                            rng.gamma(2.0, 5e-3, t.size))  # fmt: skip
    kept = rng.random(t.size) > 0.025
    row = said(tmp_path, (t * (1 + 92e-6))[kept], np.maximum.accumulate(t + delay)[kept])
    assert set(found(row)) == {"drift", "lost_messages"}
    assert not hides(row, "wait")
    assert row.residual_s.bound == pytest.approx(np.ptp(delay[kept]), rel=0.1)


@pytest.mark.parametrize("seed", range(4))
def test_a_step_of_arrivals_is_one_step(tmp_path: Path, seed: int) -> None:
    """25 ms, of stamps that scatter by 2 ms: its size is known to some us, and what is left of it
    is no second one."""
    rng = np.random.default_rng(seed)
    t = even(9.7, 120.0)
    came = queued(t, 1e-3, seed)
    stamp = came + np.where(t > 54.0, 0.025, 0.0)
    row = said(tmp_path, stamp, np.maximum.accumulate(came + rng.gamma(2.0, 3e-5, t.size)))
    assert sorted(f.fault for f in row.faults) == ["stamped_on_arrival", "step"]
    assert found(row)["step"].parameters["seconds"] == pytest.approx(0.025, abs=5e-5)
