"""Clocks that jump, drift for a while or are slewed; hosts that are; sensors that only look so.

Every world is written down here: when a sensor measured, what its clock said, when the message
came.  What is expected is what was written down.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest

from syncline_design.auditing.result import StampFault, StreamAudit
from syncline_design.auditing.run import audit

BEGAN = 1_750_000_000
Clock = Callable[[np.ndarray], np.ndarray]


def right(t: np.ndarray) -> np.ndarray:
    return t


def even(rate: float, length: float, first: float = 0.0123) -> np.ndarray:
    return first + np.arange(int(rate * length)) / rate


def transported(t: np.ndarray, scale: float, seed: int) -> np.ndarray:
    """Receipts in order, after 4 ms and a delay with a tail."""
    rng = np.random.default_rng(seed)
    return np.maximum.accumulate(t + 0.004 + rng.gamma(2.0, scale, t.size))


def written(path: Path, stamp: np.ndarray, receive: np.ndarray) -> Path:
    rows = ["stamp_ns,receive_ns"]
    for s, r in zip(np.rint(stamp * 1e9).astype(int), np.rint(receive * 1e9).astype(int),
                    strict=True):  # fmt: skip
        rows.append(f"{int(s) + BEGAN * 10**9},{int(r) + BEGAN * 10**9}")
    path.write_text("\n".join(rows) + "\n", "utf-8")
    return path


def said(folder: Path, stamp: np.ndarray, receive: np.ndarray) -> StreamAudit:
    return audit([written(folder / "x.csv", stamp, receive)]).streams[0]


def counted(row: StreamAudit) -> list[StampFault]:
    return [fault for fault in row.faults if fault.counts]


def names(row: StreamAudit) -> list[str]:
    return [fault.fault for fault in counted(row)]


# ---- drift, where a sensor's round rate lies on a host's tick as well ---------------------------


@pytest.mark.parametrize("rate", [5.0, 50.0])
@pytest.mark.parametrize("spread", [0.0, 1e-4, 2e-3])
def test_a_drift_is_named_whatever_the_delays_look_like(
    tmp_path: Path, rate: float, spread: float
) -> None:
    t = even(rate, 100.0)
    delay = 0.003 + spread * np.random.default_rng(4).random(t.size)
    row = said(tmp_path, t * (1 - 250e-6), t + delay)
    assert names(row) == ["drift"]
    assert counted(row)[0].parameters["ppm"] == pytest.approx(-250.0, abs=2.0)
    assert row.residual_s.bound == pytest.approx(np.ptp(delay), abs=2e-5 + 0.1 * spread)


def test_a_beat_with_the_hosts_tick_is_no_drift(tmp_path: Path) -> None:
    """Taken at the next tick of 20 ms, which is ever sooner, until it is the one before."""
    t = even(10.0 * (1 - 150e-6), 90.0)
    receive = np.ceil((t + 0.01 * np.random.default_rng(8).random(t.size)) / 0.02) * 0.02 + 2e-4
    assert names(said(tmp_path, t, receive)) == []


# ---- jumps ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("rate", "theta", "size", "lasts"),
    [(5, 5e-4, 0.018, 3.0), (20, 5e-4, 0.0188, 6.0), (20, 2e-3, 0.05, 3.0),
     (29.97, 1e-3, -0.038, 1.6), (50, 1e-3, -0.041, 9.0), (100, 5e-4, -0.0146, 3.1),
     (100, 3e-3, 0.165, 2.0)],
)  # fmt: skip
def test_a_jump_that_goes_back_is_one_step(
    tmp_path: Path, rate: float, theta: float, size: float, lasts: float
) -> None:
    """Also by exactly an interval (50 ms at 20 Hz), which repeats one stamp and leaves one out."""
    t = even(rate, 90.0)
    inside = (t > 31.0) & (t < 31.0 + lasts)
    receive = transported(t, theta, 3)
    row = said(tmp_path, t + size * inside, receive)
    assert names(row) == ["step"]
    fault = counted(row)[0]
    assert fault.parameters["seconds"] == pytest.approx(size, abs=0.3 * theta)
    began = receive[np.flatnonzero(inside)[0]] - receive[0]
    ended = receive[np.flatnonzero(inside)[-1] + 1] - receive[0]
    assert fault.from_s == pytest.approx(began, abs=1.1 / rate)
    assert fault.to_s == pytest.approx(ended, abs=1.1 / rate)
    assert row.residual_s.bound == pytest.approx(np.ptp(receive - t), rel=0.02)


def test_equal_jumps_are_steps_and_no_drift(tmp_path: Path) -> None:
    t = even(40.0, 75.0)
    moved = 0.01 * ((t > 15).astype(float) + (t > 40) + (t > 60))
    row = said(tmp_path, t + moved, transported(t, 1e-3, 5))
    assert names(row) == ["step"] * 3
    assert [f.parameters["seconds"] for f in counted(row)] == pytest.approx([0.01] * 3, abs=1e-6)
    assert [f.from_s for f in counted(row)] == pytest.approx([15, 40, 60], abs=0.06)


def test_a_clock_that_runs_fast_and_is_set_back_again_and_again(tmp_path: Path) -> None:
    t = even(50.0, 118.0)
    row = said(tmp_path, t + 500e-6 * (t % 20.0), transported(t, 1e-3, 6))
    assert names(row) == ["drift"] + ["step"] * 5
    drift, *steps = counted(row)
    assert drift.parameters["ppm"] == pytest.approx(500.0, abs=5.0)
    assert [f.parameters["seconds"] for f in steps] == pytest.approx([-0.01] * 5, abs=2e-5)


def test_a_lock_that_settles_beside_a_drift(tmp_path: Path) -> None:
    t = even(50.0, 60.0)
    settling = np.where(t > 25.0, 0.03 * np.exp(-(t - 25.0) / 5.0), 0.0)
    row = said(tmp_path, t * (1 + 200e-6) + settling, transported(t, 1e-3, 7))
    assert sorted(names(row)) == ["drift", "relock"]
    found = {f.fault: f.parameters for f in counted(row)}
    assert found["drift"]["ppm"] == pytest.approx(200.0, abs=10.0)
    assert found["relock"]["seconds"] == pytest.approx(0.03, rel=0.05)
    assert found["relock"]["settling_s"] == pytest.approx(5.0, rel=0.1)


def test_messages_sent_once_more_are_no_step(tmp_path: Path) -> None:
    t = even(50.0, 60.0)
    stamp = t.copy()
    stamp[1500:1540] = stamp[1460:1500]
    assert "step" not in names(said(tmp_path, stamp, transported(t, 1e-3, 8)))


# ---- drift of a part of the log -----------------------------------------------------------------


@pytest.mark.parametrize(("begin", "ppm"), [(20.0, 150.0), (60.0, 500.0), (90.0, -1000.0)])
def test_a_drift_that_begins_inside(tmp_path: Path, begin: float, ppm: float) -> None:
    t = even(50.0, 120.0)
    row = said(tmp_path, t + ppm * 1e-6 * np.maximum(t - begin, 0.0), transported(t, 1e-3, 9))
    assert names(row) == ["drift"]
    fault = counted(row)[0]
    assert fault.parameters["ppm"] == pytest.approx(ppm, rel=0.05)
    assert fault.from_s == pytest.approx(begin, abs=2.0)
    assert fault.to_s == pytest.approx(120.0, abs=1.0)


def test_a_drift_that_turns(tmp_path: Path) -> None:
    t = even(50.0, 120.0)
    row = said(tmp_path, t + 1e-4 * (60.0 - np.abs(t - 60.0)), transported(t, 1e-3, 10))
    assert names(row) == ["drift", "drift"]
    assert [f.parameters["ppm"] for f in counted(row)] == pytest.approx([100, -100], rel=0.06)


# ---- the recorder's clock -----------------------------------------------------------------------

SENSORS = {"imu": (100.0, 7e-4), "gnss": (5.0, 6e-3), "lidar": (10.0, 4e-3)}


def recorded(
    folder: Path, host: Clock, clocks: Mapping[str, Clock], narrow: bool = False
) -> dict[str, StreamAudit]:
    """All sensors of one host for 100 s; narrow: delays of 0.2 ms without a tail."""
    paths = []
    for seed, (name, (rate, scale)) in enumerate(SENSORS.items()):
        t = even(rate, 100.0, 0.01 + 0.007 * seed)
        rng = np.random.default_rng(seed)
        got = t + 0.003 + 2e-4 * rng.random(t.size) if narrow else transported(t, scale, seed)
        paths.append(written(folder / f"{name}.csv", clocks.get(name, right)(t), host(got)))
    return {row.name: row for row in audit(paths).streams}


def set_forward(t: np.ndarray) -> np.ndarray:
    return t + 0.3 * (t > 40.0)


def set_back(t: np.ndarray) -> np.ndarray:
    return t - 0.2 * (t > 60.0)


def slewed(t: np.ndarray) -> np.ndarray:
    return t + np.clip((t - 30.0) * 500e-6, 0.0, 0.02)


def late_slip(t: np.ndarray) -> np.ndarray:
    return t - 1.0 * ((t > 60.0) & (t < 75.0))


def fast(t: np.ndarray) -> np.ndarray:
    return t * (1 + 200e-6)


def set_back_late(t: np.ndarray) -> np.ndarray:
    return t - 0.1 * (t > 97.5)


def set_forward_and_back(t: np.ndarray) -> np.ndarray:
    return t + 0.08 * ((t > 40.0) & (t < 55.0))


def set_back_and_forward(t: np.ndarray) -> np.ndarray:
    return t - 0.05 * ((t > 40.0) & (t < 55.0))


@pytest.mark.parametrize(
    ("host", "sizes"),
    [(set_back_late, [0.1]), (set_forward_and_back, [-0.08, 0.08]),
     (set_back_and_forward, [-0.05, 0.05])],
)  # fmt: skip
def test_all_streams_have_one_course_of_the_recorders_clock(
    tmp_path: Path, host: Clock, sizes: list[float]
) -> None:
    """Receipts of the quick ones go back, those of the slow seem to come too early: one figure."""
    rows = recorded(tmp_path, host, {})
    assert {name for row in rows.values() for name in names(row)} == {"recorder_clock"}
    told = {
        tuple(sorted(float(f.parameters["seconds"]) for f in counted(r))) for r in rows.values()
    }
    assert len(told) == 1
    assert told.pop() == pytest.approx(sizes, rel=0.02)
    for name, row in rows.items():
        rate, scale = SENSORS[name]
        t = even(rate, 100.0)
        true = transported(t, scale, list(SENSORS).index(name)) - t
        assert row.residual_s.bound == pytest.approx(np.ptp(true), rel=0.1)


def test_a_stream_that_ended_before_it_has_no_step_of_the_recorder(tmp_path: Path) -> None:
    t = even(5.0, 30.0)
    early = written(tmp_path / "early.csv", t, transported(t, 2e-3, 9))
    paths = [early]
    for seed, (name, (rate, scale)) in enumerate(SENSORS.items()):
        t = even(rate, 100.0)
        got = set_back(transported(t, scale, seed))
        paths.append(written(tmp_path / f"{name}.csv", t, got))
    rows = {row.name: row for row in audit(paths).streams}
    assert names(rows.pop("early")) == []
    assert all(names(row) == ["recorder_clock"] for row in rows.values())


@pytest.mark.parametrize("narrow", [False, True])
def test_a_host_that_is_slewed(tmp_path: Path, narrow: bool) -> None:
    rows = recorded(tmp_path, slewed, {}, narrow)
    assert {name: names(row) for name, row in rows.items()} == {
        name: ["recorder_clock"] for name in SENSORS
    }
    fault = counted(rows["gnss"])[0]
    assert fault.parameters["kind"] == "slew"
    assert fault.parameters["seconds"] == pytest.approx(-0.02, rel=0.03)
    assert fault.parameters["ppm"] == pytest.approx(-500.0, rel=0.05)
    assert (fault.from_s, fault.to_s) == pytest.approx((30.0, 70.0), abs=1.5)
    assert rows["imu"].residual_s.bound is not None
    assert rows["imu"].residual_s.bound < 0.012


@pytest.mark.parametrize(("host", "size"), [(set_forward, -0.3), (set_back, 0.2)])
@pytest.mark.parametrize("narrow", [False, True])
def test_a_host_whose_clock_is_set(tmp_path: Path, host: Clock, size: float, narrow: bool) -> None:
    for name, row in recorded(tmp_path, host, {}, narrow).items():
        assert (name, names(row)) == (name, ["recorder_clock"])
        assert counted(row)[0].parameters["seconds"] == pytest.approx(size, rel=0.05)
        assert row.residual_s.bound is not None
        assert row.residual_s.bound < 0.09


@pytest.mark.parametrize(
    ("clock", "name", "value"),
    [(fast, "drift", ("ppm", 200.0)), (late_slip, "whole_second_slip", ("seconds", -1.0))],
)
def test_a_sensor_keeps_its_own_fault_beside_the_hosts(
    tmp_path: Path, clock: Clock, name: str, value: tuple[str, float]
) -> None:
    rows = recorded(tmp_path, set_forward, {"lidar": clock})
    assert names(rows["imu"]) == names(rows["gnss"]) == ["recorder_clock"]
    assert sorted(names(rows["lidar"])) == sorted(["recorder_clock", name])
    own = next(f for f in rows["lidar"].faults if f.fault == name)
    assert own.parameters[value[0]] == pytest.approx(value[1], rel=0.05)


def test_sensors_that_jump_together_do_not_accuse_the_host(tmp_path: Path) -> None:
    def jumps(t: np.ndarray) -> np.ndarray:
        return t + 0.03 * (t > 50.0)

    rows = recorded(tmp_path, right, dict.fromkeys(SENSORS, jumps))
    assert {name: names(row) for name, row in rows.items()} == {name: ["step"] for name in SENSORS}


def test_one_drift_of_all_is_the_recorders_though_one_is_too_slow_to_show_it(
    tmp_path: Path,
) -> None:
    rows = recorded(tmp_path, lambda t: t * (1 + 80e-6), {})
    assert not any("drift" in names(row) for row in rows.values())
    assert counted(rows["imu"])[0].parameters["ppm"] == pytest.approx(-80.0, abs=4.0)


# ---- sound rhythms on a grid --------------------------------------------------------------------


def two_publishers() -> np.ndarray:
    return np.sort(np.concatenate([even(10.0, 80.0, 0.02), even(10.0, 80.0, 0.055)]))


def of_another_rate(first: float) -> np.ndarray:
    return np.concatenate([even(10.0, 40.0, first), 40.0 + even(5.0, 40.0, first)])


SOUND = {
    "rate halves, off the grid": of_another_rate(0.0371),
    "rate halves, on it": of_another_rate(0.0),
    "bracketed exposures": np.cumsum(np.where(np.arange(1500) % 2, 0.01, 0.09)),
    "two publishers": two_publishers(),
    "keyframes": 0.1 * np.cumsum(np.random.default_rng(2).integers(1, 6, 300)),
    "pings of the depth": np.cumsum(
        0.05 * np.ceil(1.3 + 0.8 * np.sin(np.arange(900) / 60.0))
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", SOUND)
def test_messages_on_a_grid_are_no_cut_off_stamps(tmp_path: Path, name: str) -> None:
    t = SOUND[name]
    assert names(said(tmp_path, t, transported(t, 2e-3, 11))) == []


@pytest.mark.parametrize("every", [97, 10])
def test_messages_lost_in_a_strict_count_are_lost(tmp_path: Path, every: int) -> None:
    t = even(50.0, 60.0)
    kept = np.arange(t.size) % every != every // 2
    row = said(tmp_path, (t * (1 + 300e-6))[kept], transported(t, 1e-3, 12)[kept])
    assert sorted(names(row)) == ["drift", "lost_messages"]
    lost = next(f for f in row.faults if f.fault == "lost_messages")
    assert lost.parameters["count"] == np.sum(~kept)


def test_a_serial_chip_a_little_quicker_than_its_sensor(tmp_path: Path) -> None:
    """60 Hz into packets of 16 ms: one tick of 25 stays empty."""
    t = even(60.0, 60.0, 0.0011)
    rng = np.random.default_rng(13)
    stamp = np.ceil((t + 4e-4) / 0.016) * 0.016 + 2e-5 * rng.random(t.size)
    row = said(tmp_path, stamp, stamp + 2e-4 + rng.exponential(2e-4, t.size))
    assert names(row) == ["packetised"]
    assert counted(row)[0].parameters["interval_s"] == 0.016


def test_stamps_out_of_order_by_transport_are_no_packets(tmp_path: Path) -> None:
    t = even(50.0, 60.0)
    got = t + 0.004 + np.random.default_rng(14).exponential(0.03, t.size)
    order = np.argsort(got, kind="stable")
    row = said(tmp_path, (t + 37.0)[order], got[order])
    assert names(row) == ["epoch_offset"]
    falls = int(np.sum(np.diff(t[order]) < 0))
    assert any(f"why {falls} messages came after later ones" in words for words in row.cannot_show)


# ---- receipts out of order, and a jump --------------------------------------------------------


@pytest.mark.parametrize(
    ("size", "begin", "end", "name"),
    [(-1.0, 20.0, 30.0, "whole_second_slip"), (1.0, 20.0, 30.0, "whole_second_slip"),
     (0.2, 30.0, 99.0, "step"), (3600.0, 30.0, 99.0, "epoch_offset")],
)  # fmt: skip
def test_receipts_out_of_order_do_not_set_the_recorders_clock(
    tmp_path: Path, size: float, begin: float, end: float, name: str
) -> None:
    t = even(50.0, 60.0)
    got = t + 0.004 + np.random.default_rng(15).exponential(0.03, t.size)
    row = said(tmp_path, t + size * ((t > begin) & (t < end)), got)
    assert names(row) == [name]
    assert counted(row)[0].parameters["seconds"] == pytest.approx(size, abs=0.01)
    assert row.residual_s.bound is not None
    assert row.residual_s.bound < 0.4


# ---- latched messages and counters ------------------------------------------------------------


@pytest.mark.parametrize("age", [0.5, 1.5, 300.0, 3600.0, 20_000.0])
def test_one_latched_message_may_be_old(tmp_path: Path, age: float) -> None:
    assert names(said(tmp_path, np.asarray([-age]), np.asarray([0.5]))) == []


@pytest.mark.parametrize("wrap", [2.0**24 * 1e-6, 32.768])
def test_a_counter_that_begins_anew_where_messages_are_lost(tmp_path: Path, wrap: float) -> None:
    t = even(50.0, 60.0)
    count = (t + 5.0) % wrap
    kept = np.random.default_rng(16).random(t.size) > 0.01
    kept[1 + np.flatnonzero(np.diff(count) < 0)] = False  # the first of each turn
    row = said(tmp_path, count[kept] - BEGAN, transported(t, 1e-3, 16)[kept])
    assert sorted(names(row)) == ["counter_wrap", "lost_messages"]
    turns = next(f for f in row.faults if f.fault == "counter_wrap")
    assert turns.parameters["wrap_s"] == pytest.approx(wrap)
    assert turns.parameters["count"] == np.sum(np.diff(count) < 0)


def test_a_counter_that_begins_anew_in_a_gap(tmp_path: Path) -> None:
    t = even(50.0, 60.0)
    kept = (t < 20.0) | (t > 45.0)
    count = (t + 5.0) % (2.0**24 * 1e-6)
    row = said(tmp_path, count[kept] - BEGAN, transported(t, 1e-3, 17)[kept])
    assert sorted(names(row)) == ["counter_wrap", "gap"]


@pytest.mark.parametrize("seed", range(6))
def test_a_clock_that_runs_away_and_is_locked_again_is_one_relock(
    tmp_path: Path, seed: int
) -> None:
    """1000 ppm for 30 s, then back with 5 s: what its course is off by is no second fault."""
    t = even(50.0, 120.0)
    away = np.where((t > 30.0) & (t <= 60.0), (t - 30.0) * 1e-3, 0.0)
    away += np.where(t > 60.0, 0.03 * np.exp(-(t - 60.0) / 5.0), 0.0)
    row = said(tmp_path, t + away, transported(t, 1e-3, seed))
    assert names(row) == ["relock"]
    (fault,) = counted(row)
    assert fault.parameters["seconds"] == pytest.approx(0.03, rel=0.03)
    assert fault.parameters["settling_s"] == pytest.approx(5.0, rel=0.05)
