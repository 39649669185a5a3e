"""Files to an audit: opened by content, every stream examined, streams held against each other."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

import numpy as np

from syncline_design import __version__
from syncline_design.auditing.file_streams import FileStreams, recordings
from syncline_design.auditing.grains import cut_to_one_interval
from syncline_design.auditing.recorder import without_recorder_clock
from syncline_design.auditing.result import (
    Audit,
    IncompleteFile,
    ResidualTime,
    SmallestSeen,
    StampFault,
    StampNames,
    StreamAudit,
)
from syncline_design.auditing.second_time import TwoTimes, two_times
from syncline_design.auditing.series import in_words
from syncline_design.auditing.stream import Examined, examined, is_receipt
from syncline_design.auditing.swells import without_swells
from syncline_design.auditing.together import held_together
from syncline_design.logs.readers import open_recording
from syncline_design.logs.readers.stream import UNSET, Stream
from syncline_design.logs.refusals import refuse
from syncline_design.machine.deadline import in_force
from syncline_design.machine.input_files import ContentsBeside, FileRead, note_read
from syncline_design.model.figure_text import percent
from syncline_design.spec.load import BadInput

_TOLD: Final = 2.0  # times the bound, from which what the stamps leave a rhythm by is told
_TURN: Final = 1.3  # grains that a clock may run on by until a grid's edge shows


def audit(paths: Sequence[Path]) -> Audit:
    """Audit all files; BadInput where none could be read."""
    contents = ContentsBeside([one for path in paths for one in files_of(path)])
    opened, refused, problems = _open(paths)
    if not opened:
        raise BadInput(tuple(flaw for error in problems for flaw in error.problems))
    rows: list[StreamAudit] = []
    for group in recordings(opened):
        rows += _rows(group)
    damaged = tuple(
        IncompleteFile(str(o.path), o.incomplete.reason, o.incomplete.messages)
        for o in opened if o.incomplete is not None
    )  # fmt: skip
    return Audit(
        verdict="sound" if all(row.sound for row in rows) else "faults",
        streams=tuple(rows),
        incomplete=damaged[0] if damaged else None,
        damaged=damaged,
        unreadable=refused,
        unexamined=tuple(one for o in opened for one in _unexamined(o)),
        evidence=_evidence(opened, contents),
        notes=_notes(rows),
        version=__version__,
    )


def _open(
    paths: Sequence[Path],
) -> tuple[list[FileStreams], tuple[IncompleteFile, ...], list[BadInput]]:
    opened: list[FileStreams] = []
    refused: list[IncompleteFile] = []
    problems: list[BadInput] = []
    for path in paths:
        in_force().doing(f"reading {path.name}")
        try:
            recording = open_recording(path)
            streams = recording.streams()
            note_read(path)
        except BadInput as error:
            problems.append(error)
            refused.append(IncompleteFile(str(path), str(error), 0))
            continue
        lacks = _lacks(streams)
        if lacks is not None:
            refused.append(IncompleteFile(str(path), lacks, 0))
            problems.append(refuse(path, lacks, expected="at least one message with a stamp"))
            continue
        opened.append(FileStreams(path, recording.format, streams, recording.incomplete))
    return opened, tuple(refused), problems


def _unexamined(opened: FileStreams) -> Iterator[IncompleteFile]:
    """Streams that could not be read, and a file of which none was examined: no word is said of
    their stamps, so that they are not sound."""
    for stream in opened.streams:
        if stream.unread:
            reason = f"{stream.name} was not examined: {stream.unread}"
            yield IncompleteFile(str(opened.path), reason, stream.messages)
    if not any(_is_told(one) or one.unread for one in opened.streams):
        reason = f"no stream of it was examined: {_why_untold(opened.streams[0])}"
        yield IncompleteFile(str(opened.path), reason, sum(s.messages for s in opened.streams))


def _lacks(streams: Sequence[Stream]) -> str | None:
    """Why a file gives nothing to audit; None where any message has a time of either kind."""
    if not any(one.messages for one in streams):
        return "no message in it"
    timed = any(_timed(one) for one in streams)
    return None if timed else "no message in it has a time"


def _timed(stream: Stream) -> bool:
    """Whether any message has a time of any kind."""
    if stream.stamps is None:
        return False
    kinds = (stream.stamps.primary_ns, stream.stamps.secondary_ns)
    return any(one is not None and bool(np.any(one != UNSET)) for one in kinds)


def _rows(group: Sequence[FileStreams]) -> list[StreamAudit]:
    in_force().doing("auditing stamps")
    starts = [s for o in group for stream in o.streams if (s := _first(stream)) is not None]
    start = min(starts) if starts and max(starts) - min(starts) < 10**15 else None
    told = [(o, s) for o in group for s in o.streams if _is_told(s)]
    alone = [examined(stream, start) for _, stream in told]
    found = without_swells(held_together(without_recorder_clock(alone, start)))
    rows = [_row(o, one) for (o, _), one in zip(told, found, strict=True)]
    rows += [_untold(o, s) for o in group for s in o.streams if not _is_told(s)]
    return sorted(rows, key=lambda row: (row.file, row.name))


def _first(stream: Stream) -> int | None:
    if stream.stamps is None or not stream.messages:
        return None
    times = stream.stamps.secondary_ns
    times = stream.stamps.primary_ns if times is None else times
    known = times[times != UNSET]
    return int(known[0]) if known.size else None


def _is_told(stream: Stream) -> bool:
    """Whether messages carry a time of their own."""
    stamps = stream.stamps
    if stream.unread or stamps is None or not bool(np.any(stamps.primary_ns != UNSET)):
        return False
    if "points" in stream.quantity and stamps.secondary_ns is None:
        return False  # a cloud in a file lies in the order of space
    return stamps.secondary_ns is not None or not is_receipt(stamps.primary)


def _untold(opened: FileStreams, stream: Stream) -> StreamAudit:
    """A stream whose messages carry no time of their own, or points in no order of time."""
    stamps = stream.stamps
    names = StampNames(None, None) if stamps is None else StampNames(None, stamps.primary)
    if stamps is not None and _is_cloud(stream):
        names = StampNames(stamps.primary, None)
    duration = None
    known = np.zeros(0) if stamps is None else stamps.primary_ns[stamps.primary_ns != UNSET]
    if known.size > 1:
        duration = float(np.ptp(known)) / 1e9
    return StreamAudit(
        name=stream.name, file=str(opened.path), messages=stream.messages, duration_s=duration,
        rate_hz=(stream.messages - 1) / duration if duration else None, shape="unknown",
        stamps=names, timeline=stream.timeline, quantity=stream.quantity, faults=(), offset_s=None,
        residual_s=ResidualTime(None, None, None), smallest_seen=SmallestSeen(None, None),
        tau_crit_s=None, error_m=None,
        cannot_show=(f"anything: {_why_untold(stream)}",), notes=stream.notes,
        trace=(), partial=stream.partial, examined=False,
    )  # fmt: skip


def _is_cloud(stream: Stream) -> bool:
    """Whether it is a file of points with a time each."""
    stamps = stream.stamps
    return stamps is not None and "points" in stream.quantity and not is_receipt(stamps.primary)


def _why_untold(stream: Stream) -> str:
    if stream.unread:
        return stream.unread
    if _is_cloud(stream):
        return "one time a point, and points lie in the order of space"
    return "its messages carry no stamp of their own"


def _row(opened: FileStreams, one: Examined) -> StreamAudit:
    stream = one.stream
    assert stream.stamps is not None
    times = one.raw.seconds[one.raw.good]
    two = two_times(one.whole, one.series)
    duration = float(times.max() - times.min()) if times.size > 1 else None
    return StreamAudit(
        name=stream.name, file=str(opened.path), messages=stream.messages, duration_s=duration,
        rate_hz=(times.size - 1) / duration if duration else None,
        shape="regular" if one.pace.regular else "irregular" if times.size > 20 else "unknown",
        stamps=StampNames(stream.stamps.primary, stream.stamps.secondary),
        timeline=stream.timeline, quantity=stream.quantity,
        faults=_ordered(one), offset_s=one.offset_s,
        residual_s=_residual(one), smallest_seen=one.smallest, tau_crit_s=None, error_m=None,
        cannot_show=_cannot_show(one, two), notes=stream.notes, trace=one.trace,
        partial=stream.partial, uneven_s=two.uneven_s, copied=two.copied,
    )  # fmt: skip


def _residual(one: Examined) -> ResidualTime:
    """What is left, with what stamps on arrival could hide counted."""
    left = one.residual
    if one.hidden is None or left.bound is None or left.p95 is None:
        return left
    bound, p95 = left.bound + one.hidden.seconds, left.p95 + one.hidden.seconds
    return ResidualTime(bound, p95, max(bound, left.as_recorded or 0.0))


def _ordered(one: Examined) -> tuple[StampFault, ...]:
    """Faults that count first, whole-stream ones before episodes, episodes by time."""
    return tuple(sorted(one.faults, key=_rank))


def _rank(fault: StampFault) -> tuple[bool, bool, float]:
    return (not fault.counts, fault.from_s is not None, fault.from_s or 0.0)


def _cannot_show(one: Examined, two: TwoTimes) -> tuple[str, ...]:
    """What these stamps leave open, in words."""
    names = {f.fault for f in one.faults}
    if one.series.receive is None:
        return (f"offset, drift, steps and delays: {_why_one_time(one.stream)}",)
    said = []
    if one.copied:
        said.append("anything of transport: every receipt is a copy of its stamp, whose rhythm is "
                    "more even than arrivals are")  # fmt: skip
    elif two.copied:
        said.append("anything of transport or of a clock: receipts keep to their stamps as copies "
                    "do, a constant and the file's rounding apart")  # fmt: skip
    elif names & {"stamped_on_arrival", "packetised"}:
        said.append("how long the data were on their way before they were stamped")
    elif one.constant_s is not None and one.constant_s > 0.0:
        apart = in_words(one.constant_s)
        said.append(f"its constant latency: the fastest receipts come {apart} after their stamps, "
                    "which is latency or a clock's offset")  # fmt: skip
    else:
        said.append("its constant latency, nor how far its clock is from the recorder's")
    if one.hidden is not None:
        said.append(f"{one.hidden.words}; the bound counts {in_words(one.hidden.seconds)} for it")
    elif (far_s := _unlike_a_rhythm(one, two)) > 0.0:
        said.append(f"whether stamps are late here and there, or wander, with their receipts: they "
                    f"lie over {in_words(far_s)} about an even rhythm, as such stamps do and those "
                    "of an uneven sensor; the bound counts nothing of it")  # fmt: skip
    grain_s = cut_to_one_interval(one.whole, one.pace)
    drifts = [abs(float(f.parameters["ppm"])) for f in one.faults if f.fault == "drift"]
    if drifts and 1e-6 * max(drifts) * float(np.ptp(one.series.seconds)) < _TURN * grain_s:
        grid = f"a grid of up to {in_words(grain_s)}"
        said.append(f"whether its clock drifts, or keeps an interval of its own that {grid} cuts "
                    "off to one and the same: no edge of it lies within the log")  # fmt: skip
    said += one.undecided
    if one.breathing_s > 0.0:
        far = in_words(one.breathing_s)
        said.append(f"why receipts move to and fro by {far} while its stamps keep their rhythm: "
                    "latency, or the sensor's own oscillator")  # fmt: skip
    pauses = one.pace.pauses
    if pauses is not None and "packetised" not in names:
        said.append(f"whether messages are missing in its {pauses.count} pauses, which take "
                    f"{percent(pauses.share, 2)} of the log: they recur as those of a sensor that "
                    "is switched on and off, or set off by events")  # fmt: skip
    late = one.overtaken
    if late.falls and late.fault is None:
        kept = ", and their stamps keep the rhythm" if late.by_rhythm else ""
        said.append(f"why {late.falls} messages came after later ones, by up to "
                    f"{in_words(late.deepest_s)}: transport changed their order{kept} (sort by "
                    "stamp)")  # fmt: skip
    if not one.pace.regular and "packetised" not in names:
        said.append("single lost messages, and whether it was stamped on arrival: it has no rhythm")
    if one.smallest.step_s is None:
        said.append("steps and drift: too few messages")
    return tuple(said)


def _unlike_a_rhythm(one: Examined, two: TwoTimes) -> float:
    """Reach [s] of sound stamps about an even rhythm where it is well beyond the bound, else 0."""
    bound_s = one.residual.bound
    if two.uneven_s is None or bound_s is None or any(f.counts for f in one.faults):
        return 0.0
    return two.uneven_s if two.uneven_s > _TOLD * bound_s else 0.0


def _why_one_time(stream: Stream) -> str:
    stamps = stream.stamps
    if stamps is None or stamps.secondary is None:
        return "the file tells one time only"
    return (f"{stamps.primary} and {stamps.secondary} are of one clock, which cannot be held "
            "against itself, and the file does not tell when a message was received")  # fmt: skip


def _notes(rows: Sequence[StreamAudit]) -> tuple[str, ...]:
    notes = []
    if any(row.residual_s.bound is not None for row in rows):
        notes.append("what receipt minus stamp shows is transport as well as stamp error: every "
                     "residual is an upper bound, and a constant latency is in none of them "
                     "(`diagnose` finds it)")  # fmt: skip
    return tuple(notes)


def files_of(path: Path) -> list[Path]:
    """A file, or every file of a bag's folder; none of a folder that may not be read."""
    if not path.is_dir():
        return [path]
    try:
        return sorted(one for one in path.iterdir() if one.is_file())
    except OSError:  # said where it is opened
        return []


def _evidence(opened: Sequence[FileStreams], contents: ContentsBeside) -> tuple[FileRead, ...]:
    """The files that were opened, by their contents."""
    read = {str(one) for o in opened for one in files_of(o.path)}
    return tuple(one for one in contents.reads() if one.file in read)
