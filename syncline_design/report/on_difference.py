"""A difference of two designs in words, for the console, pull requests and machines."""

from __future__ import annotations

from syncline_design.report import numbers
from syncline_design.report.document import Document, Items, Node, section, show
from syncline_design.report.formats import DIFF_FORMATS as DIFF_FORMATS
from syncline_design.report.table import Cell, Table, table
from syncline_design.report.text import sentence_list, visible
from syncline_design.report.verdict_words import STATUSES, Json, items, kind_text, outcome, part


def render_diff(name: str, data: Json) -> str:
    """The text of one format (data: schema syncline-design/diff/v1)."""
    match name:
        case "json":
            from syncline_design.report.json_out import json_text

            return json_text(data)
        case "html":
            from syncline_design.report.render_html import html

            return html(on_difference(data))
        case "markdown":
            from syncline_design.report.render_markdown import markdown

            return markdown(on_difference(data))
        case "github":
            level = "notice" if data.get("exit_code") == 0 else "error"
            text = visible(headline(data)).replace("%", "%25")
            file = visible(part(data, "new").get("file"))
            place = file.replace("%", "%25").replace(":", "%3A").replace(",", "%2C")
            return f"::{level} file={place},line=1::{text}\n"
        case _:
            raise ValueError(f"unknown format {name}")


def on_difference(data: Json) -> Document:
    """A difference as a document (data: schema syncline-design/diff/v1)."""
    lines = tuple(_cause_line(cause) for cause in items(data, "causes"))
    causes: list[Node] = [*show(_causes(data), silent=True, reach="page")]
    causes += [Items(lines, reach="text")] if lines else []
    old, new = (str(part(data, side).get("file") or side) for side in ("old", "new"))
    return Document(
        family="Difference",
        outcome=outcome({"verdict": part(data, "verdict").get("new")}),
        name=f"{old} \N{RIGHTWARDS ARROW} {new}",
        sentences=(headline(data),),
        facts=tuple(_facts(data)),
        sections=(
            *section("causes", "What differs", causes),
            *section("payload", "Payload", show(_payload(data), silent=True)),
            *section("sums", "Sums", show(_sums(data), silent=True)),
            *section("margins", "Requirements", show(_margins(data), silent=True)),
        ),
    )


def _facts(data: Json) -> list[tuple[str, str]]:
    verdict = part(data, "verdict")
    return [
        (label, outcome({"verdict": verdict.get(side)}).word)
        for label, side in (("Before", "old"), ("Now", "new"))
    ]


def headline(data: Json) -> str:
    """`stages[uav].distance 100 m to 60 m: payload changes, -26 500 EUR, still meets.`"""
    causes = [cause_words(cause) for cause in items(data, "causes")]
    if not causes:
        lead = "Nothing in the files differs"
    elif len(causes) <= 3:
        lead = sentence_list(causes)
    else:
        lead = f"{len(causes)} changes"
    return f"{lead}: {effect_words(data)}."


def effect_words(data: Json) -> str:
    """`payload changes, +1 900 EUR, error 12 mm larger, still meets its requirements`."""
    parts = ["payload changes" if items(data, "payload") else "same payload"]
    cost = next((s for s in items(data, "sums") if s.get("name") == "cost"), {})
    change = numbers.finite(cost.get("change"))
    if change:
        parts.append(signed_change(change, str(data.get("currency"))))
    elif units_differ(cost):
        parts.append(f"price in {cost['unit']} (before: {cost['old_unit']})")
    error = numbers.finite(part(data, "error").get("change"))
    if error and abs(error) > 1e-12:
        word = "larger" if error > 0 else "smaller"
        parts.append(f"Syncline error {numbers.length(abs(error))} {word}")
    if not _has_designs(data):
        parts = []
    return ", ".join([*parts, _verdict_words(part(data, "verdict"))])


def _has_designs(data: Json) -> bool:
    error = part(data, "error")
    return error.get("old") is not None and error.get("new") is not None


def _verdict_words(verdict: Json) -> str:
    old, new = str(verdict.get("old")), str(verdict.get("new"))
    words = {
        "meets": "meets its requirements",
        "fails": "does not meet its requirements",
        "infeasible": "no design meets the requirements",
        "indeterminate": "no verdict",
    }
    if old == new:
        return f"still {words.get(new, new)}"
    return f"now {words.get(new, new)} (before: {words.get(old, old)})"


def signed_change(change: float, unit: str) -> str:
    """`+1 900 EUR` or `-12 mm`, the sign typeset; 0 has none."""
    sign = "" if change == 0 else "+" if change > 0 else "\N{MINUS SIGN}"
    return sign + numbers.in_unit(abs(change), unit)


def cause_words(cause: Json) -> str:
    key, old, new = cause.get("key"), cause.get("old"), cause.get("new")
    if old is None:
        return f"{key} added ({new})"
    return f"{key} removed ({old})" if new is None else f"{key} {old} to {new}"


def _cause_line(cause: Json) -> str:
    effect = part(cause, "effect")
    return cause_words(cause) + (f"; alone: {effect_words(effect)}" if effect else "")


def pick_words(entry: Json) -> str:
    if not entry:
        return "nothing"
    name = entry.get("name") or entry.get("sensor")
    return f"{name} ({entry.get('timestamping')}, {entry.get('primitive')})"


def units_of(entry: Json) -> tuple[str, str]:
    """The units of a sum before and now; currencies may differ."""
    unit = str(entry.get("unit"))
    return str(entry.get("old_unit") or unit), unit


def units_differ(entry: Json) -> bool:
    """Whether a sum is given in two currencies and so has no difference."""
    before, now = units_of(entry)
    return before != now and None not in (entry.get("old"), entry.get("new"))


def sum_name(entry: Json) -> str:
    """The word for one of the sums."""
    name = str(entry.get("name"))
    return "Syncline error" if name == "error" else name


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


def value_of_limit(row: Json) -> str:
    """`0.29 m of 0.3 m`, in that side's own unit."""
    unit = str(row.get("unit") or "")
    return f"{numbers.in_unit(row.get('value'), unit)} of {numbers.in_unit(row.get('limit'), unit)}"
