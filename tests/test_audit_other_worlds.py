"""Stamps of other units, counters, packets and transports, each with what was planted in it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from syncline_design.auditing.counters import RANGES, unwrapped
from syncline_design.auditing.result import StampFault
from syncline_design.auditing.run import audit
from syncline_design.auditing.series import in_words, series_of
from syncline_design.auditing.stream import Examined, examined
from syncline_design.logs.readers.decimal_stamps import power_of
from syncline_design.logs.readers.stream import Stamps, Stream

DAY = 86_400
THURSDAY = 1_760_000_000 // DAY * DAY  # 2025-10-09


def ns(values: np.ndarray) -> np.ndarray:
    return np.round(np.asarray(values) * 1e9).astype(np.int64)


def audited(stamp: np.ndarray, receive: np.ndarray) -> Examined:
    """Nanoseconds."""
    stamps = Stamps("header.stamp", "log time", stamp, receive)
    return examined(Stream("x", (), stamp.size, stamps))


def world(
    rate: float = 50.0, length: float = 60.0, seed: int = 1, latency: float = 0.004
) -> tuple[np.ndarray, np.ndarray]:
    """(measured, received) [s]: an even sensor, gamma delays, receipts in order."""
    rng = np.random.default_rng(seed)
    true = np.arange(int(rate * length)) / rate + 0.0137
    return true, np.maximum.accumulate(true + latency + rng.gamma(1.5, 0.002, true.size))


def only(one: Examined, name: str) -> StampFault:
    assert [fault.fault for fault in one.faults] == [name]
    return one.faults[0]


# ---- a constant lag ---------------------------------------------------------------------------


@pytest.mark.parametrize("behind", [1.0, 2.0, 3.0, 14.0])
def test_whole_seconds_late_from_the_first_message_to_the_last(behind: float) -> None:
    true, receive = world()
    fault = only(audited(ns(true - behind), ns(receive)), "whole_second_slip")
    assert fault.parameters == {"seconds": -behind, "count": float(true.size)}
    assert (fault.from_s, fault.to_s) == (None, None)


@pytest.mark.parametrize("behind", [0.7, 1.5, 5.5, 23.0, 33.0])
def test_a_lag_that_no_transport_has(behind: float) -> None:
    true, receive = world()
    fault = only(
        audited(ns(true - behind) + 17 * 10**17, ns(receive) + 17 * 10**17), "epoch_offset"
    )
    assert fault.parameters["kind"] == "unknown"
    assert fault.parameters["seconds"] == pytest.approx(-behind - 0.004, abs=1e-3)


def test_half_a_second_may_be_latency_and_is_said() -> None:
    true, receive = world(latency=0.5)
    one = audited(ns(true), ns(receive))
    assert one.faults == ()
    assert one.constant_s == pytest.approx(0.5, abs=1e-3)


# ---- units ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("column", "power"), [("s", 3), ("s", 6), ("s", 9), ("ms", 3), ("us", 3), ("ns", 3)]
)
def test_calendar_time_in_a_smaller_unit_than_its_column_says(
    tmp_path: Path, column: str, power: int
) -> None:
    true, receive = world(length=20.0)
    digits = {"s": 9, "ms": 6, "us": 3, "ns": 0}[column]
    epoch = 1_760_000_000 * 10**9
    rows = [f"stamp_{column},receive_s"]
    for a, b in zip(ns(true).tolist(), ns(receive).tolist(), strict=True):
        whole = (epoch + a) * 10**power  # in the column's unit, times 10^digits
        cell = (
            str(whole) if not digits else f"{whole // 10**digits}.{whole % 10**digits:0{digits}d}"
        )
        rows.append(f"{cell},{(epoch + b) // 10**9}.{(epoch + b) % 10**9:09d}")
    path = tmp_path / "x.csv"
    path.write_text("\n".join(rows), "utf-8")
    row = audit([path]).streams[0]
    assert [f.fault for f in row.faults] == ["epoch_offset"]
    assert row.faults[0].parameters == {"kind": "unit", "factor": 10.0**power}
    assert row.residual_s.bound == pytest.approx(np.ptp(receive - true), abs=2e-9)


def test_one_absurd_figure_among_times_is_unset_and_changes_no_unit() -> None:
    import polars as pl

    assert power_of(pl.Series(["1e300", "1760000000.5", "1760000001.5"]), "s") == 0
    assert power_of(pl.Series(["0", "0", "1760000000500", "1760000001500"]), "s") == 1


@pytest.mark.parametrize("factor", [1.024, 1e6 / 2**20, 10.0, 0.01])
def test_ticks_that_are_no_power_of_a_thousand(factor: float) -> None:
    true, receive = world()
    fault = only(audited(ns(true * factor), ns(receive) + 17 * 10**17), "epoch_offset")
    assert fault.parameters["kind"] == "unit"
    assert fault.parameters["factor"] == pytest.approx(factor, rel=1e-9)


@pytest.mark.parametrize("weekday", range(7))
def test_seconds_of_the_day_on_each_weekday(weekday: int) -> None:
    true, receive = world(length=20.0)
    start = THURSDAY + weekday * DAY + 7200
    one = audited(ns(true + start % DAY), ns(receive) + start * 10**9)
    assert only(one, "epoch_offset").parameters["kind"] == "day_seconds"


def test_seconds_of_the_day_of_a_time_zone() -> None:
    true, receive = world(length=20.0)
    start = THURSDAY + 40_000
    fault = only(
        audited(ns(true + (start + 19_800) % DAY), ns(receive) + start * 10**9), "epoch_offset"
    )
    assert fault.parameters["kind"] == "day_seconds"
    assert "+5.5 h" in fault.evidence


# ---- counters ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "wrap",
    [
        0.065536,
        0.1234,
        0.65536,
        1.0,
        1.6777216,
        3.2768,
        6.5536,
        10.0,
        17.0,
        25.0,
        29.3,
        32.768,
        60.0,
    ],
)
def test_a_counter_of_any_range(wrap: float) -> None:
    rate = 100.0 if wrap > 0.1 else 10.0
    true, receive = world(rate, 90.0)
    told = true + 0.4 * wrap
    one = audited(ns(told) % round(wrap * 1e9), ns(receive) + 17 * 10**17)
    fault = only(one, "counter_wrap")
    assert fault.parameters["wrap_s"] == pytest.approx(wrap, rel=1e-6)
    assert fault.parameters["count"] == told[-1] // wrap - told[0] // wrap
    assert one.residual.bound == pytest.approx(np.ptp(receive - true), rel=0.02)


def test_a_counter_of_an_irregular_sensor() -> None:
    rng = np.random.default_rng(3)
    true = np.cumsum(rng.exponential(0.02, 4000))
    receive = np.maximum.accumulate(true + rng.gamma(2.0, 0.001, true.size))
    one = audited(ns(true) % (2**24 * 100), ns(receive))
    fault = only(one, "counter_wrap")
    assert fault.parameters["wrap_s"] == 1.6777216
    assert one.residual.bound == pytest.approx(np.ptp(receive - true), rel=0.02)


def test_two_wraps_within_ten_minutes_beside_single_losses_and_a_long_gap() -> None:
    true, receive = world(10.0, 600.0)
    left = np.ones(true.size, bool)
    left[[400, 2000, 2001]] = False
    left[4500:4600] = False
    stamp = ns(true) % (256 * 10**9)
    one = audited(stamp[left], ns(receive)[left])
    assert {f.fault for f in one.faults} == {"counter_wrap", "gap", "lost_messages"}


def test_a_gap_longer_than_the_counters_range() -> None:
    true, receive = world(100.0, 60.0)
    left = (true < 20.0) | (true > 27.5)
    one = audited((ns(true) % (2 * 10**9))[left], ns(receive)[left])
    assert {f.fault for f in one.faults} == {"counter_wrap", "gap"}
    gap = next(f for f in one.faults if f.fault == "gap")
    assert gap.parameters["interval_s"] == pytest.approx(7.51, abs=0.011)


def test_every_range_is_told_from_its_neighbours() -> None:
    """Of two falls, whatever the range: the counter is made continuous to the nanosecond."""
    for one in RANGES:
        if one.size_ns > 1e15:
            continue
        true = np.arange(500) * (one.size_ns / 200.3)
        whole = np.round(true).astype(np.int64)
        series = series_of(np.round(true % one.size_ns).astype(np.int64), whole + 1_000_000)
        found = unwrapped(series)
        assert [f.parameters["wrap_s"] for f in found.faults] == [one.size_ns / 1e9]
        assert np.abs(found.series.stamp - whole).max() <= 2


# ---- transport that is alive ------------------------------------------------------------------


@pytest.mark.parametrize(
    ("size", "period", "rate"),
    [(0.03, 40, 10), (0.03, 60, 20), (0.01, 50, 50), (0.02, 80, 100), (0.05, 15, 25)],
)
def test_latency_that_breathes_is_no_fault(size: float, period: float, rate: float) -> None:
    true, receive = world(rate, 100.0, latency=0.05)
    rng = np.random.default_rng(7)
    receive = np.maximum.accumulate(receive + size * np.sin(2 * np.pi * true / period))
    one = audited(ns(true + rng.normal(0.0, 2e-5, true.size)), ns(receive))
    assert one.faults == ()


def test_a_clock_that_breathes_as_much_is_one() -> None:
    """The same course, but of the stamps: they leave the rhythm that they keep above."""
    true, receive = world(20.0, 100.0)
    one = audited(ns(true + 0.03 * np.sin(2 * np.pi * true / 60.0)), ns(receive))
    assert {f.fault for f in one.faults} & {"drift", "relock"}


def test_a_drift_of_some_per_mille_is_a_clock_and_a_queue_that_fills_is_not() -> None:
    true, receive = world(50.0, 90.0)
    fault = only(audited(ns(true * 1.003), ns(receive)), "drift")
    assert fault.parameters["ppm"] == pytest.approx(3000.0, rel=0.01)
    filling = np.maximum.accumulate(receive + 0.1 * ((true / 25.0) % 1.0))
    assert audited(ns(true), ns(filling)).faults == ()


@pytest.mark.parametrize("back", [2e-4, 7e-4, 5e-3])
def test_a_receipt_out_of_order_sets_no_clock(back: float) -> None:
    true, receive = world(60.0, 90.0)
    receive[2001] = receive[2000] - back
    one = audited(ns(true), ns(receive))
    assert one.faults == ()
    assert one.residual.p95 == pytest.approx(np.percentile(receive - true - 0.004, 95.0), rel=0.03)


def test_many_receipts_out_of_order_leave_drift_to_be_found() -> None:
    true, receive = world(100.0, 60.0)
    rng = np.random.default_rng(5)
    receive = receive + rng.uniform(0.0, 0.011, receive.size)
    assert np.sum(np.diff(receive) < 0) > 200
    fault = only(audited(ns(true * (1.0 + 4e-4)), ns(receive)), "drift")
    assert fault.parameters["ppm"] == pytest.approx(400.0, rel=0.03)


def test_messages_written_out_of_order_with_both_their_times() -> None:
    true, receive = world(100.0, 40.0)
    order = np.arange(true.size)
    order[[700, 701, 2500, 2501]] = [701, 700, 2501, 2500]
    receive = receive + 1e-9 * np.arange(true.size)
    assert audited(ns(true)[order], ns(receive)[order]).faults == ()


def test_a_clock_that_was_set_back_for_good_is_still_seen() -> None:
    true, receive = world(60.0, 60.0)
    one = audited(ns(true), ns(np.where(true > 25.0, receive - 0.25, receive)))
    fault = only(one, "recorder_clock")
    assert fault.parameters["seconds"] == pytest.approx(0.25, rel=0.02)


# ---- packets ----------------------------------------------------------------------------------


@pytest.mark.parametrize(("rate", "tick"), [(125, 0.04), (100, 0.05), (100, 0.02), (200, 0.016)])
@pytest.mark.parametrize("together", [True, False])
def test_packets_with_a_whole_number_of_messages(rate: float, tick: float, together: bool) -> None:
    if not together and tick in (0.05, 0.02):
        pytest.skip("a grid of 20 or 50 ms and even receipts are stamps cut off to it as well")
    true, receive = world(rate, 60.0)
    stamp = np.ceil(np.round(true / tick, 9)) * tick
    rng = np.random.default_rng(2)
    if together:
        receive = np.maximum.accumulate(stamp + rng.gamma(1.5, 5e-4, true.size))
    else:
        receive = receive + tick
    one = audited(ns(stamp), ns(receive))
    fault = only(one, "packetised")
    assert fault.parameters["interval_s"] == tick
    assert {c.fault for c in fault.consequences} == {"duplicates"}
    if together:  # the oldest of a packet waited longest
        assert one.residual.bound is not None
        assert one.residual.bound > tick - 1.0 / rate


@pytest.mark.parametrize("seconds", [1.0, -1.0, 2.0])
def test_packets_beside_a_slip_keep_their_interval(seconds: float) -> None:
    true, _ = world(100.0, 80.0)
    packet = np.ceil(true / 0.016) * 0.016
    receive = np.maximum.accumulate(packet + np.random.default_rng(4).gamma(1.5, 5e-4, packet.size))
    stamp = packet.copy()
    stamp[4000:4600] += seconds
    found = {f.fault: f for f in audited(ns(stamp), ns(receive)).faults}
    assert set(found) == {"packetised", "whole_second_slip"}
    assert found["packetised"].parameters["interval_s"] == 0.016
    assert found["whole_second_slip"].parameters["seconds"] == seconds


# ---- epochs that are exact, slips that are short ------------------------------------------------


def test_exact_epochs_of_which_some_are_unset_are_not_cut_off() -> None:
    stamp = np.arange(500) * 10**8 + 1_760_000_000 * 10**9
    receive = stamp + 10**7
    stamp[::7] = 0
    one = audited(stamp, receive)
    assert only(one, "unset_stamps").parameters["count"] == 72.0


@pytest.mark.parametrize("messages", [3, 4, 5, 6])
def test_a_slip_of_a_few_messages(messages: int) -> None:
    true, receive = world(5.0, 100.0)
    stamp = true.copy()
    stamp[100 : 100 + messages] -= 1.0
    fault = only(audited(ns(stamp), ns(receive)), "whole_second_slip")
    assert fault.parameters == {"seconds": -1.0, "count": float(messages)}


@pytest.mark.parametrize(
    ("seconds", "words"),
    [(37.0, "37 s"), (1.76e9 + 0.0137, "1760000000.014 s"), (0.0042, "4.2 ms"), (1.2e-5, "12 us"),
     (1.0042, "1.0042 s"), (0.0, "0 ms"), (36_000.5, "36000.5 s")],
)  # fmt: skip
def test_times_in_words_have_no_exponent(seconds: float, words: str) -> None:
    assert in_words(seconds) == words
