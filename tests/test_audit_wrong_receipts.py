"""Receipts that are wrong by themselves: they are named, and hide nothing that comes after them.

Every world says itself when a sensor measured, when the message came, and which receipts were
spoilt by how much afterwards.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from syncline_design.auditing.result import StampFault, StreamAudit
from syncline_design.auditing.run import audit

BEGAN = 1_790_000_000 * 10**9
Places = list[int]


def ns(times: np.ndarray) -> np.ndarray:
    return np.asarray(np.rint(times * 1e9), np.int64) + BEGAN


def said(folder: Path, stamp: np.ndarray, receive: np.ndarray) -> StreamAudit:
    """The audit of messages in the order of the file."""
    rows = [f"{s},{r}" for s, r in zip(ns(stamp).tolist(), ns(receive).tolist(), strict=True)]
    path = folder / "x.csv"
    path.write_text("\n".join(["stamp_ns,receive_ns", *rows, ""]), "utf-8")
    return audit([path]).streams[0]


def found(row: StreamAudit) -> dict[str, StampFault]:
    return {fault.fault: fault for fault in row.faults if fault.counts}


def sensor(seed: int, rate: float, length: float) -> tuple[np.ndarray, np.ndarray]:
    """When it measured, and when its messages came, one after another [s]."""
    rng = np.random.default_rng(seed)
    t = rng.uniform(0.0, 1.0) + np.arange(int(rate * length)) / rate
    return t, np.maximum.accumulate(t + 0.001 + rng.gamma(2.0, 0.001, t.size))


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("rate", [10.0, 50.0, 200.0])
@pytest.mark.parametrize("off", [32.0, 500.0, -32.0, -0.8])
def test_one_wrong_receipt_is_named_and_left_out_of_the_bound(
    tmp_path: Path, seed: int, rate: float, off: float
) -> None:
    t, receive = sensor(seed, rate, 80.0)
    wrong = int(t.size * 0.48)
    spoilt = receive + np.where(np.arange(t.size) == wrong, off, 0.0)
    row = said(tmp_path, t, spoilt)
    assert set(found(row)) == {"wrong_receipts"}
    fault = found(row)["wrong_receipts"]
    assert fault.parameters["count"] == 1.0
    assert fault.parameters["seconds"] == pytest.approx(off, abs=float(np.ptp(receive - t)))
    assert fault.from_s == pytest.approx(receive[wrong] - receive[0], abs=1.5 / rate)
    assert row.residual_s.bound == pytest.approx(np.ptp(receive - t), rel=0.02)
    assert row.residual_s.as_recorded == pytest.approx(np.ptp(receive - t), rel=0.02)


@pytest.mark.parametrize(
    ("places", "offs"),
    [
        pytest.param([0], [90.0], id="the first"),
        pytest.param([3999], [-90.0], id="the last"),
        pytest.param([500, 1700, 3100], [32.0, -7.0, 1e6], id="several"),
        pytest.param(list(range(1800, 1830)), [40.0] * 30, id="thirty in a row"),
        pytest.param(
            [*range(1000, 1004), 2500], [9.0, 70.0, -5.0, 3.0, 2.0], id="of several sizes"
        ),
    ],
)
def test_wrong_receipts_wherever_they_stand_are_counted(
    tmp_path: Path, places: Places, offs: list[float]
) -> None:
    t, receive = sensor(4, 50.0, 80.0)
    spoilt = receive.copy()
    spoilt[places] += offs
    row = said(tmp_path, t, spoilt)
    assert set(found(row)) == {"wrong_receipts"}
    assert found(row)["wrong_receipts"].parameters["count"] == len(places)
    assert row.residual_s.bound == pytest.approx(np.ptp(receive - t), rel=0.02)
    assert row.duration_s == pytest.approx(np.ptp(receive), abs=0.1)


@pytest.mark.parametrize("off", [32.0, 68.0])
def test_a_slip_and_a_hole_after_a_wrong_receipt_are_named(tmp_path: Path, off: float) -> None:
    t, receive = sensor(5, 50.0, 80.0)
    there = ~((t - t[0] > 60.0) & (t - t[0] < 63.0))
    slipped = t + np.where((t - t[0] > 45.0) & (t - t[0] < 52.0), 1.0, 0.0)
    spoilt = receive + np.where(np.arange(t.size) == 1915, off, 0.0)
    row = said(tmp_path, slipped[there], spoilt[there])
    assert set(found(row)) == {"wrong_receipts", "whole_second_slip", "gap"}
    slip = found(row)["whole_second_slip"]
    assert slip.parameters["seconds"] == 1.0
    assert slip.from_s is not None
    assert slip.to_s is not None
    assert (slip.from_s, slip.to_s) == pytest.approx((45.0, 52.0), abs=0.05)


def test_a_recorder_whose_clock_is_set_back_for_good_has_no_wrong_receipts(tmp_path: Path) -> None:
    t, receive = sensor(6, 50.0, 80.0)
    row = said(tmp_path, t, receive - np.where(t > 40.0, 5.0, 0.0))
    assert set(found(row)) == {"recorder_clock"}


def test_messages_written_late_with_both_their_times_have_right_receipts(tmp_path: Path) -> None:
    """Order in the file is not order of receipt: nothing is wrong with either time."""
    t, receive = sensor(7, 20.0, 80.0)
    order = np.arange(t.size, dtype=float)
    order[[300, 800, 1200]] += 30.5
    written = np.argsort(order)
    row = said(tmp_path, t[written], receive[written])
    assert not found(row)


def test_zeros_and_wrong_stamps_among_messages_in_another_order_are_no_wrong_receipts(
    tmp_path: Path,
) -> None:
    """Of 4 Hz, noted by threads up to 2 s later than messages that came after them."""
    t, receive = sensor(8, 4.0, 80.0)
    rng = np.random.default_rng(8)
    order = np.argsort(
        np.arange(t.size) + rng.uniform(0.0, 8.0, t.size) * (rng.random(t.size) < 0.2)
    )
    stamp = t.copy()
    stamp[rng.choice(t.size, 30, replace=False)] = -BEGAN / 1e9
    row = said(tmp_path, stamp[order], receive[order])
    assert "wrong_receipts" not in found(row)
    assert "unset_stamps" in found(row)


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("rate", [10.0, 50.0, 200.0])
@pytest.mark.parametrize(("off", "many"), [(5.0, 1), (-5.0, 1), (-0.8, 1), (60.0, 5), (2.4, 3)])
def test_wrong_receipts_are_named_in_a_file_that_is_sorted_by_them(
    tmp_path: Path, off: float, many: int, rate: float, seed: int
) -> None:
    t, receive = sensor(seed, rate, 80.0)
    first = int(t.size * 0.48)
    spoilt = receive.copy()
    spoilt[first : first + many] += off
    order = np.argsort(spoilt, kind="stable")
    row = said(tmp_path, t[order], spoilt[order])
    assert set(found(row)) == {"wrong_receipts"}
    fault = found(row)["wrong_receipts"]
    assert fault.parameters["count"] == many
    assert fault.parameters["seconds"] == pytest.approx(off, abs=float(np.ptp(receive - t)))
    assert row.residual_s.bound == pytest.approx(np.ptp(receive - t), rel=0.02)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_wrong_stamp_beside_a_lost_message_is_no_wrong_receipt(tmp_path: Path, seed: int) -> None:
    """Five seconds and a half interval back: no hole is as long as it needs."""
    t, receive = sensor(seed, 50.0, 80.0)
    stamp = t.copy()
    stamp[2100] -= 5.01
    there = np.arange(t.size) != 1850
    row = said(tmp_path, stamp[there], receive[there])
    assert "wrong_receipts" not in found(row)
