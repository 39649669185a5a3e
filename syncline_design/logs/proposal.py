"""The mapping that `log inspect` proposes: what plays which part in a diagnosis, and how."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final, Literal

from syncline_design.logs.log import LogKind
from syncline_design.logs.log_files import SortedFiles, some_offers, sorted_files, without_tables
from syncline_design.logs.readers.stream import Recording
from syncline_design.logs.reading import read_log
from syncline_design.logs.roles import ROLES, Offer, Part, Role, Sureness, parts_of
from syncline_design.logs.run_parts import one_run
from syncline_design.logs.stream_sources import StreamSource, is_pose_pair, left_of, sources_of
from syncline_design.logs.stream_values import ASSUMED_BODY, ASSUMED_FRAME
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.records import Record, optional
from syncline_design.spec.edit import flow_text
from syncline_design.spec.load import BadInput
from syncline_design.spec.log_block import LogChoice

_NAMED: Final = ("position", "attitude", "ranging", "target", "reference")
_ANY_LEVER_M: Final = 1.0  # at which poses are compared here, where only rows are counted


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


def proposed(
    recordings: Sequence[Recording], choice: LogChoice, poses: bool, stages: Sequence[str]
) -> Proposal:
    """What `diagnose` would do with some opened files.

    poses: whether attitudes may be compared too.  stages: the spec's.
    """
    if not recordings:
        return _nothing("no file could be read")
    try:
        files = sorted_files([one.path for one in recordings], choice.columns, stages)
        if not files.recordings:
            return _of_tables(files, choice, poses, stages)
        run = one_run([one for one in recordings if one.path in files.recordings])
        offers = some_offers(run)
        return _of_streams(offers, files, without_tables(choice, files, offers), poses)
    except BadInput as error:
        return _nothing(str(error))


def _nothing(lacking: str) -> Proposal:
    return Proposal(None, ProposedBlock(), "", (), (), (lacking,))


def _of_tables(
    files: SortedFiles, choice: LogChoice, poses: bool, stages: Sequence[str]
) -> Proposal:
    """Of tables alone, whose columns say by their names what they are: nothing is to be mapped."""
    kind, conversions, lacking = None, tuple[str, ...](), tuple[str, ...]()
    try:
        lever = _ANY_LEVER_M if poses else None
        log = read_log(files.tables, stages, choice.columns, False, 0.0, choice.origin, lever)
        kind, conversions = log.kind, log.notes
    except BadInput as error:
        lacking = (str(error),)
    return Proposal(kind, ProposedBlock(), "", _parts_of_tables(files), conversions, lacking)


def _parts_of_tables(files: SortedFiles) -> tuple[ProposedPart, ...]:
    return tuple(
        ProposedPart(role, table.path.stem, str(table.path), "stated", "its columns say so")
        for role in ROLES
        for table, held in zip(files.tables, files.held_by, strict=True)
        if role in held
    )


def _of_streams(
    offers: Sequence[Offer], files: SortedFiles, choice: LogChoice, poses: bool
) -> Proposal:
    """Of recordings, for the parts that no table beside them plays."""
    parts = left_of(parts_of(offers, choice, surveyed="target" in files.held), files.held)
    lacking, conversions, sources = _tried(offers, files, choice, poses)
    shown = _used(parts, poses)
    named = {role: part for role, part in shown.items() if role in _NAMED or part.sure == "stated"}
    block = ProposedBlock(
        {role: _name(part.offer, offers) for role, part in named.items()} if shown else None,
        choice.timeline, choice.gps_week, *_axes(shown, choice, sources),
    )  # fmt: skip
    return Proposal(
        kind=None if lacking else _kind({*shown, *files.held}, is_pose_pair(shown) and poses),
        log=block,
        block=_text(block),
        parts=(
            *_parts_of_tables(files),
            *(ProposedPart(role, p.offer.name, str(p.offer.path), p.sure, p.why)
              for role, p in shown.items()),
        ),
        conversions=conversions,
        lacking=lacking,
    )  # fmt: skip


def _tried(
    offers: Sequence[Offer], files: SortedFiles, choice: LogChoice, poses: bool
) -> tuple[tuple[str, ...], tuple[str, ...], Sequence[StreamSource]]:
    """What keeps the mapping from working, else all that it does to the values, and these."""
    try:
        sources = sources_of(offers, choice, "", poses, files.held, files.survey)
    except BadInput as error:
        return (str(error),), (), ()
    notes = tuple(dict.fromkeys(note for one in sources for note in one.notes))
    return (), notes, sources


def _used(parts: dict[Role, Part], poses: bool) -> dict[Role, Part]:
    """As `diagnose` will use them: of two poses the attitude is the tested one's."""
    if not (poses and is_pose_pair(parts)):
        return parts
    tested = parts["position"]
    kept: dict[Role, Part] = {r: p for r, p in parts.items() if r != "rate"}
    kept["attitude"] = Part("attitude", tested.offer, tested.sure, "the tested trajectory's own")
    return kept


def _kind(roles: set[Role], pair: bool) -> LogKind:
    if "ranging" in roles:
        return "georeference"
    return "pose" if pair else "position"


def _name(offer: Offer, offers: Sequence[Offer]) -> str:
    """How the spec names a stream: by its own name, with its file's where several have it."""
    same = [one for one in offers if one.name == offer.name]
    return offer.name if len(same) == 1 else f"{offer.path.name}:{offer.name}"


def _axes(
    parts: dict[Role, Part], choice: LogChoice, sources: Sequence[StreamSource]
) -> tuple[Literal["enu", "ned"] | None, Literal["flu", "frd"] | None]:
    """Frame and body as stated; where a stream in use does not tell, the assumed, to be seen.

    Places in WGS 84 may have shown one such stream to be north, east, down; beside another that
    does not tell, the block has one word for both and says none: `diagnose` looks again.  So for
    body axes, where one of two streams would be upside down.
    """
    frame, body = choice.frame, choice.body
    streams = list({id(p.offer): p.offer.stream for p in parts.values()}.values())
    local = {"position_x_m", "quaternion_w", "velocity_x_mps"}
    untold = [s for s in streams if s.frame == "unknown" and local & set(s.columns)]
    if untold and frame is None:
        seen: Literal["ned"] | None = "ned" if len(untold) == 1 else None
        shows = any(one.shown == "ned" for one in sources)
        frame = seen if shows else ASSUMED_FRAME
    if any(s.body == "unknown" and "quaternion_w" in s.columns for s in streams):
        taken = {one.shown_body for one in sources if one.shown_body is not None}
        only = ASSUMED_BODY if not taken else taken.pop() if len(taken) == 1 else None
        body = body or only
    return frame, body


def _text(block: ProposedBlock) -> str:
    keys = block.to_json()
    return f"log: {flow_text(keys)}" if keys else ""
