"""How the stages of a chain may be timed: clocks, timing classes, and the bounds that they give."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from syncline_design.choice.arrays import RoleArrays, Tables
from syncline_design.choice.labels import Addition
from syncline_design.choice.options import Bools, Floats
from syncline_design.choice.outlook import Outlook, RoleOptions, Timed
from syncline_design.choice.remaining import StageRoles, stage_roles
from syncline_design.choice.safety import TimingClass
from syncline_design.choice.table import ClockOption

LONG = 5  # stages; on four of 10 sensors x 8 methods and three clocks both take the same
MOST_ITEMS = 3  # pieces of shared hardware whose sets are told apart in what is still to come


class StageTimings:
    """Stages of a problem with the clocks of each vehicle; offsets: of those in force.

    useful: the clocks of each vehicle that no other one of it replaces, by place.
    """

    def __init__(self, tables: Tables, useful: Sequence[Sequence[int]]) -> None:
        self.tables, self.problem = tables, tables.problem
        vehicles = self.problem.vehicles
        self.clocks = [[v.clocks[i] for i in own] for v, own in zip(vehicles, useful, strict=True)]
        self.stages = stage_roles(self.problem)
        self.rates = {(p.role, p.reference): p.rate_mps for p in self.problem.pairs}
        self.rate = self.problem.sync_rate_mps
        self.offsets = tuple(max(c.offset_bound_s for c in clocks) for clocks in self.clocks)
        self.clock = 0

    @property
    def is_coupled(self) -> bool:
        """Whether clocks are to be chosen, or many stages: then partial designs grow many."""
        return len(self.stages) > 2 or any(len(own) > 1 for own in self.clocks)

    @property
    def is_long(self) -> bool:
        """Whether so many stages follow that looking ahead takes less than it spares."""
        return self.is_coupled and len(self.stages) >= LONG

    def is_first(self, number: int) -> bool:
        """Whether a stage is the first of its vehicle."""
        before = [stage.vehicle for stage in self.stages[:number]]
        return self.stages[number].vehicle not in before

    def by_clock(self, vehicle: int) -> Iterator[tuple[int, ClockOption]]:
        """The clocks of a vehicle, each in force while it is looked at."""
        for place, clock in enumerate(self.clocks[vehicle]):
            offset = clock.offset_bound_s
            self.offsets = (*self.offsets[:vehicle], offset, *self.offsets[vehicle + 1 :])
            self.clock = place
            yield place, clock

    def single_classes(self, stage: StageRoles) -> Iterator[TimingClass]:
        """A class for each bound and timeline of the stage's reference."""
        if stage.reference is None:
            yield TimingClass(None, 0.0, False, np.zeros(0, dtype=np.intp))
            return
        role = self.tables.roles[stage.reference]
        pairs = sorted(set(zip(role.tau.tolist(), role.host.tolist(), strict=True)))
        for tau, host in pairs:
            rows = np.flatnonzero((role.tau == tau) & (role.host == host))
            yield TimingClass(stage.reference, tau, host, rows)

    def leaf(self, role: int, stage: StageRoles, timing: TimingClass) -> Addition:
        """What the options of a role add whose pair meets the stage's reference, if any does."""
        options, used_at = self.tables.roles[role], self.used_at(stage)
        rate = self.rates.get((role, timing.role))
        if rate is None:
            return Addition(options, 0.0, used_at)
        own = np.array(self.offsets[stage.vehicle])
        if timing.role is None:
            bound = np.asarray(options.tau + np.where(options.host, own, 0.0))
            return Addition(options, rate, used_at, bound=bound)
        offset = self.offset(options.host, own, stage.vehicle, timing, stage.vehicle)
        return Addition(options, rate, used_at, meets=np.asarray(options.tau + offset))

    def offset(
        self, host: Bools, own: Floats, vehicle: int, timing: TimingClass, other: int
    ) -> Floats:
        """Offset between timelines: 0 on the same one, else both host clocks' against UTC.

        own: that of the first vehicle's clock.
        """
        offset = np.where(host, own, 0.0) + (self.offsets[other] if timing.host else 0.0)
        if vehicle == other:
            return np.where(host == timing.host, 0.0, offset)
        return np.where(host | timing.host, offset, 0.0)

    def used_at(self, stage: StageRoles) -> int:
        """Where the channels of a stage's vehicle start."""
        return stage.vehicle * len(self.tables.tracked)

    def look_ahead(self) -> Outlook:
        """What is still to come after and inside every stage but the first, by largest bound."""
        offsets = self.offsets
        ways = [list(self.timings(number)) for number in range(1, len(self.stages))]
        self.offsets = offsets
        least = math.fsum(float(role.error.min()) for role in self.tables.roles)
        return Outlook(ways, self.rate, least)

    def timings(self, number: int) -> Iterator[Timed]:
        """The clocks and timings that a stage may have."""
        stage, scale = self.stages[number], self.tables.keys[0]
        items = [self.problem.infrastructure[i] for i in self.tables.tracked]
        alone = len(self.problem.vehicles[stage.vehicle].stages) == 1 and len(items) <= MOST_ITEMS
        prices = [float(scale.whole(i.resources.of(scale.name))) for i in items if alone]
        for place, clock in self.by_clock(stage.vehicle):
            spent = scale.whole(clock.resources.of(scale.name)) if self.is_first(number) else 0
            taken = [name for name, _ in clock.requires]
            needs = sum(1 << k for k, item in enumerate(items) if item.id in taken)
            for timing in self.single_classes(stage):
                yield Timed(
                    (number, place, timing.tau_s, timing.host), float(spent),
                    self._chained(number, timing), tuple(self._parts(stage, timing)),
                    needs, tuple(prices),
                )  # fmt: skip

    def _parts(self, stage: StageRoles, timing: TimingClass) -> Iterator[RoleOptions]:
        """The roles of a stage in order, the options of the reference last."""
        for role in stage.leaves:
            added = self.leaf(role, stage, timing)
            met = None if added.meets is None else added.meets + timing.tau_s
            yield _part(added.options, added.bound if met is None else met)
        if timing.role is not None:
            yield _part(self.tables.roles[timing.role].take(timing.rows), None)

    def _chained(self, number: int, timing: TimingClass) -> Floats:
        """Bounds of a stage's reference with those that the stage before may have [s]."""
        own, before = self.stages[number], self.stages[number - 1]
        if (before.reference, timing.role) not in self.rates or before.reference is None:
            return np.zeros(1)
        role, found = self.tables.roles[before.reference], []
        for clock in self.clocks[before.vehicle]:
            offset = self.offsets[own.vehicle]
            if before.vehicle != own.vehicle:
                offset = clock.offset_bound_s
            off = self.offset(role.host, np.array(offset), before.vehicle, timing, own.vehicle)
            found.append(role.tau + off + timing.tau_s)
        return np.unique(np.concatenate(found))


def _part(options: RoleArrays, bound: Floats | None) -> RoleOptions:
    """Options as the outlook takes them."""
    needs = np.zeros(len(options), dtype=np.intp)
    for k, channels in enumerate(options.channels):
        needs |= np.where(channels > 0, 1 << k, 0)
    own = np.zeros(len(options)) if bound is None else bound
    return RoleOptions(options.resources[0].astype(np.float64), options.error, own, needs)
