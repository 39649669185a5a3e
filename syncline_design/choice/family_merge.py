"""Designs of a family by merging role after role, with every mission's sums carried along.

With the `syncline` model a mission's total is E + rate max(M, what follows), E its sensor and
systematic error, M the largest pair bound so far.  A partial design replaces another that takes no
less and errs no less in any mission: in E, in E + rate M, and in E + rate times what still waits to
meet the reference to come, on either timeline.  Whatever follows, it then ends no worse in any.
What bounds noise from below (tau_sys < limit E / rate) is left out, or, `guarded`, a partial design
that may break it replaces only those with no more noise and no smaller bounds.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from syncline_design.choice.family import FamilyDesign
from syncline_design.choice.family_bounds import Rest, may_matter
from syncline_design.choice.family_tables import (
    HOST,
    UTC,
    FamilyTables,
    Ways,
    clock_of,
    distinct,
)
from syncline_design.choice.options import MARGIN, Bools, Column, Floats, Indices
from syncline_design.choice.outcome import Deadline, TooLarge
from syncline_design.choice.pareto import Columns, undominated
from syncline_design.choice.remaining import Ceiling, StageRoles, stage_roles
from syncline_design.machine.quick_dataclass import dataclass

ROWS = 400_000  # candidates that are looked at together
MOST_PARTIAL = 400_000  # partial designs after which merging gives up
NO_WAIT = -math.inf


@dataclass(frozen=True, slots=True)
class Partial:
    """Partial designs, a column each; arrays are (missions, rows), `waits` (timelines, ...).

    amounts: by resource; noise, error: sensor error alone, and with systematic parts; bound: the
    largest pair bound so far, caused: the sum of sync errors so far (per_sensor model); waits: the
    largest bound (caused: the sum) still to meet the next reference, on each timeline it may have;
    used: channels by vehicle and tracked hardware; choice: (roles so far, rows).
    """

    amounts: tuple[Column, ...]
    noise: Floats
    error: Floats
    bound: Floats
    waits: Floats
    used: tuple[Column, ...]
    choice: Indices

    def __len__(self) -> int:
        return int(self.error.shape[1])

    def take(self, rows: Indices | Bools) -> Partial:
        """Some of them."""
        return Partial(
            tuple(column[rows] for column in self.amounts),
            self.noise[:, rows],
            self.error[:, rows],
            self.bound[:, rows],
            self.waits[:, :, rows],
            tuple(column[:, rows] for column in self.used),
            self.choice[:, rows],
        )

    @staticmethod
    def joined(parts: Sequence[Partial]) -> Partial:
        """All of several."""
        if len(parts) == 1:
            return parts[0]
        return Partial(
            tuple(np.concatenate(c) for c in zip(*(p.amounts for p in parts), strict=True)),
            np.concatenate([p.noise for p in parts], axis=1),
            np.concatenate([p.error for p in parts], axis=1),
            np.concatenate([p.bound for p in parts], axis=1),
            np.concatenate([p.waits for p in parts], axis=2),
            tuple(np.concatenate(c, axis=1) for c in zip(*(p.used for p in parts), strict=True)),
            np.concatenate([p.choice for p in parts], axis=1),
        )


@dataclass(frozen=True, slots=True)
class Complete:
    """Complete designs of one choice of clocks: primary amount, largest error [m], the design."""

    amount: Column
    total: Floats
    places: Indices  # (roles, rows) places of the family's ways
    clocks: tuple[int, ...]

    def __len__(self) -> int:
        return len(self.amount)

    def designs(self, rows: Indices) -> list[FamilyDesign]:
        """Some of them as designs."""
        chosen = self.places[:, rows].T.tolist()
        return [FamilyDesign(tuple(ways), self.clocks) for ways in chosen]


class FamilyMerge:
    """All complete designs that may be on the front, for one choice of clocks at a time."""

    def __init__(
        self,
        tables: FamilyTables,
        roles: Sequence[Ways],
        *,
        accuracy: bool,
        guarded: bool,
        ceiling: Ceiling | None,
        most: int | None = None,
    ) -> None:
        self.tables, self.roles, self.guarded = tables, tuple(roles), guarded
        self.ceiling, self.most = ceiling, most
        none = np.full(len(tables.rates), math.inf)
        self.accuracy = tables.accuracy - tables.fixed if accuracy else none
        if ceiling is not None:  # errors here are without what every design has
            self.ceiling = ceiling
        self.stages = stage_roles(tables.first)
        self.rest = Rest(tables, roles)
        first = tables.first.pairs
        self.pair_rates = [
            {(p.role, p.reference): p.rate_mps for p in problem.pairs}
            for problem in tables.family.problems
        ]
        self.paired = {(p.role, p.reference) for p in first}

    def runs(self, deadline: Deadline) -> Iterator[Complete]:
        """Complete designs for each choice of clocks."""
        for clocks in itertools.product(*self.tables.clocks):
            deadline.check()
            self.clocks = clocks
            self.offsets = np.array(
                [
                    [clock_of(self.tables.family, m, v, i).offset_bound_s
                     for v, i in enumerate(clocks)]
                    for m in range(len(self.tables.rates))
                ]
            )  # fmt: skip
            self.timelines = (UTC, HOST) if (self.offsets != 0.0).any() else (UTC,)
            found = self._run(deadline)
            if found is not None and len(found):
                yield found

    def _run(self, deadline: Deadline) -> Complete | None:
        partial: Partial = self._start()
        for number, stage in enumerate(self.stages):
            roles = (*stage.leaves, *(() if stage.reference is None else (stage.reference,)))
            for role in roles:
                partial = self._extended(partial, role, number, deadline)
                if not len(partial):
                    return None
            if self._is_left(number):
                partial = self._bought(partial, stage.vehicle)
                partial = partial.take(self._kept(partial, stage.last, number))
                if not len(partial):
                    return None
        total = self._totals(partial).max(axis=0)
        order = [ways.place[partial.choice[r]] for r, ways in enumerate(self.roles)]
        return Complete(partial.amounts[0], total, np.array(order), self.clocks)

    def _start(self) -> Partial:
        tables, missions = self.tables, len(self.tables.rates)
        chosen = [clock_of(tables.family, 0, v, i) for v, i in enumerate(self.clocks)]
        amounts = tuple(
            np.array([sum(tables.whole(k, c.resources.of(name)) for c in chosen)])
            for k, name in enumerate(tables.names)
        )
        used = [np.zeros((missions, 1), dtype=np.int64) for _ in range(len(chosen) * self._items)]
        for v, i in enumerate(self.clocks):
            for m in range(missions):
                for item, count in clock_of(tables.family, m, v, i).requires:
                    used[v * self._items + tables.tracked.index(item)][m] += count
        zero = np.zeros((missions, 1))
        waits = np.full((len(self.timelines), missions, 1), 0.0 if tables.per_sensor else NO_WAIT)
        return Partial(
            amounts, zero, zero, zero, waits, tuple(used), np.zeros((0, 1), dtype=np.intp)
        )

    @property
    def _items(self) -> int:
        return len(self.tables.tracked)

    def _is_left(self, number: int) -> bool:
        """Whether a stage is the last of its vehicle."""
        later = [stage.vehicle for stage in self.stages[number + 1 :]]
        return self.stages[number].vehicle not in later

    def _extended(self, partial: Partial, role: int, number: int, deadline: Deadline) -> Partial:
        """Every partial design with every way of a role, those that are worth going on with."""
        ways, parts = self.roles[role], []
        step = max(1, ROWS // max(1, len(ways)))
        for start in range(0, len(partial), step):
            deadline.check()
            some = partial.take(np.arange(start, min(start + step, len(partial))))
            more = self._with(some, ways, role, number)
            parts.append(more.take(self._kept(more, role, number)))
        out = Partial.joined(parts)
        if len(parts) > 1:
            out = out.take(self._kept(out, role, number))
        if self.most is not None and len(out) > self.most:
            order = np.argsort(out.amounts[0], kind="stable")
            spread = np.linspace(0, len(order) - 1, self.most).astype(np.intp)
            out = out.take(np.sort(order[spread]))
        if len(out) > MOST_PARTIAL:
            raise TooLarge(f"more than {MOST_PARTIAL} partial designs of a family")
        return out

    def _with(self, partial: Partial, ways: Ways, role: int, number: int) -> Partial:
        """Each partial design with each way, cut down to what may still matter."""
        left, right = self._worth_making(partial, ways, role)
        stage, own = self.stages[number], partial.take(left)
        added = ways.take(right)
        used = list(own.used)
        for k, channels in enumerate(added.channels):
            at = stage.vehicle * self._items + k
            used[at] = used[at] + channels
        whole = replace(
            own,
            amounts=tuple(a + b for a, b in zip(own.amounts, added.amounts, strict=True)),
            noise=own.noise + added.noise,
            error=own.error + added.added,
            used=tuple(used),
            choice=np.vstack([own.choice, right[None, :]]),
        )
        if role == stage.reference:
            return self._met(whole, added, role, number)
        return self._waiting(whole, added, role, stage)

    def _worth_making(self, partial: Partial, ways: Ways, role: int) -> tuple[Indices, Indices]:
        """Rows and ways that sums alone do not rule out."""
        left = np.repeat(np.arange(len(partial)), len(ways))
        right = np.tile(np.arange(len(ways)), len(partial))
        keep = np.ones(len(left), dtype=bool)
        for k, _ in enumerate(self.tables.names):
            budget = self.tables.budget(k)
            if budget is not None:
                sums = partial.amounts[k][left] + ways.amounts[k][right]
                keep &= sums + self.rest.amounts[k][role] <= budget
        left, right = left[keep], right[keep]
        amount = (partial.amounts[0][left] + ways.amounts[0][right]).astype(np.float64)
        total = partial.error[:, left] + ways.added[:, right] + self._least_caused(partial)[:, left]
        keep = self._may_matter(amount, total, role)
        return left[keep], right[keep]

    def _may_matter(self, amount: Floats, total: Floats, role: int) -> Bools:
        """Which may still end below what is known; total: without what every design has."""
        fixed = self.tables.fixed[:, None]
        limit = self.accuracy + self.tables.fixed
        return may_matter(self.rest.after[role], amount, total + fixed, limit, self.ceiling)

    def _least_caused(self, partial: Partial) -> Floats:
        """Sync error that follows for certain [m]."""
        if self.tables.per_sensor:
            return np.asarray(partial.bound + np.maximum(partial.waits.min(axis=0), 0.0))
        least = np.maximum(partial.bound, self.rest.waits[:, None])
        least = np.maximum(least, partial.waits.min(axis=0))
        return np.asarray(self.tables.rates[:, None] * least)

    def _met(self, partial: Partial, ways: Ways, role: int, number: int) -> Partial:
        """What waited has met the reference of its stage, which waits for the next one's."""
        on = np.where(ways.host, HOST, UTC) if len(self.timelines) > 1 else np.zeros_like(ways.host)
        mission, row = np.indices(on.shape)
        waits = partial.waits[on.astype(np.intp), mission, row]
        if self.tables.per_sensor:
            rate = self._rates_of(role, as_reference=True)[:, None]
            bound = partial.bound + waits + rate * ways.tau
        else:
            bound = np.maximum(partial.bound, waits + ways.tau)
        waiting = np.full_like(partial.waits, 0.0 if self.tables.per_sensor else NO_WAIT)
        following = self.stages[number + 1] if number + 1 < len(self.stages) else None
        partial = replace(partial, bound=bound, waits=waiting)
        if following is None or (role, following.reference) not in self.paired:
            return partial
        return self._waiting(partial, ways, role, following, self.stages[number].vehicle)

    def _waiting(
        self, partial: Partial, ways: Ways, role: int, stage: StageRoles, vehicle: int | None = None
    ) -> Partial:
        """A stamp that is to meet a stage's reference, or true time where there is none.

        vehicle: that of the stamp, where it is not the stage's own.
        """
        if (role, stage.reference) not in self.paired:
            return partial
        own = stage.vehicle if vehicle is None else vehicle
        if stage.reference is None:
            met = ways.tau + np.where(ways.host, self.offsets[:, own][:, None], 0.0)
            rate = self._rates_of(role, as_reference=False)[:, None]
            if self.tables.per_sensor:
                return replace(partial, bound=partial.bound + rate * met)
            return replace(partial, bound=np.maximum(partial.bound, met))
        waits = partial.waits.copy()
        for t in self.timelines:
            apart = ways.tau + self._apart(ways.host, own, t == HOST, stage.vehicle)
            if self.tables.per_sensor:
                waits[t] += self._rate_of((role, stage.reference))[:, None] * apart
            else:
                waits[t] = np.maximum(waits[t], apart)
        return replace(partial, waits=waits)

    def _apart(self, host: Bools, own: int, other_host: bool, other: int) -> Floats:
        """Offset between timelines [s]: 0 on the same one, else both host clocks' against UTC."""
        mine = np.where(host, self.offsets[:, own][:, None], 0.0)
        theirs = self.offsets[:, other][:, None] if other_host else 0.0
        same = (host == other_host) if own == other else ~(host | other_host)
        return np.where(same, 0.0, mine + theirs)

    def _rate_of(self, pair: tuple[int, int | None]) -> Floats:
        return np.array([rates.get(pair, 0.0) for rates in self.pair_rates])

    def _rates_of(self, role: int, *, as_reference: bool) -> Floats:
        """Of each mission the rates of the pairs in which a role is the reference, or the other."""
        return np.array(
            [
                math.fsum(r for pair, r in rates.items() if pair[1 if as_reference else 0] == role)
                for rates in self.pair_rates
            ]
        )

    def _bought(self, partial: Partial, vehicle: int) -> Partial:
        """Channels of a vehicle turned into hardware, for the mission that needs most of it."""
        tables = self.tables
        amounts, used = list(partial.amounts), list(partial.used)
        items = {i.id: i for p in tables.family.problems for i in p.infrastructure}
        for k, name in enumerate(tables.tracked):
            at = vehicle * self._items + k
            units = (-(-used[at] // tables.capacity[k])).max(axis=0)
            for n, resource in enumerate(tables.names):
                amounts[n] = amounts[n] + units * tables.whole(
                    n, items[name].resources.of(resource)
                )
            used[at] = np.zeros_like(used[at])
        return replace(partial, amounts=tuple(amounts), used=tuple(used))

    def _totals(self, partial: Partial) -> Floats:
        """Errors of complete designs [m]."""
        caused = partial.bound
        if not self.tables.per_sensor:
            caused = self.tables.rates[:, None] * caused
        return np.asarray(partial.error + caused + self.tables.fixed[:, None])

    def _kept(self, partial: Partial, role: int, number: int) -> Indices:
        """Rows worth going on with: within limits, below what is known, not replaced."""
        keep = np.ones(len(partial), dtype=bool)
        for k in range(len(self.tables.names)):
            budget = self.tables.budget(k)
            if budget is not None:
                keep &= partial.amounts[k] + self.rest.amounts[k][role] <= budget
        total = partial.error + self._least_caused(partial)
        keep &= self._may_matter(partial.amounts[0].astype(np.float64), total, role)
        rows = np.flatnonzero(keep)
        if len(rows) < 2:
            return rows
        return rows[undominated(self._columns(partial.take(rows), role, number))]

    def _columns(self, partial: Partial, role: int, number: int) -> Columns:
        rates = self.tables.rates[:, None]
        last = role == len(self.roles) - 1
        floats: list[Column] = []
        if self.tables.per_sensor:
            done = partial.error + partial.bound
            floats += [*done] if last else [row for w in partial.waits for row in done + w]
        else:
            floats += [*(partial.error + rates * partial.bound)]
            if not last:
                waiting = np.maximum(partial.waits, 0.0)
                floats += [*partial.error]
                floats += [row for w in waiting for row in partial.error + rates * w]
        if last and not self.guarded:
            floats = [(np.array(floats) + self.tables.fixed[:, None]).max(axis=0)]
        if self.guarded:
            floats += self._guards(partial, role)
        used = [row for column in partial.used for row in column]
        errors = distinct(floats)
        whole = [c for c in distinct([*partial.amounts[1:], *used]) if len(partial)]
        return Columns((partial.amounts[0], *whole, errors[0]), errors[1:])

    def _guards(self, partial: Partial, role: int) -> list[Column]:
        """Noise, negative, and bounds of those that may still break the system's sync limit."""
        tables = self.tables
        rates, limit = tables.rates[:, None], tables.sync[:, None]
        least = partial.noise + self.rest.noise[role][:, None]
        most = np.max([w.tau.max(axis=1) for w in self.roles], axis=0) * 2.0
        most = most + 2.0 * self.offsets.max(axis=1, initial=0.0)
        worst = rates * np.maximum(partial.bound, most[:, None])
        if not tables.per_sensor:
            after = partial.error + self.rest.error[role][:, None]
            worst = np.minimum(worst, self.accuracy[:, None] * (1.0 + MARGIN) - after)
        safe = least * limit * (1.0 - MARGIN) > worst
        out = [*np.where(safe, -math.inf, -partial.noise)]
        out += [*np.where(safe, -math.inf, partial.bound)]
        for waits in partial.waits:
            out += [*np.where(safe, -math.inf, waits)]
        return out
