"""What logs hold, and how they would map to a spec: the JSON of `log inspect`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Final, Literal

import numpy as np

from syncline_design import __version__
from syncline_design.logs.log_files import ONE_STAGE, roles_of_table, some_offers
from syncline_design.logs.proposal import Proposal, proposed
from syncline_design.logs.readers import open_recording
from syncline_design.logs.readers.stream import UNSET, Nanoseconds, Recording, Stream
from syncline_design.logs.readers.timelines import calendar
from syncline_design.logs.roles import ROLES, Role
from syncline_design.logs.run_parts import KnownRecording
from syncline_design.logs.static_arms import ArmBeside, arms_beside
from syncline_design.logs.table_streams import named_table
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.records import Record, SchemaName, optional
from syncline_design.model.figure_text import to_places
from syncline_design.spec.load import BadInput
from syncline_design.spec.log_block import LogChoice

SCHEMA: Final = "syncline-design/log/v1"
NANO: Final = 1e9
LEAST_STEP_S: Final = 1e-6  # between messages; what follows each other quicker are counts
CALENDARS: Final = ("utc", "gps", "tai")
_EMPTY: Final = "no message in it has a time; expected at least one message with a stamp"


@dataclass(frozen=True, slots=True)
class StampNames(Record):
    """What the two times of a message are called in the file."""

    primary: str
    secondary: str | None


@dataclass(frozen=True, slots=True)
class PointSpan(Record):
    """First and last point of a cloud after its stamp: medians of some clouds."""

    first_s: float
    last_s: float
    clouds: int


@dataclass(frozen=True, slots=True)
class InspectedStream(Record):
    """One stream.  first, last: its primary stamps in the file's order, in seconds of its own
    timeline; the same exact in nanoseconds, and as a calendar reads them.
    """

    name: str
    file: str
    kind: str
    quantity: tuple[str, ...]
    messages: int
    rate_hz: float | None
    first: float | None
    last: float | None
    stamps: StampNames | None
    timeline: Literal["utc", "gps", "tai", "boot", "unknown"]
    frame: Literal["wgs84", "enu", "ned", "utm", "unknown"]
    partial: bool
    body: Literal["flu", "frd", "unknown"]
    nature: Literal["measured", "fused", "truth", "unknown"]
    columns: tuple[str, ...]
    notes: tuple[str, ...]
    first_ns: int | None = optional()
    last_ns: int | None = optional()
    first_time: str | None = optional()
    last_time: str | None = optional()
    points: PointSpan | None = optional()


@dataclass(frozen=True, slots=True)
class CutShort(Record):
    """Why a file could not be read to its end."""

    reason: str
    messages: int


@dataclass(frozen=True, slots=True)
class InspectedFile(Record):
    """One file."""

    file: str
    format: str
    streams: int
    messages: int
    incomplete: CutShort | None


@dataclass(frozen=True, slots=True)
class UnreadFile(Record):
    """A file that gave nothing, and why."""

    file: str
    reason: str


@dataclass(frozen=True, slots=True)
class LogInspection(Record):
    """What some files hold."""

    schema: Annotated[str, SchemaName(SCHEMA)]
    version: str
    files: tuple[InspectedFile, ...]
    streams: tuple[InspectedStream, ...]
    proposal: Proposal
    unreadable: tuple[UnreadFile, ...]
    lever_arms: tuple[ArmBeside, ...] = ()

    @property
    def exit_code(self) -> int:
        """2 where a file gave nothing."""
        return 2 if self.unreadable else 0


def inspect_logs(
    paths: Sequence[Path], choice: LogChoice | None = None, poses: bool = True,
    arms: Mapping[str, tuple[float, float, float]] | None = None,
    stages: Sequence[str] = ONE_STAGE,
) -> LogInspection:  # fmt: skip
    """Read the files and propose a mapping; a file that cannot be read is told, not raised.

    choice: what a spec already says of its log.  poses: whether attitudes may be compared too.
    arms: the spec's lever arms by `stage.role`, to be held against those that a log states.
    stages: the spec's, by whose names columns of tables may begin.
    """
    choice = choice or LogChoice()
    recordings: list[Recording] = []
    unread = []
    files, streams = [], []
    for path in paths:
        try:
            recording = KnownRecording(_recording(path, choice, stages))
            found = [offer.stream for offer in some_offers([recording])]
        except BadInput as error:
            unread.append(UnreadFile(str(path), str(error)))
            continue
        roles = roles_of_table(path, choice.columns, stages)
        if found and not roles and all(_is_empty(one) for one in found):
            unread.append(UnreadFile(str(path), f"{path}: {_EMPTY}"))
            continue
        recordings.append(recording)
        files.append(_file(recording, found))
        outside = _outside(found)
        streams += [_stream(path, one, outside.get(one.name, ()), roles) for one in found]
    proposal = proposed(recordings, choice, poses, stages)
    static = [pose for one in recordings for stream in one.streams() for pose in stream.static]
    beside = arms_beside(static, arms or {})
    return LogInspection(
        SCHEMA, __version__, tuple(files), tuple(streams), proposal, tuple(unread), beside
    )  # fmt: skip


def _is_empty(stream: Stream) -> bool:
    """Whether a stream is of stamps alone, and none of them is a time."""
    if stream.stamps is None or stream.quantity or stream.static or stream.points is not None:
        return False
    kinds = (stream.stamps.primary_ns, stream.stamps.secondary_ns)
    return not any(one is not None and bool(np.any(one != UNSET)) for one in kinds)


def _recording(path: Path, choice: LogChoice, stages: Sequence[str]) -> Recording:
    """A file by its reader, else by the names that the spec gives its columns."""
    try:
        return open_recording(path)
    except BadInput:
        table = named_table(path, choice.columns, stages) if choice.columns else None
        if table is None:
            raise
        return table


def _file(recording: Recording, found: Sequence[Stream]) -> InspectedFile:
    cut = recording.incomplete
    return InspectedFile(
        str(recording.path),
        recording.format,
        len(found),
        sum(one.messages for one in found),
        None if cut is None else CutShort(cut.reason, cut.messages),
    )


def _stream(
    path: Path, one: Stream, more: Sequence[str], roles: frozenset[Role]
) -> InspectedStream:
    """roles: that the columns of a table name, which are not all quantities to its reader."""
    stamps = one.stamps
    known = np.zeros(0, dtype=np.int64)
    if stamps is not None:
        known = stamps.primary_ns[stamps.primary_ns != UNSET]
    first, last = (int(known[0]), int(known[-1])) if known.shape[0] else (None, None)
    dated = one.timeline in CALENDARS
    span = one.points
    return InspectedStream(
        name=one.name,
        file=str(path),
        kind=one.kind,
        quantity=tuple(dict.fromkeys((*one.quantity, *(r for r in ROLES if r in roles)))),
        messages=one.messages,
        rate_hz=rate_hz(known),
        first=None if first is None else first / NANO,
        last=None if last is None else last / NANO,
        stamps=None if stamps is None else StampNames(stamps.primary, stamps.secondary),
        timeline=one.timeline,
        frame=one.frame,
        partial=one.partial,
        body=one.body,
        nature=one.nature,
        columns=one.columns,
        notes=(*one.notes, *more),
        first_ns=first,
        last_ns=last,
        first_time=calendar(first) if dated and first is not None else None,
        last_time=calendar(last) if dated and last is not None else None,
        points=None if span is None else PointSpan(span.first_s, span.last_s, span.clouds),
    )


def rate_hz(stamps: Nanoseconds) -> float | None:
    """Messages a second while the stream runs: gaps, packets and stray stamps do not change it.

    Messages of one stamp over the usual time between different stamps.
    """
    different = np.unique(stamps)
    if different.shape[0] < 2:
        return None
    usual = float(np.median(np.diff(different))) / NANO
    return float(stamps.shape[0] / different.shape[0] / usual) if usual >= LEAST_STEP_S else None


def _outside(found: Sequence[Stream]) -> dict[str, tuple[str, ...]]:
    """What to say of streams whose stamps are unset or lie far from all others of the file."""
    most, ends = {}, []
    notes: dict[str, tuple[str, ...]] = {}
    for one in found:
        if one.stamps is None:
            continue
        stamps = one.stamps.primary_ns
        zeros = int(np.count_nonzero((stamps == 0) | (stamps == UNSET)))
        if zeros:
            notes[one.name] = (f"{zeros} of {one.messages} stamps are 0 or not set",)
        known = stamps[(stamps != UNSET) & (stamps != 0)]
        if known.shape[0]:
            first, last = np.quantile(known, (0.05, 0.95), method="nearest").tolist()
            most[one.name] = (first, int(np.median(known)), last)
            ends.append((int(known.min()), int(known.max()), one.timeline))
    if len(ends) < 3:
        return notes
    low, high = int(np.median([e[0] for e in ends])), int(np.median([e[1] for e in ends]))
    far = 2 * max(high - low, 1_000_000_000)
    # one that began long before the others were set lies about them and is not off
    for name, (first, middle, last) in most.items():
        if last < low - far or first > high + far:
            apart = (middle - high if middle > high else middle - low) / NANO
            words = (
                f"its stamps lie {to_places(apart, 3, sign=True)} s off those of the "
                f"file's other streams"
            )
            notes[name] = (*notes.get(name, ()), words)
    return notes
