"""The figures a verdict has data for."""

from __future__ import annotations

from syncline_design.report import (
    choice_tables,
    figures,
    figures_results,
    numbers,
    verdict_tables,
    verdict_words,
)
from syncline_design.report.svg import InlineFigure
from syncline_design.report.text import shortened
from syncline_design.report.verdict_words import Json, items, named, part


def accuracy_target(verdict: Json) -> float | None:
    """The tightest accuracy limit [m]."""
    limits = [
        float(row["limit"])
        for row in items(verdict, "requirements")
        if row.get("kind") == "accuracy" and numbers.finite(row.get("limit")) is not None
    ]
    return min(limits, default=None)


def syncline_curve(verdict: Json) -> figures.SynclineCurve | None:
    """The verdict's Syncline; None where it has none."""
    syncline = part(verdict, "syncline")
    sensor = numbers.finite(syncline.get("sensor_error_m"))
    rate = numbers.finite(syncline.get("sync_rate_mps"))
    if not sensor or rate is None:
        return None
    return figures.SynclineCurve(
        floor_m=sensor + (numbers.finite(syncline.get("systematic_error_m")) or 0.0),
        rate_mps=rate,
        tau_crit_s=numbers.finite(syncline.get("tau_crit_s")),
        tau_s=numbers.finite(syncline.get("tau_s")),
        total_m=numbers.finite(syncline.get("total_m")),
        target_m=accuracy_target(verdict),
        lever_arm_rate_mps=numbers.finite(part(syncline, "lever_arm").get("sync_rate_mps")),
    )


def verdict_figures(verdict: Json) -> dict[str, InlineFigure]:
    """Every figure the verdict has data for."""
    drawn: dict[str, InlineFigure] = {}
    curve = syncline_curve(verdict)
    target = accuracy_target(verdict)
    if curve is not None:
        drawn["syncline"] = figures.syncline(curve)
    bars = _tau_bars(verdict)
    if bars:
        drawn["timing"] = figures.tau_bars(bars)
    terms = _ledger_terms(verdict)
    if terms:
        drawn["ledger"] = figures.ledger(terms, target)
    drawn |= simulation_figures(verdict, target)
    front = _front(verdict)
    if len(front) > 1:
        cost_limit = lowest_limit(verdict, "cost")
        currency = verdict_tables.currency_of(verdict)
        drawn["choice"] = figures_results.pareto_front(front, currency, target, cost_limit)
    return drawn


def _tau_bars(verdict: Json) -> list[figures.TauBar]:
    bars = []
    for stage, role, entry in verdict_tables.roles(verdict):
        tau, crit = numbers.finite(entry.get("tau_s")), numbers.finite(entry.get("tau_crit_s"))
        if tau is not None:
            within = crit is None or tau < crit
            label = f"{shortened(stage, 18)} \u00b7 {role}"
            bars.append(figures.TauBar(label, tau, crit, within))
    return bars


def _ledger_terms(verdict: Json) -> list[figures.LedgerTerm]:
    entries = items(part(verdict, "syncline"), "ledger")
    many = len({str(entry.get("stage")) for entry in entries if entry.get("stage")}) > 1
    return [
        figures.LedgerTerm(
            (f"{shortened(str(entry['stage']), 14)}: " if many and entry.get("stage") else "")
            + shortened(verdict_words.term_text(entry)),
            value,
            str(entry.get("kind")),
        )
        for entry in entries
        if (value := numbers.finite(entry.get("value_m"))) is not None
    ]


def simulation_figures(verdict: Json, target: float | None) -> dict[str, InlineFigure]:
    """Histogram and grid, where the data are there; the grid may stand beside `monte_carlo`."""
    drawn: dict[str, InlineFigure] = {}
    monte_carlo = part(verdict, "monte_carlo")
    histogram = part(monte_carlo, "histogram")
    edges = [numbers.finite(edge) for edge in histogram.get("edges_m") or ()]
    density = [numbers.finite(value) or 0.0 for value in histogram.get("density") or ()]
    known = [edge for edge in edges if edge is not None]
    if len(known) == len(edges) == len(density) + 1 > 1:
        marks = tuple(
            (numbers.percent(float(key), 4), value)
            for key, entry in named(monte_carlo, "quantiles")
            if (value := numbers.finite(entry.get("value_m"))) is not None
        )
        total = numbers.finite(part(verdict, "syncline").get("total_m"))
        drawn["histogram"] = figures_results.error_histogram(
            figures_results.Histogram(tuple(known), tuple(density), marks, target, total)
        )
    points = grid_points(items(monte_carlo, "grid") or items(verdict, "grid"))
    if len(points) > 1:
        drawn["grid"] = figures_results.simulated_against_syncline(points)
    return drawn


def grid_points(rows: list[Json]) -> list[figures_results.GridPoint]:
    """The simulated worst case and the Syncline over tau, incomplete rows left out."""
    points = []
    for row in rows:
        tau = numbers.finite(row.get("tau_s"))
        worst = numbers.finite(row.get("worst_case_m"))
        line = numbers.finite(row.get("syncline_m"))
        if tau and worst and line:
            points.append(figures_results.GridPoint(tau, worst, line))
    return sorted(points, key=lambda point: point.tau_s)


def _front(verdict: Json) -> list[figures_results.FrontPoint]:
    points = []
    for entry in items(part(verdict, "choice"), "front"):
        price, error = numbers.finite(entry.get("cost")), numbers.finite(entry.get("error_m"))
        if price is not None and error:
            chosen = choice_tables.is_chosen(verdict, entry)
            points.append(figures_results.FrontPoint(price, error, chosen))
    return sorted(points, key=lambda point: point.cost)


def lowest_limit(verdict: Json, kind: str) -> float | None:
    """The tightest limit of a kind."""
    limits = [
        float(row["limit"])
        for row in items(verdict, "requirements")
        if row.get("kind") == kind and numbers.finite(row.get("limit")) is not None
    ]
    return min(limits, default=None)
