"""ROS bags and MCAP files, written by the formats' own libraries: read whole, cut and hostile."""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from syncline_design.logs.readers import open_recording
from syncline_design.logs.readers.stream import Recording, Stream
from syncline_design.spec.load import BadInput
from tests.flight_logs import (
    Flight,
    flight,
    geodetic,
    ros_quaternion,
    write_mcap,
    write_ros1,
    write_ros2,
    write_ulog,
)

MADE = flight(6.0)
WRITERS: dict[str, Callable[[Path, Flight], Path]] = {
    "ros1": lambda p, f: write_ros1(p / "a.bag", f),
    "ros1-bz2": lambda p, f: write_ros1(p / "a.bag", f, "bz2"),
    "ros1-lz4": lambda p, f: write_ros1(p / "a.bag", f, "lz4"),
    "ros2": lambda p, f: write_ros2(p / "bag", f),
    "ros2-packed": lambda p, f: write_ros2(p / "bag", f, packing="message"),
    "ros2-mcap": lambda p, f: write_ros2(p / "bag", f, mcap=True),
    "mcap": lambda p, f: write_mcap(p / "a.mcap", f),
    "mcap-lz4": lambda p, f: write_mcap(p / "a.mcap", f, "lz4"),
    "mcap-plain": lambda p, f: write_mcap(p / "a.mcap", f, ""),
}


def columns_of(recording: Recording, name: str) -> dict[str, np.ndarray]:
    pieces = list(recording.samples(name))
    found = {n: np.concatenate([p.columns[n] for p in pieces]) for n in pieces[0].columns}
    return {**found, "primary": np.concatenate([p.primary_ns for p in pieces])}


@pytest.mark.parametrize("writer", WRITERS)
def test_a_flight_is_read_as_it_was_written(tmp_path: Path, writer: str) -> None:
    recording = open_recording(WRITERS[writer](tmp_path, MADE))
    streams = {s.name: s for s in recording.streams()}
    assert recording.incomplete is None
    assert set(streams) == {"/fix", "/imu", "/odom"}
    for stream in streams.values():
        assert (stream.messages, stream.timeline, stream.partial) == (len(MADE), "utc", False)
        assert stream.stamps is not None
        assert (stream.stamps.primary, stream.stamps.secondary) == ("header.stamp", "log time")
        assert stream.stamps.primary_ns.tolist() == MADE.stamp_ns.tolist()
        assert stream.stamps.secondary_ns is not None
        late = stream.stamps.secondary_ns - stream.stamps.primary_ns
        assert set(late.tolist()) == {4_000_000}
    fix, imu, odom = (columns_of(recording, n) for n in ("/fix", "/imu", "/odom"))
    globe = np.stack([fix[n] for n in ("latitude_deg", "longitude_deg", "height_m")], axis=1)
    np.testing.assert_array_equal(globe, geodetic(MADE.place))
    turn = np.stack([imu[f"quaternion_{a}"] for a in "xyzw"], axis=1)
    np.testing.assert_allclose(turn, ros_quaternion(MADE.turn), atol=1e-15)
    np.testing.assert_allclose(odom["position_x_m"], MADE.place[:, 1], atol=1e-12)  # east
    np.testing.assert_allclose(odom["rate_y_radps"], -MADE.rate[:, 1], atol=1e-12)
    assert (streams["/fix"].frame, streams["/imu"].body) == ("wgs84", "flu")
    assert odom["primary"].tolist() == MADE.stamp_ns.tolist()


@pytest.mark.parametrize("writer", ["ros1", "ros1-lz4", "mcap", "mcap-plain"])
def test_a_cut_file_is_read_up_to_its_last_good_message(tmp_path: Path, writer: str) -> None:
    path = WRITERS[writer](tmp_path, MADE)
    data = path.read_bytes()
    whole = {s.name: stamps_of(s) for s in open_recording(path).streams()}
    counts = []
    for at in np.linspace(len(data) * 0.02, len(data) - 1, 12).astype(int):
        path.write_bytes(data[:at])
        recording = open_recording(path)
        try:
            streams = recording.streams()
        except BadInput:
            counts.append(0)
            continue
        for stream in streams:
            assert stamps_of(stream) == whole[stream.name][: stream.messages]
        counts.append(sum(s.messages for s in streams))
        if counts[-1] < 3 * len(MADE):
            assert recording.incomplete is not None
            assert recording.incomplete.messages == counts[-1]
            assert all(s.partial for s in streams)
    assert counts == sorted(counts)
    assert counts[-1] == 3 * len(MADE)
    assert len(set(counts)) > 2


def test_a_database_shorter_than_its_head_says_is_read_as_far_as_it_goes(tmp_path: Path) -> None:
    (path,) = write_ros2(tmp_path / "bag", MADE).glob("*.db3")
    whole = {s.name: stamps_of(s) for s in open_recording(path).streams()}
    data = path.read_bytes()
    counts = []
    for share in (0.5, 0.8):
        cut = tmp_path / f"{share}.db3"
        cut.write_bytes(data[: int(share * len(data))])
        recording = open_recording(cut)
        streams = recording.streams()
        for stream in streams:
            assert stamps_of(stream) == whole[stream.name][: stream.messages]
        assert recording.incomplete is not None
        assert all(s.partial for s in streams)
        counts.append(sum(s.messages for s in streams))
    assert 0.3 * 3 * len(MADE) < counts[0] < counts[1] < 3 * len(MADE)


def stamps_of(stream: Stream) -> list[int]:
    assert stream.stamps is not None
    stamps: list[int] = stream.stamps.primary_ns.tolist()
    return stamps


@pytest.mark.parametrize("writer", ["ros1", "ros1-bz2", "ros2", "mcap", "mcap-lz4"])
def test_changed_bytes_are_told_or_harmless(tmp_path: Path, writer: str) -> None:
    """Nothing but BadInput comes out of a file with some bytes changed, and no more messages."""
    path = WRITERS[writer](tmp_path, flight(2.0))
    path = next(path.glob("*.db3")) if path.is_dir() else path
    data = path.read_bytes()
    draw = np.random.default_rng(16)
    refused = 0
    for _ in range(8):
        bad = bytearray(data)
        for at in draw.integers(13, len(data), 3):
            bad[at] = int(draw.integers(256))
        path.write_bytes(bytes(bad))
        try:
            recording = open_recording(path)
            streams = recording.streams()
            for stream in streams:
                list(recording.samples(stream.name))
        except BadInput:
            refused += 1
            continue
        assert sum(s.messages for s in streams) <= 60
    assert refused < 8


@pytest.mark.parametrize("bit", [17, 33, 40, 62, 63])
def test_a_bag_whose_header_tells_no_place_of_its_index_is_read_from_the_front(
    tmp_path: Path, bit: int
) -> None:
    """One changed bit of index_pos: no message is behind it, and nothing was cut off."""
    path = write_ros1(tmp_path / "a.bag", flight(2.0))
    data = path.read_bytes()
    at = data.index(b"index_pos=") + len(b"index_pos=")
    (index,) = struct.unpack_from("<Q", data, at)
    assert not index >> bit & 1
    path.write_bytes(data[:at] + struct.pack("<Q", index | 1 << bit) + data[at + 8 :])
    recording = open_recording(path)
    assert {s.name: s.messages for s in recording.streams()} == dict.fromkeys(
        ("/fix", "/imu", "/odom"), 20
    )
    assert recording.incomplete is not None
    assert "index" in recording.incomplete.reason
    assert "cut off" not in recording.incomplete.reason


@pytest.mark.parametrize("write", [write_ros1, write_mcap, write_ulog])
def test_the_top_bit_of_any_position_or_length_is_damage(
    tmp_path: Path, write: Callable[[Path, Flight], Path]
) -> None:
    """Heads and ends of files hold positions and times of 64 bits: read, or refused."""
    path = write(tmp_path / "a.log", flight(1.0))
    data = path.read_bytes()
    changed = sorted({*range(13, 150), *range(len(data) - 300, len(data))})
    for at in changed:
        path.write_bytes(data[:at] + bytes([data[at] ^ 0x80]) + data[at + 1 :])
        try:
            open_recording(path).streams()
        except BadInput:
            continue


def test_a_bomb_is_refused_before_it_unpacks(tmp_path: Path) -> None:
    """A chunk that says 250 MB, many times: 8 kB each."""
    import bz2

    zeros = bz2.compress(bytes(1 << 20))
    head = record(b"\x03", struct.pack("<Q", 0), b"index_pos")
    chunk = fields(op=b"\x05", compression=b"bz2", size=struct.pack("<I", 250_000_000))
    one = struct.pack("<I", len(chunk)) + chunk + struct.pack("<I", len(zeros)) + zeros
    path = tmp_path / "bomb.bag"
    path.write_bytes(b"#ROSBAG V2.0\n" + head + one * 40)
    with pytest.raises(BadInput) as caught:
        open_recording(path).streams()
    assert "can be read" in str(caught.value) or "unpacks to too much" in str(caught.value)
    chunk = fields(op=b"\x05", compression=b"bz2", size=struct.pack("<I", 4_000_000_000))
    one = struct.pack("<I", len(chunk)) + chunk + struct.pack("<I", len(zeros)) + zeros
    path.write_bytes(b"#ROSBAG V2.0\n" + head + one)
    with pytest.raises(BadInput, match="unpacks to too much"):
        open_recording(path).streams()


def fields(**named: bytes) -> bytes:
    return b"".join(
        struct.pack("<I", len(k) + 1 + len(v)) + k.encode() + b"=" + v for k, v in named.items()
    )


def record(op: bytes, value: bytes, name: bytes) -> bytes:
    head = fields(op=op, **{name.decode(): value})
    return struct.pack("<I", len(head)) + head + struct.pack("<I", 0)


def test_a_database_that_is_no_bag_is_refused(tmp_path: Path) -> None:
    import sqlite3

    path = tmp_path / "other.db3"
    with sqlite3.connect(path) as file:
        file.execute("CREATE TABLE topics(id, name, type, serialization_format)")
        file.execute(
            "CREATE VIEW messages AS WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i+1 FROM n)"
            " SELECT 1 AS topic_id, i AS timestamp, x'00' AS data, i AS id FROM n"
        )
    with pytest.raises(BadInput, match="a database, but no bag"):
        open_recording(path).streams()


def test_a_folder_never_leads_out_of_itself(tmp_path: Path) -> None:
    bag = write_ros2(tmp_path / "bag", flight(1.0))
    (own,) = bag.glob("*.db3")
    own.rename(tmp_path / "elsewhere.db3")
    (bag / "elsewhere.db3").symlink_to(tmp_path / "elsewhere.db3")
    text = (bag / "metadata.yaml").read_text("utf-8").replace(own.name, "elsewhere.db3")
    (bag / "metadata.yaml").write_text(text, "utf-8")
    with pytest.raises(BadInput, match="outside the bag's folder"):
        open_recording(bag).streams()


def test_one_damaged_file_of_several_hides_no_other(tmp_path: Path) -> None:
    bag = write_ros2(tmp_path / "bag", MADE)
    (own,) = bag.glob("*.db3")
    (bag / "bag_1.db3").write_bytes(b"SQLite format 3\x00 and nothing else")
    text = (bag / "metadata.yaml").read_text("utf-8")
    text = text.replace(f"- {own.name}\n", f"- bag_1.db3\n  - {own.name}\n", 1)
    (bag / "metadata.yaml").write_text(text, "utf-8")
    recording = open_recording(bag)
    streams = recording.streams()
    assert sum(s.messages for s in streams) == 3 * len(MADE)
    assert recording.incomplete is not None
    assert "bag_1.db3" in recording.incomplete.reason


def test_the_time_limit_passes_through_whatever_unpacks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A signal may strike while a message is unpacked: that is no foreign message."""
    from syncline_design.logs.readers import ros_recording
    from syncline_design.logs.readers.ros_types import MessageType
    from syncline_design.machine.deadline import OutOfTime

    def struck(_: bytes) -> object:
        raise OutOfTime("over")

    struck_type = MessageType("", "ros1", {}, struck)
    monkeypatch.setattr(ros_recording, "type_of", lambda *_: struck_type)
    with pytest.raises(OutOfTime):
        open_recording(write_ros1(tmp_path / "a.bag", flight(1.0))).streams()


@pytest.mark.parametrize("writer", ["ros1", "ros2", "mcap"])
def test_streams_read_together_are_the_streams_read_alone(tmp_path: Path, writer: str) -> None:
    from syncline_design.logs.run_parts import KnownRecording, pieces_of

    recording = KnownRecording(open_recording(WRITERS[writer](tmp_path, MADE)))
    joined: dict[str, list[np.ndarray]] = {}
    for name, piece in pieces_of(recording, ["/fix", "/odom"]):
        joined.setdefault(name, []).append(np.stack(list(piece.columns.values())))
    assert set(joined) == {"/fix", "/odom"}
    for name, pieces in joined.items():
        alone = columns_of(recording, name)
        del alone["primary"]
        np.testing.assert_array_equal(
            np.concatenate(pieces, axis=1), np.stack(list(alone.values()))
        )


def test_stamps_of_large_messages_are_those_of_their_whole(tmp_path: Path) -> None:
    """Listing reads the beginnings of large messages alone; samples and stamps stay the same."""
    from rosbags.rosbag2 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    kinds, name = store.types, "sensor_msgs/msg/CompressedImage"
    with Writer(tmp_path / "bag", version=9) as writer:
        made = writer.add_connection("/camera", name, typestore=store)
        for k in range(40):
            stamp = kinds["builtin_interfaces/msg/Time"](sec=1_700_000_000 + k, nanosec=7 * k)
            head = kinds["std_msgs/msg/Header"](stamp=stamp, frame_id="camera")
            image = kinds[name](header=head, format="jpeg", data=np.full(90_000, k, np.uint8))
            writer.write(
                made, (1_700_000_000 + k) * 10**9 + 10**7, store.serialize_cdr(image, name)
            )
    (stream,) = open_recording(tmp_path / "bag").streams()
    assert stamps_of(stream) == [(1_700_000_000 + k) * 10**9 + 7 * k for k in range(40)]
    pieces = list(open_recording(tmp_path / "bag").samples("/camera"))
    assert np.concatenate([p.primary_ns for p in pieces]).tolist() == stamps_of(stream)
