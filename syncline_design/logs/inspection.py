"""What logs hold, and how they would map to a spec: the JSON of `log inspect`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Final, Literal

import numpy as np

from syncline_design import __version__
from syncline_design.logs.log import LogKind
from syncline_design.logs.readers import open_recording
from syncline_design.logs.readers.stream import UNSET, Nanoseconds, Recording, Stream
from syncline_design.logs.readers.timelines import calendar
from syncline_design.logs.roles import Offer, Part, Role, Sureness, offers_of, parts_of
from syncline_design.logs.run_parts import KnownRecording, one_run
from syncline_design.logs.sources import opened
from syncline_design.logs.static_arms import ArmBeside, arms_beside
from syncline_design.logs.stream_sources import is_pose_pair, sources_of
from syncline_design.logs.stream_values import ASSUMED_BODY, ASSUMED_FRAME
from syncline_design.logs.surveys import first_survey
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.records import Record, SchemaName, optional
from syncline_design.model.figure_text import to_places
from syncline_design.spec.edit import flow_text
from syncline_design.spec.load import BadInput
from syncline_design.spec.log_block import LogChoice

SCHEMA: Final = "syncline-design/log/v1"
NANO: Final = 1e9
LEAST_STEP_S: Final = 1e-6  # between messages; what follows each other quicker are counts
CALENDARS: Final = ("utc", "gps", "tai")


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
class ProposedPart(Record):
    """Which stream plays which part, how sure that is, and why."""

    role: Role
    stream: str
    file: str
    confidence: Sureness
    why: str


@dataclass(frozen=True, slots=True)
class ProposedBlock(Record):
    """A `log:` block that would read the files so; its keys are the spec's.

    streams: by the role that each plays; the others of streams that do not say so themselves.
    """

    streams: Mapping[Role, str] | None = optional()
    timeline: Literal["utc", "gps", "tai", "boot"] | None = optional()
    gps_week: int | None = optional()
    frame: Literal["enu", "ned"] | None = optional()
    body: Literal["flu", "frd"] | None = optional()


@dataclass(frozen=True, slots=True)
class Proposal(Record):
    """The mapping: as a `log:` block, and with reasons.

    kind: what `diagnose` would compare; None where something is lacking.  conversions: everything
    that is done to the values on the way.
    """

    kind: LogKind | None
    log: ProposedBlock
    block: str
    parts: tuple[ProposedPart, ...]
    conversions: tuple[str, ...]
    lacking: tuple[str, ...]


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
) -> LogInspection:  # fmt: skip
    """Read the files and propose a mapping; a file that cannot be read is told, not raised.

    choice: what a spec already says of its log.  poses: whether attitudes may be compared too.
    arms: the spec's lever arms by `stage.role`, to be held against those that a log states.
    """
    recordings: list[Recording] = []
    unread = []
    files, streams = [], []
    for path in paths:
        try:
            recording = KnownRecording(open_recording(path))
            found = recording.streams()
        except BadInput as error:
            unread.append(UnreadFile(str(path), str(error)))
            continue
        recordings.append(recording)
        files.append(_file(recording, found))
        outside = _outside(found)
        streams += [_stream(path, one, outside.get(one.name, ())) for one in found]
    offers = offers_of(one_run(recordings))
    proposal = _proposal(offers, choice or LogChoice(), poses)
    static = [pose for one in recordings for stream in one.streams() for pose in stream.static]
    beside = arms_beside(static, arms or {})
    return LogInspection(
        SCHEMA, __version__, tuple(files), tuple(streams), proposal, tuple(unread), beside
    )  # fmt: skip


def _file(recording: Recording, found: Sequence[Stream]) -> InspectedFile:
    cut = recording.incomplete
    return InspectedFile(
        str(recording.path),
        recording.format,
        len(found),
        sum(one.messages for one in found),
        None if cut is None else CutShort(cut.reason, cut.messages),
    )


def _stream(path: Path, one: Stream, more: Sequence[str]) -> InspectedStream:
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
        quantity=one.quantity,
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
    middles, ends = {}, []
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
            middles[one.name] = int(np.median(known))
            ends.append((int(known.min()), int(known.max()), one.timeline))
    if len(ends) < 3:
        return notes
    low, high = int(np.median([e[0] for e in ends])), int(np.median([e[1] for e in ends]))
    far = 2 * max(high - low, 1_000_000_000)
    for name, middle in middles.items():
        if not low - far <= middle <= high + far:
            apart = (middle - high if middle > high else middle - low) / NANO
            words = (
                f"its stamps lie {to_places(apart, 3, sign=True)} s off those of the "
                f"file's other streams"
            )
            notes[name] = (*notes.get(name, ()), words)
    return notes


def _proposal(offers: Sequence[Offer], choice: LogChoice, poses: bool) -> Proposal:
    if not offers:
        return Proposal(None, ProposedBlock(), "", (), (), ("no file could be read",))
    try:
        parts = parts_of(offers, choice)
    except BadInput as error:
        return Proposal(None, ProposedBlock(), "", (), (), (str(error),))
    lacking, conversions, shows = _tried(offers, choice, poses)
    shown = _used(parts, poses)
    named = {role: part for role, part in shown.items() if role in _NAMED or part.sure == "stated"}
    block = ProposedBlock(
        {role: _name(part.offer, offers) for role, part in named.items()} if shown else None,
        choice.timeline, choice.gps_week, *_axes(shown, choice, shows),
    )  # fmt: skip
    return Proposal(
        kind=None if lacking else _kind(shown, poses),
        log=block,
        block=_text(block),
        parts=tuple(
            ProposedPart(role, p.offer.name, str(p.offer.path), p.sure, p.why)
            for role, p in shown.items()
        ),
        conversions=conversions,
        lacking=lacking,
    )


_NAMED: Final = ("position", "attitude", "ranging", "target", "reference")


def _tried(
    offers: Sequence[Offer], choice: LogChoice, poses: bool
) -> tuple[tuple[str, ...], tuple[str, ...], bool]:
    """What keeps the mapping from working, else everything that it does to the values.

    And whether places in WGS 84 showed axes that a file does not tell.
    """
    try:
        lists = [o.path for o in offers if o.has("target") and o.stream.stamps is None]
        survey = first_survey([opened(path) for path in lists], choice.columns, ())
        sources = sources_of(offers, choice, "", poses, survey=survey)
    except BadInput as error:
        return (str(error),), (), False
    notes = tuple(dict.fromkeys(note for one in sources for note in one.notes))
    return (), notes, any(one.shown == "ned" for one in sources)


def _used(parts: dict[Role, Part], poses: bool) -> dict[Role, Part]:
    """As `diagnose` will use them: of two poses the attitude is the tested one's."""
    if not (poses and is_pose_pair(parts)):
        return parts
    tested = parts["position"]
    kept: dict[Role, Part] = {r: p for r, p in parts.items() if r != "rate"}
    kept["attitude"] = Part("attitude", tested.offer, tested.sure, "the tested trajectory's own")
    return kept


def _kind(parts: dict[Role, Part], poses: bool) -> LogKind:
    if "ranging" in parts:
        return "georeference"
    return "pose" if poses and is_pose_pair(parts) else "position"


def _name(offer: Offer, offers: Sequence[Offer]) -> str:
    """How the spec names a stream: by its own name, with its file's where several have it."""
    same = [one for one in offers if one.name == offer.name]
    return offer.name if len(same) == 1 else f"{offer.path.name}:{offer.name}"


def _axes(
    parts: dict[Role, Part], choice: LogChoice, shows: bool
) -> tuple[Literal["enu", "ned"] | None, Literal["flu", "frd"] | None]:
    """Frame and body as stated; where a stream in use does not tell, the assumed, to be seen.

    shows: places in WGS 84 showed one such stream to be north, east, down; beside another that
    does not tell, the block has one word for both and says none: `diagnose` looks again.
    """
    frame, body = choice.frame, choice.body
    streams = list({id(p.offer): p.offer.stream for p in parts.values()}.values())
    local = {"position_x_m", "quaternion_w", "velocity_x_mps"}
    untold = [s for s in streams if s.frame == "unknown" and local & set(s.columns)]
    if untold and frame is None:
        seen: Literal["ned"] | None = "ned" if len(untold) == 1 else None
        frame = seen if shows else ASSUMED_FRAME
    if any(s.body == "unknown" and "quaternion_w" in s.columns for s in streams):
        body = body or ASSUMED_BODY
    return frame, body


def _text(block: ProposedBlock) -> str:
    keys = block.to_json()
    return f"log: {flow_text(keys)}" if keys else ""
