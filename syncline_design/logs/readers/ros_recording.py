"""Bags of any container as a recording: the stamps of every topic in one pass, then its values."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import field
from pathlib import Path
from typing import NamedTuple

from syncline_design.logs.readers.point_times import CloudTimes, cloud_times
from syncline_design.logs.readers.reader import library
from syncline_design.logs.readers.ros_meaning import TopicMeaning, has_meaning, meaning_of
from syncline_design.logs.readers.ros_rows import PIECE_ROWS, TopicRows
from syncline_design.logs.readers.ros_types import (
    BagChannel,
    MessageType,
    StampOf,
    stamp_of,
    type_of,
    unread_of,
)
from syncline_design.logs.readers.stream import (
    UNSET,
    Incomplete,
    Nanoseconds,
    Piece,
    StampColumn,
    Stamps,
    Stream,
    Timeline,
)
from syncline_design.logs.readers.timelines import timeline_of
from syncline_design.logs.refusals import refuse
from syncline_design.machine.deadline import in_force
from syncline_design.machine.quick_dataclass import dataclass

CHECK_EVERY = 8_192  # messages between two looks at the clock
MOST_CLOUDS = 12  # of a topic, that are unpacked to see when their points were measured
MOST_TOPICS = 20_000
LONGEST_NAME = 1_000  # characters of a topic or a type
RATIO, FREE_BYTES = 200, 1 << 30  # a file may unpack to this many times its size, and this much
RECORDED = "log time"
DAMAGED = "copy the file once more, or let the recorder's own tool repair it"


class DamagedError(Exception):
    """The rest of a file cannot be read; says why."""


def from_lz4(data: bytes, due: int, path: Path, format_: str) -> bytes:
    """A chunk unpacked to no more than is due."""
    lz4 = library("lz4.frame", path, format_)
    try:
        plain: bytes = lz4.LZ4FrameDecompressor().decompress(data, due + 1)
    except (RuntimeError, EOFError, ValueError):
        raise DamagedError("a chunk does not unpack") from None
    return plain


class RawMessage(NamedTuple):
    """A message as it stands in the file; publish_ns None where the format has no such time."""

    channel: BagChannel
    log_ns: int
    publish_ns: int | None
    data: bytes


class UnpackBudget:
    """How much a file may unpack to: a few kB must not become gigabytes."""

    def __init__(self, path: Path, size: int) -> None:
        self._path, self._left = path, FREE_BYTES + RATIO * size

    def spend(self, amount: int, most: int) -> None:
        """Before `amount` bytes are unpacked, of which at most `most` go at once."""
        self._left -= amount
        if amount > most or self._left < 0:
            found = f"a chunk of {amount} bytes" if amount > most else "more than that"
            limit = f"chunks of at most {most} bytes, {RATIO} times the file's size in all"
            raise refuse(self._path, "unpacks to too much", expected=limit, found=found)


@dataclass(slots=True)
class Lost:
    """What one pass left out between good messages: chunks, and messages of channels that are gone.

    first: what is wrong with the first of the chunks.
    """

    chunks: int = 0
    first: str = ""
    orphans: int = 0

    def add(self, damage: DamagedError) -> None:
        """Count one more damaged chunk."""
        self.chunks += 1
        self.first = self.first or str(damage)

    def said(self) -> str:
        """For people; empty where nothing was lost."""
        parts = []
        if self.chunks == 1:
            parts.append(f"1 damaged chunk was left out: {self.first}")
        elif self.chunks:
            parts.append(f"{self.chunks} damaged chunks were left out, the first: {self.first}")
        if self.orphans:
            parts.append(f"{self.orphans} messages of channels that stood in damaged chunks")
        return "; ".join(parts)


class Container(ABC):
    """A file of raw messages, read from front to back."""

    def __init__(self, path: Path, format: str) -> None:  # noqa: A002
        self.path, self.format = path, format
        self.incomplete: Incomplete | None = None
        self.cut = ""  # what is known of a cut before reading comes to it
        self.wanted: frozenset[str] | None = None  # the topics that are read; None: all
        self.lost = Lost()
        self.brief = False  # whether beginnings do of large messages, behind the first of a topic

    @abstractmethod
    def _read(self) -> Iterator[RawMessage]:
        """Every message in the order of the file; DamagedError where that ends early."""

    def _sound(self, found: Iterator[RawMessage]) -> Iterator[RawMessage]:
        """The messages of one chunk: damage costs what follows in it, and no other chunk."""
        try:
            yield from found
        except DamagedError as damage:
            self.lost.add(damage)

    def of_topics(self, topics: frozenset[str]) -> Iterator[RawMessage]:
        """The messages of some topics, and maybe of others, up to the last good one."""
        known, self.wanted = self.incomplete, topics
        try:
            yield from self.messages()
        finally:
            self.wanted, self.incomplete = None, known

    def beginnings(self) -> Iterator[RawMessage]:
        """Every message, of large ones what their stamps need, where the container can."""
        self.brief = True
        try:
            yield from self.messages()
        finally:
            self.brief = False

    def messages(self) -> Iterator[RawMessage]:
        """Every message up to the last good one; then `incomplete` is known."""
        deadline = in_force()
        count = 0
        self.incomplete, self.cut, self.lost = None, "", Lost()
        reason = ""
        try:
            for count, message in enumerate(self._read(), 1):
                if not count % CHECK_EVERY:
                    deadline.check()
                yield message
        except DamagedError as damage:
            reason = str(damage)
        said = [one for one in (self.cut or reason, self.lost.said()) if one]
        if said:
            self.incomplete = Incomplete("; ".join(said), count)
        if not count and self.incomplete is not None and self.wanted is None:
            raise refuse(
                self.path,
                f"no message of this {self.format} can be read",
                found=self.incomplete.reason,
                hint=DAMAGED,
            )


@dataclass(slots=True)
class _Tally:
    """What is held of a topic while a bag is read."""

    channel: BagChannel
    own_name: str
    own_of: StampOf | None
    meaning: TopicMeaning | None
    type_: MessageType | None
    logged: StampColumn = field(default_factory=StampColumn)
    own: StampColumn = field(default_factory=StampColumn)
    published_apart: bool = False
    messages: int = 0
    unread: str = ""  # why no message can be
    cut: int = 0  # messages too short for the stamp of their type
    clouds: list[CloudTimes] = field(default_factory=list)


class RosRecording:
    """A bag as a recording."""

    def __init__(self, container: Container) -> None:
        self._container = container
        self.path, self.format = container.path, container.format
        self._channels: dict[str, BagChannel] = {}
        self._known: dict[tuple[str, str], _Tally] = {}

    @property
    def incomplete(self) -> Incomplete | None:
        return self._container.incomplete

    def streams(self) -> tuple[Stream, ...]:
        tallies: dict[tuple[str, str], _Tally] = {}
        of_channel: dict[int, _Tally] = {}  # the container keeps its channels
        for message in self._container.beginnings():
            tally = of_channel.get(id(message.channel))
            if tally is None:
                key = (message.channel.topic, message.channel.kind)
                tally = tallies.get(key)
                if tally is None:
                    tally = tallies[key] = self._begun(message, len(tallies))
                if tally.channel is message.channel:
                    of_channel[id(message.channel)] = tally
            _count(tally, message)
        topics = [topic for topic, _ in tallies]
        found = []
        for (topic, kind), tally in tallies.items():
            name = topic if topics.count(topic) == 1 else f"{topic} ({kind})"
            self._channels[name] = tally.channel
            found.append(_stream(name, tally, self.incomplete is not None))
        return tuple(sorted(found, key=lambda stream: stream.name))

    def _begun(self, message: RawMessage, topics: int) -> _Tally:
        channel = message.channel
        if topics >= MOST_TOPICS:
            raise refuse(self.path, "too many topics", expected=f"at most {MOST_TOPICS}")
        if len(channel.topic) > LONGEST_NAME or len(channel.kind) > LONGEST_NAME:
            most, found = f"at most {LONGEST_NAME} characters", f"{channel.topic[:40]!r} ..."
            raise refuse(self.path, "a topic whose name is too long", expected=most, found=found)
        own = stamp_of(channel, self.path)
        known = has_meaning(channel.topic, channel.kind)
        type_ = type_of(channel, self.path) if known else None
        first = None if type_ is None else type_.unpacked(message.data)
        meaning = None if first is None else meaning_of(channel.topic, channel.kind, first)
        name, read = own or ("", None)
        begun = _Tally(channel, name, read, meaning, type_, unread=unread_of(channel, self.path))
        self._known[channel.topic, channel.kind] = begun
        return begun

    def _rows(self, message: RawMessage) -> TopicRows:
        """TopicRows of a topic, read as it was listed: its types are compiled once."""
        channel = message.channel
        tally = self._known.get((channel.topic, channel.kind)) or self._begun(message, 0)
        return TopicRows(tally.own_of, tally.meaning, tally.type_)

    def samples(self, name: str) -> Iterator[Piece]:
        if name not in self._channels:
            self.streams()
        wanted = self._channels.get(name)
        if wanted is None:
            raise refuse(self.path, f"no stream {name}", found=", ".join(sorted(self._channels)))
        collected: TopicRows | None = None
        for message in self._container.of_topics(frozenset({wanted.topic})):
            if message.channel.topic != wanted.topic or message.channel.kind != wanted.kind:
                continue
            if collected is None:
                collected = self._rows(message)
            collected.add(message.log_ns, message.data)
            if collected.held >= PIECE_ROWS:
                yield collected.piece()
        if collected is not None and collected.held:
            yield collected.piece()

    def together(self, names: Sequence[str]) -> Iterator[tuple[str, Piece]]:
        """The pieces of several streams in one pass over the file."""
        if not self._channels:
            self.streams()
        wanted = {(c.topic, c.kind): n for n, c in self._channels.items() if n in names}
        rows: dict[str, TopicRows] = {}
        of_channel: dict[int, tuple[str, TopicRows | None]] = {}  # the container keeps its channels
        for message in self._container.of_topics(frozenset(topic for topic, _ in wanted)):
            channel = message.channel
            known = of_channel.get(id(channel))
            if known is None:
                name = wanted.get((channel.topic, channel.kind), "")
                if name and name not in rows:
                    rows[name] = self._rows(message)
                known = of_channel[id(channel)] = (name, rows.get(name))
            collected = known[1]
            if collected is None:
                continue
            collected.add(message.log_ns, message.data)
            if collected.held >= PIECE_ROWS:
                yield known[0], collected.piece()
        for name, last in rows.items():
            if last.held:
                yield name, last.piece()


def _count(tally: _Tally, message: RawMessage) -> None:
    tally.messages += 1
    tally.logged.append(message.log_ns)
    published = message.publish_ns
    if tally.own_of is not None:
        own = tally.own_of(message.data)
        tally.cut += own == UNSET
        tally.own.append(own)
    elif published is not None:
        tally.own.append(published)
        tally.published_apart = tally.published_apart or published != message.log_ns
    meaning = tally.meaning
    if meaning is not None and meaning.is_cloud and len(tally.clouds) < MOST_CLOUDS:
        times = cloud_times(None if tally.type_ is None else tally.type_.unpacked(message.data))
        tally.clouds += [times] if times is not None else []


def _stream(name: str, tally: _Tally, partial: bool) -> Stream:
    meaning = tally.meaning
    stamps = _stamps(tally)
    timeline, said = timeline_of(stamps.primary_ns, "utc")
    notes = list(said)
    if stamps.secondary_ns is not None:
        notes += _recorder(timeline, stamps.secondary_ns)
    points = None
    if meaning is None:
        notes += [_unread(tally.channel)] if tally.channel.encoding == "other" else []
    else:
        notes += meaning.notes
        points = None if not tally.clouds else CloudTimes.median_of(tally.clouds)
    if tally.unread or tally.cut:
        short = f"{tally.cut} messages are too short for the stamp of their type"
        notes.append(tally.unread or short)
    return Stream(
        name=name,
        quantity=() if meaning is None else meaning.quantity,
        messages=tally.messages,
        stamps=stamps,
        frame="unknown" if meaning is None else meaning.frame,
        timeline=timeline,
        partial=partial,
        notes=tuple(notes),
        body="unknown" if meaning is None else meaning.body,
        kind=tally.channel.kind,
        columns=() if meaning is None else meaning.columns,
        points=points,
        static=() if meaning is None else meaning.static,
        unread=_unread_of(tally),
    )


def _unread_of(tally: _Tally) -> str:
    if tally.cut == tally.messages:
        return f"no message is long enough for the stamp of a {tally.channel.kind}"
    return tally.unread


def _stamps(tally: _Tally) -> Stamps:
    logged = tally.logged.values()
    if tally.own_of is not None:
        return Stamps(tally.own_name, RECORDED, tally.own.values(), logged)
    if tally.published_apart:
        return Stamps("publish time", RECORDED, tally.own.values(), logged)
    return Stamps(RECORDED, None, logged)


def _recorder(timeline: Timeline, logged: Nanoseconds) -> list[str]:
    own, _ = timeline_of(logged, "utc")
    return [] if own == timeline else [f"stamps are {timeline}, the recorder's time is {own}"]


def _unread(channel: BagChannel) -> str:
    return f"written as {channel.encoded or 'something else'}: only the recorder's times are read"
