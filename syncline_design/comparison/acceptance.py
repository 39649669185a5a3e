"""What `accept` says: one row an assumption (schema syncline-design/acceptance/v1)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Annotated, Final, Literal

from syncline_design.effects.record import Promise
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.records import Record, SchemaName, optional
from syncline_design.verdict.tree import Provenance, Word

SCHEMA: Final = "syncline-design/acceptance/v1"
AssumptionStatus = Literal["holds", "broken", "not_shown"]
AssumptionName = Promise | Literal["speed", "rate"]
NAMES: Final[tuple[AssumptionName, ...]] = (
    "timing", "latency", "lever_arm", "mounting", "noise", "clock", "speed", "rate",
)  # fmt: skip
EXIT_CODES: Final[Mapping[AssumptionStatus, int]] = {"holds": 0, "broken": 1, "not_shown": 3}
ReadAs = Literal["clock", "stamps", "log"]


@dataclass(frozen=True, slots=True)
class MeasuredFigure(Record):
    """A figure that evidence gives, with its 95 % interval where there is one, in SI.

    Of a departure that was looked for and not found the value is 0 and the interval what the log
    would have shown; of a bound of clock logs low is what they show themselves; of messages with
    two times the error of a stamp lies between 0 and the time to its receipt.
    """

    value: float | None
    low: float | None = None
    high: float | None = None


@dataclass(frozen=True, slots=True)
class AssumptionResult(Record):
    """One thing that a verdict rests on, and what evidence says of it.

    role: position, attitude or ranging; `clock` of a vehicle's host clock, `platform` of its speed
    and rate, `target` of the reference.  assumed: a bound (timing, clock, speed, rate), the
    departure from the spec (0; latency, lever_arm, mounting), or a factor on the spec's figure (1;
    noise); None where the spec says none.  line, column: where the spec says it.
    from_s, to_s: the stamps between which the departure stands out, where it is a part of the log.
    least_stretch_s: the shortest stretch of the log that a row speaks about that holds: what turns
    the verdict would have shown wherever it had acted so long.  one_of: the number of the group of
    rows of which one is broken that it is in; its status is then not_shown, and measured what it
    would be.
    """

    stage: str
    role: str
    assumption: AssumptionName
    assumed: float | None
    measured: MeasuredFigure | None
    unit: str
    status: AssumptionStatus
    evidence: str
    line: int
    column: int
    from_s: float | None = optional()
    to_s: float | None = optional()
    least_stretch_s: float | None = optional()
    one_of: int | None = optional()

    @property
    def name(self) -> str:
        """`stage/role/assumption`."""
        return f"{self.stage}/{self.role}/{self.assumption}"


@dataclass(frozen=True, slots=True)
class SuspectedDeparture(Record):
    """One departure of a way, and the rows that it would break; none where no row asks for it, as
    of an error of the survey that the log is held against."""

    effect: str
    sensors: tuple[str, ...]
    stage: str
    rows: tuple[str, ...]
    text: str


@dataclass(frozen=True, slots=True)
class SuspectedWay(Record):
    """Departures that together explain what was found; probability: its odds among the others of
    its finding, where each is one departure alone."""

    departures: tuple[SuspectedDeparture, ...]
    probability: float | None = optional()


@dataclass(frozen=True, slots=True)
class OneOfThese(Record):
    """Rows of which at least one is broken, where the log cannot tell which.

    rows: `stage/role/assumption`, what to look at first before the others; ways: what explains the
    findings, of each its own ones; evidence: what was found; look_first: at what, in words.
    tell_apart: the command that looks for the drive that tells the first from another; None where
    no drive does.
    """

    number: int
    rows: tuple[str, ...]
    ways: tuple[SuspectedWay, ...]
    evidence: str
    look_first: str
    tell_apart: str | None = optional()


@dataclass(frozen=True, slots=True)
class EvidenceFile(Record):
    """A file and how it was read; of: what it was assigned to, "" where that was not needed."""

    file: str
    read_as: ReadAs
    of: str
    sha256: str


@dataclass(frozen=True, slots=True)
class AcceptedSpec(Record):
    """The spec whose verdict is held against the evidence, and that verdict on paper."""

    name: str
    file: str
    verdict: Word
    provenance: Provenance | None = optional()


@dataclass(frozen=True, slots=True, kw_only=True)
class Acceptance(Record):
    """The outcome: `broken` wins over `not_shown`; a spec that fails on paper is broken as well.

    asked: the assumptions that were asked for, which alone are listed.  broken_by: what makes it
    broken, `spec` for a spec that fails on paper, else stage/role/assumption, of a group of which
    one is broken all, with ` or ` between them.  groups: these.
    """

    schema: Annotated[str, SchemaName(SCHEMA)] = SCHEMA
    verdict: AssumptionStatus
    broken_by: tuple[str, ...] = ()
    spec: AcceptedSpec
    asked: tuple[AssumptionName, ...]
    assumptions: tuple[AssumptionResult, ...]
    evidence: tuple[EvidenceFile, ...]
    notes: tuple[str, ...]
    version: str
    seed: int
    groups: tuple[OneOfThese, ...] = ()

    @property
    def exit_code(self) -> int:
        """0: all hold; 1: one is broken; 3: one is not shown."""
        return EXIT_CODES[self.verdict]


def worst(statuses: Iterable[AssumptionStatus]) -> AssumptionStatus:
    """Broken before not shown before holds; of none: not shown."""
    found = set(statuses)
    if "broken" in found:
        return "broken"
    return "holds" if found == {"holds"} else "not_shown"
