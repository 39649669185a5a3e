"""HTML pages by kind; jinja2 and matplotlib load with the first one."""

from __future__ import annotations

from syncline_design.report.diagnosis_page import render_diagnosis
from syncline_design.report.overview_page import render_verdicts
from syncline_design.report.reproduction_page import render_reproduction
from syncline_design.report.simulation_page import render_simulation
from syncline_design.report.verdict_page import render_verdict

__all__ = [
    "render_diagnosis",
    "render_reproduction",
    "render_simulation",
    "render_verdict",
    "render_verdicts",
]
