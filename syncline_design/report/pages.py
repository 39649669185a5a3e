"""HTML pages by kind; jinja2 and matplotlib load with the first one."""

from __future__ import annotations

from syncline_design.report.on_diagnosis import render_diagnosis

__all__ = ["render_diagnosis"]
