"""What if a sensor cannot be had, what a little more money buys, what stamping alone changes."""

from __future__ import annotations

from collections.abc import Sequence

from syncline_design.report import numbers
from syncline_design.report.document import Items, Node
from syncline_design.report.numbers import MISSING
from syncline_design.report.table import Cell, Table, table
from syncline_design.verdict.named import Alternative, Bargain, RankedDesign, StampingRange


def alternatives_table(
    rows: Sequence[Alternative], currency: str, limit: numbers.Limited | None
) -> Table | None:
    """A row for each sensor of the design: the best one without it; limit: of accuracy."""
    if not rows:
        return None
    heads = ("Without", "Cost #", "More #", "Error #", "More error #", "Instead")
    return table("If a sensor cannot be had", heads, [_row(one, currency, limit) for one in rows])


def _row(
    one: Alternative, currency: str, limit: numbers.Limited | None
) -> tuple[Cell | str, ...]:  # fmt: skip
    name = Cell(f"{one.sensor} ({', '.join(one.places)})")
    if one.verdict == "infeasible":
        return (
            name,
            MISSING,
            MISSING,
            MISSING,
            MISSING,
            "no design meets the requirements",
        )
    left_open = " (left open by the simulation)" if one.verdict == "indeterminate" else ""
    return (
        name, _money(one.cost, currency), _money(one.dearer_by, currency),
        Cell(numbers.error(one.error_m, limit), one.error_m),
        Cell(numbers.error(one.worse_by, limit), one.worse_by),
        "; ".join(one.instead) + left_open,
    )  # fmt: skip


def _money(amount: float | None, currency: str) -> Cell:
    return Cell("unknown") if amount is None else Cell(numbers.money(amount, currency), amount)


def bargain_nodes(
    found: Sequence[Bargain], currency: str, limit: numbers.Limited | None
) -> list[Node]:
    """`15 EUR more takes the error from 0.398 m to 0.319 m: ...`, a line each."""
    lines = tuple(_bargain(one, currency, limit) for one in found)
    return [Items(lines)] if lines else []


def _bargain(one: Bargain, currency: str, limit: numbers.Limited | None) -> str:
    money = numbers.money(abs(one.extra), currency)
    old, new = (numbers.error(value, limit) for value in (one.error_from_m, one.error_to_m))
    sensors = (f"{role.name} ({role.timestamping})" for _, _, role in one.design.roles)
    clocks = (f"clock of {clock.vehicle}: {clock.name}" for clock in one.design.clocks)
    payload = ", ".join([*sensors, *clocks])
    if one.kind == "better":
        return f"{money} more takes the error from {old} to {new}: {payload}"
    return f"{money} less if the error may be {new} instead of {old}: {payload}"


def ways_cell(one: RankedDesign, currency: str, limit: numbers.Limited | None) -> Cell:
    """In how many ways these sensors can be stamped, and what range of figures that is."""
    if one.stampings is None:
        return Cell("")
    return Cell(_ways(one.stampings, currency, limit), float(one.stampings.designs))


def _ways(found: StampingRange, currency: str, limit: numbers.Limited | None) -> str:
    count = str(found.designs) if found.simulated else f"{found.designs} by the sums"
    if found.designs == 1:
        return count
    shown = [_span(*(numbers.error(value, limit) for value in found.error_m))]
    if found.cost is not None:
        shown.insert(0, _span(*(numbers.money(value, currency) for value in found.cost)))
    return f"{count}: {', '.join(shown)}"


def _span(low: str, high: str) -> str:
    return low if low == high else f"{low} to {high}"
