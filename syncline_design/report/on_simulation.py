"""The page of `simulate`: worst case over tau beside the Syncline, and the error's distribution."""

from __future__ import annotations

from typing import Any

from syncline_design.report import numbers, page, verdict_tables
from syncline_design.report.on_verdict import drawing, simulation_facts, simulation_notes
from syncline_design.report.table import Cell, Table, table
from syncline_design.report.text import harmless
from syncline_design.report.verdict_figures import grid_points, simulation_figures
from syncline_design.report.verdict_words import Json, Outcome, items, part


def render_simulation(data: Json) -> str:
    """The HTML page of one simulation (schema syncline-design/simulation/v1).

    `spec` {name, file} beside the schema's own keys names the system.
    """
    data = harmless(data)
    target = numbers.finite(
        part(part(data, "monte_carlo"), "probability_within_target").get("target_m")
    )
    drawn = simulation_figures(data, target)
    tables = _tables(data)
    return page.render_page(
        "simulation.html.j2",
        kind="Simulation",
        name=str(part(data, "spec").get("name") or data.get("name") or "Simulated system"),
        outcome=_outcome(data),
        facts=simulation_facts(data),
        contents=[(key, label) for key, label in (("grid", "Worst case"), ("errors", "Errors"),
                                                  ("provenance", "Provenance"))],
        figures={key: drawing(drawn.get(key)) for key in ("grid", "histogram")},
        tables=tables,
        trajectory=str(data.get("trajectory") or ""),
        certificate=_certificate(data),
        notes=simulation_notes(data)[1:] if _certificate(data) else simulation_notes(data),
        provenance=_provenance(data),
    )  # fmt: skip


def _outcome(data: Json) -> Outcome:
    """How far the simulator leaves the Syncline, in words; no verdict is due here."""
    points = grid_points(items(data, "grid"))
    if not points:
        return Outcome("muted", "\u2192", "Simulated")
    ratios = [point.worst_m / point.syncline_m for point in points]
    return Outcome(
        "muted",
        "\u2192",
        f"Worst case between {numbers.percent(min(ratios), 4)} and "
        f"{numbers.percent(max(ratios), 4)} of the Syncline",
    )


def _tables(data: Json) -> dict[str, Table | None]:
    return {"grid": grid_table(items(data, "grid")), "quantiles": verdict_tables.quantiles(data)}


def grid_table(rows: list[Json]) -> Table | None:
    """Worst case, Syncline and the reason of the difference at every tau."""
    found = [
        (
            Cell(numbers.time(row.get("tau_s")), numbers.finite(row.get("tau_s"))),
            Cell(numbers.length(row.get("worst_case_m")), numbers.finite(row.get("worst_case_m"))),
            Cell(numbers.length(row.get("syncline_m")), numbers.finite(row.get("syncline_m"))),
            Cell(numbers.percent(row.get("ratio"), 4), numbers.finite(row.get("ratio"))),
            str(row.get("reason") or ""),
        )
        for row in rows
    ]
    heads = ("\u03c4 #", "Worst case #", "Syncline #", "Ratio #", "Why they differ")
    return table("Worst case against the Syncline", heads, found) if found else None


def _certificate(data: Json) -> str:
    worst = part(part(data, "monte_carlo"), "worst_case")
    return str(part(worst, "certificate").get("text") or "")


def _provenance(data: Json) -> list[tuple[str, Any]]:
    found = [(str(key), str(value)) for key, value in part(data, "versions").items()]
    file = part(data, "spec").get("file")
    return [*([("Spec file", str(file))] if file else []), *found]
