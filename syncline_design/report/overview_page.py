"""Several verdicts on one page: a table of outcomes, each with its requirements below."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from syncline_design.report import numbers, page, verdict_tables, verdict_words
from syncline_design.report.ci import spec_file, spec_name
from syncline_design.report.on_verdict import render_verdict
from syncline_design.report.table import Cell, Table, table
from syncline_design.report.text import harmless
from syncline_design.report.verdict_words import Json, items, part


def render_verdicts(verdicts: Sequence[Json]) -> str:
    """The design report of one verdict, or an overview of several."""
    if len(verdicts) == 1 and verdicts[0].get("verdict") != "refused":
        return render_verdict(verdicts[0])
    clean: list[Json] = [harmless(verdict) for verdict in verdicts]
    good = sum(verdict.get("verdict") == "meets" for verdict in clean)
    result = verdict_words.OUTCOMES["meets" if good == len(clean) else "fails"]
    return page.render_page(
        "overview.html.j2",
        kind="Overview",
        contents=[("overview", "Overview"), ("specs", "Specs")],
        outcome=result,
        word=f"{good} of {len(clean)} specs meet every requirement",
        overview=_overview(clean),
        specs=[
            {
                "name": spec_name(verdict),
                "file": spec_file(verdict),
                "outcome": verdict_words.outcome(verdict),
                "sentence": verdict_words.design_sentence(verdict),
                "requirements": _requirements(verdict, index),
                "problems": items(verdict, "problems"),
            }
            for index, verdict in enumerate(clean, start=1)
        ],
    )


def _requirements(verdict: Json, index: int) -> Table | None:
    """A spec's requirements under a caption of its own, for readers that jump between tables."""
    if not items(verdict, "requirements"):
        return None
    caption = f"Requirements of spec {index}, {spec_name(verdict)}"
    return replace(verdict_tables.requirements(verdict), caption=caption)


def _overview(verdicts: Sequence[Json]) -> Table:
    rows = []
    for verdict in verdicts:
        result = verdict_words.outcome(verdict)
        design, syncline = part(verdict, "design"), part(verdict, "syncline")
        currency = verdict_tables.currency_of(verdict)
        tight = verdict_words.tightest(items(verdict, "requirements"))
        rows.append((
            spec_name(verdict),
            Cell(result.word, tone=result.tone, mark=result.mark),
            Cell(numbers.money(design.get("cost"), currency), numbers.finite(design.get("cost"))),
            Cell(numbers.length(syncline.get("total_m")), numbers.finite(syncline.get("total_m"))),
            numbers.MISSING if tight is None
            else f"{verdict_words.margin_text(tight)} ({tight.get('id')})",
        ))  # fmt: skip
    heads = ("Spec", "Verdict", "Price #", "Syncline error #", "Tightest margin")
    return table("Verdicts", heads, rows)
