"""What logs of a clock show: the records that are written as JSON (`syncline-design/timing/v1`).

Offsets are local minus reference: a clock that is 1 ms late gives -1 ms.
"""

from __future__ import annotations

from typing import Annotated, Final, Literal

from syncline_design.clocks.sessions import EventKind
from syncline_design.machine.input_files import FileRead
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.records import Record, SchemaName, optional

SCHEMA: Final = "syncline-design/timing/v1"
RestsOn = Literal["independent", "servo", "servo_and_declared", "unknown", "unknown_and_declared"]
ClockEntryKind = Literal["clock", "timestamping"]


@dataclass(frozen=True, slots=True)
class SessionResult(Record):
    """One session; from and to: ISO 8601 in UTC, or seconds since boot where no date is known.

    counted: whether it is long enough; stationary None: too short to say.  median_s and quantile_s
    None: no steady sample; median_s too of offsets without a sign.
    """

    from_: str
    to: str
    samples: int
    median_s: float | None
    quantile_s: float | None
    duration_s: float
    counted: bool
    hard_s: float | None
    autocorrelation_s: float | None
    stationary: bool | None
    files: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class EventResult(Record):
    """An event; session: its place among the sessions, from 0."""

    kind: EventKind
    from_: str
    to: str
    size_s: float
    session: int


@dataclass(frozen=True, slots=True)
class TimingClaim(Record):
    """With `confidence`, a `session_share` of sessions like these keep |offset| within the bound
    for a share `coverage` of their time.

    made: False: these logs cannot carry it; needs_sessions: how many more would.  method: how the
    statistical bound was made.  shape_free_from: sessions from which it holds whatever the
    distribution of sessions.  unseen_share: what none of these sessions held may be true of up to
    this share of starts, with the same confidence.  session_s: median length of a session, to
    which the claim is bound.  lock_share: of the time logged what was in lock, of which coverage
    is a share.  effective_sessions: as many independent ones as these say as much as, where one
    resembles the next.
    """

    coverage: float
    session_share: float
    confidence: float
    sessions: int
    hours: float
    rests_on: RestsOn
    made: bool
    needs_sessions: int
    shape_free_from: int
    session_s: float | None
    method: str | None
    why_not: str | None = optional()
    unseen_share: float | None = optional()
    lock_share: float | None = optional()
    effective_sessions: float | None = optional()


@dataclass(frozen=True, slots=True)
class SourceResult(Record):
    """One source that the logs hold; used: the figures rest on it.

    whole_way: whether its hard bound holds the whole way to the reference.  of_host: whether it
    tells of the host's clock, and not of a card's.
    """

    name: str
    sign: str
    steering: str
    samples: int
    sessions: int
    quantile_s: float | None
    hard_s: float | None
    used: bool
    whole_way: bool = True
    of_host: bool = True


@dataclass(frozen=True, slots=True)
class StabilityPoint(Record):
    """TDEV and MTIE of the longest session at one averaging time."""

    tau_s: float
    tdev_s: float | None
    mtie_s: float | None


@dataclass(frozen=True, slots=True)
class HoldoverPoint(Record):
    """What the error grows to without a reference, from how much the frequency was seen to move."""

    after_s: float
    error_s: float


@dataclass(frozen=True, slots=True)
class TracePoint(Record):
    """Smallest and largest offset over a stretch of a session."""

    session: int
    time_s: float
    low_s: float
    high_s: float


@dataclass(frozen=True, slots=True)
class CatalogEntry(Record):
    """What was written for a catalog; text: the entry as it stands in the file."""

    id: str
    kind: ClockEntryKind
    file: str
    values_file: str
    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Timing(Record):
    """What logs of a clock show, and what may be claimed from them.

    statistical_bound_s None: too few sessions for one, sessions that are not alike, or logs in
    doubt; hard_bound_s None: the logs hold no dispersions or delays.  bound_s: the larger of both
    (`use` says otherwise where the user did), declared terms included; event_bound_s: with slow
    starts, lost lock, steps and holdover.  doubts: what forbids any claim until it is explained;
    with them there is no bound of any kind.
    reservations: what keeps these logs from bearing a bound out for later sessions or for the
    whole way, though a claim may be made.
    """

    schema: Annotated[str, SchemaName(SCHEMA)] = SCHEMA
    sessions: tuple[SessionResult, ...]
    bound_s: float | None
    event_bound_s: float | None
    statistical_bound_s: float | None
    hard_bound_s: float | None
    claim: TimingClaim
    events: tuple[EventResult, ...]
    entry: CatalogEntry | None
    use: Literal["larger", "statistical", "hard"]
    sources: tuple[SourceResult, ...]
    declared: dict[str, float]
    holdover: tuple[HoldoverPoint, ...]
    stability: tuple[StabilityPoint, ...]
    trace: tuple[TracePoint, ...]
    conditions: str | None
    evidence: tuple[FileRead, ...]
    doubts: tuple[str, ...]
    notes: tuple[str, ...]
    reservations: tuple[str, ...]
    version: str

    @property
    def exit_code(self) -> int:
        """0: the wanted claim could be made; 1: not from these logs."""
        return 0 if self.claim.made else 1

    @property
    def source(self) -> SourceResult:
        """The source that the figures rest on."""
        return next(one for one in self.sources if one.used)
