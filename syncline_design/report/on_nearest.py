"""The design nearest to a spec that none meets: in a sentence, and on the front of all that are."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from syncline_design.report import numbers
from syncline_design.report.choice_tables import sensors
from syncline_design.report.document import Chart, Heading, Node, Text, show
from syncline_design.report.table import Cell, Table, table
from syncline_design.report.words import KINDS
from syncline_design.verdict.named import MissedLimit, Nearest, PricedError
from syncline_design.verdict.tree import UNITS

if TYPE_CHECKING:
    from syncline_design.report.svg import InlineChart
    from syncline_design.spec.case import Case


class AskedLimit(NamedTuple):
    """A limit of a spec, as a verdict would hold it."""

    limit: float
    unit: str
    limit_written: str | None


def asked_limit(case: Case, kind: str) -> AskedLimit | None:
    """The tightest limit of a kind that a spec asks for."""
    asked = (one for one in case.spec.requirements if one.kind == kind)
    unit = UNITS.get(kind, case.spec.currency)
    limits = (AskedLimit(float(case.limit(one)), unit, one.limit_written) for one in asked)
    return min(limits, key=lambda one: one.limit, default=None)


def nearest_nodes(
    found: Nearest | None,
    currency: str,
    limit: numbers.Limited | None = None,
    price: float | None = None,
) -> list[Node]:
    """What it is, what it misses and by how much; drawn with the limits of accuracy and cost."""
    if found is None:
        return []
    who = ", ".join(
        f"{stage.name} {role}: {one.name} by {one.primitive}, {one.timestamping_name}"
        for stage, role, one in found.design.roles
    )
    cost = "a price that is not told" if found.cost is None else numbers.money(found.cost, currency)
    error = numbers.error(found.error_m, limit)
    text = f"{who}. It costs {cost}, its Syncline error is {error}; it misses {_all(found)}."
    return [
        Heading("The nearest design"), Text(text), *_chart(found, currency, limit, price),
        *show(ends_table(found, currency, limit)),
    ]  # fmt: skip


def ends_table(found: Nearest, currency: str, limit: numbers.Limited | None) -> Table | None:
    """The ends of the front that the chart draws: what they are and how far they miss.

    Of a front of one design there are no two ends; that design is a row.
    """
    ends = (("cheapest", found.front[:1]), ("most exact", found.front[-1:]))
    named = ends if len(found.front) > 1 else (("cheapest and most exact", found.front[:1]),)
    rows = [
        [
            Cell(end), Cell(numbers.money(one.cost, currency), one.cost),
            Cell(numbers.error(one.error_m, limit), one.error_m), Cell(_all(one) or "nothing"),
            *(Cell(f"{role.name} by {role.primitive}, {role.timestamping_name}")
              for _, _, role in one.design.roles),
        ]
        for end, points in named for one in points if one.design is not None
    ]  # fmt: skip
    roles = [f"{stage.name} {role}" for stage, role, _ in found.design.roles]
    heads = ("Design", "Cost #", "Error #", "Misses", *roles)
    title = "Cheapest and most exact, all but cost and accuracy met"
    return table(title, heads, rows) if rows else None


def _all(found: Nearest | PricedError) -> str:
    return " and ".join(_missed(one) for one in found.misses or ())


def _missed(one: MissedLimit) -> str:
    name = one.requirement or f"the implied limit of {KINDS.get(one.kind, one.kind)}"
    return f"{name}: {numbers.held(one.value, one)} where {numbers.limit(one)} is asked"


def _chart(
    found: Nearest, currency: str, limit: numbers.Limited | None, price: float | None
) -> list[Node]:
    points = [point for point in found.front if point.error_m]
    if found.cost is None or not points:
        return []
    at = (found.cost, found.error_m)

    def draw() -> InlineChart:
        from syncline_design.report.charts_front import FrontMark, pareto_front

        drawn = [
            FrontMark(
                point.cost, point.error_m, False,
                "" if point.design is None else sensors(point.design),
            )
            for point in points
        ]  # fmt: skip
        return pareto_front(drawn, currency, limit, price, beside=at)

    caption = (
        "Every design on the line is the cheapest with that error of those that keep every other "
        "sum."
    )
    return [Chart("nearest", draw, caption)]
