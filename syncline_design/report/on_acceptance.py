"""What `accept` says: one row an assumption, what is broken first."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

from syncline_design.comparison.acceptance import (
    Acceptance,
    AssumptionResult,
    AssumptionStatus,
    MeasuredFigure,
    OneOfThese,
    SuspectedWay,
)
from syncline_design.comparison.assumptions import DEPARTING
from syncline_design.machine.sentences import sentence_list
from syncline_design.report import numbers
from syncline_design.report.ci import Level, Notice
from syncline_design.report.columns import alike
from syncline_design.report.document import (
    Document,
    Items,
    Node,
    Outcome,
    given,
    provenance,
    section,
    show,
)
from syncline_design.report.formats import ACCEPT_FORMATS as ACCEPT_FORMATS
from syncline_design.report.github import github_command, github_notice
from syncline_design.report.junit import junit_text, suite_of
from syncline_design.report.rendered import rendered
from syncline_design.report.sarif import sarif_log
from syncline_design.report.table import Cell, Table, Tone, table
from syncline_design.report.verdict_words import pinned_by

_OUTCOMES: Final[dict[AssumptionStatus, tuple[Tone, str, str]]] = {
    "holds": ("good", "\u2713", "holds"),
    "broken": ("bad", "\u2717", "broken"),
    "not_shown": ("warn", "!", "not shown"),
}
_ONE_OF: Final[tuple[Tone, str, str]] = ("bad", "?", "one of these")
_ORDER: Final[tuple[AssumptionStatus, ...]] = ("broken", "not_shown", "holds")
_LEVELS: Final[dict[AssumptionStatus, Level]] = {
    "holds": "pass",
    "broken": "fail",
    "not_shown": "undecided",
}
_WORDS: Final[dict[AssumptionStatus, str]] = {
    "holds": "What was asked holds",
    "broken": "An assumption is broken",
    "not_shown": "Not everything is shown by these logs",
}


def on_acceptance(result: Acceptance) -> Document:
    """The outcome as a document."""
    return Document(
        family="Acceptance",
        outcome=_outcome(result),
        name=result.spec.name,
        source=result.spec.file,
        sentences=tuple(_sentences(result)),
        facts=(),
        sections=(
            *section("assumptions", "What the verdict rests on, against the evidence",
                     show(assumptions_table(result.assumptions), silent=True), "Assumptions"),
            *section("groups", "One of these is broken", _groups(result), "One of these"),
            *section("notes", "What the logs said besides", _notes(result), "Notes"),
            *section("evidence", "Evidence", show(_evidence(result), silent=True)),
            *provenance(_provenance(result)),
        ),
        title=f"Acceptance: {result.spec.name}",
    )  # fmt: skip


def _provenance(result: Acceptance) -> list[tuple[str, str]]:
    """What the figures are pinned by, the spec's content where it is known."""
    if result.spec.provenance is not None:
        return [("Spec file", result.spec.file), *pinned_by(result.spec.provenance)]
    return [("syncline-design", result.version), ("Seed", str(result.seed))]


def _outcome(result: Acceptance) -> Outcome:
    tone, mark, _ = _OUTCOMES[result.verdict]
    if result.spec.verdict != "meets":
        return Outcome(tone, mark, "The spec does not meet its requirements on paper")
    if result.groups and not any(row.status == "broken" for row in result.assumptions):
        return Outcome(tone, mark, "An assumption is broken, and the log cannot tell which")
    return Outcome(tone, mark, _WORDS[result.verdict])


def _sentences(result: Acceptance) -> Iterator[str]:
    rows = result.assumptions
    alone = [r.status for r in rows if r.one_of is None]
    counts = {s: alone.count(s) for s in _ORDER}
    words = {s: _OUTCOMES[s][2] if n == 1 or s != "holds" else "hold" for s, n in counts.items()}
    of = [f"at least one of {len(one.rows)} broken" for one in result.groups]
    if of:  # no row of a group is shown to be the one
        words["not_shown"] = f"more {words['not_shown']}"
    told = ", ".join([*of, *(f"{n} {words[s]}" for s, n in counts.items())])
    noun = "assumption" if len(rows) == 1 else "assumptions"
    yield f"Of {len(rows)} {noun} of the verdict: {told}."
    yield from (sentence(row) for row in rows if row.status == "broken")
    for one in result.groups:
        yield group_sentence(result, one)
        yield f"Look first at {one.look_first}.{_by_driving(one)}"


def _by_driving(group: OneOfThese) -> str:
    if group.tell_apart is None:
        return " No drive tells these apart: measure them on the vehicle."
    return f" The drive that tells it from the others: {group.tell_apart}"


def group_sentence(result: Acceptance, group: OneOfThese) -> str:
    """`at least one of these is broken, and the log cannot tell which: uav position latency, ..`"""
    rows = {row.name: row for row in result.assumptions}
    members = [rows[name] for name in group.rows]
    told = ", ".join(f"{_place(row)}{_if_known(row)}" for row in members)
    beside = dict.fromkeys(p.text for way in group.ways for p in way.departures if not p.rows)
    others = f", or no row but {' or '.join(beside)}" if beside else ""
    return (f"at least one of these is broken, and the log cannot tell which: {told}{others}; of "
            f"several at once each may be of another size (found: {group.evidence}).")  # fmt: skip


def _if_known(row: AssumptionResult) -> str:
    value = None if row.measured is None else row.measured.value
    return "" if value is None else f" ({_figure(value, row.unit)})"


def _place(row: AssumptionResult) -> str:
    return f"{row.stage} {row.role} {row.assumption.replace('_', ' ')}"


def sentence(row: AssumptionResult) -> str:
    """`uav position latency is broken: ...; measured 87 ms (...), assumed 0 s`."""
    figures = ""
    if row.measured is not None and row.measured.value is not None:
        figures = f"; measured {_measured(row)}, assumed {_figure(row.assumed, row.unit)}"
    if row.one_of is not None:
        if figures:
            figures = f"; it would be {_measured(row)}, assumed {_figure(row.assumed, row.unit)}"
        return f"{_place(row)} is one of several that may be broken: {row.evidence}{figures}."
    verb = "" if row.status == "holds" else "is "
    return f"{_place(row)} {verb}{_OUTCOMES[row.status][2]}: {row.evidence}{figures}."


def _figure(value: float | None, unit: str) -> str:
    if value is None:
        return ""
    return numbers.number(value) if unit == "1" else numbers.si_quantity(value, unit)


def _measured(row: AssumptionResult) -> str:
    """`87.0 ms (86.7 ms to 87.2 ms)`: figure and interval to the same place."""
    found = row.measured or MeasuredFigure(None)
    text = _figure(found.value, row.unit)
    if found.low is None or found.high is None:
        return text
    three = (found.value, found.low, found.high)
    text, low, high = alike([(_figure(value, row.unit), value) for value in three])
    return f"{text} ({low} to {high})"


def assumptions_table(assumptions: Sequence[AssumptionResult]) -> Table:
    """A row an assumption, headed by whose it is."""
    rows = []
    for row in sorted(assumptions, key=_first_told):
        tone, mark, word = _OUTCOMES[row.status] if row.one_of is None else _ONE_OF
        value = None if row.measured is None else row.measured.value
        rows.append((
            Cell(word, None, tone, mark),
            Cell(f"{row.stage} \u00b7 {row.role}: {row.assumption.replace('_', ' ')}"),
            Cell(_figure(row.assumed, row.unit), row.assumed),
            Cell(_measured(row), value),
            Cell(row.evidence),
        ))  # fmt: skip
    heads = (
        "Status",
        "Assumption",
        "Assumed #",
        "Measured (95 %) #",
        "Evidence",
    )
    departing = {row.assumption for row in assumptions} & set(DEPARTING)
    names = [one.replace("_", " ") for one in DEPARTING if one in departing]
    note = f"Of {sentence_list(names)}: what departs from the spec." if names else ""
    return table("Assumptions", heads, rows, note, named_by=1)


def _first_told(row: AssumptionResult) -> tuple[int, int]:
    """Broken rows, then those of which one is, by their groups, then the others."""
    if row.one_of is not None:
        return 0, row.one_of
    return _ORDER.index(row.status), 0


def _groups(result: Acceptance) -> list[Node]:
    """What explains what was found, a row a way, the likelier first."""
    ways = [
        way for one in result.groups
        for way in sorted(one.ways, key=lambda each: -(each.probability or 0.0))
    ]  # fmt: skip
    heads = ("Would break", "It would be", "Odds #")
    return [*show(table("One of these", heads, map(_way, ways)), silent=True)]


def _way(way: SuspectedWay) -> tuple[Cell, ...]:
    names = [name.replace("_", " ") for part in way.departures for name in part.rows]
    odds = "" if way.probability is None else numbers.percent(way.probability, 2)
    return (
        Cell(" and ".join(names) or "no row of the spec"),
        Cell(" with ".join(part.text for part in way.departures)),
        Cell(odds, way.probability),
    )


def _notes(result: Acceptance) -> list[Node]:
    return [Items(tuple(given(note) for note in result.notes))] if result.notes else []


def _evidence(result: Acceptance) -> Table:
    rows = [
        (Cell(one.file), Cell(one.read_as), Cell(one.of), Cell(one.sha256, code=True))
        for one in result.evidence
    ]
    return table("Evidence", ("File", "Read as", "Of", "SHA-256"), rows)


def acceptance_notices(result: Acceptance) -> list[Notice]:
    """One finding an assumption, at its place in the spec; and a spec that fails on paper."""
    file = result.spec.file
    found = [
        Notice(_LEVELS[row.status], row.assumption, f"{row.stage}/{row.role}", file, row.line,
               row.column, sentence(row))
        for row in result.assumptions
    ]  # fmt: skip
    found += [_group_notice(result, one) for one in result.groups]
    if result.spec.verdict != "meets":
        text = f"on paper the verdict is {result.spec.verdict}: there is nothing to accept"
        found.insert(0, Notice("fail", "spec", "", file, 1, 1, text))
    return found


def _group_notice(result: Acceptance, group: OneOfThese) -> Notice:
    """At the place of the row to look at first."""
    first = next(row for row in result.assumptions if row.name == group.rows[0])
    text = f"{group_sentence(result, group)} Look first at {group.look_first}."
    return Notice("fail", "one_of", " or ".join(group.rows), result.spec.file, first.line,
                  first.column, text + _by_driving(group))  # fmt: skip


def render_acceptance(name: str, result: Acceptance) -> str:
    """The text of one format."""
    match name:
        case "junit" | "sarif" | "github":
            return _for_ci(name, result)
        case _:
            return rendered(name, result, lambda: on_acceptance(result))


def _for_ci(name: str, result: Acceptance) -> str:
    found = acceptance_notices(result)
    told = [one for one in found if one.level != "pass"]
    word = _outcome(result).word
    spec = result.spec
    match name:
        case "junit":
            return junit_text([suite_of(spec.name, spec.file, found, word)])
        case "sarif":
            return sarif_log(told)
        case "github":
            text = f"{word}. {next(_sentences(result))}"
            lines = [github_command(one) for one in told]
            return "\n".join([*lines, github_notice(spec.name, spec.file, text)]) + "\n"
        case _:
            raise ValueError(f"unknown format {name}")
