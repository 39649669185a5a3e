"""A recording made of batches: what the readers of flat formats have in common.

A reader of such a format only finds batches, consecutive messages of one stream, in the order of
the file, and says afterwards what it knows of each stream.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from syncline_design.logs.readers.stream import (
    UNSET,
    Body,
    Frame,
    Incomplete,
    Nanoseconds,
    Nature,
    Piece,
    PointTimes,
    StampColumn,
    Stamps,
    Stream,
    Timeline,
)
from syncline_design.logs.refusals import refuse
from syncline_design.machine.deadline import in_force
from syncline_design.machine.quick_dataclass import dataclass

BatchColumns = Mapping[str, NDArray[Any]]
MOST_STREAMS = 2_000


@dataclass(frozen=True, slots=True, eq=False)
class Batch:
    """Some consecutive messages of a stream; primary_ns None where it has no times."""

    stream: str
    messages: int
    primary_ns: Nanoseconds | None
    secondary_ns: Nanoseconds | None
    columns: BatchColumns


@dataclass(frozen=True, slots=True)
class StreamFacts:
    """What a reader knows of a stream besides its messages; as in `Stream` and `Stamps`."""

    quantity: tuple[str, ...] = ()
    frame: Frame = "unknown"
    timeline: Timeline = "unknown"
    primary: str = ""
    primary_factor: float = 1.0
    secondary: str | None = None
    notes: tuple[str, ...] = ()
    of_times: tuple[str, ...] = ()  # notes that only a stream with times needs
    body: Body = "unknown"
    kind: str = ""
    columns: tuple[str, ...] = ()
    nature: Nature = "unknown"
    points: PointTimes | None = None


@dataclass(slots=True)
class Tally:
    """What is gathered of a stream in one pass."""

    messages: int
    primary: StampColumn
    secondary: StampColumn
    columns: tuple[str, ...]

    def fill(self) -> None:
        """Messages before the first that has a time are such without it."""
        lacking = self.messages - len(self.primary)
        if lacking:
            self.primary.extend(np.full(lacking, UNSET, dtype=np.int64))


class BatchRecording(ABC):
    """A `Recording` over the batches of one file."""

    format: str

    def __init__(self, path: Path) -> None:
        self.path = path
        self._streams: tuple[Stream, ...] | None = None
        self._ended: Incomplete | None = None

    @abstractmethod
    def _batches(self, wanted: str | None) -> Iterator[Batch]:
        """Every batch; of one stream with its columns, or of all with stamps at least."""

    @abstractmethod
    def _facts(self, name: str) -> StreamFacts:
        """What is known of a stream once all batches were seen."""

    def _cut(self, reason: str, messages: int) -> None:
        """Note that the file could not be read to its end."""
        self._ended = Incomplete(reason, messages)

    @property
    def incomplete(self) -> Incomplete | None:
        self.streams()
        return self._ended

    def streams(self) -> tuple[Stream, ...]:
        if self._streams is None:
            tallies = self._tallied()
            found = [self._stream(name, tally) for name, tally in sorted(tallies.items())]
            if self._ended is not None:
                found = [replace(stream, partial=True) for stream in found]
            self._streams = tuple(found)
        return self._streams

    def _tallied(self) -> dict[str, Tally]:
        tallies: dict[str, Tally] = {}
        deadline = in_force()
        for batch in self._batches(None):
            deadline.check()
            tally = tallies.get(batch.stream)
            if tally is None:
                if len(tallies) >= MOST_STREAMS:
                    most = f"at most {MOST_STREAMS}"
                    raise refuse(self.path, "too many streams", expected=most)
                columns = tuple(batch.columns)
                tally = tallies[batch.stream] = Tally(0, StampColumn(), StampColumn(), columns)
            if batch.primary_ns is not None:
                tally.fill()
                tally.primary.extend(batch.primary_ns)
            tally.messages += batch.messages
            if batch.secondary_ns is not None:
                tally.secondary.extend(batch.secondary_ns)
        return tallies

    def _stream(self, name: str, tally: Tally) -> Stream:
        facts = self._facts(name)
        stamps = None
        if len(tally.primary):
            tally.fill()
            whole = len(tally.secondary) == len(tally.primary)
            second = tally.secondary.values() if whole and facts.secondary else None
            label = facts.secondary if second is not None else None
            stamps = Stamps(
                facts.primary, label, tally.primary.values(), second, facts.primary_factor
            )
        return Stream(
            name=name,
            quantity=facts.quantity,
            messages=tally.messages,
            stamps=stamps,
            frame=facts.frame,
            timeline=facts.timeline if stamps is not None else "unknown",
            notes=facts.notes if stamps is None else facts.of_times + facts.notes,
            body=facts.body,
            kind=facts.kind,
            columns=facts.columns or tally.columns,
            nature=facts.nature,
            points=facts.points,
        )

    def samples(self, name: str) -> Iterator[Piece]:
        if name not in {stream.name for stream in self.streams()}:
            raise refuse(self.path, f"no stream {name!r} in the log")
        return self._pieces(name)

    def _pieces(self, name: str) -> Iterator[Piece]:
        deadline = in_force()
        for batch in self._batches(name):
            deadline.check()
            if batch.stream == name:
                primary = batch.primary_ns
                if primary is None:
                    primary = np.full(batch.messages, UNSET, dtype=np.int64)
                yield Piece(primary, batch.secondary_ns, batch.columns)


def scaled(figures: NDArray[Any], factor: float) -> NDArray[Any]:
    """Divided by 1e7 rather than multiplied by 1e-7: 423923858 becomes the nearest float."""
    whole = round(1 / factor) if factor < 1 else 0
    if whole and abs(whole * factor - 1) < 1e-9:
        return figures / whole
    return figures.astype(float) * factor
