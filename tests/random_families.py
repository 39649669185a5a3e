"""Random families of missions, and every design of one tried out, slow and plain.

The sums are written out here once more, in fractions of the floats that the tables hold; nothing of
the choice is used but the tables' own figures.
"""

from __future__ import annotations

import itertools
import math
import random
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from random_problems import random_problem
from syncline_design.choice.family import Family, family_of
from syncline_design.choice.option import Option, Resources
from syncline_design.choice.table import Problem, RoleTable

Chosen = tuple[
    list[Option], list
]  # of one mission: an option of each role, a clock of each vehicle


def random_family(rng: random.Random, most: int = 60) -> Family:
    """One to four missions of one random system; in some of its roles they may differ."""
    base = random_problem(rng, most)
    count = rng.choice([1, 2, 2, 3, 3, 4])
    problems = [_mission(rng, base, m) for m in range(count)]
    differing: dict[int, dict[str, Resources]] = {}
    if rng.random() < 0.4:
        r = rng.randrange(len(base.roles))
        if math.prod(len(p.roles[r].options) for p in problems) < 200:
            own = base.roles[r].options
            differing[r] = {o.sensor: _share(rng, o.resources) for o in own}
    return family_of([f"m{m}" for m in range(count)], problems, differing)


def _share(rng: random.Random, whole: Resources) -> Resources:
    """What a sensor takes without its stamping."""
    return Resources(*(Fraction(rng.randint(0, int(whole.of(n) or 0))) for n in _NAMES))


_NAMES = ("cost", "mass", "power")


def _mission(rng: random.Random, base: Problem, number: int) -> Problem:
    """The system on one mission: other distances and speeds, now and then an option that fails."""
    far = rng.choice([1, 1, Fraction(1, 2), 2, 3])
    fast = rng.choice([1, 1, Fraction(1, 4), 2, 8])
    roles = tuple(_role(rng, table, far, number) for table in base.roles)
    pairs = tuple(replace(pair, rate_mps=float(pair.rate_mps * fast)) for pair in base.pairs)
    rate = math.fsum(pair.rate_mps for pair in pairs)
    fixed = rng.choice([base.fixed_error_m, 0.0])
    accuracy = rng.choice([None, rng.choice([0.5, 1.0, 2.0, 4.0]) * len(roles)])
    budgets = {
        name: Fraction(rng.randint(5, 45 * len(roles)), rng.choice([1, 2]))
        for name in _NAMES
        if rng.random() < 0.12
    }
    sync = rng.choice([base.limits.sync, base.limits.sync, 0.2, math.inf])
    limits = replace(base.limits, accuracy_m=accuracy, sync=sync, **budgets)
    return replace(
        base, roles=roles, pairs=pairs, sync_rate_mps=rate, fixed_error_m=fixed, limits=limits
    )


def _role(rng: random.Random, table: RoleTable, far: Fraction | int, number: int) -> RoleTable:
    options = []
    for option in table.options:
        if number and len(table.options) > 2 and rng.random() < 0.1:
            continue  # out of reach there
        scale = 1 if table.role == "position" else far
        error = float(option.sensor_error_m * scale)
        if rng.random() < 0.2:
            error *= rng.choice([0.5, 1.5])  # lies differently in this mission
        options.append(replace(option, sensor_error_m=error))
    rng.shuffle(options)
    return replace(table, options=tuple(options))


@dataclass(frozen=True)
class Tried:
    """One design with all that is held against limits."""

    names: tuple[tuple[tuple[str, str, str], ...], ...]
    amounts: dict[str, Fraction]
    totals: tuple[Fraction, ...]
    keeps: bool  # every requirement but accuracy
    accurate: bool

    @property
    def error_m(self) -> float:
        return max(float(total) for total in self.totals)


def all_tried(family: Family) -> Iterator[Tried]:
    """Every design, one by one."""
    problems = family.problems
    ways = [list(_ways(family, r)) for r in range(len(family.roles))]
    offered = [
        [
            [problem.vehicles[v].clocks[i] for problem in problems]
            for i in range(len(vehicle.clocks))
        ]
        for v, vehicle in enumerate(problems[0].vehicles)
    ]
    for chosen in itertools.product(*ways):
        for clocks in itertools.product(*offered):
            yield _tried(family, chosen, clocks)


def _ways(family: Family, r: int) -> Iterator[list[Option]]:
    """An option for each mission: the same one, or any of its own."""
    own = [list(problem.roles[r].options) for problem in family.problems]
    if family.roles[r].alone is not None:
        yield from map(list, itertools.product(*own))
        return
    for option in own[0]:
        same = [next((o for o in more if o.names == option.names), None) for more in own]
        if None not in same:
            yield same  # type: ignore[misc]


def _tried(family: Family, chosen, clocks) -> Tried:
    totals, keeps, accurate = [], True, True
    for m, problem in enumerate(family.problems):
        options, own = [way[m] for way in chosen], [clock[m] for clock in clocks]
        total, held = _mission_sums(problem, options, own)
        totals.append(total)
        limit = problem.limits.accuracy_m
        accurate &= limit is None or float(total) <= limit
        keeps &= held
    amounts = {name: _amount(family, chosen, clocks, name) for name in _NAMES}
    for problem in family.problems:
        for name in _NAMES:
            budget = getattr(problem.limits, name)
            keeps &= budget is None or amounts[name] <= budget
    names = tuple(tuple(option.names for option in way) for way in chosen)
    return Tried(names, amounts, tuple(totals), keeps, accurate)


def _mission_sums(problem: Problem, options: list[Option], clocks: list) -> tuple[Fraction, bool]:
    bounds = []
    for pair in problem.pairs:
        own = options[pair.role]
        host = [problem.roles[pair.role].vehicle] if own.timeline == "host" else []
        bound = Fraction(own.tau_s)
        if pair.reference is None:
            bound += sum(Fraction(clocks[v].offset_bound_s) for v in host)
        else:
            other = options[pair.reference]
            bound += Fraction(other.tau_s)
            theirs = [problem.roles[pair.reference].vehicle] if other.timeline == "host" else []
            if host != theirs:
                bound += sum(Fraction(clocks[v].offset_bound_s) for v in host + theirs)
        bounds.append((bound, Fraction(pair.rate_mps)))
    noise = sum(Fraction(option.sensor_error_m) for option in options)
    largest = max(bound for bound, _ in bounds)
    caused = Fraction(problem.sync_rate_mps) * largest
    ratio = 0.0 if caused == 0 else float(caused / noise)
    if problem.sync_model == "per_sensor":
        caused = sum(bound * rate for bound, rate in bounds)
    return noise + caused + Fraction(problem.fixed_error_m), ratio < problem.limits.sync


def _amount(family: Family, chosen, clocks, name: str) -> Fraction:
    total = Fraction(0)
    for role, way in zip(family.roles, chosen, strict=True):
        if role.alone is None:
            total += getattr(way[0].resources, name)
            continue
        for sensor in {option.sensor for option in way}:
            total += getattr(role.alone[sensor], name)
        bought = {(o.sensor, o.method): o for o in way}
        for option in bought.values():
            total += getattr(option.resources, name) - getattr(role.alone[option.sensor], name)
    total += sum(getattr(clock[0].resources, name) for clock in clocks)
    first = family.problems[0]
    for v in range(len(first.vehicles)):
        for item in first.infrastructure:
            units = 0
            for m, problem in enumerate(family.problems):
                used = [w[m] for t, w in zip(problem.roles, chosen, strict=True) if t.vehicle == v]
                needs = [*(o.requires for o in used), clocks[v][m].requires]
                channels = sum(n for need in needs for one, n in need if one == item.id)
                units = max(units, math.ceil(channels / item.channels))
            total += units * getattr(item.resources, name)
    return total


def plain_front(
    family: Family, resource: str, tried: Sequence[Tried] | None = None
) -> list[tuple[Fraction, float]]:
    """Amounts and errors (12 figures) of the front, over designs that keep all but accuracy.

    tried: every design, where they are there.
    """
    out: list[tuple[Fraction, float]] = []
    every = all_tried(family) if tried is None else tried
    kept = [(t.amounts[resource], float(f"{t.error_m:.12g}")) for t in every if t.keeps]
    for amount, error in sorted(kept):
        if not out or error < out[-1][1]:
            out.append((amount, error))
    return out


def plain_order(
    family: Family, tried: Sequence[Tried] | None = None
) -> list[tuple[Fraction | float, float]]:
    """Objective and error of every design that meets all requirements, best first."""
    objective = family.objective
    rows = []
    for one in all_tried(family) if tried is None else tried:
        if one.keeps and one.accurate:
            error = float(f"{one.error_m:.12g}")
            rows.append((error if objective == "error" else one.amounts[objective], error))
    return sorted(rows)
