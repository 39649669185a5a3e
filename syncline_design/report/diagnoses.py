"""The outputs of `diagnose` in every format."""

from __future__ import annotations

from typing import Any, Final

DIAGNOSE_FORMATS: Final = ("json", "html")


def render_diagnose(name: str, data: dict[str, Any]) -> str:
    """The text of one format for a diagnosis (schema syncline-design/diagnosis/v1)."""
    if name == "json":
        from syncline_design.report.json_out import json_text

        return json_text(data)
    from syncline_design.report.diagnosis_page import render_diagnosis

    return render_diagnosis(data)
