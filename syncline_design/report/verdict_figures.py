"""The charts a verdict has data for; each is drawn only when a page asks for it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from syncline_design.report import choice_tables, numbers, verdict_tables, verdict_words
from syncline_design.report.document import Chart, Explorer, Node
from syncline_design.report.text import shortened
from syncline_design.report.verdict_words import Json, items, part

if TYPE_CHECKING:
    from syncline_design.report.svg import InlineFigure

# What draws is imported where it draws: ElementTree and matplotlib hide behind it.


def lowest_limit(verdict: Json, kind: str) -> float | None:
    """The tightest limit of a kind."""
    limits = [
        float(row["limit"])
        for row in items(verdict, "requirements")
        if row.get("kind") == kind and numbers.finite(row.get("limit")) is not None
    ]
    return min(limits, default=None)


def syncline_chart(verdict: Json) -> list[Node]:
    """The verdict's Syncline with its operating point; nothing where it has none."""
    syncline = part(verdict, "syncline")
    floor, rate = _floor_and_rate(verdict)
    if floor is None or rate is None:
        return []

    def draw() -> InlineFigure:
        from syncline_design.report import figures

        return figures.syncline(
            figures.SynclineCurve(
                floor_m=floor,
                rate_mps=rate,
                tau_crit_s=numbers.finite(syncline.get("tau_crit_s")),
                tau_s=numbers.finite(syncline.get("tau_s")),
                total_m=numbers.finite(syncline.get("total_m")),
                target_m=lowest_limit(verdict, "accuracy"),
                lever_arm_rate_mps=numbers.finite(part(syncline, "lever_arm").get("sync_rate_mps")),
            )
        )

    caption = (
        "Accuracy against synchronisation accuracy. Roof: sensor noise and known effects alone. "
        "Slope: motion during the timestamp error. Marker: this design. Dotted, where drawn: with "
        "the lever arm's rotation."
    )
    return [Chart("syncline", draw, caption)]


def _floor_and_rate(verdict: Json) -> tuple[float | None, float | None]:
    """The error at tau 0 [m] and what each second of tau adds [m/s]."""
    syncline = part(verdict, "syncline")
    sensor = numbers.finite(syncline.get("sensor_error_m"))
    known = numbers.finite(syncline.get("systematic_error_m")) or 0.0
    return sensor + known if sensor else None, numbers.finite(syncline.get("sync_rate_mps"))


def explorer(verdict: Json) -> list[Node]:
    """Values for the sliders; the total follows the model that decides, in proportion to tau."""
    syncline, rows = part(verdict, "syncline"), items(verdict, "requirements")
    floor, _ = _floor_and_rate(verdict)
    tau, total = numbers.finite(syncline.get("tau_s")), numbers.finite(syncline.get("total_m"))
    if floor is None or not tau or total is None:
        return []
    crit, target = numbers.finite(syncline.get("tau_crit_s")), lowest_limit(verdict, "accuracy")
    fixed = [row for row in rows if row.get("kind") not in ("accuracy", "sync", "monte_carlo")]
    centre, middle = crit or tau, target or total
    return [
        Explorer(
            chart="syncline",
            floor_m=floor,
            rate_mps=(total - floor) / tau,
            tau_s=tau,
            tau_crit_s=crit,
            target_m=target,
            sync_limit=lowest_limit(verdict, "sync") or 1.0,
            others_pass=all(verdict_words.status_of(r).word in ("pass", "waived") for r in fixed),
            tau_span=(min(centre / 1e3, tau / 2), max(centre * 1e2, tau * 2)),
            target_span=(min(middle, floor) / 4, max(middle, total) * 10),
        )
    ]


def timing_chart(verdict: Json) -> list[Node]:
    """Each sensor's tau against its tau_crit."""
    roles = [r for r in verdict_tables.roles(verdict) if numbers.finite(r[2].get("tau_s"))
             is not None]  # fmt: skip

    def draw() -> InlineFigure:
        from syncline_design.report import figures

        bars = []
        for stage, role, entry in roles:
            tau, crit = float(entry["tau_s"]), numbers.finite(entry.get("tau_crit_s"))
            label = f"{shortened(stage, 18)} \u00b7 {role}"
            bars.append(figures.TauBar(label, tau, crit, crit is None or tau < crit))
        return figures.tau_bars(bars)

    caption = (
        "Bar: timestamp error of the chosen timestamping. Mark: the sensor's \u03c4_crit. "
        "Logarithmic."
    )
    return [Chart("timing", draw, caption)] if roles else []


def ledger_chart(verdict: Json) -> list[Node]:
    """The terms of the total error."""
    entries = [
        entry
        for entry in items(part(verdict, "syncline"), "ledger")
        if numbers.finite(entry.get("value_m")) is not None
    ]
    many = len({str(entry.get("stage")) for entry in entries if entry.get("stage")}) > 1

    def draw() -> InlineFigure:
        from syncline_design.report import figures

        terms = []
        for entry in entries:
            named = many and entry.get("stage")
            stage = f"{shortened(str(entry['stage']), 14)}: " if named else ""
            label = stage + shortened(verdict_words.term_text(entry))
            terms.append(figures.LedgerTerm(label, float(entry["value_m"]), str(entry.get("kind"))))
        return figures.ledger(terms, lowest_limit(verdict, "accuracy"))

    caption = (
        "Terms add up to the total. Plain: sensor noise. Hatched: synchronisation. Crossed: known "
        "effects."
    )
    return [Chart("ledger", draw, caption)] if entries else []


def grid_chart(verdict: Json) -> list[Node]:
    """The simulated worst case and the Syncline over tau, incomplete rows left out."""
    points = []
    for row in items(part(verdict, "monte_carlo"), "grid"):
        figures = [numbers.finite(row.get(k)) for k in ("tau_s", "worst_case_m", "syncline_m")]
        known = [value for value in figures if value]
        if len(known) == len(figures):
            points.append((known[0], known[1], known[2]))

    def draw() -> InlineFigure:
        from syncline_design.report.figures_results import GridPoint, simulated_against_syncline

        return simulated_against_syncline([GridPoint(*point) for point in sorted(points)])

    caption = (
        "Worst case found by optimisation with every magnitude held to its Syncline term, over a "
        "grid of \u03c4."
    )
    return [Chart("grid", draw, caption)] if len(points) > 1 else []


def choice_chart(verdict: Json) -> list[Node]:
    """The exact front of cost against error, the chosen design on it."""
    points = []
    for entry in items(part(verdict, "choice"), "front"):
        price, error = numbers.finite(entry.get("cost")), numbers.finite(entry.get("error_m"))
        if price is not None and error:
            points.append((price, error, choice_tables.is_chosen(verdict, entry)))

    def draw() -> InlineFigure:
        from syncline_design.report.figures_results import FrontPoint, pareto_front

        target, price = (lowest_limit(verdict, kind) for kind in ("accuracy", "cost"))
        front = [FrontPoint(*point) for point in sorted(points, key=lambda point: point[0])]
        return pareto_front(front, verdict_tables.currency_of(verdict), target, price)

    caption = (
        "Every design on the line is the cheapest with that error; nothing exists below and left "
        "of it."
    )
    return [Chart("choice", draw, caption)] if len(points) > 1 else []
