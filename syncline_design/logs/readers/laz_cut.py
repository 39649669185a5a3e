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

CHUNK_PLACE = 12  # of the chunk size in LASzip's record
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
    """The file itself where its table is there; else one with a table; record: LASzip's own."""
    size = path.stat().st_size
    file.seek(claims.offset)
    (table,) = struct.unpack("<q", file.read(POINTER).ljust(POINTER, b"\0"))
    file.seek(0)
    if table == -1 or claims.offset + POINTER <= table <= size - POINTER:
        return file
    (chunk,) = struct.unpack_from("<I", record.ljust(16, b"\0"), CHUNK_PLACE)
    if not LEAST_CHUNK <= chunk < 2**31:  # chunks of sizes that only the table told
        return file
    lazrs = library("lazrs", path, "LAZ cloud")
    tail = io.BytesIO()
    entries = [(chunk, 1)] * -(-claims.points // chunk)
    lazrs.write_chunk_table(tail, entries, lazrs.LazVlr(record))
    return MendedFile(file, claims.offset, size, tail.getvalue())
