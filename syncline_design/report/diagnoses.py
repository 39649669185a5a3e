"""The outputs of `diagnose` in every format."""

from __future__ import annotations

from syncline_design.comparison.meaning import DiagnosisAndDesign
from syncline_design.report.formats import DIAGNOSE_FORMATS as DIAGNOSE_FORMATS
from syncline_design.report.on_diagnosis import on_diagnosis
from syncline_design.report.rendered import rendered


def render_diagnose(name: str, found: DiagnosisAndDesign) -> str:
    """The text of one format for a diagnosis and what it means for the design."""
    return rendered(name, found, lambda: on_diagnosis(found))
