"""A Problem as arrays: resources as integers in a common unit, errors and bounds as floats."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

from syncline_design.choose.pareto import Bools, Column, Columns, Floats, Indices, undominated
from syncline_design.design_space import (
    RESOURCES,
    Option,
    Problem,
    ResourceName,
    Resources,
    RoleTable,
)

MARGIN = 1e-12  # sums of floats are trusted to this; what lies closer to a limit is decided exactly
INT64_ROOM = 2**61


@dataclass(frozen=True, slots=True)
class RoleArrays:
    """Options of one role in the order of their names; place: their place in that order."""

    place: Indices
    error: Floats
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

    def whole(self, amount: Fraction | None) -> int:
        """An amount in that unit; what the catalog does not say counts nothing."""
        if amount is None:
            return 0
        top, bottom = amount.as_integer_ratio()
        return top * (self.denominator // bottom)

    def column(self, amounts: list[Fraction | None]) -> Column:
        """Amounts as an integer column."""
        if self.denominator == 1:
            whole = [0 if a is None else a.numerator for a in amounts]
        else:
            whole = [self.whole(a) for a in amounts]
        return np.array(whole, dtype=self.dtype)


@dataclass(frozen=True, slots=True)
class Tables:
    """All roles as arrays, with the scales of their resources."""

    problem: Problem
    roles: tuple[RoleArrays, ...]
    order: tuple[tuple[int, ...], ...]  # per role: table index of each place
    keys: tuple[Scaled, ...]
    ties: tuple[Scaled, ...]
    tracked: tuple[int, ...]  # infrastructure indices that some option or clock requires


def tabulate(problem: Problem, primary: ResourceName) -> Tables:
    """Arrays for a front of `primary` against error; other budgets become further keys."""
    names = [primary]
    names += [n for n in RESOURCES if n != primary and problem.limits.budget(n) is not None]
    scales = {name: _scale(problem, name) for name in RESOURCES}
    keys = tuple(scales[name] for name in names)
    ties = tuple(scales[n] for n in RESOURCES if n not in names and _is_known(problem, n))
    tracked = _tracked(problem)
    orders = tuple(_by_name(table) for table in problem.roles)
    roles = tuple(
        _role_arrays([table.options[i] for i in order], keys, ties, tracked, problem)
        for table, order in zip(problem.roles, orders, strict=True)
    )
    return Tables(problem, roles, orders, keys, ties, tracked)


def _by_name(table: RoleTable) -> tuple[int, ...]:
    names = [option.names for option in table.options]
    return tuple(sorted(range(len(names)), key=names.__getitem__))


def _all_resources(problem: Problem) -> list[Resources]:
    unique = {id(o.resources): o.resources for table in problem.roles for o in table.options}
    found = list(unique.values())
    found += [clock.resources for vehicle in problem.vehicles for clock in vehicle.clocks]
    return found + [item.resources for item in problem.infrastructure]


def _is_known(problem: Problem, name: ResourceName) -> bool:
    return any(resources.of(name) for resources in _all_resources(problem))


def _scale(problem: Problem, name: ResourceName) -> Scaled:
    amounts = [r.of(name) for r in _all_resources(problem)]
    amounts.append(problem.limits.budget(name))
    bottoms = {a.denominator for a in amounts if a is not None}
    denominator = math.lcm(*bottoms) if bottoms else 1
    largest = max((abs(a) for a in amounts if a is not None), default=Fraction(0))
    terms = (len(problem.roles) + len(problem.vehicles)) * (1 + len(problem.infrastructure))
    channels = max((n for t in problem.roles for o in t.options for _, n in o.requires), default=1)
    fits = largest * denominator * (terms + 1) * max(1, channels) < INT64_ROOM
    return Scaled(name, denominator, np.int64 if fits else object)


def _tracked(problem: Problem) -> tuple[int, ...]:
    wanted = {name for t in problem.roles for o in t.options for name, _ in o.requires}
    wanted |= {name for v in problem.vehicles for c in v.clocks for name, _ in c.requires}
    return tuple(i for i, item in enumerate(problem.infrastructure) if item.id in wanted)


def _role_arrays(
    options: list[Option],
    keys: tuple[Scaled, ...],
    ties: tuple[Scaled, ...],
    tracked: tuple[int, ...],
    problem: Problem,
) -> RoleArrays:
    resources = [option.resources for option in options]
    columns = [s.column([r.of(s.name) for r in resources]) for s in (*keys, *ties)]
    channels = [
        np.array([_channels(o.requires, problem.infrastructure[i].id) for o in options], dtype=int)
        for i in tracked
    ]
    return RoleArrays(
        np.arange(len(options)),
        np.array([o.sensor_error_m for o in options], dtype=float),
        np.array([o.tau_s for o in options], dtype=float),
        np.array([o.timeline == "host" for o in options], dtype=bool),
        tuple(columns[: len(keys)]),
        tuple(columns[len(keys) :]),
        tuple(channels),
    )


def _channels(requires: tuple[tuple[str, int], ...], name: str) -> int:
    return sum(count for item, count in requires if item == name)


def useful_options(role: RoleArrays, rate_mps: float, per_sensor: bool) -> RoleArrays:
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
            [t[rows] for t in role.ties],
        )
        if len(rows):
            kept.append(rows[undominated(columns)])
    return role.take(np.sort(np.concatenate(kept)))
