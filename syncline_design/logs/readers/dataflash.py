"""ArduPilot DataFlash logs (.bin): every message kind says its own layout first.

A message is A3 95, its type, and fields that a message FMT of that type names (89 bytes: type,
length, name, one character of layout a field, the fields' names).  FMTU and UNIT name the fields'
units, and which field tells one sensor from the next.  Layout by ArduPilot's developer pages
("Log message types", the table of format characters).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from syncline_design.logs.readers.batches import (
    Batch,
    BatchColumns,
    BatchRecording,
    StreamFacts,
    Tally,
    scaled,
)
from syncline_design.logs.readers.dataflash_kinds import (
    LABELS,
    KindMeaning,
    gps_clocks,
    meaning_of,
)
from syncline_design.logs.readers.reader import BY_MAGIC, NO, FileHead, Reader
from syncline_design.logs.readers.stream import UNSET, Nanoseconds, Recording
from syncline_design.logs.refusals import refuse
from syncline_design.machine.quick_dataclass import dataclass

HEAD = b"\xa3\x95"
FMT, FMT_LENGTH = 128, 89
BLOCK = 1 << 22
# layout character -> numpy type, factor to what is meant
FIELDS: dict[str, tuple[str, float]] = {
    **{"b": ("i1", 1), "B": ("u1", 1), "M": ("u1", 1), "h": ("<i2", 1), "H": ("<u2", 1)},
    **{"i": ("<i4", 1), "I": ("<u4", 1), "q": ("<i8", 1), "Q": ("<u8", 1), "g": ("<f2", 1)},
    **{"f": ("<f4", 1), "d": ("<f8", 1), "n": ("S4", 1), "N": ("S16", 1), "Z": ("S64", 1)},
    **{"c": ("<i2", 0.01), "C": ("<u2", 0.01), "e": ("<i4", 0.01), "E": ("<u4", 0.01)},
    **{"L": ("<i4", 1e-7), "a": ("(32,)<i2", 1)},
}
CLOCKS = {"TimeUS": 1_000, "TimeMS": 1_000_000}  # nanoseconds of one


@dataclass(frozen=True)
class Kind:
    """One kind of message: its name, length with head, and its fields."""

    name: str
    length: int
    layout: str
    fields: tuple[str, ...]

    @cached_property
    def dtype(self) -> np.dtype[Any] | None:
        """The fields behind the head; None where layout, names and length do not fit."""
        known = all(char in FIELDS for char in self.layout)
        if not known or len(self.layout) != len(self.fields) or not self.layout:
            return None
        if len(set(self.fields)) != len(self.fields) or not all(self.fields):
            return None
        own = np.dtype([(n, FIELDS[c][0]) for n, c in zip(self.fields, self.layout, strict=True)])
        return own if own.itemsize == self.length - 3 else None

    @property
    def clock(self) -> str | None:
        """The field with the time, which comes first in those kinds that have one."""
        first = self.fields[0] if self.fields else ""
        return first if first in CLOCKS and self.layout[:1] in "QqI" else None


@dataclass(slots=True)
class Layouts:
    """What a log says of itself: kinds, the units of their fields, the field of the instance."""

    kinds: dict[int, Kind] = field(default_factory=dict)
    labels: dict[str, str] = field(default_factory=dict)  # unit character -> name of the unit
    factors: dict[str, float] = field(default_factory=dict)  # multiplier character -> factor
    units: dict[int, tuple[str, str]] = field(default_factory=dict)  # type -> unit, multiplier
    odd: set[str] = field(default_factory=set)  # kinds that were said twice, and not alike

    def learn(self, raw: bytes) -> None:
        """One FMT message."""
        number, length = raw[3], raw[4]
        name, layout = _text(raw[5:9]), _text(raw[9:25])
        fields = tuple(part.strip() for part in _text(raw[25:89]).split(",")) if layout else ()
        kind = Kind(name, length, layout, fields)
        before = self.kinds.setdefault(number, kind)
        if before != kind:
            self.odd.add(before.name)

    def instance(self, number: int) -> str | None:
        """The field that tells one sensor from the next (`#` in the units)."""
        place = self.units.get(number, ("", ""))[0].find("#")
        kind = self.kinds[number]
        return kind.fields[place] if 0 <= place < len(kind.fields) else None

    def unit(self, number: int, name: str) -> tuple[str, float]:
        """The unit of a field as this project writes it, and what one of its figures is in it."""
        units, multipliers = self.units.get(number, ("", ""))
        place = self.kinds[number].fields.index(name)
        char = self.kinds[number].layout[place]
        label = LABELS.get(self.labels.get(units[place : place + 1], ""), "")
        factor = self.factors.get(multipliers[place : place + 1], 0.0)
        own = FIELDS[char][1]  # already in the layout: not once more
        return label, own if own != 1 or not 0 < factor < np.inf else factor


def _text(raw: bytes) -> str:
    return raw.split(b"\0", 1)[0].decode("ascii", errors="replace")


class DataFlashRecording(BatchRecording):
    """One .bin file, in blocks."""

    format = "ArduPilot DataFlash log"

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._layouts = Layouts()
        self._single: set[str] = set()
        self._skipped = 0

    def _tallied(self) -> dict[str, Tally]:
        """One sensor alone needs no number."""
        tallies = super()._tallied()
        if not tallies:
            raise refuse(self.path, "no message in the log", expected="messages after their FMT")
        several = [name.partition("[")[0] for name in tallies if "[" in name]
        self._single = {name for name in several if several.count(name) == 1}
        return {self._named(name): tally for name, tally in tallies.items()}

    def _named(self, name: str) -> str:
        kind = name.partition("[")[0]
        return kind if kind in self._single else name

    def _batches(self, wanted: str | None) -> Iterator[Batch]:
        layouts = Layouts()
        if wanted is None:
            self._layouts, self._skipped = layouts, 0
        asked = None if wanted is None else wanted.partition("[")[0]
        walk = _Walk(layouts)
        with self.path.open("rb") as file:
            rest = b""
            while raw := file.read(BLOCK):
                block = rest + raw
                places, used = walk.through(block)
                rest = block[used:]
                for number, at in places.items():
                    kind = layouts.kinds.get(number)
                    if kind is not None and asked in (None, kind.name):
                        yield from self._of_kind(block, number, np.array(at), wanted is not None)
        if wanted is None:
            self._skipped = walk.skipped
            self._note_end(walk, rest)

    def _note_end(self, walk: _Walk, rest: bytes) -> None:
        whole = walk.messages
        if rest.strip(b"\0\xff"):
            self._cut(f"the last message is cut after {len(rest)} bytes", whole)
        elif walk.skipped:
            self._cut(f"{walk.skipped} bytes are no messages and were passed over", whole)

    def _of_kind(
        self, block: bytes, number: int, places: NDArray[np.intp], whole: bool
    ) -> Iterator[Batch]:
        """The messages of one kind in a block, by the sensor that they are of."""
        kind = self._layouts.kinds[number]
        rows = _rows(block, places, kind)
        if rows is None:
            yield Batch(kind.name, len(places), None, None, {})
            return
        which = self._layouts.instance(number)
        if which is None or rows.dtype[which].kind not in "iu":
            yield self._batch(kind.name, rows, number, whole)
            return
        for one in np.unique(rows[which]):
            name = self._named(f"{kind.name}[{int(one)}]")
            yield self._batch(name, rows[rows[which] == one], number, whole)

    def _batch(self, name: str, rows: NDArray[Any], number: int, whole: bool) -> Batch:
        kind = self._layouts.kinds[number]
        columns = _columns(rows, kind, number, self._layouts) if whole else {}
        return Batch(name, rows.shape[0], _stamps(rows, kind), None, columns)

    def _facts(self, name: str) -> StreamFacts:
        kind_name = name.partition("[")[0]
        kind = next(k for k in self._layouts.kinds.values() if k.name == kind_name)
        meaning = meaning_of(kind.name, kind.fields)
        notes = list(meaning.notes)
        if kind.dtype is None:
            notes.append("its layout does not fit its length: counted, not read")
        if kind.name in self._layouts.odd:
            notes.append("said twice with different layouts: the first one holds")
        number = next(n for n, k in self._layouts.kinds.items() if k is kind)
        none = None if kind.dtype is None else np.zeros(0, dtype=kind.dtype)
        return StreamFacts(
            columns=() if none is None else tuple(_columns(none, kind, number, self._layouts)),
            quantity=meaning.quantity,
            frame=meaning.frame,
            timeline="boot",
            primary=kind.clock or "",
            notes=tuple(notes),
            body="frd" if meaning.body else "unknown",
            kind="" if name == kind.name else kind.name,
            nature=meaning.nature,
        )


class _Walk:
    """From message to message, over blocks."""

    def __init__(self, layouts: Layouts) -> None:
        self.layouts = layouts
        self.skipped = 0
        self.messages = 0
        self._lengths = [0] * 256
        self._lengths[FMT] = FMT_LENGTH
        self._telling = {FMT}  # types that tell of others

    def through(self, block: bytes) -> tuple[dict[int, list[int]], int]:
        """Places of whole messages by type, and how many bytes of the block they fill."""
        places: dict[int, list[int]] = {}
        lengths, at, end = self._lengths, 0, len(block)
        while at + 3 <= end:
            length = lengths[block[at + 2]] if block.startswith(HEAD, at) else 0
            if not length:
                at = self._resumed(block, at)
                continue
            if at + length > end:
                break
            number = block[at + 2]
            places.setdefault(number, []).append(at)
            if number in self._telling:
                self._learn(block[at : at + length], number)
            at += length
        self.messages += sum(len(found) for found in places.values())
        return places, at

    def _resumed(self, block: bytes, at: int) -> int:
        """Where the next message may begin."""
        found = block.find(HEAD, at + 1)
        after = found if found >= 0 else max(at + 1, len(block) - 1)
        lost = block[at:after]
        self.skipped += len(lost) if lost.strip(b"\0\xff") else 0  # padding is no loss
        return after

    def _learn(self, raw: bytes, number: int) -> None:
        if number == FMT:
            self._learn_kind(raw)
            return
        rows = _rows(raw, np.zeros(1, dtype=np.intp), self.layouts.kinds[number])
        if rows is None:
            return
        one, names = rows[0], set(rows.dtype.names or ())
        if {"Id", "Label"} <= names:
            label = bytes(one["Label"]).split(b"\0")[0].decode("utf-8", errors="replace")
            self.layouts.labels.setdefault(_char(one["Id"]), label)
        elif {"Id", "Mult"} <= names:
            self.layouts.factors.setdefault(_char(one["Id"]), float(one["Mult"]))
        elif {"FmtType", "UnitIds", "MultIds"} <= names:
            said = _text(bytes(one["UnitIds"])), _text(bytes(one["MultIds"]))
            self.layouts.units[int(one["FmtType"])] = said

    def _learn_kind(self, raw: bytes) -> None:
        self.layouts.learn(raw)
        kind = self.layouts.kinds[raw[3]]
        if raw[3] != FMT:
            self._lengths[raw[3]] = kind.length if kind.length >= 3 else 0
        if kind.name in ("UNIT", "MULT", "FMTU"):
            self._telling.add(raw[3])


def _char(value: int) -> str:
    return chr(int(value) & 0xFF)


def _rows(block: bytes, places: NDArray[np.intp], kind: Kind) -> NDArray[Any] | None:
    """Messages of one kind as rows of their fields."""
    if kind.dtype is None:
        return None
    raw = np.frombuffer(block, dtype=np.uint8)
    span = np.arange(3, kind.length)
    rows: NDArray[Any] = raw[places[:, None] + span].reshape(-1).view(kind.dtype)
    return rows


def _stamps(rows: NDArray[Any], kind: Kind) -> Nanoseconds | None:
    clock = kind.clock
    if clock is None:
        return None
    counted, factor = rows[clock], CLOCKS[clock]
    held = counted < 2**63 // factor
    stamps: Nanoseconds = np.where(held, counted.astype(np.int64) * factor, UNSET)
    return stamps


def _columns(rows: NDArray[Any], kind: Kind, number: int, layouts: Layouts) -> BatchColumns:
    """Figures of the fields, by the names of the contract where a field's meaning is known."""
    meaning: KindMeaning = meaning_of(kind.name, kind.fields)
    values: dict[str, NDArray[Any]] = {}
    labels: dict[str, str] = {}
    for name, char in zip(kind.fields, kind.layout, strict=True):
        if name == kind.clock or char in "nNZa":
            continue
        labels[name], factor = layouts.unit(number, name)
        values[name] = rows[name] if factor == 1 else scaled(rows[name], factor)
    columns: dict[str, NDArray[Any]] = dict(meaning.columns(values))
    if "GWk" in values and "GMS" in values:
        columns |= gps_clocks(rows["GWk"], rows["GMS"])
    for name, column in values.items():
        if name not in meaning.taken:
            columns[f"{name}_{labels[name]}" if labels[name] else name] = column
    return columns


def _recognises(head: FileHead) -> int:
    return BY_MAGIC if head.start.startswith(HEAD + bytes([FMT])) else NO


def _open(path: Path) -> Recording:
    return DataFlashRecording(path)


READER = Reader(DataFlashRecording.format, _recognises, _open)
