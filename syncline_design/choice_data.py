"""The choice of a verdict as data: proof, exact front, next best designs, what was ruled out."""

from __future__ import annotations

from itertools import islice
from typing import Any

from syncline_design.chosen_system import system_of
from syncline_design.design_data import design_json
from syncline_design.design_space import Design, Problem
from syncline_design.known_effects import Known
from syncline_design.loading import LoadedSpec
from syncline_design.model.budget import budget
from syncline_design.open_choice import Picked

Json = dict[str, Any]
NEXT_BEST = 5


def choice_json(loaded: LoadedSpec, problem: Problem, picked: Picked, known: Known) -> Json:
    """The `choice` key of a verdict; the front is of cost against error where costs are known."""
    from syncline_design.choose.decide import best
    from syncline_design.choose.front import front

    assert picked.verified is not None
    chosen = picked.verified.design
    others = (d for d in best(problem, NEXT_BEST + 1) if d != chosen)
    points = front(problem) if _priced(problem) else ()
    return {
        "proof": {
            "method": picked.choice.proof.method,
            "optimal": picked.choice.proof.optimal,
            "rechecked": picked.choice.proof.rechecked,
            "agrees_with": list(picked.choice.proof.agrees_with),
        },
        "front": [
            {
                "cost": float(point.amount),
                "error_m": point.error_m,
                "design": full_design(loaded, problem, point.design, known),
            }
            for point in points
        ],
        "next_best": [
            _with_error(loaded, problem, design, known) for design in islice(others, NEXT_BEST)
        ],
        "excluded": excluded_json(problem),
    }


def full_design(loaded: LoadedSpec, problem: Problem, design: Design, known: Known) -> Json:
    """A design as the `design` key writes it."""
    figures = budget(system_of(loaded, problem, design), known.extra_tau_s, known.systematic)
    return design_json(loaded, problem, design, figures)


def _with_error(loaded: LoadedSpec, problem: Problem, design: Design, known: Known) -> Json:
    figures = budget(system_of(loaded, problem, design), known.extra_tau_s, known.systematic)
    shown = design_json(loaded, problem, design, figures)
    model = loaded.spec.sync_model
    return {"cost": shown["cost"], "error_m": figures.total(model), "design": shown}


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
