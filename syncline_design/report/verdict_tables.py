"""The tables of a verdict page."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from syncline_design.report import numbers
from syncline_design.report.table import Cell, Table, table
from syncline_design.report.text import grouped
from syncline_design.report.verdict_words import (
    kind_text,
    larger,
    margin_text,
    of_mission,
    relative_margin,
    row_now,
    selection_reason,
    since_word,
    status_of,
    status_word,
    term_text,
    waiver_text,
)
from syncline_design.report.words import (
    LEDGER_KINDS,
    PRIMITIVES,
    SYNC_MODELS,
    TIMELINES,
)
from syncline_design.verdict.bill import total
from syncline_design.verdict.measured import claim_words

if TYPE_CHECKING:
    from syncline_design.verdict.named import BillLine, NamedDesign
    from syncline_design.verdict.since import Earlier
    from syncline_design.verdict.syncline_figures import SynclineFigures
    from syncline_design.verdict.tree import RequirementResult, Verdict


def requirements(verdict: Verdict) -> Table:
    """Every requirement with value, limit, margin and where the spec states it."""
    rows = []
    for row in verdict.requirements:
        state = status_of(row)
        notes = (row.note, _interval(row, verdict), waiver_text(row))
        rows.append((
            Cell(row.id),
            Cell(state.word, tone=state.tone, mark=state.mark),
            kind_text(row),
            Cell(numbers.held(row.value, row), row.value),
            Cell(numbers.limit(row), row.limit, written=True),
            Cell(margin_text(row), relative_margin(row)),
            f"line {row.line}" if row.line and not row.implied else "implied",
            "; ".join(note for note in notes if note),
        ))  # fmt: skip
    heads = ("Requirement", "Status", "Limits", "Value #", "Limit #", "Margin #", "In the spec",
             "Note")  # fmt: skip
    return table("Requirements", heads, rows)


def since(verdict: Verdict) -> Table | None:
    """What became of each requirement since the baseline."""
    baseline = verdict.baseline
    if baseline is None or not baseline.requirements:
        return None
    rows = []
    for one in baseline.requirements:
        row, was = row_now(one, verdict), one.was
        word = None if row is None else status_of(row)
        then = None if was is None else status_word(was.status, waived=bool(was.waived))
        since = since_word(one, verdict)
        rows.append((
            Cell(of_mission(one.mission, one.id)),
            Cell(since.word, tone=since.tone),
            "-" if word is None else word.word,
            _both(row),
            "-" if then is None else then.word,
            _both(was),
        ))  # fmt: skip
    heads = ("Requirement", "Since then", "Now", "Value and limit now #", "Then",
             "Value and limit then #")  # fmt: skip
    return table("Against the baseline", heads, rows)


def _both(row: RequirementResult | Earlier | None) -> str:
    if row is None:
        return "-"
    return f"{numbers.held(row.value, row)} / {numbers.limit(row)}"


def _interval(row: RequirementResult, verdict: Verdict) -> str:
    if verdict.monte_carlo is None or numbers.finite(row.low) is None:
        return ""
    if numbers.finite(row.high) is None:
        return ""
    confidence = numbers.percent(verdict.monte_carlo.confidence)
    ends = f"{numbers.held(row.low, row)} to {numbers.held(row.high, row)}"
    return f"{confidence} interval, over all looks at the decision, {ends}"


def payload(verdict: Verdict, design: NamedDesign) -> Table:
    """Chosen sensors, how each is timestamped, and why."""
    rows = [
        (
            f"{stage.name} \u00b7 {role}",
            entry.name,
            PRIMITIVES.get(entry.primitive, entry.primitive),
            entry.timestamping_name,
            TIMELINES.get(entry.timeline, ""),
            _price(entry.cost, verdict),
            selection_reason(verdict, stage.name, role),
        )
        for stage, role, entry in design.roles
    ]
    heads = ("Role", "Sensor", "Primitive", "Timestamping", "Timeline", "Cost #", "Why")
    return table("Payload and timestamping", heads, rows)


def _price(cost: float | None, verdict: Verdict) -> Cell:
    return Cell(numbers.money(cost, currency_of(verdict)), cost)


def shared(verdict: Verdict, design: NamedDesign) -> Table | None:
    """Shared hardware and clocks, bought once per vehicle."""
    rows = [
        (
            entry.name,
            entry.vehicle,
            Cell(numbers.count(entry.count), float(entry.count)),
            _price(entry.cost, verdict),
        )
        for entry in design.infrastructure
    ]
    rows += [
        (f"clock: {entry.name}", entry.vehicle, Cell("1", 1.0), _price(entry.cost, verdict))
        for entry in design.clocks
    ]
    heads = ("Shared hardware", "Vehicle", "Count #", "Cost #")
    return table("Shared hardware and clocks", heads, rows) if rows else None


def _some(missions: Sequence[str]) -> str:
    """`in mission near`."""
    return f"in mission {', '.join(missions)}"


def bill(verdict: Verdict, lines: tuple[BillLine, ...]) -> Table:
    """What to buy, line by line, and what it comes to."""
    rows = [
        (
            line.stage,
            line.item,
            line.use if line.missions is None else f"{line.use}, {_some(line.missions)}",
            Cell(numbers.count(line.quantity), float(line.quantity)),
            *_amounts(verdict, line.cost, line.mass, line.power),
            line.basis,
        )
        for line in lines
    ]
    sums = (total(lines, name) for name in ("cost", "mass", "power"))
    rows.append(("Total", "", "", Cell("", None), *_amounts(verdict, *sums), ""))
    heads = ("Stage", "Item", "For", "Quantity #", "Cost #", "Mass #", "Power #", "Basis")
    return table("Bill of materials", heads, rows, named_by=1)


def _amounts(
    verdict: Verdict, cost: float | None, mass: float | None, power: float | None
) -> tuple[Cell, Cell, Cell]:
    return (
        Cell(numbers.money(cost, currency_of(verdict)), cost),
        Cell(numbers.mass(mass, 9), mass),
        Cell(numbers.power(power, 9), power),
    )


def taus(design: NamedDesign, limit: RequirementResult | None) -> Table:
    """tau of each sensor against its tau_crit, as in the paper and with the lever arm.

    limit: of the total error, in whose unit the sensor's is told.
    """
    rows = []
    for stage, role, entry in design.roles:
        tau, crit, lever = entry.tau_s, entry.tau_crit_s, entry.tau_crit_lever_arm_s
        ratio = None if not crit else tau / crit
        within = ratio is None or ratio < 1.0
        rows.append((
            f"{stage.name} \u00b7 {role}",
            entry.name,
            Cell(numbers.time(tau), tau),
            Cell(numbers.time_limit(crit), crit),
            Cell(
                numbers.percent(ratio) if ratio is not None else numbers.MISSING,
                ratio,
                "good" if within else "bad",
                "\u2713" if within else "\u2717",
            ),
            Cell(numbers.time_limit(lever), lever),
            Cell(numbers.error(entry.sensor_error_m, limit), entry.sensor_error_m),
        ))  # fmt: skip
    heads = ("Role", "Sensor", "\u03c4 #", "\u03c4_crit #", "Used #", "\u03c4_crit, lever arm #",
             "Sensor error #")  # fmt: skip
    return table("Timestamp error of each sensor against the largest it may have", heads, rows)


def ledger(syncline: SynclineFigures, limit: RequirementResult | None) -> Table:
    """Every term of the total error, in the unit of its limit."""
    rows = [
        (
            term_text(entry),
            entry.stage,
            LEDGER_KINDS[entry.kind],
            Cell(numbers.error(entry.value_m, limit), entry.value_m),
            Cell(numbers.percent(entry.share), entry.share),
        )
        for entry in larger(syncline.ledger)
    ]
    heads = ("Term", "Stage", "Kind", "Value #", "Share #")
    return table("Terms of the total error", heads, rows, _too_small(syncline, limit))


def _too_small(syncline: SynclineFigures, limit: RequirementResult | None) -> str:
    """What the terms without a row come to."""
    shown = larger(syncline.ledger)
    rest = math.fsum(e.value_m for e in syncline.ledger) - math.fsum(e.value_m for e in shown)
    count = len(syncline.ledger) - len(shown)
    if not count:
        return ""
    amount = numbers.error(rest, limit)
    if count == 1:
        return f"1 term is below 0.1 % of the total and has no row: {amount}."
    return f"{count} terms are below 0.1 % of the total and have no row; together {amount}."


def models(syncline: SynclineFigures, limit: RequirementResult | None) -> Table:
    """Both synchronisation models and the lever-arm variant; limit: of their total."""
    found = (("syncline", syncline.models.syncline), ("per_sensor", syncline.models.per_sensor))
    rows = [
        (
            SYNC_MODELS[key] + (" \u2014 decides" if key == syncline.model else ""),
            Cell(numbers.error(entry.sync_error_m, limit), entry.sync_error_m),
            Cell(numbers.error(entry.total_m, limit), entry.total_m),
        )
        for key, entry in found
    ]
    lever = syncline.lever_arm
    error = lever.sync_rate_mps * syncline.tau_s
    rows.append(
        (
            "Syncline with the lever arm's rotation",
            Cell(numbers.error(error, limit), error),
            Cell(numbers.error(lever.total_m, limit), lever.total_m),
        )
    )
    heads = ("Model", "Synchronisation error #", "Total error #")
    return table("Total error by model", heads, rows)


def assumptions(verdict: Verdict) -> Table | None:
    """Figures without a public source that this verdict rests on, a row per catalog entry."""
    figures: dict[tuple[str, str], list[str]] = {}
    for entry in verdict.assumptions or ():
        figures.setdefault((entry.entry, entry.note), []).append(
            f"{entry.figure} {grouped(entry.value)}"
        )
    rows = [
        (Cell(name, code=True), "; ".join(values), note) for (name, note), values in figures.items()
    ]
    heads = ("Entry", "Assumed figures", "Note")
    return table("Assumptions: figures without a public source", heads, rows) if rows else None


def measured(verdict: Verdict) -> Table | None:
    """Timing errors that were measured, with what is claimed of them."""
    rows = [
        (
            Cell(entry.entry, code=True),
            Cell(numbers.time(entry.bound_s), entry.bound_s),
            claim_words(entry.claim),
            (entry.claim.rests_on or "").replace("_", " ") if entry.claim else "",
            entry.conditions,
            Cell(_counted(len(entry.evidence), "log"), sub=_counted(entry.events, "event")),
        )
        for entry in verdict.measured or ()
    ]
    heads = ("Entry", "Bound #", "Holds for", "Rests on", "Conditions", "Evidence")
    return table("Measured timing errors", heads, rows) if rows else None


def _counted(count: int, what: str) -> str:
    return f"{count} {what}" if count == 1 else f"{count} {what}s"


def sources(verdict: Verdict) -> Table | None:
    """Where the catalog's figures come from."""
    rows = [(Cell(entry.entry, code=True), entry.source) for entry in verdict.sources or ()]
    return table("Sources of the catalog figures", ("Entry", "Source"), rows) if rows else None


def currency_of(verdict: Verdict) -> str:
    """The currency amounts are given in."""
    return verdict.spec.currency
