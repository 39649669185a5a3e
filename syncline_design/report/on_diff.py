"""A difference of two designs in words, for the console, pull requests and machines."""

from __future__ import annotations

import json
from typing import Literal

from syncline_design.comparison.diff_result import (
    Cause,
    Diff,
    FigureChange,
    Pick,
    RequirementChange,
    Standing,
    VerdictChange,
    VerdictChanges,
)
from syncline_design.machine.sentences import sentence_list
from syncline_design.report import numbers
from syncline_design.report.document import (
    Document,
    Items,
    Node,
    Outcome,
    provenance,
    section,
    show,
)
from syncline_design.report.formats import DIFF_FORMATS as DIFF_FORMATS
from syncline_design.report.rendered import rendered
from syncline_design.report.table import Cell, Table, table
from syncline_design.report.text import unticked, visible
from syncline_design.report.verdict_words import (
    kind_words,
    of_mission,
    pinned_by,
    status_word,
    with_waived,
)
from syncline_design.report.words import KINDS, OUTCOMES
from syncline_design.verdict.tree import PREDICATES


def render_diff(name: str, data: Diff) -> str:
    """The text of one format."""
    if name != "github":
        return rendered(name, data, lambda: on_diff(data))
    level = "notice" if data.exit_code == 0 else "error"
    text = visible(unticked(" ".join((headline(data), *reasons(data))))).replace("%", "%25")
    file = visible(data.new.file)
    place = file.replace("%", "%25").replace(":", "%3A").replace(",", "%2C")
    return f"::{level} file={place},line=1::{text}\n"


def on_diff(data: Diff) -> Document:
    """A difference as a document."""
    lines = tuple(_cause_line(cause) for cause in data.causes)
    causes: list[Node] = [*show(_causes(data), silent=True, reach="page")]
    causes += [Items(lines, reach="text")] if lines else []
    return Document(
        family="Diff",
        outcome=_outcome(data, "new"),
        name=f"{data.old.file} \N{RIGHTWARDS ARROW} {data.new.file}",
        sentences=(headline(data), *reasons(data)),
        facts=(
            ("Before", _outcome(data, "old").word),
            ("Now", _outcome(data, "new").word),
        ),
        sections=(
            *section("margins", "Requirements", show(_margins(data), silent=True)),
            *section("causes", "What differs", causes),
            *section("payload", "Payload", show(_payload(data), silent=True)),
            *section("sums", "Sums", show(_sums(data), silent=True)),
            *provenance(_provenance(data)),
        ),
    )


def _provenance(data: Diff) -> list[tuple[str, str]]:
    """What either side is pinned by."""
    return [
        (f"{word}: {name}", text)
        for word, one in (("Before", data.old), ("Now", data.new))
        if one.provenance is not None
        for name, text in pinned_by(one.provenance)
    ]


def _outcome(data: Diff, side: Literal["old", "new"]) -> Outcome:
    """One side's outcome, what is waived named."""
    word = getattr(data.verdict, side)
    found = [(one.id, getattr(one, side)) for one in data.requirements]
    missed = [name for name, row in found if row and row.waived and row.status == "fail"]
    return with_waived(OUTCOMES[word], missed if word == "meets" else ())


def headline(data: Diff) -> str:
    """`stages[uav].distance 100 m to 60 m: payload changes, -26 500 EUR, still meets.`"""
    causes = [cause_words(cause) for cause in data.causes]
    if not causes:
        lead = "Nothing in the files differs"
    elif len(causes) <= 3:
        lead = sentence_list(causes)
    else:
        lead = f"{len(causes)} changes"
    return f"{lead}: {effect_words(data)}."


def reasons(data: Diff | VerdictChanges) -> tuple[str, ...]:
    """`What was chosen before has TVU-1 at 339.8 mm; the limit is now 320.2 mm.`"""
    rows = {one.id: one for one in data.requirements}
    told = []
    for name in data.outgrown or ():
        if (old := rows[name].old) and (new := rows[name].new):
            had, limit = numbers.held(old.value, old), numbers.limit(new)
            told.append(f"What was chosen before has {name} at {had}; the limit is now {limit}.")
    for name in data.admitted or ():
        if (old := rows[name].old) and (new := rows[name].new):
            has, limit = numbers.held(new.value, new), numbers.limit(old)
            told.append(f"What is chosen now has {name} at {has}; the limit was {limit} before.")
    return tuple(told)


def effect_words(data: Diff | VerdictChanges) -> str:
    """`payload changes, +1 900 EUR, error 12 mm larger, still meets its requirements`."""
    parts = ["payload changes" if data.payload else "same payload"]
    cost, error = data.sums[0], data.error.change
    if cost.change:
        parts.append(signed_change(cost.change, data.currency))
    elif cost.units_differ:
        parts.append(f"price in {cost.unit} (before: {cost.old_unit})")
    if error and abs(error) > 1e-12:
        word = "larger" if error > 0 else "smaller"
        parts.append(f"Syncline error {numbers.error(abs(error), _limits(data)[1])} {word}")
    if None in (data.error.old, data.error.new):  # a side has no design
        parts = []
    return ", ".join([*parts, _verdict_words(data.verdict)])


def _verdict_words(verdict: VerdictChange) -> str:
    if verdict.old == verdict.new:
        return f"still {PREDICATES[verdict.new]}"
    return f"now {PREDICATES[verdict.new]} (before: {PREDICATES[verdict.old]})"


def signed_change(change: float, unit: str) -> str:
    """`+1 900 EUR` or `-12 mm`, the sign typeset; 0 has none."""
    sign = "" if change == 0 else "+" if change > 0 else "\N{MINUS SIGN}"
    return sign + numbers.in_unit(abs(change), unit)


def cause_words(cause: Cause) -> str:
    """`stages[uav].distance 100 m to 60 m`; of a list what came and what went."""
    if cause.old is None:
        return f"{cause.key} added ({_words(_held(cause.new or ''))})"
    if cause.new is None:
        return f"{cause.key} removed ({_words(_held(cause.old))})"
    old, new = _held(cause.old), _held(cause.new)
    if isinstance(old, list) and isinstance(new, list):
        came = [_inner(one) for one in new if one not in old]
        went = [_inner(one) for one in old if one not in new]
        told = [f"{', '.join(some)} {verb}" for some, verb in ((came, "added"), (went, "removed"))
                if some]  # fmt: skip
        if told:
            return f"{cause.key}: {' and '.join(told)}"
    return f"{cause.key} {_words(old)} to {_words(new)}"


def _held(text: str) -> object:
    """The mapping or list that a text holds as JSON; any other text as it is."""
    try:
        found = json.loads(text, parse_float=str, parse_int=str)  # digits as they are written
    except ValueError:
        return text
    return found if isinstance(found, dict | list) else text


def _words(value: object) -> str:
    """`kind mass, limit 3 kg` of a mapping; its id stands in the key already."""
    if isinstance(value, dict):
        return ", ".join(f"{key} {_inner(one)}" for key, one in value.items() if key != "id")
    if isinstance(value, list):
        return ", ".join(map(_inner, value)) or "none"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return "none" if value is None else str(value)


def _inner(value: object) -> str:
    """What stands inside a mapping or a list, in brackets where it is one itself."""
    if isinstance(value, dict):
        return f"({', '.join(f'{key} {_inner(one)}' for key, one in value.items())})"
    return f"[{_words(value)}]" if isinstance(value, list) else _words(value)


def _cause_line(cause: Cause) -> str:
    alone = f"; alone: {effect_words(cause.effect)}" if cause.effect is not None else ""
    return cause_words(cause) + alone


def pick_words(pick: Pick | None) -> str:
    if pick is None:
        return "nothing"
    return f"{pick.name or pick.sensor} ({pick.timestamping}, {pick.primitive})"


def _causes(data: Diff) -> Table | None:
    rows = [
        (cause_words(cause), "" if cause.effect is None else effect_words(cause.effect))
        for cause in data.causes
    ]
    heads = ("Change", "What it does alone")
    return table("What the two files say differently", heads, rows) if rows else None


def _payload(data: Diff) -> Table | None:
    rows = [(one.role, pick_words(one.old), pick_words(one.new)) for one in data.payload]
    heads = ("Role", "Before", "Now")
    return table("Roles whose sensor or timestamping is another one", heads, rows) if rows else None


def _sums(data: Diff) -> Table:
    rows = [_sum_row(figure) for figure in data.sums]
    heads = ("Sum", "Before #", "Now #", "Change #")
    return table("Sums, before and now", heads, [*rows, _error_row(data)])


def _limits(data: Diff | VerdictChanges) -> tuple[Standing | None, Standing | None]:
    """The tightest limit of accuracy on either side."""
    asked = [entry for entry in data.requirements if entry.kind == "accuracy"]
    old, new = (
        min((row for row in rows if row is not None), key=lambda row: row.limit, default=None)
        for rows in ([entry.old for entry in asked], [entry.new for entry in asked])
    )
    return old, new


def _error_row(data: Diff) -> tuple[Cell | str, ...]:
    """The Syncline error on either side, in the unit of the tightest limit that it has there."""
    old, new = _limits(data)
    before, now = numbers.error(data.error.old, old), numbers.error(data.error.new, new)
    change = _change(data.error, now)
    return "Syncline error", Cell(before, data.error.old), Cell(now, data.error.new), change


def _sum_row(figure: FigureChange) -> tuple[Cell | str, ...]:
    now = numbers.in_unit(figure.new, figure.unit)
    return (
        figure.name,
        Cell(numbers.in_unit(figure.old, figure.old_unit), figure.old),
        Cell(now, figure.new),
        _change(figure, now),
    )


def _change(figure: FigureChange, now: str) -> Cell:
    """What a sum changed by, in the unit that it is shown in; of money to the cent."""
    change = figure.change
    if change is None:
        return Cell(numbers.MISSING)
    if figure.unit not in ("m", "kg", "W") or not change:
        return Cell(signed_change(change, figure.unit), change)
    sign = "+" if change > 0 else "\N{MINUS SIGN}"
    return Cell(sign + numbers.like(now, abs(change)), change)


def _margins(data: Diff) -> Table | None:
    rows = [_margin_row(entry) for entry in (*data.requirements, *(data.missions or ()))]
    heads = ("Requirement", "Limits", "Before", "Now")
    return table("Requirements, before and now", heads, rows) if rows else None


def _margin_row(entry: RequirementChange) -> tuple[Cell | str, ...]:
    return (
        Cell(of_mission(entry.mission, entry.id)),
        _limited(entry),
        _standing(entry.old, entry.new),
        _standing(entry.new, entry.old),
    )


def _limited(entry: RequirementChange) -> str:
    """What a requirement limits; its quantile and axis where both sides have the same."""
    told = {(row.quantile, row.axis) for row in (entry.old, entry.new) if row is not None}
    if len(told) > 1:
        return KINDS.get(entry.kind, entry.kind)
    return kind_words(entry.kind, *told.pop())


def _standing(row: Standing | None, other: Standing | None) -> Cell:
    """`0.29 m of 0.3 m` with the requirement's status as colour and symbol.

    other: the same on the other side; a limit that no spec writes has a row of designs alone.
    """
    if row is None:
        implied = other is not None and other.line is None
        return Cell("no design to judge" if implied else "not required")
    state = status_word(row.status, waived=bool(row.waived))
    shown = f"{numbers.held(row.value, row)} of {numbers.limit(row)}"
    return Cell(f"{shown}, {state.word}", row.value, state.tone, state.mark)
