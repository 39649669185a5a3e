"""A LAZ file that was cut: its table of chunks, which is at the end, is put there anew.

The points themselves stand in the file from front to back; the library only starts with a table, so
that one with the right count and nothing true in it serves, as long as nobody jumps by it.
"""

from __future__ import annotations

import io
import struct
from pathlib import Path
from typing import Any, BinaryIO

from syncline_design.logs.readers.las_header import LasClaims
from syncline_design.logs.readers.reader import library
from syncline_design.logs.refusals import refuse

CHUNK_PLACE = 12  # of the chunk size in LASzip's record
ITEMS_PLACE = 32  # of the number of items, each with type, size and version (2 bytes each)
LAYERS = {10: 9, 11: 1, 12: 2, 13: 1}  # of an item's type in a chunk that is packed in layers
EXTRA_BYTES = 14  # an item with a layer for each of its bytes
LEAST_CHUNK = 100
POINTER = 8  # bytes at the first point, that say where the table is


class MendedFile(io.RawIOBase):
    """A file with another end, and with a pointer to it."""

    def __init__(self, file: BinaryIO, pointer: int, size: int, tail: bytes) -> None:
        self._file, self._pointer, self._size, self._tail = file, pointer, size, tail
        self._at = 0

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def tell(self) -> int:
        return self._at

    def seek(self, offset: int, whence: int = 0) -> int:
        base = (0, self._at, self._size + len(self._tail))[whence]
        self._at = max(base + offset, 0)
        return self._at

    def readinto(self, buffer: Any) -> int:
        found = self.read(len(buffer))
        buffer[: len(found)] = found
        return len(found)

    def read(self, size: int = -1) -> bytes:
        left = max(self._size + len(self._tail) - self._at, 0)
        size = left if size < 0 else min(size, left)
        found = b""
        if self._at < self._size:
            self._file.seek(self._at)
            found = self._with_pointer(self._file.read(min(size, self._size - self._at)))
        behind = self._at + len(found) - self._size
        if len(found) < size and behind >= 0:
            found += self._tail[behind : behind + size - len(found)]
        self._at += len(found)
        return found

    def _with_pointer(self, raw: bytes) -> bytes:
        first = self._pointer - self._at
        if not -POINTER < first < len(raw):
            return raw
        held = bytearray(raw)
        for k, byte in enumerate(struct.pack("<q", self._size)):
            if 0 <= first + k < len(held):
                held[first + k] = byte
        return bytes(held)


def mended(path: Path, file: BinaryIO, claims: LasClaims, record: bytes) -> BinaryIO | MendedFile:
    """The file itself where its table can be one; else one with a table; record: LASzip's own."""
    size = path.stat().st_size
    if _has_table(file, claims, size):
        return file
    (chunk,) = struct.unpack_from("<I", record.ljust(16, b"\0"), CHUNK_PLACE)
    if not LEAST_CHUNK <= chunk < 2**31:  # chunks of sizes that only the table told
        raise refuse(
            path,
            "the table of chunks is missing or damaged, and with it the size of each chunk",
            hint="copy the file once more: it was cut",
        )
    lazrs = library("lazrs", path, "LAZ cloud")
    tail = io.BytesIO()
    entries = [(chunk, 1)] * -(-claims.points // chunk)
    lazrs.write_chunk_table(tail, entries, lazrs.LazVlr(record))
    return MendedFile(file, claims.offset, size, tail.getvalue())


def _has_table(file: BinaryIO, claims: LasClaims, size: int) -> bool:
    """Whether the table's head is there and its count possible: the library believes any count."""
    at = _number(file, claims.offset, "<q")
    if at == -1:  # written behind the points, where a writer could not go back
        at = _number(file, size - POINTER, "<q")
    if not claims.offset + POINTER <= at <= size - POINTER:
        return False
    version, count = _number(file, at, "<I"), _number(file, at + 4, "<I")
    # the first point of every chunk stands there as it is
    return version == 0 and 0 < count * claims.record <= size


def _number(file: BinaryIO, at: int, code: str) -> int:
    """One number of a file, -1 where it ends before."""
    width = struct.calcsize(code)
    file.seek(max(at, 0))
    raw = file.read(width)
    return int(struct.unpack(code, raw)[0]) if len(raw) == width else -1


def whole_points(path: Path, claims: LasClaims, record: bytes) -> int:
    """How many points stand in chunks whose layers fit into the file.

    Points of the formats from 6 on are packed in layers, whose sizes stand behind the first point
    of each chunk; the library makes room for any size before it reads.
    """
    layers = _layers(record)
    (chunk,) = struct.unpack_from("<I", record.ljust(16, b"\0"), CHUNK_PLACE)
    if not layers or chunk == 0:
        return claims.points
    size, at, points = path.stat().st_size, claims.offset + POINTER, 0
    head = claims.record + 4 + 4 * layers
    with path.open("rb") as file:
        while points < claims.points:
            file.seek(at + claims.record)
            raw = file.read(4 + 4 * layers)
            if len(raw) < 4 + 4 * layers:
                break
            count, *sizes = struct.unpack(f"<{1 + layers}I", raw)
            at += head + sum(sizes)
            if at > size or not count:
                break
            points += min(count, chunk)
    return min(points, claims.points)


def _layers(record: bytes) -> int:
    """Layers of a chunk by the items of LASzip's record; 0 where points are packed one by one."""
    if len(record) < ITEMS_PLACE + 2:
        return 0
    (items,) = struct.unpack_from("<H", record, ITEMS_PLACE)
    if len(record) < ITEMS_PLACE + 2 + 6 * items:
        return 0
    kinds = [struct.unpack_from("<3H", record, ITEMS_PLACE + 2 + 6 * k)[:2] for k in range(items)]
    if any(kind not in LAYERS and kind != EXTRA_BYTES for kind, _ in kinds):
        return 0
    return sum(size if kind == EXTRA_BYTES else LAYERS[kind] for kind, size in kinds)
