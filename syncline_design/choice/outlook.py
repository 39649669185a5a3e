"""What designs already known leave a partial design to err, by the bound that it may end with.

The sync error of a design is its rate times its largest timestamp bound.  So what the stages still
to come add at least is told by bands of that bound: a design that ends in a band has no bound above
its upper end, which leaves out the options, timings and clocks that are stamped worse, and its sync
error is at least that of the lower end.  A partial design that stays behind the known designs in
every band is not worth going on with.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from syncline_design.choice.options import MARGIN, Bools, Floats, Indices
from syncline_design.choice.remaining import Ceiling
from syncline_design.choice.stairs import NO_ROLES, Stairs, stairs
from syncline_design.machine.quick_dataclass import dataclass

BANDS = 16  # of the largest bound
STEPS = 64  # of the staircases of what is still to come
GRID = 512  # amounts for which it is worked out what the known designs leave
FINEST = 1e-3  # share of the least error of all roles below which bounds are told apart no further
CLEAR = 1e-10  # share by which errors have to stay behind; 12 figures of them are compared in ties

NOTHING = np.zeros(0)
CLOSED = Stairs(NOTHING, NOTHING)


TimingKey = tuple[int, int, float, bool]  # stage, clock, and tau and timeline of the reference


@dataclass(frozen=True, slots=True)
class RoleOptions:
    """Options of one role as a way to time its stage has them: amounts, errors [m], bounds [s].

    needs: which shared hardware each takes channels of, a bit for each piece.
    """

    amount: Floats
    error: Floats
    bound: Floats
    needs: Indices

    def within(self, bound_s: float) -> Stairs:
        """Their staircase, without those of a larger bound."""
        rows = self.bound <= bound_s * (1.0 + MARGIN)
        return stairs(self.amount[rows], self.error[rows], STEPS) if rows.any() else CLOSED

    def on(self, hardware: int) -> RoleOptions:
        """The options that need no other shared hardware."""
        rows = self.needs & ~hardware == 0
        return RoleOptions(self.amount[rows], self.error[rows], self.bound[rows], self.needs[rows])


@dataclass(frozen=True, slots=True)
class Timed:
    """A clock, and a timing of a stage's reference: what it takes, and the stage's roles in order.

    amount: of the clock, where it is chosen with this stage; chained: what bounds the reference may
    have with that of the stage before [s].  needs: which shared hardware the clock takes; prices:
    of one unit of each piece, where the vehicle has this stage alone, else of none.
    """

    key: TimingKey
    amount: float
    chained: Floats
    parts: tuple[RoleOptions, ...]
    needs: int
    prices: tuple[float, ...]

    def equipped(self) -> Iterator[Timed]:
        """The same with each set of shared hardware, its price added, and what needs no other."""
        for hardware in range(2 ** len(self.prices)):
            if self.needs & ~hardware == 0:
                spent = sum(p for k, p in enumerate(self.prices) if hardware >> k & 1)
                parts = tuple(part.on(hardware) for part in self.parts)
                yield replace(self, amount=self.amount + spent, parts=parts)


ByBand = tuple[Stairs, ...]


class Outlook:
    """Staircases of what is still to come by band, and what a ceiling leaves under them.

    ways: of every stage but the first, by its number.  rate_mps: how fast the total grows with the
    largest bound; least_m: the least error of all roles.
    """

    def __init__(self, ways: Sequence[Sequence[Timed]], rate_mps: float, least_m: float) -> None:
        self.rate = rate_mps
        self.low, self.high = _bands(ways, FINEST * least_m / rate_mps)
        self.under = np.append(-np.inf, self.high[:-1])
        self.rest: dict[TimingKey, list[ByBand]] = {}
        after = [(NO_ROLES,) * len(self.low)]
        for number in range(len(ways), 0, -1):
            after.insert(0, self._stage(ways[number - 1], after[0]))
        self.after = after
        self.grids: dict[int, Floats] = {}
        self.tables: dict[tuple[int, TimingKey | None, int], tuple[Floats, Floats]] = {}
        self.ceiling: Ceiling | None = None

    def _stage(self, ways: Sequence[Timed], after: ByBand) -> ByBand:
        """What a stage and those after it take at least, by band."""
        self.rest.update((way.key, self._of_way(way)) for way in ways)
        each = [self.rest[way.key][0] for way in ways if not way.prices]
        each += [self._of_way(one)[0] for way in ways if way.prices for one in way.equipped()]
        out = []
        for band, later in enumerate(after):
            here = [one[band] for one in each]
            amount = np.concatenate([one.amount for one in here])
            error = np.concatenate([one.error for one in here])
            open_to = len(amount) and len(later.amount)
            out.append(stairs(amount, error, STEPS).beside(later, STEPS) if open_to else CLOSED)
        return tuple(out)

    def _of_way(self, way: Timed) -> list[ByBand]:
        """What the roles of a stage from each one on take at least, by band; nothing at the end."""
        closed = (way.chained.min() > self.high * (1.0 + MARGIN)).tolist()
        rest: list[ByBand] = [tuple(CLOSED if one else NO_ROLES for one in closed)]
        for part in reversed(way.parts):
            counts = (part.bound[:, None] <= self.high * (1.0 + MARGIN)).sum(axis=0).tolist()
            found: list[Stairs] = []
            for band, later in enumerate(rest[0]):
                same = band and counts[band] == counts[band - 1] and later is rest[0][band - 1]
                found.append(found[-1] if same else self._beside(part, band, later))
            rest.insert(0, tuple(found))
        if way.amount:
            rest[0] = tuple(Stairs(one.amount + way.amount, one.error) for one in rest[0])
        return rest

    def _beside(self, part: RoleOptions, band: int, later: Stairs) -> Stairs:
        if not len(later.amount):
            return CLOSED
        here = part.within(float(self.high[band]))
        if later is NO_ROLES or not len(here.amount):
            return here
        return here.beside(later, STEPS)

    def may_beat(
        self, ceiling: Ceiling, number: int, key: TimingKey | None, place: int,
        amount: Floats, error: Floats, bound: Floats,
    ) -> Bools:  # fmt: skip
        """Partial designs that may still end beside or below the known ones.

        place: how many roles of the stage are decided, whose way is `key`; None: all of them.
        """
        grid, table = self._table(ceiling, number, key, place)
        at = np.searchsorted(grid, amount - np.abs(amount) * MARGIN, side="right") - 1
        out = np.zeros(len(amount), dtype=bool)
        for under, low, high, leaves in zip(self.under, self.low, self.high, table, strict=True):
            ends = np.where(bound <= under * (1.0 - MARGIN), low, bound)  # in this band already
            out |= (error + self.rate * ends <= leaves[at]) & (bound <= high * (1.0 + MARGIN))
        return out

    def _table(
        self, ceiling: Ceiling, number: int, key: TimingKey | None, place: int
    ) -> tuple[Floats, Floats]:
        """Amounts, and by band what each leaves to err; between two amounts the smaller counts."""
        if ceiling is not self.ceiling:
            self.tables, self.ceiling = {}, ceiling
        asked = (number, key, place)
        if asked not in self.tables:
            self.tables[asked] = (
                self._at_end(ceiling, number)
                if key is None
                else self._inside(self._table(ceiling, number, None, 0), self.rest[key][place])
            )
        return self.tables[asked]

    def _at_end(self, ceiling: Ceiling, number: int) -> tuple[Floats, Floats]:
        known = ceiling.amount.astype(np.float64)
        known = known[:: max(1, len(known) // GRID)]
        after = self.after[number]
        least = min((float(one.amount[0]) for one in after if len(one.amount)), default=0.0)
        grid = _just_past(known, least)
        rows: list[Floats] = []
        for band, steps in enumerate(after):
            if band and steps is after[band - 1]:
                rows.append(rows[-1])
                continue
            left = ceiling.lowest(np.add.outer(grid, steps.amount)) * (1.0 + CLEAR) - steps.error
            rows.append(left.max(axis=1, initial=-np.inf))
        return grid, np.array(rows)

    @staticmethod
    def _inside(end: tuple[Floats, Floats], rest: ByBand) -> tuple[Floats, Floats]:
        grid, table = end
        least = min((float(one.amount[0]) for one in rest if len(one.amount)), default=0.0)
        shifted = _just_past(grid[1:], least)
        rows: list[Floats] = []
        at: Indices = np.zeros(0, dtype=np.intp)
        for band, steps in enumerate(rest):
            if not band or steps is not rest[band - 1]:
                amounts = np.add.outer(shifted, steps.amount)
                amounts -= np.abs(amounts) * MARGIN
                amounts[0] = -np.inf
                at = np.searchsorted(grid, amounts, side="right") - 1
            rows.append((table[band][at] - steps.error).max(axis=1, initial=-np.inf))
        return shifted, np.array(rows)


def _just_past(amounts: Floats, less: float) -> Floats:
    """Where amounts begin to count once others are added, whatever rounding does to sums."""
    return np.append(-np.inf, amounts + np.abs(amounts) * 4.0 * MARGIN - less)


def _bands(ways: Sequence[Sequence[Timed]], finest_s: float) -> tuple[Floats, Floats]:
    """Least and largest bounds of bands [s]: bounds that occur, evenly by their logarithm."""
    found = [way.chained for stage in ways for way in stage]
    found += [part.bound for stage in ways for way in stage for part in way.parts]
    bounds = np.unique(np.concatenate(found)) if found else NOTHING
    above = bounds[bounds > 0.0]
    if not len(above):
        return np.zeros(1), np.array([np.inf])
    wanted = np.geomspace(min(max(finest_s, above[0]), above[-1]), above[-1], BANDS + 1)[:-1]
    ends = np.unique(np.searchsorted(bounds, wanted * (1.0 + MARGIN), side="right") - 1)
    ends = ends[ends < len(bounds) - 1]
    return np.append(0.0, bounds[ends + 1]), np.append(bounds[ends], np.inf)
