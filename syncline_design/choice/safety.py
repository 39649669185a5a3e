"""When a partial design satisfies tau_sys < limit * E / rate whatever is added to it.

For a label with error E and largest bound M, and roles still to come with errors e and bounds m:
rate * max(M, m) < limit * (E + sum of e).  It holds for every completion when it holds for M with
the least errors to come, and when for every pair still to come the option with the largest
rate * tau - limit * e still leaves it true.
"""

from __future__ import annotations

import copy

import numpy as np

from syncline_design.choice.arrays import Tables
from syncline_design.choice.labels import Labels
from syncline_design.choice.options import MARGIN, Bools, Floats, Indices
from syncline_design.choice.table import Pair
from syncline_design.machine.quick_dataclass import dataclass


@dataclass(frozen=True, slots=True)
class TimingClass:
    """Options of a reference role that share a timeline, and tau where single; role None: none.

    tau_s: the least of their bounds [s].
    """

    role: int | None
    tau_s: float
    host: bool
    rows: Indices
    single: bool = True

    def met(self, labels: Labels, role: int) -> Floats:
        """Largest pair bound of each label [s], as the reference at best completes it."""
        if self.role is None or role >= self.role:
            return labels.bound
        return np.maximum(labels.bound, labels.meets + self.tau_s)


class Safety:
    """Thresholds of the system's sync constraint; offsets: the largest of each vehicle's clocks."""

    def __init__(self, tables: Tables, offsets: tuple[float, ...]) -> None:
        problem = tables.problem
        self.problem, self.tables, self.offsets = problem, tables, offsets
        self.limit, self.rate = problem.limits.sync, problem.sync_rate_mps
        self.least = [float(role.noise.min()) for role in tables.roles]
        most = [float(role.noise.max()) for role in tables.roles]
        self.least_after = [sum(self.least[r + 1 :]) for r in range(len(most))]
        self.most_after = [sum(most[r + 1 :]) for r in range(len(most))]
        self.deficit = [
            float((self.rate * role.tau - self.limit * role.noise).max()) for role in tables.roles
        ]

    def at(self, vehicle: int, offset_s: float) -> Safety:
        """The same once the clock of a vehicle is chosen."""
        out = copy.copy(self)
        out.offsets = (*self.offsets[:vehicle], offset_s, *self.offsets[vehicle + 1 :])
        return out

    def least_error(self, bound: Floats) -> Floats:
        """The sensor error that a largest bound already demands [m]."""
        return np.asarray(self.rate * bound / self.limit * (1.0 - MARGIN))

    def can_reach(self, labels: Labels, bound: Floats, role: int) -> Bools:
        """Labels that some completion could still lead above the bound."""
        most = labels.noise + self.most_after[role]
        return np.asarray(self.limit * most * (1.0 + MARGIN) > self.rate * bound)

    def safe(self, labels: Labels, bound: Floats, role: int, timing: TimingClass) -> Bools:
        """Labels that satisfy the constraint whatever follows."""
        ends = labels.noise + self.least_after[role]
        own = self.limit * ends * (1.0 - MARGIN) > self.rate * bound
        return np.asarray(own & (labels.noise > self.threshold(role, timing)))

    def threshold(self, role: int, timing: TimingClass) -> float:
        """Sensor error so far above which no pair still to come can break the constraint [m]."""
        worst = -np.inf
        for pair in self.problem.pairs:
            later = [r for r in (pair.role, pair.reference) if r is not None and r > role]
            fixed = pair.reference == timing.role and timing.role is not None
            if not later or (fixed and pair.role <= role):
                continue
            worst = max(worst, self._demand(pair, later, role, timing))
        return worst * (1.0 + MARGIN) if worst > 0 else worst

    def _demand(self, pair: Pair, later: list[int], role: int, timing: TimingClass) -> float:
        """E that a pair still to come may demand, given the least errors of the other roles."""
        need = self.rate * self._largest_offset(pair)
        spared = 0.0
        for member in (pair.role, pair.reference):
            if member is None:
                continue
            if member == timing.role:
                need += self.rate * timing.tau_s
            elif member in later:
                need += self.deficit[member]
                spared += self.least[member]
        return need / self.limit - (self.least_after[role] - spared)

    def _largest_offset(self, pair: Pair) -> float:
        if pair.reference is None:
            return self.offsets[self.problem.roles[pair.role].vehicle]
        own, other = (self.problem.roles[r].vehicle for r in (pair.role, pair.reference))
        return self.offsets[own] + (self.offsets[other] if other != own else 0.0)
