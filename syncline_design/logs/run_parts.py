"""Files that are parts of one run (a bag split by size) read as one recording."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Final

import numpy as np

from syncline_design.logs.readers.stream import (
    UNSET,
    Incomplete,
    Piece,
    Recording,
    Stamps,
    Stream,
)

LEAST_SHARED: Final = 2  # streams of one name; files of one stream each are told by their names
SHARED: Final = 0.5  # of the streams of the poorer file


class KnownRecording:
    """A recording whose streams were listed once and are kept."""

    def __init__(self, recording: Recording) -> None:
        self._recording = recording
        self.path: Path = recording.path
        self.format = recording.format
        self._streams = recording.streams()

    @property
    def incomplete(self) -> Incomplete | None:
        return self._recording.incomplete

    def streams(self) -> tuple[Stream, ...]:
        return self._streams

    def samples(self, name: str) -> Iterator[Piece]:
        return self._recording.samples(name)

    def together(self, names: Sequence[str]) -> Iterator[tuple[str, Piece]]:
        """The pieces of several streams, in one pass where the format can."""
        yield from pieces_of(self._recording, names)


def pieces_of(recording: Recording, names: Sequence[str]) -> Iterator[tuple[str, Piece]]:
    """The pieces of several streams, each with its stream's name."""
    together = getattr(recording, "together", None)
    if together is not None:
        yield from together(names)
        return
    for name in names:
        for piece in recording.samples(name):
            yield name, piece


class RunParts:
    """Recordings of the same streams, one after the other."""

    def __init__(self, parts: Sequence[Recording]) -> None:
        self._parts = tuple(parts)
        self.path: Path = parts[0].path
        self.format = parts[0].format

    @property
    def incomplete(self) -> Incomplete | None:
        """The first part's that was cut."""
        return next((p.incomplete for p in self._parts if p.incomplete is not None), None)

    def streams(self) -> tuple[Stream, ...]:
        return streams_of([part.streams() for part in self._parts])

    def samples(self, name: str) -> Iterator[Piece]:
        for part in self._parts:
            if any(one.name == name for one in part.streams()):
                yield from part.samples(name)


def one_run(recordings: Sequence[Recording]) -> list[Recording]:
    """The recordings, those that are parts of one run as one, in the order of time."""
    groups: list[list[Recording]] = []
    for recording in recordings:
        known = recording if isinstance(recording, KnownRecording) else KnownRecording(recording)
        for group in groups:
            if known.format == group[0].format and alike(group[0].streams(), known.streams()):
                group.append(known)
                break
        else:
            groups.append([known])
    found: list[Recording] = []
    for group in groups:
        ordered = sorted(group, key=_span)
        apart = all(_span(a)[1] <= _span(b)[0] for a, b in pairwise(ordered))
        found += [RunParts(ordered)] if apart and len(group) > 1 else group
    return found


def alike(one: Sequence[Stream], other: Sequence[Stream], least: int = LEAST_SHARED) -> bool:
    """Whether two files hold the same streams, as many of them as that."""
    a, b = ({(s.name, s.kind) for s in streams} for streams in (one, other))
    shared = len(a & b)
    return shared >= least and shared >= SHARED * min(len(a), len(b))


def _span(recording: Recording) -> tuple[int, int]:
    """First and last moment of a file: medians over its streams, so that a stray one is nothing."""
    firsts, lasts = [], []
    for one in recording.streams():
        if one.stamps is None:
            continue
        known = one.stamps.primary_ns
        known = known[(known != UNSET) & (known != 0)]
        if known.shape[0] > 1:
            firsts.append(int(known.min()))
            lasts.append(int(known.max()))
    if not firsts:
        return 0, 0
    return int(np.median(firsts)), int(np.median(lasts))


def streams_of(parts: Sequence[Sequence[Stream]], note: str = "") -> tuple[Stream, ...]:
    """The streams of all parts by name; note: said of each that is in several."""
    found: dict[str, list[Stream]] = {}
    for part in parts:
        for one in part:
            found.setdefault(one.name, []).append(one)
    return tuple(_joined(found[name], note) for name in sorted(found))


def _joined(parts: Sequence[Stream], note: str) -> Stream:
    """A stream of several parts; the notes of all, each once, and one that says so."""
    first = parts[0]
    if len(parts) == 1:
        return first
    notes = [own for part in parts for own in part.notes]
    notes += [note] if note else []
    return replace(
        first,
        messages=sum(part.messages for part in parts),
        stamps=_stamps([part.stamps for part in parts]),
        partial=any(part.partial for part in parts),
        notes=tuple(dict.fromkeys(notes)),
    )


def _stamps(several: Sequence[Stamps | None]) -> Stamps | None:
    known = [one for one in several if one is not None]
    if not known:
        return None
    seconds = [one.secondary_ns for one in known if one.secondary_ns is not None]
    return Stamps(
        known[0].primary,
        known[0].secondary,
        np.concatenate([one.primary_ns for one in known]),
        np.concatenate(seconds) if len(seconds) == len(known) else None,
        known[0].primary_factor,
    )
