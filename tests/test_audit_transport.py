"""What transport does to sound stamps: it overtakes, loses, waits; and stamps that look like it.

Every world says itself when a sensor measured, what it stamped and when the message came.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from syncline_design.auditing.result import StampFault, StreamAudit
from syncline_design.auditing.run import audit
from tests.stamped_streams import of

BEGAN = 1_755_000_000


def said(
    folder: Path, stamp: np.ndarray, receive: np.ndarray, *, file_order: bool = True
) -> StreamAudit:
    """The audit of messages in the order of their receipts."""
    order = np.argsort(receive, kind="stable") if file_order else np.arange(stamp.size)
    path = folder / "x.csv"
    rows = ["stamp_ns,receive_ns"]
    for s, r in zip(np.rint(stamp * 1e9)[order], np.rint(receive * 1e9)[order], strict=True):
        rows.append(f"{int(s) + BEGAN * 10**9},{int(r) + BEGAN * 10**9}")
    path.write_text("\n".join(rows) + "\n", "utf-8")
    return audit([path]).streams[0]


def found(row: StreamAudit) -> dict[str, StampFault]:
    return {fault.fault: fault for fault in row.faults if fault.counts}


def queued(t: np.ndarray, scale: float, seed: int) -> np.ndarray:
    delay = np.random.default_rng(seed).gamma(2.0, scale, t.size)
    return np.maximum.accumulate(t + 0.003 + delay)


def even(rate: float, length: float) -> np.ndarray:
    return 0.0171 + np.arange(int(rate * length)) / rate


# ---- messages that overtake one another -----------------------------------------------------


@pytest.mark.parametrize(("rate", "scale"), [(100.0, 0.005), (200.0, 0.03), (50.0, 0.1)])
def test_messages_that_overtake_one_another_have_right_stamps(
    tmp_path: Path, rate: float, scale: float
) -> None:
    t = even(rate, 60.0)
    delay = np.random.default_rng(3).exponential(scale, t.size)
    row = said(tmp_path, t, t + 0.004 + delay)
    assert not found(row)
    assert row.residual_s.bound == pytest.approx(np.ptp(delay), rel=0.05)
    falls = int(np.sum(np.diff(t[np.argsort(t + delay)]) < 0))
    assert any(f"why {falls} messages came after" in words for words in row.cannot_show)


def test_faults_of_a_stream_that_transport_disorders_are_named_alone(tmp_path: Path) -> None:
    t = even(50.0, 70.0)
    receive = t + 0.004 + 0.1 * np.random.default_rng(5).random(t.size)
    slipped = np.where((t > 30.0) & (t < 42.0), t - 1.0, t)
    assert set(found(said(tmp_path, slipped, receive))) == {"whole_second_slip"}
    stepped = np.where(t > 40.0, t + 0.2, t)
    row = found(said(tmp_path, stepped, receive))
    assert set(row) == {"step"}
    assert row["step"].parameters["seconds"] == pytest.approx(0.2, abs=0.01)


@pytest.mark.parametrize("rate", [20.0, 200.0])
def test_stamps_that_two_messages_exchanged_are_wrong(tmp_path: Path, rate: float) -> None:
    t = even(rate, 60.0)
    at = np.arange(40, t.size - 5, 75)
    stamp = t.copy()
    stamp[at], stamp[at + 1] = t[at + 1], t[at]
    row = found(said(tmp_path, stamp, queued(t, 0.15 / rate, 6), file_order=False))
    assert set(row) == {"backward_jump"}
    assert row["backward_jump"].parameters["count"] == at.size
    assert row["backward_jump"].parameters["seconds"] == pytest.approx(-1.0 / rate)


# ---- messages that are lost ------------------------------------------------------------------


@pytest.mark.parametrize("share", [0.2, 0.35])
def test_many_messages_lost_at_random_are_lost(tmp_path: Path, share: float) -> None:
    t = even(50.0, 60.0)
    kept = np.random.default_rng(7).random(t.size) >= share
    kept[[0, -1]] = True
    row = found(said(tmp_path, t[kept], queued(t, 1e-3, 8)[kept]))
    assert set(row) == {"lost_messages"}
    assert row["lost_messages"].parameters["count"] == np.sum(~kept)


@pytest.mark.parametrize("seed", [1, 4])
def test_a_queue_where_a_message_is_lost_is_no_step_of_a_whole_interval(
    tmp_path: Path, seed: int
) -> None:
    """One message in a hundred waits for several intervals and holds up those behind it."""
    rng = np.random.default_rng(seed)
    t = even(400.0, 25.0)
    stuck = np.where(rng.random(t.size) < 0.01, rng.exponential(8e-3, t.size), 0.0)
    receive = np.maximum.accumulate(t + 0.003 + rng.gamma(2.0, 5e-4, t.size) + stuck)
    kept = rng.random(t.size) > 0.06
    kept[[0, -1]] = True
    row = found(said(tmp_path, t[kept], receive[kept]))
    assert set(row) == {"lost_messages"}
    assert row["lost_messages"].parameters["count"] == pytest.approx(np.sum(~kept), rel=0.01)


def test_messages_left_out_by_a_pattern_are_not_lost(tmp_path: Path) -> None:
    t = even(90.0, 60.0)
    kept = np.cumsum(np.tile([3, 3, 4], t.size))
    kept = kept[kept < t.size]
    assert not found(said(tmp_path, t[kept], queued(t[kept], 1e-3, 9)))


# ---- receipts that say nothing -------------------------------------------------------------


def test_receipts_copied_from_even_stamps_are_no_arrivals(tmp_path: Path) -> None:
    t = even(20.0, 60.0)
    row = said(tmp_path, t, t)
    assert not found(row)
    assert any("copy of its stamp" in words for words in row.cannot_show)
    uneven = t + np.random.default_rng(2).exponential(2e-3, t.size)
    assert set(found(said(tmp_path, uneven, uneven))) == {"stamped_on_arrival"}


def test_a_bus_with_few_kinds_of_delay_shows_no_drift(tmp_path: Path) -> None:
    """Six places of 0.25 ms in the order of a CAN bus."""
    t = even(400.0, 50.0)
    for seed in range(2):
        rng = np.random.default_rng(seed)
        delay = 0.001 + 2.5e-4 * rng.integers(0, 6, t.size) + rng.exponential(1e-5, t.size)
        assert not found(said(tmp_path, t, t + delay))


# ---- how a sensor measures ------------------------------------------------------------------


@pytest.mark.parametrize("apart", [0.0042, 0.00515, 0.0081])
def test_two_publishers_in_turn_are_no_packets(tmp_path: Path, apart: float) -> None:
    one = even(50.0, 60.0)
    t = np.sort(np.concatenate([one, one + apart]))
    assert not found(said(tmp_path, t, queued(t, 2e-4, 10)))


@pytest.mark.parametrize("later", [100.0, 25.0])
def test_another_rate_from_some_moment_on_is_no_step(tmp_path: Path, later: float) -> None:
    first = even(50.0, 30.0)
    t = np.concatenate([first, first[-1] + np.arange(1, int(30 * later)) / later])
    for seed in (11, 12):
        assert not found(said(tmp_path, t, queued(t, 2e-3, seed)))


# ---- several at once -----------------------------------------------------------------------


def test_a_lock_that_settles_while_no_message_comes(tmp_path: Path) -> None:
    t = even(200.0, 75.0)
    stamp = t - np.where(t > 20.0, 0.011 * np.exp(-(t - 20.0) / 4.7), 0.0)
    kept = (t < 24.2) | (t > 37.4)
    row = found(said(tmp_path, stamp[kept], queued(t, 4e-4, 13)[kept]))
    assert set(row) == {"relock", "gap"}
    assert row["relock"].parameters["settling_s"] == pytest.approx(4.7, rel=0.1)
    assert row["relock"].parameters["seconds"] == pytest.approx(-0.011, rel=0.1)


def test_a_slip_within_a_slip_is_two_stretches_of_whole_seconds(tmp_path: Path) -> None:
    t = even(50.0, 75.0)
    stamp = t - np.where((t > 40.0) & (t < 59.0), 2.0, 0.0) - np.where(t > 50.0, 1.0, 0.0)
    row = said(tmp_path, stamp, queued(t, 1e-3, 14))
    assert {f.fault for f in row.faults} == {"whole_second_slip"}
    assert [f.parameters["seconds"] for f in row.faults] == [-2.0, -3.0, -1.0]


# ---- stamps of a grid, of arrivals, of single slips --------------------------------------------


@pytest.mark.parametrize("rate", [99.935, 100.05])
def test_a_sensor_whose_interval_is_nearly_the_grain(tmp_path: Path, rate: float) -> None:
    """Cut off to 10 ms: every tenth of a minute one stamp is left out, or comes twice."""
    t = even(rate, 70.0)
    row = found(said(tmp_path, np.floor(t / 0.01) * 0.01, queued(t, 2e-4, 15)))
    assert set(row) == {"truncated_stamps"}
    assert row["truncated_stamps"].parameters["resolution_s"] == 0.01


@pytest.mark.parametrize("late", [True, False])
def test_stamps_that_become_those_of_arrivals(tmp_path: Path, late: bool) -> None:
    t = even(50.0, 70.0)
    came = queued(t, 1e-3, 16)
    receive = came + 2e-5 + np.random.default_rng(17).exponential(3e-5, t.size)
    host = (t > 31.0) if late else (t < 31.0)
    row = found(said(tmp_path, np.where(host, came, t), receive))
    assert set(row) == {"stamped_on_arrival"}
    begin, end = row["stamped_on_arrival"].from_s, row["stamped_on_arrival"].to_s
    assert (begin if late else end) == pytest.approx(31.0, abs=0.1)


@pytest.mark.parametrize(("rate", "size"), [(20.0, 1.0), (20.0, -1.0), (73.0, -2.0)])
def test_every_tenth_message_a_second_off(tmp_path: Path, rate: float, size: float) -> None:
    t = even(rate, 60.0)
    wrong = np.arange(t.size) % 10 == 3
    row = found(said(tmp_path, t + size * wrong, queued(t, 5e-4, 18), file_order=False))
    assert set(row) == {"whole_second_slip"}
    assert row["whole_second_slip"].parameters == {"seconds": size, "count": float(wrong.sum())}


def test_twenty_messages_with_a_slip_count_no_other_unit(tmp_path: Path) -> None:
    t = even(10.0, 2.0)
    stamp = t - np.where((t > 0.65) & (t < 1.25), 1.0, 0.0)
    assert "epoch_offset" not in found(said(tmp_path, stamp, queued(t, 1e-3, 19)))


def test_a_clock_that_is_set_again_and_again_is_one_fault(tmp_path: Path) -> None:
    t = even(30.0, 90.0)
    stamp = t * (1 + 80e-6) - 2.7e-4 * np.floor(t / 3.365)
    row = said(tmp_path, stamp, queued(t, 2e-5, 20))
    steps = [f for f in row.faults if f.fault == "step"]
    assert len(steps) == 1
    assert steps[0].parameters["seconds"] == pytest.approx(-2.7e-4, rel=0.05)
    assert steps[0].parameters["interval_s"] == pytest.approx(3.365, rel=0.02)
    assert steps[0].parameters["count"] == 26


# ---- receipts on a host's ticks ---------------------------------------------------------------


@pytest.mark.parametrize("seed", range(4))
def test_a_beat_with_a_hosts_tick_is_no_drift_though_some_messages_miss_one(
    tmp_path: Path, seed: int
) -> None:
    """50 Hz, 8.4 ppm slow against a scheduler of 5 ms; one message in sixteen misses a tick."""
    rng = np.random.default_rng(seed)
    t = 0.0171 + 0.02 * (1.0 - 8.4e-6) * np.arange(3750)
    missed = 0.005 * rng.choice([0, 1, 2], t.size, p=[0.94, 0.05, 0.01])
    came = t + 1e-3 + rng.gamma(2.0, 2e-5, t.size) + missed
    receive = np.ceil(came / 0.005) * 0.005 + rng.uniform(0.0, 1e-3, t.size)
    row = said(tmp_path, t, np.maximum.accumulate(receive))
    assert not found(row)


def test_a_drift_beside_rare_long_delays_stays_one(tmp_path: Path) -> None:
    """The same delays on no tick, of a clock that is 30 ppm fast."""
    rng = np.random.default_rng(9)
    t = even(50.0, 75.0)
    missed = rng.choice([0.0, 1.0], t.size, p=[0.94, 0.06]) * rng.uniform(3e-3, 12e-3, t.size)
    receive = np.maximum.accumulate(t + 4e-3 + rng.uniform(0.0, 1e-3, t.size) + missed)
    row = said(tmp_path, t * (1.0 + 30e-6), receive)
    assert set(found(row)) == {"drift"}
    assert found(row)["drift"].parameters["ppm"] == pytest.approx(30.0, abs=2.0)


@pytest.mark.parametrize("tick_s", [0.01, 0.02])
def test_no_drift_is_promised_that_a_beat_with_a_hosts_ticks_would_hide(tick_s: float) -> None:
    """A host that looks at its tick: what is slow and less than 1.2 ticks is never named."""
    rng = np.random.default_rng([101, round(1e3 * tick_s)])
    at = np.arange(0.0, 120.0, 1.0 / 60.3)
    came = at + 2e-4 + rng.gamma(2.0, 1e-4, at.size)
    found = of(at, tick_s * np.ceil(came / tick_s) + 1e-5 * rng.random(at.size))
    assert found.smallest.drift_ppm is not None
    assert found.smallest.drift_ppm >= 1.19e6 * tick_s / 120.0
