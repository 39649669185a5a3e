"""The outputs of `simulate`: one simulated spec in every format."""

from __future__ import annotations

from typing import Final

from syncline_design.report.document import Document
from syncline_design.report.formats import SIMULATE_FORMATS as SIMULATE_FORMATS
from syncline_design.report.on_simulation import on_simulation
from syncline_design.simulation.results import Simulation
from syncline_design.verdict.simulated_spec import SimulatedSpec

CSV_HEADER: Final = "tau_s,worst_case_m,syncline_m,ratio,bound_m,gap,reason"


def simulated_document(run: SimulatedSpec) -> Document:
    """A simulated spec in words."""
    return on_simulation(run.result, run.system)


def render_simulate(name: str, run: SimulatedSpec) -> str:
    """The text of one format; csv holds the comparison over tau."""
    if name == "csv":
        return grid_csv(run.result)
    if name == "json":
        from syncline_design.report.json_out import json_text

        return json_text(run.result.to_json())
    from syncline_design.report.render_html import html

    return html(simulated_document(run))


def grid_csv(result: Simulation) -> str:
    """The comparison over tau as CSV, one row per tau, numbers at full precision."""
    lines = [CSV_HEADER]
    for w in result.grid:
        figures = (w.tau_s, w.worst_case_m, w.syncline_m, w.ratio, w.bound_m, w.gap)
        reason = w.reason.replace('"', '""')
        lines.append(",".join([*(repr(float(f)) for f in figures), f'"{reason}"']))
    return "\n".join(lines) + "\n"
