"""One merge of all roles for given clocks.

Stage by stage, one timing class of the reference at a time, options of one role after the other;
dominated partial designs are dropped on the way.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from syncline_design.choice.arrays import Scaled, Tables, tie_order
from syncline_design.choice.labels import NOT_MET, Addition, Labels, concatenate, extend, total_m
from syncline_design.choice.options import MARGIN, Bools, Column, Floats, Indices
from syncline_design.choice.outcome import Deadline
from syncline_design.choice.outlook import TimingKey
from syncline_design.choice.pareto import Columns, Guard, undominated
from syncline_design.choice.remaining import Ceiling, StageRoles, StillToCome, lowered
from syncline_design.choice.safety import Safety, TimingClass
from syncline_design.choice.stage_timings import StageTimings
from syncline_design.choice.stairs import Stairs
from syncline_design.choice.table import ClockOption, VehicleTable

MANY = 2000  # labels that are looked up in a grid of so many amounts:
GRID = 128
WIDER = 4  # times as many as a first pass goes on with are compared with one another
FEW = 64  # partial designs that are not worth comparing with one another


class Merge(StageTimings):
    """Merging of all roles; `run` gives the complete designs that remain.

    useful: the clocks of each vehicle that no other one of it replaces, by place.  most: partial
    designs that are gone on with after each step, spread over their amounts; then what remains are
    designs, but not the best ones.
    """

    def __init__(
        self,
        tables: Tables,
        useful: Sequence[Sequence[int]],
        *,
        accuracy: bool,
        guarded: bool,
        ceiling: Ceiling | None,
        most: int | None = None,
    ) -> None:
        self.most = most
        super().__init__(tables, useful)
        self.ceiling = ceiling
        self.per_sensor = self.problem.sync_model == "per_sensor"
        self.accuracy_m = self.problem.limits.accuracy_m if accuracy else None
        self.after = StillToCome(tables, self.stages, self.clocks)
        self.safety = Safety(tables, self.offsets) if guarded else None
        self.capacity = _most_channels(tables)
        self.number, self.outlook = 0, None
        known = ceiling is not None and not guarded and tables.keys[0].known
        if known and self.is_long and self.rate > 0.0 and not self.per_sensor:
            self.outlook = self.look_ahead()

    def run(self, deadline: Deadline) -> Labels | None:
        """Complete designs that no other one replaces; None when there is none."""
        labels = self._start()
        for number, stage in enumerate(self.stages):
            complete = number == len(self.stages) - 1 and not self.tables.tracked
            parts = []
            for done in self._ways(labels, number, deadline):
                parts.append(done)
                if complete and self.safety is None:
                    self.ceiling = lowered(self.ceiling, done, total_m(self.problem, done))
            if not parts:
                return None
            labels = concatenate(parts)
            vehicle = self.problem.vehicles[stage.vehicle]
            if self.problem.roles[stage.last].stage == max(vehicle.stages):
                labels = self._buy(labels, stage.vehicle)
                if number < len(self.stages) - 1 and len(parts) > 1:
                    labels = self._left_behind(labels, stage)
        mask = self._within_budgets(labels, len(self.problem.roles) - 1)
        return labels.take(mask)

    def _left_behind(self, labels: Labels, stage: StageRoles) -> Labels:
        """Labels whose vehicle no later stage is on: only how far its reference is off UTC counts.

        To the other vehicles' timelines the offset of its clock is as good as timestamp error.
        """
        own = labels.clocks[:, stage.vehicle]
        offsets = np.array([c.offset_bound_s for c in self.clocks[stage.vehicle]])[own]
        tau = labels.reference_tau + np.where(labels.reference_host, offsets, 0.0)
        labels = replace(labels, reference_tau=tau, reference_host=np.zeros(len(tau), dtype=bool))
        timing = TimingClass(stage.last, 0.0, False, np.zeros(0, dtype=np.intp), single=False)
        return labels.take(self._keep(labels, role=stage.last, timing=timing))

    def _ways(self, labels: Labels, number: int, deadline: Deadline) -> Iterator[Labels]:
        """Labels after one stage, for each clock of its vehicle and timing of its reference."""
        stage = self.stages[number]
        safety = self.safety
        self.number = number
        for place, clock in self.by_clock(stage.vehicle):
            group = self._on_clock(labels, number, place)
            offset = clock.offset_bound_s
            self.safety = None if safety is None else safety.at(stage.vehicle, offset)
            for timing in self._classes(stage, group):
                deadline.check()
                done = self._stage(group, number, timing, clock)
                if len(done):
                    yield done
        self.safety = safety

    def _on_clock(self, labels: Labels, number: int, place: int) -> Labels:
        """Labels whose vehicle has a clock: chosen now where this is the vehicle's first stage."""
        vehicle = self.stages[number].vehicle
        if not self.is_first(number):
            return labels.take(labels.clocks[:, vehicle] == place)
        clocks = labels.clocks.copy()
        clocks[:, vehicle] = place
        return replace(labels, clocks=clocks)

    def _with_clock(self, labels: Labels, vehicle: int, clock: ClockOption) -> Labels:
        """Labels with what a vehicle's clock takes."""
        keys = self._charged(labels.resources, self.tables.keys, clock)
        ties = self._charged(labels.ties, self.tables.ties, clock)
        used = list(labels.used)
        for k, item in enumerate(self.tables.tracked):
            at = vehicle * len(self.tables.tracked) + k
            name = self.problem.infrastructure[item].id
            used[at] = used[at] + sum(n for one, n in clock.requires if one == name)
        return replace(labels, resources=keys, ties=ties, used=tuple(used))

    def _charged(
        self, sums: tuple[Column, ...], scales: tuple[Scaled, ...], clock: ClockOption
    ) -> tuple[Column, ...]:
        """Sums with what a clock takes."""
        each = [scale.whole(clock.resources.of(scale.name)) for scale in scales]
        return tuple(np.asarray(own + one) for own, one in zip(sums, each, strict=True))

    def _start(self) -> Labels:
        nothing = [np.zeros(1, dtype=s.dtype) for s in (*self.tables.keys, *self.tables.ties)]
        cut, vehicles = len(self.tables.keys), len(self.problem.vehicles)
        used = [np.zeros(1, dtype=np.int64) for _ in range(vehicles * len(self.tables.tracked))]
        zero, no_choice = np.zeros(1), np.zeros((1, 0), dtype=np.intp)
        return Labels(
            tuple(nothing[:cut]), tuple(nothing[cut:]), zero, zero, zero, NOT_MET, zero,
            tuple(used), no_choice, np.zeros((1, vehicles), dtype=np.intp), zero, zero > 0,
        )  # fmt: skip

    def _classes(self, stage: StageRoles, labels: Labels) -> Iterator[TimingClass]:
        """Classes of the stage's reference: one for each timeline while no pair has met yet.

        Then every bound grows alike with the reference's (per_sensor: it only adds to a sum); else,
        and where the sync limit is guarded, one for each tau too.  One empty class without any.
        """
        role = None if stage.reference is None else self.tables.roles[stage.reference]
        if role is not None and self.safety is None and (self.per_sensor or not labels.bound.any()):
            for host in sorted(set(role.host.tolist())):
                rows = np.flatnonzero(role.host == host)
                yield TimingClass(stage.reference, float(role.tau[rows].min()), host, rows, False)
            return
        yield from self.single_classes(stage)

    def _stage(
        self, labels: Labels, number: int, timing: TimingClass, clock: ClockOption
    ) -> Labels:
        """Labels after one stage whose reference has this timing."""
        stage, before = self.stages[number], self.stages[number - 1] if number else None
        if before is not None and before.reference is not None:
            labels = self._chain(labels, before, stage, timing)
        if self.is_first(number):
            labels = self._with_clock(labels, stage.vehicle, clock)
        for role in stage.leaves:
            keep = partial(self._keep, role=role, timing=timing)
            labels = extend(labels, self.leaf(role, stage, timing), keep)
        if timing.role is None:
            return labels
        keep = partial(self._keep, role=timing.role, timing=timing)
        rate = math.fsum(r for (_, reference), r in self.rates.items() if reference == timing.role)
        options = self.tables.roles[timing.role].take(timing.rows)
        added = Addition(options, rate, self.used_at(stage), reference=True)
        return extend(labels, added, keep)

    def _chain(
        self, labels: Labels, before: StageRoles, stage: StageRoles, timing: TimingClass
    ) -> Labels:
        """The reference of the stage before is to meet that of this one."""
        rate = self.rates.get((before.reference or 0, timing.role))
        if rate is None:
            return labels
        own = labels.clocks[:, before.vehicle]
        offsets = np.array([c.offset_bound_s for c in self.clocks[before.vehicle]])[own]
        meets = labels.reference_tau + self.offset(
            labels.reference_host, offsets, before.vehicle, timing, stage.vehicle
        )
        labels = replace(labels, meets=meets, sync=labels.sync + rate * meets)
        return labels.take(self._keep(labels, role=before.last, timing=timing))

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
        bound = timing.met(labels, role)
        mask = self._within_budgets(labels, role) & self._within_accuracy(labels, bound, role)
        if self.safety is not None:
            mask &= self.safety.can_reach(labels, bound, role)
        rows = np.flatnonzero(mask)
        if self.ceiling is not None and len(rows):
            rows = rows[self._below_ceiling(labels.take(rows), bound[rows], role, timing)]
        if self.most is not None and len(rows) > WIDER * self.most:
            rows = self._promising(labels, bound, rows, WIDER * self.most)
        if len(rows) <= FEW:
            return rows
        if len(rows) < len(labels):
            labels, bound = labels.take(rows), bound[rows]
        kept = undominated(self._columns(labels, bound, role, timing))
        if self.most is not None and len(kept) > self.most:
            kept = self._promising(labels, bound, kept, self.most)
        return rows[kept]

    def _promising(self, labels: Labels, bound: Floats, rows: Indices, most: int) -> Indices:
        """Of so many groups of rising amounts the one that errs least."""
        total = labels.error[rows] + self._caused(labels, bound)[rows]
        order = np.argsort(labels.resources[0][rows], kind="stable")
        group = np.arange(len(rows)) * most // len(rows)
        first = np.lexsort((total[order], group))
        starts = np.flatnonzero(np.append(True, np.diff(group) > 0))
        return np.sort(rows[order[first[starts]]])

    def _columns(self, labels: Labels, bound: Floats, role: int, timing: TimingClass) -> Columns:
        total = labels.error + (labels.sync if self.per_sensor else self.rate * bound)
        few = [
            used > 0 if self.capacity[i] else used
            for i, used in enumerate(labels.used)
            if used.any()
        ]
        if role == timing.role and not timing.single and role < len(self.problem.roles) - 1:
            few.append(labels.reference_tau)  # the stage to come meets it
        guard = None
        if self.safety is not None:
            safe = self.safety.safe(labels, bound, role, timing)
            guard = Guard(safe, labels.noise, bound)
        value, weak = labels.error, [total]
        if self.per_sensor or role == len(self.problem.roles) - 1:
            value, weak = total, []
        ties = tie_order(self.tables, labels.resources, labels.ties)
        unknown, silent = self.tables.has_unknown_ties, not self.tables.keys[0].known
        return Columns((*labels.resources, value), [*weak, *few], ties, guard, unknown, silent)

    def _within_budgets(self, labels: Labels, role: int) -> Bools:
        mask = np.ones(len(labels), dtype=bool)
        for scale, sums, after in zip(
            self.tables.keys, labels.resources, self.after.resources, strict=True
        ):
            budget = self.problem.limits.budget(scale.name)
            if budget is not None:
                mask &= np.asarray(sums + after[role] <= scale.whole(budget), dtype=bool)
        return mask

    def _caused(self, labels: Labels, bound: Floats) -> Floats:
        """Sync error so far [m], with what every design has."""
        caused = labels.sync if self.per_sensor else self.rate * bound
        return np.asarray(caused + self.problem.fixed_error_m)

    def _demanded(self, labels: Labels, bound: Floats, role: int) -> Floats:
        """Sensor and systematic error that the bound demands of any completion [m]."""
        if self.safety is None:
            return labels.error
        systematic = labels.error - labels.noise + self.after.systematic[role]
        return np.asarray(self.safety.least_error(bound) + systematic)

    def _within_accuracy(self, labels: Labels, bound: Floats, role: int) -> Bools:
        if self.accuracy_m is None:
            return np.ones(len(labels), dtype=bool)
        error = np.maximum(
            labels.error + self.after.error[role], self._demanded(labels, bound, role)
        )
        total = error + self._caused(labels, bound)
        return np.asarray(total <= self.accuracy_m * (1.0 + MARGIN))

    def _below_ceiling(
        self, labels: Labels, bound: Floats, role: int, timing: TimingClass
    ) -> Bools:
        """Labels that may still end cheaper or more accurate than every known design.

        Whatever the roles still to come are, they add no less than some step of their staircase.
        """
        assert self.ceiling is not None
        amount, error = self._owed(labels), labels.error
        known = self._known_to(role, timing)
        if known is not None and self.outlook is not None:
            total = error + self.problem.fixed_error_m
            return self.outlook.may_beat(self.ceiling, self.number, *known, amount, total, bound)
        demanded, caused = self._demanded(labels, bound, role), self._caused(labels, bound)
        steps = self.after.steps[role]
        if self.safety is None and len(labels) > MANY:
            return self._below_on_grid(amount, error + caused, steps)
        out = np.zeros(len(labels), dtype=bool)
        left = np.arange(len(labels))
        for more, adds in zip(steps.amount.tolist(), steps.error.tolist(), strict=True):
            total = np.maximum(error[left] + adds, demanded[left]) + caused[left]
            below = self.ceiling.lowest(amount[left] + more) >= total * (1.0 - MARGIN)
            out[left[below]] = True
            left = left[~below]
            if not len(left):
                break
        return out

    def _known_to(self, role: int, timing: TimingClass) -> tuple[TimingKey | None, int] | None:
        """Where in its stage the outlook looks on from; None where it does not."""
        stage = self.stages[self.number]
        if self.outlook is None:
            return None
        if role == stage.last:
            return None, 0
        key = (self.number, self.clock, timing.tau_s, timing.host)
        if not timing.single or key not in self.outlook.rest:
            return None
        return key, 0 if role < stage.first else stage.leaves.index(role) + 1

    def _owed(self, labels: Labels) -> Floats:
        """Amounts so far, with the shared hardware in use that is not yet paid for."""
        amount, scale = labels.resources[0].astype(np.float64), self.tables.keys[0]
        for at, used in enumerate(labels.used):
            item = self.problem.infrastructure[self.tables.tracked[at % len(self.tables.tracked)]]
            if scale.known and used.any():
                each = scale.whole(item.resources.of(scale.name))
                amount = amount + float(each) * -(-used // item.channels)
        return amount

    def _below_on_grid(self, amount: Floats, total: Floats, steps: Stairs) -> Bools:
        """The same for many labels: what each amount leaves to err, looked up in a grid of them.

        The larger the amount, the less it leaves; between two amounts of the grid the smaller one
        counts, so that none is dropped that may come below.
        """
        assert self.ceiling is not None
        grid = np.unique(np.append(amount[:: len(amount) // GRID], amount.min()))
        known = self.ceiling.lowest(np.add.outer(grid, steps.amount)) * (1.0 + MARGIN)
        leaves = (known - steps.error).max(axis=1)
        return np.asarray(total <= leaves[np.searchsorted(grid, amount, side="right") - 1])


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
