"""What a design hinges on as nodes: tolerances, slack of every figure, what to measure next."""

from __future__ import annotations

from collections.abc import Sequence

from syncline_design.choice.slack import Slack
from syncline_design.report import numbers
from syncline_design.report.document import (
    Node,
    Text,
    show,
)
from syncline_design.report.table import Cell, Table, table
from syncline_design.report.words import KINDS
from syncline_design.verdict.optimization import Optimization


def hinges_nodes(hinges: Optimization, limit: numbers.Limited | None) -> list[Node]:
    """Slack of every figure, tolerances, what to measure next; limit: of accuracy."""
    nodes = [] if hinges.slack is None else show(slack_table(hinges.slack, limit))
    if hinges.tolerances is not None:
        nodes.append(Text(hinges.tolerances.text))
    if hinges.measure_next is None:
        return nodes
    if not hinges.measure_next:
        words = "No single datasheet figure, 20 % up or down, changes the choice."
        return [*nodes, Text(words)]
    rows = [
        (one.figure, one.value_text, one.nearest_text, one.nearest_becomes,
         f"{one.at_text}, {'20 % assumed' if one.assumed_tolerance else 'datasheet tolerance'}",
         "the same" if one.becomes == one.nearest_becomes else one.becomes)
        for one in hinges.measure_next
    ]  # fmt: skip
    heads = ("Figure", "Now", "Changes from", "The choice becomes", "End of its range", "There")
    caption = "What to measure next: a single figure that changes the choice"
    return [*nodes, *show(table(caption, heads, rows))]


def slack_table(rows: Sequence[Slack], limit: numbers.Limited | None = None) -> Table:
    """The slack ledger, a row per term; errors in the unit of the limit of accuracy."""
    return table(
        "How far each term may grow",
        ("Term", "Now #", "Verdict fails at #", "What then breaks", "Payload changes at #"),
        [
            (
                f"{row.stage} {row.term}" + (f", {row.mission}" if row.mission else ""),
                Cell(_figure(row.value, row, limit), row.value),
                _threshold(row, row.fails_at, "verdict", limit),
                KINDS.get(row.limited_by or "", row.limited_by or ""),
                _threshold(row, row.payload_changes_at, "payload", limit),
            )
            for row in rows
        ],
    )


def _figure(value: float, row: Slack, limit: numbers.Limited | None) -> str:
    """Errors in the unit of the limit; a distance, which is a length too, by its own."""
    if row.unit == "m" and row.term.endswith("error"):
        return numbers.error(value, limit)
    return numbers.si_quantity(value, row.unit)


def _threshold(row: Slack, value: float | None, what: str, limit: numbers.Limited | None) -> Cell:
    """A threshold; without one `never` where that is proven, else how far was looked."""
    if value is not None:
        return Cell(_figure(value, row, limit), value)
    if what in row.never:
        return Cell("never")
    if row.searched_to is None:
        return Cell("not known")
    return Cell(f"not up to {_figure(row.searched_to, row, limit)}")
