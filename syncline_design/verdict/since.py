"""What became of a verdict since an earlier one of the same spec, as data."""

from __future__ import annotations

from typing import Literal

from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.records import Record, optional

SinceBaseline = Literal["worse", "better", "same", "new", "gone"]


@dataclass(frozen=True, slots=True)
class Earlier(Record):
    """How a requirement stood in the baseline; waived: missed under a waiver then in force.

    kind, quantile, axis: what it limited then, where that is not what it limits now.
    """

    status: Literal["pass", "fail", "indeterminate"]
    value: float | None
    limit: float
    unit: str
    limit_written: str | None = optional()
    waived: bool | None = optional()
    kind: str | None = optional()
    quantile: float | None = optional()
    axis: str | None = optional()


@dataclass(frozen=True, slots=True)
class RequirementSince(Record):
    """What became of a requirement; was: None of a new one, unless its id was another's before.

    mission: whose it is; None of a spec without missions, and of what is said of all of them.
    judged: False where there is no design to hold against it, and it is no part of why.
    """

    id: str
    change: SinceBaseline
    was: Earlier | None
    mission: str | None = optional()
    judged: bool | None = optional()


@dataclass(frozen=True, slots=True)
class Baseline(Record):
    """What became of a spec's verdict; verdict: the earlier one, None where the file has none."""

    file: str
    verdict: Literal["meets", "fails", "infeasible", "indeterminate"] | None
    worse: bool  # the exit code is 0 where nothing is
    requirements: tuple[RequirementSince, ...]

    def of(self, requirement: str, mission: str | None = None) -> RequirementSince | None:
        """What became of a requirement, of a mission where it is named."""
        return next((row for row in self.requirements
                     if (row.id, row.mission) == (requirement, mission)), None)  # fmt: skip

    def forgives(self, requirement: str, mission: str | None = None) -> bool:
        """Whether a requirement that does not pass did no better before."""
        found = self.of(requirement, mission)
        return found is not None and found.change in ("same", "better")
