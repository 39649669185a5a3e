"""What `check` says of several specs at once: a table of outcomes, each spec in short below."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from syncline_design.report import numbers, verdict_tables, verdict_words
from syncline_design.report.ci import spec_file, spec_name
from syncline_design.report.document import (
    Document,
    Heading,
    Node,
    Outcome,
    Text,
    code,
    given,
    section,
    show,
    strong,
)
from syncline_design.report.on_verdict import on_verdict, problems
from syncline_design.report.table import Cell, Table, table
from syncline_design.report.verdict_words import Json, items, part
from syncline_design.report.words import OUTCOMES


def on_verdicts(verdicts: Sequence[Json]) -> Document:
    """The design report of one verdict, or an overview of several."""
    if len(verdicts) == 1 and verdicts[0].get("verdict") != "refused":
        return on_verdict(verdicts[0])
    good = sum(verdict.get("verdict") == "meets" for verdict in verdicts)
    known = OUTCOMES["meets" if good == len(verdicts) else "fails"]
    word = f"{good} of {len(verdicts)} specs meet every requirement"
    specs = [node for n, verdict in enumerate(verdicts, 1) for node in _spec(verdict, n)]
    return Document(
        family="Overview",
        outcome=Outcome(known.tone, known.mark, word),
        name="Design verdicts",
        sentences=(),
        facts=(),
        sections=(
            *section("overview", "Overview", show(_overview(verdicts), silent=True)),
            *section("specs", "Specs", specs),
        ),
        title=word,
    )


def _spec(verdict: Json, index: int) -> list[Node]:
    """A spec in short; its table has a caption of its own, for readers that jump between tables."""
    outcome = verdict_words.outcome(verdict)
    caption = f"Requirements of spec {index}, {spec_name(verdict)}"
    requirements = replace(verdict_tables.requirements(verdict), caption=caption)
    return [
        Heading(given(spec_name(verdict))),
        Text((strong(outcome.word), " (", code(spec_file(verdict)), ")"),
             mark=outcome.mark, tone=outcome.tone),
        Text(verdict_words.design_sentence(verdict)),
        *problems(verdict),
        *show(requirements, silent=True),
    ]  # fmt: skip


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
