"""A document as Markdown, for a pull request comment or a job summary."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

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
    spans,
)
from syncline_design.report.table import Table, cell_words
from syncline_design.report.text import markdown_safe


def markdown(document: Document) -> str:
    """The Markdown of a document as far as it reaches beyond the page; ends with a newline."""
    shown = for_output(document, "text")
    blocks = [f"## {shown.outcome.mark} {_safe(shown.name)}: {_safe(shown.outcome.word)}"]
    blocks += [_safe(words) for words in shown.sentences]
    if shown.facts:
        blocks.append(
            ", ".join(f"**{_safe(label)}** {_safe(value)}" for label, value in shown.facts)
        )
    for part in shown.sections:
        blocks.append(f"### {_safe(part.title)}")
        blocks += _blocks(part.nodes)
    return "\n\n".join(blocks).rstrip() + "\n"


def _safe(words: Inline) -> str:
    """Inline text that shows literally; only what is strong keeps its style."""
    parts = []
    for span in spans(words):
        text = markdown_safe(span.text)
        parts.append(f"**{text}**" if span.style == "strong" else text)
    return "".join(parts)


def _blocks(nodes: Iterable[Node]) -> Iterator[str]:
    for node in nodes:
        match node:
            case Heading():
                aside = _safe(node.aside)
                yield f"**{_safe(node.words)}**" + (f" ({aside})" if aside else "")
            case Text():
                yield f"{node.mark} {_safe(node.words)}".strip()
            case Facts():
                yield "\n".join(f"- {_safe(label)}: {_safe(value)}" for label, value in node.pairs)
            case Items():
                mark = f"{node.mark} " if node.mark else ""
                yield "\n".join(f"- {mark}{_safe(entry)}" for entry in node.entries)
            case TableNode():
                caption = "" if node.silent else f"**{_safe(node.table.caption)}**\n\n"
                note = f"\n\n{_safe(node.table.note)}" if node.table.note else ""
                yield f"{caption}{markdown_table(node.table).rstrip()}{note}"
            case Group():
                yield from _blocks(node.nodes)
            case _:
                raise TypeError(f"a {node.kind} is for pages only")


def markdown_table(table: Table) -> str:
    """A table in GitHub's dialect, figures flush right."""
    head = "| " + " | ".join(markdown_safe(h.text) for h in table.heads) + " |"
    rule = "|" + "|".join(" ---: " if h.numeric else " --- " for h in table.heads) + "|"
    rows = [
        "| " + " | ".join(markdown_safe(cell_words(c)) for c in row) + " |" for row in table.rows
    ]
    return "\n".join([head, rule, *rows, ""])
