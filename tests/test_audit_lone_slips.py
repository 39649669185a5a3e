"""Single stamps that are whole seconds off, in streams whose truth is known."""

from __future__ import annotations

import numpy as np
import pytest

from syncline_design.auditing.stream import Examined, examined
from syncline_design.logs.readers.stream import Stamps, Stream

START = 1_780_000_000_000_000_000


def audited(true: np.ndarray, late: np.ndarray, off: np.ndarray) -> Examined:
    """A stream whose stamps are `off` from the truth [s], in order of receipt."""
    stamp = START + np.round((true + off) * 1e9).astype(np.int64)
    receive = START + np.round((true + late) * 1e9).astype(np.int64)
    order = np.argsort(receive, kind="stable")
    stamps = Stamps("header.stamp", "log time", stamp[order], receive[order])
    return examined(Stream("x", (), true.size, stamps))


def sensor(rate_hz: float, seed: int = 3) -> tuple[np.ndarray, np.ndarray]:
    """90 s of an even sensor, 10 ms of latency and gamma delays of 2 ms."""
    rng = np.random.default_rng(seed)
    true = np.arange(0.013, 90.0, 1.0 / rate_hz)
    return true, 0.01 + rng.gamma(2.0, 2e-3, true.size)


@pytest.mark.parametrize("off_s", [1.0, -1.0, 2.0])
@pytest.mark.parametrize("rate_hz", [5.0, 10.0, 50.0])
def test_one_message_a_second_off_is_a_slip_and_nothing_else(rate_hz: float, off_s: float) -> None:
    true, late = sensor(rate_hz)
    off = np.zeros(true.size)
    off[true.size // 3] = off_s
    one = audited(true, late, off)
    assert [f.fault for f in one.faults] == ["whole_second_slip"]
    fault = one.faults[0]
    assert fault.parameters == {"seconds": off_s, "count": 1.0}
    assert fault.from_s == pytest.approx(30.0, abs=0.3)
    assert one.offset_s == pytest.approx(-late.min(), abs=1e-6)  # the others' own
    assert one.residual.bound == pytest.approx(float(np.ptp(late)), rel=0.1)


@pytest.mark.parametrize(("rate_hz", "off_s", "share"), [
    (1.0, 1.0, 0.05), (5.0, -1.0, 0.15), (50.0, 1.0, 0.05), (50.0, -1.0, 0.05),
])  # fmt: skip
def test_slips_here_and_there_are_one_fault(rate_hz: float, off_s: float, share: float) -> None:
    true, late = sensor(rate_hz)
    chosen = np.random.default_rng(8).random(true.size) < share
    one = audited(true, late, np.where(chosen, off_s, 0.0))
    assert [f.fault for f in one.faults] == ["whole_second_slip"]
    assert one.faults[0].parameters["seconds"] == off_s
    assert one.faults[0].parameters["count"] == pytest.approx(chosen.sum(), rel=0.1)
    assert one.residual.bound == pytest.approx(float(np.ptp(late)), rel=0.2)


def test_messages_that_transport_held_up_by_a_second_are_none() -> None:
    """Sent again a second later, or kept while a host stood still: the stamps are right."""
    true, late = sensor(20.0)
    again = late.copy()
    again[[400, 900, 1300]] += 1.0
    free = np.where((true > 40.0) & (true < 41.2), 41.2, true) + late
    waits = np.maximum.accumulate(free) + 1e-6 * np.arange(true.size) - true  # come in order
    for held in (again, waits):
        assert audited(true, held, np.zeros(true.size)).faults == ()


def test_a_stale_message_of_a_slow_sensor_is_a_repeated_one() -> None:
    """The very stamp of the message before: a second behind by the sensor's interval alone."""
    true, late = sensor(1.0)
    off = np.zeros(true.size)
    off[30] = -1.0
    one = audited(true, late, off)
    assert [f.fault for f in one.faults] == ["duplicates"]


@pytest.mark.parametrize("off_s", [1.0, -1.0, 2.0])
@pytest.mark.parametrize("seed", range(4))
def test_messages_of_events_a_second_off_are_slips(off_s: float, seed: int) -> None:
    """Events 0.43 s apart in the mean, of which one that is off comes after a later stamp, and one
    among events that are farther apart than it is off."""
    rng = np.random.default_rng(seed)
    apart = rng.exponential(0.43, 170)
    apart[80:83] = 2.5
    apart[119:122] = 0.2
    true = 0.013 + np.cumsum(apart)
    off = np.zeros(true.size)
    off[[81, 120]] = off_s
    one = audited(
        true, np.maximum.accumulate(true + 2e-3 + rng.gamma(2.0, 1.5e-3, 170)) - true, off
    )
    assert [f.fault for f in one.faults] == ["whole_second_slip"]
    assert one.faults[0].parameters == {"seconds": off_s, "count": 2.0}
    assert one.residual.bound is not None
    assert one.residual.bound < 0.03


def test_events_that_transport_held_up_are_no_slips() -> None:
    """By 1.00 s, and those behind them as well."""
    rng = np.random.default_rng(5)
    true = 0.013 + np.cumsum(rng.exponential(0.1, 400))
    late = 2e-3 + rng.gamma(2.0, 1.5e-3, true.size)
    late[[100, 250]] += 1.0
    late = np.maximum.accumulate(true + late) - true
    assert audited(true, late, np.zeros(true.size)).faults == ()


@pytest.mark.parametrize("range_s", [None, 65.536])
def test_events_within_one_tick_of_their_clock_are_no_duplicates(range_s: float | None) -> None:
    """Ticks of 1 ms, in a counter of 16 bits or not: some of 1500 events share one by chance."""
    rng = np.random.default_rng(0)
    true = np.cumsum(rng.exponential(0.05, 1500))
    stamp = np.floor((true if range_s is None else np.mod(true + 3.3, range_s)) * 1e3) / 1e3
    assert 10 < int(np.sum(np.diff(stamp) == 0.0)) < 30
    base = START if range_s is None else 0
    whole = base + np.round(stamp * 1e9).astype(np.int64)
    came = np.maximum.accumulate(true + 2e-3 + rng.gamma(2.0, 1.5e-3, true.size))
    receive = START + np.round(came * 1e9).astype(np.int64)
    one = examined(Stream("x", (), true.size, Stamps("header.stamp", "log time", whole, receive)))
    assert "duplicates" not in {f.fault for f in one.faults}
