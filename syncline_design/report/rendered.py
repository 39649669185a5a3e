"""A subject in the formats that nearly every subject has: its data, its page, its text."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Literal, Protocol

from syncline_design.machine.records import Json
from syncline_design.report.document import Document, charts, for_output
from syncline_design.report.json_out import json_text
from syncline_design.report.render_html import html
from syncline_design.report.render_markdown import markdown


def chart_files(
    documents: Mapping[str, Document], kind: Literal["svg", "png"]
) -> list[tuple[str, bytes]]:  # fmt: skip
    """Every figure of the documents as a file of its own: name and content.

    documents: by what their figures' names begin with, "" where there is one document.
    """
    found = []
    for prefix, document in documents.items():
        shown = for_output(document, "page")
        for chart in (chart for part in shown.sections for chart in charts(part.nodes)):
            drawn = chart.draw()
            assert drawn.exported is not None
            name = "-".join(part for part in (prefix, chart.name) if part)
            found.append((f"{name}.{kind}", drawn.exported(kind)))
    return found


class Written(Protocol):
    """A result that has a JSON."""

    def to_json(self) -> Json:
        """Its fields as data."""


def rendered(name: str, result: Written, said: Callable[[], Document]) -> str:
    """The text of one format; the document is only made where the format shows it."""
    match name:
        case "json":
            return json_text(result.to_json())
        case "html":
            return html(said())
        case "markdown":
            return markdown(said())
        case _:
            raise ValueError(f"unknown format {name}")
