"""One choice of sensors with every way of stamping it: how many designs that is, and their range.

All combinations at once, as columns: sums of money, mass and power in whole units, errors in
floats; what lies closer to a limit than floats tell is decided exactly, and so are the ends.
"""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np

from syncline_design.choice.evaluate import Evaluation, broken, evaluate
from syncline_design.choice.narrowed import Narrowed, narrowed
from syncline_design.choice.option import ResourceName
from syncline_design.choice.options import MARGIN, RESOURCES, Bools, Column, Floats, Indices, Spent
from syncline_design.choice.table import Design, Pair, Problem
from syncline_design.machine.quick_dataclass import dataclass

MOST_COMBINED = 50_000


@dataclass(frozen=True, slots=True)
class Stampings:
    """Designs of the same sensors that keep every sum: how many, and the ends of their figures.

    cost: in the spec's currency; None where an entry does not say.
    """

    count: int
    cost: tuple[Fraction, Fraction] | None
    error_m: tuple[float, float]


def stampings_of(problem: Problem, design: Design) -> Stampings | None:
    """Every design with the sensors of one; None where there are too many, or none keeps all."""
    part = _same_sensors(problem, design)
    if part.problem.combinations > MOST_COMBINED:
        return None
    every = _Combined(part.problem)
    rows = np.flatnonzero(every.keeps())
    if not len(rows):
        return None
    first, last = (every.exactly(rows[pick(every.error[rows])]) for pick in (np.argmin, np.argmax))
    cost = None
    if (spent := every.spent("cost")) is not None:
        costs = spent.whole[rows]
        cost = (
            Fraction(int(costs.min()), spent.denominator),
            Fraction(int(costs.max()), spent.denominator),
        )
    return Stampings(len(rows), cost, (first.error_m, last.error_m))


def _same_sensors(problem: Problem, design: Design) -> Narrowed:
    options = [
        np.flatnonzero(table.options.sensor == table.options.sensor[place])
        for table, place in zip(problem.roles, design.options, strict=True)
    ]
    return narrowed(problem, options, [range(len(v.clocks)) for v in problem.vehicles])


class _Combined:
    """All combinations of a small problem, one a row; at: place in each role, then vehicle."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        shape = [len(table.options) for table in problem.roles]
        shape += [len(vehicle.clocks) for vehicle in problem.vehicles]
        self.at: list[Indices] = list(np.indices(shape).reshape(len(shape), -1))
        self.noise = self._sum_of_roles("error")
        self.bounds = [self._bound(pair) for pair in problem.pairs]
        self.error = self._total()

    def keeps(self) -> Bools:
        """Which combinations keep every sum."""
        sure, maybe = self._within(1.0 - MARGIN), self._within(1.0 + MARGIN)
        for name in RESOURCES:
            sure &= self._affordable(name)
        for row in np.flatnonzero(maybe & ~self._within(1.0 - MARGIN)).tolist():
            sure[row] = not broken(self.problem, self.exactly(row))
        return sure

    def exactly(self, row: int) -> Evaluation:
        """The sums of one combination in fractions."""
        places = tuple(int(column[row]) for column in self.at)
        roles = len(self.problem.roles)
        return evaluate(self.problem, Design(places[:roles], places[roles:]))

    def spent(self, name: ResourceName) -> Spent | None:
        """A resource of every combination; None where an entry does not say."""
        found = [
            t.options.spent(name).take(self._role(r)) for r, t in enumerate(self.problem.roles)
        ]
        for v, vehicle in enumerate(self.problem.vehicles):
            clocks = Spent.of([clock.resources.of(name) for clock in vehicle.clocks])
            found.append(clocks.take(self._clock(v)))
            found += [self._hardware(name, v, i) for i in range(len(self.problem.infrastructure))]
        total = Spent.of([Fraction(0)]).take(np.zeros(len(self.error), dtype=np.intp))
        for one in found:
            total = total.plus(one)
        return total if total.known else None

    def _role(self, r: int) -> Indices:
        return self.at[r]

    def _clock(self, v: int) -> Indices:
        return self.at[len(self.problem.roles) + v]

    def _sum_of_roles(self, figure: str) -> Floats:
        tables = enumerate(self.problem.roles)
        columns = [getattr(table.options, figure)[self._role(r)] for r, table in tables]
        return np.asarray(np.sum(columns, axis=0))

    def _hardware(self, name: ResourceName, v: int, i: int) -> Spent:
        """What one piece of shared hardware adds on a vehicle, per full set of channels."""
        item = self.problem.infrastructure[i]
        used: Column = np.zeros(len(self.at[0]), dtype=np.int64)
        for r, table in enumerate(self.problem.roles):
            if table.vehicle == v:
                used = used + table.options.channels(item.id)[self._role(r)]
        clocks = self.problem.vehicles[v].clocks
        needs = [sum(n for one, n in clock.requires if one == item.id) for clock in clocks]
        used = used + np.array(needs, dtype=np.int64)[self._clock(v)]
        units = -(-used // item.channels)
        each = item.resources.of(name)
        # None bought is nothing to know.
        amounts = [None if each is None else k * each for k in range(1, int(units.max()) + 1)]
        return Spent.of([Fraction(0), *amounts]).take(units)

    def _bound(self, pair: Pair) -> Floats:
        """Bound of the relative timestamp error of a pair [s]."""
        tau, host, vehicle = self._stamp(pair.role)
        own = np.where(host, self._offset(vehicle), 0.0)
        if pair.reference is None:
            return tau + own
        other_tau, other_host, other = self._stamp(pair.reference)
        theirs = np.where(other_host, self._offset(other), 0.0)
        same = (host == other_host) & (~host | (vehicle == other))
        return np.asarray(tau + other_tau + np.where(same, 0.0, own + theirs))

    def _stamp(self, r: int) -> tuple[Floats, Bools, int]:
        table, places = self.problem.roles[r], self._role(r)
        return table.options.tau[places], table.options.host[places], table.vehicle

    def _offset(self, v: int) -> Floats:
        offsets = [clock.offset_bound_s for clock in self.problem.vehicles[v].clocks]
        return np.array(offsets)[self._clock(v)]

    def _total(self) -> Floats:
        problem = self.problem
        sync: Floats = problem.sync_rate_mps * np.max(self.bounds, axis=0)
        if problem.sync_model == "per_sensor":
            rates = [pair.rate_mps for pair in problem.pairs]
            sync = np.asarray(np.tensordot(rates, np.array(self.bounds), axes=1))
        return np.asarray(self._sum_of_roles("added") + problem.fixed_error_m + sync)

    def _within(self, share: float) -> Bools:
        """Which keep accuracy and sync times a share; options keep their own tau_crit already."""
        limits = self.problem.limits
        keeps = np.ones(len(self.error), dtype=bool)
        if limits.accuracy_m is not None:
            keeps &= self.error <= limits.accuracy_m * share
        if not math.isinf(limits.sync):
            caused = self.problem.sync_rate_mps * np.max(self.bounds, axis=0)
            keeps &= (caused < limits.sync * share * self.noise) | (caused == 0.0)
        return keeps

    def _affordable(self, name: ResourceName) -> Bools:
        budget, count = self.problem.limits.budget(name), len(self.error)
        if budget is None:
            return np.ones(count, dtype=bool)
        spent = self.spent(name)
        if spent is None:  # designs that do not say keep no budget
            return np.array([self._keeps(row, name, budget) for row in range(count)], dtype=bool)
        return np.asarray(spent.whole <= math.floor(budget * spent.denominator))

    def _keeps(self, row: int, name: ResourceName, budget: Fraction) -> bool:
        amount = self.exactly(row).amount(name)
        return amount is not None and amount <= budget
