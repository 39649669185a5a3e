"""What a role can be: options as columns, an Option itself made only where one is asked for.

The columns are floats within a few units in the last place of the exact figures, and whole numbers
where sums decide; whatever lies closer to a limit than `MARGIN` is decided on the exact option.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import fields, replace
from fractions import Fraction
from typing import Any, Protocol, overload, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from syncline_design.choice.option import Names, Option, Requires, ResourceName, sync_ratio
from syncline_design.machine.quick_dataclass import dataclass

Column = NDArray[Any]
Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Indices = NDArray[np.intp]

RESOURCES: tuple[ResourceName, ...] = ("cost", "mass", "power")
MARGIN = 1e-12  # sums of floats are trusted to this; what lies closer to a limit is decided exactly
INT64_ROOM = 2**61


@dataclass(frozen=True, slots=True)
class Spent:
    """One resource of many choices in whole multiples of 1/denominator, so that sums are exact.

    whole: infinite where the catalog does not say; int64 where every amount is known and fits.
    """

    whole: Column
    denominator: int

    @classmethod
    def of(cls, amounts: Sequence[Fraction | None]) -> Spent:
        """The amounts in the least unit that holds them all."""
        if all(amount is not None and not amount for amount in amounts):
            return cls(np.zeros(len(amounts), dtype=np.int64), 1)
        pairs = [(math.inf, 1) if a is None else a.as_integer_ratio() for a in amounts]
        unit = math.lcm(*{bottom for _, bottom in pairs})
        tops = [top if top == math.inf else top * (unit // bottom) for top, bottom in pairs]
        return cls(whole_column(tops), unit)

    @property
    def known(self) -> bool:
        """Whether every amount is given."""
        return self.whole.dtype != object or not any(top == math.inf for top in self.whole)

    @property
    def is_silent(self) -> bool:
        """Whether no amount is given."""
        return self.whole.dtype == object and all(top == math.inf for top in self.whole)

    @property
    def largest(self) -> int:
        """The largest known amount, without its sign, in whole units."""
        if self.whole.dtype != object:
            return int(np.abs(self.whole).max(initial=0))
        return max((abs(top) for top in self.whole.tolist() if top != math.inf), default=0)

    def take(self, rows: Indices | Bools) -> Spent:
        """Some of the choices."""
        return Spent(self.whole[rows], self.denominator)

    def order(self) -> Column:
        """Figures in the order of the amounts, for sorting."""
        return np.unique(self.whole, return_inverse=True)[1]

    def followed_by(self, other: Spent) -> Spent:
        """These choices and then others."""
        unit = math.lcm(self.denominator, other.denominator)
        return Spent(np.concatenate([self.scaled(unit), other.scaled(unit)]), unit)

    def plus(self, other: Spent) -> Spent:
        """Sums of two choices each."""
        unit = math.lcm(self.denominator, other.denominator)
        return Spent(_sum(self.scaled(unit), other.scaled(unit)), unit)

    def scaled(self, unit: int, dtype: Any = None) -> Column:
        """The amounts in whole multiples of 1/unit."""
        factor = unit // self.denominator
        fits = self.whole.dtype != object and self.largest * factor < INT64_ROOM
        kind = dtype or (np.int64 if fits else object)
        column = self.whole.astype(kind, copy=False)
        return column if factor == 1 else np.asarray(column * factor)


def whole_column(tops: Sequence[int | float]) -> Column:
    """Whole numbers as a column, of Python's own where int64 does not hold their sums."""
    fits = all(top != math.inf and abs(top) < INT64_ROOM for top in tops)
    return np.array(tops, dtype=np.int64 if fits else object)


def _sum(one: Column, other: Column) -> Column:
    if one.dtype == object or other.dtype == object:
        return np.asarray(one.astype(object) + other.astype(object))
    return np.asarray(one + other)  # both below 2^61


Make = Callable[[int], Option]


@runtime_checkable
class NamesOfRows(Protocol):
    """A source of options that can name them without making them."""

    def names_of(self, rows: Indices) -> list[Names]:
        """The names of some rows."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class Options(Sequence[Option]):
    """Options of one role by columns.

    make: the option at a place of the source; at: that place.  rank: place in the order of names.
    error, added: sensor error alone, and with its systematic part [m]; crit: its own tau_crit [s].
    nearer: by how much the error is smaller at the near end of the stage's distances [m].
    near, far: distances between which the sensor measures [m]; rate: how often [1/s], sound: its
    speed where a sensor waits for its echo [m/s], both infinite where they delay nothing.
    sensor, method: numbers that tell them apart.  needs: kinds of `requires`; need: which.
    """

    make: Make
    at: Indices
    rank: Indices
    sensor: Indices
    method: Indices
    error: Floats
    added: Floats
    tau: Floats
    crit: Floats
    nearer: Floats
    near: Floats
    far: Floats
    rate: Floats
    sound: Floats
    host: Bools
    spends: tuple[Spent, ...]
    needs: tuple[Requires, ...]
    need: Indices

    @classmethod
    def of(cls, options: Sequence[Option]) -> Options:
        """Columns of options that are there."""
        count = len(options)
        names = [option.names for option in options]
        needs = tuple(dict.fromkeys(option.requires for option in options))
        spends = tuple(Spent.of([o.resources.of(name) for o in options]) for name in RESOURCES)
        return cls(
            options.__getitem__,
            np.arange(count),
            ranked(names),
            numbered([name[0] for name in names]),
            numbered([name[2] for name in names]),
            _floats(o.sensor_error_m for o in options),
            _floats(o.added_m() for o in options),
            _floats(o.tau_s for o in options),
            _floats(o.tau_crit_s for o in options),
            _floats(float(o.nearer_m()) for o in options),
            _floats(o.reach_m[0] for o in options),
            _floats(o.reach_m[1] for o in options),
            _floats(float(o.rate_hz) if o.rate_hz else math.inf for o in options),
            _floats(float(o.sound_mps) if o.sound_mps else math.inf for o in options),
            np.array([o.timeline == "host" for o in options], dtype=bool),
            spends,
            needs,
            np.array([needs.index(o.requires) for o in options], dtype=np.intp),
        )

    def __len__(self) -> int:
        return len(self.at)

    @overload
    def __getitem__(self, place: int) -> Option: ...
    @overload
    def __getitem__(self, place: slice) -> tuple[Option, ...]: ...
    def __getitem__(self, place: int | slice) -> Option | tuple[Option, ...]:
        if isinstance(place, slice):
            return tuple(map(self.make, self.at[place].tolist()))
        return self.make(int(self.at[place]))

    def __iter__(self) -> Iterator[Option]:
        return map(self.make, self.at.tolist())

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Options) and tuple(self) == tuple(other)

    def __hash__(self) -> int:
        return hash(tuple(self))

    def spent(self, name: ResourceName) -> Spent:
        """One resource."""
        return self.spends[RESOURCES.index(name)]

    def channels(self, item: str) -> Column:
        """Channels of one piece of shared hardware that each option takes."""
        each = [sum(count for name, count in kind if name == item) for kind in self.needs]
        return np.array(each, dtype=np.int64)[self.need]

    @property
    def required(self) -> set[Requires]:
        """What the options require, each kind once."""
        return {self.needs[kind] for kind in np.unique(self.need).tolist()}

    def first_of_each(self, numbers: Indices) -> tuple[Option, ...]:
        """The first option of each sensor, or of each method."""
        _, first = np.unique(numbers, return_index=True)
        return tuple(self[place] for place in np.sort(first).tolist())

    def names_of_each(self, numbers: Indices) -> list[Names]:
        """The names of the first option of each sensor, or of each method."""
        _, first = np.unique(numbers, return_index=True)
        return self.take(np.sort(first)).all_names()

    def take(self, rows: Indices | Bools | Sequence[int]) -> Options:
        """Some of the options."""
        chosen = np.asarray(rows) if len(rows) else np.zeros(0, dtype=np.intp)
        changes: dict[str, Any] = {name: getattr(self, name)[chosen] for name in _ARRAYS}
        return replace(self, spends=tuple(s.take(chosen) for s in self.spends), **changes)

    def parted(self, keeps: Bools) -> tuple[Options, Options]:
        """The options that are kept, and the others."""
        if keeps.all():
            return self, self.take(())
        return self.take(keeps), self.take(~keeps)

    def by_name(self) -> Indices:
        """Rows in the order of their names."""
        return np.argsort(self.rank, kind="stable")

    def all_names(self) -> list[Names]:
        """The names of every option, read off its source where that can tell without making it."""
        source = getattr(self.make, "__self__", None)
        if isinstance(source, NamesOfRows):
            return source.names_of(self.at)
        return [option.names for option in self]

    def place_of(self, names: Names) -> int | None:
        """The row of that name; None where there is none."""
        order = self.by_name()
        low, high = 0, len(order)
        while low < high:
            middle = (low + high) // 2
            if self[int(order[middle])].names < names:
                low = middle + 1
            else:
                high = middle
        found = low < len(order) and self[int(order[low])].names == names
        return int(order[low]) if found else None

    def place_like(self, other: Options, place: int) -> int | None:
        """The row of the name that a row of other options has."""
        if other.needs is not self.needs:  # another source
            return self.place_of(other[place].names)
        found = np.flatnonzero(self.rank == other.rank[place])
        return int(found[0]) if len(found) else None

    def joined(self, other: Options) -> Options:
        """These options and others of the role."""
        if not len(other):
            return self
        if other.make != self.make or other.needs is not self.needs:
            return Options.of((*self, *other))
        changes: dict[str, Any] = {
            name: np.concatenate([getattr(self, name), getattr(other, name)]) for name in _ARRAYS
        }
        spends = tuple(map(Spent.followed_by, self.spends, other.spends))
        return replace(self, spends=spends, **changes)

    def changed(
        self, rows: Indices | Bools, change: Callable[[Option], Option], **columns: float
    ) -> Options:
        """The options with some of them changed; columns: their new figures, the same for all.

        change leaves alone what is not meant.
        """
        make = self.make
        out: dict[str, Any] = {}
        for name, value in columns.items():
            out[name] = getattr(self, name).copy()
            out[name][rows] = value
        return replace(self, make=functools.cache(lambda place: change(make(place))), **out)

    def keep_own_tau_crit(self, limit: float) -> Bools:
        """Which options keep tau < limit * tau_crit; close calls are decided exactly."""
        if math.isinf(limit):
            return np.asarray(self._own_ratios() < limit)
        ratios = self._own_ratios()
        keeps = np.asarray(ratios < limit * (1.0 - MARGIN))
        for row in np.flatnonzero(~keeps & (ratios <= limit * (1.0 + MARGIN))).tolist():
            keeps[row] = sync_ratio(self[row]) < limit
        return keeps

    def reach(self, near: float, far: float) -> Bools:
        """Which options measure at some distance between two [m]."""
        return np.asarray((self.near <= far) & (near <= self.far))

    def reach_all(self, near: float, far: float) -> Bools:
        """Which options measure at every distance between two [m]."""
        return np.asarray((self.near <= near) & (far <= self.far))

    def spacing(self, speed_mps: float, distance_m: float) -> Floats:
        """Ground between two samples [m], as far as it is told."""
        return np.maximum(speed_mps / self.rate, 2.0 * speed_mps * distance_m / self.sound)

    def keep_spacing(self, speed_mps: Fraction, distance_m: Fraction, limit: float | None) -> Bools:
        """Which options take samples no farther apart than a limit; close calls are exact."""
        if limit is None:
            return np.ones(len(self), dtype=bool)
        apart = self.spacing(float(speed_mps), float(distance_m))
        keeps = np.asarray(apart <= limit * (1.0 - MARGIN))
        for row in np.flatnonzero(~keeps & (apart <= limit * (1.0 + MARGIN))).tolist():
            keeps[row] = float(self[row].spacing_m(speed_mps, distance_m)) <= limit
        return keeps

    def _own_ratios(self) -> Floats:
        with np.errstate(divide="ignore", invalid="ignore"):
            ratios = self.tau / self.crit
        return np.where(np.isinf(self.crit) | (self.tau == 0.0), 0.0, ratios)


_ARRAYS = tuple(one.name for one in fields(Options) if one.name not in ("make", "spends", "needs"))


def _floats(values: Iterable[float]) -> Floats:
    return np.fromiter(values, dtype=np.float64)


def numbered(names: Sequence[str]) -> Indices:
    """A number for each name, in the order of their coming."""
    found: dict[str, int] = {}
    return np.array([found.setdefault(name, len(found)) for name in names], dtype=np.intp)


def ranked(names: Sequence[Any]) -> Indices:
    """Place of each in their order."""
    places = np.arange(len(names))
    out = np.empty_like(places)
    out[sorted(range(len(names)), key=names.__getitem__)] = places
    return out
