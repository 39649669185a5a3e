"""What `audit` says: the verdict, every stream with its faults, what is left, what stays open."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Final

from syncline_design.auditing.result import Audit, IncompleteFile, StampFault, StreamAudit
from syncline_design.auditing.stream import is_receipt
from syncline_design.report import numbers
from syncline_design.report.document import (
    Chart,
    Document,
    Heading,
    Inline,
    Items,
    Node,
    Outcome,
    Span,
    Text,
    code,
    given,
    muted,
    pins,
    provenance,
    section,
    show,
)
from syncline_design.report.rendered import rendered
from syncline_design.report.table import Cell, Table, table

if TYPE_CHECKING:
    from syncline_design.report.svg import InlineChart

MOST_DRAWN: Final = 40  # streams of a page
WORDS: Final[Mapping[str, str]] = {
    "epoch_offset": "another epoch, scale or unit",
    "whole_second_slip": "whole seconds off",
    "step": "the clock jumps",
    "drift": "the clock runs fast or slow",
    "counter_wrap": "a counter begins anew",
    "relock": "a clock that settles after it lost its reference",
    "packetised": "stamped when a packet came",
    "truncated_stamps": "stamps cut off",
    "stamped_on_arrival": "stamped when it came",
    "end_of_scan": "stamp of the scan's end",
    "start_of_scan": "stamp of the scan's start",
    "duplicates": "stamps that come twice",
    "backward_jump": "stamps go back",
    "gap": "nothing for a while",
    "lost_messages": "single messages missing",
    "unset_stamps": "stamps of zero",
    "ahead_of_receipt": "stamps after their receipt",
    "batched_by_recorder": "written in batches",
    "recorder_clock": "the recorder's clock was set",
    "wrong_receipts": "receipts of single messages wrong",
}
MEND: Final[Mapping[str, str]] = {
    "epoch_offset": "subtract the constant, or give the driver the right scale or unit",
    "whole_second_slip": "pair the pulse with the message that follows it; repair the stretch",
    "step": "discipline the clock before the run; split the log at the step",
    "drift": "discipline the clock (PPS, PTP, NTP), or take the drift out of the stamps",
    "counter_wrap": "unwrap the counter in the driver",
    "relock": "leave the stretch out; let the clock lock before the run",
    "packetised": "set the serial chip's latency timer to 1 ms, or stamp by PPS",
    "truncated_stamps": "write stamps with all their digits",
    "stamped_on_arrival": "let the sensor stamp (PPS, trigger); diagnose finds the mean latency",
    "end_of_scan": "declare which end of a scan the stamp is of",
    "start_of_scan": "declare which end of a scan the stamp is of",
    "duplicates": "drop the repeated messages, or mend the driver that stamps anew too late",
    "backward_jump": "leave out what is far off, sort the rest; look at what set the clock",
    "gap": "leave the stretch out; look at cable, driver and recorder",
    "lost_messages": "enlarge queues, lower the rate; nothing to mend in the stamps",
    "unset_stamps": "drop these messages; wait for the first fix before recording",
    "ahead_of_receipt": "bring both clocks to one reference (PTP, NTP)",
    "recorder_clock": "do not let the recording host's clock be set during a run",
    "wrong_receipts": "leave these messages out; look at the recorder and at the file's medium",
}


def on_audit(result: Audit) -> Document:
    """An audit as a document."""
    return Document(
        family="Audit of stamps",
        outcome=_outcome(result),
        name=_name(result),
        sentences=tuple(_sentences(result)),
        facts=tuple(_facts(result)),
        sections=(
            *section("incomplete", "Files that are damaged",
                     _files("Damaged", (*result.damaged, *result.unreadable)), "Damaged"),
            *section("unexamined", "What was not examined",
                     _files("Not examined", result.unexamined), "Not examined"),
            *section("faults", "Faults by stream", list(_faults(result)), "Faults"),
            *section("left", "What is left once every named fault is out",
                     show(_left(result), silent=True), "Residuals"),
            *section("streams", "Streams", show(_streams(result), silent=True)),
            *section("offsets", "Receipt minus stamp over time", list(_charts(result)),
                     "Over time"),
            *section("roles", "What each stream was taken as", _roles(result), "Roles"),
            *section("open", "What these stamps cannot show", _open(result), "Cannot show"),
            *section("notes", "Notes", [Items(tuple(given(n) for n in result.notes))]
                     if result.notes else []),
            *section("evidence", "Evidence", show(_evidence(result), silent=True)),
            *provenance(_provenance(result)),
        ),
        title=f"Audit: {_name(result)}",
    )  # fmt: skip


def _provenance(result: Audit) -> list[tuple[str, str]]:
    """What the figures are pinned by; those in metres by a spec besides."""
    spec = result.spec
    if spec is None:
        return [("syncline-design", result.version)]
    own = pins(result.version, spec.spec_sha256, spec.catalogs_sha256, spec.seed)
    return [("Spec file", spec.file), *own]


def _name(result: Audit) -> str:
    files = [one.file.rstrip("/").rsplit("/", 1)[-1] for one in result.evidence]
    return files[0] if len(files) == 1 else f"{files[0]} and {len(files) - 1} more"


def _faulty(result: Audit) -> list[StreamAudit]:
    return [row for row in result.streams if not row.sound]


def _outcome(result: Audit) -> Outcome:
    if result.verdict == "sound":
        if not any(row.examined for row in result.streams):
            return Outcome("warn", "!", "Nothing examined")
        if result.damaged or result.unreadable or result.unexamined:
            return Outcome("warn", "!", "Sound as far as it was read")
        return Outcome("good", "\u2713", "Sound")
    count = len({(f.fault, r.name, f.from_s) for r in result.streams for f in r.faults if f.counts})
    return Outcome("bad", "\u2717", f"{count} fault{'' if count == 1 else 's'}")


def _sentences(result: Audit) -> Iterator[Inline]:
    faulty = _faulty(result)
    told = [row for row in result.streams if row.examined]
    if not told:
        yield "Of no stream do stamps say anything."
    elif not faulty:
        yield f"No fault in the stamps of {len(told)} stream{'' if len(told) == 1 else 's'}."
    else:
        names = ", ".join(row.name for row in faulty[:6])
        more = f" and {len(faulty) - 6} more" if len(faulty) > 6 else ""
        of = len(result.streams)
        have = "stream has" if of == 1 else "streams have"
        yield f"{len(faulty)} of {of} {have} faults: {names}{more}."
    if any(f.fault == "recorder_clock" for row in result.streams for f in row.faults):
        yield "The recorder's own clock moved: every stream shows it, none of them is to blame."
    if result.unreadable:
        files = ", ".join(one.file for one in result.unreadable)
        yield f"Nothing could be read of {files}."
    for one in result.unexamined:
        yield f"Of {one.file}: {one.reason}."


def _facts(result: Audit) -> Iterator[tuple[str, str]]:
    yield "Streams", numbers.count(len(result.streams))
    yield "Messages", numbers.count(sum(row.messages for row in result.streams))
    lengths = [row.duration_s for row in result.streams if row.duration_s is not None]
    if lengths:
        yield "Longest stream", numbers.time(max(lengths))


def _files(name: str, files: Sequence[IncompleteFile]) -> list[Node]:
    rows = [
        (Cell(one.file), one.reason, Cell(numbers.count(one.messages), one.messages))
        for one in files
    ]
    return show(table(name, ("File", "Why", "Messages read #"), rows), silent=True)


def _faults(result: Audit) -> Iterator[Node]:
    for row in result.streams:
        if not row.faults:
            continue
        mark, tone = ("\u2713", "good") if row.sound else ("\u2717", "bad")
        yield Heading((given(row.name),), aside=f"{mark} {_kind(row)}")
        yield Items(tuple(_fault_line(fault) for fault in row.faults), mark=mark, tone=tone)  # type: ignore[arg-type]


def _kind(row: StreamAudit) -> str:
    rate = "" if row.rate_hz is None else f", {numbers.number(row.rate_hz, 3)} Hz"
    return f"{row.messages} messages{rate}"


def _fault_line(fault: StampFault) -> Inline:
    parts: list[str | Span] = [code(fault.fault), " ", _when(fault), given(fault.evidence)]
    for after in fault.consequences:
        parts += [muted(f"; follows: {after.fault} ({after.evidence})")]
    mend = MEND.get(fault.fault)
    if fault.counts and mend:
        parts.append(muted(f". To mend: {mend}."))
    return tuple(parts)


def _when(fault: StampFault) -> str:
    if fault.from_s is None:
        return ""
    if fault.to_s is None or fault.to_s <= fault.from_s:
        return f"at {_clock(fault.from_s)}: "
    return f"{_clock(fault.from_s)} to {_clock(fault.to_s)}: "


def _clock(seconds: float) -> str:
    return f"{numbers.places(seconds, 2)}\N{NO-BREAK SPACE}s"


def _charts(result: Audit) -> Iterator[Node]:
    rows = [row for row in result.streams if row.trace]
    shown = sorted(rows, key=lambda row: row.sound)[:MOST_DRAWN]
    if shown:
        words = ("One row a stream: least and largest receipt minus stamp of each stretch, without "
                 "the median; where a fault begins and ends is marked.")  # fmt: skip
        yield Chart("traces", _drawer(shown), words)
    if len(rows) > len(shown):
        yield Text(f"and {len(rows) - len(shown)} sound streams more", quiet=True, reach="page")


def _drawer(rows: list[StreamAudit]) -> Callable[[], InlineChart]:
    def draw() -> InlineChart:
        from syncline_design.report.charts_audit import traces

        return traces(rows)

    return draw


def _streams(result: Audit) -> Table:
    rows = [
        (
            _named(row),
            Cell(numbers.count(row.messages), row.messages),
            Cell(numbers.number(row.rate_hz, 4), row.rate_hz),
            row.shape,
            row.stamps.primary or "none",
            _receipt(row),
            row.timeline,
            Cell(numbers.time(row.offset_s), row.offset_s),
            ", ".join(dict.fromkeys(f.fault for f in row.faults)),
        )
        for row in result.streams
    ]  # fmt: skip
    heads = ("Stream", "Messages #", "Rate [Hz] #", "Rhythm", "Stamp", "Receipt", "Timeline",
             "Stamp \N{MINUS SIGN} receipt #", "Faults")  # fmt: skip
    return table("Streams", heads, rows)


def _receipt(row: StreamAudit) -> str:
    """What the file calls its receipts; a second time of the stamps' own clock is none."""
    second = row.stamps.secondary
    return f"none ({second}: same clock)" if second and not is_receipt(second) else second or "none"


def _named(row: StreamAudit) -> Cell:
    """A stream's name, marked as sound, as one with faults, or not at all."""
    sub = "partial" if row.partial else ""
    if not row.examined:
        return Cell(row.name, code=True, sub=sub)
    good = row.sound
    return Cell(row.name, code=True, tone="good" if good else "bad",
                mark="\u2713" if good else "\u2717", sub=sub)  # fmt: skip


def _left(result: Audit) -> Table:
    rows = [
        (
            Cell(row.name, code=True, sub=row.role or ""),
            Cell(numbers.time(row.residual_s.bound), row.residual_s.bound),
            Cell(numbers.time(row.residual_s.p95), row.residual_s.p95),
            Cell(numbers.time(row.residual_s.as_recorded), row.residual_s.as_recorded),
            Cell("" if row.role is None else numbers.time_limit(row.tau_crit_s), row.tau_crit_s),
            _share(row),
            Cell("" if row.error_m is None else numbers.length(row.error_m), row.error_m),
            Cell(numbers.time(row.smallest_seen.step_s, 2), row.smallest_seen.step_s),
            Cell(_ppm(row.smallest_seen.drift_ppm), row.smallest_seen.drift_ppm),
        )
        for row in result.streams if row.residual_s.bound is not None
    ]  # fmt: skip
    heads = ("Stream", "At most #", "95 % #", "As recorded #", "\u03c4_crit #",
             "At most / \u03c4_crit #", "Error at most #", "Would show a step of #",
             "Would show a drift of #")  # fmt: skip
    return table("Residuals", heads, rows)


def _ppm(value: float | None) -> str:
    return numbers.MISSING if value is None else f"{numbers.number(value, 2)}\N{NO-BREAK SPACE}ppm"


def _share(row: StreamAudit) -> Cell:
    known = row.error_m is not None and row.residual_s.bound is not None
    if not known or row.tau_crit_s is None or row.residual_s.bound is None:
        return Cell("")  # stamped in hardware: receipts say nothing of it
    share = row.residual_s.bound / row.tau_crit_s
    kept = share < 1.0
    return Cell(numbers.percent(share), share, "good" if kept else "warn",
                "\u2713" if kept else "!")  # fmt: skip


def _roles(result: Audit) -> list[Node]:
    lines = tuple(
        (given(row.name), ": ", given(row.notes[-1])) for row in result.streams
        if row.role is not None and row.notes
    )  # fmt: skip
    return [Items(lines)] if lines else []


def _open(result: Audit) -> list[Node]:
    lines = tuple(
        (given(row.name), ": ", given("; ".join(row.cannot_show)))
        for row in result.streams if row.cannot_show
    )  # fmt: skip
    return [Items(lines)] if lines else []


def _evidence(result: Audit) -> Table:
    rows = [(Cell(one.file), Cell(one.sha256, code=True)) for one in result.evidence]
    return table("Evidence", ("File", "SHA-256"), rows)


def render_audit(name: str, result: Audit) -> str:
    """The text of one format."""
    return rendered(name, result, lambda: on_audit(result))
