"""The choice of a family as data: its front, what robustness costs, which missions do not go."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from typing import Any

from syncline_design.choice.family_best import FamilyPoint
from syncline_design.choice.front import staircase
from syncline_design.choice.options import ResourceName
from syncline_design.choice.outcome import FrontPoint, Proof
from syncline_design.machine.deadline import in_force
from syncline_design.verdict.choice_data import MOST_EXCLUDED, full_design, ruled_out
from syncline_design.verdict.family import (
    Build,
    Chosen,
    Work,
    choose_family,
    front_of,
    intervals,
    work_of,
)
from syncline_design.verdict.named import ChoiceResult, Exclusion, FrontDesign, RankedDesign
from syncline_design.verdict.recheck_sums import BUDGETS, Budget
from syncline_design.verdict.tree import Robustness

Sums = dict[Budget, Fraction | None]


def ranked(work: Work, chosen: Chosen) -> RankedDesign:
    """A family's design with what it takes and its largest error."""
    assert chosen.found is not None
    sums = chosen.found.sums
    worst = max(range(len(sums.missions)), key=lambda m: sums.missions[m].error_m)
    scenario = work.scenarios[worst]
    shown = full_design(scenario.case, work.family.problems[worst], chosen.designs[worst])
    amounts = [None if (a := sums.amount(name)) is None else float(a) for name in BUDGETS]
    cost, mass, power = amounts
    return RankedDesign(
        cost, mass, power, sums.error_m, replace(shown, cost=cost, mass=mass, power=power)
    )


def robustness_of(work: Work, sums: Sums, build: Callable[[], Build]) -> Robustness | None:
    """What it costs to hold for more than the figures as given."""
    spec = work.case.spec
    if spec.choose_for == "nominal":
        return None
    in_force().doing("choosing at given figures")
    own = work_of(work.case, build, nominal=True)
    chosen = choose_family(own) if not own.family.is_empty else None
    best = None if chosen is None or chosen.undecided else ranked(own, chosen)
    unit = {"cost": spec.currency, "mass": "kg", "power": "W"}.get(spec.objective, "m")
    price = None
    if spec.objective != "error" and chosen is not None and chosen.found is not None:
        before, now = chosen.found.sums.amount(spec.objective), sums[spec.objective]
        price = None if before is None or now is None else float(now - before)
    figures = {f.name for one in work.missions for f in intervals(one.case)}
    return Robustness(
        choose_for=str(spec.choose_for), figures=len(figures), nominal=best, price=price, unit=unit
    )


def choice_of_family(work: Work) -> ChoiceResult:
    """The proof, the front of the family, what was ruled out in any mission."""
    in_force().doing("working out the front")
    points = front_of(work)
    excluded, count = ruled_out_of(work)
    return ChoiceResult(
        proof=Proof("front", optimal=True, rechecked=True),
        front=tuple(front_design(work, point) for point in points),
        staircase=staircase([as_point(work, point) for point in points]),
        excluded=excluded,
        excluded_count=count,
    )


def ruled_out_of(work: Work) -> tuple[tuple[Exclusion, ...], int]:
    """What was ruled out in any mission, each row once; in some of them alone: in which."""
    rows: dict[Exclusion, list[str]] = {}
    several = bool(work.case.missions)
    for one in work.scenarios:
        for row in ruled_out(one.problem)[0]:
            names = rows.setdefault(row, [])
            if one.mission not in names:
                names.append(one.mission)
    told = [
        replace(row, reason=f"in mission {', '.join(names)}: {row.reason}")
        if several and len(names) < len(work.missions)
        else row
        for row, names in rows.items()
    ]
    return tuple(told[:MOST_EXCLUDED]), len(told)


def as_point(work: Work, point: FamilyPoint) -> FrontPoint:
    """A point with the design of the first mission."""
    return FrontPoint(point.amount, point.error_m, work.family.designs(point.design)[0])


def front_design(work: Work, point: FamilyPoint, resource: ResourceName = "cost") -> FrontDesign:
    """A point of a front in names; amount and error are the family's."""
    designs, scenario = work.family.designs(point.design), work.scenarios[0]
    shown = full_design(scenario.case, scenario.problem, designs[0])
    amounts: dict[str, Any] = {resource: float(point.amount)}
    return FrontDesign(**amounts, error_m=point.error_m, design=replace(shown, **amounts))


def cannot_share(work: Work, build: Callable[[], Build]) -> tuple[str, ...]:
    """Missions that cannot share one payload, none of which can be left out."""
    left = list(work.missions)
    for mission in work.missions:
        rest = tuple(one for one in left if one is not mission)
        if (
            len(rest) > 1
            and choose_family(work_of(replace(work.case, missions=rest), build)) is None
        ):
            left = list(rest)
    return tuple(one.name for one in left)
