"""A difference of two designs in words, for the console, pull requests and machines."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from syncline_design.report import numbers
from syncline_design.report.formats import DIFF_FORMATS as DIFF_FORMATS
from syncline_design.report.text import markdown_safe, sentence_list, visible
from syncline_design.report.verdict_words import OUTCOMES, Json, items, part


def render_diff(name: str, data: Json) -> str:
    """The text of one format (data: schema syncline-design/diff/v1)."""
    match name:
        case "json":
            from syncline_design.report.json_out import json_text

            return json_text(data)
        case "html":
            from syncline_design.report.difference_page import render_difference

            return render_difference(data)
        case "markdown":
            return _markdown(data)
        case "github":
            level = "notice" if data.get("exit_code") == 0 else "error"
            text = visible(headline(data)).replace("%", "%25")
            file = visible(part(data, "new").get("file"))
            place = file.replace("%", "%25").replace(":", "%3A").replace(",", "%2C")
            return f"::{level} file={place},line=1::{text}\n"
        case _:
            raise ValueError(f"unknown format {name}")


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


def diff_text(data: Json) -> str:
    """The difference for the console."""
    mark = OUTCOMES[str(part(data, "verdict").get("new"))].mark
    lines = [f"{mark} {visible(headline(data))}", ""]
    for title, found in _sections(data):
        rows = list(found)
        if rows:
            lines += [title, *(f"  {visible(row)}" for row in rows), ""]
    return "\n".join(lines).rstrip() + "\n"


def _markdown(data: Json) -> str:
    mark = OUTCOMES[str(part(data, "verdict").get("new"))].mark
    lines = [f"## {mark} {markdown_safe(headline(data))}", ""]
    for title, found in _sections(data):
        rows = list(found)
        if rows:
            lines += [f"**{title}**", "", *(f"- {markdown_safe(row)}" for row in rows), ""]
    return "\n".join(lines).rstrip() + "\n"


def _sections(data: Json) -> list[tuple[str, Iterator[str]]]:
    return [
        ("What differs", _causes(data)),
        ("Payload", _payload(data)),
        ("Sums", _sums(data)),
        ("Margins", _margins(data)),
    ]


def _causes(data: Json) -> Iterator[str]:
    for cause in items(data, "causes"):
        effect = part(cause, "effect")
        alone = f"; alone: {effect_words(effect)}" if effect else ""
        yield cause_words(cause) + alone


def _payload(data: Json) -> Iterator[str]:
    for entry in items(data, "payload"):
        old, new = pick_words(part(entry, "old")), pick_words(part(entry, "new"))
        yield f"{entry.get('role')}: {old} to {new}"


def pick_words(entry: Json) -> str:
    if not entry:
        return "nothing"
    name = entry.get("name") or entry.get("sensor")
    return f"{name} ({entry.get('timestamping')}, {entry.get('primitive')})"


def _sums(data: Json) -> Iterator[str]:
    for entry in [*items(data, "sums"), part(data, "error")]:
        old, new = entry.get("old"), entry.get("new")
        if old != new or units_differ(entry):
            before, now = (
                numbers.in_unit(v, u) for v, u in zip((old, new), units_of(entry), strict=True)
            )
            yield f"{sum_name(entry)}: {before} to {now}"


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


def _margins(data: Json) -> Iterator[str]:
    for entry in items(data, "requirements"):
        old, new = part(entry, "old"), part(entry, "new")
        if old and new and _comparable(old) == _comparable(new):
            continue
        yield f"{entry.get('id')}: {_standing(old)} to {_standing(new)}"


def _comparable(row: Json) -> tuple[Any, ...]:
    return row.get("status"), row.get("value"), row.get("limit"), row.get("unit")


def _standing(row: Json) -> str:
    """`0.29 m of 0.3 m (pass)`."""
    return f"{value_of_limit(row)} ({row.get('status')})" if row else "not required"


def value_of_limit(row: Json) -> str:
    """`0.29 m of 0.3 m`, in that side's own unit."""
    unit = str(row.get("unit") or "")
    return f"{numbers.in_unit(row.get('value'), unit)} of {numbers.in_unit(row.get('limit'), unit)}"
