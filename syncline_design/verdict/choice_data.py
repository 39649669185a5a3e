"""The choice of a verdict as data: proof, exact front, next best designs, what was ruled out."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING

from syncline_design.choice.effect_tables import design_budget
from syncline_design.choice.judged import judgement
from syncline_design.choice.option import ResourceName
from syncline_design.choice.outcome import FrontPoint
from syncline_design.choice.stampings import stampings_of
from syncline_design.choice.table import Design, Problem
from syncline_design.machine.deadline import Pieces
from syncline_design.spec.case import Case
from syncline_design.spec.references import parts_in_use
from syncline_design.verdict.design_data import full_design, named_design
from syncline_design.verdict.named import (
    Alternative,
    ChoiceResult,
    Exclusion,
    FactFigure,
    FrontByFigure,
    FrontDesign,
    RankedDesign,
    StampingRange,
)
from syncline_design.verdict.tree import finite

if TYPE_CHECKING:
    from syncline_design.verdict.open_choice import Picked

NEXT_BEST = 5
MOST_EXCLUDED = 1000  # rows of `excluded` in a verdict


def choice_of(
    case: Case,
    problem: Problem,
    picked: Picked,
    pieces: Pieces | None = None,
    points: Sequence[FrontPoint] | None = None,
    *,
    pictured: bool = False,
    others: bool = True,
    brief: bool = False,
) -> ChoiceResult:
    """What was chosen among what; points: the front of cost, where it is known.

    pictured: whether to tell the front by a figure of the error too, where one is limited.
    others: whether to look for the next best designs and for what else could be bought.
    brief: the front, and nothing besides.
    """
    # late: 20 ms that a pinned spec need not wait
    from syncline_design.choice.front import front, staircase
    from syncline_design.verdict.alternatives import bargains
    from syncline_design.verdict.front_by_figure import front_by_figure

    assert picked.verified is not None
    chosen = picked.verified.design
    pieces = pieces or Pieces()
    nothing: tuple[FrontPoint, ...] = ()

    if points is None:
        points = pieces.made("front", lambda: tuple(front(problem)), nothing)
    if brief:
        return ChoiceResult(picked.choice.proof, front_designs(case, problem, points))
    following, ranked, offered = _others(case, problem, chosen, pieces) if others else ((), (), ())
    excluded, count = ruled_out(problem)
    by_figure = None
    if pictured:
        verified, known = picked.verified, points

        def by_the_tightest() -> FrontByFigure | None:
            return front_by_figure(case, problem, verified, known)

        by_figure = pieces.made("front by figure", by_the_tightest, None)
    return ChoiceResult(
        picked.choice.proof,
        front_designs(case, problem, points),
        left_out(case, problem, "cost"),
        staircase([p for p in points if not p.undecided]),
        ranked_designs(case, problem, following[:NEXT_BEST], folded=True),
        ranked_designs(case, problem, ranked[:NEXT_BEST]),
        excluded,
        count,
        offered,
        tuple(bargains(case, problem, chosen, points)),
        by_figure=by_figure,
    )


def _others(
    case: Case, problem: Problem, chosen: Design, pieces: Pieces
) -> tuple[Sequence[Design], Sequence[Design], tuple[Alternative, ...]]:
    """The next best designs, those of every design, and what else could be bought."""
    from syncline_design.choice.decide import best
    from syncline_design.verdict.alternatives import alternatives

    def next_best(every: bool) -> Iterator[Design]:
        return (d for d in best(problem, NEXT_BEST + 1, every=every) if d != chosen)

    return (
        pieces.listed("next best designs", lambda: next_best(every=False)),
        pieces.listed("next best of every design", lambda: next_best(every=True)),
        tuple(pieces.listed("alternatives", lambda: alternatives(case, problem, chosen))),
    )


def without_choice(problem: Problem) -> ChoiceResult:
    """Where there was nothing to choose, or no design to be had: what was ruled out."""
    excluded, count = ruled_out(problem)
    return ChoiceResult(excluded=excluded, excluded_count=count)


def front_designs(
    case: Case,
    problem: Problem,
    points: Iterable[FrontPoint],
    resource: ResourceName = "cost",
) -> tuple[FrontDesign, ...]:
    """The points of a front with their designs, by rising amount of the resource."""
    return tuple(
        FrontDesign(
            **{resource: float(point.amount)},
            error_m=point.error_m,
            design=full_design(case, problem, point.design),
            undecided=_undecided(problem, point.design),
            figure_m=point.figure_m,
        )
        for point in points
    )


def ranked_designs(
    case: Case, problem: Problem, designs: Iterable[Design], *, folded: bool = False
) -> tuple[RankedDesign, ...]:
    """Designs with what they cost and reach, in the order given.

    folded: each stands for every design of its sensors.
    """
    return tuple(_ranked(case, problem, design, folded) for design in designs)


def _ranked(case: Case, problem: Problem, design: Design, folded: bool) -> RankedDesign:
    figures = design_budget(case, problem, design)
    shown = named_design(case, problem, design, figures)
    error = figures.total(case.spec.sync_model)
    left_open = _undecided(problem, design)
    over = _stampings(problem, design) if folded else None
    return RankedDesign(shown.cost, shown.mass, shown.power, error, shown, left_open, over)


def _stampings(problem: Problem, design: Design) -> StampingRange | None:
    found = stampings_of(problem, design)
    if found is None:
        return None
    cost = None if found.cost is None else (float(found.cost[0]), float(found.cost[1]))
    return StampingRange(found.count, cost, found.error_m, problem.judge is None)


def _undecided(problem: Problem, design: Design) -> tuple[str, ...] | None:
    """Simulated requirements that a design's samples leave open, where there are any."""
    return judgement(problem, design).undecided or None


def left_out(case: Case, problem: Problem, resource: ResourceName) -> tuple[str, ...]:
    """What has no place on a front of a resource because its entry does not say how much it takes.

    In words, as in `sensor my_gnss`; only entries that a design may use.
    """
    usable = {f"clock {clock.id}" for vehicle in problem.vehicles for clock in vehicle.clocks}
    usable |= {f"shared hardware {item.id}" for item in problem.infrastructure}
    for options in (table.options for table in problem.roles):
        sensors, methods = (options.names_of_each(n) for n in (options.sensor, options.method))
        usable |= {f"sensor {sensor}" for sensor, _, _ in sensors}
        usable |= {f"timestamping method {method}" for _, _, method in methods}
    return tuple(
        label
        for _, label, entry in parts_in_use(case)
        if label in usable and getattr(entry, resource) is None
    )


def left_out_text(labels: Sequence[str], resource: ResourceName) -> str:
    """One line about what is not on a front."""
    one = len(labels) == 1
    return (
        f"not on the front of {resource}: {', '.join(labels)} "
        f"{'gives' if one else 'give'} no {resource}"
    )


def ruled_out(problem: Problem) -> tuple[tuple[Exclusion, ...], int]:
    """What was ruled out before the choice, MOST_EXCLUDED rows at most, and how much that is.

    One row a sensor where the reason is the sensor's, else one an option; then clocks.
    """
    count = sum(len(table.excluded) for table in problem.roles)
    count += sum(len(vehicle.excluded) for vehicle in problem.vehicles)
    return tuple(itertools.islice(ruled_out_rows(problem), MOST_EXCLUDED)), count


def ruled_out_rows(problem: Problem) -> Iterator[Exclusion]:
    """All of it, row by row."""
    return itertools.chain(_excluded_options(problem), _excluded_clocks(problem))


def _excluded_options(problem: Problem) -> Iterator[Exclusion]:
    for table in problem.roles:
        for gone in table.excluded:
            yield Exclusion(
                table.stage_name,
                table.role,
                gone.sensor,
                gone.primitive or None,
                gone.method or None,
                gone.reason,
                gone.code,
                _plain(gone.figure),
                _plain(gone.limit),
            )


def _excluded_clocks(problem: Problem) -> Iterator[Exclusion]:
    names = {table.stage: table.stage_name for table in problem.roles}
    for vehicle in problem.vehicles:
        stage = names.get(vehicle.stages[0], vehicle.name)
        for gone in vehicle.excluded:
            why = (gone.reason, gone.code, _plain(gone.figure), _plain(gone.limit))
            yield Exclusion(stage, "clock", gone.clock.id, None, None, *why)


def _plain(figure: FactFigure) -> FactFigure:
    """JSON has no infinity."""
    return figure if isinstance(figure, str) else finite(figure)
