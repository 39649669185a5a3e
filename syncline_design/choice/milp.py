"""The mixed-integer program through cvxpy and HiGHS: the general road and second opinion.

Variables: one binary per option and clock, an integer per vehicle and shared hardware, and one
binary z_k per value T_k that tau_sys can take.  Which pair bound demands which ceiling is said by
0/1 rows (y_a + y_b - 1 <= sum of z_k with T_k >= bound), so no time in seconds enters the matrix;
errors are scaled by the limit of their row, and resources are whole cents, grams, milliwatts.
HiGHS drops coefficients at or below 1e-9 and accepts violations of 1e-6: a design that it calls
optimal is therefore recomputed exactly, and excluded by a cut when it does not stand.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import field
from fractions import Fraction
from typing import Any, Protocol, TypeVar

import numpy as np

from syncline_design.choice.arrays import Scaled, Tables, tabulate
from syncline_design.choice.evaluate import broken, evaluate
from syncline_design.choice.option import ResourceName
from syncline_design.choice.options import MARGIN
from syncline_design.choice.outcome import Deadline, NoVerdict
from syncline_design.choice.solver import Solver
from syncline_design.choice.table import Design, Pair, Problem, is_empty
from syncline_design.machine.quick_dataclass import dataclass

D = TypeVar("D")
MOST_CUTS = 40
MOST_DEMANDS = 10_000
ERROR_STEPS = 1e6  # the error objective counts millionths of a typical error


def best_by_milp(problem: Problem, deadline: Deadline) -> Design | None:
    """A design with the least objective and, among those, the least error; None if none is."""
    if is_empty(problem):
        return None
    solver = Solver(deadline)
    solver.demand_canary()
    model = MilpModel(problem, solver.cp, deadline)
    if problem.objective == "error":
        return model.solve(solver, model.objective())
    resource = problem.objective
    return best_of(model, solver, lambda design: evaluate(problem, design).amount(resource))


class Program(Protocol[D]):
    """An integer program whose solutions stand up to exact arithmetic."""

    def objective(self) -> Any:
        """What is minimised first."""

    def error(self) -> Any:
        """What is minimised among those of the least objective."""

    def hold_objective(self, design: D) -> None:
        """No more of the objective than this design takes."""

    def solve(self, solver: Solver, objective: Any) -> D | None:
        """The best design; None when proven that none is."""


def best_of(
    program: Program[D], solver: Solver, amount: Callable[[D], Fraction | None]
) -> D | None:
    """Of the designs of the least amount the one of the least error; None if there is none."""
    first = program.solve(solver, program.objective())
    if first is None:
        return None
    program.hold_objective(first)
    second = program.solve(solver, program.error())
    return first if second is None or amount(second) != amount(first) else second


@dataclass(frozen=True, slots=True)
class _TimingClass:
    """Options of a role that share tau and timeline."""

    tau: float
    host: bool
    rows: np.ndarray


@dataclass(frozen=True, slots=True)
class Variables:
    """What is decided: options by role, clocks by vehicle, units by (vehicle, tracked hardware)."""

    x: list[Any]
    c: list[Any]
    units: dict[tuple[int, int], Any]


@dataclass
class MilpModel:
    """Variables and rows of one problem.

    shared: of a mission, its variables by those of its family, which holds the budgets as well.
    """

    problem: Problem
    cp: Any
    deadline: Deadline
    shared: Callable[[Tables], Variables] | None = None
    tables: Tables = field(init=False)
    rows: list[Any] = field(init=False, default_factory=list)

    def __post_init__(self) -> None:
        objective: ResourceName = (
            "cost" if self.problem.objective == "error" else self.problem.objective
        )
        self.tables = tabulate(self.problem, objective)
        cp = self.cp
        given = self._variables() if self.shared is None else self.shared(self.tables)
        self.x, self.c, self.units = given.x, given.c, given.units
        self.classes = [list(_classes(self.tables, r)) for r in range(len(self.x))]
        self._demand_size()
        self.demands = list(self._demands())
        self.ceilings = sorted({bound for bound, _ in self.demands} | {0.0})
        self.z = cp.Variable(len(self.ceilings), boolean=True)
        self.rows += [cp.sum(x) == 1 for x in (*self.x, *self.c, self.z)]
        self._add_rows()

    def _variables(self) -> Variables:
        cp, vehicles = self.cp, self.problem.vehicles
        tracked = range(len(self.tables.tracked))
        return Variables(
            [cp.Variable(len(role), boolean=True) for role in self.tables.roles],
            [cp.Variable(len(v.clocks), boolean=True) for v in vehicles],
            {(v, k): cp.Variable(integer=True) for v in range(len(vehicles)) for k in tracked},
        )

    def _add_rows(self) -> None:
        place = {bound: k for k, bound in enumerate(self.ceilings)}
        for bound, members in self.demands:
            self.deadline.check()
            if place[bound]:
                at_least = self.cp.sum(self.z[place[bound] :])
                self.rows.append(sum(members) - (len(members) - 1) <= at_least)
        self._add_hardware()
        self._add_accuracy()
        self._add_sync()
        for k, scale in enumerate(self.tables.keys if self.shared is None else ()):
            budget = self.problem.limits.budget(scale.name)
            if budget is not None:
                amount = max(1, scale.whole(budget))
                self.rows.append(self._amount(k, 1.0 / amount) <= scale.whole(budget) / amount)

    def _demand_size(self) -> None:
        """Refuse what would take longer to write down than to solve otherwise."""
        count = sum(
            len(self.classes[p.role])
            * (1 if p.reference is None else len(self.classes[p.reference]))
            for p in self.problem.pairs
        )
        if count > MOST_DEMANDS:
            raise NoVerdict(
                f"{count} pairs of different timestamp errors are too many for the MILP "
                f"(at most {MOST_DEMANDS})"
            )

    def _demands(self) -> Iterator[tuple[float, list[Any]]]:
        """(pair bound, binaries that are all 1 where it applies)."""
        for pair in self.problem.pairs:
            for own in self.classes[pair.role]:
                y = self.cp.sum(self.x[pair.role][own.rows])
                if pair.reference is None:
                    for offset, clocks in self._from_utc(pair.role, own.host):
                        yield own.tau + offset, [y, *clocks]
                    continue
                for other in self.classes[pair.reference]:
                    other_y = self.cp.sum(self.x[pair.reference][other.rows])
                    for offset, clocks in self._offsets(pair, own.host, other.host):
                        yield own.tau + other.tau + offset, [y, other_y, *clocks]

    def _offsets(self, pair: Pair, host: bool, other: bool) -> Iterator[tuple[float, list[Any]]]:
        """(offset between two timelines, clock binaries that make it)."""
        assert pair.reference is not None
        vehicles = [self.problem.roles[r].vehicle for r in (pair.role, pair.reference)]
        if host == other and (not host or vehicles[0] == vehicles[1]):
            yield 0.0, []
            return
        involved = [v for v, is_host in zip(vehicles, (host, other), strict=True) if is_host]
        tables = [self.problem.vehicles[v].clocks for v in involved]
        for places in np.ndindex(*(len(clocks) for clocks in tables)):
            chosen = [(v, clocks, i) for v, clocks, i in zip(involved, tables, places, strict=True)]
            yield (
                sum(clocks[i].offset_bound_s for _, clocks, i in chosen),
                [self.c[v][i] for v, _, i in chosen],
            )

    def _from_utc(self, role: int, host: bool) -> Iterator[tuple[float, list[Any]]]:
        """(offset of a role's timeline from UTC, clock binaries that make it)."""
        if not host:
            yield 0.0, []
            return
        v = self.problem.roles[role].vehicle
        for i, clock in enumerate(self.problem.vehicles[v].clocks):
            yield clock.offset_bound_s, [self.c[v][i]]

    def _add_hardware(self) -> None:
        for (v, k), units in self.units.items():
            item = self.problem.infrastructure[self.tables.tracked[k]]
            used = sum(
                role.channels[k] @ self.x[r]
                for r, role in enumerate(self.tables.roles)
                if self.problem.roles[r].vehicle == v
            )
            for i, clock in enumerate(self.problem.vehicles[v].clocks):
                used = used + sum(n for name, n in clock.requires if name == item.id) * self.c[v][i]
            self.rows += [used <= item.channels * units, units >= 0]

    def _amount(self, k: int, factor: float) -> Any:
        """Sum of a resource in whole units, times a factor."""
        scale: Scaled = self.tables.keys[k]
        total = sum(
            (role.resources[k].astype(float) * factor) @ self.x[r]
            for r, role in enumerate(self.tables.roles)
        )
        for v, vehicle in enumerate(self.problem.vehicles):
            own = [float(scale.whole(c.resources.of(scale.name))) * factor for c in vehicle.clocks]
            total = total + np.array(own) @ self.c[v]
        for (_, item), units in self.units.items():
            each = self.problem.infrastructure[self.tables.tracked[item]].resources
            total = total + float(scale.whole(each.of(scale.name))) * factor * units
        return total

    def total(self, scale_m: float) -> Any:
        """Total error over `scale_m`, without the fixed terms."""
        error = sum((role.error / scale_m) @ self.x[r] for r, role in enumerate(self.tables.roles))
        if self.problem.sync_model == "syncline":
            caused = self.problem.sync_rate_mps * np.array(self.ceilings) / scale_m
            return error + caused @ self.z
        return error + self._per_sensor(scale_m)

    def _per_sensor(self, scale_m: float) -> Any:
        """Each pair's rate times its own bound: tau terms add up, offsets hang on the clocks."""
        total: Any = 0.0
        for pair in self.problem.pairs:
            for r in (pair.role, pair.reference):
                if r is not None:
                    total = total + (pair.rate_mps * self.tables.roles[r].tau / scale_m) @ self.x[r]
            for offset, members in self._apart(pair):
                if not offset > 0.0:
                    continue
                active = self.cp.Variable(nonneg=True)
                self.rows.append(active >= sum(members) - (len(members) - 1))
                total = total + pair.rate_mps * offset / scale_m * active
        return total

    def _apart(self, pair: Pair) -> Iterator[tuple[float, list[Any]]]:
        """(offset between a pair's timelines, binaries that are all 1 where it applies)."""
        for host in (False, True):
            own = self._on_timeline(pair.role, host)
            if own is None:
                continue
            if pair.reference is None:
                for offset, clocks in self._from_utc(pair.role, host):
                    yield offset, [own, *clocks]
                continue
            for other in (False, True):
                theirs = self._on_timeline(pair.reference, other)
                if theirs is not None:
                    for offset, clocks in self._offsets(pair, host, other):
                        yield offset, [own, theirs, *clocks]

    def _on_timeline(self, role: int, host: bool) -> Any:
        """1 where a role's choice stamps on the host clock (or in UTC); None if no option does."""
        rows = np.flatnonzero(self.tables.roles[role].host == host)
        return self.cp.sum(self.x[role][rows]) if len(rows) else None

    def _add_accuracy(self) -> None:
        limit = self.problem.limits.accuracy_m
        if limit is None:
            return
        for r, role in enumerate(self.tables.roles):
            over = np.flatnonzero(role.error > limit * (1.0 + MARGIN))
            if len(over):
                self.rows.append(self.x[r][over] == 0)
        left = 1.0 - self.problem.fixed_error_m / limit
        self.rows.append(self._capped_total(limit) <= left + MARGIN)

    def _capped_total(self, limit: float) -> Any:
        """The total over the limit; what alone exceeds it counts twice the limit, no more."""
        error = sum(
            np.minimum(role.error / limit, 2.0) @ self.x[r]
            for r, role in enumerate(self.tables.roles)
        )
        if self.problem.sync_model == "per_sensor":
            return error + self._per_sensor(limit)
        caused = self.problem.sync_rate_mps * np.array(self.ceilings) / limit
        return error + np.minimum(caused, 2.0) @ self.z

    def _add_sync(self) -> None:
        """For each ceiling the sensor error that it demands, as a cover row scaled by itself."""
        limit = self.problem.limits.sync
        if math.isinf(limit):
            return
        for near in ((), *self.problem.near_ends()):
            stages = {one.stage for one in near}
            rate = self.problem.sync_rate_mps - float(sum(one.slower for one in near))
            noises = [
                role.noise - role.nearer if table.stage in stages else role.noise
                for table, role in zip(self.problem.roles, self.tables.roles, strict=True)
            ]
            for k, ceiling in enumerate(self.ceilings):
                demand = rate * ceiling / limit
                if demand > 0.0:
                    covered = sum(
                        np.minimum(noise / demand, 1.0) @ self.x[r]
                        for r, noise in enumerate(noises)
                    )
                    self.rows.append(covered >= (1.0 - MARGIN) * self.z[k])

    def objective(self) -> Any:
        """What is minimised first."""
        return self.error() if self.problem.objective == "error" else self._amount(0, 1.0)

    def error(self) -> Any:
        """The total error in small parts of a typical one."""
        least = sum(float(role.error.min()) for role in self.tables.roles)
        return self.total((least or 1.0) / ERROR_STEPS)

    def hold_objective(self, design: Design) -> None:
        """No more of the objective than this design needs."""
        assert self.problem.objective != "error"
        scale = self.tables.keys[0]
        amount = scale.whole(evaluate(self.problem, design).amount(scale.name))
        self.rows.append(self._amount(0, 1.0 / max(1, amount)) <= amount / max(1, amount))

    def solve(self, solver: Solver, objective: Any) -> Design | None:
        """The best design that stands up to exact arithmetic; None when proven that none is."""
        for _ in range(MOST_CUTS):
            program = self.cp.Problem(self.cp.Minimize(objective), self.rows)
            if solver.run(program) == "infeasible":
                return None
            places = [int(np.argmax(x.value)) for x in self.x]
            clocks = tuple(int(np.argmax(c.value)) for c in self.c)
            options = (int(order[i]) for order, i in zip(self.tables.order, places, strict=True))
            design = Design(tuple(options), clocks)
            if not broken(self.problem, evaluate(self.problem, design)):
                return design
            chosen = [x[i] for x, i in zip((*self.x, *self.c), (*places, *clocks), strict=True)]
            self.rows.append(sum(chosen) <= len(chosen) - 1)
        raise NoVerdict(
            f"{MOST_CUTS} designs in a row were optimal to the MILP solver and did not stand up to "
            "the exact recheck"
        )


def _classes(tables: Tables, role: int) -> Iterator[_TimingClass]:
    arrays = tables.roles[role]
    for tau, host in sorted(set(zip(arrays.tau.tolist(), arrays.host.tolist(), strict=True))):
        rows = np.flatnonzero((arrays.tau == tau) & (arrays.host == host))
        yield _TimingClass(tau, host, rows)
