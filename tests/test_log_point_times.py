"""Point times of clouds, as drivers write them: each by hand from its driver's convention."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from syncline_design.logs.readers.point_times import CloudTimes, cloud_times

STAMP_S = 1_700_000_000.25
F4, F8, U4, U8 = 7, 8, 6, 10
OFFSETS_S = np.linspace(0.0, 0.0999, 50)


def cloud(name: str, code: int, kind: str, values: np.ndarray, big: bool = False) -> object:
    record = np.zeros(len(values), dtype=[("x", "f4"), ("t", (">" if big else "<") + kind)])
    record["t"] = values
    stamp = SimpleNamespace(sec=int(STAMP_S), nanosec=250_000_000)
    field = SimpleNamespace(name=name, offset=4, datatype=code, count=1)
    x = SimpleNamespace(name="x", offset=0, datatype=F4, count=1)
    return SimpleNamespace(
        header=SimpleNamespace(stamp=stamp), fields=[x, field], is_bigendian=big,
        point_step=record.dtype.itemsize, width=len(values), height=1,
        data=np.frombuffer(record.tobytes(), dtype=np.uint8),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("made", "first", "last"),
    [
        (cloud("time", F4, "f4", OFFSETS_S), 0.0, 0.0999),  # Velodyne: seconds after the stamp
        (cloud("time", F4, "f4", OFFSETS_S - 0.0999), -0.0999, 0.0),  # stamped at the scan's end
        (cloud("t", U4, "u4", OFFSETS_S * 1e9), 0.0, 0.0999),  # Ouster: nanoseconds
        (cloud("t", U4, "u4", OFFSETS_S * 1e9, big=True), 0.0, 0.0999),
        (cloud("timestamp", F8, "f8", STAMP_S + OFFSETS_S), 0.0, 0.0999),  # Hesai: absolute
        (cloud("timestamp", F8, "f8", STAMP_S + OFFSETS_S - 0.1), -0.1, -1e-4),
        (cloud("time", U4, "u4", OFFSETS_S * 1e6), 0.0, 0.0999),  # microseconds
    ],
)
def test_first_and_last_point_after_the_stamp(made: object, first: float, last: float) -> None:
    found = cloud_times(made)
    assert found is not None
    assert found.first_s == pytest.approx(first, abs=1e-6)
    assert found.last_s == pytest.approx(last, abs=1e-6)


def test_livox_counts_from_its_own_base() -> None:
    points = [SimpleNamespace(offset_time=int(o * 1e9)) for o in OFFSETS_S]
    stamp = SimpleNamespace(sec=int(STAMP_S), nanosec=250_000_000)
    base = round((STAMP_S - 0.02) * 1e9)
    made = SimpleNamespace(header=SimpleNamespace(stamp=stamp), timebase=base, points=points)
    found = cloud_times(made)
    assert found is not None
    assert found.first_s == pytest.approx(-0.02, abs=1e-6)
    assert found.last_s == pytest.approx(0.0799, abs=1e-6)


def test_a_scan_tells_by_its_increment() -> None:
    assert cloud_times(SimpleNamespace(time_increment=1e-4, ranges=np.zeros(101))) == CloudTimes(
        0.0, pytest.approx(0.01)
    )
    assert cloud_times(SimpleNamespace(time_increment=0.0, ranges=np.zeros(101))) is None


@pytest.mark.parametrize(
    "made",
    [
        cloud("intensity", F4, "f4", OFFSETS_S),  # no time at all
        cloud("t", U4, "u4", np.zeros(50)),  # all zero
        cloud("timestamp", F8, "f8", np.full(50, np.nan)),
        cloud(
            "timestamp", F8, "f8", STAMP_S + 3600 + OFFSETS_S
        ),  # of another hour: not this scan's
    ],
)
def test_what_tells_no_time_tells_none(made: object) -> None:
    assert cloud_times(made) is None


def test_a_cloud_that_lies_about_its_size_is_not_read() -> None:
    made = cloud("t", U4, "u4", OFFSETS_S * 1e9)
    made.width = 10**9  # type: ignore[attr-defined]
    assert cloud_times(made) is None
    assert cloud_times(None) is None
