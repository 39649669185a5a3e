"""JSON Schema of every result, made from the type that it is."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from syncline_design.auditing import result as auditing
from syncline_design.campaign import watch_result
from syncline_design.clocks import result as clocks
from syncline_design.comparison import acceptance, clock_meaning, diff_result, meaning
from syncline_design.diagnosis import result as diagnosis
from syncline_design.logs import inspection
from syncline_design.machine.records import schema_of
from syncline_design.paper import reproduce
from syncline_design.planning import result as planning
from syncline_design.report import catalogs
from syncline_design.report.formats import ResultName
from syncline_design.report.json_out import json_text
from syncline_design.simulation import results as simulation
from syncline_design.spec import catalog_check
from syncline_design.studies import data as study
from syncline_design.verdict import optimization
from syncline_design.verdict import tree as verdict

RESULTS: Final[Mapping[ResultName, tuple[Any, str]]] = {
    "acceptance": (acceptance.Acceptance, acceptance.SCHEMA),
    "audit": (auditing.Audit, auditing.SCHEMA),
    "catalog-check": (catalog_check.CatalogCheck, catalog_check.SCHEMA),
    "catalog-entry": (catalogs.WholeEntry, catalogs.ENTRY_SCHEMA),
    "catalog-list": (catalogs.CatalogList, catalogs.LIST_SCHEMA),
    "diagnosis": (meaning.DiagnosisAndDesign, diagnosis.SCHEMA),
    "diff": (diff_result.Diff, diff_result.SCHEMA),
    "log": (inspection.LogInspection, inspection.SCHEMA),
    "optimization": (optimization.Optimization, optimization.SCHEMA),
    "plan": (planning.Plan, planning.SCHEMA),
    "reproduction": (reproduce.Reproduction, reproduce.SCHEMA),
    "simulation": (simulation.Simulation, simulation.SCHEMA),
    "study-result": (study.StudyData, study.SCHEMA),
    "timing": (clock_meaning.TimingAndSpec, clocks.SCHEMA),
    "verdict": (verdict.Checked, verdict.SCHEMA),
    "verdicts": (verdict.Verdicts, verdict.SEVERAL_SCHEMA),
    "watch": (watch_result.Watch, watch_result.SCHEMA),
}


def result_schema(name: ResultName) -> dict[str, Any]:
    """The schema of one kind of result as plain data (draft 2020-12)."""
    kind, schema = RESULTS[name]
    return schema_of(kind, schema, f"syncline-design {name}")


def result_schema_text(name: ResultName) -> str:
    """The schema as JSON text."""
    return json_text(result_schema(name))
