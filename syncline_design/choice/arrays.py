"""A Problem as arrays: resources as integers in a common unit, errors and bounds as floats."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from operator import attrgetter
from typing import Any

import numpy as np

from syncline_design.choice.outcome import TooLarge
from syncline_design.choice.pareto import (
    Bools,
    Column,
    Columns,
    Floats,
    Indices,
    undominated,
)
from syncline_design.choice.table import RESOURCES, Option, Problem, ResourceName, RoleTable

MARGIN = 1e-12  # sums of floats are trusted to this; what lies closer to a limit is decided exactly
INT64_ROOM = 2**61
MOST_CHANNELS = 1000


@dataclass(frozen=True, slots=True)
class RoleArrays:
    """Options of one role in the order of their names; place: their place in that order.

    error: what an option adds to the total [m], its systematic part included; noise: the sensor
    error alone [m], which the sync requirement is held against.
    """

    place: Indices
    error: Floats
    noise: Floats
    tau: Floats
    host: Bools
    resources: tuple[Column, ...]  # key resources, the primary one first
    ties: tuple[Column, ...]  # resources that only break ties
    channels: tuple[Column, ...]  # one column per tracked piece of shared hardware

    def take(self, rows: Indices | Bools) -> RoleArrays:
        """Some of the options."""
        return RoleArrays(
            self.place[rows],
            self.error[rows],
            self.noise[rows],
            self.tau[rows],
            self.host[rows],
            tuple(c[rows] for c in self.resources),
            tuple(c[rows] for c in self.ties),
            tuple(c[rows] for c in self.channels),
        )

    def __len__(self) -> int:
        return len(self.place)


@dataclass(frozen=True, slots=True)
class Scaled:
    """One resource in whole multiples of 1/denominator, so that sums are exact."""

    name: ResourceName
    denominator: int
    dtype: Any
    known: bool = True  # whether every amount is given

    def whole(self, amount: Fraction | None) -> int | float:
        """An amount in that unit; infinite where the catalog does not say."""
        if amount is None:
            return math.inf
        top, bottom = amount.as_integer_ratio()
        return top * (self.denominator // bottom)


@dataclass(frozen=True, slots=True)
class Tables:
    """All roles as arrays, with the scales of their resources."""

    problem: Problem
    roles: tuple[RoleArrays, ...]
    order: tuple[tuple[int, ...], ...]  # per role: table index of each place
    keys: tuple[Scaled, ...]
    ties: tuple[Scaled, ...]
    tracked: tuple[int, ...]  # infrastructure indices that some option or clock requires

    @property
    def has_unknown_ties(self) -> bool:
        """Whether some design does not say a sum that may settle a tie."""
        return not all(scaled.known for scaled in (*self.keys[1:], *self.ties))


def tabulate(problem: Problem, primary: ResourceName) -> Tables:
    """Arrays for a front of `primary` against error; other budgets become further keys."""
    names = [primary]
    names += [n for n in RESOURCES if n != primary and problem.limits.budget(n) is not None]
    orders = tuple(_by_name(table) for table in problem.roles)
    options = [
        [table.options[i] for i in order]
        for table, order in zip(problem.roles, orders, strict=True)
    ]
    amounts = {name: _Amounts(problem, name, options) for name in RESOURCES}
    ties = [n for n in RESOURCES if n not in names and amounts[n].matter]
    tracked = _tracked(problem, options)
    roles = tuple(
        _role_arrays(
            problem, role, [amounts[n].columns[r] for n in (*names, *ties)], len(names), tracked
        )
        for r, role in enumerate(options)
    )
    keys = tuple(amounts[name].scaled for name in names)
    return Tables(problem, roles, orders, keys, tuple(amounts[n].scaled for n in ties), tracked)


_names = attrgetter("sensor", "primitive", "method")


def _by_name(table: RoleTable) -> tuple[int, ...]:
    names = [_names(option) for option in table.options]
    return tuple(sorted(range(len(names)), key=names.__getitem__))


class _Amounts:
    """One resource of all options as integer columns, with the scale they share."""

    def __init__(self, problem: Problem, name: ResourceName, options: list[list[Option]]) -> None:
        spent = [[option.resources for option in role] for role in options]
        amount_of = attrgetter(name)
        others = [c.resources for v in problem.vehicles for c in v.clocks]
        others += [problem.infrastructure[i].resources for i in _tracked(problem, options)]
        known = all(amount_of(r) is not None for r in itertools.chain(others, *spent))
        rest = [a for a in (*map(amount_of, others), problem.limits.budget(name)) if a is not None]
        ratios = [_ratios(list(map(amount_of, role))) for role in spent]
        denominator = math.lcm(
            *(b for _, bottoms in ratios for b in set(bottoms)), *(a.denominator for a in rest)
        )
        largest = max(
            (abs(top) for tops, _ in ratios for top in tops if top != math.inf), default=0
        )
        largest = max(largest * denominator, *(int(abs(a * denominator)) for a in rest), 0)
        self.matter = any(any(tops) for tops, _ in ratios) or any(rest) or not known
        fits = known and largest * _most_terms(problem) < INT64_ROOM
        self.scaled = Scaled(name, denominator, np.int64 if fits else object, known)
        self.columns = [
            _whole(*ratio, len(role), self.scaled)
            for ratio, role in zip(ratios, spent, strict=True)
        ]


def _ratios(amounts: list[Fraction | None]) -> tuple[Sequence[int | float], Sequence[int]]:
    """Numerators and denominators; infinite where the catalog does not say."""
    if all(amount is not None and not amount for amount in amounts):
        return (), ()
    pairs = [(math.inf, 1) if a is None else a.as_integer_ratio() for a in amounts]
    tops, bottoms = zip(*pairs, strict=True)
    return tops, bottoms


def _whole(
    tops: Sequence[int | float], bottoms: Sequence[int], count: int, scaled: Scaled
) -> Column:
    if not tops:
        return np.zeros(count, dtype=np.int64)
    column = np.array(tops, dtype=scaled.dtype)
    if scaled.denominator == 1:
        return column
    factors = scaled.denominator // np.array(bottoms, dtype=scaled.dtype)
    return np.asarray(column * factors)


def _most_terms(problem: Problem) -> int:
    """How many amounts a design can add up at most."""
    roles = len(problem.roles) + len(problem.vehicles)
    return roles * (1 + len(problem.infrastructure) * MOST_CHANNELS)


def _tracked(problem: Problem, options: list[list[Option]]) -> tuple[int, ...]:
    needs = {o.requires for role in options for o in role}
    needs |= {c.requires for v in problem.vehicles for c in v.clocks}
    wanted = {name for requires in needs for name, _ in requires}
    if any(count > MOST_CHANNELS for requires in needs for _, count in requires):
        raise TooLarge(f"an option that needs more than {MOST_CHANNELS} channels")
    return tuple(i for i, item in enumerate(problem.infrastructure) if item.id in wanted)


def _role_arrays(
    problem: Problem,
    options: list[Option],
    columns: list[Column],
    keys: int,
    tracked: tuple[int, ...],
) -> RoleArrays:
    channels = [
        np.array([_channels(o.requires, problem.infrastructure[i].id) for o in options], dtype=int)
        for i in tracked
    ]
    return RoleArrays(
        np.arange(len(options)),
        np.array([_added_m(o) for o in options], dtype=float),
        np.array([o.sensor_error_m for o in options], dtype=float),
        np.array([o.tau_s for o in options], dtype=float),
        np.array([o.timeline == "host" for o in options], dtype=bool),
        tuple(columns[:keys]),
        tuple(columns[keys:]),
        tuple(channels),
    )


def _added_m(option: Option) -> float:
    if option.systematic_m == 0.0:
        return option.sensor_error_m
    return float(option.error() + option.systematic())


def _channels(requires: tuple[tuple[str, int], ...], name: str) -> int:
    return sum(count for item, count in requires if item == name) if requires else 0


def tie_order(tables: Tables, resources: Sequence[Column], ties: Sequence[Column]) -> list[Column]:
    """Cost, mass, power in this order, limited or not, as far as they are not the first key."""
    named = dict(zip((s.name for s in tables.keys), resources, strict=True))
    named.update(zip((s.name for s in tables.ties), ties, strict=True))
    own = tables.keys[0].name
    return [named[name] for name in RESOURCES if name in named and name != own]


def useful_options(
    tables: Tables, role: RoleArrays, rate_mps: float, per_sensor: bool
) -> RoleArrays:
    """Options that no other option of the same timeline makes superfluous.

    rate_mps: how fast the total grows with this role's tau.  With the `syncline` model the total
    is E + rate max(M, tau + ...), so an option with the smaller error and the smaller
    error + rate tau is never worse, even if its tau is the larger one.
    """
    if len(role) == 0:
        return role
    total = role.error + rate_mps * role.tau
    value, weak = (total, ()) if per_sensor else (role.error, (total,))
    keys = (*role.resources, value)
    kept = []
    for timeline in (False, True):
        rows = np.flatnonzero(role.host == timeline)
        columns = Columns(
            [k[rows] for k in keys],
            [w[rows] for w in (*weak, *role.channels)],
            [t[rows] for t in tie_order(tables, role.resources, role.ties)],
            unknown=tables.has_unknown_ties,
            amount_unknown=not tables.keys[0].known,
        )
        if len(rows):
            kept.append(rows[undominated(columns)])
    return role.take(np.sort(np.concatenate(kept)))
