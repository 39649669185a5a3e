"""A study as data: what its JSON holds, with the rows of its table."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal

from syncline_design import __version__
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.records import Record, SchemaName, optional
from syncline_design.spec.keys import label
from syncline_design.studies.definition import MeetsWhen
from syncline_design.studies.finished import Finished
from syncline_design.studies.loading import Study
from syncline_design.studies.record import CaseWord, StudyWord
from syncline_design.studies.summary import (
    Boundary,
    HeatMap,
    StudyFront,
    StudySummary,
    Winner,
    boundaries,
    heat_map,
    winners,
)
from syncline_design.studies.table import Value, rows, si_unit

SCHEMA = "syncline-design/study/v1"


@dataclass(frozen=True, slots=True)
class VariedKey(Record):
    """A key path and the values it takes; unit: of its figures in SI, None of words."""

    key: str
    origin: Literal["grid", "sample"]
    unit: str | None
    values: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class BaseHashes(Record):
    """What a base spec and its catalogs held."""

    file: str
    spec_sha256: str
    catalogs_sha256: str


@dataclass(frozen=True, slots=True)
class StudyProvenance(Record):
    """What the numbers depend on; judged_on: the day, of bases whose waivers end on one."""

    version: str
    seed: int
    study_sha256: str
    bases: tuple[BaseHashes, ...]
    judged_on: str | None = optional()


@dataclass(frozen=True, slots=True)
class StudyData(Record):
    """A finished study; cases: the rows of its table, what a case lacks null or left out."""

    schema: Annotated[str, SchemaName(SCHEMA)]
    verdict: StudyWord
    name: str
    file: str
    meets_when: MeetsWhen
    counts: Mapping[CaseWord, int]
    not_simulated: tuple[str, ...]
    factors: tuple[VariedKey, ...]
    heat_map: HeatMap | None
    winners: tuple[Winner, ...]
    boundaries: tuple[Boundary, ...]
    fronts: tuple[StudyFront, ...]
    cases: tuple[Mapping[str, Value], ...]
    provenance: StudyProvenance


def study_data(result: Finished, summary: StudySummary) -> StudyData:
    """The study as data."""
    study = result.study
    return StudyData(
        SCHEMA, result.verdict, study.name, str(study.path), study.meets_when, result.counts,
        result.not_simulated, _factors(study), heat_map(summary), tuple(winners(summary)),
        tuple(boundaries(summary)), summary.fronts, tuple(rows(result)), _provenance(result),
    )  # fmt: skip


def _factors(study: Study) -> tuple[VariedKey, ...]:
    return tuple(
        VariedKey(factor.key, factor.origin, si_unit(factor), tuple(map(label, factor.values)))
        for factor in study.factors
    )


def _provenance(result: Finished) -> StudyProvenance:
    bases = tuple(
        BaseHashes(str(base.path), base.document.sha256, base.catalogs.sha256())
        for base in result.study.bases
    )
    return StudyProvenance(__version__, result.seed, result.study.sha256, bases, result.judged_on)
