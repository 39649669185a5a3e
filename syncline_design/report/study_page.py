"""A study as one offline HTML page."""

from __future__ import annotations

from typing import Any

from syncline_design import __version__
from syncline_design.report import figures_study, numbers, page
from syncline_design.report.study_rows import reason, si_unit
from syncline_design.report.study_words import (
    boundary_table,
    heat_table,
    outcome,
    rule_sentence,
    winners_table,
)
from syncline_design.report.tables import Cell, Table, table
from syncline_design.report.text import visible
from syncline_design.report.verdict_words import OUTCOMES
from syncline_design.study.factors import figure_of
from syncline_design.study.result import StudyResult
from syncline_design.study.summary import Brief, Front, Summary, heat_map, summarise, varied

MOST_CASES = 500  # rows of the case table; CSV and Parquet have them all
MOST_FRONTS = 8


def render_study_page(result: StudyResult) -> str:
    """The page of a study: what holds, least cost, who wins, where it ends, fronts, cases."""
    summary = summarise(result)
    currency = result.study.bases[0].currency
    heat = heat_map(summary)
    shown = outcome(result)
    fronts = _distinct_fronts(summary)
    ends = boundary_table(summary)
    parts = {
        "heat": heat is not None,
        "sampled": heat is None and _sampled(summary) is not None,
        "winners": True,
        "ends": bool(ends.rows),
        "fronts": bool(fronts),
        "cases": True,
        "provenance": True,
    }
    titles = {
        "heat": "Least cost", "sampled": "Sample", "winners": "What wins where",
        "ends": "Where it ends", "fronts": "Fronts", "cases": "Cases", "provenance": "Provenance",
    }  # fmt: skip
    return page.render_page(
        "study.html.j2",
        kind="Trade study",
        name=visible(result.study.name),
        note=visible(result.study.note),
        contents=[(key, title) for key, title in titles.items() if parts[key]],
        outcome=shown,
        rule=rule_sentence(result),
        facts=_facts(result),
        heat_figure=_svg(figures_study.cost_map(heat, currency)) if heat is not None else None,
        heat_table=heat_table(heat, currency) if heat is not None else None,
        sampled_figure=_sampled_figure(summary) if parts["sampled"] else None,
        winners=winners_table(summary),
        ends=ends if ends.rows else None,
        fronts_figure=_fronts_figure(summary, fronts, currency) if fronts else None,
        fronts_table=_fronts_table(summary, currency) if fronts else None,
        cases=_case_table(summary, currency),
        provenance=_provenance(result),
    )


def _svg(figure: Any) -> Any:
    return page.trusted_svg(figure.svg)


def _facts(result: StudyResult) -> list[tuple[str, str]]:
    counts = result.counts
    names = {"meets": "Meet", "fails": "Fail", "infeasible": "Infeasible", "refused": "Refused",
             "indeterminate": "No verdict"}  # fmt: skip
    facts = [("Cases", numbers.count(len(result)))]
    return facts + [(names[word], numbers.count(n)) for word, n in counts.items() if n]


def _distinct_fronts(summary: Summary) -> list[Front]:
    """At most eight fronts, spread evenly over all that differ."""
    found = list(summary.fronts)
    if len(found) <= MOST_FRONTS:
        return found
    step = (len(found) - 1) / (MOST_FRONTS - 1)
    return [found[round(place * step)] for place in range(MOST_FRONTS)]


def _common(summary: Summary, front: Front) -> str:
    """What the cases that share a front have in common: that is what tells it from others."""
    chosen = [summary.briefs[number - 1] for number in front.cases]
    parts = []
    if len(summary.result.study.bases) > 1 and len({b.base for b in chosen}) == 1:
        parts.append(summary.result.study.bases[chosen[0].base].name)
    for place, factor in varied(summary):
        values = {brief.labels[place] for brief in chosen}
        if len(values) == 1:
            parts.append(f"{factor.key} = {values.pop()}")
    return visible(", ".join(parts)) or "every case"


def _fronts_figure(summary: Summary, chosen: list[Front], currency: str) -> Any:
    named = [figures_study.NamedFront(_common(summary, f), f.points) for f in chosen]
    return _svg(figures_study.fronts(named, currency))


def _fronts_table(summary: Summary, currency: str) -> Table:
    rows = []
    for front in summary.fronts:
        (least, worst), (most, best) = front.points[0], front.points[-1]
        rows.append((
            Cell(_common(summary, front)),
            Cell(numbers.count(len(front.cases)), float(len(front.cases))),
            Cell(numbers.count(len(front.points)), float(len(front.points))),
            Cell(numbers.money(least, currency), least), Cell(numbers.length(worst), worst),
            Cell(numbers.money(most, currency), most), Cell(numbers.length(best), best),
        ))  # fmt: skip
    heads = ("With", "Cases #", "Points #", "Cheapest #", "its error #", "Most accurate: cost #",
             "its error #")  # fmt: skip
    note = (
        "Each front is exact, over all payloads that meet every requirement but accuracy; cases "
        "that differ only in limits on accuracy share it."
    )
    return table("Fronts of cost against error", heads, rows, note)


def _sampled(summary: Summary) -> figures_study.Sampled | None:
    """Two numeric factors to place the cases in, when there is no grid for a heat map."""
    numeric = [(i, f) for i, f in varied(summary) if si_unit(f) is not None][:2]
    if len(numeric) < 2:
        return None
    (across, x), (up, y) = numeric
    points = []
    for brief in summary.briefs:
        first, second = _figure(brief, across), _figure(brief, up)
        if first is not None and second is not None:
            points.append((first, second, brief.meets))
    labels = [f"{factor.key} [{si_unit(factor)}]" for factor in (x, y)]
    return figures_study.Sampled(labels[0], labels[1], tuple(points))


def _figure(brief: Brief, place: int) -> float | None:
    from syncline_design.yaml_reader import plain_scalar

    found = figure_of(plain_scalar(brief.labels[place]))
    return None if found is None else found[0]


def _sampled_figure(summary: Summary) -> Any:
    data = _sampled(summary)
    return None if data is None else _svg(figures_study.sampled_cases(data))


def _case_table(summary: Summary, currency: str) -> Table:
    result = summary.result
    several = varied(summary)
    many = len(result.study.bases) > 1
    rows = []
    for brief in summary.briefs[:MOST_CASES]:
        shown = OUTCOMES[brief.verdict]
        payload = ", ".join(pick.name for pick in brief.picks)
        why = payload or visible(reason(result.case(brief.number - 1)))
        named = [Cell(result.study.bases[brief.base].name)] if many else []
        rows.append([
            Cell(str(brief.number), float(brief.number)), *named,
            *(Cell(brief.labels[i], _sort(brief, i)) for i, _ in several),
            Cell(brief.verdict, tone=shown.tone, mark=shown.mark),
            Cell(numbers.money(brief.cost, currency), brief.cost),
            Cell(numbers.length(brief.error_m), brief.error_m),
            Cell(why),
        ])  # fmt: skip
    varying = [*(["Base"] if many else []), *(factor.key for _, factor in several)]
    ends = ["Verdict", "Price #", "Worst-case error #", "Payload, or why there is none"]
    heads = ["Case #", *varying, *ends]
    more = len(summary.briefs) - MOST_CASES
    note = f"{more} further cases are in the CSV and Parquet tables." if more > 0 else ""
    return table("All cases", heads, rows, note)


def _sort(brief: Brief, place: int) -> float | None:
    return _figure(brief, place)


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
    return facts
