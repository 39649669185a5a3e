"""The outputs of `diagnose` in every format."""

from __future__ import annotations

from syncline_design.comparison.meaning import DiagnosisAndDesign
from syncline_design.report.formats import DIAGNOSE_FORMATS as DIAGNOSE_FORMATS
from syncline_design.report.json_out import json_text
from syncline_design.report.on_diagnosis import on_diagnosis
from syncline_design.report.render_html import html
from syncline_design.report.render_markdown import markdown


def render_diagnose(name: str, found: DiagnosisAndDesign) -> str:
    """The text of one format for a diagnosis and what it means for the design."""
    if name == "json":
        return json_text(found.to_json())
    if name == "markdown":
        return markdown(on_diagnosis(found))
    return html(on_diagnosis(found))
