"""A Problem as arrays: resources as integers in a common unit, errors and bounds as floats."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import numpy as np

from syncline_design.choice.option import ResourceName
from syncline_design.choice.options import (
    INT64_ROOM,
    RESOURCES,
    Bools,
    Column,
    Floats,
    Indices,
    Options,
)
from syncline_design.choice.outcome import TooLarge
from syncline_design.choice.pareto import Columns, undominated
from syncline_design.choice.table import Problem
from syncline_design.machine.quick_dataclass import dataclass

MOST_CHANNELS = 1000


@dataclass(frozen=True, slots=True)
class RoleArrays:
    """Options of one role in the order of their names; place: their place in that order.

    error: what an option adds to the total [m], its systematic part included; noise: the sensor
    error alone [m], which the sync requirement is held against; nearer: how much smaller it is at
    the near end of the stage's distances.
    """

    place: Indices
    error: Floats
    noise: Floats
    nearer: Floats
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
            self.nearer[rows],
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
    order: tuple[Indices, ...]  # per role: table index of each place
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
    tracked = _tracked(problem)
    ties = [n for n in RESOURCES if n not in names and _matters(problem, n, tracked)]
    keys, rest = ([_scaled(problem, n, tracked) for n in some] for some in (names, ties))
    orders = tuple(table.options.by_name() for table in problem.roles)
    roles = tuple(
        _role_arrays(problem, table.options.take(order), keys, rest, tracked)
        for table, order in zip(problem.roles, orders, strict=True)
    )
    return Tables(problem, roles, orders, tuple(keys), tuple(rest), tracked)


def _beside(
    problem: Problem, name: ResourceName, tracked: tuple[int, ...]
) -> list[Fraction | None]:
    """Amounts of a resource that clocks and shared hardware take."""
    out = [clock.resources.of(name) for v in problem.vehicles for clock in v.clocks]
    return out + [problem.infrastructure[i].resources.of(name) for i in tracked]


def _matters(problem: Problem, name: ResourceName, tracked: tuple[int, ...]) -> bool:
    """Whether a resource can tell designs apart: not where no design says how much it takes."""
    if any(len(t.options) and t.options.spent(name).is_silent for t in problem.roles):
        return False
    amounts = _beside(problem, name, tracked)
    return any(a is None or a for a in amounts) or any(
        table.options.spent(name).whole.any() for table in problem.roles
    )


def _scaled(problem: Problem, name: ResourceName, tracked: tuple[int, ...]) -> Scaled:
    """The unit in which all amounts of a resource are whole, and how their sums are held."""
    spent = [table.options.spent(name) for table in problem.roles]
    beside = _beside(problem, name, tracked)
    rest = [a for a in (*beside, problem.limits.budget(name)) if a is not None]
    unit = math.lcm(*(one.denominator for one in spent), *(a.denominator for a in rest))
    largest = [one.largest * (unit // one.denominator) for one in spent]
    largest += [int(abs(a * unit)) for a in rest]
    known = all(a is not None for a in beside) and all(one.known for one in spent)
    fits = known and max(largest) * _most_terms(problem) < INT64_ROOM
    return Scaled(name, unit, np.int64 if fits else object, known)


def _most_terms(problem: Problem) -> int:
    """How many amounts a design can add up at most."""
    roles = len(problem.roles) + len(problem.vehicles)
    return roles * (1 + len(problem.infrastructure) * MOST_CHANNELS)


def _tracked(problem: Problem) -> tuple[int, ...]:
    needs = {kind for table in problem.roles for kind in table.options.required}
    needs |= {c.requires for v in problem.vehicles for c in v.clocks}
    wanted = {name for requires in needs for name, _ in requires}
    if any(count > MOST_CHANNELS for requires in needs for _, count in requires):
        raise TooLarge(f"an option that needs more than {MOST_CHANNELS} channels")
    return tuple(i for i, item in enumerate(problem.infrastructure) if item.id in wanted)


def _role_arrays(
    problem: Problem,
    options: Options,
    keys: Sequence[Scaled],
    ties: Sequence[Scaled],
    tracked: tuple[int, ...],
) -> RoleArrays:
    def columns(scales: Sequence[Scaled]) -> tuple[Column, ...]:
        return tuple(options.spent(s.name).scaled(s.denominator, s.dtype) for s in scales)

    channels = tuple(options.channels(problem.infrastructure[i].id) for i in tracked)
    return RoleArrays(
        np.arange(len(options)), options.added, options.error, options.nearer, options.tau,
        options.host,
        columns(keys), columns(ties), channels,
    )  # fmt: skip


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
