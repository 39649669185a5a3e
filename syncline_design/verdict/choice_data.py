"""The choice of a verdict as data: proof, exact front, next best designs, what was ruled out."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from syncline_design.choice.effect_tables import design_budget
from syncline_design.choice.outcome import FrontPoint
from syncline_design.choice.table import Design, Problem, ResourceName
from syncline_design.machine.deadline import Pieces
from syncline_design.machine.records import Json
from syncline_design.spec.case import Case
from syncline_design.spec.references import parts_in_use
from syncline_design.verdict.design_data import design_json
from syncline_design.verdict.open_choice import Picked
from syncline_design.verdict.tree import finite

NEXT_BEST = 5
MOST_EXCLUDED = 1000  # rows of `excluded` in a verdict


def choice_json(
    case: Case,
    problem: Problem,
    picked: Picked,
    pieces: Pieces | None = None,
    points: Sequence[FrontPoint] | None = None,
) -> Json:
    """The `choice` key of a verdict; the front is of cost against error where costs are known."""
    from syncline_design.choice.decide import best
    from syncline_design.choice.front import front
    from syncline_design.choice.prices import staircase

    assert picked.verified is not None
    chosen = picked.verified.design
    pieces = pieces or Pieces()
    nothing: tuple[FrontPoint, ...] = ()

    def others(every: bool) -> Iterator[Design]:
        return (d for d in best(problem, NEXT_BEST + 1, every=every) if d != chosen)

    if points is None:
        points = pieces.made("front", lambda: front(problem), nothing)
    following = pieces.listed("next best designs", lambda: others(every=False))
    ranked = pieces.listed("next best of every design", lambda: others(every=True))
    return {
        "proof": proof_json(picked),
        "front": front_json(case, problem, points),
        "front_left_out": left_out(case, problem, "cost"),
        "staircase": [step.to_json() for step in staircase([p for p in points if not p.undecided])],
        "next_best": designs_json(case, problem, following[:NEXT_BEST]),
        "next_best_every": designs_json(case, problem, ranked[:NEXT_BEST]),
        **excluded_json(problem),
    }


def proof_json(picked: Picked) -> Json:
    """How the choice was proven."""
    proof = picked.choice.proof
    return {
        "method": proof.method,
        "optimal": proof.optimal,
        "rechecked": proof.rechecked,
        "gap": proof.gap,
        "agrees_with": list(proof.agrees_with),
        "passed_over": picked.passed_over,
    }


def unproven_json(method: str) -> Json:
    """The proof of a search that ended before it found any design."""
    return {
        "method": method,
        "optimal": False,
        "rechecked": False,
        "gap": None,
        "agrees_with": [],
        "passed_over": 0,
    }


def front_json(
    case: Case,
    problem: Problem,
    points: Iterable[FrontPoint],
    resource: str = "cost",
) -> list[Json]:
    """The points of a front with their designs, by rising amount of the resource."""
    return [
        {
            resource: float(point.amount),
            "error_m": point.error_m,
            "design": full_design(case, problem, point.design),
        }
        | _undecided(problem, point.design)
        for point in points
    ]


def designs_json(case: Case, problem: Problem, designs: Iterable[Design]) -> list[Json]:
    """Designs with what they cost and reach, in the order given."""
    return [_with_error(case, problem, design) for design in designs]


def full_design(case: Case, problem: Problem, design: Design) -> Json:
    """A design as the `design` key writes it."""
    figures = design_budget(case, problem, design)
    return design_json(case, problem, design, figures)


def _with_error(case: Case, problem: Problem, design: Design) -> Json:
    figures = design_budget(case, problem, design)
    shown = design_json(case, problem, design, figures)
    error = figures.total(case.spec.sync_model)
    sums = {key: shown[key] for key in ("cost", "mass", "power")}
    return sums | {"error_m": error, "design": shown} | _undecided(problem, design)


def _undecided(problem: Problem, design: Design) -> Json:
    """Simulated requirements that a design's samples leave open, where there are any."""
    from syncline_design.choice.acceptable import judgement

    found = judgement(problem, design).undecided
    return {"undecided": list(found)} if found else {}


def left_out(case: Case, problem: Problem, resource: ResourceName) -> list[str]:
    """What has no place on a front of a resource because its entry does not say how much it takes.

    In words, as in `sensor my_gnss`; only entries that a design may use.
    """
    usable = {f"clock {clock.id}" for vehicle in problem.vehicles for clock in vehicle.clocks}
    usable |= {f"shared hardware {item.id}" for item in problem.infrastructure}
    for option in (option for table in problem.roles for option in table.options):
        usable |= {f"sensor {option.sensor}", f"timestamping method {option.method}"}
    return [
        label
        for _, label, entry in parts_in_use(case)
        if label in usable and getattr(entry, resource) is None
    ]


def left_out_text(labels: Sequence[str], resource: ResourceName) -> str:
    """One line about what is not on a front."""
    one = len(labels) == 1
    return (
        f"not on the front of {resource}: {', '.join(labels)} "
        f"{'gives' if one else 'give'} no {resource}"
    )


def excluded_json(problem: Problem) -> Json:
    """`excluded`: what was ruled out before the choice, and `excluded_count`, how much that is.

    One row a sensor where the reason is the sensor's (primitive and method null), else one an
    option; clocks have the role `clock`.  At most MOST_EXCLUDED rows.
    """
    rows = [*_excluded_options(problem), *_excluded_clocks(problem)]
    return {"excluded": rows[:MOST_EXCLUDED], "excluded_count": len(rows)}


def _excluded_options(problem: Problem) -> Iterator[Json]:
    for table in problem.roles:
        for gone in table.excluded:
            yield {
                "stage": table.stage_name,
                "role": table.role,
                "sensor": gone.sensor,
                "primitive": gone.primitive or None,
                "method": gone.method or None,
                "reason": gone.reason,
                "code": gone.code,
                "figure": _plain(gone.figure),
                "limit": _plain(gone.limit),
            }


def _excluded_clocks(problem: Problem) -> Iterator[Json]:
    names = {table.stage: table.stage_name for table in problem.roles}
    for vehicle in problem.vehicles:
        for gone in vehicle.excluded:
            yield {
                "stage": names.get(vehicle.stages[0], vehicle.name),
                "role": "clock",
                "sensor": gone.clock.id,
                "primitive": None,
                "method": None,
                "reason": gone.reason,
                "code": gone.code,
                "figure": _plain(gone.figure),
                "limit": _plain(gone.limit),
            }


def _plain(figure: float | str | None) -> float | str | None:
    """JSON has no infinity."""
    return figure if isinstance(figure, str) else finite(figure)
