"""The Pareto front over every design, one by one: the oracle of the solvers' fronts."""

from __future__ import annotations

from syncline_design.choice.enumerate import all_designs
from syncline_design.choice.evaluate import broken, error_key, rank
from syncline_design.choice.option import ResourceName
from syncline_design.choice.outcome import FrontPoint
from syncline_design.choice.table import Problem


def front_by_enumeration(
    problem: Problem, resource: ResourceName = "cost"
) -> tuple[FrontPoint, ...]:
    """The Pareto front over all designs that meet every requirement but accuracy."""
    found = []
    for design, evaluation in all_designs(problem):
        amount = evaluation.amount(resource)
        if amount is not None and not broken(problem, evaluation, accuracy=False):
            ranked = rank(problem, design, evaluation)[2:]
            found.append((amount, error_key(evaluation.error_m), ranked, evaluation, design))
    found.sort(key=lambda entry: entry[:3])
    points: list[FrontPoint] = []
    for amount, error, _, evaluation, design in found:
        if not points or error < error_key(points[-1].error_m):
            points.append(FrontPoint(amount, evaluation.error_m, design))
    return tuple(points)
