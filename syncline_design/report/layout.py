"""How the nodes of a page stand beside one another: figures two in a row, or beside their table.

Done once for every page, so that no subject has to lay itself out.  On a narrow page all of it
stands one below the other.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import groupby
from typing import Final

from syncline_design.report.document import Chart, Group, Items, Node, TableNode, charts

BESIDE: Final = 4  # columns of a table that fits into half a page
ROWS: Final = 14  # of a table that is not much longer than a figure is high
LINE: Final = 40  # characters of a cell beside a figure
HEADED: Final = 3  # rows that caption and heads of a further table take


def laid_out(nodes: Sequence[Node]) -> tuple[Node, ...]:
    """The same nodes: figures in a grid, a single one beside its table or its values."""
    return tuple(_beside(list(_grids(_inner(nodes)))))


def _inner(nodes: Iterable[Node]) -> Iterator[Node]:
    for node in nodes:
        if isinstance(node, Group) and node.form in ("article", "column", "fold"):
            yield replace(node, nodes=laid_out(node.nodes))
        elif isinstance(node, Group) and node.form == "pair":
            yield from node.nodes if len(list(charts([node]))) == len(node.nodes) else (node,)
        else:
            yield node


def _grids(nodes: Iterable[Node]) -> Iterator[Node]:
    """Charts that follow one another as one group, in two columns of their own lengths."""
    for is_chart, run in groupby(nodes, lambda node: isinstance(node, Chart)):
        together = tuple(run)
        if is_chart and len(together) > 1:
            yield Group(together, "flow", reach="page")
        else:
            yield from together


def _beside(nodes: Sequence[Node]) -> Iterator[Node]:
    """A single chart with the small tables, or the list, that follow it."""
    place = 0
    while place < len(nodes):
        node, after = nodes[place], nodes[place + 1 : place + 2]
        if isinstance(node, Chart) and after and _small(after[0]):
            column = _column(after[0], nodes[place + 2 :])
            right = Group(column, "column", reach="page") if len(column) > 1 else after[0]
            yield Group((node, right), "pair", reach="page")
            place += 1 + len(column)
        elif isinstance(node, Chart):
            yield Group((node,), "alone", reach="page")
            place += 1
        else:
            yield node
            place += 1


def _column(first: Node, after: Sequence[Node]) -> tuple[Node, ...]:
    """What stands beside a figure: small tables below one another, as long as it is high."""
    column, rows = [first], _rows(first)
    for node in after:
        rows += HEADED + _rows(node)
        if not (isinstance(first, TableNode) and isinstance(node, TableNode) and _small(node)):
            break
        if rows > ROWS:
            break
        column.append(node)
    return tuple(column)


def _rows(node: Node) -> int:
    """Lines of a table, where a cell of sentences has several."""
    if not isinstance(node, TableNode):
        return 0
    return sum(max(1, *(-(-len(cell.text) // LINE) for cell in row)) for row in node.table.rows)


def _small(node: Node) -> bool:
    if not isinstance(node, TableNode):
        return isinstance(node, Items)
    return len(node.table.heads) <= BESIDE and len(node.table.rows) <= ROWS
