"""What partial designs have to beat, and what the roles still to come add at least."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from syncline_design.choice.arrays import Tables
from syncline_design.choice.labels import Labels
from syncline_design.choice.options import MARGIN, Column, Floats
from syncline_design.choice.stairs import NO_ROLES, Stairs, stairs
from syncline_design.choice.table import ClockOption, Problem
from syncline_design.machine.quick_dataclass import dataclass

STEPS = 64  # of the staircases that bound what is still to come


@dataclass(frozen=True, slots=True)
class Ceiling:
    """Designs already known to be feasible: rising amounts with their falling errors."""

    amount: Column
    total: Floats

    def lowest(self, amount: Floats) -> Floats:
        """The least error among known designs of no larger amount; infinite where there is none."""
        known = self.amount.astype(np.float64)
        place = np.searchsorted(known, amount * (1.0 - MARGIN), side="right")
        return np.asarray(np.append(np.inf, self.total)[place])


def lowered(ceiling: Ceiling | None, labels: Labels, total: Floats) -> Ceiling:
    """A ceiling with further complete designs."""
    amount = labels.resources[0]
    if ceiling is not None:
        amount = np.concatenate([ceiling.amount, amount])
        total = np.concatenate([ceiling.total, total])
    order = np.lexsort((total, amount))
    amount, total = amount[order], total[order]
    steps = np.flatnonzero(total < np.minimum.accumulate(np.append(np.inf, total[:-1])))
    return Ceiling(amount[steps], total[steps])


@dataclass(frozen=True, slots=True)
class StageRoles:
    """Role indices of one stage: those timed against its reference, then the reference."""

    vehicle: int
    leaves: tuple[int, ...]
    reference: int | None

    @property
    def first(self) -> int:
        """Index of the first role decided in this stage."""
        return (*self.leaves, self.last)[0]

    @property
    def last(self) -> int:
        """Index of the last role decided in this stage."""
        return self.leaves[-1] if self.reference is None else self.reference


def stage_roles(problem: Problem) -> tuple[StageRoles, ...]:
    """Roles by stage, in order."""
    out = []
    for stage in sorted({role.stage for role in problem.roles}):
        here = [r for r, role in enumerate(problem.roles) if role.stage == stage]
        reference = [r for r in here if problem.roles[r].role == "ranging"]
        leaves = tuple(r for r in here if r not in reference)
        vehicle = problem.roles[here[0]].vehicle
        out.append(StageRoles(vehicle, leaves, reference[0] if reference else None))
    return tuple(out)


class StillToCome:
    """What the roles still to come add at least, after each role."""

    def __init__(
        self,
        tables: Tables,
        stages: Sequence[StageRoles],
        clocks: Sequence[Sequence[ClockOption]],
    ) -> None:
        roles = tables.roles
        first = [min(s.first for s in stages if s.vehicle == v) for v in range(len(clocks))]
        self.resources = []
        for k, scale in enumerate(tables.keys):
            each = [role.resources[k].min() for role in roles]
            for own, r in zip(clocks, first, strict=True):  # chosen just before that role
                each[r] = each[r] + min(scale.whole(c.resources.of(scale.name)) for c in own)
            self.resources.append(_after(each, 0))
        self.error = _after([role.error.min() for role in roles], 0.0)
        self.systematic = _after([(role.error - role.noise).min() for role in roles], 0.0)
        self.steps = [NO_ROLES]
        for r in range(len(roles) - 1, 0, -1):
            here = stairs(roles[r].resources[0].astype(np.float64), roles[r].error, STEPS)
            if r in first:
                scale = tables.keys[0]
                offered = clocks[first.index(r)]
                least = min(scale.whole(c.resources.of(scale.name)) for c in offered)
                here = Stairs(here.amount + float(least), here.error)
            self.steps.insert(0, here.beside(self.steps[0], STEPS))


def _after(least: list[Any], zero: float) -> list[Any]:
    """For each role the sum of what the later roles add at least."""
    out = [zero]
    for value in reversed(least[1:]):
        out.append(out[-1] + value)
    return out[::-1]
