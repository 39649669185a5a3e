"""What `simulate` says: worst case over tau beside the Syncline, and the error's distribution."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import groupby
from typing import TYPE_CHECKING, Final

from syncline_design.model.system import System
from syncline_design.report import numbers
from syncline_design.report.csv_out import plain_csv
from syncline_design.report.document import (
    Chart,
    Document,
    Group,
    Items,
    Node,
    Outcome,
    Text,
    code,
    given,
    provenance,
    section,
    show,
)
from syncline_design.report.formats import SIMULATE_FORMATS as SIMULATE_FORMATS
from syncline_design.report.rendered import rendered
from syncline_design.report.simulated import (
    BEYOND,
    along_chart,
    certificate,
    ensemble,
    histogram_chart,
    quantiles,
    simulation_facts,
    span,
)
from syncline_design.report.table import Cell, Table, table
from syncline_design.simulation.comparison import CAUSES
from syncline_design.simulation.results import ComparisonRow, Simulation
from syncline_design.verdict.simulated_spec import SimulatedSpec

if TYPE_CHECKING:
    from syncline_design.report.svg import InlineChart

GRID_COLUMNS: Final = ("tau_s", "worst_case_m", "syncline_m", "ratio", "bound_m", "gap", "reason")


_NAMES: Final[Mapping[str, str]] = {
    "lever_arm": "lever arm", "chord": "chord", "range_noise": "range noise", "tilt": "tilt",
}  # fmt: skip


def on_simulation(result: Simulation, system: System | None = None) -> Document:
    """A simulated system as a document; no verdict is due here.

    system: what was simulated; without it the known effects that acted are not listed.
    """
    name = result.spec.name if result.spec is not None else "Simulated system"
    file = result.spec.file if result.spec is not None else ""
    where = f", along {result.trajectory}" if result.trajectory else ""
    return Document(
        family="Simulation",
        outcome=_outcome(result.grid),
        name=name,
        sentences=(f"The nonlinear measurement chain against the Syncline{where}.",),
        facts=(
            *simulation_facts(result.monte_carlo),
            ("\u03c4_crit of the system", numbers.time_limit(result.syncline.tau_crit_s)),
        ),
        sections=(
            *section(
                "grid", "Worst case over the timestamp error", _grid(result, system), "Worst case"
            ),
            *section("errors", "Distribution of the error", _errors(result), "Errors"),
            *section("effects", "Known effects acting", _effects(system), "Known effects"),
            *provenance(_provenance(result)),
        ),
        source=file,
    )


def _provenance(result: Simulation) -> list[tuple[str, str]]:
    """What the figures are pinned by: files by their content, seed, versions."""
    content, spec = result.provenance, result.spec
    files = [("Spec file", spec.file)] if spec is not None and spec.file else []
    hashes = [] if content is None else [
        ("Spec, SHA-256", content.spec_sha256), ("Catalogs, SHA-256", content.catalogs_sha256),
    ]  # fmt: skip
    return [*files, *hashes, ("Seed", str(result.monte_carlo.seed)), *result.versions.items()]


def _outcome(grid: tuple[ComparisonRow, ...]) -> Outcome:
    """How far the simulator leaves the Syncline, in words."""
    ratios = [row.ratio for row in grid if numbers.finite(row.ratio)]
    if not ratios:
        return Outcome("muted", "\u2192", "Simulated")
    ends = span(numbers.percent(min(ratios), 4), numbers.percent(max(ratios), 4))
    return Outcome("muted", "\u2192", f"Worst case {ends} of the Syncline")


def _own_tau(system: System | None) -> str:
    """Where the worst case beside the grid stands; known effects act there where there are any."""
    if system is None:
        return "At the \u03c4 of the timestamps, known effects of the spec, if any, besides"
    # a known latency is no timestamp error here, while it is part of the tau that `check` tells
    if system.effects:
        return "At the \u03c4 of the timestamps, known effects besides"
    return "At the system's own \u03c4"


def _grid(result: Simulation, system: System | None) -> list[Node]:
    worst, within = result.monte_carlo.worst_case, result.monte_carlo.probability_within_target
    share = numbers.percent(worst.ratio_to_syncline, 4)
    said = (
        f"{_own_tau(system)}, {numbers.time(worst.tau_s)}: "
        f"{numbers.error(worst.value_m, within)}, {share} of the "
        f"Syncline's {numbers.error(worst.syncline_m, within)}. " + certificate(result.monte_carlo)
    )
    return [
        Text("Every magnitude is held to its Syncline term and the directions are free: the "
             "largest error is found by optimization, not by luck of sampling."),
        Text(said),
        *_grid_chart(result.grid, within),
        *show(_grid_table(result.grid, within, reasons=False), silent=True, reach="text"),
        *_causes(result.grid),
        Group(tuple(show(_grid_table(result.grid, within, reasons=True), silent=True)), "fold",
              summary="Worst case and Syncline at every \u03c4, and why they differ", reach="page"),
    ]  # fmt: skip


def _grid_chart(grid: tuple[ComparisonRow, ...], limit: numbers.Limited | None) -> list[Node]:
    def draw() -> InlineChart:
        from syncline_design.report.charts_grid import GridPoint, simulated_against_syncline

        return simulated_against_syncline(
            [GridPoint(r.tau_s, r.worst_case_m, r.syncline_m) for r in grid if r.tau_s > 0.0],
            limit,
        )

    caption = "Line: Syncline. Dots: worst case of the simulator. Below: their ratio."
    return [Chart("grid", draw, caption)] if len(grid) > 1 else []


def _grid_table(
    grid: tuple[ComparisonRow, ...], limit: numbers.Limited | None, *, reasons: bool
) -> Table:
    """Worst case and Syncline at every tau; with the reason of the difference where asked for."""
    rows = []
    for row in grid:
        cells = [
            Cell(numbers.time(row.tau_s), row.tau_s),
            Cell(numbers.error(row.worst_case_m, limit), row.worst_case_m),
            Cell(numbers.error(row.syncline_m, limit), row.syncline_m),
            Cell(numbers.percent(row.ratio, 4), numbers.finite(row.ratio)),
        ]
        rows.append([*cells, *([Cell(_shares(row))] if reasons else [])])
    heads = ["\u03c4 #", "Worst case #", "Syncline #", "Ratio #"]
    why = ["Why they differ"] if reasons else []
    return table("Worst case against the Syncline", [*heads, *why], rows, _meanings(grid) * reasons)


def _shares(row: ComparisonRow) -> str:
    """What the two differ by, each cause by its name: `range noise (5.1 %)`."""
    _, _, told = row.reason.partition(": ")
    for cause in row.causes:
        told = told.replace(CAUSES[cause], _NAMES[cause])
    return told


def _meanings(grid: tuple[ComparisonRow, ...]) -> str:
    """Every cause that a grid names, said once."""
    found = dict.fromkeys(cause for row in grid for cause in row.causes)
    return "; ".join(f"{_NAMES[cause]}: {CAUSES[cause]}" for cause in found)


def _causes(grid: tuple[ComparisonRow, ...]) -> list[Node]:
    """Runs of neighbouring taus whose ratio leaves 1 for the same main cause, each in words."""
    lines = []
    for cause, run in groupby(grid, key=lambda row: row.causes[0] if row.causes else ""):
        rows = list(run)
        if cause:
            ratios = [row.ratio for row in rows]
            taus = span(numbers.time(rows[0].tau_s), numbers.time(rows[-1].tau_s))
            ends = span(numbers.percent(min(ratios), 3), numbers.percent(max(ratios), 3))
            lines.append(f"\u03c4 {taus}, ratio {ends}: {CAUSES[cause]}")
    if not lines:
        words = "The worst case stays within 2 % of the Syncline over the whole grid."
        return [Text(words)]
    lead = Text("Where it leaves the Syncline by more than 2 %, and why:")
    return [lead, Items(tuple(lines))]


def _errors(result: Simulation) -> list[Node]:
    monte_carlo = result.monte_carlo
    return [
        Text(f"Gaussian noise and the timing errors' own distributions. {BEYOND} "
             f"{ensemble(monte_carlo)}"),
        *histogram_chart(monte_carlo, None),
        *along_chart(monte_carlo),
        *show(quantiles(monte_carlo)),
    ]  # fmt: skip


def _effects(system: System | None) -> list[Node]:
    known = () if system is None else system.effects
    entries = [(code(e.effect), " of the ", given(e.sensor), " sensor") for e in known]
    return [Items(tuple(entries))] if entries else []


def render_simulate(name: str, run: SimulatedSpec) -> str:
    """The text of one format; csv holds the comparison over tau."""
    if name == "csv":
        return grid_csv(run.result)
    return rendered(name, run.result, lambda: on_simulation(run.result, run.system))


def grid_csv(result: Simulation) -> str:
    """The comparison over tau as CSV, one row per tau, numbers at full precision."""
    rows = (
        (row.tau_s, row.worst_case_m, row.syncline_m, row.ratio, row.bound_m, row.gap, row.reason)
        for row in result.grid
    )
    return plain_csv(GRID_COLUMNS, rows)
