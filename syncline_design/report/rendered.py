"""A subject in the formats that nearly every subject has: its data, its page, its text."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from syncline_design.machine.records import Json
from syncline_design.report.document import Document
from syncline_design.report.json_out import json_text
from syncline_design.report.render_html import html
from syncline_design.report.render_markdown import markdown


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
