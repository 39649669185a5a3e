"""The outputs of `diagnose` in every format."""

from __future__ import annotations

from typing import Any

from syncline_design.report.formats import DIAGNOSE_FORMATS as DIAGNOSE_FORMATS


def render_diagnose(name: str, data: dict[str, Any]) -> str:
    """The text of one format for a diagnosis (schema syncline-design/diagnosis/v1)."""
    if name == "json":
        from syncline_design.report.json_out import json_text

        return json_text(data)
    if name == "markdown":
        from syncline_design.report.diagnosis_markdown import render_diagnosis_markdown

        return render_diagnosis_markdown(data)
    from syncline_design.report.on_diagnosis import render_diagnosis

    return render_diagnosis(data)
