"""The outputs of `study`: a result in every format."""

from __future__ import annotations

from syncline_design.report.formats import STUDY_FORMATS as STUDY_FORMATS
from syncline_design.studies.result import StudyResult


def render_study(name: str, result: StudyResult) -> str | bytes:
    """The content of one format; each format's module loads only when it is asked for."""
    match name:
        case "csv":
            from syncline_design.report.study_rows import study_csv

            return study_csv(result)
        case "parquet":
            from syncline_design.report.study_rows import study_parquet

            return study_parquet(result)
        case "json":
            from syncline_design.report.json_out import json_text
            from syncline_design.report.study_data import study_data

            return json_text(study_data(result).to_json())
        case "html":
            from syncline_design.report.on_study import on_study
            from syncline_design.report.render_html import html

            return html(on_study(result))
        case "markdown":
            from syncline_design.report.on_study import on_study
            from syncline_design.report.render_markdown import markdown

            return markdown(on_study(result))
        case _:
            return _for_ci(name, result)


def _for_ci(name: str, result: StudyResult) -> str:
    from syncline_design.report import study_findings

    match name:
        case "junit":
            return study_findings.study_junit(result)
        case "sarif":
            return study_findings.study_sarif(result)
        case "github":
            return study_findings.study_github(result)
        case _:
            raise ValueError(f"unknown format {name}")
