"""A study in words and tables: outcome, least cost, who wins, where feasibility ends."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Final

from syncline_design.machine.sentences import sentence_list
from syncline_design.report import numbers
from syncline_design.report.document import Outcome
from syncline_design.report.table import CORNER, Cell, Table, Tone, table
from syncline_design.report.text import visible
from syncline_design.report.verdict_words import expired_text, kind_text, waiver_text
from syncline_design.report.words import OUTCOMES, VERBS
from syncline_design.spec.yaml_text import plain_scalar
from syncline_design.studies.definition import Factor, figure_of
from syncline_design.studies.result import StudyResult
from syncline_design.studies.summary import (
    CellWord,
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
WAIVED_SIGN: Final = "\N{CIRCLE WITH LEFT HALF BLACK}"
UNPRICED: Final[Mapping[CellWord, tuple[str, Tone, str]]] = {  # text, tone, sign
    "none": ("none", "bad", "\u2717"),
    "undecided": ("not known", "warn", "?"),
    "refused": ("cannot be", "muted", "\N{EN DASH}"),
}
COMBINED = "cannot be as combined"  # a case that is refused
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
        count = Cell(str(len(bases)), float(len(bases)))
        rows.insert(0, [Cell("base"), Cell("base", code=True), count, Cell(_bases(summary))])
    return table("What varies", ["Name", "In the spec", "Values #", "Which"], rows)


def _bases(summary: StudySummary) -> str:
    """`Harbour (12 of 20 meet), Harbour, no wire (none of 20 meets)`."""
    told = []
    for place, base in enumerate(summary.result.study.bases):
        found = [brief.meets for brief in summary.briefs if brief.base == place]
        met = numbers.count(sum(found)) if any(found) else "none"
        many = f"{met} of {numbers.count(len(found))} {'meet' if sum(found) > 1 else 'meets'}"
        told.append(f"{visible(base.name)} ({many})")
    return ", ".join(told)


def _values_of(factor: Factor) -> str:
    """`30 m to 120 m`; what is no figure one by one."""
    shown = [shown_value(factor, label) for label in factor.axis]
    if factor.is_of_figures and len(shown) > MOST_KEYS:
        return f"{shown[0]} to {shown[-1]}"
    more = (
        f" and {numbers.count(len(shown) - MOST_ACROSS)} more" if len(shown) > MOST_ACROSS else ""
    )
    return ", ".join(shown[:MOST_ACROSS]) + more


def outcome(result: StudyResult) -> Outcome:
    """The study's outcome as colour, symbol and word."""
    shown = OUTCOMES[result.verdict]
    words = count_sentence(result) + expired_text(result.expired_waivers)
    if result.expired_waivers and shown.tone == "good":
        return Outcome("warn", "!", words)  # a study may pass whose cases miss what was waived
    return Outcome(shown.tone, shown.mark, words)


def count_sentence(result: StudyResult) -> str:
    """`13 of 25 cases meet their requirements, 12 are infeasible`."""
    verbs = VERBS | {"refused": (COMBINED, COMBINED)}
    counts = result.counts
    met, every = numbers.count(counts["meets"]), numbers.count(len(result))
    parts = [f"{met} of {every} cases {verbs['meets'][counts['meets'] != 1]}"]
    if result.waived:
        parts[0] += f" ({numbers.count(result.waived)} with waived ones missed)"
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
    again = f", {numbers.count(result.retried)} done again after a worker died"
    return (
        f"{numbers.counted(result.computed, 'case')} computed, "
        f"{numbers.count(result.reused)} already there"
        f"{again if result.retried else ''}; kept in {result.store.folder}"
    )


def currency_sentence(summary: StudySummary) -> str:
    """Why there is no least cost; empty where all prices are in one currency."""
    if len(summary.currencies) < 2:
        return ""
    names = sentence_list(list(summary.currencies))
    return f" Prices are in {names}, so there is no least cost among them."


def heat_table(heat: HeatMap) -> Table:
    """Least cost over two factors as a table: across and down, or a row per cell where too wide."""
    across, down = short_key(heat.x), short_key(heat.y)
    names, sides, cells = heat.x_values, heat.y_values, _cost_cells(heat)
    if len(names) > MOST_ACROSS and len(sides) <= MOST_ACROSS:
        across, down, names, sides = down, across, sides, names
        cells = [list(column) for column in zip(*cells, strict=True)]
    if len(names) > MOST_ACROSS:
        return _cell_table(heat)
    heads = [f"{down}{CORNER}{across}", *(f"{text} #" for text in names)]
    rows = [[Cell(name), *line] for name, line in zip(sides, cells, strict=True)]
    return table(LEAST_COST, heads, rows, cell_notes(heat))


def cell_notes(heat: HeatMap, *, signs: bool = True) -> str:
    """What the signs in cells say, where there are any; and what is not known."""
    words = {word for line in heat.cells or () for word in line if signs}
    told = []
    if "waived" in words:
        told.append(f"{WAIVED_SIGN}: with a waived requirement missed.")
    if "refused" in words:
        told.append(f"\N{EN DASH}: {COMBINED}.")
    if heat.undecided:
        many = "1 cell" if heat.undecided == 1 else f"{numbers.count(heat.undecided)} cells"
        told.append(f"In {many} a case got no verdict: what costs less may meet.")
    return " ".join(told)


def _cell_table(heat: HeatMap) -> Table:
    """The cells of a large map that a payload meets, a row each."""
    rows = [
        [Cell(y), Cell(x), cell, Cell(picks)]
        for y, cells, payloads in zip(heat.y_values, _cost_cells(heat), heat.payload, strict=True)
        for x, cell, picks in zip(heat.x_values, cells, payloads, strict=True)
        if cell.sort is not None
    ]
    left = len(heat.x_values) * len(heat.y_values) - len(rows)
    more = max(0, len(rows) - MOST_ROWS)
    note = f"In {numbers.count(left)} cells no case meets." if left else ""
    note += f" {numbers.count(more)} further rows are left out." if more else ""
    note += f" {cell_notes(heat)}"
    heads = (short_key(heat.y), short_key(heat.x), "Least cost #", "Payload")
    return table(LEAST_COST, heads, rows[:MOST_ROWS], note.strip())


def cell_word(heat: HeatMap, x: int, y: int) -> CellWord:
    """What is known of a cell; of a file without these words, by its cost."""
    if heat.cells is not None:
        return heat.cells[y][x]
    return "none" if heat.least_cost[y][x] is None else "meets"


def _cost_cells(heat: HeatMap) -> list[list[Cell]]:
    """A cell for each of the map."""
    return [
        [_cost_cell(cost, cell_word(heat, x, y), heat.currency) for x, cost in enumerate(line)]
        for y, line in enumerate(heat.least_cost)
    ]


def _cost_cell(cost: float | None, word: CellWord, currency: str) -> Cell:
    if cost is None:
        text, tone, sign = UNPRICED[word]
        return Cell(text, tone=tone, mark=sign)
    if word == "waived":
        return Cell(numbers.money(cost, currency), cost, "warn", WAIVED_SIGN)
    return Cell(numbers.money(cost, currency), cost)


def shown_value(factor: Factor, label: str) -> str:
    """A value as it was listed; one that was drawn to four figures, in full in CSV and JSON.

    Shares and amounts of money stay as they are.
    """
    return rounded(label) if factor.origin == "sample" else label


def rounded(label: str) -> str:
    """A value to four figures; shares, amounts of money and words as they are."""
    found = figure_of(plain_scalar(label))
    if found is None or found[1].isupper() or "%" in label:
        return label
    return numbers.like(label, found[0])


def winners_table(summary: StudySummary) -> Table:
    """Which sensor and method is chosen where."""
    several = [short_key(factor.key) for _, factor in varied(summary)]
    rows = [
        [
            Cell(w.role), Cell(w.name), Cell(w.timestamping),
            Cell(numbers.share_of(w.cases, w.of), float(w.cases)),
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
    """Which requirements cases miss, or cannot meet together; in how many, and where."""
    several = [short_key(factor.key) for _, factor in varied(summary)]
    rows = []
    for one in misses(summary, shown_value):
        row, *others = summary.missed[one.requirement]
        rows.append([
            Cell(one.requirement), Cell(kind_text(row)),
            Cell(numbers.share_of(one.cases, len(summary.briefs)),
                 float(one.cases)),
            Cell(numbers.count(one.waived) if one.waived else "", float(one.waived)),
            Cell("; ".join(filter(None, map(waiver_text, (row, *others))))),
            *_where_cells(several, one.where),
        ])  # fmt: skip
    heads = ["Requirement", "Limits", "Fails in #", "Waived in #", "Waiver", *_at(several)]
    return table("Which requirements fail", heads, rows, misses_note(summary))


def misses_note(summary: StudySummary) -> str:
    """What counts as failing in a case without a design, and what does not."""
    together = any(brief.verdict == "infeasible" and brief.failing for brief in summary.briefs)
    note = "Of an infeasible case those that no design meets together." if together else ""
    unsettled = sum(brief.unsettled for brief in summary.briefs)
    if not unsettled:
        return note
    which = "one case" if unsettled == 1 else f"{numbers.count(unsettled)} cases"
    return (
        f"{note} In {which} the time limit was over before it was known which requirements "
        "stand in the way: not counted."
    ).strip()


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
    note = f"{numbers.count(more)} further rows are left out." if more > 0 else ""
    heads = ["Along", "Last value that meets", "Next value", "There", "With"]
    return table("Where feasibility ends", heads, rows, note)


def _with_words(fixed: list[str]) -> str:
    """The combinations that share an end: up to three by name, of more the ends and the number."""
    if len(fixed) <= 3:
        return " | ".join(fixed)
    return f"{numbers.count(len(fixed))} combinations, {fixed[0]} to {fixed[-1]}"
