"""The outputs of `check`: one or several verdicts in every format."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from syncline_design.report.formats import CHECK_FORMATS as CHECK_FORMATS

if TYPE_CHECKING:
    from syncline_design.verdict.tree import Checked


def render_checks(name: str, verdicts: Sequence[Checked]) -> str:
    """The text of one format for these verdicts; files that were refused may stand among them."""
    return _renderer(name)(verdicts)


def _renderer(name: str) -> Callable[[Sequence[Checked]], str]:
    """Each format's module loads only when it is asked for."""
    match name:
        case "json":
            from syncline_design.report.json_out import verdicts_json as render
        case "html":
            return _page
        case "junit":
            from syncline_design.report.junit import render_junit as render
        case "sarif":
            from syncline_design.report.sarif import render_sarif as render
        case "github":
            from syncline_design.report.github import render_github as render
        case "markdown":
            return _markdown
        case "csv":
            from syncline_design.report.csv_out import render_csv as render
        case _:
            raise ValueError(f"unknown format {name}")
    return render


def _page(verdicts: Sequence[Checked]) -> str:
    from syncline_design.report.on_verdicts import on_verdicts
    from syncline_design.report.render_html import html

    return html(on_verdicts(verdicts))


def _markdown(verdicts: Sequence[Checked]) -> str:
    """Every verdict in full, one after the other."""
    from syncline_design.report.on_verdict import on_verdict
    from syncline_design.report.render_markdown import markdown

    return "\n".join(markdown(on_verdict(verdict)) for verdict in verdicts)
