"""What `check` says of several specs at once: a table of outcomes, each spec in short below."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from syncline_design.report import numbers, verdict_tables, verdict_words
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
from syncline_design.report.several import since_line
from syncline_design.report.table import Cell, Table, table
from syncline_design.report.verdict_charts import tightest_limit
from syncline_design.report.words import OUTCOMES, SINCE, STATUSES
from syncline_design.verdict.tree import Checked, Refused, Verdict


def on_verdicts(verdicts: Sequence[Checked]) -> Document:
    """The design report of one verdict, or an overview of several."""
    if len(verdicts) == 1 and not isinstance(verdicts[0], Refused):
        return on_verdict(verdicts[0])
    good = sum(verdict.verdict == "meets" for verdict in verdicts)
    known = OUTCOMES["meets" if good == len(verdicts) else "fails"]
    word = f"{good} of {len(verdicts)} specs meet every requirement"
    waived = sum(bool(_waived(verdict)) for verdict in verdicts)
    if waived:
        known = STATUSES["waived"] if known is OUTCOMES["meets"] else known
        word += f", {waived} with waived ones missed"
    since = tuple(filter(None, [since_line(verdicts)]))
    specs = [node for n, verdict in enumerate(verdicts, 1) for node in _spec(verdict, n)]
    return Document(
        family="Overview",
        outcome=Outcome(known.tone, known.mark, word),
        name="Design verdicts",
        sentences=since,
        facts=(),
        sections=(
            *section("overview", "Overview", show(_overview(verdicts), silent=True)),
            *section("specs", "Specs", specs),
        ),
        title=word,
    )


def _waived(verdict: Checked) -> tuple[str, ...]:
    if isinstance(verdict, Refused):
        return ()
    return verdict_words.waived_of(verdict.verdict, verdict.requirements)


def _spec(verdict: Checked, index: int) -> list[Node]:
    """A spec in short."""
    outcome = verdict_words.outcome(verdict)
    return [
        Heading(given(verdict.name)),
        Text((strong(outcome.word), " (", code(verdict.file), ")"),
             mark=outcome.mark, tone=outcome.tone),
        Text(verdict_words.design_sentence(verdict)),
        *(problems(verdict) if isinstance(verdict, Refused) else _requirements(verdict, index)),
        *_since(verdict, index),
    ]  # fmt: skip


def _since(verdict: Checked, index: int) -> list[Node]:
    """What became of the spec since a baseline."""
    if isinstance(verdict, Refused) or verdict.baseline is None:
        return []
    found = verdict_tables.since(verdict)
    caption = f"Spec {index}, {verdict.name}, against the baseline"
    return [
        Text(verdict_words.since_sentence(verdict.baseline, verdict)),
        *(show(replace(found, caption=caption), silent=True) if found is not None else ()),
    ]


def _requirements(verdict: Verdict, index: int) -> list[Node]:
    """With a caption of its own, for readers that jump between tables."""
    caption = f"Requirements of spec {index}, {verdict.name}"
    return show(replace(verdict_tables.requirements(verdict), caption=caption), silent=True)


def _overview(verdicts: Sequence[Checked]) -> Table:
    rows: list[tuple[Cell | str, ...]] = []
    known = bool(since_line(verdicts))
    for verdict in verdicts:
        result = verdict_words.outcome(verdict)
        word = Cell(result.word, tone=result.tone, mark=result.mark)
        rows.append((verdict.name, word, *_answer(verdict), *_change(verdict, known)))
    heads = ("Spec", "Verdict", "Price #", "Syncline error #", "Tightest margin",
             *(("Since then",) if known else ()))  # fmt: skip
    return table("Verdicts", heads, rows)


def _change(verdict: Checked, known: bool) -> tuple[Cell, ...]:
    """Whether a spec got worse, beside others that are held against a baseline."""
    if not known:
        return ()
    if isinstance(verdict, Refused) or verdict.baseline is None:
        return (Cell(numbers.MISSING),)
    word = SINCE["worse" if verdict.baseline.worse else "same"]
    return (Cell(word.word, tone=word.tone),)


def _answer(verdict: Checked) -> tuple[Cell, Cell, str]:
    """Price, error and tightest margin, as far as there are any."""
    unknown = Cell(numbers.MISSING)
    if isinstance(verdict, Refused):
        return unknown, unknown, numbers.MISSING
    cost = None if verdict.design is None else verdict.design.cost
    total = None if verdict.syncline is None else verdict.syncline.total_m
    tight = verdict_words.tightest(verdict.requirements)
    return (
        Cell(numbers.money(cost, verdict.spec.currency), cost),
        Cell(numbers.error(total, tightest_limit(verdict, "accuracy")), total),
        numbers.MISSING if tight is None else f"{verdict_words.margin_text(tight)} ({tight.id})",
    )
