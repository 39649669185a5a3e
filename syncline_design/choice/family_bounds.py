"""What the roles of a family still to come add at least, over all missions at once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from syncline_design.choice.family_tables import FamilyTables, Ways, clock_of
from syncline_design.choice.options import MARGIN, Bools, Floats
from syncline_design.choice.remaining import Ceiling
from syncline_design.machine.quick_dataclass import dataclass

STEPS = 48  # of the staircases that bound what is still to come


@dataclass(frozen=True, slots=True)
class Steps:
    """Amounts, rising, and the least error of each mission for no more than the next of them.

    Whatever some roles are, in some step they take no less and err no less in any mission.
    error: (missions, steps).
    """

    amount: Floats
    error: Floats

    @classmethod
    def of(cls, amount: Floats, error: Floats) -> Steps:
        """Of the ways of one role; error: (missions, ways)."""
        order = np.argsort(amount, kind="stable")
        lowest = np.minimum.accumulate(error[:, order], axis=1)
        return cls(amount[order].astype(np.float64), lowest).thinned()

    def beside(self, other: Steps) -> Steps:
        """Sums of two such sets of roles, each mission's least by itself."""
        amount = np.add.outer(self.amount, other.amount).ravel()
        error = (self.error[:, :, None] + other.error[:, None, :]).reshape(len(self.error), -1)
        return Steps.of(amount, error)

    def thinned(self) -> Steps:
        """Fewer steps: each takes the least amount and the least errors of those it stands for."""
        changes = np.any(np.diff(self.error, axis=1) < 0, axis=0)
        rows = np.concatenate([[0], 1 + np.flatnonzero(changes)])
        if len(rows) > STEPS:
            rows = rows[np.unique(np.linspace(0, len(rows) - 1, STEPS).astype(np.intp))]
        last = np.append(rows[1:] - 1, self.error.shape[1] - 1)
        return Steps(self.amount[rows], self.error[:, last])


class Rest:
    """Of the roles after each one, and of all but one: what they add at least."""

    def __init__(self, tables: FamilyTables, roles: Sequence[Ways]) -> None:
        self.tables = tables
        own = [Steps.of(ways.amounts[0].astype(np.float64), ways.added) for ways in roles]
        nothing = np.zeros((len(tables.rates), 1))
        self.after = [Steps(np.zeros(1), nothing)]
        for one in own[:0:-1]:
            self.after.insert(0, one.beside(self.after[0]))
        before = [Steps(np.array([least_of_clocks(tables)]), nothing)]
        for one in own[:-1]:
            before.append(before[-1].beside(one))
        self.beside = [a.beside(b) for a, b in zip(before, self.after, strict=True)]
        self.amounts = [self._least(roles, k) for k in range(len(tables.names))]
        self.noise = _suffixes([ways.noise.min(axis=1) for ways in roles])
        self.error = _suffixes([ways.added.min(axis=1) for ways in roles])
        self.waits = self._least_bound(roles)

    def _least(self, roles: Sequence[Ways], k: int) -> list[float]:
        """After each role the least of a resource that later roles take."""
        out = [0.0]
        for ways in list(roles)[:0:-1]:
            out.insert(0, out[0] + float(ways.amounts[k].min()))
        return out

    def _least_bound(self, roles: Sequence[Ways]) -> Floats:
        """Of each mission the least that the largest pair bound can be [s]."""
        out = np.zeros(len(self.tables.rates))
        for pair in self.tables.first.pairs:
            least = roles[pair.role].tau.min(axis=1)
            if pair.reference is not None:
                least = least + roles[pair.reference].tau.min(axis=1)
            out = np.maximum(out, least)
        return out


def least_of_clocks(tables: FamilyTables) -> float:
    """The least of the primary resource that the clocks of all vehicles take together."""
    name = tables.names[0]
    each = (
        min(tables.whole(0, clock_of(tables.family, 0, v, i).resources.of(name)) for i in own)
        for v, own in enumerate(tables.clocks)
    )
    return float(sum(each))


def _suffixes(least: Sequence[Floats]) -> list[Floats]:
    """For each role the sum of what the later roles add at least, of each mission."""
    out = [np.zeros(len(least[0]))]
    for value in list(least)[:0:-1]:
        out.insert(0, out[0] + value)
    return out


def may_matter(
    steps: Steps, amount: Floats, total: Floats, accuracy: Floats, ceiling: Ceiling | None
) -> Bools:
    """Which partial designs may still end within every limit and below every known design.

    amount: (rows,), without clocks; total: (missions, rows), what follows left out.
    """
    out = np.zeros(len(amount), dtype=bool)
    left = np.arange(len(amount))
    room = accuracy[:, None] * (1.0 + MARGIN)
    for more, adds in zip(steps.amount.tolist(), steps.error.T, strict=True):
        reached = total[:, left] + adds[:, None]
        fits = np.asarray((reached <= room).all(axis=0))
        if ceiling is not None:
            known = ceiling.lowest(amount[left] + more)
            fits &= known >= reached.max(axis=0) * (1.0 - MARGIN)
        out[left[fits]] = True
        left = left[~fits]
        if not len(left):
            break
    return out
