"""A difference of two designs as one offline HTML page."""

from __future__ import annotations

from typing import Final

from syncline_design.report import numbers, page
from syncline_design.report.on_difference import (
    cause_words,
    effect_words,
    headline,
    pick_words,
    signed_change,
    sum_name,
    units_of,
    value_of_limit,
)
from syncline_design.report.table import Cell, Table, table
from syncline_design.report.text import harmless
from syncline_design.report.verdict_words import (
    OUTCOMES,
    STATUSES,
    Json,
    items,
    kind_text,
    outcome,
    part,
)

_TITLES: Final = (
    ("causes", "What differs"),
    ("payload", "Payload"),
    ("sums", "Sums"),
    ("margins", "Requirements"),
)


def render_difference(data: Json) -> str:
    """The page of `diff` (data: schema syncline-design/diff/v1)."""
    data = harmless(data)
    tables = {
        "causes": _causes(data), "payload": _payload(data), "sums": _sums(data),
        "margins": _margins(data),
    }  # fmt: skip
    return page.render_page(
        "difference.html.j2",
        kind="Difference",
        name=f"{_file(data, 'old')} \N{RIGHTWARDS ARROW} {_file(data, 'new')}",
        outcome=outcome({"verdict": part(data, "verdict").get("new")}),
        sentence=headline(data),
        facts=_facts(data),
        contents=[(key, title) for key, title in _TITLES if tables[key] is not None],
        sections=[(key, title, tables[key]) for key, title in _TITLES if tables[key] is not None],
    )


def _file(data: Json, side: str) -> str:
    return str(part(data, side).get("file") or side)


def _facts(data: Json) -> list[tuple[str, str]]:
    verdict = part(data, "verdict")
    return [
        (label, OUTCOMES.get(str(verdict.get(side)), OUTCOMES["indeterminate"]).word)
        for label, side in (("Before", "old"), ("Now", "new"))
    ]


def _causes(data: Json) -> Table | None:
    rows = [
        (cause_words(cause), effect_words(part(cause, "effect")) if cause.get("effect") else "")
        for cause in items(data, "causes")
    ]
    heads = ("Change", "What it does alone")
    return table("What the two files say differently", heads, rows) if rows else None


def _payload(data: Json) -> Table | None:
    rows = [
        (str(e.get("role")), pick_words(part(e, "old")), pick_words(part(e, "new")))
        for e in items(data, "payload")
    ]
    heads = ("Role", "Before", "Now")
    return table("Roles whose sensor or timestamping is another one", heads, rows) if rows else None


def _sums(data: Json) -> Table | None:
    rows = []
    for entry in [*items(data, "sums"), part(data, "error")]:
        before, unit = units_of(entry)
        old, new = numbers.finite(entry.get("old")), numbers.finite(entry.get("new"))
        change = numbers.finite(entry.get("change"))
        rows.append((
            sum_name(entry),
            Cell(numbers.in_unit(old, before), old),
            Cell(numbers.in_unit(new, unit), new),
            Cell(numbers.MISSING if change is None else signed_change(change, unit), change),
        ))  # fmt: skip
    return table("Sums, before and now", ("Sum", "Before #", "Now #", "Change #"), rows)


def _margins(data: Json) -> Table | None:
    rows: list[tuple[Cell | str, ...]] = []
    for entry in items(data, "requirements"):
        cells = [_standing(part(entry, side)) for side in ("old", "new")]
        rows.append((Cell(str(entry.get("id"))), kind_text(entry), *cells))
    heads = ("Requirement", "Limits", "Before", "Now")
    return table("Requirements, before and now", heads, rows) if rows else None


def _standing(row: Json) -> Cell:
    """`0.29 m of 0.3 m` with the requirement's status as colour and symbol."""
    if not row:
        return Cell("not required")
    state = STATUSES.get(str(row.get("status")), STATUSES["indeterminate"])
    return Cell(
        f"{value_of_limit(row)}, {state.word}",
        numbers.finite(row.get("value")),
        state.tone,
        state.mark,
    )
