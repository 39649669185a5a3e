"""What else a family could buy: the next payloads, without a sensor, for a little more money."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from functools import partial

from syncline_design.choice.family import Family, FamilyDesign, broken_by_family, evaluate_family
from syncline_design.choice.family_best import FamilyPoint, SummedDesign, iter_differing
from syncline_design.choice.family_parts import same_sensors, sensor_groups, without_sensor
from syncline_design.choice.family_roads import all_of_family, front_by_road
from syncline_design.choice.problem import selection_of
from syncline_design.spec.selection import Selection
from syncline_design.verdict.alternatives import worth_it
from syncline_design.verdict.choice_data import NEXT_BEST
from syncline_design.verdict.family import (
    Chosen,
    Work,
    accepted,
    choose_family,
    on_part,
    passing,
)
from syncline_design.verdict.family_named import front_design, ranked
from syncline_design.verdict.named import (
    Alternative,
    Bargain,
    NamedDesign,
    RankedDesign,
    StampingRange,
)

MOST_COMBINED = 1_000  # ways of stamping the same sensors that are looked at, each exactly


def next_best(
    work: Work, chosen: Chosen, *, every: bool = False, count: int = NEXT_BEST
) -> Iterator[RankedDesign]:
    """The payloads after the chosen one, each with other sensors; every: whatever differs."""
    left = count
    for one in _every(work) if every else _differing(work):
        found = _chosen(work, one)
        if found.designs == chosen.designs:
            continue
        yield with_stampings(work, found) if not every else ranked(work, found)
        left -= 1
        if not left:
            return


def _chosen(work: Work, one: SummedDesign) -> Chosen:
    return Chosen(work.family.designs(one.design), work.family.problems, one)


def _every(work: Work) -> Iterator[SummedDesign]:
    return accepted(work)


def _differing(work: Work) -> Iterator[SummedDesign]:
    groups = [sensor_groups(work.family, r) for r in range(len(work.family.roles))]
    return iter_differing(work.family, groups, passing(work))


def with_stampings(work: Work, chosen: Chosen) -> RankedDesign:
    """A payload with the range of its sensors' other ways of stamping."""
    assert chosen.found is not None
    return ranked(work, chosen, stampings(work, chosen.found.design))


def stampings(work: Work, design: FamilyDesign) -> StampingRange | None:
    """Every payload of the same sensors that keeps the sums of every mission; None of too many."""
    part = same_sensors(work.family, design)
    if part.combinations > MOST_COMBINED:
        return None
    kept = [one.sums for one in all_of_family(part) if not broken_by_family(part, one.sums)]
    if not kept:
        return None
    costs = [one.cost for one in kept if one.cost is not None]
    errors = [one.error_m for one in kept]
    cost = (float(min(costs)), float(max(costs))) if len(costs) == len(kept) else None
    return StampingRange(len(kept), cost, (min(errors), max(errors)), passing(work) is None)


def alternatives(work: Work, chosen: Chosen) -> Iterator[Alternative]:
    """One for each sensor of the payload that is not all that its roles may take."""
    places: dict[str, list[str]] = {}
    for selection in _selections(chosen):
        for one in selection.roles:
            role = f"{one.stage}.{one.role}"
            if role not in places.setdefault(one.sensor, []):
                places[one.sensor].append(role)
    for sensor, roles in places.items():
        part = without_sensor(work.family, sensor)
        if all(_is_open(work.family, role, sensor) for role in roles):
            yield _without(work, chosen, sensor, tuple(roles), part)


def _is_open(family: Family, role: str, sensor: str) -> bool:
    """Whether a role may take another sensor in some mission."""
    tables = (table for problem in family.problems for table in problem.roles)
    own = [one for one in tables if f"{one.stage_name}.{one.role}" == role]
    return any(option.sensor != sensor for table in own for option in table.options)


def _without(
    work: Work, chosen: Chosen, sensor: str, places: tuple[str, ...], part: Family
) -> Alternative:
    other = choose_family(on_part(work, part))
    if other is None:
        return Alternative(sensor, places, "infeasible", None, None, None, None, (), None)
    if other.found is None or chosen.found is None:
        return Alternative(sensor, places, "indeterminate", None, None, None, None, (), None)
    before, after = chosen.found.sums, other.found.sums
    dearer = None
    if before.cost is not None and after.cost is not None:
        dearer = float(after.cost - before.cost)
    shown = ranked(work, other)
    return Alternative(
        sensor, places, "meets", shown.cost, after.error_m, dearer,
        after.error_m - before.error_m, tuple(_changes(work, chosen, other)), shown.design,
    )  # fmt: skip


def _changes(work: Work, old: Chosen, new: Chosen) -> Iterator[str]:
    """Roles and clocks taken otherwise; where not in every mission, in which."""
    told: dict[str, list[str]] = {}
    for scenario, before, after in zip(
        work.scenarios, _selections(old), _selections(new), strict=True
    ):
        lines = [
            f"{one.stage}.{one.role}: {one.sensor} by {one.primitive}, {one.method}"
            for one in after.roles
            if one not in before.roles
        ]
        lines += [f"clock of {c.vehicle}: {c.id}" for c in after.clocks if c not in before.clocks]
        for line in lines:
            if scenario.mission not in told.setdefault(line, []):
                told[line].append(scenario.mission)
    for line, names in told.items():
        everywhere = len(names) == len(work.missions)
        yield line if everywhere else f"{line} (in mission {', '.join(names)})"


def _selections(chosen: Chosen) -> list[Selection]:
    return [selection_of(p, d) for p, d in zip(chosen.problems, chosen.designs, strict=True)]


def bargains(work: Work, chosen: Chosen, points: Sequence[FamilyPoint]) -> Iterator[Bargain]:
    """What a little more money, or a little more error, would buy; the largest gain first.

    points: the front of cost.  What is better keeps every mission's accuracy; less accurate for
    less is said where all missions ask for the same accuracy.
    """
    assert chosen.found is not None
    sums = chosen.found.sums
    if sums.cost is None or sums.error_m <= 0.0:
        return
    problems = work.family.problems
    limits = {problem.limits.accuracy_m for problem in problems}
    better = [p for p in points if p.amount > sums.cost]
    if limits != {None} and passing(work) is None:
        better = [p for p in front_by_road(work.family, accuracy=True) if p.amount > sums.cost]
    elif limits != {None}:
        better = [p for p in better if not _inaccurate(work.family, p.design)]
    one = next(iter(limits))
    allowed = sums.error_m if one is None or work.family.objective == "error" else one
    cheaper = [p for p in points if p.amount < sums.cost] if len(limits) == 1 else []

    def named(point: FamilyPoint) -> NamedDesign:
        return front_design(work, point).design

    every = [(Fraction(p.amount), p.error_m, partial(named, p)) for p in (*cheaper, *better)]
    yield from worth_it(every, sums.cost, sums.error_m, allowed)


def _inaccurate(family: Family, design: FamilyDesign) -> bool:
    return bool(broken_by_family(family, evaluate_family(family, design)))
