"""The verdict, one typed tree: what `check` says (schema syncline-design/verdict/v1).

Fields are the keys of the JSON in their order; what is unlimited or unknown is None.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Annotated, Any, Final, Literal

from syncline_design.choice.outcome import Explanation
from syncline_design.machine.input_files import FileRead
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.records import Record, SchemaName, optional
from syncline_design.model.budget import SyncModelName
from syncline_design.simulation import MonteCarlo
from syncline_design.simulation.figures import MissionFigures, WorstSituation
from syncline_design.spec.requirement import LIMIT_UNITS
from syncline_design.verdict.likely import Probability
from syncline_design.verdict.named import (
    BillLine,
    ChoiceResult,
    ExplainedRequirement,
    NamedDesign,
    Nearest,
    RankedDesign,
)
from syncline_design.verdict.since import Baseline
from syncline_design.verdict.syncline_figures import SynclineFigures

SCHEMA = "syncline-design/verdict/v1"
SEVERAL_SCHEMA = "syncline-design/verdicts/v1"
Status = Literal["pass", "fail", "indeterminate"]
Word = Literal["meets", "fails", "infeasible", "indeterminate"]
# What a verdict says of its spec, wherever a sentence goes on with it.
PREDICATES: Final[dict[Word, str]] = {
    "meets": "meets its requirements",
    "fails": "does not meet its requirements",
    "infeasible": "has no design that meets its requirements",
    "indeterminate": "could not be decided",
}
EXIT_CODES: Mapping[str, int] = {
    "meets": 0,
    "fails": 1,
    "infeasible": 1,
    "refused": 2,
    "indeterminate": 3,
}
UNITS = {**LIMIT_UNITS, "feasible": "1", "failing_share": "1"}


def finite(value: float | None) -> float | None:
    """JSON has no infinity: what is unlimited or unknown is null."""
    return value if value is not None and math.isfinite(value) else None


@dataclass(frozen=True, slots=True)
class WaiverResult(Record):
    """Why a requirement may be missed and until when; expired: whether it no longer counts."""

    reason: str
    expires: str
    expired: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class RequirementResult(Record):
    """One requirement, decided: value against limit; made by `decided`.

    line, column: its place in the spec, None of one that no one wrote; quantile, low, high: of a
    simulated one, with the interval of its value; axis: of the error that an rmse or a quantile
    limits; at_distance_m: range of the last stage that the value is for; limit_written: the limit
    in the unit and with the decimals that the spec has, where it has a unit of its own.
    """

    id: str
    kind: str
    status: Status
    value: float | None
    limit: float
    unit: str
    margin: float | None
    line: int | None = None
    column: int | None = None
    implied: bool = False
    note: str = ""
    quantile: float | None = optional()
    low: float | None = optional()
    high: float | None = optional()
    axis: str | None = optional()
    at_distance_m: float | None = optional()
    waiver: WaiverResult | None = optional()
    limit_written: str | None = optional()

    @property
    def is_waived(self) -> bool:
        """Whether a waiver in force covers this requirement."""
        return self.waiver is not None and not self.waiver.expired


def decided(*, status: Status, value: float | None, limit: float, **rest: Any) -> RequirementResult:
    """A requirement's result with its margin, limit - value."""
    margin = None if value is None else finite(limit - value)
    return RequirementResult(status=status, value=finite(value), limit=limit, margin=margin, **rest)


def settled(left_open: RequirementResult, status: Status, value: float | None) -> RequirementResult:
    """A result that was left open, with what it came to and its margin."""
    margin = None if value is None else finite(left_open.limit - value)
    return replace(left_open, status=status, value=finite(value), margin=margin, note="")


def word_of(results: Iterable[RequirementResult]) -> Word:
    """One failed requirement fails the whole; one undecided one leaves it open; else it meets.

    A failure with a valid waiver does not count.
    """
    rows = list(results)
    waived = waived_misses(rows)
    statuses = {r.status for r in rows if r.id not in waived}
    if "fail" in statuses:
        return "fails"
    return "indeterminate" if "indeterminate" in statuses else "meets"


def waived_misses(results: Iterable[RequirementResult]) -> tuple[str, ...]:
    """Ids of requirements that are missed and do not count, by a waiver in force."""
    return tuple(row.id for row in results if row.status == "fail" and row.is_waived)


@dataclass(frozen=True, slots=True)
class PlatformFigures(Record):
    """How a stage may move and how far it looks; nearest_m: the other end of several distances."""

    id: str
    name: str
    v_max_mps: float
    omega_max_radps: float
    distance_m: float
    baseline_m: float
    nearest_m: float | None = optional()


@dataclass(frozen=True, slots=True)
class StageFrame(Record):
    """A stage of the spec."""

    name: str
    vehicle: str
    platform: PlatformFigures


@dataclass(frozen=True, slots=True)
class SpecFrame(Record):
    """What a verdict repeats of its spec; open_roles: `stage.role` that leave something open.

    combinations: digits of a whole number of any size; None where time ended before it was known.
    """

    name: str
    file: str
    currency: str
    sync_model: SyncModelName
    objective: str
    coverage_factor: float
    open_roles: tuple[str, ...]
    combinations: str | None
    stages: tuple[StageFrame, ...]


@dataclass(frozen=True, slots=True)
class MissionHorizon(Record):
    """What drifts, grids and heave are charged for and simulated over."""

    duration_s: float
    extent_m: float
    tilt_rad: float


@dataclass(frozen=True, slots=True)
class Caution(Record):
    """One warning; entry: of a catalog; key: its figure; requirement: an id of the spec.

    missions: those that it is about, where it is not about all.
    """

    code: str
    message: str
    entry: str | None = optional()
    key: str | None = optional()
    requirement: str | None = optional()
    missions: tuple[str, ...] | None = optional()


@dataclass(frozen=True, slots=True)
class Provenance(Record):
    """What the numbers depend on; judged_on: the day, of a spec whose waivers end on one."""

    version: str
    spec_sha256: str
    catalogs_sha256: str
    files: tuple[FileRead, ...]
    seed: int
    python: str
    numpy: str
    judged_on: str | None = optional()


@dataclass(frozen=True, slots=True)
class ErrorFigures(Record):
    """The errors of a design, each named by its convention; only those that are computed.

    syncline_m: the paper's sum of one-sigma terms; worst_case_m: certified, sensors at
    `worst_case_k` standard deviations; worst_case_1sigma_m: at one.  The statistical figures are
    over missions; `one_mission` holds what is constant in a mission at its worst value.
    """

    syncline_m: float | None
    worst_case_1sigma_m: float | None = optional()
    worst_case_m: float | None = optional()
    worst_case_k: float | None = optional()
    rmse_m: Mapping[str, float] | None = optional()
    thu95_m: float | None = optional()
    tvu95_m: float | None = optional()
    quantile95_3d_m: float | None = optional()
    ensemble: Literal["over_missions"] | None = optional()
    one_mission: MissionFigures | None = optional()
    worst_at: tuple[WorstSituation, ...] | None = optional()


@dataclass(frozen=True, slots=True)
class Assumption(Record):
    """A figure of a catalog entry without a public source."""

    entry: str
    section: str
    figure: str
    value: str
    note: str


@dataclass(frozen=True, slots=True)
class Source(Record):
    """Where the figures of a catalog entry come from."""

    entry: str
    section: str
    source: str


@dataclass(frozen=True, slots=True)
class ClaimShown(Record):
    """What a measured bound is claimed to hold for; None: the entry does not say."""

    coverage: float
    session_share: float | None
    confidence: float | None
    sessions: int | None
    session_s: float | None
    rests_on: str | None


@dataclass(frozen=True, slots=True)
class MeasuredEntry(Record):
    """A timing error of a catalog that was measured; events: how many its entry lists."""

    entry: str
    section: str
    bound_s: float
    claim: ClaimShown | None
    conditions: str
    evidence: tuple[FileRead, ...]
    events: int


@dataclass(frozen=True, slots=True)
class KnownEffect(Record):
    """A known effect of the system and what it does, in words."""

    effect: str
    sensor: str
    stage: str
    parameters: Mapping[str, float | str]
    sentence: str


@dataclass(frozen=True, slots=True, kw_only=True)
class MissionVerdict(Record):
    """What is said of one mission of a family; alone: the best payload of this mission by itself.

    cost, mass and power of its requirements are the family's.
    """

    name: str
    verdict: Word
    requirements: tuple[RequirementResult, ...]
    figures: ErrorFigures | None
    design: NamedDesign | None = None
    syncline: SynclineFigures | None = None
    monte_carlo: MonteCarlo | None = None
    alone: RankedDesign | None = optional()


@dataclass(frozen=True, slots=True, kw_only=True)
class Robustness(Record):
    """What the design was chosen for, beside the choice at nominal figures.

    choose_for: always, or the probability; figures: how many datasheet figures have an interval.
    price: what the chosen design takes more of the objective than the nominal one (None: there is
    none, or the objective is the error); probability: that every requirement holds.
    """

    choose_for: str
    figures: int
    nominal: RankedDesign | None
    price: float | None
    unit: str
    probability: Probability | None = optional()


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict(Record):
    """What `check` says of one spec; without a design its figures are None."""

    schema: Annotated[str, SchemaName(SCHEMA)] = SCHEMA
    verdict: Word
    spec: SpecFrame
    horizon: MissionHorizon
    requirements: tuple[RequirementResult, ...] = ()
    design: NamedDesign | None = None
    syncline: SynclineFigures | None = None
    monte_carlo: MonteCarlo | None = None
    warnings: tuple[Caution, ...] = ()
    provenance: Provenance
    infeasibility: Explanation | None = optional()
    nearest: Nearest | None = optional()
    figures: ErrorFigures | None = optional()
    assumptions: tuple[Assumption, ...] | None = optional()
    sources: tuple[Source, ...] | None = optional()
    effects: tuple[KnownEffect, ...] | None = optional()
    choice: ChoiceResult | None = optional()
    measured: tuple[MeasuredEntry, ...] | None = optional()
    explained: tuple[ExplainedRequirement, ...] | None = optional()
    bill_of_materials: tuple[BillLine, ...] | None = optional()
    missions: tuple[MissionVerdict, ...] | None = optional()
    robustness: Robustness | None = optional()
    baseline: Baseline | None = optional()

    @property
    def name(self) -> str:
        """The system's name."""
        return self.spec.name

    @property
    def file(self) -> str:
        """The spec's path as it was given."""
        return self.spec.file

    @property
    def judged_rows(self) -> tuple[tuple[str | None, RequirementResult], ...]:
        """Requirements with their missions: of several each mission's own, after those of all."""
        if self.missions is None:
            return tuple((None, row) for row in self.requirements)
        own = [(one.name, row) for one in self.missions for row in one.requirements]
        held = {row.id for _, row in own}
        return (*((None, row) for row in self.requirements if row.id not in held), *own)

    @property
    def exit_code(self) -> int:
        """0 meets, or is no worse than its baseline; 1 does not meet; 3 no verdict."""
        if self.baseline is not None and not self.baseline.worse:
            return 0
        return EXIT_CODES[self.verdict]


@dataclass(frozen=True, slots=True)
class FileProblem(Record):
    """What is wrong with a file, and where."""

    file: str
    line: int
    column: int
    path: str
    message: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Refused(Record):
    """A file among several that could not be read; nothing of it was computed."""

    schema: Annotated[str, SchemaName(SCHEMA)] = SCHEMA
    verdict: Literal["refused"] = "refused"
    file: str
    problems: tuple[FileProblem, ...]
    text: str

    @property
    def name(self) -> str:
        """Its path: what it calls itself could not be read."""
        return self.file

    @property
    def exit_code(self) -> int:
        """2."""
        return EXIT_CODES[self.verdict]


Checked = Verdict | Refused  # what there is to say of one file among several


@dataclass(frozen=True, slots=True)
class Verdicts(Record):
    """What `check` says of several files."""

    schema: Annotated[str, SchemaName(SEVERAL_SCHEMA)]
    verdicts: tuple[Checked, ...]
