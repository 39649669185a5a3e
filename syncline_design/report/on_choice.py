"""What `optimize` says: the best designs, the front, what accuracy costs, what it all hinges on."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import TYPE_CHECKING

from syncline_design.choice.evaluate import chosen_clocks, chosen_options, evaluate
from syncline_design.choice.judged import judgement
from syncline_design.choice.option import ResourceName
from syncline_design.choice.outcome import ROADS, FrontPoint, PriceStep
from syncline_design.choice.table import Design, Problem, VehicleTable
from syncline_design.report import numbers
from syncline_design.report.document import (
    Chart,
    Document,
    Items,
    Node,
    Outcome,
    Section,
    Text,
    section,
    show,
)
from syncline_design.report.on_alternatives import (
    alternatives_table,
    bargain_nodes,
    ways_cell,
)
from syncline_design.report.on_hinges import hinges_nodes
from syncline_design.report.on_infeasibility import infeasibility_nodes
from syncline_design.report.on_nearest import asked_limit, nearest_nodes
from syncline_design.report.on_why_not import why_not_nodes
from syncline_design.report.table import Cell, Table, table
from syncline_design.report.verdict_words import qualification, warning_nodes, with_waived
from syncline_design.report.words import OBJECTIVES, OUTCOMES
from syncline_design.verdict.acceptance import MOST_SIMULATED
from syncline_design.verdict.choice_data import left_out_text
from syncline_design.verdict.named import FrontDesign, NamedDesign, RankedDesign
from syncline_design.verdict.optimization import Optimization, Optimized

if TYPE_CHECKING:
    from syncline_design.report.svg import InlineChart


def on_choice(found: Optimized) -> Document:
    """The best designs of a spec as a document, or why there is none."""
    currency, result = found.case.spec.currency, found.result
    limit = asked_limit(found.case, "accuracy")
    if found.text is None:
        designs = designs_table(found.problem, found.designs, currency, limit, result.designs)
    else:
        designs = family_designs_table(result.designs, currency, limit)
    without = alternatives_table(result.alternatives or (), currency, limit)
    bargains = bargain_nodes(result.bargains or (), currency, limit)
    return Document(
        family="Optimization",
        outcome=_outcome(found),
        name=found.case.spec.name,
        sentences=tuple(_sentences(found)),
        facts=(),
        sections=(
            *_why_not(found, currency),
            *section("designs", "Best designs", show(designs, silent=True)),
            *why_not_section(result, currency, limit),
            *section("alternatives", "If a sensor cannot be had", show(without, silent=True)),
            *section("bargains", "Worth a thought", bargains),
            *section("warnings", "Warnings", warning_nodes(found.result.warnings)),
            *_front(found),
            *section("hinges", "What it hinges on", hinges_nodes(found.result, limit)),
            *section("incomplete", "Not complete", _items(incomplete_lines(found.result))),
        ),
        source=str(found.case.path),
    )


def why_not_section(
    result: Optimization, currency: str, limit: numbers.Limited | None
) -> list[Section]:
    """What `--why-not` asked about."""
    return section("why-not", "Why not", why_not_nodes(result.why_not, currency, limit))


def _items(lines: Sequence[str]) -> list[Node]:
    return [Items(tuple(lines))] if lines else []


def _outcome(found: Optimized) -> Outcome:
    if found.result.verdict != "meets":
        return OUTCOMES[found.result.verdict]
    objective = found.case.spec.objective
    best = OBJECTIVES.get(objective, objective)
    how = "proven" if found.result.proof.optimal else "not proven optimal"
    shown = Outcome("good", "\u2713", f"Design of {best}, {how}")
    shown = with_waived(shown, found.result.waived or ())
    return replace(shown, word=shown.word + qualification(found.result))


def _sentences(found: Optimized) -> list[str]:
    """How it is known, or why it is not."""
    if found.result.message is not None:
        return [found.result.message]
    return [_proof(found.result, found.case.spec.objective)] if found.result.designs else []


def _proof(result: Optimization, objective: str) -> str:
    proof, size = result.proof, _size(result.combinations or "")
    if not proof.optimal:
        gap = (
            ""
            if proof.gap is None
            else f": the optimum is at most {numbers.percent(proof.gap, 3)} lower"
        )
        return (
            f"Found among {size} combinations by {objective} within the time limit, rechecked "
            f"exactly, not proven optimal{gap}."
        )
    confirmed = " and ".join(ROADS.get(road, road) for road in proof.agrees_with)
    others = f", confirmed by {confirmed}" if confirmed else ""
    passed = proof.passed_over
    skipped = f"; {passed} better ones fail the Monte Carlo requirements" if passed else ""
    return (
        f"Best of {size} combinations by {objective}: proven by "
        f"{ROADS.get(proof.method, proof.method)}{others}, rechecked exactly{skipped}."
    )


def _size(combinations: str) -> str:
    """How many combinations there are: plain up to a million, then as a power."""
    return combinations if len(combinations) < 7 else numbers.number(float(combinations), 3)


def incomplete_lines(result: Optimization) -> list[str]:
    """Which parts lack designs: by the time limit, or because simulation is bounded."""
    lines = []
    if result.cut_short and result.message is None:
        lines.append(f"The time limit ended this too early: {', '.join(result.cut_short)}.")
    if result.gave_up:
        lines.append(
            f"After {MOST_SIMULATED} simulated designs the search gave up; not complete: "
            f"{', '.join(result.gave_up)}."
        )
    return lines


def _why_not(found: Optimized, currency: str) -> list[Section]:
    result, case = found.result, found.case
    if result.infeasibility is None:
        return []
    limits = asked_limit(case, "accuracy"), asked_limit(case, "cost")
    price = None if limits[1] is None else limits[1].limit
    nodes = [
        *infeasibility_nodes(result.infeasibility),
        *nearest_nodes(result.nearest, currency, limits[0], price),
    ]
    return section("infeasibility", "Why no design meets the requirements", nodes)


def designs_table(
    problem: Problem,
    designs: Iterable[Design],
    currency: str,
    limit: numbers.Limited | None,
    named: Sequence[RankedDesign] = (),
) -> Table:
    """Best first, with what each costs and reaches, and what simulation leaves open.

    limit: of accuracy, in whose unit errors are told.  named: the same designs, with how else their
    sensors can be stamped.
    """
    rows = []
    for place, (design, shown) in enumerate(itertools.zip_longest(designs, named), 1):
        sums = evaluate(problem, design)
        undecided = judgement(problem, design).undecided
        rows.append([
            Cell(str(place), float(place)),
            *(amount_cell(getattr(sums, name), name, currency) for name in _RESOURCES),
            Cell(numbers.error(sums.error_m, limit), sums.error_m),
            *_role_cells(problem, design),
            Cell("") if shown is None else ways_cell(shown, currency, limit),
            Cell(_open_text(undecided)),
        ])  # fmt: skip
    heads = (
        "Place", "Cost #", "Mass #", "Power #", "Error #", *_role_heads(problem),
        "Ways of stamping it", "Simulation",
    )  # fmt: skip
    return table("Best designs", heads, rows)


def family_designs_table(
    designs: Sequence[RankedDesign], currency: str, limit: numbers.Limited | None
) -> Table:
    """Payloads for several missions, best first; the error is the largest of any mission."""
    clocked = _clocked(designs)
    rows = [
        [
            Cell(str(place), float(place)),
            *(amount_cell(getattr(one, name), name, currency) for name in _RESOURCES),
            Cell(numbers.error(one.error_m, limit), one.error_m),
            *_named_cells(one.design, clocked=clocked),
            ways_cell(one, currency, limit),
        ]
        for place, one in enumerate(designs, 1)
    ]
    heads = ("Place", "Cost #", "Mass #", "Power #", "Largest error #")
    return table("Best designs", (*heads, *_named_heads(designs), "Ways of stamping it"), rows)


def family_front_table(
    front: Sequence[FrontDesign],
    resource: ResourceName,
    currency: str,
    limit: numbers.Limited | None,
    figure: str | None = None,
) -> Table:
    """The front of several missions, a row per point.

    figure: what it is drawn over in place of the Syncline error.
    """
    over = () if figure is None else (f"{figure[0].upper()}{figure[1:]} #",)
    clocked = _clocked(front)
    rows = [
        [
            amount_cell(getattr(one, resource), resource, currency),
            *(Cell(numbers.error(one.figure_m, limit), one.figure_m) for _ in over),
            Cell(numbers.error(one.error_m, limit), one.error_m),
            *_named_cells(one.design, clocked=clocked),
        ]
        for one in front
    ]
    error = "Largest error #" if figure is None else "Largest Syncline error #"
    heads = (f"{resource.capitalize()} #", *over, error, *_named_heads(front))
    return table("Exact front", heads, rows)


def _named_heads(designs: Sequence[RankedDesign | FrontDesign]) -> list[str]:
    """Roles of the designs, which are alike in them, and the clocks where any has one."""
    roles = [f"{stage.name} {role}" for one in designs[:1] for stage, role, _ in one.design.roles]
    return [*roles, CLOCKS] if _clocked(designs) else roles


def _clocked(designs: Sequence[RankedDesign | FrontDesign]) -> bool:
    return any(one.design.clocks for one in designs)


def _named_cells(design: NamedDesign, *, clocked: bool) -> list[Cell]:
    texts = [f"{one.sensor} by {one.primitive}, {one.timestamping}" for _, _, one in design.roles]
    if clocked:
        texts.append("; ".join(f"{one.vehicle}: {one.id}" for one in design.clocks) or "none")
    return [Cell(text) for text in texts]


CLOCKS = "Clocks"
_RESOURCES: tuple[ResourceName, ...] = ("cost", "mass", "power")


def amount_cell(amount: Fraction | float | None, resource: str, currency: str) -> Cell:
    """`59 862.35 EUR`, `1.2 kg`; `unknown` where a catalog entry does not say."""
    if amount is None:
        return Cell("unknown")
    value = float(amount)
    if resource == "cost":
        return Cell(numbers.money(value, currency), value)
    return Cell(numbers.in_unit(value, "kg" if resource == "mass" else "W", 5), value)


def _role_heads(problem: Problem) -> list[str]:
    """Roles, and the vehicles whose clock is a choice."""
    heads = [f"{roles.stage_name} {roles.role}" for roles in problem.roles]
    return heads + [f"{vehicle.name} clock" for vehicle in problem.vehicles if _is_clocked(vehicle)]


def _is_clocked(vehicle: VehicleTable) -> bool:
    return any(clock.id is not None for clock in vehicle.clocks)


def _role_cells(problem: Problem, design: Design) -> list[Cell]:
    """`ublox_f9p_rtk by pps, gpio` per role, and the clocks."""
    options = chosen_options(problem, design)
    roles = [f"{one.sensor} by {one.primitive}, {one.method}" for one in options]
    chosen = zip(problem.vehicles, chosen_clocks(problem, design), strict=True)
    clocks = [clock.id or "none" for vehicle, clock in chosen if _is_clocked(vehicle)]
    return [Cell(text) for text in (*roles, *clocks)]


def _open_text(requirements: Sequence[str]) -> str:
    """Simulated requirements that samples leave open for a design."""
    return f"{', '.join(requirements)} undecided" if requirements else ""


def _front(found: Optimized) -> list[Section]:
    """The exact front and what each accuracy costs on it."""
    resource, currency = found.settings.resource, found.case.spec.currency
    limit = asked_limit(found.case, "accuracy")
    nodes: list[Node] = []
    if found.text is not None and found.result.front:
        words = found.result.front_figure
        front = family_front_table(found.result.front, resource, currency, limit, words)
        nodes += show(front, silent=True)
        steps = found.result.staircase or ()
        nodes += show(staircase_table(steps, currency, resource, limit, words))
        nodes += [] if words is None else [Text(f"{OVER_FIGURE} {OF_MISSIONS}")]
    if found.points:
        words = found.result.front_figure
        drawn = front_table(found.problem, found.points, resource, currency, limit, words)
        nodes += show(drawn, silent=True)
        steps = found.result.staircase or ()
        nodes += show(staircase_table(steps, currency, resource, limit, words))
        if words is not None:
            nodes += [Text(OVER_FIGURE), *_figure_chart(found, words)]
    if found.result.front_left_out:
        nodes.append(Text(left_out_text(found.result.front_left_out, resource)))
    return section(
        "front",
        f"Exact front of {resource} against {found.result.front_figure or 'error'}, all else met",
        nodes,
    )


OVER_FIGURE = (
    "Every point keeps all requirements but accuracy and those on this figure; each figure is the "
    "largest that a search over the situations found, and gains below 0.1 % are no points."
)
OF_MISSIONS = "Of several missions the largest figure counts."


def figure_front(found: Optimized) -> list[Section]:
    """The front over a figure of the error, for a page that has the Syncline's beside it."""
    return _front(found) if found.result.front_figure is not None else []


def _figure_chart(found: Optimized, words: str) -> list[Node]:
    """The front over a figure of the error as a staircase, the best design where it is on it."""
    best = found.designs[0] if found.designs else None
    points = [
        (float(point.amount), point.drawn_m, point.design == best)
        for point in found.points
        if point.drawn_m
    ]

    def draw() -> InlineChart:
        from syncline_design.report.charts_front import FrontMark, pareto_front

        drawn = [FrontMark(*point) for point in sorted(points)]
        return pareto_front(
            drawn, found.case.spec.currency, None, None, "fig-front-figure", over=words
        )

    caption = (
        f"Every design on the line is the cheapest with that {words}; nothing that keeps the other "
        "requirements exists below and left of it."
    )
    drawable = found.settings.resource == "cost" and len(points) > 1
    return [Chart("front-figure", draw, caption)] if drawable else []


def front_table(
    problem: Problem,
    points: Sequence[FrontPoint],
    resource: ResourceName,
    currency: str,
    limit: numbers.Limited | None,
    figure: str | None = None,
) -> Table:
    """The Pareto front, a row per point; one that simulation leaves open says so.

    figure: what it is drawn over in place of the Syncline error.
    """
    over = (figure,) if figure is not None else ()
    rows = [
        [
            amount_cell(point.amount, resource, currency),
            *(Cell(numbers.error(point.drawn_m, limit), point.drawn_m) for _ in over),
            Cell(numbers.error(point.error_m, limit), point.error_m),
            *_role_cells(problem, point.design),
            Cell(_open_text(point.undecided)),
        ]
        for point in points
    ]
    heads = (
        f"{resource.capitalize()} #", *(f"{one[0].upper()}{one[1:]} #" for one in over),
        "Error #" if not over else "Syncline error #", *_role_heads(problem), "Simulation",
    )  # fmt: skip
    return table("Exact front", heads, rows)


def staircase_table(
    steps: Sequence[PriceStep],
    currency: str,
    resource: ResourceName,
    limit: numbers.Limited | None,
    figure: str | None = None,
) -> Table:
    """The price of accuracy, or of another figure of the error, loosest target first."""
    rows = []
    for step in steps:
        loose = step.looser_than_m
        upto = "and looser" if loose is None else f"to below {numbers.rounded_up(loose, limit)}"
        more = Cell("") if step.extra is None else amount_cell(step.extra, resource, currency)
        rows.append([
            Cell(f"{numbers.rounded_up(step.tightest_m, limit)} {upto}", step.tightest_m),
            amount_cell(step.cost, resource, currency), more,
        ])  # fmt: skip
    limits = "Accuracy limit #" if figure is None else f"Limit of {figure} #"
    heads = (limits, f"{resource.capitalize()} #", "More than the step before #")
    return table("What accuracy costs" if figure is None else "What it costs", heads, rows)
