"""How large the columns of a Parquet file are before anything of them is unpacked.

The footer is Thrift in its compact protocol (Apache Parquet format, `FileMetaData`); only what
leads to the sizes of the column chunks is used.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

MOST_FOOTER = 4 * 2**20  # bytes; ten thousands of column chunks
MOST_DEPTH = 32
STOP, TRUE, FALSE, BYTE, DOUBLE, BINARY, LIST, SET, MAP, STRUCT = 0, 1, 2, 3, 7, 8, 9, 10, 11, 12
ROW_GROUPS, COLUMNS, META = 4, 1, 3  # field numbers of FileMetaData, RowGroup, ColumnChunk
PATH, VALUES, UNPACKED = 3, 5, 6  # of ColumnMetaData


class FooterError(Exception):
    """A footer that cannot be read, or is too large to be."""


class _Reader:
    def __init__(self, data: bytes) -> None:
        self.data, self.at = data, 0

    def unsigned(self) -> int:
        result, shift = 0, 0
        while shift < 70:
            byte = self.data[self.at]
            self.at += 1
            result |= (byte & 0x7F) << shift
            if byte < 0x80:
                return result
            shift += 7
        raise FooterError("a number without an end")

    def signed(self) -> int:
        found = self.unsigned()
        return (found >> 1) ^ -(found & 1)

    def binary(self) -> bytes:
        length = self.unsigned()
        self.at += length
        return self.data[self.at - length : self.at]

    def value(self, kind: int, depth: int) -> Any:
        if depth > MOST_DEPTH:
            raise FooterError("nested too deep")
        if kind in (TRUE, FALSE, BYTE):
            self.at += 1  # of a list's elements; as a field a truth value has no bytes
            return None
        if kind == DOUBLE:
            self.at += 8
            return None
        if kind == BINARY:
            return self.binary()
        if kind in (LIST, SET):
            return self.sequence(depth)
        if kind == STRUCT:
            return self.struct(depth)
        if BYTE < kind < DOUBLE:
            return self.signed()
        raise FooterError(f"a type {kind}")  # maps do not occur

    def sequence(self, depth: int) -> list[Any]:
        head = self.data[self.at]
        self.at += 1
        count = head >> 4 if head >> 4 != 15 else self.unsigned()
        if count > len(self.data):
            raise FooterError("a list longer than the footer")
        return [self.value(head & 15, depth + 1) for _ in range(count)]

    def struct(self, depth: int) -> dict[int, Any]:
        found: dict[int, Any] = {}
        number = 0
        while head := self.data[self.at]:
            self.at += 1
            number = number + (head >> 4) if head >> 4 else self.signed()
            kind = head & 15
            found[number] = None if kind in (TRUE, FALSE) else self.value(kind, depth + 1)
        self.at += 1
        return found


def chunks(path: Path, column: str) -> Iterator[tuple[int, int]]:
    """Values and unpacked bytes of a column in every row group, as the footer says."""
    try:
        for group in _Reader(_footer(path)).struct(0)[ROW_GROUPS]:
            for chunk in group[COLUMNS]:
                meta = chunk[META]
                if [part.decode() for part in meta[PATH]] == [column]:
                    yield int(meta[VALUES]), int(meta[UNPACKED])
    except (KeyError, IndexError, TypeError, ValueError, AttributeError) as error:
        raise FooterError(f"{type(error).__name__}: {error}") from None


def _footer(path: Path) -> bytes:
    with path.open("rb") as file:
        size = file.seek(0, 2)
        file.seek(max(0, size - 8))
        tail = file.read(8)
        length = int.from_bytes(tail[:4], "little")
        if tail[4:] != b"PAR1" or length > size - 8:
            raise FooterError("no Parquet footer")
        if length > MOST_FOOTER:
            raise FooterError(f"a footer of {length} bytes; expected at most {MOST_FOOTER}")
        file.seek(size - 8 - length)
        return file.read(length)
