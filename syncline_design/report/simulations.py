"""The outputs of `simulate`: one simulated spec in every format."""

from __future__ import annotations

from syncline_design.report.formats import SIMULATE_FORMATS as SIMULATE_FORMATS
from syncline_design.simulation.summary import grid_csv
from syncline_design.verdict.simulated_spec import SimulatedSpec


def render_simulate(name: str, run: SimulatedSpec) -> str:
    """The text of one format; csv holds the comparison over tau."""
    if name == "csv":
        return grid_csv(run.result)
    if name == "json":
        from syncline_design.report.json_out import json_text

        return json_text(run.to_json())
    from syncline_design.report.on_simulation import render_simulation

    return render_simulation(run.to_json())
