"""ArduPilot DataFlash logs, written byte by byte and compared with what pymavlink reads."""

from __future__ import annotations

import struct
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from syncline_design.logs.readers import open_recording
from syncline_design.logs.readers.stream import UNSET, Recording, Stream
from syncline_design.spec.load import BadInput

DFReader = pytest.importorskip("pymavlink.DFReader")

SIZES = dict(
    zip(
        "bBMhHiIfdnNZcCeELQq",
        [1, 1, 1, 2, 2, 4, 4, 4, 8, 4, 16, 64, 2, 2, 4, 4, 4, 8, 8],
        strict=True,
    )
)
CODES = dict(zip("bBMhHiIfdnNZcCeELQq", "bBBhHiIfd4s16s64shHiIiQq", strict=False)) | {
    **{"n": "4s", "N": "16s", "Z": "64s", "c": "h", "C": "H", "e": "i", "E": "I"},
    **{"L": "i", "Q": "Q", "q": "q"},
}
GPS = (130, "GPS", "QBIHBcLLefffB", "TimeUS,Status,GMS,GWk,NSats,HDop,Lat,Lng,Alt,Spd,GCrs,VZ,U")
ATT = (131, "ATT", "Qcccc", "TimeUS,DesRoll,Roll,Pitch,Yaw")
IMU = (132, "IMU", "QBffffff", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ")
UNIT = (133, "UNIT", "QbZ", "TimeUS,Id,Label")
FMTU = (134, "FMTU", "QBNN", "TimeUS,FmtType,UnitIds,MultIds")
MULT = (135, "MULT", "Qbd", "TimeUS,Id,Mult")
BARO = (136, "BARO", "QfI", "TimeUS,Alt,SMS")
Kind = tuple[int, str, str, str]


def fmt(kind: Kind) -> bytes:
    number, name, layout, fields = kind
    length = 3 + sum(SIZES[c] for c in layout)
    body = struct.pack(
        "<BB4s16s64s", number, length, name.encode(), layout.encode(), fields.encode()
    )
    return b"\xa3\x95\x80" + body


def message(kind: Kind, *values: Any) -> bytes:
    code = "<" + "".join(CODES[c] for c in kind[2])
    return b"\xa3\x95" + bytes([kind[0]]) + struct.pack(code, *values)


def flight(rows: int = 40) -> bytes:
    """A log of its own description, a GNSS at 5 Hz, two IMUs and an attitude."""
    parts = [fmt((128, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns"))]
    parts += [fmt(kind) for kind in (UNIT, MULT, FMTU, GPS, ATT, IMU, BARO)]
    parts += [message(UNIT, 1, ord(c), t) for c, t in (("s", b"s"), ("E", b"rad/s"), ("m", b"m"))]
    parts += [message(MULT, 1, ord(c), f) for c, f in (("F", 1e-6), ("C", 1e-3), ("0", 1.0))]
    parts += [message(FMTU, 1, IMU[0], b"s#EEEooo", b"F-000000")]
    parts += [message(FMTU, 1, BARO[0], b"sms", b"F0C")]
    for k in range(rows):
        at = 10_000_000 + 200_000 * k
        week = 2346 if k else 0  # no week before the first fix
        lat, lng = 473977418 + 11 * k, -85455932 - 7 * k
        parts.append(
            message(
                GPS, at, 3, 100_000 + 200 * k, week, 12, 70, lat, lng, 48833, 5.0, 30.0, -0.5, 1
            )
        )
        parts.append(message(ATT, at + 100, 0, 120 + k, -340, 9000 + k))
        parts.append(message(BARO, at + 300, 3.5, 10_000 + 200 * k))
        for one in range(2):
            parts.append(message(IMU, at + 200 + one, one, 0.1, 0.2, 0.3, 0.0, 0.0, -9.8))
    return b"".join(parts)


def written(tmp_path: Path, content: bytes) -> Recording:
    path = tmp_path / "a.bin"
    path.write_bytes(content)
    return open_recording(path)


def by_name(recording: Recording) -> dict[str, Stream]:
    return {stream.name: stream for stream in recording.streams()}


def columns_of(recording: Recording, name: str) -> dict[str, np.ndarray]:
    pieces = list(recording.samples(name))
    return {key: np.concatenate([p.columns[key] for p in pieces]) for key in pieces[0].columns}


def test_every_kind_is_counted_as_pymavlink_counts_it(tmp_path: Path) -> None:
    recording = written(tmp_path, flight())
    reader = DFReader.DFReader_binary(str(recording.path))
    counted: Counter[str] = Counter()
    while (one := reader.recv_msg()) is not None:
        counted[one.get_type()] += 1
    found: Counter[str] = Counter()
    for stream in recording.streams():
        found[stream.name.partition("[")[0]] += stream.messages
    assert found == counted
    assert recording.incomplete is None


def test_figures_are_those_that_pymavlink_reads(tmp_path: Path) -> None:
    recording = written(tmp_path, flight())
    reader = DFReader.DFReader_binary(str(recording.path))
    gps, att = [], []
    while (one := reader.recv_msg()) is not None:
        if one.get_type() == "GPS":
            gps.append((one.TimeUS, one.Lat, one.Lng, one.Alt))
        elif one.get_type() == "ATT":
            att.append((one.Roll, one.Pitch, one.Yaw))
    fix = columns_of(recording, "GPS")
    place = np.stack([fix["latitude_deg"], fix["longitude_deg"], fix["height_msl_m"]], axis=1)
    assert np.array_equal(place, np.array(gps)[:, 1:])
    turn = columns_of(recording, "ATT")
    assert np.allclose(
        np.stack([turn["roll_deg"], turn["pitch_deg"], turn["yaw_deg"]], axis=1),
        att,
        rtol=0,
        atol=1e-12,
    )
    stamps = by_name(recording)["GPS"].stamps
    assert stamps is not None
    assert stamps.primary_ns.tolist() == [1000 * row[0] for row in gps]


def test_what_is_said_of_the_streams(tmp_path: Path) -> None:
    streams = by_name(written(tmp_path, flight()))
    assert {"IMU[0]", "IMU[1]", "GPS", "ATT"} <= set(streams)  # the units' # tells two sensors
    assert streams["IMU[1]"].messages == 40
    assert streams["GPS"].quantity == ("position", "velocity", "clock")
    assert (streams["GPS"].frame, streams["GPS"].timeline) == ("wgs84", "boot")
    assert any("sea level" in note for note in streams["GPS"].notes)
    assert (streams["ATT"].frame, streams["ATT"].body) == ("ned", "frd")
    assert streams["ATT"].quantity == ("attitude",)


def test_one_of_two_sensors_alone_keeps_its_plain_name(tmp_path: Path) -> None:
    one = fmt((128, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns")) + fmt(FMTU) + fmt(IMU)
    one += message(FMTU, 1, IMU[0], b"s#EEEooo", b"F-000000")
    one += message(IMU, 5, 1, 0.1, 0.2, 0.3, 0.0, 0.0, -9.8)
    recording = written(tmp_path, one)
    assert "IMU" in by_name(recording)
    assert columns_of(recording, "IMU")["I"].tolist() == [1]


def test_velocity_and_the_receivers_own_time(tmp_path: Path) -> None:
    fix = columns_of(written(tmp_path, flight()), "GPS")
    north, east = 5.0 * np.cos(np.pi / 6), 2.5  # 5 m/s on course 30 deg
    assert np.allclose(fix["velocity_north_mps"], north)
    assert np.allclose(fix["velocity_east_mps"], east)
    assert np.allclose(fix["velocity_down_mps"], -0.5)
    assert (fix["clock_gps_ns"][0], fix["clock_utc_ns"][0]) == (0, 0)
    # 2024-12-22 is the Sunday that GPS week 2346 begins with, 100.2 s after midnight
    sunday = int(np.datetime64("2024-12-22T00:00:00", "ns").astype(np.int64))
    assert fix["clock_gps_ns"][1] == sunday + 100_200_000_000
    assert fix["clock_utc_ns"][1] == sunday + 82_200_000_000


def test_the_multiplier_of_a_unit_counts(tmp_path: Path) -> None:
    baro = columns_of(written(tmp_path, flight()), "BARO")
    assert baro["SMS_s"][1] == pytest.approx(10.2)  # milliseconds in the file
    assert baro["Alt_m"][0] == 3.5


def test_a_cut_log_is_read_up_to_its_last_whole_message(tmp_path: Path) -> None:
    whole = flight()
    recording = written(tmp_path, whole[:-5])
    streams = by_name(recording)
    assert streams["IMU[1]"].messages == 39
    assert streams["IMU[0]"].messages == 40
    assert all(stream.partial for stream in streams.values())
    assert recording.incomplete is not None
    assert "cut" in recording.incomplete.reason
    assert recording.incomplete.messages == sum(s.messages for s in streams.values())


def test_garbage_between_messages_is_passed_over_and_said(tmp_path: Path) -> None:
    log = flight()
    at = log.rindex(b"\xa3\x95" + bytes([ATT[0]]))
    recording = written(tmp_path, log[:at] + b"\x17" * 41 + log[at:])
    assert by_name(recording)["ATT"].messages == 40
    assert recording.incomplete is not None
    assert "41 bytes" in recording.incomplete.reason


def test_padding_at_the_end_is_no_damage(tmp_path: Path) -> None:
    assert written(tmp_path, flight() + b"\xff" * 500).incomplete is None
    assert written(tmp_path, flight() + bytes(500)).incomplete is None


@pytest.mark.parametrize(
    "layout", [("QQQ", "TimeUS,A"), ("Q?", "TimeUS,A"), ("QB", "TimeUS,TimeUS"), ("", "")]
)
def test_a_layout_that_does_not_fit_is_counted_only(
    tmp_path: Path, layout: tuple[str, str]
) -> None:
    head = b"\xa3\x95\x80" + struct.pack(
        "<BB4s16s64s", 140, 12, b"ODD", layout[0].encode(), layout[1].encode()
    )
    recording = written(tmp_path, flight(2) + head + b"\xa3\x95" + bytes([140]) + bytes(9))
    odd = by_name(recording)["ODD"]
    assert odd.messages == 1
    assert odd.stamps is None
    assert any("does not fit" in note for note in odd.notes)


@pytest.mark.parametrize("length", [0, 1, 2])
def test_a_length_shorter_than_a_head_ends_nowhere_else(tmp_path: Path, length: int) -> None:
    head = b"\xa3\x95\x80" + struct.pack("<BB4s16s64s", 140, length, b"ODD", b"B", b"A")
    recording = written(tmp_path, flight(2) + head + b"\xa3\x95" + bytes([140, 9, 9]))
    assert by_name(recording)["GPS"].messages == 2


def test_stamps_beyond_64_bits_are_unset(tmp_path: Path) -> None:
    wild = fmt(ATT) + message(ATT, 2**64 - 1, 0, 0, 0, 0) + message(ATT, 7, 0, 0, 0, 0)
    stamps = by_name(written(tmp_path, wild))["ATT"].stamps
    assert stamps is not None
    assert stamps.primary_ns.tolist() == [UNSET, 7000]


def test_a_log_without_messages_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="no message"):
        written(tmp_path, b"\xa3\x95\x80" + b"\xff" * 40).streams()
