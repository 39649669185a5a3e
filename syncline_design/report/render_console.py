"""A document as plain text for a terminal: the answer first, in colour where there is any."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from textwrap import wrap
from typing import Final

from syncline_design.report.document import (
    Document,
    Facts,
    Group,
    Heading,
    Inline,
    Items,
    Node,
    TableNode,
    Text,
    for_output,
    plain,
)
from syncline_design.report.table import Head, Table, Tone, cell_words
from syncline_design.report.text import visible

WIDTH: Final = 110  # columns of a paragraph, and of a table as far as its last one can be wrapped
_LEAST: Final = 30  # columns of a wrapped cell
_CODES: Final = {"good": "32", "bad": "31", "warn": "33"}

Paint = Callable[[str, str], str]


def console(document: Document, *, colour: bool | None = None) -> str:
    """The text of a document as far as it reaches beyond the page; ends with a newline."""
    paint = _painter(colour)
    shown = for_output(document, "text")
    blocks = [_answer(shown, paint)]
    blocks += [[_shown(s.title), *_lines(s.nodes, "  ", paint)] for s in shown.sections]
    return "\n\n".join("\n".join(block) for block in blocks) + "\n"


def supports_colour() -> bool:
    """Colour only on a terminal, and never against NO_COLOR."""
    return sys.stdout.isatty() and "NO_COLOR" not in os.environ


def _painter(colour: bool | None) -> Paint:
    on = supports_colour() if colour is None else colour
    return lambda text, tone: (
        f"\033[{_CODES[tone]}m{text}\033[0m" if on and tone in _CODES else text
    )


def _shown(words: Inline) -> str:
    """One line: harmless, and with the spaces that terminals know."""
    return visible(plain(words)).replace("\u00a0", " ")


def _answer(document: Document, paint: Paint) -> list[str]:
    outcome = document.outcome
    source = f" ({_shown(document.source)})" if document.source else ""
    said = paint(f"{outcome.mark} {_shown(outcome.word)}", outcome.tone)
    lines = [f"{_shown(document.name)}{source}: {said}"]
    for words in document.sentences:
        lines += _wrapped(_shown(words), "  ")
    return [*lines, *_pairs(document.facts, "  ")]


def _wrapped(text: str, indent: str, first: str | None = None) -> list[str]:
    start = indent if first is None else first
    return wrap(
        text, WIDTH, initial_indent=start, subsequent_indent=indent,
        break_long_words=False, break_on_hyphens=False,
    )  # fmt: skip


def _lines(nodes: Iterable[Node], indent: str, paint: Paint) -> Iterator[str]:
    for node in nodes:
        match node:
            case Heading():
                aside = f" ({_shown(node.aside)})" if plain(node.aside) else ""
                yield f"{indent}{_shown(node.words)}{aside}"
            case Text():
                mark = f"{paint(node.mark, node.tone)} " if node.mark else ""
                yield from _wrapped(_shown(node.words), indent, indent + mark)
            case Facts(look="terms"):
                for label, value in node.pairs:
                    yield from _wrapped(_shown(label), indent)
                    yield from _wrapped(_shown(value), f"{indent}  ")
            case Facts():
                yield from _pairs(node.pairs, indent)
            case Items():
                mark = paint(node.mark, node.tone) if node.mark else "-"
                yield from (f"{indent}{mark} {_shown(entry)}" for entry in node.entries)
            case TableNode():
                yield from table_lines(node.table, indent, paint, silent=node.silent)
            case Group():
                yield from _lines(node.nodes, indent, paint)
            case _:
                raise TypeError(f"a {node.kind} is for pages only")


def _pairs(pairs: Sequence[tuple[str, Inline]], indent: str) -> Iterator[str]:
    """Label and value, the values lined up."""
    width = max((len(_shown(label)) for label, _ in pairs), default=0) + 2
    for label, value in pairs:
        head = f"{indent}{_shown(label).ljust(width)}"
        yield from _wrapped(_shown(value) or "-", " " * len(head), head)


def table_lines(
    shown: Table, indent: str = "", paint: Paint | None = None, *, silent: bool = False
) -> Iterator[str]:
    """A table with its columns lined up; a long last column goes on below itself."""
    if not silent:
        yield f"{indent}{_shown(shown.caption)}"
        indent += "  "
    rows: list[tuple[list[str], list[Tone]]] = [
        ([_shown(head.text) for head in shown.heads], [""] * len(shown.heads)),
        *(([_shown(cell_words(c)) for c in row], [c.tone for c in row]) for row in shown.rows),
    ]
    widths = [max(map(len, column)) for column in zip(*(texts for texts, _ in rows), strict=True)]
    left = len(indent) + sum(width + 2 for width in widths[:-1])
    for texts, tones in rows:
        last = shown.heads[-1].numeric
        ends = [texts[-1]] if last else wrap(texts[-1], max(WIDTH - left, _LEAST)) or [""]
        cells = [*texts[:-1], ends[0]]
        padded = [
            _padded(*cell, paint) for cell in zip(cells, widths, tones, shown.heads, strict=True)
        ]
        yield (indent + "  ".join(padded)).rstrip()
        yield from (" " * left + more for more in ends[1:])
    if shown.note:
        yield from _wrapped(_shown(shown.note), indent)


def _padded(text: str, width: int, tone: Tone, head: Head, paint: Paint | None) -> str:
    aligned = text.rjust(width) if head.numeric else text.ljust(width)
    return paint(aligned, tone) if paint else aligned


def aligned(rows: Sequence[Sequence[str]], indent: int = 2) -> list[str]:
    """Rows without heads as columns."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = ("  ".join(c.ljust(w) for c, w in zip(row, widths, strict=True)) for row in rows)
    return [" " * indent + line.rstrip() for line in lines]
