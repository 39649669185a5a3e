"""CSV files as streams: two times for `audit`, any separator and decimal mark."""

from __future__ import annotations

from decimal import Decimal
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from syncline_design.logs.readers import open_recording
from syncline_design.logs.readers.csv_names import plain_name
from syncline_design.logs.readers.decimal_stamps import column, nanoseconds
from syncline_design.logs.readers.epochs import (
    gps_minus_utc_s,
    gps_to_utc,
    nanoseconds_of,
    utc_to_gps,
)
from syncline_design.logs.readers.stream import UNSET, Recording, Stream
from syncline_design.spec.load import BadInput


def opened(tmp_path: Path, text: str | bytes, name: str = "imu.csv") -> Recording:
    path = tmp_path / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return open_recording(path)


def only(recording: Recording) -> Stream:
    (stream,) = recording.streams()
    return stream


@pytest.mark.parametrize(("unit", "digits"), [("s", 9), ("ms", 6), ("us", 3), ("ns", 0)])
def test_stamp_and_receipt_in_every_unit(tmp_path: Path, unit: str, digits: int) -> None:
    rows = [
        (1403636580838555648 + k * 5_000_000, 1403636580841000123 + k * 5_000_001) for k in range(9)
    ]
    scale = Decimal(10) ** digits
    lines = [f"{Decimal(a) / scale:f},{Decimal(b) / scale:f}" for a, b in rows]
    text = f"stamp_{unit},receive_{unit}\n" + "\n".join(lines) + "\n"
    stream = only(opened(tmp_path, text))
    assert stream.name == "imu"
    assert stream.messages == 9
    assert stream.stamps is not None
    assert (stream.stamps.primary, stream.stamps.secondary) == (f"stamp_{unit}", f"receive_{unit}")
    assert stream.stamps.primary_ns.tolist() == [a for a, _ in rows]  # to the last digit
    assert stream.stamps.secondary_ns is not None
    assert stream.stamps.secondary_ns.tolist() == [b for _, b in rows]
    assert stream.timeline == "utc"


def test_one_stream_in_every_way_of_writing(tmp_path: Path) -> None:
    head = ["time_s", "roll_deg", "range_mm"]
    rows = [(f"{1.5 + k}", f"{0.25 * k}", f"{1000 + k}") for k in range(4)]
    for mark, decimal in ((",", "."), (";", ","), ("\t", ","), (";", "."), ("|", ".")):
        for end in ("\n", "\r\n"):
            for start in (b"", b"\xef\xbb\xbf", b"# logged on a boat" + end.encode()):
                lines = [mark.join(c.replace(".", decimal) for c in row) for row in [*rows]]
                text = start + end.join([mark.join(head), *lines, ""]).encode()
                recording = opened(tmp_path, text)
                stamps = only(recording).stamps
                assert stamps is not None
                assert stamps.primary_ns.tolist() == [1_500_000_000 + k * 10**9 for k in range(4)]
                (piece,) = recording.samples("imu")
                assert piece.columns["range_m"].tolist() == [1.0, 1.001, 1.002, 1.003]
                assert piece.columns["roll_deg"].tolist() == [0.0, 0.25, 0.5, 0.75]


def test_iso_times_are_utc(tmp_path: Path) -> None:
    text = (
        "time;latitude_deg;longitude_deg;height_m\n2026-03-01T13:00:00.125+01:00;47,5;8,5;400,25\n"
    )
    stream = only(opened(tmp_path, text))
    assert stream.timeline == "utc"
    assert stream.frame == "wgs84"
    assert stream.stamps is not None
    moment = np.datetime64("2026-03-01T12:00:00.125", "ns").astype(np.int64)
    assert stream.stamps.primary_ns.tolist() == [int(moment)]


def test_names_with_units_in_brackets() -> None:
    named = {
        "Latitude (deg)": "latitude_deg",
        "East Velocity (m/s)": "east_velocity_mps",
        "roll [rad]": "roll_rad",
        "GPS TOW (s)": "gps_tow_s",
        "rate_x_degps": "rate_x_degps",
        "Depth": "depth",
    }
    assert {name: plain_name(name) for name in named} == named


def test_columns_get_the_names_of_the_contract(tmp_path: Path) -> None:
    text = (
        "GPS TOW (s), GPS Week, Latitude (deg), Longitude (deg), Ellipsoid Height (m),"
        "Roll (deg),Pitch (deg),Heading (deg),East Velocity (m/s),North Velocity (m/s),"
        "Up Velocity (m/s),note\n194670.2,2270,35.1,136.8,41.3,0.3,3.0,270.1,-1,2,0.5,fine\n"
    )
    recording = opened(tmp_path, text)
    stream = only(recording)
    assert stream.quantity == ("position", "attitude", "velocity")
    assert (stream.timeline, stream.frame, stream.body) == ("gps", "wgs84", "frd")
    # week 2270 began on Sunday, 2023-07-09
    start = np.datetime64("2023-07-09T00:00:00", "ns").astype(np.int64)
    assert stream.stamps is not None
    assert stream.stamps.primary_ns.tolist() == [int(start) + 194_670_200_000_000]
    (piece,) = recording.samples("imu")
    assert piece.columns["velocity_down_mps"].tolist() == [-0.5]
    assert piece.columns["yaw_deg"].tolist() == [270.1]
    assert any("note" in note for note in stream.notes)


def test_week_seconds_without_a_week_have_no_timeline(tmp_path: Path) -> None:
    stream = only(opened(tmp_path, "gps_tow_s,height_m\n604799.5,1\n604800.5,2\n"))
    assert stream.timeline == "unknown"
    assert stream.stamps is not None
    assert stream.stamps.primary == "seconds of the GPS week"
    assert any("whose number is not there" in note for note in stream.notes)


def test_a_time_of_week_that_is_none_has_no_moment(tmp_path: Path) -> None:
    text = "gps_week,gps_tow_s,height_m\n2270,,1\n2270,1e12,2\n,5,3\n2270,-1e10,4\n2270,0,5\n"
    stamps = only(opened(tmp_path, text)).stamps
    assert stamps is not None
    start = int(np.datetime64("2023-07-09T00:00:00", "ns").astype(np.int64))
    assert stamps.primary_ns.tolist() == [UNSET] * 4 + [start]


def test_a_survey_has_no_times(tmp_path: Path) -> None:
    recording = opened(
        tmp_path, "target_id,target_north_m,target_east_m,target_down_m\nA,1,2,3\nB,4,5,6\n"
    )
    stream = only(recording)
    assert stream.quantity == ("target",)
    assert stream.stamps is None
    (piece,) = recording.samples("imu")
    other = opened(tmp_path, "target_id,range_m,time_s\nB,5,1\n7,6,2\nA,6,2\n", "log.csv")
    (ranges,) = other.samples("log")
    a, b = piece.columns["target_id"].tolist()
    assert ranges.columns["target_id"].tolist() == [b, 7.0, a]  # one name is one figure everywhere
    assert a != b


def test_empty_cells_are_messages_without_the_stamp(tmp_path: Path) -> None:
    stamps = only(opened(tmp_path, "stamp_s,receive_s\n1,2\n,3\nnan,4\n")).stamps
    assert stamps is not None
    assert stamps.primary_ns.tolist() == [10**9, UNSET, UNSET]


def test_a_cut_last_row_is_left_out_and_said(tmp_path: Path) -> None:
    recording = opened(tmp_path, "stamp_s,receive_s\n1,2\n2,3\n3")
    stream = only(recording)
    assert (stream.messages, stream.partial) == (2, True)
    assert recording.incomplete is not None


@pytest.mark.parametrize(
    ("text", "line", "column", "words"),
    [
        ("stamp_s,receive_s\n1,2\nx,3\n", 3, 1, "text among numbers"),
        ("stamp_s,stamp_ms,receive_s\n1,1,2\n", 1, 2, "two columns of stamps"),
        ("stamp_s,receive_s\n1,2\n1,2,3\n", 3, 1, "cells"),
        ("stamp_s,receive_s\n", 1, 1, "no rows"),
        ("stamp,receive_s\n1,2\n", 1, 1, "without a unit"),
        ("time_s,roll_deg\n1,2\n2,2026-01-01T00:00:00Z\n", 3, 2, "text among numbers"),
        (b"stamp_s,receive_s\n1,\x002\n", 2, 3, "not a text file"),
    ],
)
def test_what_is_wrong_is_refused_at_its_place(
    tmp_path: Path, text: str | bytes, line: int, column: int, words: str
) -> None:
    with pytest.raises(BadInput) as caught:
        opened(tmp_path, text).streams()
    (flaw,) = caught.value.problems
    assert (flaw.line, flaw.column) == (line, column)
    assert words in flaw.message


def test_decimals_become_nanoseconds_without_floats() -> None:
    written = [
        "1403636580.838555648",
        "1.413394881555760384e+09",
        "-3.5",
        "5,25",
        "1e30",
        "0",
        "+7",
    ]
    found = column(pl.Series(written), "s").tolist()
    assert found == [
        *(1403636580838555648, 1413394881555760384, -3_500_000_000, 5_250_000_000),
        *(UNSET, 0, 7_000_000_000),
    ]
    assert [nanoseconds(text) for text in written] == found
    assert nanoseconds("0.0000000015") == 2  # half to even, as decimals round
    with pytest.raises(ValueError, match="not a time"):
        nanoseconds("12:30")


def test_leap_seconds_are_those_of_the_bulletins() -> None:
    # IERS Bulletin C: TAI - UTC is 34 s since 2009, 37 s since 2017; GPS = TAI - 19 s
    moments = {
        "2008-12-31T23:59:59": 14,
        "2009-01-01": 15,
        "2016-12-31T23:59:59": 17,
        "2026-11-22": 18,
    }
    for moment, leaps in moments.items():
        utc = np.array([np.datetime64(moment, "ns").astype(np.int64)])
        assert gps_minus_utc_s(int(utc[0])) == leaps
        assert utc_to_gps(utc)[0] == utc[0] + leaps * 10**9
        assert gps_to_utc(utc_to_gps(utc))[0] == utc[0]
    assert utc_to_gps(np.array([UNSET]))[0] == UNSET


def test_seconds_become_nanoseconds_to_the_last_digit() -> None:
    odd = np.array([np.nan, np.inf, -np.inf, 1e300, 9.3e9])
    assert nanoseconds_of(odd).tolist() == [UNSET] * 5
    for value in (400825.001313, -0.25, 604799.9999999999, 1.4e9 + 0.1):
        exact = Decimal(value) * 10**9  # of the double itself
        assert nanoseconds_of(np.array([value]))[0] == int(exact.to_integral_value())


def test_parquet_is_read_by_the_names_that_text_is_read_by(tmp_path: Path) -> None:
    """Whole nanoseconds, calendar times and durations by their types; what is no figure is said."""
    stamps = [1403636580838555648 + k * 5_000_000 for k in range(9)]
    spans = pl.Series([stamps[0] + k for k in range(9)]).cast(pl.Duration("ns"))
    rolls = [0.1 * k for k in range(9)]
    others = {"who": ["a"] * 9, "good": [True] * 9, "all": [[1.0]] * 9}
    turns = {"roll_deg": rolls, "pitch_deg": rolls}
    frame = pl.DataFrame({"stamp_ns": stamps, "receive_s": spans, **turns, **others})
    frame.write_parquet(tmp_path / "imu.parquet")
    recording = open_recording(tmp_path / "imu.parquet")
    stream = only(recording)
    assert recording.format == "Parquet file"
    assert (stream.messages, stream.timeline, stream.quantity) == (9, "utc", ("attitude",))
    assert stream.stamps is not None
    assert stream.stamps.primary_ns.tolist() == stamps
    (piece,) = recording.samples("imu")
    assert piece.columns["roll_deg"].tolist() == rolls
    assert "not read, as they hold text: who, good, all" in stream.notes


@pytest.mark.parametrize("unit", ["ms", "us", "ns"])
def test_calendar_times_of_parquet(tmp_path: Path, unit: str) -> None:
    moments = pl.Series([1_700_000_000_123 + k for k in range(5)]).cast(pl.Datetime("ms"))
    pl.DataFrame({"time": moments.cast(pl.Datetime(unit, "UTC")), "x": range(5)}).write_parquet(
        tmp_path / "a.parquet"
    )
    stream = only(open_recording(tmp_path / "a.parquet"))
    assert stream.timeline == "utc"
    assert stream.stamps is not None
    assert stream.stamps.primary_ns.tolist() == [
        (1_700_000_000_123 + k) * 1_000_000 for k in range(5)
    ]


def test_damaged_parquet_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.parquet"
    pl.DataFrame({"stamp_s": [0.1 * k for k in range(9)], "receive_s": range(9)}).write_parquet(
        path
    )
    path.write_bytes(path.read_bytes()[:-20])
    with pytest.raises(BadInput, match="no readable Parquet file"):
        open_recording(path)
    pl.DataFrame({"stamp_s": ["one"], "receive_s": ["two"]}).write_parquet(path)
    with pytest.raises(BadInput, match="text among numbers in row 1"):
        open_recording(path).streams()
