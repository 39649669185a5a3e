"""A table as lines that fit a width: columns give way at words, then rows become records."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import zip_longest
from textwrap import wrap
from typing import Final

from syncline_design.report.table import CORNER, Cell, Table, Tone, cell_words
from syncline_design.report.text import unbroken, visible

GAP: Final = "  "
_LONGEST_WORD: Final = 28  # a longer one does not hold its column open
_JOINTS: Final = "_-./:\\"
_MEASURED: Final = 60  # rows whose height decides

Paint = Callable[[str, str], str]


def one_line(text: str) -> str:
    """Harmless text with the spaces that terminals know."""
    return visible(text).replace("\u00a0", " ")


def folded(text: str, width: int, first: str = "", indent: str = "") -> list[str]:
    """Text in lines of a width; figures stay with their units."""
    lines = wrap(
        unbroken(visible(text)), width, initial_indent=first, subsequent_indent=indent,
        break_long_words=False, break_on_hyphens=False,
    )  # fmt: skip
    return [line.replace("\u00a0", " ") for line in lines] or [""]


def fitted(table: Table, room: int, paint: Paint | None = None) -> Iterator[str]:
    """The lines of a table without its caption, none longer than `room` where words allow it."""
    heads = [head.text for head in table.heads]
    rows = [[_marked(cell) for cell in row] for row in table.rows]
    widths = _widths(heads, rows, room)
    if widths is None:
        yield from _records(heads, rows, room)
        return
    right = [head.numeric for head in table.heads]
    yield from _row(heads, [""] * len(heads), widths, right, paint)
    for cells, row in zip(rows, table.rows, strict=True):
        yield from _row(cells, [cell.tone for cell in row], widths, right, paint)


def _marked(cell: Cell) -> str:
    """A cell's words; its symbol stays with the first of them."""
    words = unbroken(cell_words(cell))
    return words.replace(" ", "\u00a0", 1) if cell.mark else words


def _widths(heads: Sequence[str], rows: Sequence[Sequence[str]], room: int) -> list[int] | None:
    """The columns' widths: as wide as they like, else those give way that cost the fewest lines.

    None where no words leave room for all of them, and where records take fewer lines.
    """
    columns = [[row[k] for row in rows] for k in range(len(heads))]
    full = [max(map(len, (head, *cells))) for head, cells in zip(heads, columns, strict=True)]
    least = [_longest([head, *cells]) for head, cells in zip(heads, columns, strict=True)]
    spare = room - len(GAP) * (len(heads) - 1)
    if sum(map(min, full, least)) > spare:
        return None
    sizes = [[len(text) for text in row] for row in (heads, *rows[:_MEASURED])]
    while sum(full) > spare:
        open_ones = [k for k in range(len(full)) if full[k] > least[k]]
        full[min(open_ones, key=lambda k: (_height(sizes, full, k), -full[k]))] -= 1
    return None if _height(sizes, full) > _height_of_records(sizes, room) else full


def _height(sizes: Sequence[Sequence[int]], widths: Sequence[int], narrower: int = -1) -> int:
    """About how many lines a table takes, with one column narrower by one."""
    tried = [width - (k == narrower) for k, width in enumerate(widths)]
    return sum(
        max(-(-size // width) for size, width in zip(row, tried, strict=True)) for row in sizes
    )


def _height_of_records(sizes: Sequence[Sequence[int]], room: int) -> int:
    """About how many lines the same takes with a line for each cell."""
    heads, *rows = sizes
    return sum(
        -(-(size + (2 + head if k else 0)) // room)
        for row in rows
        for k, (head, size) in enumerate(zip(heads, row, strict=True))
        if size
    )


def _longest(texts: Sequence[str]) -> int:
    """The longest word, which a column cannot break; a figure with its unit is one."""
    words = (len(word) for text in texts for word in text.split(" "))
    return min(max(words, default=0), _LONGEST_WORD)


def _row(
    cells: Sequence[str],
    tones: Sequence[Tone],
    widths: Sequence[int],
    right: Sequence[bool],
    paint: Paint | None,
) -> Iterator[str]:
    """A row in as many lines as its longest cell takes."""
    lines = [
        [part for line in folded(text, width) for part in _parts(line, width)]
        for text, width in zip(cells, widths, strict=True)
    ]
    for parts in zip_longest(*lines, fillvalue=""):
        padded = [
            text.rjust(width) if flush else text.ljust(width)
            for text, width, flush in zip(parts, widths, right, strict=True)
        ]
        if paint is not None:
            padded = [paint(text, tone) for text, tone in zip(padded, tones, strict=True)]
        yield GAP.join(padded).rstrip()


def _parts(word: str, width: int) -> Iterator[str]:
    """A word that is longer than its column in parts, cut where it is joined if that can be."""
    while len(word) > width:
        joint = max(word.rfind(mark, 0, width) for mark in _JOINTS)
        cut = joint + 1 if joint >= width // 2 else width
        yield word[:cut]
        word = word[cut:]
    yield word


def _records(heads: Sequence[str], rows: Sequence[Sequence[str]], room: int) -> Iterator[str]:
    """Each row as a record: its name, then a line for every other cell that says something.

    A bare number is no name without its head.
    A corner that names both sides of a table is kept: nothing else says what its figures are.
    """
    if CORNER in heads[0]:
        yield from folded(heads[0], room, indent=GAP)
    for row in rows:
        name = f"{heads[0]} {row[0]}" if row[0].isdecimal() else row[0]
        yield from folded(name or "-", room, indent=GAP)
        for head, text in zip(heads[1:], row[1:], strict=True):
            if text:
                yield from folded(f"{head}: {text}", room, GAP, GAP * 2)
