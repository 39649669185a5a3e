"""The tables of a verdict page."""

from __future__ import annotations

from collections.abc import Iterator

from syncline_design.report import numbers
from syncline_design.report.table import Cell, Table, table
from syncline_design.report.verdict_words import (
    Json,
    items,
    kind_text,
    margin_text,
    named,
    part,
    relative_margin,
    selection_reason,
    status_of,
    term_text,
    value_text,
    waiver_text,
)
from syncline_design.report.words import LEDGER_KINDS, PRIMITIVES, SYNC_MODELS, TIMELINES


def roles(verdict: Json) -> Iterator[tuple[str, str, Json]]:
    """(stage, role, entry) of every chosen sensor."""
    for stage in items(part(verdict, "design"), "stages"):
        for role, entry in named(stage, "roles"):
            yield str(stage.get("name")), role, entry


def requirements(verdict: Json) -> Table:
    """Every requirement with value, limit, margin and where the spec states it."""
    rows = []
    for row in items(verdict, "requirements"):
        state = status_of(row)
        line = numbers.finite(row.get("line"))
        where = "implied" if row.get("implied") or not line else f"line {line:.0f}"
        notes = [str(n) for n in (row.get("note"), _interval(row, verdict), waiver_text(row)) if n]
        rows.append((
            Cell(str(row.get("id"))),
            Cell(state.word, tone=state.tone, mark=state.mark),
            kind_text(row),
            Cell(value_text(row, "value"), numbers.finite(row.get("value"))),
            Cell(value_text(row, "limit"), numbers.finite(row.get("limit"))),
            Cell(margin_text(row), relative_margin(row)),
            where,
            "; ".join(notes),
        ))  # fmt: skip
    heads = ("Requirement", "Status", "Limits", "Value #", "Limit #", "Margin #", "In the spec",
             "Note")  # fmt: skip
    return table("Requirements", heads, rows)


def _interval(row: Json, verdict: Json) -> str:
    low, high = row.get("low"), row.get("high")
    if numbers.finite(low) is None or numbers.finite(high) is None:
        return ""
    unit = str(row.get("unit") or "")
    confidence = numbers.percent(part(verdict, "monte_carlo").get("confidence") or 0.95)
    ends = f"{numbers.in_unit(low, unit)} to {numbers.in_unit(high, unit)}"
    return f"{confidence} interval, over all looks at the decision, {ends}"


def payload(verdict: Json) -> Table:
    """Chosen sensors, how each is timestamped, and why."""
    currency = currency_of(verdict)
    rows = [
        (
            f"{stage} \u00b7 {role}",
            str(entry.get("name") or entry.get("sensor")),
            PRIMITIVES.get(str(entry.get("primitive")), str(entry.get("primitive"))),
            str(entry.get("timestamping_name") or entry.get("timestamping")),
            TIMELINES.get(str(entry.get("timeline")), ""),
            Cell(numbers.money(entry.get("cost"), currency), numbers.finite(entry.get("cost"))),
            selection_reason(verdict, stage, role),
        )
        for stage, role, entry in roles(verdict)
    ]
    heads = ("Role", "Sensor", "Primitive", "Timestamping", "Timeline", "Cost #", "Why")
    return table("Payload and timestamping", heads, rows)


def shared(verdict: Json) -> Table | None:
    """Shared hardware and clocks, bought once per vehicle."""
    design = part(verdict, "design")
    currency = currency_of(verdict)
    rows = [
        (
            str(entry.get("name") or entry.get("id")),
            str(entry.get("vehicle")),
            Cell(numbers.count(entry.get("count")), numbers.finite(entry.get("count"))),
            Cell(numbers.money(entry.get("cost"), currency), numbers.finite(entry.get("cost"))),
        )
        for entry in items(design, "infrastructure")
    ]
    rows += [
        (
            f"clock: {entry.get('name') or entry.get('id')}",
            str(entry.get("vehicle")),
            Cell("1", 1.0),
            Cell(numbers.money(entry.get("cost"), currency), numbers.finite(entry.get("cost"))),
        )
        for entry in items(design, "clocks")
        if entry.get("id")
    ]
    heads = ("Shared hardware", "Vehicle", "Count #", "Cost #")
    return table("Shared hardware and clocks", heads, rows) if rows else None


def taus(verdict: Json) -> Table:
    """tau of each sensor against its tau_crit, as in the paper and with the lever arm."""
    rows = []
    for stage, role, entry in roles(verdict):
        tau, crit = numbers.finite(entry.get("tau_s")), numbers.finite(entry.get("tau_crit_s"))
        ratio = None if tau is None or not crit else tau / crit
        within = ratio is None or ratio < 1.0
        lever = entry.get("tau_crit_lever_arm_s")
        rows.append((
            f"{stage} \u00b7 {role}",
            str(entry.get("name") or entry.get("sensor")),
            Cell(numbers.time(tau), tau),
            Cell(numbers.time_limit(crit), crit),
            Cell(
                numbers.percent(ratio) if ratio is not None else numbers.MISSING,
                ratio,
                "good" if within else "bad",
                "\u2713" if within else "\u2717",
            ),
            Cell(numbers.time_limit(lever), numbers.finite(lever)),
            Cell(numbers.length(entry.get("sensor_error_m")),
                 numbers.finite(entry.get("sensor_error_m"))),
        ))  # fmt: skip
    heads = ("Role", "Sensor", "\u03c4 #", "\u03c4_crit #", "Used #", "\u03c4_crit, lever arm #",
             "Sensor error #")  # fmt: skip
    return table("Timestamp error of each sensor against the largest it may have", heads, rows)


def ledger(verdict: Json) -> Table:
    """Every term of the total error."""
    rows = [
        (
            term_text(entry),
            str(entry.get("stage") or ""),
            LEDGER_KINDS.get(str(entry.get("kind")), str(entry.get("kind"))),
            Cell(numbers.length(entry.get("value_m")), numbers.finite(entry.get("value_m"))),
            Cell(numbers.percent(entry.get("share")), numbers.finite(entry.get("share"))),
        )
        for entry in items(part(verdict, "syncline"), "ledger")
    ]
    return table("Terms of the total error", ("Term", "Stage", "Kind", "Value #", "Share #"), rows)


def models(verdict: Json) -> Table:
    """Both synchronisation models and the lever-arm variant, side by side."""
    syncline = part(verdict, "syncline")
    used = str(syncline.get("model") or "syncline")
    rows = []
    for key, entry in named(syncline, "models"):
        rows.append((
            SYNC_MODELS.get(str(key), str(key)) + (" \u2014 decides" if key == used else ""),
            Cell(numbers.length(entry.get("sync_error_m")), entry.get("sync_error_m")),
            Cell(numbers.length(entry.get("total_m")), entry.get("total_m")),
        ))  # fmt: skip
    lever = part(syncline, "lever_arm")
    if lever:
        total, sensor = numbers.finite(lever.get("total_m")), syncline.get("sensor_error_m")
        rate, tau = numbers.finite(lever.get("sync_rate_mps")), syncline.get("tau_s")
        error = rate * tau if rate is not None and tau is not None else None
        if error is None and total is not None and numbers.finite(sensor) is not None:
            error = total - float(sensor or 0.0)
        rows.append((
            "Syncline with the lever arm's rotation",
            Cell(numbers.length(error), error),
            Cell(numbers.length(total), total),
        ))  # fmt: skip
    heads = ("Model", "Synchronisation error #", "Total error #")
    return table("Total error by model", heads, rows)


def assumptions(verdict: Json) -> Table | None:
    """Figures without a public source that this verdict rests on, a row per catalog entry."""
    figures: dict[tuple[str, str], list[str]] = {}
    for entry in items(verdict, "assumptions"):
        key = (str(entry.get("entry")), str(entry.get("note") or ""))
        figures.setdefault(key, []).append(f"{entry.get('figure')} {entry.get('value')}")
    rows = [
        (Cell(name, code=True), "; ".join(values), note) for (name, note), values in figures.items()
    ]
    heads = ("Entry", "Assumed figures", "Note")
    return table("Assumptions: figures without a public source", heads, rows) if rows else None


def sources(verdict: Json) -> Table | None:
    """Where the catalog's figures come from."""
    rows = [
        (Cell(str(entry.get("entry")), code=True), str(entry.get("source")))
        for entry in items(verdict, "sources")
    ]
    return table("Sources of the catalog figures", ("Entry", "Source"), rows) if rows else None


def currency_of(verdict: Json) -> str:
    """The currency amounts are given in."""
    design, spec = part(verdict, "design"), part(verdict, "spec")
    return str(design.get("currency") or spec.get("currency") or "EUR")
