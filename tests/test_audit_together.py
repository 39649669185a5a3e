"""Faults that come together while messages change their order: each by its name, nothing else."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks import audit_together
from benchmarks.audit_corpus import Made
from syncline_design.auditing.result import StampFault, StreamAudit
from syncline_design.auditing.run import audit

BEGAN_NS = 1_755_000_000 * 10**9


def written(path: Path, stamp_ns: np.ndarray, receive_ns: np.ndarray) -> Path:
    rows = zip(stamp_ns.tolist(), receive_ns.tolist(), strict=True)
    path.write_text("stamp_ns,receive_ns\n" + "".join(f"{s},{r}\n" for s, r in rows), "utf-8")
    return path


def said(folder: Path, stamp: np.ndarray, receive: np.ndarray, name: str = "x") -> StreamAudit:
    """The audit of messages in the order of their receipts [s]."""
    order = np.argsort(receive, kind="stable")
    stamp_ns, receive_ns = (np.rint(x * 1e9).astype(np.int64)[order] for x in (stamp, receive))
    path = written(folder / f"{name}.csv", stamp_ns + BEGAN_NS, receive_ns + BEGAN_NS)
    return audit([path]).streams[0]


def found(row: StreamAudit) -> dict[str, StampFault]:
    return {fault.fault: fault for fault in row.faults if fault.counts}


def even(rate: float, length: float = 70.0) -> np.ndarray:
    return 0.0171 + np.arange(int(rate * length)) / rate


def overtaking(t: np.ndarray, reach: float, seed: int) -> np.ndarray:
    return t + 0.004 + reach * np.random.default_rng(seed).random(t.size)


@pytest.mark.parametrize("rate", [4.0, 25.0])
def test_a_sonar_whose_pings_overtake_one_another_is_sound(tmp_path: Path, rate: float) -> None:
    n = int(70 * rate)
    t = np.cumsum(1.0 + 0.4 * np.sin(np.arange(n) * 4 * np.pi / n)) / rate
    receive = overtaking(t, 3.0 / rate, 1)
    row = said(tmp_path, t, receive)
    assert not found(row)
    assert row.residual_s.bound == pytest.approx(np.ptp(receive - t), rel=1e-6)


@pytest.mark.parametrize("rate", [4.0, 50.0])
@pytest.mark.parametrize("back", [2.7, 9.4])
def test_wrong_stamps_among_messages_that_overtake_one_another(
    tmp_path: Path, rate: float, back: float
) -> None:
    t = even(rate)
    receive = overtaking(t, 2.5 / rate, 2)
    wrong = np.array([60, 131, 222])
    stamp = t.copy()
    stamp[wrong] -= back / rate
    row = said(tmp_path, stamp, receive)
    assert set(found(row)) == {"backward_jump"}
    assert found(row)["backward_jump"].parameters["count"] == wrong.size
    right = np.ones(t.size, bool)
    right[wrong] = False
    assert row.residual_s.bound == pytest.approx(np.ptp((receive - t)[right]), rel=1e-6)


@pytest.mark.parametrize("size", [-1.0, 2.0])
def test_a_slip_and_losses_of_messages_that_overtake_one_another(
    tmp_path: Path, size: float
) -> None:
    t = even(50.0)
    rng = np.random.default_rng(3)
    receive = t + 0.003 + rng.exponential(0.012, t.size)
    stamp = t + size * ((t > 30.0) & (t < 41.0))
    kept = rng.random(t.size) > 0.04
    kept[[0, -1]] = True
    row = said(tmp_path, stamp[kept], receive[kept])
    assert set(found(row)) == {"whole_second_slip", "lost_messages"}
    assert found(row)["lost_messages"].parameters["count"] == pytest.approx(np.sum(~kept), abs=1)
    assert row.residual_s.bound == pytest.approx(np.ptp((receive - t)[kept]), rel=1e-6)


@pytest.mark.parametrize("size", [0.37, -0.37])
def test_a_counter_that_begins_anew_while_the_recorders_clock_is_set(
    tmp_path: Path, size: float
) -> None:
    paths = []
    for k, rate in enumerate((25.0, 40.0)):
        t = even(rate)
        receive = overtaking(t, 2.0 / rate, 4 + k)
        stamp = (t + 3.0) % 4.294967296 if k == 0 else t  # 32 bits of nanoseconds
        order = np.argsort(receive)
        set_ = receive + size * (receive > 33.0)
        stamp_ns, receive_ns = (np.rint(x[order] * 1e9).astype(np.int64) for x in (stamp, set_))
        paths.append(
            written(tmp_path / f"s{k}.csv", stamp_ns + BEGAN_NS * k, receive_ns + BEGAN_NS)
        )
    rows = audit(paths).streams
    assert set(found(rows[0])) == {"counter_wrap", "recorder_clock"}
    assert set(found(rows[1])) == {"recorder_clock"}
    # by how much receipts were set is told by medians: 5 ms (1 sigma) of 60 such messages
    assert rows[0].residual_s.bound == pytest.approx(2.0 / 25.0, abs=0.016)


@pytest.mark.parametrize("size", [-1.3, -0.5, 1.3])
def test_a_recorder_that_is_set_keeps_its_name_where_messages_overtake_one_another(
    tmp_path: Path, size: float
) -> None:
    paths = []
    for k, rate in enumerate((125.0, 10.0)):
        t = even(rate)
        receive = overtaking(t, 2.0 / rate, 14 + k)
        stamp = t.copy()
        stamp[[600, 604]] -= 3.4 / rate  # two wrong ones make no jump of the stamps
        order = np.argsort(receive)
        set_ = receive + size * (receive > 40.0)
        kept = order[order % 11 != 5]  # a missing one now and then, left out by count
        paths.append(
            written(
                tmp_path / f"s{k}.csv",
                np.rint(stamp[kept] * 1e9).astype(np.int64) + BEGAN_NS,
                np.rint(set_[kept] * 1e9).astype(np.int64) + BEGAN_NS,
            )
        )
    for row in audit(paths).streams:
        assert set(found(row)) == {"recorder_clock", "backward_jump", "lost_messages"}
        seconds = found(row)["recorder_clock"].parameters["seconds"]
        assert abs(float(seconds)) == pytest.approx(abs(size), rel=0.05)


def test_unset_stamps_leave_no_holes_where_messages_overtake_one_another(tmp_path: Path) -> None:
    t = even(50.0)
    unset = np.arange(40, t.size, 97)
    receive = overtaking(t, 0.05, 6)
    order = np.argsort(receive)
    stamp_ns = np.rint(t * 1e9).astype(np.int64) + BEGAN_NS
    stamp_ns[unset] = 0
    receive_ns = np.rint(receive * 1e9).astype(np.int64) + BEGAN_NS
    row = audit([written(tmp_path / "x.csv", stamp_ns[order], receive_ns[order])]).streams[0]
    assert set(found(row)) == {"unset_stamps"}


@pytest.mark.parametrize("size", [-1.0, 1.0])
def test_a_message_that_repeats_its_stamp_where_a_slip_begins(tmp_path: Path, size: float) -> None:
    t = even(20.0)
    at = int(np.argmax(t > 25.0))
    stamp = t + size * ((np.arange(t.size) >= at) & (t < 40.0))
    stamp[at + 1] = stamp[at]
    receive = np.maximum.accumulate(t + np.random.default_rng(7).gamma(2.0, 1e-3, t.size))
    row = said(tmp_path, stamp, receive)
    assert set(found(row)) == {"whole_second_slip", "duplicates"}
    assert found(row)["duplicates"].parameters["count"] == 1.0


def test_a_slip_by_the_interval_repeats_a_stamp_by_itself(tmp_path: Path) -> None:
    t = even(1.0, 400.0)
    stamp = t - 1.0 * ((t > 150.0) & (t < 260.0))
    receive = np.maximum.accumulate(t + np.random.default_rng(8).gamma(2.0, 1e-3, t.size))
    assert "duplicates" not in found(said(tmp_path, stamp, receive))


def test_a_seeded_part_of_the_corpus_of_faults_together(tmp_path: Path) -> None:
    planted: list[tuple[set[str], set[str]]] = []
    sound: list[set[str]] = []
    bounds: list[float] = []
    for recording in audit_together.corpus(1, 1, 1):
        if sum(one.stamp_ns.size for one in recording.streams) > 9000:
            continue
        paths = [written(tmp_path / f"{one.name}.csv", one.stamp_ns, one.receive_ns)
                 for one in recording.streams]  # fmt: skip
        rows = {row.name: row for row in audit(paths).streams}
        for one in recording.streams:
            _add(one, rows[one.name], planted, sound, bounds)
    missed = [row for row in planted if not row[0] <= row[1]]
    beside = [row for row in planted if row[1] - row[0]]
    assert len(planted) >= 18
    assert len(missed) <= 1, missed
    assert len(beside) <= 1, beside
    assert not any(sound), sound
    assert np.mean(np.abs(np.asarray(bounds) - 1.0) < 0.1) > 0.95


def _add(
    one: Made, row: StreamAudit, planted: list[tuple[set[str], set[str]]], sound: list[set[str]],
    bounds: list[float],
) -> None:  # fmt: skip
    names = set(found(row))
    if one.planted:
        planted.append((set(one.planted), names))
    else:
        sound.append(names)
    assert one.bound_s is not None
    bounds.append((row.residual_s.bound or 0.0) / one.bound_s)


@pytest.mark.parametrize(("rates", "set_by"), [
    ((10.0, 4.0), 1.31), ((125.0, 200.0), 0.337), ((125.0, 4.0), -0.2), ((50.0, 10.0), -1.1),
])  # fmt: skip
@pytest.mark.parametrize("seed", [1, 2])
def test_a_clock_that_is_set_is_told_from_two_streams_one_of_which_slips(
    tmp_path: Path, rates: tuple[float, float], set_by: float, seed: int
) -> None:
    """The slip is of one stream, the jump of both receipts the recorder's; delays are left."""
    rng = np.random.default_rng(seed)
    paths, delays = [], []
    for name, rate in zip("ab", rates, strict=True):
        t = even(rate)
        delay = 0.002 + rng.gamma(2.0, 5e-4, t.size)
        came = np.maximum.accumulate(t + delay)
        stamp = t - ((t > 17.0) & (t < 24.0)) if name == "a" else t
        receive = came + set_by * (came > 46.6)
        stamp_ns, receive_ns = (np.rint(x * 1e9).astype(np.int64) for x in (stamp, receive))
        paths.append(written(tmp_path / f"{name}.csv", stamp_ns + BEGAN_NS, receive_ns + BEGAN_NS))
        delays.append(float(np.ptp(came - t)))
    a, b = sorted(audit(paths).streams, key=lambda row: row.name)
    assert set(found(a)) == {"recorder_clock", "whole_second_slip"}
    assert set(found(b)) == {"recorder_clock"}
    for row, delay_s in zip((a, b), delays, strict=True):
        seconds = float(found(row)["recorder_clock"].parameters["seconds"])
        assert abs(seconds) == pytest.approx(abs(set_by), abs=0.01)
        assert row.residual_s.bound == pytest.approx(delay_s, rel=0.1)


def test_stamps_that_go_back_to_places_left_empty_are_no_messages_overtaken(tmp_path: Path) -> None:
    """Before the first message, and where another wrong stamp left its own place: nobody else was
    measured when these five were."""
    t = even(10.0)
    wrong = np.array([4, 61, 159, 171, 361])
    stamp = t.copy()
    stamp[wrong] -= 1.201
    receive = np.maximum.accumulate(t + np.random.default_rng(9).gamma(2.0, 5e-4, t.size))
    row = said(tmp_path, stamp, receive)
    assert set(found(row)) == {"backward_jump"}
    assert found(row)["backward_jump"].parameters["count"] == wrong.size
    assert row.residual_s.bound == pytest.approx(np.ptp(receive - t), rel=0.1)


@pytest.mark.parametrize(("seed", "name"), [
    (12, "overtaking_even_lost_messages_counter_wrap_11"),
    (11, "noted_by_threads_even_lost_messages_counter_wrap_11"),
])  # fmt: skip
def test_a_clock_that_is_set_is_told_though_a_counter_begins_anew_near_by(
    tmp_path: Path, seed: int, name: str
) -> None:
    recordings = audit_together.corpus(seed, 2, 2)
    recording = next(one for one in recordings if one.name == name)
    paths = [written(tmp_path / f"{one.name}.csv", one.stamp_ns, one.receive_ns)
             for one in recording.streams]  # fmt: skip
    rows = {row.name: row for row in audit(paths).streams}
    for one in recording.streams:
        assert "recorder_clock" in one.planted
        assert set(found(rows[one.name])) == set(one.planted)
        assert one.bound_s is not None
        assert rows[one.name].residual_s.bound == pytest.approx(one.bound_s, rel=0.2)
