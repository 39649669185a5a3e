"""The mixed-integer program of a family: one set of binaries, the rows of every mission.

A role has a binary for each way of taking it, a vehicle one for each clock; what a mission's option
or clock is, is the sum of the binaries of the ways that take it there.  Accuracy, sync and channels
are rows of each mission, money, mass and power those of what all of them buy together:
  units_(v, h) >= channels used in mission m / channels of a piece, for every m.
As with one mission, what the solver calls optimal is recomputed exactly and cut off where it does
not stand.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from syncline_design.choice.arrays import Tables
from syncline_design.choice.family import (
    Family,
    FamilyDesign,
    broken_by_family,
    evaluate_family,
)
from syncline_design.choice.family_best import primary_of
from syncline_design.choice.family_tables import clock_of, tabulate_family
from syncline_design.choice.milp import ERROR_STEPS, MOST_CUTS, MilpModel, Variables, best_of
from syncline_design.choice.options import Indices
from syncline_design.choice.outcome import Deadline, NoVerdict, TooLarge
from syncline_design.choice.solver import Solver
from syncline_design.choice.table import Problem

# Of all ways together; a program of more takes longer to write than to merge.
MOST_BINARIES = 20_000


def family_by_milp(family: Family, deadline: Deadline) -> FamilyDesign | None:
    """A design of the least objective and, among those, the least error; None if there is none."""
    if family.is_empty:
        return None
    count = sum(len(role) for role in family.roles)
    if count > MOST_BINARIES:
        raise TooLarge(
            f"{count} ways of taking the roles are too many for the integer program of a family "
            f"(at most {MOST_BINARIES}); leave --road out"
        )
    solver = Solver(deadline)
    solver.demand_canary()
    model = _FamilyModel(family, solver.cp, deadline)
    if family.objective == "error":
        return model.solve(solver, model.objective())
    resource = family.objective
    return best_of(model, solver, lambda design: evaluate_family(family, design).amount(resource))


class _FamilyModel:
    """Variables of a family, rows of all its missions."""

    def __init__(self, family: Family, cp: Any, deadline: Deadline) -> None:
        self.family, self.cp = family, cp
        self.tables = tabulate_family(family, primary_of(family))
        first = family.problems[0]
        self.x = [cp.Variable(len(role), boolean=True) for role in family.roles]
        self.c = [cp.Variable(own.shape[1], boolean=True) for own in family.clocks]
        self.units = {
            (v, name): cp.Variable(integer=True)
            for v in range(len(first.vehicles))
            for name in self.tables.tracked
        }
        self.rows: list[Any] = [cp.sum(one) == 1 for one in (*self.x, *self.c)]
        self.rows += [units >= 0 for units in self.units.values()]
        self.missions = [
            MilpModel(problem, cp, deadline, self._seen_by(m))
            for m, problem in enumerate(family.problems)
        ]
        for mission in self.missions:
            self.rows += mission.rows
        for k in range(len(self.tables.names)):
            budget = self.tables.budget(k)
            if budget is not None:
                scale = max(1, budget)
                self.rows.append(self._amount(k, 1.0 / scale) <= budget / scale)

    def _seen_by(self, mission: int) -> Any:
        """How the variables of the family are those of one of its missions."""
        family = self.family

        def seen(tables: Tables) -> Variables:
            problem = family.problems[mission]
            x = [
                _sums(role.places[mission], order) @ own
                for role, order, own in zip(family.roles, tables.order, self.x, strict=True)
            ]
            c = [
                _sums(places[mission], np.arange(len(vehicle.clocks))) @ own
                for places, vehicle, own in zip(
                    family.clocks, problem.vehicles, self.c, strict=True
                )
            ]
            return Variables(x, c, self._units_of(problem, tables))

        return seen

    def _units_of(self, problem: Problem, tables: Tables) -> dict[tuple[int, int], Any]:
        return {
            (v, k): self.units[v, problem.infrastructure[place].id]
            for v in range(len(problem.vehicles))
            for k, place in enumerate(tables.tracked)
        }

    def _amount(self, k: int, factor: float) -> Any:
        """What the family takes of a resource, in whole units times a factor."""
        tables, name = self.tables, self.tables.names[k]
        total: Any = sum(
            (ways.amounts[k].astype(float) * factor) @ self.x[r]
            for r, ways in enumerate(tables.roles)
        )
        for v, places in enumerate(tables.clocks):
            own = [clock_of(self.family, 0, v, place).resources.of(name) for place in places]
            total = total + np.array([tables.whole(k, a) * factor for a in own]) @ self.c[v]
        items = {one.id: one for p in self.family.problems for one in p.infrastructure}
        for (_, identity), units in self.units.items():
            each = tables.whole(k, items[identity].resources.of(name))
            total = total + each * factor * units
        return total

    def objective(self) -> Any:
        """What is minimised first."""
        return self.error() if self.family.objective == "error" else self._amount(0, 1.0)

    def error(self) -> Any:
        """The largest total of any mission, in small parts of a typical one.

        The rows are in typical errors: in small parts they would not hold to the tolerances.
        """
        least = max(
            sum(float(role.error.min()) for role in mission.tables.roles)
            for mission in self.missions
        )
        scale = least or 1.0
        largest = self.cp.Variable()
        for mission in self.missions:
            fixed = mission.problem.fixed_error_m / scale
            self.rows.append(mission.total(scale) + fixed <= largest)
        return ERROR_STEPS * largest

    def hold_objective(self, design: FamilyDesign) -> None:
        """No more of the objective than this design takes."""
        spent = evaluate_family(self.family, design).amount(self.tables.names[0])
        amount = self.tables.whole(0, spent)
        scale = max(1, amount)
        self.rows.append(self._amount(0, 1.0 / scale) <= amount / scale)

    def solve(self, solver: Solver, objective: Any) -> FamilyDesign | None:
        """The best design that stands up to exact arithmetic; None when proven that none is."""
        for _ in range(MOST_CUTS):
            program = self.cp.Problem(self.cp.Minimize(objective), self.rows)
            if solver.run(program) == "infeasible":
                return None
            ways = tuple(int(np.argmax(x.value)) for x in self.x)
            clocks = tuple(int(np.argmax(c.value)) for c in self.c)
            design = FamilyDesign(ways, clocks)
            if not broken_by_family(self.family, evaluate_family(self.family, design)):
                return design
            chosen = [x[i] for x, i in zip((*self.x, *self.c), (*ways, *clocks), strict=True)]
            self.rows.append(sum(chosen) <= len(chosen) - 1)
        raise NoVerdict(
            f"{MOST_CUTS} payloads in a row were optimal to the MILP solver and did not stand up "
            "to the exact recheck"
        )


def _sums(places: Indices, order: Indices) -> Any:
    """The matrix that adds up the ways that take each option; order: the options of its rows."""
    from scipy.sparse import csr_matrix

    row_of = np.empty(max(int(order.max(initial=0)), int(places.max(initial=0))) + 1, dtype=np.intp)
    row_of[order] = np.arange(len(order))
    shape = (len(order), len(places))
    ones = np.ones(len(places))
    return csr_matrix((ones, (row_of[places], np.arange(len(places)))), shape=shape)
