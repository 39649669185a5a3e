"""Files as they were opened, and which of them are one recording.

CSV files are streams of one recorder.  A bag that its recorder split by size or by time is several
files of the same streams, each of which begins when the one before ends: they are audited as one,
for what goes wrong where two of them meet shows in neither.  Files of two runs do not adjoin.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

from syncline_design.auditing.series import NS
from syncline_design.logs.readers.stream import UNSET, Incomplete, Nanoseconds, Stream
from syncline_design.logs.run_parts import alike, streams_of
from syncline_design.machine.quick_dataclass import dataclass

_CSV: Final = "CSV"
_ADJOIN_S: Final = 1.0  # between the receipts of one part and of the next, ...
_INTERVALS: Final = 10.0  # ... or so many intervals of the stream that tells most of it
_BACK_S: Final = 0.1  # what was still under way when the file was closed


@dataclass(frozen=True, slots=True)
class FileStreams:
    """One file's streams, or those of all parts of a recording, by the first of them."""

    path: Path
    format: str
    streams: tuple[Stream, ...]
    incomplete: Incomplete | None


@dataclass(frozen=True, slots=True)
class _Span:
    """When a file's messages were received [s]; interval_s: usual one of its quickest stream."""

    first_s: float
    last_s: float
    interval_s: float


_Timed = tuple[FileStreams, _Span | None]
_Folder = tuple[FileStreams, ...]  # the tables of one folder, or one file of another kind


def recordings(opened: Sequence[FileStreams]) -> list[list[FileStreams]]:
    """Files of one recorder: every CSV file is one stream of it, parts of a recording are one."""
    whole = _with_parts_joined(_with_folders_joined(opened))
    tables = [one for one in whole if one.format.startswith(_CSV)]
    others = [one for one in whole if not one.format.startswith(_CSV)]
    return ([tables] if tables else []) + [[one] for one in others]


def _with_folders_joined(opened: Sequence[FileStreams]) -> list[FileStreams]:
    """Folders of tables that are parts of one recording, as bags of several streams are: one of
    their streams may miss what lies about the border."""
    folders: dict[Path, list[FileStreams]] = {}
    for one in opened:
        if one.format.startswith(_CSV):
            folders.setdefault(one.path.parent, []).append(one)
    timed = [(_as_one(folder), tuple(folder)) for folder in folders.values()]
    joined = [one for one in opened if not one.format.startswith(_CSV)]
    for chain in _chains([(one, _span(one)) for one, _ in timed]):
        bundles = [next(files for own, files in timed if own is part) for part, _ in chain]
        joined += _by_name(bundles)
    return joined


def _as_one(folder: Sequence[FileStreams]) -> FileStreams:
    streams = tuple(stream for one in folder for stream in one.streams)
    return FileStreams(folder[0].path, folder[0].format, streams, None)


def _by_name(bundles: Sequence[_Folder]) -> list[FileStreams]:
    found: dict[tuple[str, int], list[FileStreams]] = {}
    for bundle in bundles:
        names = [one.path.name for one in bundle]  # a file that is given twice is two
        for k, one in enumerate(bundle):
            found.setdefault((names[k], names[:k].count(names[k])), []).append(one)
    return [_one_recording(parts) for parts in found.values()]


def _with_parts_joined(opened: Sequence[FileStreams]) -> list[FileStreams]:
    chains = _chains([(one, _span(one)) for one in opened])
    return [_one_recording([part for part, _ in chain]) for chain in chains]


def _chains(timed: Sequence[_Timed]) -> list[list[_Timed]]:
    """What begins when another one ends, after it."""
    chains: list[list[_Timed]] = []
    for one in sorted(timed, key=lambda one: 0.0 if one[1] is None else one[1].first_s):
        before = next((chain for chain in chains if _adjoin(chain[-1], one)), None)
        if before is None:
            chains.append([one])
        else:
            before.append(one)
    return chains


def _adjoin(one: _Timed, other: _Timed) -> bool:
    (before, earlier), (after, later) = one, other
    if earlier is None or later is None or before.format != after.format:
        return False
    apart = later.first_s - earlier.last_s
    near = max(_ADJOIN_S, _INTERVALS * max(earlier.interval_s, later.interval_s))
    return -_BACK_S <= apart <= near and alike(before.streams, after.streams, 1)


def _span(one: FileStreams) -> _Span | None:
    """None of a file whose messages were received at no known time."""
    received = [each for stream in one.streams if (each := _received(stream)) is not None]
    times = [each[each != UNSET] for each in received]
    known = [each for each in times if each.size > 1]
    if not known:
        return None
    first, last = min(int(t.min()) for t in known), max(int(t.max()) for t in known)
    return _Span(first / NS, last / NS, (last - first) / NS / max(t.size for t in known))


def _received(stream: Stream) -> Nanoseconds | None:
    return None if stream.stamps is None or stream.unread else stream.stamps.secondary_ns


def _one_recording(parts: Sequence[FileStreams]) -> FileStreams:
    if len(parts) == 1:
        return parts[0]
    names = ", ".join(part.path.name for part in parts[1:])
    note = f"read on from {parts[0].path.name} into {names}: parts of one recording"
    streams = streams_of([part.streams for part in parts], note)
    return FileStreams(parts[0].path, parts[0].format, streams, None)
