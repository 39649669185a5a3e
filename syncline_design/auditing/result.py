"""What the stamps of logs say: the records that are written as JSON (`syncline-design/audit/v1`).

Sizes are stamp minus receipt: a stamp that is 37 s ahead of its receipt has `seconds` 37, a clock
that runs fast a positive `ppm`.
"""

from __future__ import annotations

from typing import Annotated, Final, Literal

from syncline_design.machine.input_files import FileRead
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.records import Record, SchemaName, optional

SCHEMA: Final = "syncline-design/audit/v1"
FaultName = Literal[
    "epoch_offset",
    "whole_second_slip",
    "step",
    "drift",
    "counter_wrap",
    "relock",
    "packetised",
    "truncated_stamps",
    "stamped_on_arrival",
    "end_of_scan",
    "start_of_scan",
    "duplicates",
    "backward_jump",
    "gap",
    "lost_messages",
    "unset_stamps",
    "ahead_of_receipt",
    "batched_by_recorder",
    "recorder_clock",
    "wrong_receipts",
]
Soundness = Literal["sound", "faults"]


@dataclass(frozen=True, slots=True)
class Consequence(Record):
    """What follows from a fault and is no fault of its own."""

    fault: FaultName
    parameters: dict[str, float | str]
    evidence: str


@dataclass(frozen=True, slots=True)
class StampFault(Record):
    """One cause; from_s and to_s: seconds of receipt since the first message of the run, null for
    the whole stream.

    counts: False for what is listed and does not change the verdict.
    """

    fault: FaultName
    parameters: dict[str, float | str]
    from_s: float | None
    to_s: float | None
    evidence: str
    consequences: tuple[Consequence, ...] = ()
    counts: bool = True


@dataclass(frozen=True, slots=True)
class StampNames(Record):
    """What the file calls the two times of a message; null where it has none."""

    primary: str | None
    secondary: str | None


@dataclass(frozen=True, slots=True)
class ResidualTime(Record):
    """Receipt minus stamp above its lower envelope, once every named fault is taken out [s].

    bound: the largest; p95: what 95 % of messages stay below; as_recorded: the largest with
    everything in that is no constant: an upper bound of the stamps' own error.
    """

    bound: float | None
    p95: float | None
    as_recorded: float | None


@dataclass(frozen=True, slots=True)
class SmallestSeen(Record):
    """The smallest step [s], in the middle of the log, and drift [ppm] that it would have shown."""

    step_s: float | None
    drift_ppm: float | None


@dataclass(frozen=True, slots=True)
class EnvelopePoint(Record):
    """Smallest and largest receipt minus stamp of a stretch of the log, without the median."""

    time_s: float
    low_s: float
    high_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class StreamAudit(Record):
    """One stream.  offset_s: stamp minus receipt of the fastest message, null without receipts.

    error_m, tau_crit_s: only with a spec; role: which of its roles this stream is held against.
    cannot_show: what these stamps leave open.  shape: how the stamps follow one another.
    examined: False where its messages carry no stamp of their own, in an order of time.
    uneven_s: reach of the stamps as recorded about the even rhythm of a sensor, null where they
    keep none.  copied: every receipt is its stamp once more, but for a constant and rounding.
    """

    name: str
    file: str
    messages: int
    duration_s: float | None
    rate_hz: float | None
    shape: Literal["regular", "irregular", "unknown"]
    stamps: StampNames
    timeline: str
    quantity: tuple[str, ...] = ()
    faults: tuple[StampFault, ...]
    offset_s: float | None
    residual_s: ResidualTime
    smallest_seen: SmallestSeen
    tau_crit_s: float | None
    error_m: float | None
    role: str | None = optional()
    cannot_show: tuple[str, ...]
    notes: tuple[str, ...] = ()
    trace: tuple[EnvelopePoint, ...]
    partial: bool = False
    examined: bool = True
    uneven_s: float | None = None
    copied: bool = False

    @property
    def sound(self) -> bool:
        return not any(fault.counts for fault in self.faults)


@dataclass(frozen=True, slots=True)
class IncompleteFile(Record):
    """A file that could be read in part, or not at all (`messages` 0)."""

    file: str
    reason: str
    messages: int


@dataclass(frozen=True, slots=True)
class AuditedFor(Record):
    """The spec against which streams were held, by its content, and the seed of its choice."""

    name: str
    file: str
    spec_sha256: str
    catalogs_sha256: str
    seed: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Audit(Record):
    """All streams of all files.  `incomplete`: the first of the damaged files, `damaged` each.

    unexamined: files none of whose streams could be examined, and streams that could not be read.
    """

    schema: Annotated[str, SchemaName(SCHEMA)] = SCHEMA
    verdict: Soundness
    streams: tuple[StreamAudit, ...]
    incomplete: IncompleteFile | None = optional()
    damaged: tuple[IncompleteFile, ...] = ()
    unreadable: tuple[IncompleteFile, ...] = ()
    unexamined: tuple[IncompleteFile, ...] = ()
    evidence: tuple[FileRead, ...]
    notes: tuple[str, ...]
    version: str
    spec: AuditedFor | None = optional()

    @property
    def exit_code(self) -> int:
        """0 sound, 1 faults, 2 where a file gave nothing, or a stream of it could not be read."""
        if self.unreadable or self.unexamined:
            return 2
        return 0 if self.verdict == "sound" else 1
