"""Why entries are not in the design, in sentences."""

from __future__ import annotations

from collections.abc import Sequence

from syncline_design.report import numbers
from syncline_design.report.document import Items, Node
from syncline_design.verdict.why_not import Answer, HeldBack, NotTaken

KINDS = {
    "sensor": "sensor",
    "timestamping": "timestamping method",
    "hardware": "shared hardware",
    "clock": "clock",
}


def why_not_nodes(
    answers: Sequence[Answer] | None, currency: str, limit: numbers.Limited | None
) -> list[Node]:
    """One entry a line; one that the spec does not list has two; limit: of accuracy."""
    if not answers:
        return []
    return [Items(tuple(_line(one, currency, limit) for one in answers))]


def _line(one: Answer, currency: str, limit: numbers.Limited | None) -> str:
    head = f"{one.entry} ({KINDS[one.kind]})"
    if isinstance(one, NotTaken):
        place = "" if one.place is None else f", {one.place}"
        return f"{head}{place}: {one.reason}"
    where = " and ".join(one.best_with.places)
    if one.in_design:
        return f"{head}: in the best design, for {where}"
    unlisted = "" if one.candidate else "were it a candidate, "
    return (
        f"{head}: {unlisted}the best design with it, for {where}, {_compared(one, currency, limit)}"
    )


def _compared(one: HeldBack, currency: str, limit: numbers.Limited | None) -> str:
    best = one.best_with
    cost = "does not say what it costs"
    if best.cost is not None:
        cost = f"costs {numbers.money(best.cost, currency)}"
        cost += _more(one.dearer_by, numbers.money(abs(one.dearer_by or 0.0), currency))
    error = f"has a Syncline error of {numbers.error(best.error_m, limit)}"
    error += _more(one.worse_by, numbers.error(abs(one.worse_by or 0.0), limit))
    return f"{cost} and {error}"


def _more(difference: float | None, shown: str) -> str:
    """` (900 EUR more)`; nothing where there is nothing to compare with."""
    if difference is None:
        return ""
    if difference == 0.0:
        return " (the same)"
    return f" ({shown} {'more' if difference > 0.0 else 'less'})"
