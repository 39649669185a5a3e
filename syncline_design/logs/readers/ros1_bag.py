"""ROS 1 bags (version 2.0), read from front to back, so that a bag without its index reads too.

Format: records of a header (length, then `name=value` fields) and data (length, then bytes); a
chunk's data are records again, plain or packed.  Source: wiki.ros.org/Bags/Format/2.0.
"""

from __future__ import annotations

import bz2
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from syncline_design.logs.readers.reader import BY_MAGIC, NO, FileHead, Reader
from syncline_design.logs.readers.ros_recording import (
    Container,
    DamagedError,
    RawMessage,
    RosRecording,
    UnpackBudget,
    from_lz4,
)
from syncline_design.logs.readers.ros_types import BagChannel, modern
from syncline_design.logs.refusals import refuse

MAGIC = b"#ROSBAG V2.0\n"
FORMAT = "ROS 1 bag"
MESSAGE, BAG_HEADER, CHUNK, CHUNK_INFO, CONNECTION = 2, 3, 5, 6, 7
MOST_HEADER = 1 << 20
MOST_RECORD = 1 << 28  # bytes of a chunk, and of what it unpacks to
_LENGTH = struct.Struct("<I")
_TIME = struct.Struct("<II")
Fields = dict[bytes, bytes]


class Ros1Bag(Container):
    """The records of one bag."""

    def __init__(self, path: Path) -> None:
        super().__init__(path, FORMAT)
        self._size = path.stat().st_size

    def _read(self) -> Iterator[RawMessage]:
        self._channels: dict[int, BagChannel] = {}
        self._chunks: list[int] | None = None
        budget = UnpackBudget(self.path, self._size)
        with self.path.open("rb") as file:
            file.seek(len(MAGIC))
            index = self._index_of(file)
            while (at := file.tell()) < (index or self._size):
                try:
                    yield from self._record(file, budget)
                except DamagedError as damage:
                    later = [k for k in self._indexed(file, index) if at < k < self._size]
                    if not later:
                        raise
                    self.lost.add(damage)
                    file.seek(min(later))
                if self.lost.chunks:
                    self._indexed(file, index)
        if not index:
            raise DamagedError("the bag was not closed: it has no index")

    def _record(self, file: BinaryIO, budget: UnpackBudget) -> Iterator[RawMessage]:
        """The messages of one record of the file."""
        fields, length = _record_head(file)
        operation = _operation(fields)
        if length > MOST_RECORD and length <= self._size - file.tell():
            most = f"at most {MOST_RECORD} bytes"
            raise refuse(self.path, "absurd length", expected=most, found=str(length))
        if operation == CHUNK:
            data = file.read(min(length, MOST_RECORD))
            cut = len(data) < length  # what is there of a cut chunk is read
            found = self._of_packed(data, fields, budget, cut)
            yield from found if cut else self._sound(found)
            if cut:
                raise DamagedError("cut off within a chunk")
        elif operation in (MESSAGE, CONNECTION):
            yield from self._one(operation, fields, _taken(file, length))
        else:
            if operation == CHUNK_INFO and self.cut:  # the index is here, and nothing cut off
                self.cut = "damaged: its index is not where the bag's header says"
            _skip(file, length, self._size)

    def _of_packed(
        self, data: bytes, fields: Fields, budget: UnpackBudget, cut: bool
    ) -> Iterator[RawMessage]:
        yield from self._of_chunk(_unpacked(data, fields, budget, self.path, cut))

    def _indexed(self, file: BinaryIO, index: int) -> list[int]:
        """Where chunks begin by the bag's index, whose connections count where theirs were lost."""
        if self._chunks is not None:
            return self._chunks
        self._chunks, known, here = [], dict(self._channels), file.tell()
        try:
            file.seek(min(index or self._size, self._size))  # no file offset: beyond 63 bits
            while file.tell() < self._size:
                fields, length = _record_head(file)
                data = _taken(file, length)
                if _operation(fields) == CONNECTION:
                    list(self._one(CONNECTION, fields, data))
                elif len(at := fields.get(b"chunk_pos", b"")) == 8:
                    self._chunks.append(struct.unpack("<Q", at)[0])
        except DamagedError:
            pass  # what the index tells up to its own damage
        self._channels |= known  # as they were: a topic is known by its channel
        file.seek(here)
        return self._chunks

    def _index_of(self, file: BinaryIO) -> int:
        """Where the index begins, which is where messages end; 0 in a bag that was not closed."""
        fields, length = _record_head(file)
        if _operation(fields) != BAG_HEADER:
            raise DamagedError("no bag header")
        _skip(file, length, self._size)
        at = fields.get(b"index_pos", b"")
        index = struct.unpack("<Q", at)[0] if len(at) == 8 else 0
        if index > self._size:
            self.cut = f"cut off: the index is due at byte {index} of {self._size}"
        return int(index)

    def _of_chunk(self, data: bytes) -> Iterator[RawMessage]:
        """Records of a chunk; message headers that look like the last one are not parsed anew."""
        at, end = 0, len(data)
        alike: _Alike | None = None
        while at < end:
            if alike is not None and at + alike.length + 8 <= end and alike.fits(data, at):
                body = at + alike.length + 4
                length = _LENGTH.unpack_from(data, body)[0]
                channel = self._channels.get(_LENGTH.unpack_from(data, at + alike.connection)[0])
                if channel is not None and body + 4 + length <= end:
                    seconds, rest = _TIME.unpack_from(data, at + alike.time)
                    at = body + 4 + length
                    if self.wanted is not None and channel.topic not in self.wanted:
                        continue
                    stamp = seconds * 1_000_000_000 + rest
                    yield RawMessage(channel, stamp, None, data[body + 4 : at])
                    continue
            begun = at
            fields, at = _fields_of(data, at)
            if fields.get(b"op") == bytes([MESSAGE]):
                alike = _Alike.of(data, begun, at, fields)
            length, at = _length_of(data, at)
            if at + length > end:
                raise DamagedError("a record reaches beyond its chunk")
            operation = _operation(fields)
            if operation in (MESSAGE, CONNECTION):
                yield from self._one(operation, fields, data[at : at + length])
            at += length

    def _one(self, operation: int, fields: Fields, data: bytes) -> Iterator[RawMessage]:
        number = fields.get(b"conn", b"")
        if len(number) != 4:
            raise DamagedError("a record without its connection")
        connection = _LENGTH.unpack(number)[0]
        if operation == CONNECTION:
            self._channels[connection] = _channel(fields, data)
            return
        time = fields.get(b"time", b"")
        if len(time) == 8 and connection not in self._channels and self.lost.chunks:
            self.lost.orphans += 1
            return
        if connection not in self._channels or len(time) != 8:
            raise DamagedError("a message of no known connection")
        seconds, rest = _TIME.unpack(time)
        yield RawMessage(self._channels[connection], seconds * 1_000_000_000 + rest, None, data)


class _Alike:
    """Where connection and time stand in a message's header: a writer's headers are all alike."""

    def __init__(self, head: bytes, connection: int, time: int) -> None:
        self.length = len(head) - 4
        self.connection, self.time = connection, time
        ends = sorted([(connection, connection + 4), (time, time + 8)])
        bounds = [0, *(edge for pair in ends for edge in pair), len(head)]
        self._fixed = [
            (a, b, head[a:b]) for a, b in zip(bounds[::2], bounds[1::2], strict=True) if a < b
        ]

    @staticmethod
    def of(data: bytes, begun: int, end: int, fields: Fields) -> _Alike | None:
        """By the header from `begun` to `end`, its length included; None where it is unusual."""
        head = data[begun:end]
        places = {name: head.find(name + b"=") + len(name) + 1 for name in (b"conn", b"time")}
        usual = set(fields) == {b"op", b"conn", b"time"} and all(
            head.count(name + b"=") == 1 for name in places
        )
        right = usual and (len(fields[b"conn"]), len(fields[b"time"])) == (4, 8)
        return _Alike(head, places[b"conn"], places[b"time"]) if right else None

    def fits(self, data: bytes, at: int) -> bool:
        """Whether a header of the same form begins there."""
        for a, b, fixed in self._fixed:  # noqa: SIM110  called for every message
            if data[at + a : at + b] != fixed:
                return False
        return True


def _record_head(file: BinaryIO) -> tuple[Fields, int]:
    """The fields of a record and the length of its data."""
    length = _LENGTH.unpack(_taken(file, 4))[0]
    if length > MOST_HEADER:
        raise DamagedError(f"a header of {length} bytes")
    fields, _ = _fields_of(_LENGTH.pack(length) + _taken(file, length), 0)
    return fields, int(_LENGTH.unpack(_taken(file, 4))[0])


def _fields_of(data: bytes, at: int) -> tuple[Fields, int]:
    length, at = _length_of(data, at)
    end = at + length
    if end > len(data):
        raise DamagedError("a header reaches beyond its record")
    fields: Fields = {}
    while at < end:
        length, at = _length_of(data, at)
        name, mark, value = data[at : at + length].partition(b"=")
        if not mark or at + length > end:
            raise DamagedError("a header field without a name")
        fields[name] = value
        at += length
    return fields, end


def _length_of(data: bytes, at: int) -> tuple[int, int]:
    if at + 4 > len(data):
        raise DamagedError("cut off within a record")
    return int(_LENGTH.unpack_from(data, at)[0]), at + 4


def _operation(fields: Fields) -> int:
    operation = fields.get(b"op", b"")
    if len(operation) != 1:
        raise DamagedError("a record without its kind")
    return operation[0]


def _taken(file: BinaryIO, length: int) -> bytes:
    if length > MOST_RECORD:
        raise DamagedError(f"a record of {length} bytes")
    data = file.read(length)
    if len(data) < length:
        raise DamagedError("cut off within a record")
    return data


def _skip(file: BinaryIO, length: int, size: int) -> None:
    if file.tell() + length > size:
        raise DamagedError("cut off within a record")
    file.seek(length, 1)


def _unpacked(data: bytes, fields: Fields, budget: UnpackBudget, path: Path, cut: bool) -> bytes:
    size = fields.get(b"size", b"")
    packing = fields.get(b"compression", b"none").decode("ascii", "replace")
    if len(size) != 4:
        raise DamagedError("a chunk without its size")
    due = int(_LENGTH.unpack(size)[0])
    budget.spend(due, MOST_RECORD)
    if packing == "none":
        plain = data
    elif packing == "bz2":
        plain = _from_bz2(data, due)
    elif packing == "lz4":
        plain = from_lz4(data, due, path, FORMAT)
    else:
        raise DamagedError(f"a chunk packed as {packing[:20]!r}")
    if len(plain) != due and not (cut and len(plain) < due):
        raise DamagedError("a chunk does not unpack to its size")
    return plain


def _from_bz2(data: bytes, due: int) -> bytes:
    try:
        return bz2.BZ2Decompressor().decompress(data, due + 1)
    except (OSError, EOFError, ValueError):
        raise DamagedError("a chunk does not unpack") from None


def _channel(fields: Fields, data: bytes) -> BagChannel:
    own, _ = _fields_of(_LENGTH.pack(len(data)) + data, 0)
    whole = {**own, b"topic": fields.get(b"topic", own.get(b"topic", b""))}
    text = {k: v.decode("utf-8", "replace") for k, v in whole.items()}
    by_name = {k.decode("ascii", "replace"): v for k, v in text.items()}
    kind = modern(by_name.get("type", ""))
    return BagChannel(by_name["topic"], kind, "ros1", by_name.get("message_definition", ""))


def _recognises(head: FileHead) -> int:
    return BY_MAGIC if head.start.startswith(MAGIC) else NO


READER = Reader(FORMAT, _recognises, lambda path: RosRecording(Ros1Bag(path)))
