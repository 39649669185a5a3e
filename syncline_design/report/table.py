"""Tables of a page: cells with their text, sort key and tone; one template draws them all."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Final, Literal

from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.report.columns import alike, worded
from syncline_design.report.text import unticked

Tone = Literal["", "good", "bad", "warn", "muted"]
CORNER: Final = " \\ "  # in a first heading: between what goes down and what goes across


@dataclass(frozen=True, slots=True)
class Cell:
    """One cell: what it says, what it sorts by (its text when None), its colour and symbol."""

    text: str
    sort: float | None = None
    tone: Tone = ""
    mark: str = ""
    code: bool = False
    sub: str = ""  # a second, quieter line
    written: bool = False  # as someone wrote it, so to be shown with just these digits


def cell_words(cell: Cell) -> str:
    """A cell in one line: its symbol, what it says, and the quieter words in brackets."""
    text = cell.text if cell.code else unticked(cell.text)
    sub = f" ({unticked(cell.sub)})" if cell.sub else ""
    return f"{cell.mark} {text}{sub}".strip()


@dataclass(frozen=True, slots=True)
class Head:
    """One column heading; figures are set flush right."""

    text: str
    numeric: bool = False


@dataclass(frozen=True, slots=True)
class Table:
    """A sortable table.

    named_by: the column that names a row, and heads it where rows stand as cards; in a row that is
    empty there, the first does.
    """

    caption: str
    heads: tuple[Head, ...]
    rows: tuple[tuple[Cell, ...], ...]
    note: str = ""
    named_by: int = 0


def table(
    caption: str,
    heads: Iterable[str],
    rows: Iterable[Iterable[Cell | str]],
    note: str = "",
    named_by: int = 0,
) -> Table:
    """A table; a heading that ends in ` #` is numeric, a plain string is a plain cell."""
    shown = tuple(Head(h.removesuffix(" #"), h.endswith(" #")) for h in heads)
    cells = [[c if isinstance(c, Cell) else Cell(c) for c in row] for row in rows]
    columns = [
        _alike(column) if head.numeric else column
        for head, column in zip(shown, zip(*cells, strict=True), strict=bool(cells))
    ]
    return Table(caption, shown, tuple(zip(*columns, strict=True)), note, named_by)


def turned(one: Table, corner: str) -> Table:
    """The same with rows for columns, less those that say nothing; corner: what heads the first."""
    heads = (Head(corner), *(Head(cell_words(row[0]), True) for row in one.rows))
    rows = tuple(
        (Cell(head.text), *column)
        for head, column in zip(one.heads[1:], list(zip(*one.rows, strict=True))[1:], strict=True)
        if any(cell.text for cell in column)
    )
    return Table(one.caption, heads, rows, one.note)


def _alike(column: Sequence[Cell]) -> Sequence[Cell]:
    """A column of figures, all to the same place or to the same number of digits."""
    texts = worded(alike([(cell.text, None if cell.written else cell.sort) for cell in column]))
    return [
        cell if cell.written or cell.text == text else replace(cell, text=text)
        for cell, text in zip(column, texts, strict=True)
    ]
