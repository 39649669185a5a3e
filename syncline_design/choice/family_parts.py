"""Parts of a family: with some of the ways and clocks alone, and the way back to the whole one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from syncline_design.choice.family import Family, FamilyDesign
from syncline_design.choice.holding import EntryKind, hold
from syncline_design.choice.option import ResourceName
from syncline_design.choice.options import Bools, Indices

Whole = Callable[[FamilyDesign], FamilyDesign]


def narrowed_family(
    family: Family, places: Sequence[Indices], clocks: Sequence[Indices] | None = None
) -> tuple[Family, Whole]:
    """The family with these ways of each role alone, and how its designs are the whole one's.

    clocks: of each vehicle, where not all stay.
    """
    own = [np.arange(one.shape[1]) for one in family.clocks] if clocks is None else clocks
    roles = tuple(role.take(some) for role, some in zip(family.roles, places, strict=True))
    left = tuple(table[:, some] for table, some in zip(family.clocks, own, strict=True))

    def whole(design: FamilyDesign) -> FamilyDesign:
        ways = (int(some[way]) for some, way in zip(places, design.ways, strict=True))
        chosen = (int(some[one]) for some, one in zip(own, design.clocks, strict=True))
        return FamilyDesign(tuple(ways), tuple(chosen))

    return replace(family, roles=roles, clocks=left), whole


def ways_with(family: Family, r: int, kind: EntryKind, identity: str) -> Bools:
    """Which ways of a role hold an entry in some mission."""
    found = np.zeros(len(family.roles[r]), dtype=bool)
    for problem, places in zip(family.problems, family.roles[r].places, strict=True):
        found |= hold(problem.roles[r].options, kind, identity)[places]
    return found


def without_sensor(family: Family, sensor: str) -> Family:
    """The designs with this sensor in no role of any mission."""
    rows = [
        np.flatnonzero(~ways_with(family, r, "sensor", sensor)) for r in range(len(family.roles))
    ]
    return narrowed_family(family, rows)[0]


def stated_family(family: Family, resource: ResourceName) -> tuple[Family, Whole]:
    """The designs of ways and clocks that say how much of a resource they take."""
    rows = []
    for r, role in enumerate(family.roles):
        says = np.ones(len(role), dtype=bool)
        for problem, places in zip(family.problems, role.places, strict=True):
            options = problem.roles[r].options
            if not options.spent(resource).known:
                known = [one.resources.of(resource) is not None for one in options]
                says &= np.array(known, dtype=bool)[places]
        rows.append(np.flatnonzero(says))
    clocks = []
    for vehicle, own in zip(family.problems[0].vehicles, family.clocks, strict=True):
        told = [vehicle.clocks[i].resources.of(resource) is not None for i in own[0].tolist()]
        clocks.append(np.flatnonzero(told))
    return narrowed_family(family, rows, clocks)


def sensor_groups(family: Family, r: int) -> Indices:
    """Of each way of a role a number that ways of the same sensors, mission by mission, share."""
    columns = []
    for problem, places in zip(family.problems, family.roles[r].places, strict=True):
        names = [option.sensor for option in problem.roles[r].options]
        columns.append(np.unique(names, return_inverse=True)[1].ravel()[places])
    return np.asarray(np.unique(np.array(columns).T, axis=0, return_inverse=True)[1].ravel())


def same_sensors(family: Family, design: FamilyDesign) -> Family:
    """The designs of the same sensors, however they are stamped and whatever clocks there are."""
    rows = []
    for r, way in enumerate(design.ways):
        groups = sensor_groups(family, r)
        rows.append(np.flatnonzero(groups == groups[way]))
    return narrowed_family(family, rows)[0]
