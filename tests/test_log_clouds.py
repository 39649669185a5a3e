"""LAS and LAZ written with laspy, captures written with dpkt; damaged and hostile ones too."""

from __future__ import annotations

import struct
import zlib
from datetime import UTC, datetime
from decimal import Decimal
from pathlib import Path

import numpy as np
import pytest

from syncline_design.logs.readers import open_recording
from syncline_design.logs.readers.stream import UNSET, Recording, Stream
from syncline_design.spec.load import BadInput

laspy = pytest.importorskip("laspy")
dpkt = pytest.importorskip("dpkt")

SECOND = 10**9
HOST, SENSOR = bytes([10, 0, 0, 1]), bytes([10, 0, 0, 7])


def only(recording: Recording) -> Stream:
    (stream,) = recording.streams()
    return stream


def stamps_of(stream: Stream) -> list[int]:
    assert stream.stamps is not None
    return [int(at) for at in stream.stamps.primary_ns]


# LAS


def cloud(
    path: Path, times: np.ndarray, standard: bool = False, form: int = 6, version: str = "1.4"
) -> Path:
    header = laspy.LasHeader(point_format=form, version=version)
    header.scales, header.offsets = [0.001] * 3, [500_000.0, 5_000_000.0, 0.0]
    header.global_encoding.gps_time_type = laspy.header.GpsTimeType(int(standard))
    las = laspy.LasData(header)
    las.x = 500_000 + np.arange(times.shape[0])
    las.y = 5_000_000 - 0.5 * np.arange(times.shape[0])
    las.z = 100 + 0.25 * np.arange(times.shape[0])
    las.intensity = np.arange(times.shape[0]) % 1000
    if form not in (0, 2):
        las.gps_time = times
    las.write(path)
    return path


@pytest.mark.parametrize("name", ["a.las", "a.laz"])
def test_points_and_times_of_a_cloud(tmp_path: Path, name: str) -> None:
    times = 245_000.125 + 0.25 * np.arange(1000)
    recording = open_recording(cloud(tmp_path / name, times))
    stream = only(recording)
    assert stream.messages == 1000
    assert stream.timeline == "unknown"
    assert stream.stamps is not None
    assert stream.stamps.primary == "seconds of the GPS week"
    assert stamps_of(stream) == [245_000_125_000_000 + k * 250_000_000 for k in range(1000)]
    pieces = list(recording.samples("a"))
    assert np.allclose(
        np.concatenate([p.columns["point_y_m"] for p in pieces])[[0, 999]], [5e6, 4_999_500.5]
    )
    assert sum(p.columns["intensity"].shape[0] for p in pieces) == 1000


@pytest.mark.parametrize("said", [True, False])
def test_adjusted_standard_time_whatever_the_header_says(tmp_path: Path, said: bool) -> None:
    moment = datetime(2014, 4, 15, 16, 56, 41, tzinfo=UTC)  # as the calendar of GPS reads
    seconds = (moment - datetime(1980, 1, 6, tzinfo=UTC)).total_seconds() - 1e9
    stream = only(open_recording(cloud(tmp_path / "a.las", seconds + np.arange(5.0), said)))
    assert stream.timeline == "gps"
    assert stamps_of(stream)[0] == int(moment.timestamp()) * SECOND
    assert any("header says seconds of the GPS week" in note for note in stream.notes) is not said


def test_week_seconds_though_the_header_says_standard_time(tmp_path: Path) -> None:
    stream = only(open_recording(cloud(tmp_path / "a.las", 3e5 + np.arange(5.0), True)))
    assert stream.timeline == "unknown"
    assert any("header says adjusted standard time" in note for note in stream.notes)


def test_points_without_time_and_with_none_that_is_finite(tmp_path: Path) -> None:
    old = only(open_recording(cloud(tmp_path / "a.las", np.zeros(4), form=0, version="1.2")))
    assert old.stamps is None
    odd = np.array([np.nan, 5.0, 4.0, np.inf])
    stream = only(open_recording(cloud(tmp_path / "b.las", odd)))
    assert stamps_of(stream) == [UNSET, 5 * SECOND, 4 * SECOND, UNSET]
    assert any("2 points have no finite time" in note for note in stream.notes)
    assert any("1 steps back" in note for note in stream.notes)


@pytest.mark.parametrize("at", [0.2, 0.7])
def test_damage_that_ends_the_process_of_its_library_ends_none_here(
    tmp_path: Path, at: float
) -> None:
    """lazrs reads outside its memory in such layers: its own process dies, this one says so."""
    import subprocess
    import sys

    path = cloud(tmp_path / "a.laz", np.sort(np.random.default_rng(1).uniform(0, 6e5, 3000)))
    whole = path.read_bytes()
    begins = int(at * len(whole))
    path.write_bytes(whole[:begins] + b"\xff" * 3000 + whole[begins + 3000 :])
    code = "import laspy, sys; laspy.open(sys.argv[1]).read_points(3000)"
    alone = subprocess.run([sys.executable, "-c", code, str(path)], capture_output=True)
    assert alone.returncode < 0  # else the library was mended, and the probe may go
    with pytest.raises(BadInput, match="the library that unpacks its points crashes there"):
        open_recording(path).streams()


@pytest.mark.parametrize("name", ["a.las", "a.laz"])
@pytest.mark.parametrize("behind", [1, 900])
def test_records_behind_the_points_may_be_lost(tmp_path: Path, name: str, behind: int) -> None:
    """They are what a cut takes first; every point is there still."""
    path = cloud(tmp_path / name, 245_000.0 + 0.25 * np.arange(1000))
    las = laspy.read(path)
    las.evlrs = laspy.vlrs.vlrlist.VLRList([laspy.VLR("made", 7, "", b"x" * 1000)])
    las.write(path)
    whole = path.read_bytes()
    assert whole.endswith(b"x" * 900)
    path.write_bytes(whole[:-behind])
    recording = open_recording(path)
    assert only(recording).messages == 1000


def test_a_sound_cloud_is_unpacked_once_to_be_listed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By the other process alone; what came over are the points that laspy reads itself."""
    from syncline_design.logs.readers.las import LasRecording

    times = np.sort(np.random.default_rng(3).uniform(0, 6e5, 60_000))
    path = cloud(tmp_path / "a.laz", times)
    recording = open_recording(path)
    with monkeypatch.context() as patch:
        patch.setattr(LasRecording, "_from", None)
        found = only(recording)
    assert (found.messages, found.partial) == (60_000, False)
    assert np.abs(np.asarray(stamps_of(found)) - laspy.read(path).gps_time * SECOND).max() < 1.0
    (x, again) = (
        np.concatenate([piece.columns["point_x_m"] for piece in one.samples("a")])
        for one in (recording, open_recording(path))
    )
    assert np.array_equal(x, np.asarray(laspy.read(path).x))
    assert np.array_equal(x, again)


def test_what_unpacks_before_a_crash_is_read(tmp_path: Path) -> None:
    """The chunk behind 50 000 points is damaged; those of the first are read and are the same."""
    times = np.sort(np.random.default_rng(2).uniform(0, 6e5, 60_000))
    path = cloud(tmp_path / "a.laz", times)
    expected = stamps_of(only(open_recording(path)))
    whole = path.read_bytes()
    begins = int(0.84 * len(whole))
    path.write_bytes(whole[:begins] + b"\xff" * 3000 + whole[begins + 3000 :])
    recording = open_recording(path)
    stream = only(recording)
    assert (stream.partial, stream.messages) == (True, 50_000)
    assert stamps_of(stream) == expected[:50_000]
    assert recording.incomplete is not None
    assert "crashes there" in recording.incomplete.reason


@pytest.mark.parametrize("name", ["a.las", "a.laz"])
def test_a_cut_cloud_is_read_up_to_its_cut(tmp_path: Path, name: str) -> None:
    rng = np.random.default_rng(3)
    whole = cloud(tmp_path / name, np.sort(rng.uniform(0, 6e5, 120_000)))
    other = tmp_path / f"whole_{name}"
    other.write_bytes(whole.read_bytes())
    whole.write_bytes(whole.read_bytes()[: whole.stat().st_size * 2 // 3])
    recording = open_recording(whole)
    stream = only(recording)
    assert stream.partial
    if name == "a.las":
        assert 79_000 < stream.messages < 81_000
    else:
        assert stream.messages == 50_000  # whole chunks: their parts are packed layer by layer
    assert recording.incomplete is not None
    assert "of 120000 points" in recording.incomplete.reason
    assert stamps_of(stream) == stamps_of(only(open_recording(other)))[: stream.messages]


def patched(path: Path, at: int, code: str, value: int) -> Path:
    raw = bytearray(path.read_bytes())
    struct.pack_into(code, raw, at, value)
    path.write_bytes(bytes(raw))
    return path


@pytest.mark.parametrize(
    ("at", "code", "value", "words"),
    [
        (24, "<B", 9, "version"),
        (94, "<H", 20, "header size"),
        (96, "<I", 2**31, "offset to points"),
        (100, "<I", 2**31, "number of records"),
        (104, "<B", 77, "point format"),
        (105, "<H", 3, "length of a point"),
    ],
)
def test_absurd_headers_are_refused(
    tmp_path: Path, at: int, code: str, value: int, words: str
) -> None:
    path = patched(cloud(tmp_path / "a.las", np.arange(50.0)), at, code, value)
    with pytest.raises(BadInput, match=words):
        open_recording(path).streams()


@pytest.mark.parametrize(("at", "code"), [(235, "<Q"), (243, "<I")])
@pytest.mark.parametrize("name", ["a.las", "a.laz"])
def test_absurd_records_behind_the_points_are_not_read(
    tmp_path: Path, name: str, at: int, code: str
) -> None:
    path = patched(cloud(tmp_path / name, np.arange(50.0)), at, code, 2**31)
    assert only(open_recording(path)).messages == 50


def test_a_cloud_that_unpacks_to_too_much_is_refused(tmp_path: Path) -> None:
    path = cloud(tmp_path / "a.laz", np.arange(50.0))
    with pytest.raises(BadInput, match="unpacks to too much"):
        open_recording(patched(path, 247, "<Q", 10**12)).streams()


def test_more_points_claimed_than_are_there(tmp_path: Path) -> None:
    path = patched(cloud(tmp_path / "a.las", np.arange(50.0)), 247, "<Q", 10**12)
    recording = open_recording(path)
    assert only(recording).messages == 50
    assert only(recording).partial


# captures


def udp(payload: bytes, port: int, source: bytes = SENSOR) -> bytes:
    datagram = dpkt.udp.UDP(sport=port, dport=port, data=payload)
    datagram.ulen = len(datagram)
    packet = dpkt.ip.IP(src=source, dst=HOST, p=17, data=datagram, id=7)
    packet.len = len(packet)
    return bytes(dpkt.ethernet.Ethernet(data=packet, type=0x0800))


def capture(path: Path, packets: list[tuple[Decimal, bytes]], nano: bool = False) -> Path:
    with path.open("wb") as file:
        writer = dpkt.pcap.Writer(file, nano=nano)
        for at, frame in packets:
            writer.writepkt(frame, ts=at)
    return path


def legacy(first_ns: int, step_ns: int, frame: int, start: int, pixels: int = 32) -> bytes:
    """Sixteen columns of an Ouster as firmware 2.1 sends them."""
    columns = []
    for k in range(16):
        head = struct.pack("<QHHI", first_ns + k * step_ns, start + k, frame, 88 * (start + k))
        columns.append(head + bytes(12 * pixels) + b"\xff\xff\xff\xff")
    return b"".join(columns)


def configurable(first_ns: int, step_ns: int, frame: int, start: int) -> bytes:
    """The same in the profile RNG19_RFL8_SIG16_NIR16_DUAL."""
    columns = [
        struct.pack("<QHH", first_ns + k * step_ns, start + k, 1) + bytes(16 * 32)
        for k in range(16)
    ]
    return struct.pack("<HH", 1, frame) + bytes(28) + b"".join(columns) + bytes(32)


def velodyne(micros: int) -> bytes:
    block = b"\xff\xee" + struct.pack("<H", 100) + bytes(96)
    return block * 12 + struct.pack("<I", micros) + b"\x37\x22"


START = 1_700_000_000 * SECOND


@pytest.mark.parametrize("packet", [legacy, configurable])
@pytest.mark.parametrize("nano", [True, False])
def test_packet_time_against_capture_time(tmp_path: Path, packet: object, nano: bool) -> None:
    sensor = [5 * SECOND + k * 1_562_500 for k in range(20)]
    arrived = [START + k * 1_562_000 + 123_000 for k in range(20)]
    packets = [
        (Decimal(arrived[k]) / SECOND, udp(packet(sensor[k], 97_656, 9, 16 * k), 7502))  # type: ignore[operator]
        for k in range(20)
    ]
    recording = open_recording(capture(tmp_path / "a.pcap", packets, nano))
    stream = only(recording)
    assert stream.name == "udp 7502 lidar"
    assert stamps_of(stream) == sensor
    assert stream.stamps is not None
    assert stream.stamps.secondary_ns is not None
    assert stream.stamps.secondary_ns.tolist() == arrived
    assert stream.timeline == "boot"
    assert stream.points is not None
    assert stream.points.last_s == pytest.approx(15 * 97_656e-9)
    (piece,) = recording.samples(stream.name)
    assert piece.columns["frame_id"].tolist() == [9] * 20
    assert piece.columns["clock_last_column_ns"][0] == sensor[0] + 15 * 97_656


def test_metadata_beside_a_capture_name_the_clock(tmp_path: Path) -> None:
    at = START + 37 * SECOND
    packets = [(Decimal(START) / SECOND, udp(legacy(at, 97_656, 9, 0), 7502))]
    path = capture(tmp_path / "a.pcap", packets)
    assert only(open_recording(path)).timeline == "unknown"
    path.with_suffix(".json").write_text('{"timestamp_mode": "TIME_FROM_PTP_1588"}')
    assert only(open_recording(path)).timeline == "tai"


def test_an_imu_of_an_ouster(tmp_path: Path) -> None:
    payload = struct.pack("<3Q6f", 100, 5 * SECOND, 5 * SECOND + 200, 0, 0, 1, 10, -20, 0.5)
    payload = struct.pack("<Q", 5 * SECOND - 90) + payload[8:]
    recording = open_recording(capture(tmp_path / "a.pcap", [(Decimal(9), udp(payload, 7503))]))
    stream = only(recording)
    assert stream.quantity == ("rate", "acceleration", "clock")
    (piece,) = recording.samples(stream.name)
    assert piece.columns["acceleration_z_mps2"].tolist() == [9.80665]
    assert piece.columns["rate_y_degps"].tolist() == [-20]
    assert piece.columns["clock_gyro_ns"].tolist() == [5 * SECOND + 200]


def test_microseconds_of_the_hour_over_the_full_hour(tmp_path: Path) -> None:
    hour = int(datetime(2026, 3, 1, 13, tzinfo=UTC).timestamp()) * SECOND
    packets = []
    for k in range(-3, 3):
        stamp = hour + k * 1_327_000
        packets.append(
            (Decimal(stamp + 400_000) / SECOND, udp(velodyne(stamp // 1000 % 3_600_000_000), 2368))
        )
    stream = only(open_recording(capture(tmp_path / "a.pcap", packets)))
    assert stamps_of(stream) == [hour + k * 1_327_000 for k in range(-3, 3)]
    assert stream.timeline == "unknown"
    position = bytes(198) + struct.pack("<I", 0) + bytes([2, 0, 0, 0])
    position += b"$GPRMC,130000,A,1,N,2,E,3,4,010326,,,A*00\r\n".ljust(306, b"\0")
    packets.append((Decimal(hour) / SECOND, udp(position, 8308)))
    streams = {s.name: s for s in open_recording(capture(tmp_path / "b.pcap", packets)).streams()}
    assert streams["udp 2368 lidar"].timeline == "utc"
    assert streams["udp 8308 position"].messages == 1


def test_logs_of_a_receiver_over_several_segments(tmp_path: Path) -> None:
    logs = b""
    for k in range(4):
        head = b"\xaaD\x12\x1c" + struct.pack(
            "<HBBHHBBHI", 42, 0, 32, 8, 0, 180, 180, 2385, 1000 * k
        )
        raw = head + bytes(8) + bytes(8)
        crc = zlib.crc32(raw, 0xFFFFFFFF) ^ 0xFFFFFFFF
        logs += raw + struct.pack("<I", crc)
    packets = []
    for k, at in enumerate(range(0, len(logs), 30)):
        segment = dpkt.tcp.TCP(sport=3001, dport=48224, seq=at, data=logs[at : at + 30])
        ip = dpkt.ip.IP(src=SENSOR, dst=HOST, p=6, data=segment)
        ip.len = len(ip)
        packets.append((Decimal(10 + k), bytes(dpkt.ethernet.Ethernet(data=ip, type=0x0800))))
    streams = {s.name: s for s in open_recording(capture(tmp_path / "a.pcap", packets)).streams()}
    stream = streams["tcp 3001 BESTPOS"]
    sunday = int(datetime(2025, 9, 21, tzinfo=UTC).timestamp()) * SECOND  # week 2385 begins
    assert stamps_of(stream) == [sunday + k * SECOND for k in range(4)]
    assert stream.timeline == "gps"
    assert streams["tcp 3001"].messages == len(packets)


def test_fragments_are_joined(tmp_path: Path) -> None:
    datagram = dpkt.udp.UDP(sport=7502, dport=7502, data=legacy(5 * SECOND, 97_656, 9, 0))
    datagram.ulen = len(datagram)
    whole = bytes(datagram)
    packets = []
    for at in range(0, len(whole), 1480):
        part = whole[at : at + 1480]
        ip = dpkt.ip.IP(src=SENSOR, dst=HOST, p=17, id=5, data=part)
        ip.mf, ip.offset = int(at + 1480 < len(whole)), at // 8
        ip.len = 20 + len(part)
        packets.append((Decimal(10), bytes(dpkt.ethernet.Ethernet(data=ip, type=0x0800))))
    stream = only(open_recording(capture(tmp_path / "a.pcap", packets)))
    assert stamps_of(stream) == [5 * SECOND]


def test_two_sensors_on_one_port_are_two_streams(tmp_path: Path) -> None:
    packets = [
        (Decimal(10), udp(legacy(5 * SECOND, 97_656, 9, 0), 7502, bytes([10, 0, 0, k])))
        for k in (7, 8)
    ]
    names = [s.name for s in open_recording(capture(tmp_path / "a.pcap", packets)).streams()]
    assert names == ["udp 7502 lidar from 10.0.0.7", "udp 7502 lidar from 10.0.0.8"]


def test_a_cut_capture_ends_with_its_last_whole_packet(tmp_path: Path) -> None:
    packets = [(Decimal(k), udp(legacy(5 * SECOND + k, 97_656, 9, 0), 7502)) for k in range(5)]
    path = capture(tmp_path / "a.pcap", packets)
    for lost in (1, 3000, 6506 + 7):  # the last within the head of a packet
        cut = tmp_path / f"cut{lost}.pcap"
        cut.write_bytes(path.read_bytes()[:-lost])
        recording = open_recording(cut)
        assert only(recording).messages == 4
        assert only(recording).partial


def test_an_absurd_packet_length_ends_the_capture(tmp_path: Path) -> None:
    packets = [(Decimal(k), udp(legacy(5 * SECOND + k, 97_656, 9, 0), 7502)) for k in range(3)]
    path = capture(tmp_path / "a.pcap", packets)
    second = 24 + 16 + len(packets[0][1]) + 8
    recording = open_recording(patched(path, second, "<I", 2**32 - 1))
    assert only(recording).messages == 1
    assert recording.incomplete is not None
    assert "4294967295" in recording.incomplete.reason


@pytest.mark.parametrize("rest", [b"", bytes(20), b"\x07" * 200])
def test_a_capture_of_nothing_is_refused(tmp_path: Path, rest: bytes) -> None:
    path = tmp_path / "a.pcap"
    path.write_bytes(b"\xd4\xc3\xb2\xa1" + rest)
    with pytest.raises(BadInput):
        open_recording(path).streams()


def test_pcapng_is_read_too_and_its_absurd_times_are_unset(tmp_path: Path) -> None:
    path = tmp_path / "a.pcapng"
    with path.open("wb") as file:
        writer = dpkt.pcapng.Writer(file)
        for k in range(3):
            writer.writepkt(udp(legacy(5 * SECOND + k, 97_656, 9, 0), 7502), ts=1_700_000_000.5 + k)
    (stream,) = open_recording(path).streams()
    assert stamps_of(stream) == [5 * SECOND + k for k in range(3)]
    assert stream.stamps is not None
    assert stream.stamps.secondary_ns is not None
    at = 1_700_000_000_500_000_000
    assert stream.stamps.secondary_ns.tolist() == [at + k * SECOND for k in range(3)]
    raw = bytearray(path.read_bytes())
    high = raw.index(struct.pack("<I", int(1_700_000_000.5e6) >> 32))
    raw[high : high + 4] = b"\xff\xff\xff\x7f"
    path.write_bytes(bytes(raw))
    (stream,) = open_recording(path).streams()
    assert stream.stamps is not None
    assert stream.stamps.secondary_ns is not None
    assert stream.stamps.secondary_ns[0] == UNSET


def test_a_pipe_in_place_of_metadata_is_not_waited_for(tmp_path: Path) -> None:
    import os

    path = capture(tmp_path / "run.pcap", [(Decimal(5), udp(legacy(5 * SECOND, 1, 9, 0), 7502))])
    os.mkfifo(tmp_path / "run.json")
    assert only(open_recording(path)).messages == 1
