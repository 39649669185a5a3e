"""A problem with some of its options and clocks left out, and the way back to the whole one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from syncline_design.choice.table import (
    RESOURCES,
    ClockOption,
    Design,
    Option,
    Problem,
    ResourceName,
    Resources,
)


@dataclass(frozen=True, slots=True)
class Narrowed:
    """The smaller problem; options, clocks: places in the whole one, per role and vehicle."""

    problem: Problem
    options: tuple[tuple[int, ...], ...]
    clocks: tuple[tuple[int, ...], ...]

    @property
    def is_empty(self) -> bool:
        """Whether a role or a vehicle has nothing left to choose."""
        return not all(self.options) or not all(self.clocks)

    def whole(self, design: Design) -> Design:
        """A design of the smaller problem as one of the whole problem."""
        return Design(
            tuple(places[i] for places, i in zip(self.options, design.options, strict=True)),
            tuple(places[i] for places, i in zip(self.clocks, design.clocks, strict=True)),
        )


def narrowed(
    problem: Problem, options: Sequence[Sequence[int]], clocks: Sequence[Sequence[int]]
) -> Narrowed:
    """The problem with these options per role and these clocks per vehicle alone."""
    roles = tuple(
        replace(table, options=tuple(table.options[i] for i in places))
        for table, places in zip(problem.roles, options, strict=True)
    )
    vehicles = tuple(
        replace(table, clocks=tuple(table.clocks[i] for i in places))
        for table, places in zip(problem.vehicles, clocks, strict=True)
    )
    smaller = replace(problem, roles=roles, vehicles=vehicles)
    return Narrowed(smaller, tuple(map(tuple, options)), tuple(map(tuple, clocks)))


def kept(
    problem: Problem,
    option: Callable[[int, Option], bool],
    clock: Callable[[int, ClockOption], bool],
) -> Narrowed:
    """The problem with what two tests keep, by (role, option) and (vehicle, clock)."""
    return narrowed(
        problem,
        [
            [i for i, one in enumerate(table.options) if option(r, one)]
            for r, table in enumerate(problem.roles)
        ],
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

    def says(one: Option | ClockOption) -> bool:
        resources: Resources = one.resources
        needed = {name for name, _ in one.requires}
        return resources.of(resource) is not None and not silent & needed

    return kept(problem, lambda _, one: says(one), lambda _, one: says(one))


def says_all(problem: Problem) -> bool:
    """Whether every option, clock and shared hardware says its cost, mass and power."""
    spent = [item.resources for item in problem.infrastructure]
    spent += [option.resources for table in problem.roles for option in table.options]
    spent += [clock.resources for table in problem.vehicles for clock in table.clocks]
    return not any(resources.of(name) is None for resources in spent for name in RESOURCES)
