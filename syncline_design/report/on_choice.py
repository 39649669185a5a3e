"""What `optimize` says: the best designs, the front, what accuracy costs, what it all hinges on."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from syncline_design.choice.acceptable import judgement
from syncline_design.choice.evaluate import chosen_options, evaluate
from syncline_design.choice.outcome import ROADS, FrontPoint
from syncline_design.choice.prices import PriceStep
from syncline_design.choice.slack import Slack
from syncline_design.choice.table import Design, Problem, ResourceName
from syncline_design.report import numbers
from syncline_design.report.document import (
    Document,
    Items,
    Node,
    Outcome,
    Section,
    Text,
    section,
    show,
)
from syncline_design.report.table import Cell, Table, table
from syncline_design.report.words import KINDS, OBJECTIVES, OUTCOMES
from syncline_design.verdict.choice_data import left_out, left_out_text
from syncline_design.verdict.open_choice import Picked
from syncline_design.verdict.optimise import (
    Hinges,
    Optimisation,
    incomplete_lines,
    problem_size,
    unfinished_line,
)


def on_choice(found: Optimisation) -> Document:
    """The best designs of a spec as a document, or why there is none."""
    designs = designs_table(found.problem, found.designs, found.case.spec.currency)
    return Document(
        family="Optimisation",
        outcome=_outcome(found),
        name=found.case.spec.name,
        sentences=tuple(_sentences(found)),
        facts=(),
        sections=(
            *_why_not(found),
            *section("designs", "Best designs", show(designs, silent=True)),
            *_front(found),
            *section("hinges", "What it hinges on", hinges_nodes(found.hinges)),
            *section("incomplete", "Not complete", _items(incomplete_lines(found))),
        ),
        source=str(found.case.path),
    )


def _items(lines: Sequence[str]) -> list[Node]:
    return [Items(tuple(lines))] if lines else []


def _outcome(found: Optimisation) -> Outcome:
    if found.explanation is not None:
        return OUTCOMES["infeasible"]
    if found.exit_code != 0 or found.picked is None:
        return OUTCOMES["indeterminate"]
    objective = found.case.spec.objective
    best = OBJECTIVES.get(objective, objective)
    how = "proven" if found.picked.choice.proof.optimal else "not proven optimal"
    return Outcome("good", "\u2713", f"Design of {best}, {how}")


def _sentences(found: Optimisation) -> list[str]:
    """How it is known, or why it is not."""
    if found.unfinished:
        return [unfinished_line(found)]
    return [_proof(found, found.picked)] if found.picked is not None and found.designs else []


def _proof(found: Optimisation, picked: Picked) -> str:
    proof, size = picked.choice.proof, problem_size(found.problem)
    objective = found.case.spec.objective
    if not proof.optimal:
        gap = "" if proof.gap is None else f": the optimum is at most {100 * proof.gap:.3g} % lower"
        return (
            f"Found among {size} combinations by {objective} within the time limit, rechecked "
            f"exactly, not proven optimal{gap}."
        )
    confirmed = " and ".join(ROADS.get(road, road) for road in proof.agrees_with)
    others = f", confirmed by {confirmed}" if confirmed else ""
    passed = picked.passed_over
    skipped = f"; {passed} better ones fail the Monte Carlo requirements" if passed else ""
    return (
        f"Best of {size} combinations by {objective}: proven by "
        f"{ROADS.get(proof.method, proof.method)}{others}, rechecked exactly{skipped}."
    )


def _why_not(found: Optimisation) -> list[Section]:
    """The explanation's own lines: those with a dash are a list."""
    if found.explanation is None:
        return []
    nodes: list[Node] = []
    for line in found.explanation.lines()[1:]:
        text = line.strip()
        nodes.append(Items((text[2:],)) if text.startswith("- ") else Text(text))
    return section("infeasibility", "Why no design meets the requirements", nodes)


def designs_table(problem: Problem, designs: Sequence[Design], currency: str) -> Table:
    """Best first, with what each costs and reaches, and what simulation leaves open."""
    rows = []
    for place, design in enumerate(designs, 1):
        sums = evaluate(problem, design)
        undecided = judgement(problem, design).undecided
        rows.append([
            Cell(str(place), float(place)),
            *(amount_cell(getattr(sums, name), name, currency) for name in _RESOURCES),
            Cell(numbers.length(sums.error_m), sums.error_m),
            *_role_cells(problem, design), Cell(_open_text(undecided)),
        ])  # fmt: skip
    heads = ("Place", "Cost #", "Mass #", "Power #", "Error #", *_role_heads(problem), "Simulation")
    return table("Best designs", heads, rows)


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
    return [f"{roles.stage_name} {roles.role}" for roles in problem.roles]


def _role_cells(problem: Problem, design: Design) -> list[Cell]:
    """`ublox_f9p_rtk by pps, gpio` per role."""
    options = chosen_options(problem, design)
    return [Cell(f"{one.sensor} by {one.primitive}, {one.method}") for one in options]


def _open_text(requirements: Sequence[str]) -> str:
    """Simulated requirements that samples leave open for a design."""
    return f"{', '.join(requirements)} undecided" if requirements else ""


def _front(found: Optimisation) -> list[Section]:
    """The exact front and what each accuracy costs on it."""
    resource, currency = found.settings.resource, found.case.spec.currency
    nodes: list[Node] = []
    if found.front:
        nodes += show(front_table(found.problem, found.front, resource, currency), silent=True)
        nodes += show(staircase_table(found.prices, currency, resource))
    if found.settings.pareto and found.picked is not None:
        missing = left_out(found.case, found.problem, resource)
        nodes += [Text(left_out_text(missing, resource))] if missing else []
    return section("front", f"Exact front of {resource} against error, all else met", nodes)


def front_table(
    problem: Problem, points: Sequence[FrontPoint], resource: ResourceName, currency: str
) -> Table:
    """The Pareto front, a row per point; one that simulation leaves open says so."""
    rows = [
        [
            amount_cell(point.amount, resource, currency),
            Cell(numbers.length(point.error_m), point.error_m),
            *_role_cells(problem, point.design),
            Cell(_open_text(point.undecided)),
        ]
        for point in points
    ]
    heads = (f"{resource.capitalize()} #", "Error #", *_role_heads(problem), "Simulation")
    return table("Exact front", heads, rows)


def staircase_table(steps: Sequence[PriceStep], currency: str, resource: ResourceName) -> Table:
    """The price of accuracy, loosest target first."""
    rows = []
    for step in steps:
        loose = step.looser_than_m
        upto = "and looser" if loose is None else f"to below {numbers.target(loose)}"
        more = Cell("") if step.extra is None else amount_cell(step.extra, resource, currency)
        rows.append([
            Cell(f"{numbers.target(step.tightest_m)} {upto}", step.tightest_m),
            amount_cell(step.amount, resource, currency), more,
        ])  # fmt: skip
    heads = ("Accuracy target #", f"{resource.capitalize()} #", "More than the step before #")
    return table("What accuracy costs", heads, rows)


def hinges_nodes(hinges: Hinges | None) -> list[Node]:
    """Slack of every figure, tolerances, what to measure next."""
    if hinges is None:
        return []
    nodes = [] if hinges.slack is None else show(slack_table(hinges.slack))
    if hinges.tolerance is not None:
        nodes.append(Text(hinges.tolerance.text))
    if hinges.measure_next is None:
        return nodes
    if not hinges.measure_next:
        words = "No single datasheet figure, 20 % up or down, changes the choice."
        return [*nodes, Text(words)]
    rows = [
        (one.figure, one.value_text, one.at_text,
         "20 % assumed" if one.assumed else "datasheet tolerance", one.becomes)
        for one in hinges.measure_next
    ]  # fmt: skip
    heads = ("Figure", "Now", "Flips at", "Range", "The choice becomes")
    caption = "What to measure next: a single figure that changes the choice"
    return [*nodes, *show(table(caption, heads, rows))]


def slack_table(rows: Sequence[Slack]) -> Table:
    """The slack ledger, a row per term."""
    return table(
        "How far each term may grow",
        ("Term", "Now #", "Verdict fails at #", "What then breaks", "Payload changes at #"),
        [
            (
                f"{row.stage} {row.term}",
                Cell(numbers.si_quantity(row.value, row.unit), row.value),
                _threshold(row, row.fails_at, "verdict"),
                KINDS.get(row.limited_by or "", row.limited_by or ""),
                _threshold(row, row.payload_changes_at, "payload"),
            )
            for row in rows
        ],
    )


def _threshold(row: Slack, value: float | None, what: str) -> Cell:
    """A threshold; without one `never` where that is proven, else how far was looked."""
    if value is not None:
        return Cell(numbers.si_quantity(value, row.unit), value)
    if what in row.never:
        return Cell("never")
    if row.searched_to is None:
        return Cell("not known")
    return Cell(f"not up to {numbers.si_quantity(row.searched_to, row.unit)}")
