"""What `optimize` is asked and what it says."""

from __future__ import annotations

from dataclasses import fields
from typing import Annotated

from syncline_design import __version__
from syncline_design.choice.measured_next import Measurement
from syncline_design.choice.option import ResourceName
from syncline_design.choice.outcome import (
    Explanation,
    FrontPoint,
    PriceStep,
    Proof,
    Road,
)
from syncline_design.choice.slack import Slack
from syncline_design.choice.table import Design, Limits, Problem
from syncline_design.choice.tolerance import ToleranceVerdict
from syncline_design.machine.input_files import FileRead
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.records import Record, SchemaName, optional
from syncline_design.simulation.results import SpecName
from syncline_design.spec.case import Case
from syncline_design.verdict.figure_front import (
    FigureKind,
)
from syncline_design.verdict.named import (
    Alternative,
    Bargain,
    Exclusion,
    FrontDesign,
    Nearest,
    RankedDesign,
)
from syncline_design.verdict.settings import CheckSettings
from syncline_design.verdict.tree import EXIT_CODES, Caution, Verdict, Word
from syncline_design.verdict.why_not import Answer

SCHEMA = "syncline-design/optimization/v1"


@dataclass(frozen=True, slots=True)
class OptimizeSettings:
    """count: how many designs; pareto: the front too, of `resource` against error, or a figure.

    every: rank every design, not only those that differ in a sensor.
    """

    count: int = 1
    pareto: bool = False
    resource: ResourceName = "cost"
    figure: FigureKind | None = None  # of the error, in place of the Syncline's
    road: Road = "auto"
    seed: int = 0
    every: bool = False
    report: bool = False  # the whole verdict too, for a page
    why_not: tuple[
        str, ...
    ] = ()  # entries to answer for; NoSuchEntry for one that is in no catalog


@dataclass(frozen=True, slots=True)
class MadeFrom(Record):
    """What the choice depends on; judged_on: the day, of a spec whose waivers end on one."""

    version: str
    spec_sha256: str
    catalogs_sha256: str
    files: tuple[FileRead, ...]
    seed: int
    judged_on: str | None = optional()


def made_from(case: Case, settings: CheckSettings) -> MadeFrom:
    """Of a spec and how it was checked."""
    return MadeFrom(
        __version__, case.spec_sha256, case.catalogs_sha256, case.files, settings.seed,
        case.judged_on(settings.day),
    )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Optimization(Record):
    """What `optimize` says: the best designs, or why there is none.

    warnings: of the first design, as `check` gives them; cut_short: what the time limit left out
    or incomplete; gave_up: what lacks designs because too many were simulated; message: what ended
    a search that found no design; front: with `--pareto`, `front_left_out` what has no place on
    it, `front_figure` over which figure of the error it is drawn, in words; slack, tolerances,
    measure_next: of a design that meets, null where that was not worked out; why_not: of the
    entries that were asked about; alternatives, bargains: as in a verdict; waived: ids of
    requirements that the first design misses under a waiver.
    """

    schema: Annotated[str, SchemaName(SCHEMA)] = SCHEMA
    verdict: Word
    spec: SpecName
    proof: Proof
    combinations: str | None
    designs: tuple[RankedDesign, ...] = ()
    warnings: tuple[Caution, ...] = ()
    excluded: tuple[Exclusion, ...]
    excluded_count: int
    cut_short: tuple[str, ...] = ()
    gave_up: tuple[str, ...] = ()
    provenance: MadeFrom
    message: str | None = optional()
    front: tuple[FrontDesign, ...] | None = optional()
    front_figure: str | None = optional()
    front_left_out: tuple[str, ...] | None = optional()
    staircase: tuple[PriceStep, ...] | None = optional()
    slack: tuple[Slack, ...] | None = optional()
    tolerances: ToleranceVerdict | None = optional()
    measure_next: tuple[Measurement, ...] | None = optional()
    infeasibility: Explanation | None = optional()
    nearest: Nearest | None = optional()
    waived: tuple[str, ...] | None = optional()
    why_not: tuple[Answer, ...] | None = optional()
    alternatives: tuple[Alternative, ...] | None = optional()
    bargains: tuple[Bargain, ...] | None = optional()

    @property
    def exit_code(self) -> int:
        """0: a design; 1: none; 3: the search for one was cut short."""
        return EXIT_CODES[self.verdict]


@dataclass(frozen=True, slots=True, kw_only=True)
class Hinged(Optimization):
    """Of a design that meets: with what it hinges on, None where that was not worked out."""

    slack: tuple[Slack, ...] | None = None
    tolerances: ToleranceVerdict | None = None
    measure_next: tuple[Measurement, ...] | None = None


@dataclass(frozen=True, slots=True)
class Hinges:
    """What a design hinges on; None: not worked out."""

    slack: tuple[Slack, ...] | None
    tolerances: ToleranceVerdict | None
    measure_next: tuple[Measurement, ...] | None


def with_hinges(result: Optimization, hinges: Hinges | None) -> Optimization:
    """A result with what its design hinges on, where it is one of a design that meets."""
    if hinges is None:
        return result
    told = {one.name: getattr(result, one.name) for one in fields(result)}
    return Hinged(**(told | {one.name: getattr(hinges, one.name) for one in fields(hinges)}))


@dataclass(frozen=True, slots=True)
class Optimized:
    """An optimization with what it was made from.

    designs, points: of the result, by their places in the problem's tables; verdict: the whole one
    on the same design, where a page is wanted.
    """

    case: Case
    problem: Problem
    settings: OptimizeSettings
    designs: tuple[Design, ...]
    points: tuple[FrontPoint, ...]
    result: Optimization
    verdict: Verdict | None = None
    text: str | None = None  # of a family: the spec with its design pinned


# What stands for the tables where time ended before they were made.
NO_TABLES = Problem((), (), (), (), 0.0, 0.0, Limits(None, 1.0), "syncline", "cost")
