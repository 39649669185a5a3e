"""Damage within a file costs what it hits: chunks of bags and MCAP files, records of an SBET."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

from syncline_design.logs.readers import open_recording
from syncline_design.logs.readers.stream import Recording, Stream
from syncline_design.spec.load import BadInput
from tests.flat_flight_logs import write_sbet
from tests.flight_logs import flight

COUNT, EACH = 4000, 250  # messages of a topic, data bytes of one


def mcap(path: Path, packing: str) -> Path:
    """Two topics; the second begins in the second chunk, which alone declares it."""
    from mcap.writer import CompressionType, Writer

    kinds = {"": CompressionType.NONE, "lz4": CompressionType.LZ4, "zstd": CompressionType.ZSTD}
    draw = np.random.default_rng(4)
    with path.open("wb") as file:
        writer = Writer(file, compression=kinds[packing], chunk_size=100_000)
        writer.start()
        channels = {"/a": writer.register_channel("/a", "raw", 0)}
        for k in range(COUNT):
            if k == 600:
                channels["/b"] = writer.register_channel("/b", "raw", 0)
            for channel in channels.values():
                writer.add_message(channel, 10**9 + 1000 * k, draw.bytes(EACH), 10**9 + 1000 * k)
        writer.finish()
    return path


def chunks_of(path: Path) -> list[tuple[int, int, int, dict[str, int]]]:
    """Begin, end, first time and messages by topic of every chunk, by the library."""
    from mcap.reader import make_reader

    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
        assert summary is not None
        file.seek(0)
        read = make_reader(file).iter_messages()
        messages = [(channel.topic, one.log_time) for _, channel, one in read]
    found = []
    for one in summary.chunk_indexes:
        first, last = one.message_start_time, one.message_end_time
        inside = [topic for topic, time in messages if first <= time <= last]
        counts = {name: inside.count(name) for name in ("/a", "/b")}
        begins = one.chunk_start_offset
        found.append((begins, begins + one.chunk_length, first, counts))
    return found


def by_name(recording: Recording) -> dict[str, Stream]:
    return {stream.name: stream for stream in recording.streams()}


@pytest.mark.parametrize("packing", ["", "lz4", "zstd"])
@pytest.mark.parametrize("hit", [0, 2, 5])
def test_one_damaged_chunk_costs_itself(tmp_path: Path, packing: str, hit: int) -> None:
    path = mcap(tmp_path / "a.mcap", packing)
    whole = {name: one.messages for name, one in by_name(open_recording(path)).items()}
    chunks = chunks_of(path)
    begins, ends, _, _ = chunks[hit]
    raw = bytearray(path.read_bytes())
    raw[(begins + ends) // 2] ^= 0x55
    path.write_bytes(raw)
    recording = open_recording(path)
    left = {name: one.messages for name, one in by_name(recording).items()}
    assert recording.incomplete is not None
    assert "1 damaged chunk was left out" in recording.incomplete.reason
    lost = sum(whole.values()) - sum(left.values())
    most = max(sum(counts.values()) for *_, counts in chunks)
    assert 0 < lost <= most
    assert set(left) == set(whole)
    assert recording.incomplete.messages == sum(left.values())
    pieces = [piece.primary_ns for piece in recording.samples("/a")]
    assert sum(len(one) for one in pieces) == left["/a"]


def test_channels_that_stood_in_a_lost_chunk_are_the_index_s(tmp_path: Path) -> None:
    """The chunk that alone declares /b: its later messages are read all the same."""
    path = mcap(tmp_path / "a.mcap", "zstd")
    declares = next(one for one in chunks_of(path) if one[3]["/b"])
    raw = bytearray(path.read_bytes())
    raw[declares[1] - 200] ^= 0xFF
    path.write_bytes(raw)
    found = by_name(open_recording(path))
    assert set(found) == {"/a", "/b"}
    assert found["/b"].messages > COUNT - 600 - 400


def test_a_chunk_whose_frame_is_gone_is_jumped_over_by_the_index(tmp_path: Path) -> None:
    """NUL over the head of the fourth chunk: where the fifth begins the index tells."""
    path = mcap(tmp_path / "a.mcap", "lz4")
    chunks = chunks_of(path)
    whole = sum(sum(counts.values()) for *_, counts in chunks)
    raw = bytearray(path.read_bytes())
    raw[chunks[3][0] - 40 : chunks[3][0] + 60] = bytes(100)
    path.write_bytes(raw)
    left = sum(one.messages for one in open_recording(path).streams())
    assert left >= 0.9 * whole
    assert left < whole


@pytest.mark.parametrize("packing", ["none", "bz2", "lz4"])
def test_a_damaged_chunk_of_a_bag_costs_itself(tmp_path: Path, packing: str) -> None:
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    text = store.types["std_msgs/msg/String"]
    path = tmp_path / "a.bag"
    writer = Writer(path)
    if packing != "none":
        writer.set_compression(Writer.CompressionFormat[packing.upper()])
    draw = np.random.default_rng(6)
    with writer:
        topic = writer.add_connection("/a", text.__msgtype__, typestore=store)
        for k in range(20_000):
            data = store.serialize_ros1(text(data=draw.bytes(120).hex()), text.__msgtype__)
            writer.write(topic, 10**18 + 10**6 * k, data)
    (whole,) = open_recording(path).streams()
    assert whole.messages == 20_000
    raw = bytearray(path.read_bytes())
    at = len(raw) // 10
    raw[at : at + 3000] = b"\xff" * 3000
    path.write_bytes(raw)
    recording = open_recording(path)
    (left,) = recording.streams()
    assert recording.incomplete is not None
    assert "damaged chunk" in recording.incomplete.reason
    assert 0.5 * whole.messages < left.messages < whole.messages
    assert left.stamps is not None
    assert left.stamps.primary_ns[-1] == 10**18 + 10**6 * 19_999


SIZE = 17 * 8


@pytest.mark.parametrize("seed", range(4))
def test_impossible_records_of_an_sbet_are_counted(tmp_path: Path, seed: int) -> None:
    """Single records, blocks of NUL and noise: what is whole is read, at its own time."""
    path = write_sbet(tmp_path / "a.out", flight(120.0))
    raw = bytearray(path.read_bytes())
    times = np.frombuffer(bytes(raw), "<f8").reshape(-1, 17)[:, 0]
    draw = np.random.default_rng(seed)
    lost = set()
    for block in (bytes(SIZE), b"\xff" * SIZE, bytes(20 * SIZE), b"\xff" * (3 * SIZE)):
        k = int(draw.integers(100, len(times) - 100))
        rows = range(k, k + len(block) // SIZE)
        lost |= set(rows)
        raw[k * SIZE : k * SIZE + len(block)] = block
    path.write_bytes(raw)
    recording = open_recording(path)
    (stream,) = recording.streams()
    assert stream.messages == len(times) - len(lost)
    assert recording.incomplete is not None
    assert f"{len(lost)} records cannot be any" in recording.incomplete.reason
    assert stream.stamps is not None
    left_s = np.delete(times, sorted(lost))
    np.testing.assert_allclose(stream.stamps.primary_ns / 1e9, left_s, rtol=0, atol=1e-6)


def test_records_behind_lost_bytes_are_none(tmp_path: Path) -> None:
    """Eight bytes missing shift all that follows, which is no record by its time."""
    path = write_sbet(tmp_path / "a.out", flight(60.0))
    raw = path.read_bytes()
    at = 300 * SIZE
    path.write_bytes(raw[:at] + raw[at + 8 :])
    recording = open_recording(path)
    (stream,) = recording.streams()
    assert stream.messages <= 300
    assert recording.incomplete is not None


def test_utf_16_is_named(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_bytes("stamp_s,receive_s\n1,2\n3,4\n".encode("utf-16"))
    with pytest.raises(BadInput, match="UTF-16"):
        open_recording(path)
    assert struct.unpack("<H", path.read_bytes()[:2])[0] == 0xFEFF
