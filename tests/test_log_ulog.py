"""PX4 flight logs against pyulog, and against bytes made here."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

from syncline_design.logs.readers import open_recording
from syncline_design.spec.load import BadInput
from tests.flight_logs import (
    BOOT_NS,
    GEOID_M,
    START_NS,
    flight,
    geodetic,
    ulog_bytes,
    ulog_record,
    write_ulog,
)

MADE = flight(6.0)


def test_a_flight_is_read_as_it_was_written(tmp_path: Path) -> None:
    from pyulog import ULog

    path = write_ulog(tmp_path / "a.ulg", MADE)
    recording = open_recording(path)
    streams = {s.name: s for s in recording.streams()}
    theirs = {f"{d.name}[{d.multi_id}]": d for d in ULog(str(path)).data_list}
    assert {n: s.messages for n, s in streams.items()} == {
        n: len(d.data["timestamp"]) for n, d in theirs.items()
    }
    attitude = streams["vehicle_attitude[0]"]
    assert attitude.stamps is not None
    assert (attitude.stamps.primary, attitude.stamps.secondary) == ("timestamp_sample", "timestamp")
    own = theirs["vehicle_attitude[0]"].data
    assert attitude.stamps.primary_ns.tolist() == (own["timestamp_sample"] * 1000).tolist()
    (piece,) = recording.samples("vehicle_attitude[0]")
    np.testing.assert_array_equal(piece.columns["quaternion_w"], own["q[0]"].astype(float))
    (fix,) = recording.samples("vehicle_gps_position[0]")
    globe = geodetic(MADE.place)
    assert np.isnan(fix.columns["latitude_deg"][:3]).all()  # no fix yet
    assert np.abs(fix.columns["latitude_deg"] - globe[:, 0])[3:].max() <= 0.5000001e-7
    assert np.abs(fix.columns["height_m"] - globe[:, 2])[3:].max() <= 0.5001e-3
    assert np.abs(fix.columns["height_msl_m"] + GEOID_M - globe[:, 2])[3:].max() <= 0.5001e-3
    gnss = streams["vehicle_gps_position[0]"]
    offset = (START_NS // 1000 - BOOT_NS // 1000) / 1e6
    assert any(f"UTC - boot = {offset:.6f} s" in note for note in gnss.notes)
    assert "3 messages without UTC: no fix yet" in gnss.notes
    assert streams["vehicle_local_position[0]"].nature == "fused"


def test_utc_is_held_against_when_a_receiver_measured(tmp_path: Path) -> None:
    """Its message was published 60 ms later, which is no part of UTC - boot."""
    boot_us, utc_us = 12_345_678, 1_764_000_000_500_000
    names = "uint64_t timestamp;uint64_t timestamp_sample;uint64_t time_utc_usec"
    records = [ulog_record("F", f"sensor_gps:{names}".encode())]
    records.append(ulog_record("A", struct.pack("<BH", 0, 0) + b"sensor_gps"))
    for k in range(20):
        measured, utc = boot_us + 200_000 * k, utc_us + 200_000 * k
        row = struct.pack("<QQQ", measured + 60_000, measured, utc)
        records.append(ulog_record("D", struct.pack("<H", 0) + row))
    path = tmp_path / "a.ulg"
    path.write_bytes(b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 1) + b"".join(records))
    (gnss,) = open_recording(path).streams()
    offset = (utc_us - boot_us) / 1e6
    wanted = f"UTC - boot = {offset:.6f} s (median of 20, spread 0.0 ms, by timestamp_sample)"
    assert any(wanted in note for note in gnss.notes), gnss.notes


def test_formats_within_formats_and_sections_behind_the_end(tmp_path: Path) -> None:
    """Arrays of formats, trailing padding that is not there, and data appended after a crash."""
    formats = ("inner:uint8_t a;uint8_t[3] _padding0;float b",
               "outer:uint64_t timestamp;inner[2] x;uint16_t c;uint8_t[6] _padding1")  # fmt: skip
    body = [ulog_record("F", text.encode()) for text in formats]
    body.append(ulog_record("A", struct.pack("<BH", 3, 7) + b"outer"))

    def row(k: int) -> bytes:
        data = struct.pack("<QB3xfB3xfH", 1000 * k, k, 0.5 * k, k + 1, 0.25 * k, 7 * k)
        return ulog_record("D", struct.pack("<H", 7) + data)

    head = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 1)
    rest = b"".join(body) + b"".join(row(k) for k in range(5))
    end = len(head) + 43 + len(rest) + 4  # the section ends within a record
    flags = bytes(8) + bytes([1]) + bytes(7) + struct.pack("<QQQ", end, 0, 0)
    path = tmp_path / "a.ulg"
    data = head + ulog_record("B", flags) + rest + row(9)[:4] + b"".join(row(k) for k in (5, 6))
    path.write_bytes(data)
    recording = open_recording(path)
    (stream,) = recording.streams()
    assert recording.incomplete is None
    assert (stream.name, stream.messages) == ("outer[3]", 7)
    assert stream.stamps is not None
    assert stream.stamps.primary_ns.tolist() == [1_000_000 * k for k in range(7)]


def test_a_cut_log_is_read_up_to_its_last_good_record(tmp_path: Path) -> None:
    data = ulog_bytes(MADE)
    path = tmp_path / "a.ulg"
    counts = []
    for at in np.linspace(600, len(data), 15).astype(int):
        path.write_bytes(data[:at])
        recording = open_recording(path)
        try:
            streams = recording.streams()
        except BadInput:
            counts.append(0)
            continue
        counts.append(sum(s.messages for s in streams))
        assert (recording.incomplete is not None) == all(s.partial for s in streams)
    assert counts == sorted(counts)
    assert counts[-1] == 4 * len(MADE)


def test_changed_bytes_are_told_or_harmless(tmp_path: Path) -> None:
    data = ulog_bytes(flight(2.0))
    path = tmp_path / "a.ulg"
    draw = np.random.default_rng(7)
    for _ in range(24):
        bad = bytearray(data)
        for at in draw.integers(8, len(data) if _ % 2 else 900, 3):
            bad[at] = int(draw.integers(256))
        path.write_bytes(bytes(bad))
        try:
            recording = open_recording(path)
            streams = recording.streams()
            for stream in streams:
                list(recording.samples(stream.name))
        except BadInput:
            continue
        assert sum(s.messages for s in streams) <= 80


def test_a_format_that_holds_itself_is_told(tmp_path: Path) -> None:
    path = tmp_path / "a.ulg"
    head = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 1)
    loop = ulog_record("F", b"a:uint64_t timestamp;a[9] x")
    path.write_bytes(head + loop + ulog_record("A", struct.pack("<BH", 0, 1) + b"a"))
    with pytest.raises(BadInput, match="no readable ULog"):
        open_recording(path).streams()
