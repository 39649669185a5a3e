"""ULog of PX4, record by record: topics with their formats, stamps in microseconds since boot.

Read here and not by pyulog, which holds a whole file.  Format: docs.px4.io, "ULog File Format":
records of a length, a kind and data; formats of fields by name, data by subscription; padding at
the end of a format is not in the data.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from dataclasses import field
from pathlib import Path
from typing import Any, BinaryIO, Final

import numpy as np
from numpy.typing import NDArray

from syncline_design.logs.readers.reader import BY_MAGIC, NO, FileHead, Reader
from syncline_design.logs.readers.stream import (
    UNSET,
    Incomplete,
    Piece,
    StampColumn,
    Stamps,
    Stream,
)
from syncline_design.logs.readers.timelines import EARLIEST_NS, calendar
from syncline_design.logs.readers.ulog_meaning import Meaning, meaning_of
from syncline_design.logs.refusals import refuse
from syncline_design.machine.deadline import in_force
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import to_places

MAGIC: Final = b"ULog\x01\x12\x35"
FORMAT: Final = "PX4 ULog"
HEADER_BYTES: Final = 16
APPENDED: Final = 1  # bit of the first incompatible flag
KINDS: Final = frozenset(b"BFIMPQACRLSOD")
PRIMITIVES: Final = {
    "int8_t": "i1", "uint8_t": "u1", "int16_t": "<i2", "uint16_t": "<u2", "int32_t": "<i4",
    "uint32_t": "<u4", "int64_t": "<i8", "uint64_t": "<u8", "float": "<f4", "double": "<f8",
    "bool": "u1", "char": "S1",
}  # fmt: skip
MOST_FIELDS: Final = 20_000
MOST_DEPTH: Final = 8
MOST_STREAMS: Final = 2_000
PIECE_ROWS: Final = 20_000
CHECK_EVERY: Final = 16_384
MOST_UTC: Final = 100_000  # pairs of boot and UTC that are held
BLOCK: Final = 1 << 20
SAMPLE, STAMP, UTC = "timestamp_sample", "timestamp", "time_utc_usec"
_FIELD = re.compile(r"^(\w+)(?:\[(\d+)\])? (\w+)$")
_RECORD = struct.Struct("<HB")
_NUMBER = struct.Struct("<Q")


class _DamagedError(Exception):
    """The rest of a file cannot be read."""


@dataclass(frozen=True, slots=True)
class Layout:
    """Where the fields of a topic lie: name -> (offset, numpy's code); bytes without padding."""

    fields: dict[str, tuple[int, str]]
    size: int


@dataclass(slots=True)
class _Topic:
    """A subscription, and what is held of it while the file is read."""

    name: str
    kind: str
    layout: Layout
    published: StampColumn = field(default_factory=StampColumn)
    sampled: StampColumn = field(default_factory=StampColumn)
    utc: list[tuple[int, int]] = field(default_factory=list)  # which message, and what it tells
    utc_unset: int = 0
    messages: int = 0


class ULogRecording:
    """One flight log."""

    def __init__(self, path: Path) -> None:
        self.path, self.format = path, FORMAT
        self._size = path.stat().st_size
        self.incomplete: Incomplete | None = None
        self._dropouts = 0
        if self._size < HEADER_BYTES:
            raise refuse(path, "no readable ULog", found=f"{self._size} bytes")

    def streams(self) -> tuple[Stream, ...]:
        topics: dict[int, _Topic] = {}
        for number, topic, data in self._data():
            topics[number] = topic
            _count(topic, data)
        partial = self.incomplete is not None
        found = [_stream(topic, partial) for topic in topics.values()]
        if not found:
            raise refuse(
                self.path,
                "no readable ULog",
                expected="topics with data",
                found=self.incomplete.reason if self.incomplete else "none",
                hint="copy the file once more from the vehicle",
            )
        return tuple(sorted(found, key=lambda one: one.name))

    def samples(self, name: str) -> Iterator[Piece]:
        held: list[bytes] = []
        wanted: _Topic | None = None
        meaning: Meaning | None = None
        for _, topic, data in self._data():
            if topic.name != name:
                continue
            if wanted is None:
                wanted, meaning = topic, meaning_of(topic.kind, topic.layout.fields)
                uses_sample = self._uses_sample(topic)
            held.append(data[: topic.layout.size])
            if len(held) >= PIECE_ROWS:
                yield _piece(wanted, meaning, held, uses_sample)
                held = []
        if wanted is None:
            raise refuse(self.path, f"no stream {name}")
        if held:
            yield _piece(wanted, meaning, held, uses_sample)

    def _uses_sample(self, wanted: _Topic) -> bool:
        """As `streams` decides: whether any measurement time is set at all."""
        place = wanted.layout.fields.get(SAMPLE)
        if place is None:
            return False
        return any(
            _microseconds(data, place[0])
            for _, topic, data in self._data()
            if topic.name == wanted.name
        )

    def _data(self) -> Iterator[tuple[int, _Topic, bytes]]:
        """Every record of data with its topic, up to the last good one."""
        deadline = in_force()
        count = 0
        self.incomplete = None
        try:
            for count, found in enumerate(self._records(), 1):
                if not count % CHECK_EVERY:
                    deadline.check()
                yield found
        except _DamagedError as damage:
            self.incomplete = Incomplete(str(damage), count)

    def _records(self) -> Iterator[tuple[int, _Topic, bytes]]:
        formats: dict[str, str] = {}
        topics: dict[int, _Topic] = {}
        self._dropouts = 0
        with self.path.open("rb", buffering=BLOCK) as file:
            file.seek(HEADER_BYTES)
            ends = [self._size]
            for kind, data in _read(file, ends):
                if kind == b"D"[0]:
                    number = _number(data)
                    topic = topics.get(number)
                    if topic is None or len(data) - 2 < topic.layout.size:
                        raise _DamagedError("data of no known topic, or shorter than it")
                    yield number, topic, data[2:]
                elif kind == b"F"[0]:
                    name, _, fields = data.decode("ascii", "replace").partition(":")
                    formats[name] = fields
                elif kind == b"A"[0]:
                    _subscribe(data, formats, topics)
                    if len(topics) > MOST_STREAMS:
                        most = f"at most {MOST_STREAMS}"
                        raise refuse(self.path, "too many topics", expected=most)
                elif kind == b"O"[0]:
                    self._dropouts += 1
                elif kind == b"B"[0]:
                    ends[:0] = _appended(data, self._size)


def _read(file: BinaryIO, ends: list[int]) -> Iterator[tuple[int, bytes]]:
    """Records one by one; a section ends where the next one was appended, within a record maybe.

    ends: offsets at which sections end, rising; the caller adds to it.
    """
    at = HEADER_BYTES
    while ends:
        if at + 3 > ends[0]:
            if len(ends) == 1 and at != ends[0]:
                raise _DamagedError("cut off within a record")
            at = ends.pop(0)
            file.seek(at)
            continue
        length, kind = _RECORD.unpack(file.read(3))
        if kind not in KINDS and not 65 <= kind <= 90:
            raise _DamagedError(f"no record of ULog at byte {at}")
        if at + 3 + length > ends[0]:
            if len(ends) == 1:
                raise _DamagedError("cut off within a record")
            at = ends.pop(0)
            file.seek(at)
            continue
        yield kind, file.read(length)
        at += 3 + length


def _appended(data: bytes, size: int) -> list[int]:
    """Where data were appended behind the end of the file proper (after a crash)."""
    if len(data) < 40 or not data[8] & APPENDED:
        return []
    offsets = [_NUMBER.unpack_from(data, 16 + 8 * k)[0] for k in range(3)]
    return sorted({int(at) for at in offsets if HEADER_BYTES < at < size})


def _number(data: bytes) -> int:
    if len(data) < 2:
        raise _DamagedError("data without a topic")
    return data[0] | data[1] << 8


def _subscribe(data: bytes, formats: dict[str, str], topics: dict[int, _Topic]) -> None:
    if len(data) < 4:
        raise _DamagedError("a subscription without a name")
    number, kind = data[1] | data[2] << 8, data[3:].decode("ascii", "replace")
    name = f"{kind}[{data[0]}]"
    layout = _layout(kind, formats)
    if STAMP not in layout.fields:
        raise _DamagedError(f"topic {kind[:60]} has no {STAMP}")
    if number in topics and topics[number].name != name:
        raise _DamagedError("two topics with one number")
    if number not in topics:
        topics[number] = _Topic(name, kind, layout)


def _layout(kind: str, formats: dict[str, str]) -> Layout:
    """All fields of a format with those of the formats within it, by offset."""
    found: dict[str, tuple[int, str]] = {}
    end = _laid(kind, formats, "", 0, found, 0)
    size = max((at + np.dtype(code).itemsize for at, code in found.values()), default=end)
    return Layout(found, size)


def _laid(
    kind: str,
    formats: dict[str, str],
    prefix: str,
    at: int,
    found: dict[str, tuple[int, str]],
    depth: int,
) -> int:
    """Add the fields of one format from an offset on; gives the offset behind it."""
    if kind not in formats or depth > MOST_DEPTH:
        raise _DamagedError(f"no format of {kind[:60]!r}")
    for text in filter(None, formats[kind].split(";")):
        parts = _FIELD.match(text.strip())
        if parts is None:
            raise _DamagedError(f"no field of a format: {text[:60]!r}")
        inner, many, name = parts.groups()
        for k in range(int(many or 1)):
            full = prefix + name + (f"[{k}]" if many else "")
            if inner not in PRIMITIVES:
                at = _laid(inner, formats, full + ".", at, found, depth + 1)
                continue
            code = PRIMITIVES[inner]
            if not name.startswith("_padding"):
                found[full] = (at, code)
            at += np.dtype(code).itemsize
            if len(found) > MOST_FIELDS or at > 1 << 16:
                raise _DamagedError(f"a format of too many fields: {kind[:60]}")
    return at


def _microseconds(data: bytes, at: int) -> int:
    return int(_NUMBER.unpack_from(data, at)[0])


def _nanoseconds(data: bytes, at: int) -> int:
    value = _microseconds(data, at) * 1000
    return value if value < 2**63 else UNSET


def _count(topic: _Topic, data: bytes) -> None:
    fields = topic.layout.fields
    topic.messages += 1
    stamp = _nanoseconds(data, fields[STAMP][0])
    topic.published.append(stamp)
    if SAMPLE in fields:
        topic.sampled.append(_nanoseconds(data, fields[SAMPLE][0]))
    if UTC in fields:
        utc = _nanoseconds(data, fields[UTC][0])
        if utc < EARLIEST_NS:
            topic.utc_unset += 1
        elif stamp != UNSET and len(topic.utc) < MOST_UTC:
            topic.utc.append((topic.messages - 1, utc))


def _stream(topic: _Topic, partial: bool) -> Stream:
    published = topic.published.values()
    sampled = topic.sampled.values() if len(topic.sampled) else None
    notes = []
    if sampled is not None and not np.any(sampled):
        notes.append(f"{SAMPLE} is 0 throughout, so {STAMP} (publication) stands for it")
        sampled = None
    stamps = (
        Stamps(STAMP, None, published)
        if sampled is None
        else Stamps(SAMPLE, STAMP, sampled, published)
    )
    meaning = meaning_of(topic.kind, topic.layout.fields)
    notes += _clock_notes(topic, stamps)
    if meaning is not None:
        notes += meaning.notes
    return Stream(
        name=topic.name,
        quantity=() if meaning is None else meaning.quantity,
        messages=topic.messages,
        stamps=stamps,
        frame="unknown" if meaning is None else meaning.frame,
        timeline="boot",
        partial=partial,
        notes=tuple(notes),
        body="unknown" if meaning is None else meaning.body,
        kind=topic.kind,
        columns=() if meaning is None else tuple(meaning.columns),
        nature="unknown" if meaning is None else meaning.nature,
    )


def _clock_notes(topic: _Topic, stamps: Stamps) -> list[str]:
    """How boot and UTC stand to each other, as far as the topic tells.

    A receiver's UTC is of when it measured, as the stamps that stand for its messages are: held
    against those of publication it would be less by what lies between.
    """
    boot = stamps.primary_ns
    known = boot[(boot != UNSET) & (boot != 0)]
    notes = []
    if known.shape[0] and int(np.median(known)) > EARLIEST_NS:
        notes.append("the boot clock itself runs on Unix time (a simulation)")
    apart = np.array(
        [u - int(boot[k]) for k, u in topic.utc if boot[k] not in (0, UNSET)], dtype=np.int64
    )
    if apart.size:
        middle = int(apart[0]) + round(float(np.median(apart - apart[0])))
        seconds, micro = divmod((middle + 500) // 1000, 10**6)
        spread = (int(apart.max()) - int(apart.min())) / 1e6
        first, last = calendar(topic.utc[0][1]), calendar(topic.utc[-1][1])
        notes.append(
            f"UTC - boot = {seconds}.{micro:06d} s (median of {apart.size}, "
            f"spread {to_places(spread, 1)} ms, by {stamps.primary}); UTC {first} to {last}"
        )
    if topic.utc_unset:
        notes.append(f"{topic.utc_unset} messages without UTC: no fix yet")
    return notes


def _piece(topic: _Topic, meaning: Meaning | None, held: list[bytes], uses_sample: bool) -> Piece:
    fields = topic.layout.fields
    kind = np.dtype(
        {
            "names": list(fields),
            "formats": [code for _, code in fields.values()],
            "offsets": [at for at, _ in fields.values()],
            "itemsize": topic.layout.size,
        }
    )
    table: NDArray[Any] = np.frombuffer(b"".join(held), dtype=kind)
    published = (table[STAMP].astype(np.uint64) * np.uint64(1000)).astype(np.int64)
    columns = {} if meaning is None else {n: f(table) for n, f in meaning.columns.items()}
    if not uses_sample:
        return Piece(published, None, columns)
    sampled = (table[SAMPLE].astype(np.uint64) * np.uint64(1000)).astype(np.int64)
    return Piece(sampled, published, columns)


def _recognises(head: FileHead) -> int:
    return BY_MAGIC if head.start.startswith(MAGIC) else NO


READER = Reader(FORMAT, _recognises, ULogRecording)
