"""What would put a diagnosed system right: a row for the best repair of each kind."""

from __future__ import annotations

from syncline_design.comparison.meaning import DiagnosisAndDesign
from syncline_design.comparison.repairs import Repair
from syncline_design.report import numbers
from syncline_design.report.document import Node, Text, show
from syncline_design.report.table import Cell, table
from syncline_design.report.verdict_charts import tightest_limit
from syncline_design.report.words import BRIEF


def repair_nodes(found: DiagnosisAndDesign) -> list[Node]:
    """The cheapest that meets in a sentence, then the best of each kind."""
    rows = found.repairs or ()
    if not rows:
        return []
    heads = ("Price #", "Error #", "Verdict", "What to do", "Provided that")
    limit = None if found.design is None else tightest_limit(found.design.before, "accuracy")
    shown = table("Repairs", heads, [_row(one, limit) for one in rows], named_by=3)
    return [Text(_sentence(rows)), *show(shown, silent=True)]


def _sentence(rows: tuple[Repair, ...]) -> str:
    best = next((one for one in rows if one.cheapest), None)
    if best is None:
        return "None of these meets every requirement."
    price = "at no cost for parts" if not best.price else f"for {_money(best)}"
    steps = " and ".join(step.text for step in best.steps)
    return f"The cheapest that meets every requirement, {price}: {steps}."


def _money(one: Repair) -> str:
    return numbers.money(one.price, one.currency)


def _row(one: Repair, limit: numbers.Limited | None) -> tuple[Cell | str, ...]:
    word = BRIEF[one.verdict]
    missed = f": {', '.join(one.misses)}" if one.misses else ""
    return (
        Cell(_money(one), one.price),
        Cell(numbers.error(one.error_m, limit), one.error_m),
        Cell(word.word + missed, tone=word.tone, mark=word.mark),
        "; ".join(step.text for step in one.steps),
        "; ".join(dict.fromkeys(s.assumes for s in one.steps if s.assumes)),
    )
