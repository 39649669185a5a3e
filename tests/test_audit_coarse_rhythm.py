"""Losses and gaps beside packets and grids, each message's fate known to the maker."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from syncline_design.auditing.coarse_rhythm import counted
from syncline_design.auditing.result import StampFault
from syncline_design.auditing.stream import Examined
from syncline_design.machine.random_numbers import generator
from tests.stamped_streams import of

Array = NDArray[np.float64]
LENGTH_S, TICK_S, GRID_S = 75.0, 0.016, 0.1
GAP_S = 5.3


def measured(rate: float, gap: bool, share: float, seed: int) -> tuple[Array, int]:
    """When the messages that came were measured [s], and how many single ones did not."""
    rng = generator((seed, int(rate), int(gap), int(1e3 * share)))
    count = int(LENGTH_S * rate)
    when = (rng.uniform() + np.arange(count)) / rate * (1.0 + rng.normal(0.0, 2e-5))
    lost = rng.uniform(size=count) < share
    lost[:5] = lost[-5:] = False
    hole = (when > 30.0) & (when < 30.0 + GAP_S) if gap else np.zeros(count, bool)
    return when[~lost & ~hole], int(np.sum(lost & ~hole))


def in_packets(when: Array, seed: int) -> tuple[Array, Array]:
    """Stamps [s] of a serial chip that hands over what it has every 16 ms, and their receipts."""
    rng = generator((seed, when.size))
    tick = np.ceil(when / TICK_S)
    first = np.concatenate([[True], np.diff(tick) > 0.0])
    wait = rng.uniform(0.0, 2e-5, int(first.sum()))[np.cumsum(first) - 1]
    stamp = tick * TICK_S + wait
    return stamp, np.maximum.accumulate(stamp + rng.gamma(2.0, 1e-4, when.size) + 1e-3)


def on_a_grid(when: Array, seed: int) -> tuple[Array, Array]:
    """Stamps cut off to 100 ms, and receipts."""
    rng = generator((seed, when.size))
    late = rng.gamma(2.0, 1e-3, when.size) + 5e-3
    return np.floor(when / GRID_S) * GRID_S, np.maximum.accumulate(when + late)


def named(one: Examined) -> dict[str, StampFault]:
    return {fault.fault: fault for fault in one.faults}


MAKERS = {"packetised": in_packets, "truncated_stamps": on_a_grid}
# no interval a simple part of the tick: where it is, waits that creep look like another interval
CASES = [
    ("packetised", 4.7), ("packetised", 23.0), ("packetised", 47.0), ("packetised", 119.0),
    ("packetised", 187.0), ("truncated_stamps", 23.0), ("truncated_stamps", 101.0),
]  # fmt: skip


@pytest.mark.parametrize("gap", [False, True])
@pytest.mark.parametrize(("fault", "rate"), CASES)
def test_a_gap_beside_coarse_stamps_is_named_with_its_length(
    fault: str, rate: float, gap: bool
) -> None:
    when, _ = measured(rate, gap, 0.0, 1)
    stamp, receive = MAKERS[fault](when, 1)
    found = named(one := of(stamp, receive))
    assert set(found) == ({fault, "gap"} if gap else {fault})
    if gap:
        coarse = TICK_S if fault == "packetised" else GRID_S
        hole = float(np.max(np.diff(when)))
        assert abs(float(found["gap"].parameters["interval_s"]) - hole) <= coarse
    assert one.residual.bound == pytest.approx(float(np.ptp(receive - when)), rel=0.1)


@pytest.mark.parametrize("gap", [False, True])
@pytest.mark.parametrize(("fault", "rate"), CASES)
def test_lost_messages_beside_coarse_stamps_are_counted(fault: str, rate: float, gap: bool) -> None:
    """All of them where an interval is longer than a tick; about as many where waits creep."""
    when, lost = measured(rate, gap, 0.01, 2)
    found = named(of(*MAKERS[fault](when, 2)))
    assert set(found) == {fault, "lost_messages"} | ({"gap"} if gap else set())
    count = float(found["lost_messages"].parameters["count"])
    creeping = fault == "packetised" and rate > 50.0
    assert abs(count - lost) <= max(1.0, (0.15 if creeping else 0.05) * lost)


@pytest.mark.parametrize("rate", [62.0, 62.4, 61.0, 124.0])
def test_a_beat_between_interval_and_tick_is_no_loss(rate: float) -> None:
    """62 Hz in ticks of 16 ms leave one out every 125, and no message is missing."""
    when, _ = measured(rate, False, 0.0, 3)
    assert "lost_messages" not in named(of(*in_packets(when, 3)))


@pytest.mark.parametrize("rate", [4.0, 62.0, 130.0, 377.0])
def test_every_message_is_numbered_as_it_was_measured(rate: float) -> None:
    """Against the numbers that the maker gave, waits up to a tick whatever the interval."""
    rng = generator((4, int(rate)))
    number = np.arange(int(LENGTH_S * rate), dtype=np.float64)
    number = number[(number < 20.0 * rate) | (number > 23.0 * rate)]
    count = counted(number / rate + rng.uniform(0.0, TICK_S, number.size), TICK_S)
    assert count is not None
    assert count.period_s == pytest.approx(1.0 / rate, rel=1e-4)
    assert count.number[-1] - count.number[0] == number[-1] - number[0]


def test_what_has_no_rhythm_is_not_counted() -> None:
    rng = generator((5,))
    assert counted(np.sort(rng.uniform(0.0, LENGTH_S, 1500)), TICK_S) is None


@pytest.mark.parametrize("kind", MAKERS)
@pytest.mark.parametrize("rate", [9.7, 53.0, 137.0])
@pytest.mark.parametrize("ppm", [80.0, -80.0, 0.0])
def test_drift_of_less_than_a_tick_is_named_beside_ticks(
    kind: str, rate: float, ppm: float
) -> None:
    """80 ppm are 6 ms over the log; the grid here is of 10 ms, packets come every 16."""
    when, _ = measured(rate, gap=False, share=0.0, seed=31)
    rng = generator((31, int(rate)))
    if kind == "packetised":
        stamp, receive = in_packets(when, 31)
        stamp = stamp * (1.0 + 1e-6 * ppm)
    else:
        stamp = np.floor(when * (1.0 + 1e-6 * ppm) / 0.01) * 0.01
        receive = np.maximum.accumulate(when + rng.gamma(2.0, 1e-3, when.size) + 5e-3)
    one = of(stamp, receive)
    assert set(named(one)) == ({kind, "drift"} if ppm else {kind})
    if ppm:
        assert named(one)["drift"].parameters["ppm"] == pytest.approx(ppm, abs=3.0)
    assert one.residual.bound == pytest.approx(np.ptp(receive - when), rel=0.05)


@pytest.mark.parametrize("kind", MAKERS)
def test_latency_that_breathes_beside_ticks_is_no_drift(kind: str) -> None:
    when, _ = measured(53.0, gap=False, share=0.0, seed=32)
    stamp, receive = in_packets(when, 32)
    if kind != "packetised":
        stamp = np.floor(when / 0.01) * 0.01
        receive = when + generator(32).gamma(2.0, 1e-3, when.size) + 5e-3
    breathing = 3e-3 * np.sin(2.0 * np.pi * when / 50.0)
    one = of(stamp, np.maximum.accumulate(receive + breathing))
    assert set(named(one)) == {kind}


@pytest.mark.parametrize("kind", MAKERS)
@pytest.mark.parametrize("rate", [9.7, 53.0])
def test_messages_that_come_twice_where_no_two_share_a_tick(kind: str, rate: float) -> None:
    """Sensors slower than the tick (16 ms, 10 ms): two messages with one stamp are one message."""
    when, _ = measured(rate, gap=False, share=0.0, seed=33)
    stamp, receive = in_packets(when, 33)
    if kind != "packetised":
        stamp = np.floor(when / 0.01) * 0.01
        receive = when + generator(33).gamma(2.0, 1e-3, when.size) + 5e-3
    again = np.sort(generator(34).choice(np.arange(50, when.size - 50), 15, replace=False))
    one = of(
        np.insert(stamp, again + 1, stamp[again]),
        np.maximum.accumulate(np.insert(receive, again + 1, receive[again] + 1e-4)),
    )
    assert set(named(one)) == {kind, "duplicates"}
    assert named(one)["duplicates"].parameters["count"] == 15.0
    assert one.residual.bound == pytest.approx(np.ptp(receive - when), rel=0.1)


@pytest.mark.parametrize("apart_s", [2e-9, 2e-6])
def test_packets_of_pairs_whose_median_interval_is_of_neither_kind(apart_s: float) -> None:
    """125 Hz in packets of 16 ms: as many intervals within pairs as between them, and the median
    lies half-way."""
    rng = generator(35)
    heads = 0.016 * np.arange(4687.0) + rng.uniform(0.0, 2e-4, 4687)
    stamp = np.stack([heads, heads + apart_s], axis=1).ravel()[:-1]
    receive = np.maximum.accumulate(stamp + 1e-3 + rng.gamma(2.0, 5e-5, stamp.size))
    assert set(named(of(stamp, receive))) == {"packetised"}


@pytest.mark.parametrize(("rate", "grid", "ppm"), [(130.0, 0.01, 300.0), (37.0, 0.1, -200.0)])
def test_equal_stamps_of_a_grid_do_not_go_back_beside_a_drift(
    rate: float, grid: float, ppm: float
) -> None:
    rng = generator((29, int(rate)))
    when = (rng.uniform() + np.arange(int(90.0 * rate))) / rate
    stamp = np.floor(when * (1.0 + 1e-6 * ppm) / grid) * grid
    assert np.all(np.diff(stamp) >= 0.0)
    late = 2e-3 + rng.gamma(2.0, 1.5e-3, when.size)
    faults = named(of(stamp, np.maximum.accumulate(when + late)))
    assert set(faults) == {"truncated_stamps", "drift"}
    assert faults["drift"].parameters["ppm"] == pytest.approx(ppm, abs=5.0)


@pytest.mark.parametrize("seed", [2, 3, 7])
@pytest.mark.parametrize(("rate", "grid_s"), [
    (11.0, 0.1), (12.5, 0.1), (13.0, 0.1), (15.0, 0.1), (17.0, 0.1), (1.1, 1.0), (1.25, 1.0),
])  # fmt: skip
def test_messages_that_share_a_coarse_grain_now_and_then_are_cut_off(
    rate: float, grid_s: float, seed: int
) -> None:
    """Faster than the grid by less than twice: some share a grain, and come as far apart as all."""
    rng = generator((40, seed, int(100 * rate)))
    when = 0.7 * grid_s * rng.uniform() + np.arange(int(120.0 * rate)) / rate * (1.0 + 1e-5)
    receive = np.maximum.accumulate(when + 5e-3 + rng.gamma(2.0, 0.02 * grid_s, when.size))
    one = of(np.floor(when / grid_s) * grid_s, receive)
    assert set(named(one)) == {"truncated_stamps"}
    assert named(one)["truncated_stamps"].parameters["resolution_s"] == grid_s
    assert one.residual.bound == pytest.approx(float(np.ptp(receive - when)), rel=0.1)
    assert one.residual.as_recorded is not None
    assert one.residual.as_recorded > 0.9 * np.ptp(receive - np.floor(when / grid_s) * grid_s)


@pytest.mark.parametrize("every", [5, 8, 13])
@pytest.mark.parametrize("grid_s", [0.1, 1.0])
def test_messages_sent_twice_in_a_beat_are_not_cut_off(grid_s: float, every: int) -> None:
    """A sensor at exact epochs of which every so many are sent again at once: its receipts tell."""
    rng = generator((41, every))
    epochs = np.arange(int(120.0 / grid_s)) * grid_s
    stamp = np.sort(np.concatenate([epochs, epochs[::every]]))
    twice = np.concatenate([[0.0], np.diff(stamp)]) == 0.0
    late = 5e-3 + rng.gamma(2.0, 0.02 * grid_s, epochs.size)
    receive = late[np.cumsum(~twice) - 1] + stamp + 2e-3 * twice
    assert set(named(of(stamp, receive))) == {"duplicates"}
