"""A family as arrays: a row for each mission, a column for each way of taking a role."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction

import numpy as np

from syncline_design.choice.family import Family
from syncline_design.choice.merged_front import demand_structure, useful_clocks
from syncline_design.choice.option import ResourceName
from syncline_design.choice.options import INT64_ROOM, Bools, Column, Floats, Indices, Spent
from syncline_design.choice.outcome import TooLarge
from syncline_design.choice.pareto import Columns, undominated
from syncline_design.choice.table import ClockOption, Problem
from syncline_design.machine.quick_dataclass import dataclass

UTC, HOST = 0, 1


@dataclass(frozen=True, slots=True)
class Ways:
    """The ways of one role; arrays are (missions, ways), amounts and channels lists of them.

    added: what a way adds to the total [m], its systematic part included; noise: the sensor error
    alone [m]; amounts: whole numbers, the primary resource first; channels: by tracked hardware.
    place: its place in the family's role.
    """

    place: Indices
    added: Floats
    noise: Floats
    tau: Floats
    host: Bools
    amounts: tuple[Column, ...]
    channels: tuple[Column, ...]

    def __len__(self) -> int:
        return len(self.place)

    def take(self, rows: Indices | Bools) -> Ways:
        """Some of the ways."""
        return Ways(
            self.place[rows],
            self.added[:, rows],
            self.noise[:, rows],
            self.tau[:, rows],
            self.host[:, rows],
            tuple(column[rows] for column in self.amounts),
            tuple(column[:, rows] for column in self.channels),
        )


@dataclass(frozen=True, slots=True)
class FamilyTables:
    """All roles as arrays; what they are counted in.

    names: resources that are summed, the primary one first; units: denominators of their whole
    numbers, 0 where nothing asks for the primary one and some entry does not say it.  clocks: of
    each vehicle the places of its clocks.  rates: of each mission the sync rate [m/s]; accuracy:
    its limit [m], infinite where there is none.
    """

    family: Family
    roles: tuple[Ways, ...]
    names: tuple[ResourceName, ...]
    units: tuple[int, ...]
    clocks: tuple[tuple[int, ...], ...]
    tracked: tuple[str, ...]
    capacity: tuple[int, ...]
    rates: Floats
    fixed: Floats
    accuracy: Floats
    sync: Floats

    @property
    def first(self) -> Problem:
        """The first mission's problem: stages, vehicles and pairs are the same in all."""
        return self.family.problems[0]

    @property
    def per_sensor(self) -> bool:
        """Whether sync errors add up pair by pair."""
        return self.first.sync_model == "per_sensor"

    @property
    def guards_sync(self) -> bool:
        """Whether a guarded merge knows all that the system's sync limit asks for.

        It does not know the largest bound where errors add up pair by pair, nor the near end of a
        stage's distances.
        """
        ends = any(next(iter(p.near_ends()), None) is not None for p in self.family.problems)
        return not self.per_sensor and not ends

    def whole(self, k: int, amount: Fraction | None) -> int:
        """An amount of a resource in its whole numbers; none where it is of no matter."""
        if self.units[k] == 0:
            return 0
        if amount is None:
            raise TooLarge(f"an entry gives no {self.names[k]}")
        return int(amount * self.units[k])

    def budget(self, k: int) -> int | None:
        """The budget of a resource in its whole numbers, rounded down."""
        given = dict(self.family.budgets).get(self.names[k])
        return None if given is None else (given * self.units[k]).__floor__()


def tabulate_family(family: Family, primary: ResourceName) -> FamilyTables:
    """Arrays for a front of `primary` against the largest error of any mission."""
    for problem in family.problems:
        demand_structure(problem)
    names = (primary, *(name for name, _ in family.budgets if name != primary))
    problems, first = family.problems, family.problems[0]
    items = {item.id: item for problem in problems for item in problem.infrastructure}
    tracked = tuple(sorted(items))
    beside = [
        *(clock.resources for vehicle in first.vehicles for clock in vehicle.clocks),
        *(item.resources for item in items.values()),
    ]
    spent = [[_spent(family, r, name) for r in range(len(family.roles))] for name in names]
    other = [Spent.of([one.of(name) for one in beside]) for name in names]
    units = tuple(
        int(np.lcm.reduce([s.denominator for s in (*own, more)], dtype=object))
        for own, more in zip(spent, other, strict=True)
    )
    for k, (own, more) in enumerate(zip(spent, other, strict=True)):
        if all(one.known for one in (*own, more)):
            continue
        if family.objective != "error" or names[k] in dict(family.budgets):
            raise TooLarge("an entry that does not say how much of a resource it takes")
        units = (0, *units[1:])  # nothing asks for it: every way takes none
        spent[k] = [Spent(np.zeros(len(role), dtype=np.int64), 1) for role in family.roles]
    roles = tuple(
        _ways(family, r, [own[r].scaled(unit or 1) for own, unit in zip(spent, units, strict=True)],
              tracked)
        for r in range(len(family.roles))
    )  # fmt: skip
    _demand_room(roles)
    limits = [problem.limits for problem in problems]
    return FamilyTables(
        family, roles, names, units,
        tuple(tuple(range(own.shape[1])) for own in family.clocks), tracked,
        tuple(items[name].channels for name in tracked),
        np.array([problem.sync_rate_mps for problem in problems]),
        np.array([problem.fixed_error_m for problem in problems]),
        np.array([np.inf if one.accuracy_m is None else one.accuracy_m for one in limits]),
        np.array([one.sync for one in limits]),
    )  # fmt: skip


def _demand_room(roles: Sequence[Ways]) -> None:
    largest = max((abs(int(c.max(initial=0))) for role in roles for c in role.amounts), default=0)
    if largest * (len(roles) + 1) >= INT64_ROOM:
        raise TooLarge("amounts with too many decimals to add up in whole numbers")


def useful_clocks_of(tables: FamilyTables) -> FamilyTables:
    """Tables without clocks that another one of the vehicle replaces in every mission."""
    family = tables.family
    common = [
        replace(vehicle, clocks=tuple(clock_of(family, 0, v, i) for i in own))
        for v, (vehicle, own) in enumerate(zip(tables.first.vehicles, tables.clocks, strict=True))
    ]
    kept = useful_clocks(replace(tables.first, vehicles=tuple(common)))
    alike = all(
        clock_of(family, m, v, i).offset_bound_s == clock_of(family, 0, v, i).offset_bound_s
        for v, own in enumerate(tables.clocks)
        for i in own
        for m in range(len(family.problems))
    )
    if not alike:
        return tables
    clocks = (tuple(own[i] for i in rows) for own, rows in zip(tables.clocks, kept, strict=True))
    return replace(tables, clocks=tuple(clocks))


def clock_of(family: Family, mission: int, vehicle: int, place: int) -> ClockOption:
    """A vehicle's clock as one mission sees it."""
    own = int(family.clocks[vehicle][mission, place])
    return family.problems[mission].vehicles[vehicle].clocks[own]


def _ways(family: Family, r: int, amounts: Sequence[Column], tracked: Sequence[str]) -> Ways:
    role = family.roles[r]
    options = [problem.roles[r].options for problem in family.problems]
    rows = list(zip(options, role.places, strict=True))
    return Ways(
        np.arange(len(role)),
        np.array([own.added[at] for own, at in rows]).reshape(len(rows), -1),
        np.array([own.error[at] for own, at in rows]).reshape(len(rows), -1),
        np.array([own.tau[at] for own, at in rows]).reshape(len(rows), -1),
        np.array([own.host[at] for own, at in rows], dtype=bool).reshape(len(rows), -1),
        tuple(column.astype(np.int64) for column in amounts),
        tuple(np.array([own.channels(name)[at] for own, at in rows]) for name in tracked),
    )


def _spent(family: Family, r: int, name: ResourceName) -> Spent:
    """What each way of a role takes: its option's, or what its missions' options take together."""
    role, tables = family.roles[r], [problem.roles[r] for problem in family.problems]
    if role.alone is None:
        return tables[0].options.spent(name).take(role.places[0])
    sensors: dict[str, int] = {}
    stamps: dict[tuple[str, str], int] = {}
    each: list[Fraction | None] = []  # what each (sensor, method) takes beside the sensor
    numbers = []
    for table, at in zip(tables, role.places, strict=True):
        own = []
        for option in table.options:
            sensor = sensors.setdefault(option.sensor, len(sensors))
            key = (option.sensor, option.method)
            if key not in stamps:
                whole, bare = option.resources.of(name), role.alone[option.sensor].of(name)
                each.append(None if whole is None or bare is None else whole - bare)
            own.append((sensor, stamps.setdefault(key, len(stamps))))
        numbers.append(np.array(own, dtype=np.intp).reshape(-1, 2)[at])
    alone = Spent.of([role.alone[one].of(name) for one in sensors])
    return _once(numbers, 0, alone).plus(_once(numbers, 1, Spent.of(each)))


def _once(numbers: Sequence[Indices], column: int, amounts: Spent) -> Spent:
    """Sums over missions in which what was bought for an earlier one costs nothing again."""
    total = Spent(np.zeros(len(numbers[0]), dtype=np.int64), amounts.denominator)
    for m, own in enumerate(numbers):
        new = np.ones(len(own), dtype=bool)
        for before in numbers[:m]:
            new &= own[:, column] != before[:, column]
        part = np.where(new, amounts.whole[own[:, column]], 0)
        total = total.plus(Spent(part, amounts.denominator))
    return total


def useful_ways(tables: FamilyTables, r: int) -> Ways:
    """The ways of a role that no other way makes superfluous where nothing bounds noise below.

    One is superfluous where another takes no more, errs no more in any mission, alone and with its
    own timestamp error, and stands on the same timelines with no more channels.
    """
    ways = tables.roles[r]
    if len(ways) < 2:
        return ways
    floats = []
    for m, problem in enumerate(tables.family.problems):
        rates = [pair.rate_mps for pair in problem.pairs if r in (pair.role, pair.reference)]
        rate = sum(rates) if tables.per_sensor else tables.rates[m] * bool(rates)
        stamped = ways.added[m] + rate * ways.tau[m]
        floats += [stamped] if tables.per_sensor else [ways.added[m], stamped]
    groups = np.unique(ways.host.T, axis=0, return_inverse=True)[1].ravel()
    kept = []
    for group in np.unique(groups).tolist():
        rows = np.flatnonzero(groups == group)
        channels = [c[m, rows] for c in ways.channels for m in range(len(c))]
        columns = distinct([*(a[rows] for a in ways.amounts[1:]), *channels])
        errors = distinct([f[rows] for f in floats])
        keys = (ways.amounts[0][rows], *columns, errors[0])
        kept.append(rows[undominated(Columns(keys, errors[1:]))])
    return ways.take(np.sort(np.concatenate(kept)))


def distinct(columns: Sequence[Column]) -> list[Column]:
    """Columns without those that another one repeats, or that say the same of every row."""
    seen = {column.tobytes(): column for column in columns}
    told = [c for c in seen.values() if len(c) and (c != c[0]).any()]
    return told or list(columns[:1])
