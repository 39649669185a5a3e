"""One payload for several missions: a table of ways for each role, every mission's figures beside.

A family is a problem for each mission and, for each role, the ways of taking it in all of them: one
option for all, or, of a role that may differ, one for each.  What is bought counts once: sensors
and stamping over all missions, shared hardware for the mission that needs most of it.  Every other
requirement is held by each mission for itself.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from typing import Any

import numpy as np

from syncline_design.choice.evaluate import (
    Evaluation,
    broken,
    chosen_clocks,
    chosen_options,
    error_key,
    evaluate,
    known_or_more,
)
from syncline_design.choice.option import Names, Option, ResourceName, Resources
from syncline_design.choice.options import RESOURCES, Indices
from syncline_design.choice.outcome import TooLarge
from syncline_design.choice.table import Design, Objective, Problem, RoleTable
from syncline_design.machine.quick_dataclass import dataclass

MOST_WAYS = 1_000_000  # of one role that may differ between missions


@dataclass(frozen=True, slots=True)
class FamilyRole:
    """The ways of taking one role: places[mission, way] is a row of that mission's table.

    alone: of a role that may differ, what each sensor takes without its timestamping.
    """

    places: Indices
    alone: Mapping[str, Resources] | None = None

    def __len__(self) -> int:
        return int(self.places.shape[1])

    def take(self, rows: Indices | Sequence[int]) -> FamilyRole:
        """Some of the ways."""
        return FamilyRole(self.places[:, np.asarray(rows, dtype=np.intp)], self.alone)


@dataclass(frozen=True, slots=True)
class FamilyDesign:
    """What was chosen: a way for each role, a clock for each vehicle."""

    ways: tuple[int, ...]
    clocks: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Family:
    """Missions that share a payload.

    clocks: of each vehicle, places[mission, clock]; budgets: the tightest of any mission.
    """

    names: tuple[str, ...]
    problems: tuple[Problem, ...]
    roles: tuple[FamilyRole, ...]
    clocks: tuple[Indices, ...]
    budgets: tuple[tuple[ResourceName, Fraction], ...]

    @property
    def objective(self) -> Objective:
        """What is to be least; the same in every mission."""
        return self.problems[0].objective

    @property
    def combinations(self) -> int:
        """How many designs there are before any requirement."""
        return math.prod(len(role) for role in self.roles) * math.prod(
            int(own.shape[1]) for own in self.clocks
        )

    @property
    def is_empty(self) -> bool:
        """Whether a role has no way that serves every mission, or a vehicle no clock."""
        return self.combinations == 0

    def designs(self, chosen: FamilyDesign) -> tuple[Design, ...]:
        """The design of each mission."""
        return tuple(
            Design(
                tuple(int(r.places[m, w]) for r, w in zip(self.roles, chosen.ways, strict=True)),
                tuple(int(c[m, p]) for c, p in zip(self.clocks, chosen.clocks, strict=True)),
            )
            for m in range(len(self.problems))
        )


def family_of(
    names: Sequence[str],
    problems: Sequence[Problem],
    differing: Mapping[int, Mapping[str, Resources]] | None = None,
    groups: Sequence[int] | None = None,
) -> Family:
    """The family of these missions' problems, whose roles and vehicles are the same ones.

    differing: roles that each mission may take in its own way, with what each sensor takes alone.
    groups: of each problem the number of its mission, where several are one mission's.
    """
    differing, groups = differing or {}, groups or range(len(problems))
    tables = list(zip(*(problem.roles for problem in problems), strict=True))
    roles = tuple(
        _own_ways(own, differing[r], groups) if r in differing else _shared_ways(own)
        for r, own in enumerate(tables)
    )
    clocks = tuple(
        _common([[clock.id or "" for clock in v.clocks] for v in own])
        for own in zip(*(problem.vehicles for problem in problems), strict=True)
    )
    budgets = []
    for name in RESOURCES:
        asked = [p.limits.budget(name) for p in problems]
        given = [amount for amount in asked if amount is not None]
        budgets += [(name, min(given))] if given else []
    return Family(tuple(names), tuple(problems), roles, clocks, tuple(budgets))


def _shared_ways(tables: Sequence[RoleTable]) -> FamilyRole:
    """Options that every mission has."""
    return FamilyRole(_common([table.options.all_names() for table in tables]))


def _own_ways(
    tables: Sequence[RoleTable], alone: Mapping[str, Resources], groups: Sequence[int]
) -> FamilyRole:
    """An option for each mission, in every combination."""
    members = [[m for m, one in enumerate(groups) if one == group] for group in sorted({*groups})]
    own = [_common([tables[m].options.all_names() for m in some]) for some in members]
    count = math.prod(places.shape[1] for places in own)
    if count > MOST_WAYS:
        raise TooLarge(
            f"{count} ways of taking {tables[0].role} of {tables[0].stage_name} with a sensor of "
            f"its own in each mission (at most {MOST_WAYS}): name fewer candidates"
        )
    grids = np.meshgrid(*(np.arange(places.shape[1]) for places in own), indexing="ij")
    rows = np.zeros((len(tables), count), dtype=np.intp)
    for some, places, grid in zip(members, own, grids, strict=True):
        rows[some] = places[:, grid.ravel()]
    return FamilyRole(rows, alone)


def _common(names: Sequence[Sequence[str] | Sequence[Names]]) -> Indices:
    """Places of what all lists name, in the order of the names."""
    places: list[dict[Any, int]] = [{name: i for i, name in enumerate(own)} for own in names]
    order = sorted(set(places[0]).intersection(*places[1:]))
    rows = [[own[name] for name in order] for own in places]
    return np.array(rows, dtype=np.intp).reshape(len(names), len(order))


@dataclass(frozen=True, slots=True)
class FamilyEvaluation:
    """Sums of a family's design, exact; missions: each one's own, by itself."""

    cost: Fraction | None
    mass: Fraction | None
    power: Fraction | None
    missions: tuple[Evaluation, ...]

    def amount(self, name: ResourceName) -> Fraction | None:
        """One resource, of all that is bought for the family."""
        return {"cost": self.cost, "mass": self.mass, "power": self.power}[name]

    @property
    def error_m(self) -> float:
        """The largest total error of any mission [m], rounded once."""
        return max(one.error_m for one in self.missions)


def evaluate_family(family: Family, chosen: FamilyDesign) -> FamilyEvaluation:
    """Every sum of one design."""
    designs = family.designs(chosen)
    found = tuple(
        evaluate(problem, design) for problem, design in zip(family.problems, designs, strict=True)
    )
    parts = list(_parts(family, designs, found))
    cost, mass, power = (_sum(parts, name) for name in RESOURCES)
    return FamilyEvaluation(cost, mass, power, found)


def _parts(
    family: Family, designs: Sequence[Design], found: Sequence[Evaluation]
) -> Iterable[tuple[Resources, int]]:
    """All that is bought: for each role, for each clock, and shared hardware."""
    options = [chosen_options(p, d) for p, d in zip(family.problems, designs, strict=True)]
    for r, role in enumerate(family.roles):
        own = [chosen[r] for chosen in options]
        yield union(own, role.alone) if role.alone is not None else own[0].resources, 1
    for clock in chosen_clocks(family.problems[0], designs[0]):
        yield clock.resources, 1
    most: dict[tuple[int, str], tuple[int, Resources]] = {}
    for problem, one in zip(family.problems, found, strict=True):
        for bought in one.units:
            item = problem.infrastructure[bought.infrastructure]
            key = (bought.vehicle, item.id)
            most[key] = max(most.get(key, (0, item.resources)), (bought.count, item.resources),
                            key=lambda entry: entry[0])  # fmt: skip
    for count, resources in most.values():
        yield resources, count


def union(options: Sequence[Option], alone: Mapping[str, Resources]) -> Resources:
    """What the options of a role take together: a sensor once, a way of stamping it once."""
    sums: dict[str, Fraction | None] = {}
    for name in RESOURCES:
        stamps = {(o.sensor, o.method): o.resources.of(name) for o in options}
        bare = {sensor: alone[sensor].of(name) for sensor, _ in stamps}
        parts = [*bare.values(), *(_less(whole, bare[key[0]]) for key, whole in stamps.items())]
        told = [part for part in parts if part is not None]
        sums[name] = sum(told, Fraction(0)) if len(told) == len(parts) else None
    return Resources(**sums)


def _less(whole: Fraction | None, part: Fraction | None) -> Fraction | None:
    return None if whole is None or part is None else whole - part


def _sum(parts: Sequence[tuple[Resources, int]], name: ResourceName) -> Fraction | None:
    total = Fraction(0)
    for resources, count in parts:
        amount = resources.of(name)
        if amount is None:
            return None
        total += count * amount
    return total


def broken_by_family(
    family: Family, found: FamilyEvaluation, *, accuracy: bool = True
) -> tuple[tuple[str, str], ...]:
    """(mission, kind) of every requirement that a design breaks; a budget is the family's ("")."""
    out = [
        (name, kind)
        for name, problem, one in zip(family.names, family.problems, found.missions, strict=True)
        for kind in broken(problem, one, accuracy=accuracy)
        if kind not in RESOURCES
    ]
    for name, budget in family.budgets:
        amount = found.amount(name)
        if amount is None or not amount <= budget:
            out.append(("", name))
    return tuple(out)


Amount = Fraction | float
FamilyRank = tuple[Amount, float, Amount, Amount, Amount, tuple[int, ...]]


def rank_of(family: Family, chosen: FamilyDesign, found: FamilyEvaluation) -> FamilyRank:
    """The order of designs: objective, largest error, cost, mass, power, then as listed."""
    error = error_key(found.error_m)
    sums = [known_or_more(found.amount(name)) for name in RESOURCES]
    first: Amount = error
    if family.objective != "error":
        first = known_or_more(found.amount(family.objective))
    return (first, error, sums[0], sums[1], sums[2], (*chosen.ways, *chosen.clocks))
