"""Broken and hostile bags, MCAP files, flight logs: each ends as said, and nothing is written."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from syncline_design.cli.app import app
from syncline_design.logs.readers import open_recording
from syncline_design.spec.load import BadInput
from tests.flight_logs import (
    flight,
    ulog_bytes,
    ulog_record,
    write_mcap,
    write_ros1,
    write_ros2,
)
from tests.test_diagnose_recordings import spec

MADE = flight(2.0)
MCAP_MAGIC = b"\x89MCAP0\r\n"
ULOG_HEAD = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 1)
BAG_MAGIC = b"#ROSBAG V2.0\n"


def bag_record(data: bytes = b"", **fields: bytes) -> bytes:
    head = b"".join(
        struct.pack("<I", len(k) + 1 + len(v)) + k.encode() + b"=" + v for k, v in fields.items()
    )
    return struct.pack("<I", len(head)) + head + struct.pack("<I", len(data)) + data


def bag_head(index: int = 0) -> bytes:
    return bag_record(op=b"\x03", index_pos=struct.pack("<Q", index))


def mcap_record(kind: int, data: bytes) -> bytes:
    return struct.pack("<BQ", kind, len(data)) + data


def text(value: str) -> bytes:
    return struct.pack("<I", len(value)) + value.encode()


def chunk(size: int, packing: str, data: bytes, crc: int = 0) -> bytes:
    head = struct.pack("<QQQI", 0, 1, size, crc) + text(packing)
    return mcap_record(6, head + struct.pack("<Q", len(data)) + data)


def mcap_head() -> bytes:
    return MCAP_MAGIC + mcap_record(1, text("ros2") + text("test"))


def zstd(data: bytes) -> bytes:
    import zstandard

    packed: bytes = zstandard.ZstdCompressor().compress(data)
    return packed


def lz4(data: bytes) -> bytes:
    import lz4.frame

    packed: bytes = lz4.frame.compress(data)
    return packed


def whole_bag(folder: Path) -> bytes:
    path = folder / "whole.bag"
    return (path if path.exists() else write_ros1(path, MADE)).read_bytes()


def whole_mcap(folder: Path) -> bytes:
    return write_mcap(folder / "whole.mcap", MADE).read_bytes()


def message(channel: int) -> bytes:
    return mcap_record(5, struct.pack("<HIQQ", channel, 0, 1, 1) + b"data")


def connection(number: int, **own: bytes) -> bytes:
    data = bag_record(**own)[4:-4]
    return bag_record(data, op=b"\x07", conn=struct.pack("<I", number), topic=b"/a")


UNREADABLE: dict[str, Callable[[Path], bytes]] = {
    "bag: the magic alone": lambda _: BAG_MAGIC,
    "bag: closed without a message": lambda _: BAG_MAGIC + bag_head(len(BAG_MAGIC + bag_head())),
    "bag: no bag header": lambda _: BAG_MAGIC + bag_record(op=b"\x05"),
    "bag: header longer than any": lambda _: BAG_MAGIC + b"\xff\xff\xff\x7f" * 4,
    "bag: field without a name": lambda _: BAG_MAGIC
    + struct.pack("<II", 8, 4)
    + b"none"
    + bytes(4),
    "bag: message of no connection": lambda _: BAG_MAGIC
    + bag_head()
    + bag_record(b"x", op=b"\x02", conn=bytes(4), time=bytes(8)),
    "bag: chunk without size": lambda _: BAG_MAGIC
    + bag_head()
    + bag_record(b"x", op=b"\x05", compression=b"none"),
    "bag: chunk of 4 GB": lambda _: BAG_MAGIC
    + bag_head()
    + bag_record(b"x", op=b"\x05", compression=b"lz4", size=b"\xff\xff\xff\xff"),
    "bag: chunk packed as nobody does": lambda _: BAG_MAGIC
    + bag_head()
    + bag_record(b"x", op=b"\x05", compression=b"rar", size=struct.pack("<I", 1)),
    "bag: chunk of garbage": lambda _: BAG_MAGIC
    + bag_head()
    + bag_record(b"\x00" * 64, op=b"\x05", compression=b"bz2", size=struct.pack("<I", 10)),
    "bag: record beyond its chunk": lambda _: BAG_MAGIC
    + bag_head()
    + bag_record(
        struct.pack("<I", 500) + b"x", op=b"\x05", compression=b"none", size=struct.pack("<I", 5)
    ),
    "bag: a topic of 100 kB": lambda _: BAG_MAGIC
    + bag_head()
    + bag_record(
        bag_record(type=b"a/B", md5sum=b"*")[4:-4], op=b"\x07", conn=bytes(4), topic=b"/a" * 50_000
    )
    + bag_record(b"x", op=b"\x02", conn=bytes(4), time=bytes(8)),
    "bag: zeros": lambda _: BAG_MAGIC + bytes(5000),
    "bag: version 1": lambda _: b"#ROSBAG V1.1\n" + bytes(500),
    "mcap: the magic alone": lambda _: MCAP_MAGIC,
    "mcap: record of 2^60 bytes": lambda _: mcap_head() + struct.pack("<BQ", 6, 1 << 60),
    "mcap: message of no channel": lambda _: mcap_head() + message(7),
    "mcap: bomb by its own word": lambda _: mcap_head() + chunk(1 << 40, "zstd", zstd(b"x")),
    "mcap: bomb that hides": lambda _: mcap_head() + chunk(10, "zstd", zstd(bytes(50_000_000))),
    "mcap: lz4 bomb that hides": lambda _: mcap_head() + chunk(10, "lz4", lz4(bytes(50_000_000))),
    "mcap: chunk of zeros": lambda _: mcap_head() + chunk(90_000, "zstd", zstd(bytes(90_000))),
    "mcap: chunk of garbage": lambda _: mcap_head() + chunk(10, "zstd", b"\x01" * 40),
    "mcap: wrong checksum": lambda _: mcap_head() + chunk(9, "", message(1)[:9], zlib.crc32(b"x")),
    "mcap: packed as nobody does": lambda _: mcap_head() + chunk(4, "brotli", b"abcd"),
    "mcap: schema that is no text": lambda _: mcap_head()
    + mcap_record(3, struct.pack("<H", 1) + b"\xff\xff\xff\x7f"),
    "ulog: the head alone": lambda _: ULOG_HEAD,
    "ulog: cut in the head": lambda _: ULOG_HEAD[:9],
    "ulog: data of no topic": lambda _: ULOG_HEAD + ulog_record("D", b"\x05\x00" + bytes(30)),
    "ulog: subscription of no format": lambda _: ULOG_HEAD
    + ulog_record("A", b"\x00\x01\x00nothing"),
    "ulog: field of no type": lambda _: ULOG_HEAD
    + ulog_record("F", b"a:uint64_t timestamp;quaternion q")
    + ulog_record("A", b"\x00\x01\x00a"),
    "ulog: array of a billion": lambda _: ULOG_HEAD
    + ulog_record("F", b"a:uint64_t timestamp;uint8_t[1000000000] x")
    + ulog_record("A", b"\x00\x01\x00a"),
    "ulog: no timestamp": lambda _: ULOG_HEAD
    + ulog_record("F", b"a:float x")
    + ulog_record("A", b"\x00\x01\x00a"),
    "ulog: more topics than any": lambda _: ULOG_HEAD
    + ulog_record("F", b"a:uint64_t timestamp")
    + b"".join(ulog_record("A", struct.pack("<BH", 0, k) + b"a") for k in range(3000))
    + ulog_record("D", bytes(10)),
    "ulog: zeros": lambda _: ULOG_HEAD + bytes(1000),
    "database: SQLite's magic alone": lambda _: b"SQLite format 3\x00",
    "database: pages of garbage": lambda _: b"SQLite format 3\x00" + bytes(range(256)) * 40,
}  # fmt: skip
PARTLY: dict[str, Callable[[Path], bytes]] = {
    "bag: cut in its last third": lambda f: whole_bag(f)[: len(whole_bag(f)) * 2 // 3],
    "bag: garbage behind the chunks": lambda f: whole_bag(f)[: len(whole_bag(f)) // 2]
    + b"\xff" * 100,
    "mcap: cut in its last third": lambda f: whole_mcap(f)[: len(whole_mcap(f)) * 2 // 3],
    "mcap: no end": lambda f: whole_mcap(f)[: whole_mcap(f).rindex(MCAP_MAGIC) - 60],
    "ulog: cut within a record": lambda _: ulog_bytes(MADE)[:-5],
    "ulog: garbage at the end": lambda _: ulog_bytes(MADE) + b"\x00" * 40,
}  # fmt: skip
SUFFIX = {"bag": ".bag", "mcap": ".mcap", "ulog": ".ulg", "database": ".db3"}


def inspected(path: Path) -> tuple[int, str, str]:
    folder = path.parent
    mapped = folder / "mapped.yaml"
    words = ["log", "inspect", str(path), "--spec", str(spec(folder)), "--write-spec", str(mapped)]
    result = CliRunner().invoke(app, [*words, "--output", f"json:{folder / 'out.json'}"])
    assert "Traceback" not in result.stderr + result.stdout
    assert "internal error" not in result.stderr
    if result.exit_code == 2:
        assert not mapped.exists()
    return result.exit_code, result.stdout, result.stderr


@pytest.mark.parametrize("name", UNREADABLE)
def test_what_holds_nothing_is_refused_in_one_line(tmp_path: Path, name: str) -> None:
    path = tmp_path / f"broken{SUFFIX[name.partition(':')[0]]}"
    path.write_bytes(UNREADABLE[name](tmp_path))
    code, _, said = inspected(path)
    assert code == 2
    lines = [line for line in said.splitlines() if str(path) in line]
    assert len(lines) == 1, said
    assert len(lines[0]) < 700


@pytest.mark.parametrize("name", PARTLY)
def test_what_is_cut_is_read_in_part(tmp_path: Path, name: str) -> None:
    path = tmp_path / f"broken{SUFFIX[name.partition(':')[0]]}"
    path.write_bytes(PARTLY[name](tmp_path))
    code, out, _ = inspected(path)
    assert code == 0
    assert "Read in part" in out


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda bag: (bag / "metadata.yaml").write_text("- just\n- a list\n"), "no metadata"),
        (lambda bag: (bag / "metadata.yaml").write_text("{" * 3000), "no metadata"),
        (lambda bag: next(bag.glob("*.db3")).unlink(), "can be read"),
        (lambda bag: next(bag.glob("*.db3")).write_bytes(b""), "can be read"),
    ],
    ids=["metadata of another kind", "metadata that nests", "no file", "an empty file"],
)
def test_a_broken_folder_is_refused(
    tmp_path: Path, change: Callable[[Path], object], message: str
) -> None:
    bag = write_ros2(tmp_path / "bag", MADE)
    change(bag)
    code, _, said = inspected(bag)
    assert code == 2
    assert message in said


def test_a_bag_compressed_as_a_whole_says_what_to_do(tmp_path: Path) -> None:
    bag = write_ros2(tmp_path / "bag", MADE)
    own = next(bag.glob("*.db3"))
    own.write_bytes(zstd(own.read_bytes()))
    code, _, said = inspected(bag)
    assert code == 2
    assert f"zstd -d {own.name}" in said


@pytest.mark.parametrize("packing", ["", "lz4", "zstd"])
def test_a_chunk_that_ends_with_the_file_is_read_as_far_as_it_unpacks(
    tmp_path: Path, packing: str
) -> None:
    """One chunk of 3000 noisy messages, cut in the middle: those before the cut are read."""
    from mcap.writer import CompressionType, Writer

    kinds = {"": CompressionType.NONE, "lz4": CompressionType.LZ4, "zstd": CompressionType.ZSTD}
    noise = np.random.default_rng(1).bytes(3000 * 200)
    path = tmp_path / "one.mcap"
    with path.open("wb") as file:
        writer = Writer(file, compression=kinds[packing], chunk_size=1 << 24)
        writer.start()
        channel = writer.register_channel("/a", "raw", 0)
        for k in range(3000):
            writer.add_message(
                channel, 10**9 + 1000 * k, noise[200 * k : 200 * (k + 1)], 10**9 + 1000 * k
            )
        writer.finish()
    path.write_bytes(path.read_bytes()[:300_000])
    recording = open_recording(path)
    (stream,) = recording.streams()
    assert stream.partial
    # a message takes 31 bytes more than its data; blocks of up to 128 KB may be lost
    assert stream.messages == 1298 if not packing else 500 < stream.messages < 1500
    assert stream.stamps is not None
    logged = stream.stamps.primary_ns
    np.testing.assert_array_equal(logged, 10**9 + 1000 * np.arange(stream.messages))
    assert recording.incomplete is not None
    assert "within a chunk" in recording.incomplete.reason


@pytest.mark.parametrize(("name", "start"), [
    ("a.bag", b"#ROSBAG V2.0\n\x45\x00\x00\x00"), ("a.mcap", b"\x89MCAP0\r\n\x01"),
    ("a.ulg", b"ULog\x01\x12\x35\x01" + bytes(8) + b"\x05\x00F"),
])  # fmt: skip
def test_a_file_cut_in_its_head_is_refused_with_what_to_do(
    tmp_path: Path, name: str, start: bytes
) -> None:
    path = tmp_path / name
    path.write_bytes(start)
    with pytest.raises(BadInput, match="copy the file once more"):
        open_recording(path).streams()
