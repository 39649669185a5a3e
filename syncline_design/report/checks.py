"""The outputs of `check`: one or several verdicts in every format."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from syncline_design.report.csv_out import render_bill, render_csv
from syncline_design.report.formats import CHECK_FORMATS as CHECK_FORMATS
from syncline_design.report.github import render_github
from syncline_design.report.json_out import verdicts_json
from syncline_design.report.on_verdict import on_verdict
from syncline_design.report.on_verdicts import on_verdicts
from syncline_design.report.render_html import html
from syncline_design.report.render_markdown import markdown

if TYPE_CHECKING:
    from syncline_design.verdict.tree import Checked


def render_checks(name: str, verdicts: Sequence[Checked]) -> str:
    """The text of one format for these verdicts; files that were refused may stand among them."""
    match name:
        case "json":
            return verdicts_json(verdicts)
        case "html":
            return html(on_verdicts(verdicts))
        case "junit":
            # with the XML library, which takes longer to load than all else here
            from syncline_design.report.junit import render_junit

            return render_junit(verdicts)
        case "sarif":
            from syncline_design.report.sarif import render_sarif  # with its hashes

            return render_sarif(verdicts)
        case "github":
            return render_github(verdicts)
        case "markdown":
            return "\n".join(markdown(on_verdict(verdict)) for verdict in verdicts)
        case "csv":
            return render_csv(verdicts)
        case "bill":
            return render_bill(verdicts)
        case _:
            raise ValueError(f"unknown format {name}")
