"""Tables of the choice: front, price staircase, runners-up, exclusions."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

from syncline_design.report import numbers
from syncline_design.report.table import Cell, Table, Tone, table
from syncline_design.report.verdict_tables import currency_of
from syncline_design.report.verdict_words import Json, items, named, plain
from syncline_design.report.words import PRIMITIVES

if TYPE_CHECKING:
    from syncline_design.verdict.tree import Verdict


def choice_tables(verdict: Verdict) -> list[Table]:
    """Every table of the choice that has rows."""
    found = (
        priced(verdict, "front", "Pareto front: cost against error"),
        staircase(verdict),
        priced(verdict, "next_best", "What else almost won"),
        excluded(verdict),
    )
    return [entry for entry in found if entry is not None]


def staircase(verdict: Verdict) -> Table | None:
    """What each accuracy costs: a row per step of the exact front."""
    currency = currency_of(verdict)
    rows = []
    for entry in items(verdict.choice, "staircase"):
        tight, loose = entry["tightest_m"], entry["looser_than_m"]
        below = f" to below {numbers.target(loose)}" if loose is not None else " and looser"
        rows.append((
            Cell(numbers.target(tight) + below, numbers.finite(tight)),
            Cell(numbers.money(entry.get("cost"), currency), numbers.finite(entry.get("cost"))),
            Cell(numbers.money(entry.get("extra"), currency), numbers.finite(entry.get("extra"))),
        ))  # fmt: skip
    heads = ("Accuracy targets", "Price #", "More than the step before #")
    return table("Price staircase of accuracy", heads, rows) if rows else None


def is_chosen(verdict: Verdict, entry: Json) -> bool:
    """Whether a point of the front is the chosen design: same price, same error."""
    cost = plain(verdict.design).get("cost")
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
