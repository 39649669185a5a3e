"""Figures of many ROS messages at once, where they stand at the same bytes in all of them.

Messages of a topic mostly differ in figures alone: they are equally long, and the lengths and texts
in them are the same.  Where the definition puts a figure in one of them, it stands in all.
Source: CDR of OMG DDS-XTypes (plain, 8 bytes aligned at most), wiki.ros.org/ROS/Technical Overview.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from syncline_design.logs.readers.ros_types import Encoding
from syncline_design.machine.quick_dataclass import dataclass

Definitions = Mapping[str, Any]  # type -> (constants, fields), as rosbags has them
Block = NDArray[np.uint8]  # (messages, bytes of each)

MOST_FIELDS: Final = 4_000  # of a message that are walked through
NESTED: Final = 20
_BASE, _NAME, _ARRAY = 1, 2, 3  # kinds of a field's type; 4 is a sequence
_HEAD: Final = 4  # bytes of encapsulation before CDR
_LITTLE: Final = b"\x00\x01"
_COUNT: Final = struct.Struct("<I")
_FIGURES: Final = {
    "int8": "<i1", "int16": "<i2", "int32": "<i4", "int64": "<i8", "uint8": "<u1",
    "uint16": "<u2", "uint32": "<u4", "uint64": "<u8", "float32": "<f4", "float64": "<f8",
}  # fmt: skip
_BARE: Final = {"bool": 1, "byte": 1, "char": 1}  # bytes that nothing is read from
_UNFILLED: Final = "structure_needs_at_least_one_member"  # of an empty type; ROS 1 writes nothing


class UnevenError(Exception):
    """A message whose figures have no places that its definition would tell."""


@dataclass(frozen=True, slots=True)
class Place:
    """Where a figure begins, as what it is written; count: of an array, None for a single one."""

    at: int
    written: str
    count: int | None

    def of(self, block: Block) -> NDArray[Any]:
        """The figure of every message; of an array one row an element."""
        messages, length = block.shape
        kind = np.dtype(self.written)
        shape: tuple[int, ...] = (messages,)
        strides: tuple[int, ...] = (length,)
        if self.count is not None:
            shape, strides = (self.count, messages), (kind.itemsize, length)
        found: NDArray[Any] = np.ndarray(shape, kind, block, self.at, strides)
        return found.astype(np.float64 if kind.kind == "f" else kind.newbyteorder("="))


Tree = dict[str, "Place | Tree"]


class Figures:
    """Messages as if they were one, whose every figure is an array over them."""

    def __init__(self, tree: Tree, block: Block) -> None:
        self._tree, self._block = tree, block

    def __getattr__(self, name: str) -> Any:
        place = self._tree.get(name)
        if place is None:
            raise AttributeError(name)
        return Figures(place, self._block) if isinstance(place, dict) else place.of(self._block)


class MessageForm:
    """Where the figures of a message stand, and of all that are like it."""

    def __init__(
        self, data: bytes, definitions: Definitions, kind: str, encoding: Encoding
    ) -> None:
        """Walk through one message; raises UnevenError where that is not to be told."""
        walk = _Walk(data, definitions, encoding)
        self.tree = walk.fields_of(kind, 0)
        self.length = len(data)
        self._same = np.array(
            [k for begin, end in walk.same for k in range(begin, end)], dtype=np.intp
        )
        self._told = np.frombuffer(data, dtype=np.uint8)[self._same]

    def alike(self, block: Block) -> NDArray[np.bool_]:
        """Which of some equally long messages have the same lengths and texts."""
        same: NDArray[np.bool_] = (block[:, self._same] == self._told).all(axis=1)
        return same

    def figures(self, block: Block) -> Figures:
        return Figures(self.tree, block)


class _Walk:
    """The way through the fields of one message."""

    def __init__(self, data: bytes, definitions: Definitions, encoding: Encoding) -> None:
        self._data, self._definitions = data, definitions
        self._cdr = encoding == "cdr"
        self.same: list[tuple[int, int]] = [(0, _HEAD)] if self._cdr else []
        self._begun = _HEAD if self._cdr else 0
        self._at = self._begun
        self._fields = 0
        if self._cdr and data[:2] != _LITTLE:
            raise UnevenError

    def fields_of(self, kind: str, depth: int) -> Tree:
        if depth > NESTED or kind not in self._definitions:
            raise UnevenError
        tree: Tree = {}
        for name, (node, what) in self._definitions[kind][1]:
            if name == _UNFILLED and not self._cdr:
                continue
            place = self._field(int(node), what, depth)
            if place is not None:
                tree[name] = place
        return tree

    def _field(self, node: int, what: Any, depth: int) -> Place | Tree | None:
        self._fields += 1
        if self._fields > MOST_FIELDS:
            raise UnevenError
        if node == _NAME:
            return self.fields_of(what, depth + 1)
        if node == _BASE:
            if what[0] != "string":
                return self._figure(what[0], None)
            self._text()
            return None
        inner, count = what
        if node != _ARRAY:
            count = self._count()
        if int(inner[0]) == _BASE and inner[1][0] != "string":
            return self._figure(inner[1][0], count) if count else None
        for _ in range(count):
            self._field(int(inner[0]), inner[1], depth)
        return None

    def _figure(self, written: str, count: int | None) -> Place | None:
        kind = _FIGURES.get(written)
        size = _BARE.get(written, 0) if kind is None else int(kind[2])
        if not size:
            raise UnevenError
        begins = self._taken(size * (1 if count is None else count), size)
        return None if kind is None else Place(begins, kind, count)

    def _count(self) -> int:
        begins = self._taken(4, 4)
        self.same.append((begins, begins + 4))
        return int(_COUNT.unpack_from(self._data, begins)[0])

    def _text(self) -> None:
        length = self._count()
        begins = self._taken(length, 1)
        self.same.append((begins, begins + length))

    def _taken(self, length: int, aligned: int) -> int:
        """Where the next so many bytes begin."""
        over = (self._at - self._begun) % aligned if self._cdr else 0
        begins = self._at + (aligned - over if over else 0)
        if begins + length > len(self._data):
            raise UnevenError
        self._at = begins + length
        return begins
