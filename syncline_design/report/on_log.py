"""What `log inspect` says: files, streams, and the mapping with its reasons."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from syncline_design.logs.inspection import InspectedStream, LogInspection
from syncline_design.report import numbers
from syncline_design.report.document import (
    Document,
    Heading,
    Items,
    Node,
    Outcome,
    Text,
    code,
    given,
    provenance,
    section,
    show,
)
from syncline_design.report.numbers import MISSING
from syncline_design.report.rendered import rendered
from syncline_design.report.table import Cell, Table, Tone, table

_KINDS: Final = {
    "georeference": "places of surveyed targets, by position, attitude and ranges",
    "position": "positions against those of a better system",
    "pose": "two trajectories of one body, places and attitudes both",
}
_TONES: Final[dict[str, Tone]] = {"stated": "good", "high": "good", "medium": "warn", "low": "bad"}
_MARKS: Final = {"stated": "\u2713", "high": "\u2713", "medium": "~", "low": "?"}


def on_log(result: LogInspection) -> Document:
    """Logs as a document."""
    names = ", ".join(one.file.rpartition("/")[2] or one.file for one in result.files) or "no log"
    return Document(
        family="Log",
        outcome=_outcome(result),
        name=names,
        sentences=tuple(_sentences(result)),
        facts=tuple((one.format, given(_size(one.streams, one.messages))) for one in result.files),
        sections=(
            *section("lacking", "What is lacking for a diagnosis",
                     [Items(tuple(given(one) for one in result.proposal.lacking))]
                     if result.proposal.lacking and result.streams else [], "Lacking"),
            *section("proposal", "Mapping", _proposal(result), "Mapping"),
            *section("streams", "Streams", show(_streams(result), silent=True), "Streams"),
            *section("arms", "Lever arms that the log states", show(_arms(result)), "Lever arms"),
            *section("notes", "What the streams say of themselves", _notes(result), "Notes"),
            *section("unreadable", "Not read",
                     [Items(tuple(given(one.reason) for one in result.unreadable))]
                     if result.unreadable else [], "Not read"),
            *provenance([("syncline-design", result.version)]),
        ),
        title=f"Log: {names}",
    )  # fmt: skip


def _size(streams: int, messages: int) -> str:
    many = "s" if streams != 1 else ""
    return f"{numbers.count(streams)} stream{many}, {numbers.count(messages)} messages"


def _outcome(result: LogInspection) -> Outcome:
    if not result.streams:
        return Outcome("bad", "\u2717", "Nothing could be read")
    if result.unreadable:
        return Outcome("bad", "\u2717", "A file could not be read")
    if any(one.incomplete for one in result.files):
        return Outcome("warn", "!", "Read in part")
    if result.proposal.kind is None:
        return Outcome("warn", "!", "Read; no mapping for a diagnosis")
    return Outcome("good", "\u2713", "Read")


def _sentences(result: LogInspection) -> Iterator[str]:
    for one in result.files:
        if one.incomplete is not None:
            cut = one.incomplete
            yield (f"{one.file} is read up to message {numbers.count(cut.messages)}: "
                   f"{cut.reason}.")  # fmt: skip
    if result.proposal.kind is not None:
        yield f"A diagnosis would compare {_KINDS[result.proposal.kind]}."


def _proposal(result: LogInspection) -> list[Node]:
    proposal = result.proposal
    if not proposal.parts:
        return []
    rows = [
        (Cell(one.role), Cell(one.stream, code=True), Cell(one.confidence, None,
         _TONES[one.confidence], _MARKS[one.confidence]), Cell(one.why))
        for one in proposal.parts
    ]  # fmt: skip
    nodes: list[Node] = [
        *show(table("Which stream plays which part", ("Part", "Stream", "Sure", "Why"), rows)),
    ]
    if proposal.block:
        nodes += [Heading("For the spec"), Text(code(proposal.block))]
    if proposal.conversions:
        words = tuple(given(one) for one in proposal.conversions)
        nodes += [Heading("What is done to the values"), Items(words)]
    return nodes


def _streams(result: LogInspection) -> Table | None:
    if not result.streams:
        return None
    several = len(result.files) > 1
    rows = [
        (
            Cell(one.name, code=True, sub=one.file.rpartition("/")[2] if several else ""),
            Cell(", ".join(one.quantity) or MISSING, sub=one.kind),
            Cell(numbers.count(one.messages), float(one.messages)),
            Cell(MISSING if one.rate_hz is None else numbers.number(one.rate_hz), one.rate_hz),
            Cell(_moment(one, "first")),
            Cell(_moment(one, "last")),
            Cell(one.timeline, sub=_times(one)),
            Cell(one.frame, None, "warn" if one.partial else "", sub="in part" * one.partial),
        )
        for one in result.streams
    ]
    heads = ("Stream", "Measures", "Messages #", "Rate [Hz] #", "First", "Last", "Timeline",
             "Frame")  # fmt: skip
    return table("Streams", heads, rows)


def _arms(result: LogInspection) -> Table | None:
    """Every frame on the vehicle, and the spec's arm where the frame's name tells its role."""
    if not result.lever_arms:
        return None
    rows = [
        (
            Cell(one.frame, code=True, sub=f"in {one.body}"),
            Cell(_place(one.log_m)),
            Cell(one.role or MISSING),
            Cell(MISSING if one.spec_m is None else _place(one.spec_m)),
            Cell(MISSING if one.apart_m is None else numbers.length(one.apart_m), one.apart_m,
                 "" if one.agrees else "warn", "" if one.agrees else "!"),
        )
        for one in result.lever_arms
    ]  # fmt: skip
    heads = ("Frame", "Log: forward, right, down [m]", "Role", "Spec [m]", "Apart #")
    return table("Lever arms", heads, rows)


def _place(place: tuple[float, float, float]) -> str:
    return ", ".join(numbers.number(v, 4) for v in place)


def _moment(one: InspectedStream, end: str) -> str:
    dated = one.first_time if end == "first" else one.last_time
    seconds = one.first if end == "first" else one.last
    if dated is not None:
        return dated[:-3]
    return MISSING if seconds is None else f"{numbers.places(seconds, 6)} s"


def _times(one: InspectedStream) -> str:
    if one.stamps is None:
        return "none"
    second = one.stamps.secondary
    return one.stamps.primary if second is None else f"{one.stamps.primary}, {second}"


def _notes(result: LogInspection) -> list[Node]:
    used = {part.stream for part in result.proposal.parts}
    entries = [
        given(f"{one.name}: {note}")
        for one in result.streams
        for note in one.notes
        if one.name in used or "stamps" in note or "lever arm" in note
    ]
    return [Items(tuple(entries))] if entries else []


def render_log(name: str, result: LogInspection) -> str:
    """The inspection in one of the command's formats."""
    return rendered(name, result, lambda: on_log(result))
