"""The best design of a family, the next ones, and the front of a resource against error.

A design's error is the largest total error of any mission.  Merging finds the front of all sums
but one: what bounds noise from below is decided on what was found, exactly, and where that fails a
second, guarded merge or a search of parts (each without the designs found) settles it.
"""

from __future__ import annotations

import heapq
import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from fractions import Fraction
from functools import partial as having

import numpy as np

from syncline_design.choice.evaluate import error_key, known_or_more
from syncline_design.choice.family import (
    Family,
    FamilyDesign,
    FamilyEvaluation,
    FamilyRank,
    broken_by_family,
    evaluate_family,
    rank_of,
)
from syncline_design.choice.family_bounds import Rest, may_matter
from syncline_design.choice.family_merge import Complete, FamilyMerge
from syncline_design.choice.family_tables import (
    FamilyTables,
    Ways,
    tabulate_family,
    useful_clocks_of,
    useful_ways,
)
from syncline_design.choice.option import ResourceName
from syncline_design.choice.options import MARGIN, Floats, Indices
from syncline_design.choice.outcome import TooLarge
from syncline_design.choice.remaining import Ceiling
from syncline_design.machine.deadline import in_force
from syncline_design.machine.quick_dataclass import dataclass

ROUGH = 60  # partial designs that a first pass goes on with, to know what the others must beat
SMALL = 20_000  # combinations up to which nothing is gained by a first pass
MOST_PARTS = 2_000  # parts of a family that are searched for one design after the other
APART = 3e-11  # errors that differ by a larger share differ in their 12 figures


Also = Callable[[FamilyDesign], bool]


@dataclass(frozen=True, slots=True)
class FamilyPoint:
    """One point of a family's front."""

    amount: Fraction
    error_m: float
    design: FamilyDesign


@dataclass(frozen=True, slots=True)
class SummedDesign:
    """A design with its sums."""

    design: FamilyDesign
    sums: FamilyEvaluation
    rank: FamilyRank


def primary_of(family: Family) -> ResourceName:
    """The resource that a front sets against error when a design is chosen."""
    return "cost" if family.objective == "error" else family.objective


def family_front(
    family: Family,
    resource: ResourceName = "cost",
    also: Also | None = None,
    *,
    accuracy: bool = False,
) -> tuple[FamilyPoint, ...]:
    """The exact front over designs that meet every requirement but accuracy.

    By rising amount and falling error; errors that agree to 12 figures count as equal.  also: what
    a design has to satisfy besides; accuracy: of every mission too.
    """
    if family.is_empty:
        return ()
    problems = tuple(replace(problem, objective=resource) for problem in family.problems)
    tables = tabulate_family(replace(family, problems=problems), resource)
    if not accuracy:
        tables = replace(tables, accuracy=np.full(len(tables.rates), math.inf))
    if also is not None:
        return tuple(_step_by_step(tables, also, accuracy=accuracy))
    found = _merged(tables, guarded=False, least=False)
    points = _front_of(tables, found)
    known = [one for one in points if not broken_by_family(family, one.sums, accuracy=accuracy)]
    if len(known) == len(points):
        return tuple(_point(tables, one) for one in points)
    if tables.guards_sync and not accuracy:
        with suppress(TooLarge):
            found = _merged(tables, guarded=True, least=False, known=known)
            return tuple(_point(tables, one) for one in _front_of(tables, found, known))
    return tuple(_step_by_step(tables, accuracy=accuracy))


def _step_by_step(
    tables: FamilyTables, also: Also | None = None, *, accuracy: bool = False
) -> Iterator[FamilyPoint]:
    """The front by rising amount: the least amount below the error of the point before."""
    limits = tables.accuracy
    while True:
        one = next(_iter(tables, also, accuracy=accuracy), None)
        if one is None:
            return
        yield _point(tables, one)
        cap = one.sums.error_m * (1.0 - APART)
        tables = replace(tables, accuracy=np.minimum(limits, cap))


def _point(tables: FamilyTables, one: SummedDesign) -> FamilyPoint:
    amount = one.sums.amount(tables.names[0])
    assert amount is not None
    return FamilyPoint(amount, one.sums.error_m, one.design)


def best_of_family(family: Family) -> SummedDesign | None:
    """The first design in the order; None where no design meets every requirement."""
    return next(iter_family(family), None)


def iter_family(family: Family, also: Also | None = None) -> Iterator[SummedDesign]:
    """Designs that meet every requirement, best first, each decided exactly.

    also: what a design has to satisfy besides; one that does not is passed over.
    """
    if not family.is_empty:
        yield from _iter(tabulate_family(family, primary_of(family)), also, accuracy=True)


def iter_differing(
    family: Family, groups: Sequence[Indices], also: Also | None = None
) -> Iterator[SummedDesign]:
    """The best design of each choice of groups of ways (their sensors), best first.

    groups: of each role the group of every way.  Each part without the groups of the design that
    was found in it is solved anew (Lawler, as below).
    """
    if family.is_empty:
        return
    counter = itertools.count()
    heap: list[tuple[FamilyRank, int, FamilyTables, SummedDesign]] = []

    def push(part: FamilyTables) -> None:
        found = next(_iter(part, also, accuracy=True), None)
        if found is not None:
            heapq.heappush(heap, (found.rank, next(counter), part, found))

    push(tabulate_family(family, primary_of(family)))
    while heap:
        *_, part, found = heapq.heappop(heap)
        yield found
        for r, chosen in enumerate(found.design.ways):
            own = part.roles[r]
            same = groups[r][own.place] == groups[r][chosen]
            if not same.all():
                others = own.take(~same)
                push(replace(part, roles=(*part.roles[:r], others, *part.roles[r + 1 :])))
            part = replace(part, roles=(*part.roles[:r], own.take(same), *part.roles[r + 1 :]))


def _iter(tables: FamilyTables, also: Also | None, *, accuracy: bool) -> Iterator[SummedDesign]:
    """Designs in order: each part of the family without those found is solved anew.

    (E. L. Lawler, A procedure for computing the K best solutions, Management Science 18, 1972.)
    """
    counter = itertools.count()
    heap: list[tuple[FamilyRank, int, FamilyTables, SummedDesign]] = []

    def push(part: FamilyTables) -> None:
        found = _best_in(part, accuracy)
        if found is not None:
            heapq.heappush(heap, (found.rank, next(counter), part, found))

    push(tables)
    for _ in range(MOST_PARTS):
        if not heap:
            return
        in_force().check()
        *_, part, found = heapq.heappop(heap)
        exact = not broken_by_family(tables.family, found.sums, accuracy=accuracy)
        if exact and (also is None or also(found.design)):
            yield found
        for smaller in _without(part, found.design):
            push(smaller)
    raise TooLarge(f"the search stopped after {MOST_PARTS} designs of the family")


def _without(part: FamilyTables, design: FamilyDesign) -> Iterator[FamilyTables]:
    """The part in parts that leave one design out: each role in turn, then each clock."""
    for r, chosen in enumerate(design.ways):
        own = part.roles[r]
        others = own.take(own.place != chosen)
        if len(others):
            yield replace(part, roles=(*part.roles[:r], others, *part.roles[r + 1 :]))
        fixed = own.take(own.place == chosen)
        part = replace(part, roles=(*part.roles[:r], fixed, *part.roles[r + 1 :]))
    for v, clock in enumerate(design.clocks):
        rest = tuple(place for place in part.clocks[v] if place != clock)
        if rest:
            yield replace(part, clocks=(*part.clocks[:v], rest, *part.clocks[v + 1 :]))
        part = replace(part, clocks=(*part.clocks[:v], (clock,), *part.clocks[v + 1 :]))


def _best_in(tables: FamilyTables, accuracy: bool) -> SummedDesign | None:
    """The first design of a part by the sums that merging decides, the sync limit where it can."""
    first = _first(tables, _merged(tables, guarded=False, least=True))
    if first is None or not broken_by_family(tables.family, first.sums, accuracy=accuracy):
        return first
    if not tables.guards_sync:
        return first
    try:
        found = _merged(tables, guarded=True, least=True)
    except TooLarge:
        return first
    return _first(tables, found, accuracy=accuracy)


def _found(tables: FamilyTables, design: FamilyDesign) -> SummedDesign:
    sums = evaluate_family(tables.family, design)
    return SummedDesign(design, sums, rank_of(tables.family, design, sums))


def _first(
    tables: FamilyTables, parts: Sequence[Complete], accuracy: bool | None = None
) -> SummedDesign | None:
    """The first of complete designs in the order; accuracy: only those that keep the sync limit."""
    best: SummedDesign | None = None
    by_error = tables.family.objective == "error"
    everything = [
        (float(total), int(amount), part, row)
        if by_error
        else (int(amount), float(total), part, row)
        for part in parts
        for row, (amount, total) in enumerate(
            zip(part.amount.tolist(), part.total.tolist(), strict=True)
        )
    ]
    for first, second, part, row in sorted(everything, key=lambda entry: entry[:2]):
        if best is not None and _is_later(tables, best, first, second):
            break
        one = _found(tables, part.designs(np.array([row]))[0])
        if accuracy is not None and any(
            kind == "sync" for _, kind in broken_by_family(tables.family, one.sums)
        ):
            continue
        best = one if best is None else min(best, one, key=lambda entry: entry.rank)
    return best


def _is_later(tables: FamilyTables, best: SummedDesign, first: float, second: float) -> bool:
    """Whether what has these figures comes after the best for certain."""
    error = best.sums.error_m * (1.0 + APART)
    if tables.family.objective == "error":
        return first > error
    amount = best.sums.amount(tables.names[0])
    own = tables.whole(0, amount)
    return first > own or (first == own and second > error)


def _front_of(
    tables: FamilyTables, parts: Sequence[Complete], known: Sequence[SummedDesign] = ()
) -> list[SummedDesign]:
    """The front of complete designs, exact where floats do not tell; known: more of them."""
    lowest, candidates = math.inf, list(known)
    for _, total, part, row in sorted(_rows(parts), key=lambda entry: entry[:2]):
        if total > lowest * (1.0 + APART):
            continue
        one = _found(tables, part.designs(np.array([row]))[0])
        lowest = min(lowest, total)
        candidates.append(one)
    out: list[SummedDesign] = []
    name = tables.names[0]

    def order(one: SummedDesign) -> tuple[Fraction | float, float, FamilyRank]:
        return known_or_more(one.sums.amount(name)), error_key(one.sums.error_m), one.rank

    for one in sorted(candidates, key=order):
        if not out or error_key(one.sums.error_m) < error_key(out[-1].sums.error_m):
            out.append(one)
    return out


def _rows(parts: Sequence[Complete]) -> list[tuple[float, float, Complete, int]]:
    """Amount and error of every complete design, with its part and row."""
    return [
        (amount, total, part, row)
        for part in parts
        for row, (amount, total) in enumerate(
            zip(part.amount.tolist(), part.total.tolist(), strict=True)
        )
    ]


def _merged(
    tables: FamilyTables, *, guarded: bool, least: bool, known: Sequence[SummedDesign] = ()
) -> list[Complete]:
    """Complete designs that may be on the front, or (`least`) the first in the order.

    A rough pass finds designs that the others have to come below; ways that cannot be part of a
    design below them are left out; what is left is merged.
    """
    deadline, tables = in_force(), useful_clocks_of(tables)
    roles = tables.roles
    if not guarded:
        roles = tuple(useful_ways(tables, r) for r in range(len(roles)))
    ceiling = _ceiling_of(tables, known)
    merge = having(FamilyMerge, tables, accuracy=True, guarded=guarded)
    most, found = ROUGH, math.prod(map(len, roles)) <= SMALL
    while not found and most <= ROUGH * 64:
        rough = merge(roles, ceiling=ceiling, most=most)
        for one in rough.runs(deadline):
            kept = _holding(tables, one) if guarded else one
            ceiling = _below(tables, ceiling, kept, least)
            rough.ceiling, found = ceiling, found or bool(len(kept))
        most *= 8
    if math.prod(map(len, roles)) > SMALL:
        roles = _worth_keeping(tables, roles, ceiling)
    if any(not len(ways) for ways in roles):
        return []
    final, out = merge(roles, ceiling=ceiling), []
    for one in final.runs(deadline):
        kept = _holding(tables, one) if guarded else one
        final.ceiling = _below(tables, final.ceiling, kept, least)
        out.append(kept)
    return out


def _holding(tables: FamilyTables, one: Complete) -> Complete:
    """Those complete designs that keep the sync limit, exactly."""
    rows = np.arange(len(one))
    keeps = [
        not any(kind == "sync" for _, kind in broken_by_family(
            tables.family, evaluate_family(tables.family, design)))
        for design in one.designs(rows)
    ]  # fmt: skip
    kept = rows[np.array(keeps, dtype=bool)]
    return replace(one, amount=one.amount[kept], total=one.total[kept], places=one.places[:, kept])


def _worth_keeping(
    tables: FamilyTables, roles: Sequence[Ways], ceiling: Ceiling | None
) -> tuple[Ways, ...]:
    """Roles without the ways that no design below the ceiling and within the limits has."""
    for _ in range(2):
        rest, kept = Rest(tables, roles), []
        least = (tables.rates * rest.waits + tables.fixed)[:, None]
        if tables.per_sensor:
            least = tables.fixed[:, None]
        for r, ways in enumerate(roles):
            amount = ways.amounts[0].astype(np.float64)
            total = ways.added + least
            kept.append(
                ways.take(may_matter(rest.beside[r], amount, total, tables.accuracy, ceiling))
            )
        roles = kept
        if any(not len(ways) for ways in kept):
            break
    return tuple(roles)


def _ceiling_of(tables: FamilyTables, known: Sequence[SummedDesign]) -> Ceiling | None:
    """What designs leave to others."""
    if not known:
        return None
    name = tables.names[0]
    amount = np.array([tables.whole(0, one.sums.amount(name)) for one in known])
    total = np.array([one.sums.error_m * (1.0 + APART) for one in known])
    return _staircase(amount, total)


def _below(
    tables: FamilyTables, ceiling: Ceiling | None, one: Complete, least: bool
) -> Ceiling | None:
    """A ceiling with further complete designs; least: only what may come first is left."""
    if not len(one):
        return ceiling
    amount, total = one.amount.astype(np.float64), one.total * (1.0 + APART)
    if ceiling is not None:
        amount = np.concatenate([ceiling.amount, amount])
        total = np.concatenate([ceiling.total, total])
    if not least:
        return _staircase(amount, total)
    if tables.family.objective == "error":
        return Ceiling(np.array([-math.inf]), np.array([total.min()]))
    finite = np.isfinite(total)
    lowest = float(amount[finite].min())
    error = float(total[finite & (amount == lowest)].min())
    dearer = lowest + abs(lowest) * 4.0 * MARGIN + 0.5
    return Ceiling(np.array([lowest, dearer]), np.array([error, -math.inf]))


def _staircase(amount: Floats, total: Floats) -> Ceiling:
    order = np.lexsort((total, amount))
    amount, total = amount[order].astype(np.float64), total[order]
    before = np.minimum.accumulate(np.append(np.inf, total[:-1]))
    steps = np.flatnonzero(total < before)
    return Ceiling(amount[steps], total[steps])
