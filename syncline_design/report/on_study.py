"""What `study` says: outcome, least cost, who wins, where feasibility ends, fronts, cases."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from functools import partial

from syncline_design import __version__
from syncline_design.machine.sentences import sentence_list
from syncline_design.report import charts_along, charts_study, numbers
from syncline_design.report.document import (
    Chart,
    Document,
    Group,
    Items,
    Node,
    Outcome,
    Section,
    Text,
    given,
    provenance,
    section,
    show,
)
from syncline_design.report.study_words import (
    LEAST_COST,
    MOST_DOWN,
    MOST_KEYS,
    boundary_table,
    cell_notes,
    currency_sentence,
    heat_table,
    misses_table,
    outcome,
    rule_sentence,
    setting,
    short_key,
    shown_value,
    varied_table,
    winners_table,
)
from syncline_design.report.svg import InlineChart
from syncline_design.report.table import Cell, Table, table
from syncline_design.report.text import visible
from syncline_design.report.verdict_words import JUDGED_ON, with_waived
from syncline_design.report.words import OUTCOMES
from syncline_design.spec.yaml_text import plain_scalar
from syncline_design.studies.definition import Factor, figure_of
from syncline_design.studies.result import StudyResult
from syncline_design.studies.scatter import Scatter, along, scatter
from syncline_design.studies.summary import (
    Brief,
    HeatMap,
    StudyFront,
    StudySummary,
    heat_map,
    varied,
)
from syncline_design.studies.table import reason

MOST_CASES = 500  # rows of the case table; CSV and Parquet have them all
MOST_OPEN = 60  # rows of a table that is not folded away
MOST_FRONTS = 8


def on_study(result: StudyResult) -> Document:
    """A study as a document: what holds, least cost, who wins, where it ends, fronts, cases."""
    summary = result.summary
    note = (given(result.study.note),) if result.study.note else ()
    winners = show(winners_table(summary), silent=True)
    cases = show(_case_table(summary), silent=True, reach="page")
    if len(summary.briefs) > MOST_OPEN:
        count = numbers.count(min(len(summary.briefs), MOST_CASES))
        words = f"The first {count} cases" if len(summary.briefs) > MOST_CASES else f"{count} cases"
        cases = [Group(tuple(cases), "fold", summary=words, reach="page")]
    return Document(
        family="Trade study",
        outcome=outcome(result),
        name=result.study.name,
        sentences=(rule_sentence(result) + currency_sentence(summary), *note),
        facts=tuple(_facts(result)),
        sections=(
            *section("heat", LEAST_COST, _heat(summary), "Least cost"),
            *_sampled(summary),
            *section("along", _along_heading(summary), _along(summary), "One by one"),
            *section("winners", "Which sensor and method wins where, of the cases that meet",
                     winners, "What wins where"),
            *section("misses", "Which requirements fail",
                     _missed(summary), "What fails"),
            *section("refused", "Which cases cannot be as combined", _refused(summary),
                     "Refused"),
            *section("ends", "Where feasibility ends", _ends(summary), "Where it ends"),
            *section("fronts", "Cost against error, front by case", _fronts(summary), "Fronts"),
            *section("cases", "Cases", cases),
            *section("varied", "What varies", show(varied_table(summary), silent=True)),
            *provenance(_provenance(result)),
        ),
    )  # fmt: skip


def _heat(summary: StudySummary) -> list[Node]:
    """Least cost over two factors; on a terminal only where its table is short."""
    heat = heat_map(summary)
    if heat is None:
        return []
    shown = heat_table(heat)
    fine = charts_study.is_fine(heat)
    sign = "Hatched" if fine else "A cross"
    caption = (
        "Least cost of a payload that meets the requirements; the stronger the colour, the dearer. "
        f"{sign}: computed, and no case is known to meet."
    )
    caption = f"{caption} {cell_notes(heat, signs=not fine)}".strip()
    if least := _collapsed(summary, heat):
        caption, shown = f"{caption} {least}", replace(shown, note=f"{shown.note} {least}".strip())
    short = show(shown, silent=True, reach="text")
    whole = show(shown, silent=True, reach="page")
    if len(shown.rows) > MOST_DOWN:
        size = f"{len(heat.x_values)} by {len(heat.y_values)} values"
        short = [Text(f"Over {size}: see the page or the CSV table.", reach="text")]
        whole = [Group(tuple(whole), "fold", summary=f"As a table, {size}", reach="page")]
    return [Chart("heat", lambda: charts_study.cost_map(heat), caption), *whole, *short]


def _collapsed(summary: StudySummary, heat: HeatMap) -> str:
    """What varies besides the two factors of a map, of which a cell has the cheapest."""
    others = [short_key(f.key) for _, f in varied(summary) if f.key not in (heat.x, heat.y)]
    if len(summary.result.study.bases) > 1:
        others.insert(0, "base")
    return f"Of all values of {sentence_list(others)} the case that costs least." if others else ""


def _sampled(summary: StudySummary) -> list[Section]:
    """Cases over two factors, where these are no grid or too fine a one for a map."""
    currency, *others = summary.currencies
    if others or heat_map(summary) is not None:
        return []
    found = scatter(summary)
    if found is None:
        return []

    def draw() -> InlineChart:
        several = varied(summary)
        briefs = [summary.briefs[point.number - 1] for point in found.points]
        says = [_says(one, several, summary.accuracy) for one in briefs]
        return charts_study.sampled_cases(found, currency, says)

    title = f"Cases over {visible(short_key(found.x.key))} and {visible(short_key(found.y.key))}"
    name = "sampled" if found.sampled else "plane"
    return section(name, title, [Chart(name, draw, _sampled_caption(found))], "Map of cases")


def _along_heading(summary: StudySummary) -> str:
    keys = [short_key(factor.key) for _, factor in varied(summary)]
    return f"Price and error over {visible(sentence_list(keys))}"


def _along(summary: StudySummary) -> list[Node]:
    """Every case over the one key that varies."""
    currency, *others = summary.currencies
    found = along(summary)
    if others or found is None:
        return []
    bases = summary.result.study.bases
    named = [[("Base", visible(bases[b.base].name))] if bases[1:] else [] for b in summary.briefs]

    def draw() -> InlineChart:
        several = varied(summary)
        says = [[*base, *_says(b, several, summary.accuracy)]
                for base, b in zip(named, summary.briefs, strict=True)]  # fmt: skip
        return charts_along.over_key(found, currency, summary.accuracy, says)

    caption = "What each case chose, only where a case was computed."
    if any(point.error_m is None for point in found.points):
        caption += " Along the edge: no design, or none that is known."
    return [Chart("along", draw, caption)]


def _says(
    brief: Brief, several: list[tuple[int, Factor]], limit: numbers.Limited | None
) -> list[tuple[str, str]]:
    """A case in words: number, setting, answer, price, error, payload."""
    values = [(short_key(f.key), shown_value(f, brief.labels[i])) for i, f in several]
    found = [("Case", str(brief.number)), *values, ("Verdict", _ended(brief).word)]
    if failing := _failing(brief):
        found.append(("Fails", failing))
    if brief.cost is not None:
        found.append(("Price", numbers.money(brief.cost, brief.currency)))
    if brief.error_m is not None:
        found.append(("Error", numbers.error(brief.error_m, limit)))
    return [*found, ("Payload", ", ".join(pick.name for pick in brief.picks))]


def _ends(summary: StudySummary) -> list[Node]:
    return [
        *show(boundary_table(summary), silent=True, reach="page"),
        *show(boundary_table(summary, MOST_DOWN), silent=True, reach="text"),
    ]


def _fronts(summary: StudySummary) -> list[Node]:
    chosen = _distinct_fronts(summary)
    nodes: list[Node] = []
    if len({front.currency for front in chosen}) == 1:
        named = [charts_study.NamedFront(_name(summary, f)[0], f.points) for f in chosen]
        draw = partial(charts_study.fronts, named, chosen[0].currency, summary.accuracy)
        caption = "Exact fronts: what each accuracy costs."
        if len(summary.fronts) > MOST_FRONTS:
            caption = "Eight of the fronts are drawn; the table has all that differ."
        nodes.append(Chart("fronts", draw, caption))
    return [*nodes, *show(_fronts_table(summary), silent=True, reach="page")]


def _facts(result: StudyResult) -> list[tuple[str, str]]:
    counts = result.counts
    names = {"meets": "Meet", "fails": "Fail", "infeasible": "Infeasible", "refused": "Refused",
             "indeterminate": "No verdict"}  # fmt: skip
    facts = [("Cases", numbers.count(len(result)))]
    return facts + [(names[word], numbers.count(n)) for word, n in counts.items() if n]


def _distinct_fronts(summary: StudySummary) -> list[StudyFront]:
    """At most eight fronts, spread evenly over all that differ."""
    found = list(summary.fronts)
    if len(found) <= MOST_FRONTS:
        return found
    step = (len(found) - 1) / (MOST_FRONTS - 1)
    return [found[round(place * step)] for place in range(MOST_FRONTS)]


def _common(summary: StudySummary, front: StudyFront) -> str:
    """What the cases that share a front have in common: that is what tells it from others."""
    chosen = [summary.briefs[number - 1] for number in front.cases]
    parts = []
    if len(summary.result.study.bases) > 1 and len({b.base for b in chosen}) == 1:
        parts.append(summary.result.study.bases[chosen[0].base].name)
    for place, factor in varied(summary):
        values = {brief.labels[place] for brief in chosen}
        if len(values) == 1:
            parts.append(setting(factor, values.pop()))
    if parts:
        return visible(", ".join(parts))
    if len(chosen) == len(summary.briefs):
        return "every case"
    return f"case {chosen[0].number} and {numbers.count(len(chosen) - 1)} more"


def _name(summary: StudySummary, front: StudyFront) -> tuple[str, str]:
    """What a front is called in a legend, and in full where that is too long for one."""
    words = _common(summary, front)
    if len(words) <= charts_study.MOST_LABEL:
        return words, ""
    if len(front.cases) == 1:
        return f"case {front.cases[0]}", words
    return f"front {summary.fronts.index(front) + 1}", words


def _fronts_table(summary: StudySummary) -> Table:
    rows, limit = [], summary.accuracy
    for front in summary.fronts:
        cheapest, finest = front.points[0], front.points[-1]
        currency, (called, words) = front.currency, _name(summary, front)
        rows.append((
            Cell(called, sub=words),
            Cell(numbers.count(len(front.cases)), float(len(front.cases))),
            Cell(numbers.count(len(front.points)), float(len(front.points))),
            Cell(numbers.money(cheapest.cost, currency), cheapest.cost),
            Cell(numbers.error(cheapest.error_m, limit), cheapest.error_m),
            Cell(numbers.money(finest.cost, currency), finest.cost),
            Cell(numbers.error(finest.error_m, limit), finest.error_m),
        ))  # fmt: skip
    heads = ("With", "Cases #", "Points #", "Cheapest #", "its error #", "Most accurate: cost #",
             "its error #")  # fmt: skip
    note = (
        "Each front is exact, over all payloads that meet every requirement but accuracy; cases "
        "that differ only in limits on accuracy share it."
    )
    return table("Fronts of cost against error", heads, rows, note)


def _figure(brief: Brief, place: int) -> float | None:
    found = figure_of(plain_scalar(brief.labels[place]))
    return None if found is None else found[0]


def _sampled_caption(data: Scatter) -> str:
    """What the marks mean; only of those that are there."""
    told = ["Computed cases only."]
    costs = {point.cost for point in data.points if point.cost is not None}
    if any(point.verdict == "meets" for point in data.points):
        stronger = ", the stronger its colour the dearer" if len(costs) > 1 else ""
        told.append(f"A filled mark meets its requirements{stronger}.")
    if any(point.verdict in ("fails", "infeasible") for point in data.points):
        told.append("A cross does not meet its requirements.")
    if others := sentence_list([short_key(key) for key in data.others]):
        shape = ", which the shapes of filled marks tell" if data.kinds else ""
        told.append(f"What varies besides: {others}{shape}.")
    return " ".join(told)


def _case_table(summary: StudySummary) -> Table:
    result, limit = summary.result, summary.accuracy
    several = varied(summary)
    many = len(result.study.bases) > 1
    rows = []
    for brief in summary.briefs[:MOST_CASES]:
        shown = _ended(brief)
        payload = ", ".join(pick.name for pick in brief.picks)
        why = payload or visible(reason(result.case(brief.number - 1)))
        named = [Cell(result.study.bases[brief.base].name)] if many else []
        rows.append([
            Cell(str(brief.number), float(brief.number)), *named,
            *_setting_cells(brief, several),
            Cell(shown.word, tone=shown.tone, mark=shown.mark, sub=_failing(brief)),
            Cell(numbers.money(brief.cost, brief.currency), brief.cost),
            Cell(numbers.error(brief.error_m, limit), brief.error_m),
            Cell(why),
        ])  # fmt: skip
    few = len(several) <= MOST_KEYS
    keys = [_head(factor) for _, factor in several] if few else ["Setting"]
    varying = [*(["Base"] if many else []), *keys]
    ends = ["Verdict", "Price #", "Syncline error #", "Payload, or why there is none"]
    heads = ["Case #", *varying, *ends]
    more = len(summary.briefs) - MOST_CASES
    note = (
        f"{numbers.count(more)} further cases are in the CSV and Parquet tables."
        if more > 0
        else ""
    )
    return table("All cases", heads, rows, note)


def _ended(brief: Brief) -> Outcome:
    """How a case ended, in the words of legend and headline, and what of it is waived."""
    word = "no verdict" if brief.verdict == "indeterminate" else brief.verdict
    return with_waived(replace(OUTCOMES[brief.verdict], word=word), brief.waived)


def _refused(summary: StudySummary) -> list[Node]:
    """Why cases cannot be as combined, each reason once."""
    cases = (summary.result.case(b.number - 1) for b in summary.briefs if b.verdict == "refused")
    count = Counter(visible(reason(case)) for case in cases)
    told = [f"{why} ({numbers.count(n)} of {numbers.count(len(summary.briefs))})"
            for why, n in count.most_common(MOST_DOWN)]  # fmt: skip
    left = len(count) - len(told)
    more = [f"and {numbers.count(left)} further reasons: see the CSV"] if left else []
    return [Items((*told, *more))] if told else []


def _missed(summary: StudySummary) -> list[Node]:
    found = misses_table(summary)
    return show(found, silent=True) or ([Text(found.note)] if found.note else [])


def _failing(brief: Brief) -> str:
    """Ids of what its design fails, where no word beside them says so."""
    return ", ".join(visible(one) for one in brief.failing if one not in brief.waived)


def _head(factor: Factor) -> str:
    """A key above its values: figures are set flush right."""
    return f"{short_key(factor.key)}{' #' if factor.is_of_figures else ''}"


def _setting_cells(brief: Brief, several: list[tuple[int, Factor]]) -> list[Cell]:
    """What varies: a cell per key, or one cell that names them all."""
    if len(several) <= MOST_KEYS:
        return [Cell(shown_value(f, brief.labels[i]), _figure(brief, i)) for i, f in several]
    return [Cell("; ".join(setting(f, brief.labels[i]) for i, f in several))]


def _provenance(result: StudyResult) -> list[tuple[str, str]]:
    facts = [
        ("Version", __version__),
        ("Study", str(result.study.path)),
        ("SHA-256 of the study", result.study.sha256),
        ("Seed", str(result.seed)),
    ]
    for base in result.study.bases:
        facts.append((f"SHA-256 of {base.path}", base.document.sha256))
        facts.append((f"SHA-256 of the catalogs of {base.path}", base.catalogs.sha256()))
    if result.judged_on:
        facts.append((JUDGED_ON, result.judged_on))
    return facts
