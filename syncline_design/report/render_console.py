"""A document as plain text for a terminal: the answer first, in colour where there is any."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Iterator, Sequence
from shutil import get_terminal_size
from typing import Final

from syncline_design.report.console_table import Paint, fitted, folded, one_line
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
from syncline_design.report.table import Table
from syncline_design.report.text import unticked

WIDTH: Final = 110  # columns of a paragraph at most: longer lines are hard to read
NO_TERMINAL: Final = (80, 24)
_LEAST: Final = 40  # columns of a terminal that is narrower still
_CODES: Final = {"good": "32", "bad": "31", "warn": "33"}


def console(document: Document, *, colour: bool | None = None) -> str:
    """The text of a document as far as it reaches beyond the page; ends with a newline."""
    paint = _painter(colour)
    shown = for_output(document, "text")
    blocks = [_answer(shown, paint)]
    blocks += [
        [*_wrapped(s.title, "  ", ""), *_lines(s.nodes, "  ", paint)] for s in shown.sections
    ]
    return "\n\n".join("\n".join(block) for block in blocks) + "\n"


def columns() -> int:
    """Of the terminal, or of COLUMNS; 80 where there is none."""
    return max(get_terminal_size(NO_TERMINAL).columns, _LEAST)


def supports_colour() -> bool:
    """Colour on a terminal that has it, or where FORCE_COLOR asks for it; never against NO_COLOR.

    A variable that is empty says nothing (no-color.org, force-color.org).
    """
    if os.environ.get("NO_COLOR"):
        return False
    if os.environ.get("FORCE_COLOR"):
        return True
    return sys.stdout.isatty() and os.environ.get("TERM") != "dumb"


def _painter(colour: bool | None) -> Paint:
    on = supports_colour() if colour is None else colour
    return lambda text, tone: (
        f"\033[{_CODES[tone]}m{text}\033[0m" if on and tone in _CODES else text
    )


def _shown(words: Inline) -> str:
    return one_line(plain(words))


def _answer(document: Document, paint: Paint) -> list[str]:
    outcome = document.outcome
    source = f" ({_shown(document.source)})" if document.source else ""
    subject = f"{_shown(document.name)}{source}:"
    first, *more = folded(f"{subject} {outcome.mark} {plain(outcome.word)}", columns(), "", "    ")
    head = subject if first.startswith(subject) else first
    lines = [head + paint(first[len(head) :], outcome.tone)]
    lines += [paint(line, outcome.tone) for line in more]
    for words in document.sentences:
        lines += _wrapped(plain(words), "  ")
    return [*lines, *_pairs(document.facts, "  ")]


def _wrapped(text: str, indent: str, first: str | None = None) -> list[str]:
    return folded(text, min(columns(), WIDTH), indent if first is None else first, indent)


def paragraph(text: str) -> str:
    """A text by itself, no wider than the terminal; ends with a newline."""
    return "\n".join(_wrapped(text, "")) + "\n"


def hanging(text: str, indent: int = 0, deeper: int = 2) -> list[str]:
    """A text in lines that fit the terminal, all but the first of them deeper in."""
    return _wrapped(text, " " * (indent + deeper), " " * indent)


def _lines(nodes: Iterable[Node], indent: str, paint: Paint) -> Iterator[str]:
    for node in nodes:
        match node:
            case Heading():
                aside = f" ({plain(node.aside)})" if plain(node.aside) else ""
                yield from _wrapped(f"{plain(node.words)}{aside}", f"{indent}  ", indent)
            case Text():
                mark = f"{paint(node.mark, node.tone)} " if node.mark else ""
                yield from _wrapped(plain(node.words), indent, indent + mark)
            case Facts():
                yield from (_terms if node.form == "terms" else _pairs)(node.pairs, indent)
            case Items():
                yield from _items(node, indent, paint)
            case TableNode():
                yield from table_lines(node.table, indent, paint, silent=node.silent)
            case Group():
                yield from _lines(node.nodes, indent, paint)
            case _:
                raise TypeError(f"a {node.kind} is for pages only")


def _items(node: Items, indent: str, paint: Paint) -> Iterator[str]:
    mark = paint(node.mark, node.tone) if node.mark else "-"
    for entry in node.entries:
        yield from _wrapped(plain(entry), f"{indent}  ", f"{indent}{mark} ")


def _terms(pairs: Sequence[tuple[str, Inline]], indent: str) -> Iterator[str]:
    """Label, and its sentences below it."""
    for label, value in pairs:
        yield from _wrapped(plain(label), indent)
        yield from _wrapped(plain(value), f"{indent}  ")


def _pairs(pairs: Sequence[tuple[str, Inline]], indent: str) -> Iterator[str]:
    """Label and value, the values lined up; below its label what is too long beside it."""
    width = max((len(_shown(label)) for label, _ in pairs), default=0) + 2
    room = columns() - len(indent) - width
    for label, value in pairs:
        longest = max(map(len, plain(value).split(" ")))
        if width > columns() // 2 or longest > room:
            yield from _wrapped(f"{plain(label)}: {plain(value) or '-'}", f"{indent}  ", indent)
            continue
        head = f"{indent}{_shown(label).ljust(width)}"
        yield from _wrapped(plain(value) or "-", " " * len(head), head)


def table_lines(
    shown: Table, indent: str = "", paint: Paint | None = None, *, silent: bool = False
) -> Iterator[str]:
    """A table with its columns lined up, no wider than the terminal."""
    if not silent:
        yield from _wrapped(unticked(shown.caption), f"{indent}  ", indent)
        indent += "  "
    for line in fitted(shown, columns() - len(indent), paint):
        yield f"{indent}{line}".rstrip()
    if shown.note:
        yield from _wrapped(unticked(shown.note), indent)
