"""CSV (RFC 4180) that no spreadsheet runs: text is quoted, what looks like a formula disarmed."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from syncline_design.report.json_out import json_text
from syncline_design.report.text import spreadsheet_safe
from syncline_design.report.verdict_words import since_word, status_id, waiver_text
from syncline_design.verdict.since import RequirementSince
from syncline_design.verdict.tree import Checked, Refused, RequirementResult, Verdict

_COLUMNS = ("spec", "file", "verdict", "requirement", "kind", "status", "value", "limit", "unit",
            "margin", "line", "warnings", "waiver", "since_baseline", "kind_then", "status_then",
            "value_then", "limit_then", "unit_then", "mission")  # fmt: skip


def csv_text(columns: Sequence[str], rows: Iterable[Mapping[str, Any]]) -> str:
    """Rows under a header; figures in full precision, missing ones empty, texts quoted."""
    stream = io.StringIO(newline="")
    writer = csv.writer(stream, quoting=csv.QUOTE_NONNUMERIC, lineterminator="\r\n")
    return _written(stream, writer, columns, ([row.get(name) for name in columns] for row in rows))


def plain_csv(columns: Sequence[str], rows: Iterable[Iterable[Any]]) -> str:
    """The same for rows of cells, quoted only where they must be, with Unix line ends."""
    stream = io.StringIO(newline="")
    return _written(stream, csv.writer(stream, lineterminator="\n"), columns, rows)


def _written(
    stream: io.StringIO, writer: Any, columns: Sequence[str], rows: Iterable[Iterable[Any]]
) -> str:
    writer.writerow([spreadsheet_safe(column) for column in columns])
    writer.writerows([_cell(value) for value in row] for row in rows)
    return stream.getvalue()


def _cell(value: Any) -> Any:
    if value is None:
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int | float):
        return float(value) if isinstance(value, float) else value
    if isinstance(value, Mapping | list | tuple):
        return spreadsheet_safe(json_text(value).strip())
    return spreadsheet_safe(value)


def render_csv(verdicts: Sequence[Checked]) -> str:
    """A row per requirement of every spec; a spec without any still gets its row."""
    rows: list[dict[str, Any]] = []
    for verdict in verdicts:
        head = {"spec": verdict.name, "file": verdict.file, "verdict": verdict.verdict}
        found = (
            []
            if isinstance(verdict, Refused)
            else [{**head, **about} for about in (*_rows(verdict), *_gone(verdict))]
        )
        rows += found or [head]
    return csv_text(_COLUMNS, rows)


_BILL = ("spec", "file", "stage", "use", "item", "entry", "quantity", "cost", "currency",
         "mass_kg", "power_w", "basis", "missions")  # fmt: skip


def render_bill(verdicts: Sequence[Checked]) -> str:
    """A row per line of every spec's bill of materials; the columns add up to the totals."""
    rows: list[dict[str, Any]] = []
    for verdict in verdicts:
        if isinstance(verdict, Refused):
            continue
        head = {"spec": verdict.name, "file": verdict.file, "currency": verdict.spec.currency}
        for line in verdict.bill_of_materials or ():
            told = line.to_json()
            told |= {"mass_kg": told.pop("mass"), "power_w": told.pop("power")}
            told["missions"] = "; ".join(line.missions or ())
            rows.append(head | told)
    return csv_text(_BILL, rows)


def _rows(verdict: Verdict) -> Iterator[dict[str, Any]]:
    """Requirements with the codes of the warnings about them, what their waivers do, and what
    became of them since the baseline; a miss under a waiver in force is `waived`, as in JUnit.

    Of several missions first what holds over all of them, then each mission's own.
    """
    since = _since(verdict)
    rows: list[tuple[str | None, RequirementResult]] = [(None, r) for r in verdict.requirements]
    rows += [one for one in verdict.judged_rows if one[0] is not None]
    for mission, row in rows:
        codes = " ".join(
            w.code for w in verdict.warnings
            if w.requirement == row.id and (not w.missions or mission in w.missions)
        )  # fmt: skip
        told = {"requirement": row.id, "warnings": codes, "waiver": waiver_text(row, mission)}
        one = since.get((mission, row.id))
        earlier = {} if one is None else _then(verdict, one)
        status = {"status": status_id(row), "mission": mission or ""}
        yield row.to_json() | told | status | earlier


def _gone(verdict: Verdict) -> Iterator[dict[str, Any]]:
    """Requirements that only the baseline has."""
    for one in _since(verdict).values():
        if one.change == "gone":
            told = {"requirement": one.id, "mission": one.mission or ""}
            yield told | _then(verdict, one)


def _since(verdict: Verdict) -> dict[tuple[str | None, str], RequirementSince]:
    rows = verdict.baseline.requirements if verdict.baseline else ()
    return {(one.mission, one.id): one for one in rows}


def _then(verdict: Verdict, one: RequirementSince) -> dict[str, Any]:
    """What became of a requirement and how it stood, as the table of the baseline says it."""
    found: dict[str, Any] = {"since_baseline": since_word(one, verdict).word}
    if one.was is not None:
        then = one.was
        status = "waived" if then.waived else then.status
        found |= {"kind_then": then.kind or "", "status_then": status, "value_then": then.value}
        found |= {"limit_then": then.limit, "unit_then": then.unit}
    return found
