"""The best design of a family by roads that must agree, and one in hand in the meantime."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction

import numpy as np

from syncline_design.choice.anytime import FEW, SHARE
from syncline_design.choice.decide import SAME, SMALL
from syncline_design.choice.enumerate import demand_few
from syncline_design.choice.evaluate import error_key, known_or_more
from syncline_design.choice.family import (
    Family,
    FamilyDesign,
    broken_by_family,
    evaluate_family,
    rank_of,
)
from syncline_design.choice.family_best import (
    APART,
    Also,
    FamilyPoint,
    SummedDesign,
    best_of_family,
    family_front,
    iter_family,
    primary_of,
)
from syncline_design.choice.family_bounds import Rest, least_of_clocks
from syncline_design.choice.family_parts import Whole, narrowed_family, stated_family
from syncline_design.choice.family_tables import FamilyTables, tabulate_family
from syncline_design.choice.option import ResourceName
from syncline_design.choice.options import Floats, Indices
from syncline_design.choice.outcome import NoVerdict, OutOfTime, Proof, Road, TooLarge
from syncline_design.choice.table import Problem
from syncline_design.machine.deadline import in_force, within_s
from syncline_design.machine.quick_dataclass import dataclass

MOST_ENUMERATED = 20_000  # combinations of which a front is worked out one by one


@dataclass(frozen=True, slots=True)
class FamilyChoice:
    """The best design of a family, None where there is none, and how that was proven."""

    found: SummedDesign | None
    proof: Proof


def choose_by_road(family: Family, road: Road = "auto") -> FamilyChoice:
    """The first design in the order, by the sums.

    auto: by merging, confirmed by enumeration where there are few combinations, the integer program
    where merging gives up.  milp: confirmed by merging, where that does not give up.  Raises
    NoVerdict where a road ends without a proof or two disagree.
    """
    if family.is_empty:
        return FamilyChoice(None, Proof("tables", True, True))
    if road == "milp":
        return _by_milp(family, confirm=True)
    if road == "enumerate":
        return _proven(family, _enumerated(family), "enumerate")
    try:
        found = best_of_family(family)
    except TooLarge:
        if road == "front":
            raise
        return _by_milp(family, confirm=False)
    if road == "front" or family.combinations > SMALL:
        return _proven(family, found, "front")
    try:
        other = _enumerated(family)
    except OutOfTime:  # merging is the proof, enumeration confirms it
        return _proven(family, found, "front")
    agreed = _agreed(family, found, other, "merging", "enumeration")
    return _proven(family, agreed, "front", "enumerate")


def _by_milp(family: Family, *, confirm: bool) -> FamilyChoice:
    from syncline_design.choice.family_milp import family_by_milp

    design = family_by_milp(family, in_force())
    found = None if design is None else _found(family, design)
    if not confirm:
        return _proven(family, found, "milp")
    try:
        other = best_of_family(family)
    except (TooLarge, OutOfTime):
        return _proven(family, found, "milp")
    return _proven(family, _agreed(family, found, other, "the MILP", "merging"), "milp", "front")


def _enumerated(family: Family) -> SummedDesign | None:
    """The first design of all, one by one."""
    demand_few(family.combinations)
    best: SummedDesign | None = None
    for one in all_of_family(family):
        if best is not None and one.rank >= best.rank:
            continue
        if not broken_by_family(family, one.sums):
            best = one
    return best


def all_of_family(family: Family) -> Iterator[SummedDesign]:
    """Every design with its sums, whatever it breaks, one by one."""
    clocks = [range(int(own.shape[1])) for own in family.clocks]
    for ways in itertools.product(*(range(len(role)) for role in family.roles)):
        in_force().check()
        for own in itertools.product(*clocks):
            yield _found(family, FamilyDesign(ways, own))


def front_by_road(
    family: Family, resource: ResourceName = "cost", *, accuracy: bool = False
) -> tuple[FamilyPoint, ...]:
    """The exact front: by merging; where that gives up by enumeration or by integer programs.

    accuracy: over designs that keep the accuracy of every mission too.  What does not say how much
    of the resource it takes has no place on it.
    """
    part, whole = stated_family(family, resource)
    try:
        points = family_front(part, resource, accuracy=accuracy)
    except TooLarge:
        made = _front_by_milp
        if part.combinations <= MOST_ENUMERATED:
            made = _front_enumerated
        points = tuple(made(part, resource, accuracy))
    return tuple(replace(point, design=whole(point.design)) for point in points)


def _front_enumerated(
    family: Family, resource: ResourceName, accuracy: bool
) -> Iterator[FamilyPoint]:
    kept: list[tuple[Fraction, float, FamilyDesign]] = []
    for one in all_of_family(family):
        amount = one.sums.amount(resource)
        if amount is None or broken_by_family(family, one.sums, accuracy=accuracy):
            continue
        kept.append((amount, one.sums.error_m, one.design))
    lowest = math.inf
    for amount, error, design in sorted(kept, key=lambda row: (row[0], error_key(row[1]))):
        if error_key(error) < lowest:
            lowest = error_key(error)
            yield FamilyPoint(amount, error, design)


def _front_by_milp(family: Family, resource: ResourceName, accuracy: bool) -> Iterator[FamilyPoint]:
    """By rising amount: the least amount below the error of the point before, and its least
    error."""
    from syncline_design.choice.family_milp import family_by_milp

    cap = math.inf
    while True:
        part = replace(family, problems=tuple(
            _capped(problem, resource, cap, accuracy) for problem in family.problems
        ))  # fmt: skip
        design = family_by_milp(part, in_force())
        if design is None:
            return
        sums = evaluate_family(part, design)
        amount = sums.amount(resource)
        assert amount is not None
        yield FamilyPoint(amount, sums.error_m, design)
        cap = sums.error_m * (1.0 - APART)


def _capped(problem: Problem, resource: ResourceName, cap: float, accuracy: bool) -> Problem:
    """The problem with an error below a cap; a cap of infinity asks for nothing."""
    own = problem.limits.accuracy_m if accuracy else None
    least = min(math.inf if own is None else own, cap)
    limits = replace(problem.limits, accuracy_m=None if math.isinf(least) else least)
    return replace(problem, limits=limits, objective=resource)


def _found(family: Family, design: FamilyDesign) -> SummedDesign:
    sums = evaluate_family(family, design)
    return SummedDesign(design, sums, rank_of(family, design, sums))


def _proven(family: Family, found: SummedDesign | None, road: str, *agrees: str) -> FamilyChoice:
    if found is not None and broken_by_family(family, found.sums):
        raise NoVerdict(f"the payload found by {road} does not stand up to the exact recheck")
    return FamilyChoice(found, Proof(road, True, True, agrees_with=agrees))


def _agreed(
    family: Family, one: SummedDesign | None, other: SummedDesign | None, first: str, second: str
) -> SummedDesign | None:
    """What two roads found, the earlier in the order; NoVerdict where they do not agree."""
    if (one is None) != (other is None):
        raise NoVerdict(f"{first} and {second} disagree on whether any payload meets every mission")
    if one is None or other is None:
        return None
    errors = (one.sums.error_m, other.sums.error_m)
    alike = abs(errors[0] - errors[1]) <= SAME * max(errors)
    if family.objective != "error":
        alike &= one.sums.amount(family.objective) == other.sums.amount(family.objective)
    if not alike:
        raise NoVerdict(f"{first} and {second} disagree on the best payload")
    return min(one, other, key=lambda found: found.rank)


@dataclass(frozen=True, slots=True)
class FamilyInHand:
    """A design that meets every requirement, and what none can go below in the objective."""

    found: SummedDesign
    bound: Fraction | float

    def proof(self, family: Family, road: str) -> Proof:
        """That it is rechecked and by what share a better one may lie below it."""
        value: Fraction | float = self.found.sums.error_m
        if family.objective != "error":
            value = known_or_more(self.found.sums.amount(family.objective))
        gap = float(1 - Fraction(self.bound) / Fraction(value)) if value else 0.0
        return Proof(road, optimal=False, rechecked=True, gap=max(0.0, gap))


def in_hand(family: Family, also: Also | None = None) -> FamilyInHand | None:
    """A quick design, for a time limit that ends the search; None without a limit, or if there is
    none.  also: what it has to satisfy besides."""
    left = in_force().left_s()
    if left is None or family.is_empty:
        return None
    best: SummedDesign | None = None
    for count in FEW:
        try:
            with within_s(SHARE * (in_force().left_s() or 0.0)):
                one = _among_few(family, count, also)
        except (OutOfTime, TooLarge):
            break
        if one is not None and (best is None or one.rank < best.rank):
            best = one
    return None if best is None else FamilyInHand(best, _bound(family))


def _among_few(family: Family, count: int, also: Also | None) -> SummedDesign | None:
    """The best design of those with a few ways of each role."""
    tables = tabulate_family(family, primary_of(family))
    places = [few(tables, r, count) for r in range(len(family.roles))]
    part, whole = narrowed_family(family, places)
    asked = None if also is None else _of_whole(also, whole)
    one = next(iter_family(part, asked), None)
    return None if one is None else _found(family, whole(one.design))


def few(tables: FamilyTables, r: int, count: int) -> Indices:
    """The ways of a role that are least in amount, in error, in timing, and in both together."""
    ways = tables.roles[r]
    caused: Floats = np.asarray((tables.rates[:, None] * ways.tau).max(axis=0))
    error = ways.added.max(axis=0)
    amount = ways.amounts[0]
    aims = (amount, error, caused, error + caused)
    orders = [np.lexsort((*aims[::-1], aim))[:count] for aim in aims]
    return np.unique(np.concatenate(orders))


def _of_whole(also: Also, whole: Whole) -> Also:
    return lambda design: also(whole(design))


def _bound(family: Family) -> Fraction | float:
    """What no design goes below: each role's least amount, or error, by itself."""
    tables = tabulate_family(family, primary_of(family))
    if family.objective == "error":
        least = sum(ways.added.min(axis=1) for ways in tables.roles) + tables.fixed
        if not tables.per_sensor:
            least = least + tables.rates * Rest(tables, tables.roles).waits
        return float(np.max(least))
    whole = sum(int(ways.amounts[0].min()) for ways in tables.roles)
    return Fraction(whole + int(least_of_clocks(tables)), tables.units[0])
