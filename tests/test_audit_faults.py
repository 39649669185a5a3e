"""Planted faults of the audit, each with what it was planted as: sizes, places, consequences."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks import audit_corpus, audit_corpus_other
from benchmarks.audit_corpus import MadeRecording
from syncline_design.auditing.envelope import above_floor, lower_hull, lower_line
from syncline_design.auditing.result import StampFault
from syncline_design.auditing.stream import Examined, examined
from syncline_design.auditing.together import held_together
from syncline_design.logs.readers.stream import PointTimes, Stamps, Stream

START = 1_700_000_000_000_000_000
SECOND = 10**9


def whole(values: np.ndarray) -> np.ndarray:
    return np.round(values * 1e9).astype(np.int64)


class Bench:
    """A regular sensor of 100 Hz for 60 s, gamma delays of 0.4 ms."""

    def __init__(self, seed: int = 0, rate: float = 100.0, length: float = 60.0) -> None:
        rng = np.random.default_rng(seed)
        self.true = np.arange(int(rate * length)) / rate
        self.late = rng.gamma(2.0, 4e-4, self.true.size)
        self.stamp = self.true.copy()

    def audited(self, points: PointTimes | None = None) -> Examined:
        receive = np.maximum.accumulate(self.true + self.late)
        return audited(START + whole(self.stamp), START + whole(receive), points=points)


def audited(
    stamp: np.ndarray, receive: np.ndarray | None, name: str = "x",
    points: PointTimes | None = None,
) -> Examined:  # fmt: skip
    stamps = Stamps("header.stamp", "log time" if receive is not None else None, stamp, receive)
    return examined(Stream(name, (), stamp.size, stamps, points=points))


def only(one: Examined, name: str) -> StampFault:
    assert [fault.fault for fault in one.faults] == [name]
    return one.faults[0]


# ---- the envelope ---------------------------------------------------------------------------


def test_the_hull_is_the_one_that_no_point_lies_below() -> None:
    """By the definition: two points are an edge where no point lies below their line."""
    rng = np.random.default_rng(4)
    x, y = np.sort(rng.uniform(0, 10, 40)), rng.gamma(2.0, 1.0, 40)
    edges = set()
    for i in range(40):
        for j in range(i + 1, 40):
            line = y[i] + (y[j] - y[i]) / (x[j] - x[i]) * (x - x[i])
            if np.all(y >= line - 1e-12):
                edges |= {i, j}
    assert sorted(edges) == lower_hull(x, y).tolist()


def test_the_line_below_has_the_least_sum_of_distances() -> None:
    """Zhang, Liu and Xia's linear programme, solved as one."""
    from scipy.optimize import linprog

    rng = np.random.default_rng(5)
    x = np.linspace(0, 60, 300)
    y = 0.002 + 40e-6 * x + rng.gamma(2.0, 1e-3, x.size)
    best = linprog([-x.size, -x.sum()], A_ub=np.stack([np.ones(x.size), x], 1), b_ub=y,
                   bounds=[(None, None)] * 2)  # fmt: skip
    assert lower_line(x, y) == pytest.approx(tuple(best.x), rel=1e-6)
    assert above_floor(x, y, sloping=True).min() == pytest.approx(0.0, abs=1e-12)


# ---- one fault at a time --------------------------------------------------------------------


def test_a_sound_stream_is_left_alone_and_its_residual_is_the_largest_delay() -> None:
    bench = Bench()
    one = bench.audited()
    assert one.faults == ()
    waits = np.maximum.accumulate(bench.true + bench.late) - bench.true
    assert one.residual.bound == pytest.approx(np.ptp(waits), abs=2e-9)
    assert one.offset_s == pytest.approx(-waits.min(), abs=2e-9)


@pytest.mark.parametrize(
    ("seconds", "kind"),
    [(37.0, "tai"), (-37.0, "tai"), (18.0, "gps"), (19.0, "tai_gps"), (-19.0, "tai_gps"),
     (7200.0, "time_zone"), (-12_600.0, "time_zone"), (-315_964_800.0 + 18.0, "gps_epoch"),
     (-619_315_200.0, "week_rollover"), (-1.69e9, "boot")],
)  # fmt: skip
def test_an_epoch_by_its_name(seconds: float, kind: str) -> None:
    bench = Bench(length=20.0)
    bench.stamp += seconds
    fault = only(bench.audited(), "epoch_offset")
    assert fault.parameters["kind"] == kind
    assert fault.parameters["seconds"] == pytest.approx(seconds, abs=0.01)
    assert (fault.from_s, fault.to_s) == (None, None)


def test_seconds_of_the_week_are_told_from_a_boot_clock() -> None:
    bench = Bench(length=20.0)
    gps = START // SECOND - 315_964_800 + 18
    bench.stamp -= START // SECOND - gps % 604_800
    assert only(bench.audited(), "epoch_offset").parameters["kind"] == "week_seconds"


@pytest.mark.parametrize("factor", [1e-3, 1e-6, 1e-9])
def test_a_unit_that_was_mistaken(factor: float) -> None:
    bench = Bench(length=20.0)
    receive = START + whole(np.maximum.accumulate(bench.true + bench.late))
    stamp = (START + whole(bench.stamp)) // round(1.0 / factor)
    fault = only(audited(stamp, receive), "epoch_offset")
    assert fault.parameters["factor"] == pytest.approx(factor)


def test_a_drift_to_a_part_in_a_hundred() -> None:
    bench = Bench()
    bench.stamp += 80e-6 * bench.true
    fault = only(bench.audited(), "drift")
    assert fault.parameters["ppm"] == pytest.approx(80.0, rel=0.01)


def test_a_step_at_its_message() -> None:
    bench = Bench()
    bench.stamp[2345:] -= 0.002
    one = bench.audited()
    fault = only(one, "step")
    assert fault.parameters["seconds"] == pytest.approx(-0.002, rel=0.02)
    assert fault.from_s == pytest.approx(23.45, abs=0.005)
    waits = np.maximum.accumulate(bench.true + bench.late) - bench.true
    assert one.residual.bound == pytest.approx(np.ptp(waits), rel=0.02)


def test_a_clock_that_settles_after_it_lost_its_reference() -> None:
    bench = Bench()
    gone = np.where(bench.true >= 20.0, np.exp(-np.maximum(bench.true - 20.0, 0.0) / 4.0), 0.0)
    bench.stamp += 0.03 * gone
    fault = only(bench.audited(), "relock")
    assert fault.parameters["seconds"] == pytest.approx(0.03, rel=0.02)
    assert fault.parameters["settling_s"] == pytest.approx(4.0, rel=0.03)
    assert fault.from_s == pytest.approx(20.0, abs=0.02)


def test_a_counter_of_32_bits_and_its_consequences() -> None:
    bench = Bench()
    receive = START + whole(np.maximum.accumulate(bench.true + bench.late))
    counter = (whole(bench.true) + (2**32 * 1000 - 30 * SECOND)) % (2**32 * 1000)
    fault = only(audited(counter, receive), "counter_wrap")
    assert fault.parameters["wrap_s"] == 4294.967296
    assert fault.from_s == pytest.approx(30.0, abs=0.02)
    assert {after.fault for after in fault.consequences} == {"backward_jump", "epoch_offset"}


@pytest.mark.parametrize("rate", [25.0, 50.0, 62.0, 100.0, 250.0])
def test_packets_of_16_ms(rate: float) -> None:
    bench = Bench(rate=rate)
    bench.stamp = np.ceil(bench.true / 0.016) * 0.016
    bench.late = bench.stamp - bench.true + 0.1 * bench.late
    fault = only(bench.audited(), "packetised")
    assert fault.parameters["interval_s"] == 0.016


@pytest.mark.parametrize(("rate", "grain"), [(130.0, 0.001), (97.0, 0.01), (30.0, 0.01)])
def test_truncated_stamps_are_told_from_exact_epochs(rate: float, grain: float) -> None:
    bench = Bench(rate=rate)
    bench.stamp = np.floor(bench.true / grain + 1e-9) * grain
    assert only(bench.audited(), "truncated_stamps").parameters["resolution_s"] == grain
    assert Bench(rate=10.0).audited().faults == ()


def test_arrival_is_told_from_a_sensor_that_stamps_itself() -> None:
    bench = Bench()
    late = np.random.default_rng(3).gamma(2.0, 5e-4, bench.true.size)
    bench.stamp = np.maximum.accumulate(bench.true + late) + 1e-9 * np.arange(bench.true.size)
    bench.late = bench.stamp - bench.true + 2e-5
    assert only(bench.audited(), "stamped_on_arrival").parameters["seconds"] > 3e-4


def test_losses_and_a_gap_are_counted_apart() -> None:
    bench = Bench()
    left = np.ones(bench.true.size, bool)
    left[[700, 1500, 1501, 4000]] = False
    left[2500:2800] = False
    bench.true, bench.late, bench.stamp = bench.true[left], bench.late[left], bench.stamp[left]
    gap, losses = sorted(bench.audited().faults, key=lambda fault: fault.fault)
    assert (gap.fault, losses.fault) == ("gap", "lost_messages")
    assert gap.parameters["interval_s"] == pytest.approx(3.01, abs=1e-6)
    assert losses.parameters["count"] == 4.0


def test_zeros_duplicates_and_spikes() -> None:
    bench = Bench()
    bench.stamp[1000] = bench.stamp[999]
    bench.stamp[3000] -= 0.5
    receive = START + whole(np.maximum.accumulate(bench.true + bench.late))
    stamp = START + whole(bench.stamp)
    stamp[:7] = 0
    found = {fault.fault: fault for fault in audited(stamp, receive).faults}
    assert set(found) == {"unset_stamps", "duplicates", "backward_jump"}
    assert found["unset_stamps"].parameters["count"] == 7.0
    assert found["duplicates"].parameters["count"] == 1.0
    assert found["backward_jump"].parameters["seconds"] == pytest.approx(-0.49, abs=1e-6)


def test_stamps_of_the_future() -> None:
    bench = Bench()
    bench.stamp += 0.012
    fault = only(bench.audited(), "ahead_of_receipt")
    assert fault.parameters["seconds"] == pytest.approx(0.012 - bench.late.min(), abs=1e-4)


def test_a_scan_whose_last_point_lies_behind_its_receipt_is_stamped_at_its_end() -> None:
    bench = Bench(rate=10.0)
    said = only(bench.audited(PointTimes(0.0, 0.1, 20)), "end_of_scan")
    assert (said.parameters["kind"], said.counts) == ("contradicted", True)
    bench.late += 0.11
    declared = only(bench.audited(PointTimes(0.0, 0.1, 20)), "start_of_scan")
    assert (declared.parameters["kind"], declared.counts) == ("declared", False)


@pytest.mark.parametrize(
    ("first", "last", "name"),
    [(-0.25, -0.15, "end_of_scan"), (0.06, 0.16, "start_of_scan"), (-0.14, -0.13, "end_of_scan")],
)
def test_a_stamp_outside_its_own_scan_is_contradicted_by_its_points(
    first: float, last: float, name: str
) -> None:
    """Ten scans a second: from start or end no point lies farther off than 0.1 s."""
    bench = Bench(rate=10.0)
    bench.late += 0.4
    said = only(bench.audited(PointTimes(first, last, 20)), name)
    assert (said.parameters["kind"], said.counts) == ("contradicted", True)


@pytest.mark.parametrize(("first", "last"), [(0.06, 0.09), (-0.05, 0.05), (-1.0, 0.0), (-0.1, 0)])
def test_cut_outs_and_maps_of_several_scans_contradict_no_stamp(first: float, last: float) -> None:
    bench = Bench(rate=10.0)
    bench.late += 0.4
    assert not any(f.counts for f in bench.audited(PointTimes(first, last, 20)).faults)


def test_stamps_ahead_of_receipt_are_said_once_whatever_their_points_say() -> None:
    bench = Bench(rate=10.0)
    bench.stamp += 0.3
    only(bench.audited(PointTimes(-0.3, -0.2, 20)), "ahead_of_receipt")


@pytest.mark.parametrize("rate", [10.0, 50.0, 200.0])
def test_duplicates_of_a_sensor_at_exact_epochs_are_not_taken_for_truncation(rate: float) -> None:
    bench = Bench(rate=rate)
    for k in (41, 160, 222, 305, 411):
        bench.stamp[k] = bench.stamp[k - 1]
    assert only(bench.audited(), "duplicates").parameters["count"] == 5.0


@pytest.mark.parametrize(
    ("seconds", "kind"),
    [(37.0, "tai"), (3600.0, "time_zone"), (-3600.0, "time_zone"), (-1.69e9, "boot")],
)
def test_an_epoch_that_changes_in_the_middle_is_named_from_there_on(
    seconds: float, kind: str
) -> None:
    bench = Bench(length=30.0)
    bench.stamp[1000:] += seconds
    fault = only(bench.audited(), "epoch_offset")
    assert fault.parameters["kind"] == kind
    assert fault.parameters["seconds"] == pytest.approx(seconds, abs=0.01)
    assert fault.from_s == pytest.approx(10.0, abs=0.02)
    assert fault.to_s == pytest.approx(29.99, abs=0.02)


def test_a_host_that_stands_still_is_no_fault_of_the_stream() -> None:
    bench = Bench()
    arrived = bench.true + bench.late
    for begin, length in ((12.0, 1.4), (31.0, 1.1), (33.5, 0.4)):
        held = (arrived > begin) & (arrived < begin + length)
        arrived = np.where(held, begin + length, arrived)
    bench.late = arrived - bench.true
    assert bench.audited().faults == ()


# ---- streams together -----------------------------------------------------------------------


@pytest.mark.parametrize("size", [0.25, -0.25])
def test_a_step_of_all_receipts_is_the_recorders(size: float) -> None:
    made = []
    for k, rate in enumerate((20.0, 50.0, 100.0)):
        bench = Bench(k, rate)
        receive = np.maximum.accumulate(bench.true + bench.late)
        receive = receive + np.where(receive >= 31.0, size, 0.0)
        made.append(audited(START + whole(bench.stamp), START + whole(receive), str(k)))
    for one in held_together(made):
        fault = only(one, "recorder_clock")
        assert fault.parameters["seconds"] == pytest.approx(-size, rel=0.02)
        assert fault.from_s == pytest.approx(31.0, abs=0.5)


def test_one_shift_of_receipts_alone_is_nobodys_fault() -> None:
    """Longer latency from some moment on: the stamps keep their rhythm."""
    bench = Bench()
    bench.late[3000:] += 0.004
    assert bench.audited().faults == ()


# ---- both generators, a few of everything ---------------------------------------------------


def found_in(recording: MadeRecording) -> list[tuple[set[str], set[str]]]:
    ones = held_together([audited(s.stamp_ns, s.receive_ns, s.name) for s in recording.streams])
    batched = {"batched_by_recorder"} & set(recording.planted)
    return [
        (set(made.planted) | batched, {f.fault for f in one.faults if f.counts or batched})
        for made, one in zip(recording.streams, ones, strict=True)
    ]


@pytest.mark.parametrize("corpus", [audit_corpus, audit_corpus_other])
def test_a_seeded_part_of_the_corpus(corpus: object) -> None:
    rows = [row for made in corpus.corpus(31, 1, 2) for row in found_in(made)]  # type: ignore[attr-defined]
    planted = [(names, found) for names, found in rows if names]
    sound = [found for names, found in rows if not names]
    missed = [row for row in planted if not row[0] <= row[1]]
    assert len(planted) >= 20
    assert len(missed) <= 1, missed
    assert sum(bool(found) for found in sound) == 0, sound


def test_what_would_come_sooner_than_any_other_is_no_slip() -> None:
    """A host under load lets go of messages that are up to 1.9 s late: 41 of them are near one
    whole second, and by that second too early they would come 0.3 s before they were measured."""
    drawn = (one for made in audit_corpus.corpus(60331, 4, 8) for one in made.streams)
    made = next(one for one in drawn if one.name == "sound_load_episodes_6")
    assert (made.receive_ns - made.stamp_ns).max() > 1.8 * SECOND
    assert not any(f.counts for f in audited(made.stamp_ns, made.receive_ns).faults)
