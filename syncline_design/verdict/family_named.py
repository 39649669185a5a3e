"""A family's payloads in the names of the spec, and what was ruled out in any mission."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from typing import Any

from syncline_design.choice.family_best import FamilyPoint
from syncline_design.choice.option import ResourceName
from syncline_design.choice.outcome import FrontPoint
from syncline_design.verdict.choice_data import MOST_EXCLUDED, left_out, ruled_out
from syncline_design.verdict.design_data import full_design
from syncline_design.verdict.family import Chosen, Work
from syncline_design.verdict.named import Exclusion, FrontDesign, RankedDesign, StampingRange
from syncline_design.verdict.recheck_sums import BUDGETS, SummedKind

Sums = dict[SummedKind, Fraction | None]


def ranked(work: Work, chosen: Chosen, ways: StampingRange | None = None) -> RankedDesign:
    """A family's design with what it takes and its largest error; ways: of stamping its sensors."""
    assert chosen.found is not None
    sums = chosen.found.sums
    worst = max(range(len(sums.missions)), key=lambda m: sums.missions[m].error_m)
    scenario = work.scenarios[worst]
    shown = full_design(scenario.case, work.family.problems[worst], chosen.designs[worst])
    amounts = [None if (a := sums.amount(name)) is None else float(a) for name in BUDGETS]
    cost, mass, power = amounts
    own = replace(shown, cost=cost, mass=mass, power=power)
    return RankedDesign(cost, mass, power, sums.error_m, own, stampings=ways)


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


def front_left_out(work: Work, resource: ResourceName = "cost") -> tuple[str, ...]:
    """What has no place on a front of a resource because its entry does not say how much it takes.

    Each once, whichever missions may use it.
    """
    labels = (label for s in work.scenarios for label in left_out(s.case, s.problem, resource))
    return tuple(dict.fromkeys(labels))
