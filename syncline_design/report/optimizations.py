"""The outputs of `optimize` in every format."""

from __future__ import annotations

from dataclasses import replace

from syncline_design.report.choice_csv import optimization_csv
from syncline_design.report.document import Document, Heading, Node, Text, strong
from syncline_design.report.formats import OPTIMIZE_FORMATS as OPTIMIZE_FORMATS
from syncline_design.report.json_out import json_text
from syncline_design.report.on_choice import figure_front, incomplete_lines
from syncline_design.report.on_hinges import hinges_nodes
from syncline_design.report.on_nearest import asked_limit
from syncline_design.report.on_verdict import on_verdict
from syncline_design.report.on_why_not import why_not_nodes
from syncline_design.report.render_html import html
from syncline_design.verdict.optimization import Optimized


def render_optimize(name: str, found: Optimized) -> str:
    """The text of one format; html is the design report with all that the choice hinges on."""
    if name == "csv":
        return optimization_csv(found)
    if name == "json":
        return json_text(found.result.to_json())
    return html(on_optimized(found))


def on_optimized(found: Optimized) -> Document:
    """The design report with all that the choice hinges on."""
    assert found.verdict is not None
    more: list[Node] = [Text((strong(line),)) for line in incomplete_lines(found.result)]
    limit = asked_limit(found.case, "accuracy")
    asked = why_not_nodes(found.result.why_not, found.case.spec.currency, limit)
    if asked:
        more += [Heading("Why not"), *asked]
    for section in figure_front(found):
        more += [Heading(section.title), *section.nodes]
    document = on_verdict(found.verdict, [*more, *hinges_nodes(found.result, limit)])
    parts = (replace(part, folded=part.folded and part.key != "choice")
             for part in document.sections)  # fmt: skip
    return replace(document, sections=tuple(parts))
