"""Tables of the choice: front, price staircase, runners-up, slack, what to measure, exclusions."""

from __future__ import annotations

import math
from collections.abc import Mapping

from syncline_design.report import numbers
from syncline_design.report.table import Cell, Table, Tone, table
from syncline_design.report.text import sentence_list
from syncline_design.report.verdict_tables import currency_of
from syncline_design.report.verdict_words import Json, items, named, part
from syncline_design.report.words import KINDS, PRIMITIVES
from syncline_design.verdict.tree import Verdict


def choice_tables(verdict: Verdict) -> list[Table]:
    """Every table of the choice that has rows."""
    found = (
        priced(verdict, "front", "Pareto front: cost against error"),
        staircase(verdict),
        priced(verdict, "next_best", "What else almost won"),
        slack(verdict),
        measure_next(verdict),
        excluded(verdict),
    )
    return [entry for entry in found if entry is not None]


def staircase(verdict: Verdict) -> Table | None:
    """What each accuracy costs: a row per step of the exact front."""
    currency = currency_of(verdict)
    rows = []
    for entry in items(verdict.choice, "staircase"):
        tight, loose = entry.get("tightest_m"), entry.get("looser_than_m")
        below = f" to below {numbers.length(loose)}" if loose is not None else " and looser"
        rows.append((
            Cell(numbers.length(tight) + below, numbers.finite(tight)),
            Cell(numbers.money(entry.get("cost"), currency), numbers.finite(entry.get("cost"))),
            Cell(numbers.money(entry.get("extra"), currency), numbers.finite(entry.get("extra"))),
        ))  # fmt: skip
    heads = ("Accuracy targets", "Price #", "More than the step before #")
    return table("Price staircase of accuracy", heads, rows) if rows else None


def slack(verdict: Verdict) -> Table | None:
    """How far each term may grow before the verdict or the payload changes."""
    rows = []
    for entry in items(verdict.choice, "slack"):
        unit = str(entry.get("unit") or "")
        breaks = KINDS.get(str(entry.get("limited_by")), "")
        rows.append((
            f"{entry.get('stage')} \u00b7 {entry.get('term')}",
            Cell(numbers.si_quantity(entry.get("value"), unit), numbers.finite(entry.get("value"))),
            _threshold(entry, "fails_at", "verdict", unit),
            breaks,
            _threshold(entry, "payload_changes_at", "payload", unit),
        ))  # fmt: skip
    heads = ("Term", "Now #", "Verdict fails at #", "What then breaks", "Payload changes at #")
    return table("Slack: how far each term may grow", heads, rows) if rows else None


def _threshold(entry: Json, key: str, what: str, unit: str) -> Cell:
    """A threshold; without one `never` where that is proven, else how far was looked."""
    known = numbers.finite(entry.get(key))
    if known is not None:
        return Cell(numbers.si_quantity(known, unit), known)
    if what in (entry.get("never") or ()):
        return Cell("never", None)
    searched = numbers.finite(entry.get("searched_to"))
    if searched is None:
        return Cell("not known", None)
    return Cell(f"not up to {numbers.si_quantity(searched, unit)}", None)


def measure_next(verdict: Verdict) -> Table | None:
    """Datasheet figures that alone would flip the choice."""
    rows = [
        (
            str(entry.get("figure")),
            Cell(_written(entry, "value"), numbers.finite(entry.get("value"))),
            Cell(_written(entry, "at"), numbers.finite(entry.get("at"))),
            "20 % tried, the datasheet gives none" if entry.get("assumed_tolerance")
            else "datasheet tolerance",
            str(entry.get("becomes") or ""),
        )
        for entry in items(verdict.choice, "measure_next")
    ]  # fmt: skip
    heads = ("Figure", "Now #", "Flips at #", "Range", "The choice becomes")
    return table("What to measure next", heads, rows) if rows else None


def _written(entry: Json, key: str) -> str:
    """A datasheet figure in the unit in which it was written."""
    text = entry.get(f"{key}_text")
    return str(text) if text else numbers.number(entry.get(key))


def tolerance_sentence(verdict: Verdict) -> str:
    """Whether the design passes always, sometimes or never within the datasheet tolerances."""
    found = part(verdict.choice, "tolerances")
    if not found or not found.get("figures"):
        return ""
    text = f"Within the datasheet tolerances the design {found.get('passes')} passes"
    deciding = [str(name) for name in found.get("deciding") or ()]
    if not deciding:
        return text + "."
    verb = "decides it" if found.get("alone") else "decide it together"
    return f"{text}; {sentence_list(deciding)} {verb}."


def is_chosen(verdict: Verdict, entry: Json) -> bool:
    """Whether a point of the front is the chosen design: same price, same error."""
    cost = (verdict.design or {}).get("cost")
    error = numbers.finite(entry.get("error_m"))
    if cost is None or verdict.syncline is None or error is None or entry.get("cost") != cost:
        return False
    return math.isclose(error, verdict.syncline.total_m, rel_tol=1e-6)


def priced(verdict: Verdict, key: str, caption: str) -> Table | None:
    """A list of designs with price and error: the front, the next best."""
    currency = currency_of(verdict)
    rows = []
    for entry in items(verdict.choice, key):
        error = entry.get("error_m")
        shown: tuple[str, Tone] = ("\u25c6", "good") if is_chosen(verdict, entry) else ("", "")
        rows.append((
            Cell(numbers.money(entry.get("cost"), currency), numbers.finite(entry.get("cost"))),
            Cell(numbers.length(error), numbers.finite(error)),
            Cell(design_text(entry.get("design")), tone=shown[1], mark=shown[0]),
        ))  # fmt: skip
    return table(caption, ("Cost #", "Error #", "Design"), rows) if rows else None


def design_text(design: object) -> str:
    """A design as words: text as it is; a design record as its sensors."""
    if not isinstance(design, Mapping):
        return str(design or "")
    names = []
    for stage in items(design, "stages"):
        for _, entry in named(stage, "roles"):
            method = entry.get("timestamping")
            sensor = str(entry.get("name") or entry.get("sensor"))
            names.append(f"{sensor} ({method})" if method else sensor)
    return ", ".join(names)


def excluded(verdict: Verdict) -> Table | None:
    """Options ruled out before the choice, with the reason."""
    rows = [
        (
            f"{entry.get('stage')} \u00b7 {entry.get('role')}",
            Cell(str(entry.get("sensor")), code=True),
            PRIMITIVES.get(str(entry.get("primitive")), str(entry.get("primitive") or "\u2013")),
            Cell(str(entry.get("method") or "\u2013"), code=True),
            str(entry.get("reason")),
        )
        for entry in items(verdict.choice, "excluded")
    ]
    heads = ("Role", "Sensor", "Primitive", "Timestamping", "Reason")
    return table("Options ruled out", heads, rows) if rows else None
