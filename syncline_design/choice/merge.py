"""One merge of all roles for given clocks.

Stage by stage, one timing class of the reference at a time, options of one role after the other;
dominated partial designs are dropped on the way.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from syncline_design.choice.arrays import RoleArrays, Tables, tie_order
from syncline_design.choice.labels import Addition, Labels, concatenate, extend, total_m, with_pair
from syncline_design.choice.options import MARGIN, Bools, Column, Floats, Indices
from syncline_design.choice.outcome import Deadline
from syncline_design.choice.pareto import Columns, Guard, undominated
from syncline_design.choice.safety import Safety, TimingClass
from syncline_design.choice.table import Problem, VehicleTable

FEW = 64  # partial designs that are not worth comparing with one another


@dataclass(frozen=True, slots=True)
class Ceiling:
    """Designs already known to be feasible: rising amounts with their falling errors."""

    amount: Column
    total: Floats


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


class Merge:
    """Merging for one combination of clocks; `run` gives the complete designs that remain."""

    def __init__(
        self,
        tables: Tables,
        clocks: tuple[int, ...],
        *,
        accuracy: bool,
        guarded: bool,
        ceiling: Ceiling | None,
    ) -> None:
        self.tables, self.problem, self.ceiling = tables, tables.problem, ceiling
        self.clocks = [v.clocks[i] for v, i in zip(self.problem.vehicles, clocks, strict=True)]
        self.offsets = tuple(clock.offset_bound_s for clock in self.clocks)
        self.stages = stage_roles(self.problem)
        self.rates = {(p.role, p.reference): p.rate_mps for p in self.problem.pairs}
        self.rate = self.problem.sync_rate_mps
        self.per_sensor = self.problem.sync_model == "per_sensor"
        self.accuracy_m = self.problem.limits.accuracy_m if accuracy else None
        self.error_after = _after([role.error.min() for role in tables.roles], 0.0)
        self.resources_after = [
            _after([role.resources[k].min() for role in tables.roles], 0)
            for k in range(len(tables.keys))
        ]
        self.systematic_after = _after([(r.error - r.noise).min() for r in tables.roles], 0.0)
        self.safety = Safety(tables, self.offsets) if guarded else None
        self.capacity = _most_channels(tables)

    def run(self, deadline: Deadline) -> Labels | None:
        """Complete designs that no other one replaces; None when there is none."""
        labels = self._start()
        for number, stage in enumerate(self.stages):
            parts = []
            complete = number == len(self.stages) - 1 and not self.tables.tracked
            for timing in self._classes(stage):
                deadline.check()
                done = self._stage(labels, number, timing)
                if len(done):
                    parts.append(done)
                    if complete and self.safety is None:
                        self.ceiling = lowered(self.ceiling, done, total_m(self.problem, done))
            if not parts:
                return None
            labels = concatenate(parts)
            vehicle = self.problem.vehicles[stage.vehicle]
            if self.problem.roles[stage.last].stage == max(vehicle.stages):
                labels = self._buy(labels, stage.vehicle)
        mask = self._within_budgets(labels, len(self.problem.roles) - 1)
        return labels.take(mask)

    def _start(self) -> Labels:
        scales = (*self.tables.keys, *self.tables.ties)
        sums = [
            np.array([sum(s.whole(c.resources.of(s.name)) for c in self.clocks)], dtype=s.dtype)
            for s in scales
        ]
        items = [self.problem.infrastructure[i].id for i in self.tables.tracked]
        used = [
            np.array([sum(n for name, n in clock.requires if name == item)])
            for clock in self.clocks
            for item in items
        ]
        zero, cut = np.zeros(1), len(self.tables.keys)
        choice = np.zeros((1, 0), dtype=np.intp)
        return Labels(
            tuple(sums[:cut]),
            tuple(sums[cut:]),
            zero,
            zero,
            zero,
            zero,
            tuple(used),
            choice,
            zero,
            zero > 0,
        )

    def _classes(self, stage: StageRoles) -> Iterator[TimingClass]:
        """Distinct (tau, timeline) of the stage's reference; one empty class without one."""
        if stage.reference is None:
            yield TimingClass(None, 0.0, False, np.zeros(0, dtype=np.intp))
            return
        role = self.tables.roles[stage.reference]
        pairs = sorted(set(zip(role.tau.tolist(), role.host.tolist(), strict=True)))
        for tau, host in pairs:
            rows = np.flatnonzero((role.tau == tau) & (role.host == host))
            yield TimingClass(stage.reference, tau, host, rows)

    def _stage(self, labels: Labels, number: int, timing: TimingClass) -> Labels:
        """Labels after one stage whose reference has this timing."""
        stage, before = self.stages[number], self.stages[number - 1] if number else None
        if before is not None and before.reference is not None:
            labels = self._chain(labels, before, stage, timing)
        for role in stage.leaves:
            options = self.tables.roles[role]
            bound = self._leaf_bound(role, options, stage, timing)
            rate = self.rates.get((role, timing.role), 0.0)
            keep = partial(self._keep, role=role, timing=timing)
            labels = extend(labels, Addition(options, bound, rate, self._used_at(stage)), keep)
        if timing.role is None:
            return labels
        keep = partial(self._keep, role=timing.role, timing=timing)
        options = self.tables.roles[timing.role].take(timing.rows)
        labels = extend(labels, Addition(options, None, 0.0, self._used_at(stage)), keep)
        tau, host = np.full(len(labels), timing.tau_s), np.full(len(labels), timing.host)
        return replace(labels, reference_tau=tau, reference_host=host)

    def _chain(
        self, labels: Labels, before: StageRoles, stage: StageRoles, timing: TimingClass
    ) -> Labels:
        """The pair of two stages' references meets."""
        rate = self.rates.get((before.reference or 0, timing.role))
        if rate is None:
            return labels
        bound = labels.reference_tau + timing.tau_s
        bound = bound + self._offset(labels.reference_host, before.vehicle, timing, stage.vehicle)
        labels = with_pair(labels, bound, rate)
        return labels.take(self._keep(labels, role=before.last, timing=timing))

    def _leaf_bound(
        self, role: int, options: RoleArrays, stage: StageRoles, timing: TimingClass
    ) -> Floats | None:
        if (role, timing.role) not in self.rates:
            return None
        if timing.role is None:
            return np.asarray(options.tau + self._from_utc(options.host, stage.vehicle))
        offset = self._offset(options.host, stage.vehicle, timing, stage.vehicle)
        return np.asarray(options.tau + timing.tau_s + offset)

    def _offset(self, host: Bools, vehicle: int, timing: TimingClass, other: int) -> Floats:
        """Offset between timelines: 0 on the same one, else both host clocks' against UTC."""
        theirs = self.offsets[other] if timing.host else 0.0
        offset = self._from_utc(host, vehicle) + theirs
        if vehicle == other:
            return np.where(host == timing.host, 0.0, offset)
        return np.where(host | timing.host, offset, 0.0)

    def _from_utc(self, host: Bools, vehicle: int) -> Floats:
        """Offset of timelines from UTC: the host clock's, or none."""
        return np.where(host, self.offsets[vehicle], 0.0)

    def _used_at(self, stage: StageRoles) -> int:
        return stage.vehicle * len(self.tables.tracked)

    def _buy(self, labels: Labels, vehicle: int) -> Labels:
        """Channels of a vehicle turned into whole units of shared hardware and paid for."""
        keys, ties, used = list(labels.resources), list(labels.ties), list(labels.used)
        for k, item in enumerate(self.tables.tracked):
            at = vehicle * len(self.tables.tracked) + k
            hardware = self.problem.infrastructure[item]
            units = -(-used[at] // hardware.channels)
            for sums, scales in ((keys, self.tables.keys), (ties, self.tables.ties)):
                for i, scale in enumerate(scales):
                    each = scale.whole(hardware.resources.of(scale.name))
                    if each == math.inf:  # none bought is nothing to know
                        bought: Column = np.where(units > 0, np.array(each, dtype=object), 0)
                    else:
                        bought = units.astype(scale.dtype) * each
                    sums[i] = sums[i] + bought
            used[at] = np.zeros_like(used[at])
        return replace(labels, resources=tuple(keys), ties=tuple(ties), used=tuple(used))

    def _keep(self, labels: Labels, *, role: int, timing: TimingClass) -> Indices:
        """Rows worth going on with after a role is decided."""
        mask = self._within_budgets(labels, role) & self._within_accuracy(labels, role)
        if self.safety is not None:
            mask &= self.safety.can_reach(labels, role)
        rows = np.flatnonzero(mask)
        if len(rows) < len(labels):
            labels = labels.take(rows)
        if self.ceiling is not None and len(rows):
            below = self._below_ceiling(labels, role)
            rows, labels = rows[below], labels.take(below)
        if len(rows) <= FEW:
            return rows
        return rows[undominated(self._columns(labels, role, timing))]

    def _columns(self, labels: Labels, role: int, timing: TimingClass) -> Columns:
        total = labels.error + (labels.sync if self.per_sensor else self.rate * labels.bound)
        used = [
            used > 0 if self.capacity[i] else used
            for i, used in enumerate(labels.used)
            if used.any()
        ]
        guard = None
        if self.safety is not None:
            safe = self.safety.safe(labels, role, timing)
            guard = Guard(safe, labels.noise, labels.bound)
        value, weak = labels.error, [total]
        if self.per_sensor or role == len(self.problem.roles) - 1:
            value, weak = total, []
        ties = tie_order(self.tables, labels.resources, labels.ties)
        unknown, silent = self.tables.has_unknown_ties, not self.tables.keys[0].known
        return Columns((*labels.resources, value), [*weak, *used], ties, guard, unknown, silent)

    def _within_budgets(self, labels: Labels, role: int) -> Bools:
        mask = np.ones(len(labels), dtype=bool)
        for scale, sums, after in zip(
            self.tables.keys, labels.resources, self.resources_after, strict=True
        ):
            budget = self.problem.limits.budget(scale.name)
            if budget is not None:
                mask &= np.asarray(sums + after[role] <= scale.whole(budget), dtype=bool)
        return mask

    def _least_total(self, labels: Labels, role: int) -> Floats:
        caused = labels.sync if self.per_sensor else self.rate * labels.bound
        error = labels.error + self.error_after[role]
        if self.safety is not None:
            systematic = labels.error - labels.noise + self.systematic_after[role]
            error = np.maximum(error, self.safety.least_error(labels) + systematic)
        return np.asarray(error + self.problem.fixed_error_m + caused)

    def _within_accuracy(self, labels: Labels, role: int) -> Bools:
        if self.accuracy_m is None:
            return np.ones(len(labels), dtype=bool)
        return np.asarray(self._least_total(labels, role) <= self.accuracy_m * (1.0 + MARGIN))

    def _below_ceiling(self, labels: Labels, role: int) -> Bools:
        """Labels that may still end cheaper or more accurate than every known design."""
        assert self.ceiling is not None
        amounts = labels.resources[0] + self.resources_after[0][role]
        place = np.searchsorted(self.ceiling.amount, amounts, side="right") - 1
        best = np.where(place >= 0, self.ceiling.total[np.maximum(place, 0)], np.inf)
        return np.asarray(self._least_total(labels, role) <= best * (1.0 + MARGIN))


def _after(least: list[float], zero: float) -> list[float]:
    """For each role the sum of what the later roles add at least."""
    out = [zero]
    for value in reversed(least[1:]):
        out.append(out[-1] + value)
    return out[::-1]


def _most_channels(tables: Tables) -> list[bool]:
    """Per (vehicle, shared hardware): whether one unit serves any design of that vehicle."""
    problem = tables.problem
    return [
        _most(tables, v, vehicle, k) <= problem.infrastructure[item].channels
        for v, vehicle in enumerate(problem.vehicles)
        for k, item in enumerate(tables.tracked)
    ]


def _most(tables: Tables, v: int, vehicle: VehicleTable, k: int) -> int:
    name = tables.problem.infrastructure[tables.tracked[k]].id
    most = sum(
        int(role.channels[k].max())
        for role, table in zip(tables.roles, tables.problem.roles, strict=True)
        if table.vehicle == v
    )
    return most + max(sum(n for item, n in c.requires if item == name) for c in vehicle.clocks)
