"""Faults that others hid, and sound sensors in turn: stamps and receipts made here."""

from __future__ import annotations

import numpy as np
import pytest

from syncline_design.auditing.stream import Examined, examined
from syncline_design.logs.readers.stream import Stamps, Stream

START = 1_779_000_000 * 10**9 + 123_456_789


def _examined(stamp_s: np.ndarray, receive_s: np.ndarray) -> Examined:
    stamp, receive = (START + np.round(t * 1e9).astype(np.int64) for t in (stamp_s, receive_s))
    stamps = Stamps("header.stamp", "log time", stamp, receive)
    return examined(Stream("x", (), stamp.size, stamps))


def _tight(seed: int, when: np.ndarray) -> np.ndarray:
    """Receipts 5 ms after the measurement, scattered by tens of microseconds."""
    late = 5e-3 + np.random.default_rng(seed).gamma(3.0, 2e-5, when.size)
    return np.maximum.accumulate(when + late)


@pytest.mark.parametrize(
    ("constant", "kind"), [(37.0, "tai"), (18.0, "gps"), (7200.0, "time_zone")]
)
@pytest.mark.parametrize("shape", ["step", "drift"])
def test_an_epoch_keeps_its_name_beside_a_shift_forward(
    constant: float, kind: str, shape: str
) -> None:
    when = np.arange(3750) / 50.0
    shift = np.where(when > 30.0, 0.16, 0.0) if shape == "step" else when * 1.8e-3
    found = _examined(when + constant + shift, _tight(1, when)).faults
    assert {f.fault for f in found} == {"epoch_offset", shape}
    epoch = next(f for f in found if f.fault == "epoch_offset")
    assert epoch.parameters == {"seconds": constant, "kind": kind}


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("turns", [(0.05, 0.075), (0.04, 0.06), (0.05, 0.05, 0.075)])
def test_a_sensor_that_measures_in_turn_is_not_a_timer(turns: tuple[float, ...], seed: int) -> None:
    rng = np.random.default_rng(seed)
    when = np.cumsum(np.tile(turns, 400))
    late = 3e-3 + rng.gamma(2.0, 1e-3, when.size)
    one = _examined(when, np.maximum.accumulate(when + late))
    assert one.faults == ()
    assert one.residual.bound == pytest.approx(np.ptp(late), rel=0.1)


def test_slow_ticks_of_a_serial_chip_are_still_packets() -> None:
    """25 Hz on a timer of 16 ms: intervals of 32 and 48 ms by turns."""
    when = np.arange(2500) / 25.0
    ticks = np.ceil((when - 0.003) / 0.016) * 0.016 + 0.003
    found = _examined(ticks, _tight(2, ticks)).faults
    assert [f.fault for f in found] == ["packetised"]
    assert found[0].parameters["interval_s"] == pytest.approx(0.016)


@pytest.mark.parametrize("seed", [129, 138, 148, 158])
def test_few_stamps_that_come_twice_are_no_timer(seed: int) -> None:
    """Six of 1 500 at random: at these seeds their distances happen to be nearly even, as those of
    ticks left out are (9 of seeds 0 to 199)."""
    rng = np.random.default_rng(seed)
    when = np.arange(1500) / 20.0
    stamp = when.copy()
    twice = np.sort(rng.choice(np.arange(5, 1495), 6, replace=False))
    stamp[twice] = stamp[twice - 1]
    receive = np.maximum.accumulate(when + 5e-3 + rng.gamma(3.0, 2e-5, 1500))
    found = _examined(stamp, receive).faults
    assert [f.fault for f in found] == ["duplicates"]
    assert found[0].parameters["count"] == 6


def test_two_messages_a_grain_are_cut_off_and_no_packets() -> None:
    """200 Hz cut to 10 ms: receipts stay evenly 5 ms apart."""
    when = np.arange(15_000) / 200.0 + 0.0031
    stamp = START + np.round(when * 1e9).astype(np.int64)
    cut = stamp // 10_000_000 * 10_000_000
    stamps = Stamps("s", "log time", cut, START + np.round(_tight(4, when) * 1e9).astype(np.int64))
    found = examined(Stream("x", (), cut.size, stamps)).faults
    assert [f.fault for f in found] == ["truncated_stamps"]
    assert found[0].parameters["resolution_s"] == 0.01
