"""Best-first search over the roles.

A partial design is ranked by the least that any completion can cost and err (its sums plus a
Pareto front of what the later roles add), so a complete design that comes up is the next best one.
"""

from __future__ import annotations

import heapq
import itertools
import math
from collections.abc import Iterator, Sequence
from fractions import Fraction
from typing import Any

import numpy as np

from syncline_design.choice.arrays import RoleArrays, Scaled, tabulate
from syncline_design.choice.evaluate import Amount, broken, error_key, evaluate
from syncline_design.choice.option import ResourceName
from syncline_design.choice.options import MARGIN, RESOURCES, Bools, Column, Floats, Indices
from syncline_design.choice.outcome import Deadline, TooLarge
from syncline_design.choice.pareto import Columns, undominated
from syncline_design.choice.table import Design, Problem, VehicleTable, is_empty
from syncline_design.machine.quick_dataclass import dataclass

MOST_ROWS = 2_000_000  # options in the blocks of a search: about 200 MB
Whole = int | float  # an amount in whole units, which compare quicker than fractions; infinite
Key = tuple[Whole, float, Whole, Whole, Whole, tuple[int, ...]]


def iter_first(
    problem: Problem, deadline: Deadline, most_steps: int, *, cuts: bool = False
) -> Iterator[Design]:
    """Every design that meets all requirements, best first; TooLarge after so many partial ones.

    cuts: without those that the judge has learned to fail by their sums.
    """
    if not is_empty(problem):
        yield from BestFirstSearch(problem, cuts=cuts).run(deadline, most_steps)


def lower_bound(problem: Problem) -> Amount:
    """What no design can go below in the objective: shared hardware and later roles for free."""
    return BestFirstSearch(problem).bound()


@dataclass(frozen=True, slots=True)
class _Node:
    """A partial design: clock places and option places so far, with their sums."""

    clocks: tuple[int, ...]
    places: tuple[int, ...]
    error: float
    sums: tuple[int | float, ...]  # cost, mass, power in whole units


@dataclass(frozen=True, slots=True)
class _Block:
    """Children of a node in their order, with their least figures."""

    node: _Node
    order: Indices
    error: Floats  # of the child itself
    total: Floats  # least total of any completion
    sums: tuple[Column, ...]  # of the child itself
    least: tuple[Column, ...]  # of any completion


Entry = tuple[Key, int, _Block | None, int, Design | None]


@dataclass(frozen=True, slots=True)
class _Limit:
    """A sum with a limit: what each option adds, by role; of all roles after each one the sums
    (rising) and least objective amounts."""

    added: list[Floats]
    most: float
    suffixes: list[tuple[Floats, Column]]


class BestFirstSearch:
    """A search over one problem's tables; its designs in order, or its bound."""

    def __init__(self, problem: Problem, *, cuts: bool = False) -> None:
        self.judge = problem.judge if cuts else None
        self.limits: list[_Limit] = []
        self.problem = problem
        self.objective: ResourceName = "cost" if problem.objective == "error" else problem.objective
        self.main = RESOURCES.index(self.objective)
        tables = tabulate(problem, self.objective)
        self.tables = tables
        scales: dict[str, Scaled] = {s.name: s for s in (*tables.keys, *tables.ties)}
        self.scales = [scales.get(name) for name in RESOURCES]
        self.columns = [self._columns(role) for role in tables.roles]
        self.budgets = [
            None if s is None or (b := problem.limits.budget(s.name)) is None else s.whole(b)
            for s in self.scales
        ]
        self.least_sums = [[c.min() for c in columns] for columns in self.columns]
        self.least_error = [float(role.error.min()) for role in tables.roles]
        self.least_tau = [float(role.tau.min()) for role in tables.roles]
        self.suffixes = self._suffix_fronts([role.error for role in tables.roles])
        self.counter = itertools.count()
        self.rows = 0  # options held in blocks so far
        self.clock_order = [_by_id(vehicle) for vehicle in problem.vehicles]

    def run(
        self, deadline: Deadline, most_steps: int, *, patient: bool = False
    ) -> Iterator[Design]:
        """Designs in order; patient: the steps count anew after each design."""
        heap: list[Entry] = []
        ranges = [range(len(v.clocks)) for v in self.problem.vehicles]
        for clocks in itertools.product(*ranges):
            self._push(heap, self._expand(_Node(clocks, (), 0.0, self._clock_sums(clocks))), 0)
        steps = 0
        while heap:
            deadline.check()
            steps += 1
            if steps > most_steps or self.rows > MOST_ROWS:
                raise TooLarge(f"more than {most_steps} partial designs")
            _, _, block, at, design = heapq.heappop(heap)
            if design is not None:
                yield design
                steps = 0 if patient else steps
                continue
            assert block is not None
            self._push(heap, block, at + 1)
            node = self._child(block, at)
            if len(node.places) < len(self.problem.roles):
                self._push(heap, self._expand(node), 0)
            else:
                self._push_design(heap, node)

    def _columns(self, role: RoleArrays) -> list[Column]:
        known = dict(
            zip(
                (s.name for s in (*self.tables.keys, *self.tables.ties)),
                (*role.resources, *role.ties),
                strict=True,
            )
        )
        return [known.get(name, np.zeros(len(role), dtype=np.int64)) for name in RESOURCES]

    def bound(self) -> Amount:
        """What no design can go below in the objective (infinite: there is none)."""
        least: Whole = math.inf
        ranges = [range(len(v.clocks)) for v in self.problem.vehicles]
        for clocks in itertools.product(*ranges):
            block = self._expand(_Node(clocks, (), 0.0, self._clock_sums(clocks)))
            for place in block.order.tolist():
                least = min(least, self._key(block, place)[0])
        scale = self.scales[self.main]
        if self.problem.objective == "error" or scale is None or isinstance(least, float):
            return least
        return Fraction(least, scale.denominator)

    def _clock_sums(self, clocks: tuple[int, ...]) -> tuple[int | float, ...]:
        chosen = [
            v.clocks[order[i]]
            for v, order, i in zip(self.problem.vehicles, self.clock_order, clocks, strict=True)
        ]
        return tuple(
            0 if s is None else sum(s.whole(c.resources.of(s.name)) for c in chosen)
            for s in self.scales
        )

    def _suffix_fronts(self, added: list[Floats]) -> list[tuple[Floats, Column]]:
        """For each role: sums (rising) and least objective amounts of all roles after it."""
        amount: Column = np.zeros(1, dtype=np.int64)
        error: Floats = np.zeros(1)
        fronts = [(error, amount)]
        for r in range(len(self.tables.roles) - 1, 0, -1):
            own = self.columns[r][self.main]
            rows = undominated(Columns((added[r], own)))
            errors = np.add.outer(added[r][rows], error).ravel()
            amounts = np.add.outer(own[rows], amount).ravel()
            kept = undominated(Columns((errors, amounts)))
            kept = kept[np.argsort(errors[kept], kind="stable")]
            error, amount = errors[kept], amounts[kept]
            fronts.append((error, amount))
        return fronts[::-1]

    def _expand(self, node: _Node) -> _Block:
        """All options of the next role that may still lead to a design."""
        r = len(node.places)
        role = self.tables.roles[r]
        error = node.error + role.error
        caused = self._caused(node, role)
        fixed = self.problem.fixed_error_m
        total = error + sum(self.least_error[r + 1 :]) + fixed + caused
        sums = tuple(s + c for s, c in zip(node.sums, self.columns[r], strict=True))
        later = [sum(m[k] for m in self.least_sums[r + 1 :]) for k in range(len(RESOURCES))]
        least = [s + a for s, a in zip(sums, later, strict=True)]
        keep = np.ones(len(role), dtype=bool)
        for amounts, budget in zip(least, self.budgets, strict=True):
            if budget is not None:
                keep &= np.asarray(amounts <= budget, dtype=bool)
        accuracy = self.problem.limits.accuracy_m
        if accuracy is not None:
            slack = accuracy * (1.0 + MARGIN) - (error + fixed + caused)
            reach, amount = _least_within(self.suffixes[r], slack)
            keep &= reach
            least[self.main] = sums[self.main] + amount
        for limit in self._learned():
            spent = sum(float(own[at]) for own, at in zip(limit.added, node.places, strict=False))
            reach, amount = _least_within(limit.suffixes[r], limit.most - spent - limit.added[r])
            keep &= reach
            least[self.main] = np.maximum(least[self.main], sums[self.main] + amount)
        order = self._sorted(total, least, np.flatnonzero(keep))
        self.rows += len(role)
        return _Block(node, order, error, total, sums, tuple(least))

    def _learned(self) -> list[_Limit]:
        """The judge's cuts, those that came since the last look made into limits."""
        if self.judge is not None:
            for cut in self.judge.cuts(self.problem, len(self.limits)):
                pairs = zip(cut.weights, self.tables.order, strict=True)
                added = [own[order] for own, order in pairs]
                self.limits.append(_Limit(added, cut.most, self._suffix_fronts(added)))
        return self.limits

    def _sorted(self, total: Floats, least: Sequence[Column], rows: Indices) -> Indices:
        error = _twelve_figures(total[rows])
        columns = [c[rows] for c in least]
        if self.problem.objective == "error":
            keys = (*columns[::-1], error)
        else:
            keys = (*columns[::-1], error, columns[self.main])
        return rows[np.lexsort(keys)]

    def _caused(self, node: _Node, role: RoleArrays) -> Floats:
        """Least sync error of any completion, for each option of the next role [m]."""
        r, rates = len(node.places), self.problem.sync_rate_mps
        largest = np.zeros(len(role))
        summed = np.zeros(len(role))
        for pair in self.problem.pairs:
            bound = self._tau(node, role, pair.role)
            if pair.reference is None and pair.role <= r:
                bound = bound + self._from_utc(node, role, pair.role)
            elif pair.reference is not None:
                bound = bound + self._tau(node, role, pair.reference)
                if max(pair.role, pair.reference) <= r:
                    bound = bound + self._offset(node, role, pair.role, pair.reference)
            largest = np.maximum(largest, bound)
            summed = summed + pair.rate_mps * bound
        return summed if self.problem.sync_model == "per_sensor" else rates * largest

    def _tau(self, node: _Node, role: RoleArrays, which: int) -> Floats | float:
        r = len(node.places)
        if which == r:
            return role.tau
        if which < r:
            return float(self.tables.roles[which].tau[node.places[which]])
        return self.least_tau[which]

    def _offset(self, node: _Node, role: RoleArrays, first: int, second: int) -> Floats:
        """Offset between the timelines of two decided roles, the next one's options included."""
        host = [self._on_host(node, role, which) for which in (first, second)]
        vehicles = [self.problem.roles[which].vehicle for which in (first, second)]
        same = (host[0] == host[1]) & (~host[0] | (vehicles[0] == vehicles[1]))
        apart = self._from_utc(node, role, first) + self._from_utc(node, role, second)
        return np.where(same, 0.0, apart)

    def _on_host(self, node: _Node, role: RoleArrays, which: int) -> Bools:
        """Whether a decided role is stamped by its host, for each of the next role's options."""
        if which == len(node.places):
            return role.host
        return np.full(len(role), self.tables.roles[which].host[node.places[which]])

    def _from_utc(self, node: _Node, role: RoleArrays, which: int) -> Floats:
        """Offset of a decided role's timeline from UTC [s]."""
        v = self.problem.roles[which].vehicle
        clock = self.problem.vehicles[v].clocks[self.clock_order[v][node.clocks[v]]]
        return np.where(self._on_host(node, role, which), clock.offset_bound_s, 0.0)

    def _child(self, block: _Block, at: int) -> _Node:
        place = int(block.order[at])
        sums = tuple(_plain(s[place]) for s in block.sums)
        places = (*block.node.places, place)
        return _Node(block.node.clocks, places, float(block.error[place]), sums)

    def _push(self, heap: list[Entry], block: _Block, at: int) -> None:
        if at >= len(block.order):
            return
        key = self._key(block, int(block.order[at]))
        heapq.heappush(heap, (key, next(self.counter), block, at, None))

    def _key(self, block: _Block, place: int) -> Key:
        sums = [
            0 if s is None else _plain(c[place])
            for s, c in zip(self.scales, block.least, strict=True)
        ]
        return self._ordered(float(block.total[place]), sums, (*block.node.places, place))

    def _ordered(self, error_m: float, sums: list[Whole], places: tuple[int, ...]) -> Key:
        """The order of `evaluate.rank`; a resource in which no two designs differ counts as 0."""
        error = error_key(error_m)
        first = error if self.problem.objective == "error" else sums[self.main]
        return (first, error, sums[0], sums[1], sums[2], places)

    def _push_design(self, heap: list[Entry], node: _Node) -> None:
        options = tuple(int(self.tables.order[r][place]) for r, place in enumerate(node.places))
        clocks = tuple(order[i] for order, i in zip(self.clock_order, node.clocks, strict=True))
        design = Design(options, clocks)
        found = evaluate(self.problem, design)
        if broken(self.problem, found):
            return
        sums = [0 if s is None else s.whole(found.amount(s.name)) for s in self.scales]
        key = self._ordered(found.error_m, sums, (*node.places, *node.clocks))
        heapq.heappush(heap, (key, next(self.counter), None, 0, design))


def _least_within(suffix: tuple[Floats, Column], slack: Floats) -> tuple[Bools, Column]:
    """Whether the later roles fit into what is left, and the least objective amount at which."""
    sums, amounts = suffix
    place = np.searchsorted(sums, slack + np.abs(slack) * MARGIN, side="right") - 1
    return place >= 0, amounts[np.maximum(place, 0)]


def _plain(whole: Any) -> Whole:
    """An element of a column as a number of Python's own."""
    return math.inf if whole == math.inf else int(whole)


def _by_id(vehicle: VehicleTable) -> list[int]:
    ids = [clock.id or "" for clock in vehicle.clocks]
    return sorted(range(len(ids)), key=ids.__getitem__)


def _twelve_figures(values: Floats) -> Floats:
    """Values rounded to 12 significant figures, for sorting."""
    with np.errstate(divide="ignore"):
        power = np.floor(np.log10(np.abs(values)))
    scale = 10.0 ** (11.0 - np.where(np.isfinite(power), power, 0.0))
    return np.asarray(np.round(values * scale) / scale)
