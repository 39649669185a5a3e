"""HTML pages by kind; jinja2 and matplotlib load with the first one."""

from __future__ import annotations

from syncline_design.report.on_diagnosis import render_diagnosis
from syncline_design.report.on_verdict import render_verdict
from syncline_design.report.overview_page import render_verdicts

__all__ = [
    "render_diagnosis",
    "render_verdict",
    "render_verdicts",
]
