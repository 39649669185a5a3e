"""A study in words and tables: outcome, least cost, who wins, where feasibility ends."""

from __future__ import annotations

import re
from typing import Final

from syncline_design.machine.sentences import sentence_list
from syncline_design.report import numbers
from syncline_design.report.document import Outcome
from syncline_design.report.table import CORNER, Cell, Table, table
from syncline_design.report.text import visible
from syncline_design.report.verdict_words import expired_text, kind_text, waiver_text
from syncline_design.report.words import OUTCOMES, VERBS
from syncline_design.spec.yaml_text import plain_scalar
from syncline_design.studies.definition import Factor, figure_of
from syncline_design.studies.result import StudyResult
from syncline_design.studies.summary import (
    HeatMap,
    StudySummary,
    boundaries,
    misses,
    varied,
    winners,
)

MOST_ROWS = 200
MOST_ACROSS = 8  # columns of figures in any table: more fit neither page nor console
MOST_DOWN = 20  # of tables on the console
MOST_KEYS = 3  # columns of their own for what varies; of more, one column names them all
LEAST_COST = "Least cost of a payload that meets the requirements"
_NAMED: Final = re.compile(r"([\w.]+)\[([^\]\d][^\]]*)\]\.(.+)")  # by its name, not by a number
_COMBINED = "cannot be as combined"  # a case that is refused
_WHEN = {
    "all": "every case meets its requirements",
    "any": "at least one case meets its requirements",
    "decided": "every case gets an answer",
}


def short_key(key: str) -> str:
    """A key path as a figure and a table name it: `uav.distance`, `ACC-1 limit`."""
    found = _NAMED.fullmatch(key)
    if found is None:
        return key
    place, name, rest = found.groups()
    return f"{name}{'.' if place == 'stages' else ' '}{rest}"


def setting(factor: Factor, label: str) -> str:
    """What a key is set to: `uav.distance 55.06 m`."""
    return f"{short_key(factor.key)} {shown_value(factor, label)}"


def varied_table(summary: StudySummary) -> Table:
    """What varies: short name, key path of the spec, how many values between which ends."""
    rows = [
        [Cell(short_key(factor.key)), Cell(factor.key, code=True),
         Cell(str(len(factor.axis)), float(len(factor.axis))), Cell(_values_of(factor))]
        for _, factor in varied(summary)
    ]  # fmt: skip
    bases = summary.result.study.bases
    if len(bases) > 1:
        rows.insert(
            0,
            [
                Cell("base"),
                Cell("base", code=True),
                Cell(str(len(bases)), float(len(bases))),
                Cell(_bases(summary)),
            ],
        )
    return table("What varies", ["Name", "In the spec", "Values #", "Which"], rows)


def _bases(summary: StudySummary) -> str:
    """`Harbour (12 of 20 meet), Harbour, no wire (none of 20 meets)`."""
    told = []
    for place, base in enumerate(summary.result.study.bases):
        found = [brief.meets for brief in summary.briefs if brief.base == place]
        many = f"{sum(found) or 'none'} of {len(found)} {'meet' if sum(found) > 1 else 'meets'}"
        told.append(f"{visible(base.name)} ({many})")
    return ", ".join(told)


def _values_of(factor: Factor) -> str:
    """`30 m to 120 m`; what is no figure one by one."""
    shown = [shown_value(factor, label) for label in factor.axis]
    if factor.is_of_figures and len(shown) > MOST_KEYS:
        return f"{shown[0]} to {shown[-1]}"
    more = f" and {len(shown) - MOST_ACROSS} more" if len(shown) > MOST_ACROSS else ""
    return ", ".join(shown[:MOST_ACROSS]) + more


def outcome(result: StudyResult) -> Outcome:
    """The study's outcome as colour, symbol and word."""
    shown = OUTCOMES[result.verdict]
    return Outcome(shown.tone, shown.mark, count_sentence(result) + expired_text(result.lapsed))


def count_sentence(result: StudyResult) -> str:
    """`13 of 25 cases meet their requirements, 12 are infeasible`."""
    verbs = VERBS | {"refused": (_COMBINED, _COMBINED)}
    counts = result.counts
    met, every = numbers.count(counts["meets"]), numbers.count(len(result))
    parts = [f"{met} of {every} cases {verbs['meets'][counts['meets'] != 1]}"]
    if result.waived:
        parts[0] += f" ({result.waived} with waived ones missed)"
    others = [(word, n) for word, n in counts.items() if n and word != "meets"]
    parts += [f"{numbers.count(n)} {verbs[word][n > 1]}" for word, n in others]
    return sentence_list(parts)


def rule_sentence(result: StudyResult) -> str:
    """What decides the study's exit code, and what was left out."""
    text = f"The study passes when {_WHEN[result.study.meets_when]}."
    if result.not_simulated:
        many = "are" if len(result.not_simulated) > 1 else "is"
        names = sentence_list(list(result.not_simulated))
        text += f" Without Monte Carlo, as the study asks: {names} {many} left out of every case."
    return text


def stored_text(result: StudyResult) -> str:
    """What was computed and what was there already: it differs from run to run."""
    retried = f", {result.retried} done again after a worker died" if result.retried else ""
    return (
        f"{result.computed} cases computed, {result.reused} already there{retried}; "
        f"kept in {result.store.folder}\n"
    )


def currency_sentence(summary: StudySummary) -> str:
    """Why there is no least cost; empty where all prices are in one currency."""
    if len(summary.currencies) < 2:
        return ""
    names = sentence_list(list(summary.currencies))
    return f" Prices are in {names}, so there is no least cost among them."


def heat_table(heat: HeatMap) -> Table:
    """Least cost over two factors as a table: across and down, or a row per cell where too wide."""
    across, down, costs = short_key(heat.x), short_key(heat.y), heat.least_cost
    names, sides = heat.x_values, heat.y_values
    if len(names) > MOST_ACROSS and len(sides) <= MOST_ACROSS:
        across, down, names, sides = down, across, sides, names
        costs = tuple(zip(*heat.least_cost, strict=True))
    if len(names) > MOST_ACROSS:
        return _cell_table(heat)
    heads = [f"{down}{CORNER}{across}", *(f"{text} #" for text in names)]
    rows = [
        [Cell(name), *(_cost_cell(cost, heat.currency) for cost in line)]
        for name, line in zip(sides, costs, strict=True)
    ]
    return table(LEAST_COST, heads, rows, _undecided_note(heat))


def _undecided_note(heat: HeatMap) -> str:
    """Cells without a cost in which a case got no verdict: not the same as none that meets."""
    return f"In {heat.undecided} cells a case got no verdict." if heat.undecided else ""


def _cell_table(heat: HeatMap) -> Table:
    """The cells of a large map that a payload meets, a row each."""
    rows = [
        [Cell(y), Cell(x), _cost_cell(cost, heat.currency), Cell(picks)]
        for y, costs, payloads in zip(heat.y_values, heat.least_cost, heat.payload, strict=True)
        for x, cost, picks in zip(heat.x_values, costs, payloads, strict=True)
        if cost is not None
    ]
    left = len(heat.x_values) * len(heat.y_values) - len(rows)
    more = max(0, len(rows) - MOST_ROWS)
    note = f"In {left} cells no case meets." if left else ""
    note += f" {more} further rows are left out." if more else ""
    note += f" {_undecided_note(heat)}"
    heads = (short_key(heat.y), short_key(heat.x), "Least cost #", "Payload")
    return table(LEAST_COST, heads, rows[:MOST_ROWS], note.strip())


def _cost_cell(cost: float | None, currency: str) -> Cell:
    if cost is None:
        return Cell("none", tone="bad", mark="\u2717")
    return Cell(numbers.money(cost, currency), cost)


def shown_value(factor: Factor, label: str) -> str:
    """A value as it was listed; one that was drawn to four figures, in full in CSV and JSON.

    Shares and amounts of money stay as they are.
    """
    found = figure_of(plain_scalar(label)) if factor.origin == "sample" else None
    if found is None or found[1].isupper() or "%" in label:
        return label
    return numbers.like(label, found[0])


def winners_table(summary: StudySummary) -> Table:
    """Which sensor and method is chosen where."""
    several = [short_key(factor.key) for _, factor in varied(summary)]
    rows = [
        [
            Cell(w.role), Cell(w.name), Cell(w.timestamping),
            Cell(f"{w.cases} of {w.of}", float(w.cases)),
            *_where_cells(several, w.where, everywhere=w.cases == w.of),
        ]
        for w in winners(summary, shown_value)
    ]  # fmt: skip
    heads = ["Role", "Sensor", "Timestamping", "Chosen in #", *_at(several)]
    caption = "Which sensor and method wins where, of the cases that meet"
    return table(caption, heads, rows, named_by=1)


def _at(keys: list[str]) -> list[str]:
    return [f"At {key}" for key in keys] if len(keys) <= MOST_KEYS else ["At"]


def _where_cells(
    keys: list[str], where: tuple[str, ...], *, everywhere: bool = False
) -> list[Cell]:
    """A cell per key, or one that leaves out the keys over all of whose values it is so."""
    if len(keys) <= MOST_KEYS:
        return [Cell(text) for text in where]
    if everywhere:
        return [Cell("every case that meets")]
    told = [f"{key} {text}" for key, text in zip(keys, where, strict=True) if text != "everywhere"]
    return [Cell("; ".join(told) or "everywhere")]


def misses_table(summary: StudySummary) -> Table:
    """Which requirements designs fail, in how many cases and where."""
    several = [short_key(factor.key) for _, factor in varied(summary)]
    rows = []
    for one in misses(summary, shown_value):
        row = summary.missed[one.requirement]
        rows.append([
            Cell(one.requirement), Cell(kind_text(row)),
            Cell(f"{one.cases} of {one.of}", float(one.cases)), Cell(waiver_text(row)),
            *_where_cells(several, one.where),
        ])  # fmt: skip
    heads = ["Requirement", "Limits", "Fails in #", "Waiver", *_at(several)]
    return table("Which requirements fail", heads, rows)


def boundary_table(summary: StudySummary, most: int = MOST_ROWS) -> Table:
    """Where feasibility ends along each factor; equal ends are one row."""
    ends: dict[tuple[str, str, str, str], list[str]] = {}
    for b in boundaries(summary):
        fixed = "; ".join(f"{short_key(key)} {value}" for key, value in b.fixed.items())
        ends.setdefault((short_key(b.factor), b.met, b.missed, b.why), []).append(fixed)
    rows = [
        [*map(Cell, end), Cell(_with_words(fixed), float(len(fixed)))]
        for end, fixed in list(ends.items())[:most]
    ]
    more = len(ends) - most
    note = f"{more} further rows are left out." if more > 0 else ""
    heads = ["Along", "Last value that meets", "Next value", "There", "With"]
    return table("Where feasibility ends", heads, rows, note)


def _with_words(fixed: list[str]) -> str:
    """The combinations that share an end: up to three by name, of more the ends and the number."""
    if len(fixed) <= 3:
        return " | ".join(fixed)
    return f"{len(fixed)} combinations, {fixed[0]} to {fixed[-1]}"
