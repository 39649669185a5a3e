"""What if a sensor of the design cannot be had, and what a little more money would buy."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from functools import partial
from typing import Literal

from syncline_design.choice.evaluate import chosen_options, evaluate
from syncline_design.choice.holding import outcome_of, without
from syncline_design.choice.outcome import FrontPoint, Infeasible
from syncline_design.choice.table import Design, Problem
from syncline_design.spec.case import Case
from syncline_design.verdict.design_data import full_design
from syncline_design.verdict.named import Alternative, Bargain, NamedDesign

LEAST_GAIN = 0.05  # share of the error, or of the price, that a bargain takes off at least
LEAST_RATIO = 2.0  # by how much that share exceeds the share it costs
MOST_BARGAINS = 3  # of each kind


def alternatives(case: Case, problem: Problem, chosen: Design) -> Iterator[Alternative]:
    """One for each sensor of the design that is not all that its roles may take."""
    places: dict[str, list[str]] = {}
    for table, option in zip(problem.roles, chosen_options(problem, chosen), strict=True):
        places.setdefault(option.sensor, []).append(f"{table.stage_name}.{table.role}")
    open_to = _choices(problem)
    for sensor, roles in places.items():
        if all(open_to[role] > 1 for role in roles):
            yield _without(case, problem, chosen, sensor, tuple(roles))


def _choices(problem: Problem) -> dict[str, int]:
    """How many sensors each role may take."""
    return {
        f"{table.stage_name}.{table.role}": len(set(table.options.sensor.tolist()))
        for table in problem.roles
    }


def _without(
    case: Case, problem: Problem, chosen: Design, sensor: str, places: tuple[str, ...]
) -> Alternative:
    part = without(problem, sensor, chosen)
    found = outcome_of(part.problem)
    if isinstance(found, Infeasible):
        return Alternative(sensor, places, "infeasible", None, None, None, None, (), None)
    design = part.whole(found.design)
    before, after = evaluate(problem, chosen), evaluate(problem, design)
    dearer = None
    if before.cost is not None and after.cost is not None:
        dearer = float(after.cost - before.cost)
    return Alternative(
        sensor, places, "meets" if found.accepted else "indeterminate",
        None if after.cost is None else float(after.cost), after.error_m,
        dearer, float(after.total_m - before.total_m),
        tuple(_changes(problem, chosen, design)), full_design(case, problem, design),
    )  # fmt: skip


def _changes(problem: Problem, old: Design, new: Design) -> Iterator[str]:
    """Roles and clocks that the other design takes otherwise."""
    olds, news = chosen_options(problem, old), chosen_options(problem, new)
    for table, before, after in zip(problem.roles, olds, news, strict=True):
        if before.names != after.names:
            name, primitive, method = after.names
            yield f"{table.stage_name}.{table.role}: {name} by {primitive}, {method}"
    for vehicle, first, second in zip(problem.vehicles, old.clocks, new.clocks, strict=True):
        if first != second:
            yield f"clock of {vehicle.name}: {vehicle.clocks[second].id}"


def bargains(
    case: Case, problem: Problem, chosen: Design, points: Sequence[FrontPoint]
) -> Iterator[Bargain]:
    """What a little more money, or a little more error, would buy; the largest gain first."""
    sums = evaluate(problem, chosen)
    if sums.cost is None or sums.error_m <= 0.0:
        return
    limit = problem.limits.accuracy_m
    allowed = sums.error_m if limit is None or problem.objective == "error" else limit
    known = [
        (Fraction(p.amount), p.error_m, partial(full_design, case, problem, p.design))
        for p in points
        if not p.undecided
    ]
    yield from worth_it(known, sums.cost, sums.error_m, allowed)


def worth_it(
    known: Sequence[tuple[Fraction, float, Callable[[], NamedDesign]]],
    cost: Fraction,
    error: float,
    allowed: float,
) -> Iterator[Bargain]:
    """Bargains among points of a front (amount, error, what names it), seen from a design.

    allowed: the error that it may have, where it is the price that is least.
    """
    paid = float(cost) or min((float(amount) for amount, *_ in known if amount > 0), default=0.0)
    found: dict[Literal["better", "cheaper"], list[tuple[float, int, float, float]]]
    found = {"better": [], "cheaper": []}
    for place, (amount, reached, _) in enumerate(known):
        extra = float(amount - cost)
        kind: Literal["better", "cheaper"]
        if extra > 0.0 and reached < error:
            gain, pain, kind, start = 1.0 - reached / error, extra / paid, "better", error
        elif extra < 0.0 and reached > allowed:
            gain, pain, kind, start = -extra / paid, reached / allowed - 1.0, "cheaper", allowed
        else:
            continue
        if gain >= LEAST_GAIN and gain >= LEAST_RATIO * pain:
            found[kind].append((gain / pain if pain else math.inf, place, extra, start))
    for kind, those in found.items():
        those.sort(key=lambda one: -one[0])
        for _, place, extra, start in those[:MOST_BARGAINS]:
            amount, reached, named = known[place]
            yield Bargain(kind, extra, float(amount), start, reached, named())
