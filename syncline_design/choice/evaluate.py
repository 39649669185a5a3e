"""What one design costs and reaches, in exact fractions: the decision behind every road.

Formulas of the design rules: total = sync error + sensor error + systematic error, with
`syncline` sync error = rate * tau_sys (eq. sync_error_ub) and `per_sensor` = sum of rate * bound.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from fractions import Fraction

from syncline_design.choice.option import Option, ResourceName, Resources
from syncline_design.choice.options import RESOURCES
from syncline_design.choice.table import ClockOption, Design, Nearer, Pair, Problem
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import rounded


@dataclass(frozen=True, slots=True)
class Bought:
    """Shared hardware bought for one vehicle."""

    vehicle: int
    infrastructure: int
    count: int


@dataclass(frozen=True, slots=True)
class Evaluation:
    """Sums and errors of a design, exact; a resource is None when a catalog entry lacks it.

    tightest: sensor error [m] and sync rate [m/s] at those ends of the stages' distances where
    tau_crit is least; where there is one distance, they are the sums themselves.
    """

    cost: Fraction | None
    mass: Fraction | None
    power: Fraction | None
    units: tuple[Bought, ...]
    sensor_error_m: Fraction
    tau_sys_s: Fraction
    sync_error_m: Fraction
    total_m: Fraction
    sync_rate_mps: Fraction
    tightest: tuple[Fraction, Fraction]

    def amount(self, name: ResourceName) -> Fraction | None:
        """One resource."""
        return {"cost": self.cost, "mass": self.mass, "power": self.power}[name]

    @property
    def error_m(self) -> float:
        """Total error [m], rounded once."""
        return float(self.total_m)

    @property
    def sync_ratio(self) -> float:
        """tau_sys / tau_crit of the system, rounded once; 0 where motion does not matter."""
        error, rate = self.tightest
        caused = rate * self.tau_sys_s
        if caused == 0:
            return 0.0
        return float(caused / error) if error > 0 else math.inf


def evaluate(problem: Problem, design: Design) -> Evaluation:
    """Every sum of one design."""
    options = chosen_options(problem, design)
    rate = problem.sync_rate()
    sensor_error, tau_sys, sync_error = _errors(problem, design, options)
    units = units_bought(problem, design, options)
    cost, mass, power = (_sum(problem, design, options, units, name) for name in RESOURCES)
    total = sensor_error + sync_error + _systematic(problem, options)
    tightest = _tightest(problem, options, sensor_error)
    return Evaluation(
        cost, mass, power, units, sensor_error, tau_sys, sync_error, total, rate, tightest
    )


def _tightest(
    problem: Problem, options: list[Option], sensor_error: Fraction
) -> tuple[Fraction, Fraction]:
    """Sensor error and sync rate where the first is the smallest share of the second.

    Both are sums of terms a + b d over the stages, so that their ratio is steady in each d: the
    least lies at an end of every stage's distances, or where a sensor's noise by range bends.
    """
    rate = problem.sync_rate()
    if not problem.nearer:
        return sensor_error, rate
    ends = []
    for moves in itertools.product(*(_places(problem, options, one) for one in problem.nearer)):
        less = sum((error for error, _ in moves), Fraction(0))
        slower = sum((slow for _, slow in moves), Fraction(0))
        ends.append((sensor_error - less, rate - slower))
    return min(ends, key=lambda end: end[0] / end[1] if end[1] > 0 else math.inf)


def _places(
    problem: Problem, options: list[Option], near: Nearer
) -> list[tuple[Fraction, Fraction]]:
    """How much smaller sensor error [m] and sync rate [m/s] are where a stage's object may be:
    at the far end, at the near end, and at every bend between."""
    own = [
        (table, option)
        for table, option in zip(problem.roles, options, strict=True)
        if table.stage == near.stage
    ]
    less = sum((option.nearer_m() for _, option in own), Fraction(0))
    found = [(Fraction(0), Fraction(0)), (less, near.slower)]
    for table, option in own:
        for bend in option.bends:
            assert table.nearest_m is not None
            share = (table.distance_m - bend.distance_m) / (table.distance_m - table.nearest_m)
            others = sum((o.nearer_m() for _, o in own if o is not option), Fraction(0))
            eased = option.error() - bend.error_m
            found.append((eased + share * others, share * near.slower))
    return found


def _errors(
    problem: Problem, design: Design, options: list[Option]
) -> tuple[Fraction, Fraction, Fraction]:
    """Sensor error [m], tau_sys [s] and sync error [m]."""
    bounds = [pair_bound(problem, design, options, pair) for pair in problem.pairs]
    tau_sys = max(bounds, default=Fraction(0))
    if problem.sync_model == "syncline":
        sync_error = problem.sync_rate() * tau_sys
    else:
        sync_error = sum(
            (pair.rate() * bound for pair, bound in zip(problem.pairs, bounds, strict=True)),
            Fraction(0),
        )
    return added_up([option.error() for option in options]), tau_sys, sync_error


def total_error_m(problem: Problem, design: Design) -> float:
    """Total error alone [m], rounded once: what `evaluate` gives as error_m."""
    options = chosen_options(problem, design)
    sensor, _, sync = _errors(problem, design, options)
    return float(sensor + sync + _systematic(problem, options))


def _systematic(problem: Problem, options: list[Option]) -> Fraction:
    """Known systematic errors [m]: those of every design and those of its sensors."""
    return added_up([problem.fixed_error(), *(option.systematic() for option in options)])


def chosen_options(problem: Problem, design: Design) -> list[Option]:
    """The option of each role."""
    return [table.options[i] for table, i in zip(problem.roles, design.options, strict=True)]


def chosen_clocks(problem: Problem, design: Design) -> list[ClockOption]:
    """The clock of each vehicle."""
    return [table.clocks[i] for table, i in zip(problem.vehicles, design.clocks, strict=True)]


def pair_bound(problem: Problem, design: Design, options: list[Option], pair: Pair) -> Fraction:
    """Bound of the relative timestamp error of a pair [s]; without reference, against UTC."""
    own = options[pair.role]
    if pair.reference is None:
        clock = chosen_clocks(problem, design)[problem.roles[pair.role].vehicle]
        return own.tau() + (clock.offset() if own.timeline == "host" else Fraction(0))
    other = options[pair.reference]
    vehicles = (problem.roles[pair.role].vehicle, problem.roles[pair.reference].vehicle)
    bound = own.tau() + other.tau()
    if own.timeline == other.timeline and (own.timeline == "utc" or vehicles[0] == vehicles[1]):
        return bound
    clocks = chosen_clocks(problem, design)
    for option, vehicle in zip((own, other), vehicles, strict=True):
        if option.timeline == "host":
            bound += clocks[vehicle].offset()
    return bound


def units_bought(problem: Problem, design: Design, options: list[Option]) -> tuple[Bought, ...]:
    """Shared hardware: the channels in use per vehicle, divided by a unit's, rounded up."""
    used: dict[tuple[int, str], int] = {}
    needs = [(problem.roles[r].vehicle, option.requires) for r, option in enumerate(options)]
    needs += [(v, clock.requires) for v, clock in enumerate(chosen_clocks(problem, design))]
    for vehicle, requires in needs:
        for name, channels in requires:
            used[vehicle, name] = used.get((vehicle, name), 0) + channels
    return tuple(
        Bought(vehicle, i, -(-used[vehicle, item.id] // item.channels))
        for vehicle in range(len(problem.vehicles))
        for i, item in enumerate(problem.infrastructure)
        if used.get((vehicle, item.id), 0) > 0
    )


def _sum(
    problem: Problem,
    design: Design,
    options: list[Option],
    units: tuple[Bought, ...],
    name: ResourceName,
) -> Fraction | None:
    parts: list[tuple[Resources, int]] = [(option.resources, 1) for option in options]
    parts += [(clock.resources, 1) for clock in chosen_clocks(problem, design)]
    parts += [(problem.infrastructure[u.infrastructure].resources, u.count) for u in units]
    amounts = []
    for resources, count in parts:
        amount = resources.of(name)
        if amount is None:
            return None
        amounts.append(amount if count == 1 else count * amount)
    return added_up(amounts)


def added_up(terms: Sequence[Fraction]) -> Fraction:
    """Their sum, over the least common denominator and so reduced only once."""
    pairs = [term.as_integer_ratio() for term in terms]
    unit = math.lcm(*(bottom for _, bottom in pairs))
    return Fraction(sum(top * (unit // bottom) for top, bottom in pairs), unit)


def broken(problem: Problem, found: Evaluation, *, accuracy: bool = True) -> tuple[str, ...]:
    """Kinds of requirement that a design breaks; written so that NaN breaks them."""
    limits = problem.limits
    out: list[str] = []
    if accuracy and limits.accuracy_m is not None and not found.error_m <= limits.accuracy_m:
        out.append("accuracy")
    if not found.sync_ratio < limits.sync:
        out.append("sync")
    for name in RESOURCES:
        budget = limits.budget(name)
        amount = found.amount(name)
        if budget is not None and (amount is None or not amount <= budget):
            out.append(name)
    return tuple(out)


def error_key(error_m: float) -> float:
    """An error as ties see it: errors that agree to 12 figures are the same."""
    return rounded(error_m, 12) if math.isfinite(error_m) else error_m


def known_or_more(amount: Fraction | None) -> Fraction | float:
    """An amount as the order sees it: one that no catalog gives comes after every known one."""
    return math.inf if amount is None else amount


Amount = Fraction | float
Rank = tuple[Amount, float, Amount, Amount, Amount, tuple[tuple[str, ...], ...]]


def rank(problem: Problem, design: Design, found: Evaluation) -> Rank:
    """The order of designs: objective, error, cost, mass, power, then names by role and clock."""
    error = error_key(found.error_m)
    sums = [known_or_more(found.amount(name)) for name in RESOURCES]
    first: Fraction | float = error
    if problem.objective != "error":
        first = known_or_more(found.amount(problem.objective))
    names: list[tuple[str, ...]] = [o.names for o in chosen_options(problem, design)]
    names += [(clock.id or "",) for clock in chosen_clocks(problem, design)]
    return (first, error, sums[0], sums[1], sums[2], tuple(names))


@dataclass(frozen=True, slots=True)
class Incumbent:
    """A design that meets every sum: what others have to come below."""

    design: Design
    amount: Fraction | float  # of the objective's resource; infinite where it does not say
    total_m: float

    @classmethod
    def of(cls, problem: Problem, design: Design) -> Incumbent | None:
        """None where the design breaks a requirement."""
        found = evaluate(problem, design)
        if broken(problem, found):
            return None
        amount = known_or_more(found.amount(resource_of(problem)))
        return cls(design, amount, found.error_m)


def resource_of(problem: Problem) -> ResourceName:
    """The resource that a front sets against error when a design is chosen."""
    return "cost" if problem.objective == "error" else problem.objective
