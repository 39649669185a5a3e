"""The choice of a verdict as data: proof, exact front, next best designs, what was ruled out."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import islice
from typing import Any

from syncline_design.choose.outcome import FrontPoint
from syncline_design.design_data import design_json
from syncline_design.design_space import Design, Problem
from syncline_design.effect_tables import design_budget
from syncline_design.loading import LoadedSpec
from syncline_design.open_choice import Picked

Json = dict[str, Any]
NEXT_BEST = 5


def choice_json(loaded: LoadedSpec, problem: Problem, picked: Picked) -> Json:
    """The `choice` key of a verdict; the front is of cost against error where costs are known."""
    from syncline_design.choose.decide import best
    from syncline_design.choose.front import front
    from syncline_design.choose.prices import staircase

    assert picked.verified is not None
    chosen = picked.verified.design
    others = (d for d in best(problem, NEXT_BEST + 1) if d != chosen)
    points = front(problem) if _priced(problem) else ()
    return {
        "proof": proof_json(picked),
        "front": front_json(loaded, problem, points),
        "staircase": [step.to_json() for step in staircase(points)],
        "next_best": designs_json(loaded, problem, islice(others, NEXT_BEST)),
        "excluded": excluded_json(problem),
    }


def proof_json(picked: Picked) -> Json:
    """How the choice was proven."""
    proof = picked.choice.proof
    return {
        "method": proof.method,
        "optimal": proof.optimal,
        "rechecked": proof.rechecked,
        "agrees_with": list(proof.agrees_with),
        "passed_over": picked.passed_over,
    }


def front_json(
    loaded: LoadedSpec,
    problem: Problem,
    points: Iterable[FrontPoint],
    resource: str = "cost",
) -> list[Json]:
    """The points of a front with their designs, by rising amount of the resource."""
    return [
        {
            resource: float(point.amount),
            "error_m": point.error_m,
            "design": full_design(loaded, problem, point.design),
        }
        for point in points
    ]


def designs_json(loaded: LoadedSpec, problem: Problem, designs: Iterable[Design]) -> list[Json]:
    """Designs with what they cost and reach, in the order given."""
    return [_with_error(loaded, problem, design) for design in designs]


def full_design(loaded: LoadedSpec, problem: Problem, design: Design) -> Json:
    """A design as the `design` key writes it."""
    figures = design_budget(loaded, problem, design)
    return design_json(loaded, problem, design, figures)


def _with_error(loaded: LoadedSpec, problem: Problem, design: Design) -> Json:
    figures = design_budget(loaded, problem, design)
    shown = design_json(loaded, problem, design, figures)
    error = figures.total(loaded.spec.sync_model)
    return {key: shown[key] for key in ("cost", "mass", "power")} | {
        "error_m": error,
        "design": shown,
    }


def _priced(problem: Problem) -> bool:
    """Whether every option and shared part has a cost, so that a front of cost exists."""
    parts = [option.resources for table in problem.roles for option in table.options]
    parts += [clock.resources for vehicle in problem.vehicles for clock in vehicle.clocks]
    parts += [item.resources for item in problem.infrastructure]
    return all(resources.cost is not None for resources in parts)


def excluded_json(problem: Problem) -> list[Json]:
    """Candidates ruled out before the choice, with the reason."""
    return [
        {
            "stage": table.stage_name,
            "role": table.role,
            "sensor": gone.sensor,
            "primitive": gone.primitive,
            "method": gone.method,
            "reason": gone.reason,
        }
        for table in problem.roles
        for gone in table.excluded
    ]
