"""What a study keeps of a case, and whether that hangs together.

All that the tables and findings of a study need of a verdict, no more.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal

from syncline_design.choice.outcome import Explanation
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.records import Record
from syncline_design.studies.inputs import Inputs
from syncline_design.verdict.named import NamedDesign
from syncline_design.verdict.tree import FileProblem, RequirementResult, waived_misses

SCHEMA = "syncline-design/study-case/v1"
CaseWord = Literal["meets", "fails", "infeasible", "refused", "indeterminate"]
StudyWord = Literal["meets", "fails", "indeterminate"]
_ROUNDING = 1e-9  # of a printed figure against the exact one that was decided


@dataclass(frozen=True, slots=True)
class CaseFigures(Record):
    """The Syncline figures of a case's design; tau_crit_s None: it has no limit."""

    model: str
    sensor_error_m: float
    sync_rate_mps: float
    tau_s: float
    tau_crit_s: float | None
    sync_error_m: float
    systematic_error_m: float
    total_m: float


@dataclass(frozen=True, slots=True)
class CasePoint(Record):
    """One point of an exact front."""

    cost: float
    error_m: float


@dataclass(frozen=True, slots=True)
class RolePick(Record):
    """One role of a design: stage.role, sensor, and how it is stamped."""

    role: str
    sensor: str
    name: str
    timestamping: str


@dataclass(frozen=True, slots=True, kw_only=True)
class CaseRecord(Record):
    """One case; inputs: the files that it read besides spec and catalogs.

    problems: of one that cannot be as combined; reason: of one without a verdict; provisional: as
    far as this machine came within the time limit.
    """

    verdict: CaseWord
    requirements: tuple[RequirementResult, ...] = ()
    design: NamedDesign | None = None
    syncline: CaseFigures | None = None
    front: tuple[CasePoint, ...] = ()
    infeasibility: Explanation | None = None
    not_simulated: tuple[str, ...] = ()
    problems: tuple[FileProblem, ...] = ()
    reason: str = ""
    provisional: bool = False
    inputs: Inputs = ()

    @property
    def is_final(self) -> bool:
        """Whether the same case would come out the same again: not after a time limit or crash."""
        return not self.provisional and not (self.verdict == "indeterminate" and self.reason)

    @property
    def is_believable(self) -> bool:
        """Whether the verdict follows from what the record says."""
        return self.verdict != "meets" or (
            bool(self.requirements) and all(map(_holds, self.requirements))
        )

    @property
    def waived(self) -> tuple[str, ...]:
        """Ids of requirements that a case misses which meets all the same."""
        return waived_misses(self.requirements) if self.verdict == "meets" else ()

    @property
    def excused(self) -> tuple[str, ...]:
        """Ids of requirements that are missed under a waiver in force, whatever else is."""
        return waived_misses(self.requirements)

    @property
    def unsettled(self) -> bool:
        """Whether the time limit left open which of its requirements stand in the way."""
        why = self.infeasibility
        return why is not None and bool(why.conflict.requirements[1:]) and not why.conflict.minimal

    @property
    def failing(self) -> tuple[str, ...]:
        """Ids of what its design fails, or of what no design meets together, where that is known.

        Waived ones too.
        """
        if self.unsettled:
            return ()
        return tuple(row.id for row in self.requirements if row.status == "fail")

    @property
    def expired_waivers(self) -> tuple[str, ...]:
        """Ids of requirements that a case misses and whose waiver is over."""
        missed = (row for row in self.requirements if row.status == "fail" and row.waiver)
        return tuple(row.id for row in missed if not row.is_waived)

    @property
    def cost(self) -> float | None:
        """Of the design; None where there is none, or where its price is unknown."""
        return None if self.design is None else self.design.cost

    @property
    def error_m(self) -> float | None:
        """Total error of the design."""
        return None if self.syncline is None else self.syncline.total_m

    @property
    def picks(self) -> Iterator[RolePick]:
        """What fills the roles of the case's design."""
        for stage, role, taken in self.design.roles if self.design is not None else ():
            stamping = f"{taken.timestamping} ({taken.primitive})"
            name = taken.name or taken.sensor
            yield RolePick(f"{stage.name}.{role}", taken.sensor, name, stamping)


def lost(reason: str) -> CaseRecord:
    """The record of a case that came to no verdict."""
    return CaseRecord(verdict="indeterminate", reason=reason)


def _holds(row: RequirementResult) -> bool:
    """Whether a system that meets its requirements may have this one: it passes, or is waived."""
    if row.status == "fail":
        return row.is_waived
    if row.value is None:
        return row.status == "pass"
    room = _ROUNDING * max(abs(row.value), abs(row.limit))
    return row.status == "pass" and row.value <= row.limit + room
