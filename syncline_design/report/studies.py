"""The outputs of `study`: a result in every format."""

from __future__ import annotations

from typing import Any

from syncline_design.report import study_notices
from syncline_design.report.csv_out import csv_text
from syncline_design.report.formats import STUDY_FORMATS as STUDY_FORMATS
from syncline_design.report.on_study import on_study
from syncline_design.report.rendered import rendered
from syncline_design.report.text import visible
from syncline_design.studies.result import StudyResult
from syncline_design.studies.table import Value, columns, rows, text_columns


def render_study(name: str, result: StudyResult) -> str | bytes:
    """The content of one format."""
    match name:
        case "csv":
            return study_csv(result)
        case "parquet":
            return study_parquet(result)
        case "junit" | "sarif" | "github":
            return _for_ci(name, result)
        case _:
            return rendered(name, result, lambda: on_study(result))


def _for_ci(name: str, result: StudyResult) -> str:
    match name:
        case "junit":
            return study_notices.study_junit(result)
        case "sarif":
            return study_notices.study_sarif(result)
        case "github":
            return study_notices.study_github(result)
        case _:
            raise ValueError(f"unknown format {name}")


def study_csv(result: StudyResult) -> str:
    """The table as CSV; text that a spreadsheet would run is disarmed."""
    return csv_text(columns(result), rows(result))


def study_parquet(result: StudyResult) -> bytes:
    """The table as Parquet, figures as float64; unit in the column's name."""
    import io

    import polars as pl

    text = text_columns(result)
    names = columns(result)
    schema: dict[str, Any] = {n: pl.String if n in text else pl.Float64 for n in names}
    schema["case"] = pl.Int64
    filled = ({n: _value(r.get(n)) for n in names} for r in rows(result))
    stream = io.BytesIO()
    pl.DataFrame(filled, schema=schema, orient="row").write_parquet(stream, statistics=False)
    return stream.getvalue()


def _value(value: Value) -> Value:
    return visible(value) if isinstance(value, str) else value
