"""A problem with some of its options and clocks left out, and the way back to the whole one."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from syncline_design.choice.option import ResourceName
from syncline_design.choice.options import RESOURCES, Bools, Indices, Options
from syncline_design.choice.table import ClockOption, Design, Problem, RoleTable
from syncline_design.machine.quick_dataclass import dataclass


@dataclass(frozen=True, slots=True)
class Narrowed:
    """The smaller problem; options, clocks: places in the whole one, per role and vehicle."""

    problem: Problem
    options: tuple[Indices, ...]
    clocks: tuple[tuple[int, ...], ...]

    @property
    def is_empty(self) -> bool:
        """Whether a role or a vehicle has nothing left to choose."""
        return not all(map(len, self.options)) or not all(self.clocks)

    def whole(self, design: Design) -> Design:
        """A design of the smaller problem as one of the whole problem."""
        return Design(
            tuple(int(places[i]) for places, i in zip(self.options, design.options, strict=True)),
            tuple(places[i] for places, i in zip(self.clocks, design.clocks, strict=True)),
        )

    def within(self, outer: Narrowed) -> Narrowed:
        """This part of another one's problem, as a part of the whole problem."""
        options = zip(outer.options, self.options, strict=True)
        clocks = zip(outer.clocks, self.clocks, strict=True)
        return Narrowed(
            self.problem,
            tuple(places[rows] for places, rows in options),
            tuple(tuple(places[i] for i in rows) for places, rows in clocks),
        )


def narrowed(
    problem: Problem, options: Sequence[Indices], clocks: Sequence[Sequence[int]]
) -> Narrowed:
    """The problem with these options per role and these clocks per vehicle alone."""
    roles = tuple(
        table if len(places) == len(table.options) else _part(table, places)
        for table, places in zip(problem.roles, options, strict=True)
    )
    vehicles = tuple(
        replace(table, clocks=tuple(table.clocks[i] for i in places))
        for table, places in zip(problem.vehicles, clocks, strict=True)
    )
    smaller = replace(problem, roles=roles, vehicles=vehicles)
    return Narrowed(smaller, tuple(options), tuple(map(tuple, clocks)))


def whole_of(problem: Problem) -> Narrowed:
    """The whole problem."""
    return narrowed(
        problem,
        [np.arange(len(table.options)) for table in problem.roles],
        [range(len(table.clocks)) for table in problem.vehicles],
    )


def _part(table: RoleTable, places: Indices) -> RoleTable:
    return replace(table, options=table.options.take(places))


def kept(
    problem: Problem,
    option: Callable[[int, Options], Bools],
    clock: Callable[[int, ClockOption], bool],
) -> Narrowed:
    """The problem with what two tests keep, by (role, its options) and (vehicle, clock)."""
    return narrowed(
        problem,
        [np.flatnonzero(option(r, table.options)) for r, table in enumerate(problem.roles)],
        [
            [i for i, one in enumerate(table.clocks) if clock(v, one)]
            for v, table in enumerate(problem.vehicles)
        ],
    )


def stated(problem: Problem, resource: ResourceName) -> Narrowed:
    """What says how much of a resource it takes, the shared hardware that it requires included.

    An amount that no catalog gives is not 0: what lacks it has no place on a front of it.
    """
    silent = {item.id for item in problem.infrastructure if item.resources.of(resource) is None}

    def says(clock: ClockOption) -> bool:
        needed = {name for name, _ in clock.requires}
        return clock.resources.of(resource) is not None and not silent & needed

    def say(options: Options) -> Bools:
        spent = options.spent(resource)
        quiet = [any(name in silent for name, _ in kind) for kind in options.needs]
        out = ~np.array([*quiet, False])[options.need]
        return out if spent.known else out & (spent.whole != math.inf)

    return kept(problem, lambda _, options: say(options), lambda _, one: says(one))


def says_all(problem: Problem) -> bool:
    """Whether every option, clock and shared hardware says its cost, mass and power."""
    spent = [item.resources for item in problem.infrastructure]
    spent += [clock.resources for table in problem.vehicles for clock in table.clocks]
    said = not any(resources.of(name) is None for resources in spent for name in RESOURCES)
    return said and all(
        table.options.spent(name).known for table in problem.roles for name in RESOURCES
    )
