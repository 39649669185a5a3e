"""Tables of the choice: front, price staircase, runners-up, exclusions."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from syncline_design.report import numbers
from syncline_design.report.on_alternatives import alternatives_table, ways_cell
from syncline_design.report.table import Cell, Table, Tone, table
from syncline_design.report.verdict_tables import currency_of
from syncline_design.report.words import PRIMITIVES
from syncline_design.verdict.named import RankedDesign

if TYPE_CHECKING:
    from syncline_design.choice.outcome import PriceStep
    from syncline_design.verdict.named import Exclusion, FrontDesign, NamedDesign
    from syncline_design.verdict.tree import Verdict


def choice_tables(verdict: Verdict, limit: numbers.Limited | None) -> list[Table]:
    """Every table of the choice that has rows; limit: of accuracy, in whose unit errors are."""
    choice = verdict.choice
    if choice is None:
        return []
    found = (
        _priced(verdict, choice.front or (), "Pareto front: cost against error", limit),
        _staircase(choice.staircase or (), currency_of(verdict), limit),
        _priced(verdict, choice.next_best or (), "What else almost won", limit),
        alternatives_table(choice.alternatives or (), currency_of(verdict), limit),
        _excluded(choice.excluded or ()),
    )
    return [entry for entry in found if entry is not None]


def _money(amount: float | None, currency: str) -> Cell:
    return Cell(numbers.money(amount, currency), amount)


def _staircase(
    steps: Sequence[PriceStep], currency: str, limit: numbers.Limited | None
) -> Table | None:
    """What each accuracy costs: a row per step of the exact front."""
    rows = []
    for step in steps:
        loose = step.looser_than_m
        below = " and looser" if loose is None else f" to below {numbers.rounded_up(loose, limit)}"
        rows.append((
            Cell(numbers.rounded_up(step.tightest_m, limit) + below, step.tightest_m),
            _money(step.cost, currency),
            _money(step.extra, currency),
        ))  # fmt: skip
    heads = ("Accuracy limits", "Price #", "More than the step before #")
    return table("Price staircase of accuracy", heads, rows) if rows else None


def is_chosen(verdict: Verdict, entry: FrontDesign | RankedDesign) -> bool:
    """Whether a point of the front is the chosen design: same price, same error."""
    if verdict.design is None or verdict.syncline is None or verdict.design.cost is None:
        return False
    if entry.cost != verdict.design.cost:
        return False
    errors = [one.syncline.total_m for one in verdict.missions or () if one.syncline is not None]
    own = max(errors, default=verdict.syncline.total_m)  # of a family: its largest
    return math.isclose(entry.error_m, own, rel_tol=1e-6)


def _priced(
    verdict: Verdict,
    designs: Sequence[FrontDesign | RankedDesign],
    caption: str,
    limit: numbers.Limited | None,
) -> Table | None:
    """A list of designs with price and error: the front, the next best."""
    currency = currency_of(verdict)
    rows = []
    for entry in designs:
        shown: tuple[str, Tone] = ("\u25c6", "good") if is_chosen(verdict, entry) else ("", "")
        ways = [ways_cell(entry, currency, limit)] if isinstance(entry, RankedDesign) else []
        rows.append((
            _money(entry.cost, currency),
            Cell(numbers.error(entry.error_m, limit), entry.error_m),
            Cell(sensors(entry.design), tone=shown[1], mark=shown[0]), *ways,
        ))  # fmt: skip
    heads = ("Cost #", "Error #", "Design", "Ways of stamping it")[: len(rows[0]) if rows else 0]
    return table(caption, heads, rows) if rows else None


def sensors(design: NamedDesign) -> str:
    """A design as its sensors: `u-blox F9P (gpio), SBG Apogee (gpio)`."""
    return ", ".join(f"{entry.name} ({entry.timestamping})" for _, _, entry in design.roles)


def _excluded(options: Sequence[Exclusion]) -> Table | None:
    """Options ruled out before the choice, with the reason."""
    rows = [
        (
            f"{entry.stage} \u00b7 {entry.role}",
            Cell(str(entry.sensor), code=True),
            PRIMITIVES.get(str(entry.primitive), entry.primitive or numbers.MISSING),
            Cell(entry.method or numbers.MISSING, code=True),
            entry.reason,
        )
        for entry in options
    ]
    heads = ("Role", "Sensor", "Primitive", "Timestamping", "Reason")
    return table("Options ruled out", heads, rows) if rows else None
