"""MCAP files, chunk by chunk, within limits on what a chunk may unpack to."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import Any

from syncline_design.logs.readers.reader import BY_MAGIC, NO, FileHead, Reader, library
from syncline_design.logs.readers.ros_recording import (
    Container,
    DamagedError,
    RawMessage,
    RosRecording,
    UnpackBudget,
    from_lz4,
)
from syncline_design.logs.readers.ros_types import BagChannel, Encoding, modern

MAGIC = b"\x89MCAP0\r\n"
FORMAT = "MCAP file"
MOST_RECORD = 1 << 28
FOOTER, MESSAGE, CHUNK = 2, 5, 6  # the kind of record
DEFINING = (3, 4)  # schemas and channels, which stand among the messages of a chunk
_RECORD = struct.Struct("<BQ")  # kind, length
_FOOTER = struct.Struct("<QQI")  # where the index and its offsets begin, checksum
_MESSAGE = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time
_CHUNK = struct.Struct(
    "<QQQII"
)  # first and last time, size, checksum, length of the packing's name
ENCODINGS: dict[tuple[str, str], Encoding] = {
    ("cdr", "ros2msg"): "cdr",
    ("cdr", "ros2idl"): "cdr",
    ("cdr", ""): "cdr",
    ("ros1", "ros1msg"): "ros1",
}


class _CutShortError(DamagedError):
    """The file ends within a record."""


class McapFile(Container):
    """The records of one file, by the mcap library, its chunks unpacked here."""

    def __init__(self, path: Path) -> None:
        super().__init__(path, FORMAT)
        self._size = path.stat().st_size

    def _read(self) -> Iterator[RawMessage]:
        self._records: Any = library("mcap.records", self.path, FORMAT)
        self._stream: Any = library("mcap.stream_reader", self.path, FORMAT)
        self._schemas: dict[int, tuple[str, str, str]] = {}
        self._channels: dict[int, BagChannel] = {}
        self._chunks: list[int] | None = None
        budget = UnpackBudget(self.path, self._size)
        ended = False
        with self.path.open("rb") as file:
            try:
                for record in self._outer(file):
                    if isinstance(record, self._records.Chunk):
                        yield from self._sound(self._of_packed(record, budget))
                        if self.lost.chunks:
                            self._indexed(file)
                    elif isinstance(record, self._records.DataEnd):
                        ended = True
                        break
                    else:
                        yield from self._one(record)
            except _CutShortError:
                yield from self._of_cut(file, budget)
                raise
            file.seek(0, 2)
            file.seek(max(file.tell() - len(MAGIC), 0))
            whole = file.read() == MAGIC
        if ended and not whole:
            raise DamagedError("cut off behind its data; no message is missing")
        if not ended:
            raise DamagedError("the file was not closed: its data have no end")

    def _outer(self, file: Any) -> Iterator[Any]:
        """The records of the file; behind one that is none, those from the next chunk on."""
        at, begins = 0, True
        while True:
            try:
                for record in self._of(file, whole=True, magic=begins):
                    at = file.tell()
                    yield record
                return
            except DamagedError as damage:
                later = [one for one in self._indexed(file) if at < one < self._size]
                if not later:
                    raise
                self.lost.add(damage)
                begins, at = False, min(later)
                file.seek(at)

    def _indexed(self, file: Any) -> list[int]:
        """Where chunks begin, by the file's index, whose channels count where theirs were lost."""
        if self._chunks is not None:
            return self._chunks
        self._chunks, known, here = [], dict(self._channels), file.tell()
        try:
            file.seek(max(self._size - len(MAGIC) - _RECORD.size - _FOOTER.size, 0))
            kind, _ = _RECORD.unpack(file.read(_RECORD.size))
            begins = _FOOTER.unpack(file.read(_FOOTER.size))[0] if kind == FOOTER else 0
            if 0 < begins < self._size:  # beyond 63 bits no file offset
                file.seek(begins)
                for record in self._of(file, whole=False):
                    if isinstance(record, self._records.ChunkIndex):
                        self._chunks.append(int(record.chunk_start_offset))
                    elif isinstance(record, (self._records.Schema, self._records.Channel)):
                        list(self._one(record))
        except (DamagedError, struct.error, OSError):
            self._chunks = []
        self._channels |= known  # as they were: a topic is known by its channel
        file.seek(here)
        return self._chunks

    def _of_packed(self, chunk: Any, budget: UnpackBudget) -> Iterator[RawMessage]:
        yield from self._of_chunk(self._unpacked(chunk, budget))

    def _of_cut(self, file: Any, budget: UnpackBudget) -> Iterator[RawMessage]:
        """What the beginning of a chunk holds that ends with the file; no checksum covers it."""
        at = len(MAGIC)
        file.seek(at)
        while len(head := file.read(_RECORD.size)) == _RECORD.size:
            kind, length = _RECORD.unpack(head)
            if at + _RECORD.size + length > self._size:
                break
            at += _RECORD.size + length
            file.seek(at)
        else:
            return
        body = file.read(min(length, MOST_RECORD)) if kind == CHUNK else b""
        if len(body) < _CHUNK.size:
            return
        *_, due, _, named = _CHUNK.unpack_from(body)
        begins = _CHUNK.size + named + 8
        packing = body[_CHUNK.size : _CHUNK.size + named].decode("ascii", "replace")
        budget.spend(due, MOST_RECORD)
        try:
            yield from self._of_chunk(self._plain(packing, body[begins:], due)[:due])
        except DamagedError:
            raise _CutShortError("cut off within a chunk, whose checksum is lost") from None

    def _of_chunk(self, data: bytes) -> Iterator[RawMessage]:
        """The records of an unpacked chunk; messages are taken apart here, which is quicker."""
        at, end = 0, len(data)
        while at < end:
            if at + _RECORD.size > end:
                raise DamagedError("cut off within a record of a chunk")
            kind, length = _RECORD.unpack_from(data, at)
            body, at = at + _RECORD.size, at + _RECORD.size + length
            if at > end:
                raise DamagedError("a record reaches beyond its chunk")
            if kind != MESSAGE:
                if not kind:
                    raise DamagedError("a record of no kind")
                if kind not in DEFINING:  # nothing else belongs here; what is new is passed over
                    continue
                for inner in self._of(BytesIO(data[body - _RECORD.size : at]), whole=False):
                    yield from self._one(inner)
                continue
            if length < _MESSAGE.size:
                raise DamagedError("a message without its times")
            number, _, log_ns, publish_ns = _MESSAGE.unpack_from(data, body)
            channel = self._channels.get(number)
            if channel is None:
                if not self.lost.chunks:
                    raise DamagedError("a message of no known channel")
                self.lost.orphans += 1
                continue
            if self.wanted is None or channel.topic in self.wanted:
                yield RawMessage(channel, log_ns, publish_ns, data[body + _MESSAGE.size : at])

    def _of(self, file: Any, whole: bool, magic: bool = False) -> Iterator[Any]:
        """The records of a file, which has an end of its own, or some of a part, which has none."""
        exceptions = library("mcap.exceptions", self.path, FORMAT)
        reader = self._stream.StreamReader(
            file, skip_magic=not magic, emit_chunks=True, record_size_limit=MOST_RECORD
        )
        try:
            yield from reader.records
        except exceptions.EndOfFile:
            if whole:
                raise _CutShortError("cut off within a record") from None
        except exceptions.McapError as error:
            raise DamagedError(str(error)[:160] or type(error).__name__) from None
        except (ValueError, struct.error, UnicodeDecodeError, OverflowError, MemoryError) as error:
            raise DamagedError(f"a record cannot be read: {str(error)[:120]}") from None

    def _one(self, record: Any) -> Iterator[RawMessage]:
        if isinstance(record, self._records.Message):
            channel = self._channels.get(record.channel_id)
            if channel is None:
                raise DamagedError("a message of no known channel")
            if self.wanted is not None and channel.topic not in self.wanted:
                return
            yield RawMessage(channel, record.log_time, record.publish_time, record.data)
        elif isinstance(record, self._records.Schema):
            text = record.data.decode("utf-8", "replace")
            self._schemas[record.id] = (record.name, record.encoding, text)
        elif isinstance(record, self._records.Channel):
            self._channels[record.id] = self._channel(record)

    def _channel(self, record: Any) -> BagChannel:
        name, encoding, text = self._schemas.get(record.schema_id, ("", "", ""))
        found = ENCODINGS.get((record.message_encoding, encoding), "other")
        kind = modern(name) if found != "other" else name
        return BagChannel(record.topic, kind, found, text, record.message_encoding)

    def _unpacked(self, chunk: Any, budget: UnpackBudget) -> bytes:
        due = int(chunk.uncompressed_size)
        budget.spend(due, MOST_RECORD)
        plain = self._plain(str(chunk.compression), bytes(chunk.data), due)
        if len(plain) != due:
            raise DamagedError("a chunk does not unpack to its size")
        self._demand_sum(chunk, plain)
        return plain

    def _plain(self, packing: str, data: bytes, due: int) -> bytes:
        """As much as the data unpack to, one byte above what is due at most."""
        if packing == "zstd":
            return _from_zstd(data, due, self.path)
        if packing == "lz4":
            return from_lz4(data, due, self.path, FORMAT)
        if packing == "":
            return data
        raise DamagedError(f"a chunk packed as {packing[:20]!r}")

    def _demand_sum(self, chunk: Any, plain: bytes) -> None:
        import zlib

        if chunk.uncompressed_crc and zlib.crc32(plain) != chunk.uncompressed_crc:
            raise DamagedError("the checksum of a chunk is wrong")


def _from_zstd(data: bytes, due: int, path: Path) -> bytes:
    zstandard = library("zstandard", path, FORMAT)
    try:
        with zstandard.ZstdDecompressor().stream_reader(BytesIO(data)) as reader:
            plain: bytes = reader.read(due + 1)
    except zstandard.ZstdError:
        raise DamagedError("a chunk does not unpack") from None
    return plain


def _recognises(head: FileHead) -> int:
    return BY_MAGIC if head.start.startswith(MAGIC) else NO


READER = Reader(FORMAT, _recognises, lambda path: RosRecording(McapFile(path)))
