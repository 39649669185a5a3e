"""What a role cannot be, and why: records made where they are asked for."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import overload

import numpy as np

from syncline_design.choice.option import Option, sync_ratio
from syncline_design.choice.options import Indices, Options
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import to_digits

NO_OPTIONS = Options.of(())


@dataclass(frozen=True, slots=True)
class Excluded:
    """A candidate removed before the choice, with the reason in words and by how much it misses.

    primitive, method: empty where the reason is the sensor's.
    """

    sensor: str
    primitive: str
    method: str
    reason: str
    ratio: float | None = None  # tau / tau_crit where that is the reason
    option: Option | None = None  # what it would be, were the sync limit relaxed
    code: str = "primitive"
    figure: float | str | None = None  # what the entry says
    limit: float | str | None = None  # what is asked of it
    impossible: tuple[Option, ...] = ()  # what cannot work here, whatever limit is relaxed


def breaks_own_tau_crit(option: Option) -> Excluded:
    """The record of an option whose timestamps are too poor for its own noise."""
    ratio = sync_ratio(option)
    reason = (
        f"its timestamp error reaches {to_digits(ratio, 3)} times its own tau_crit: the sensor "
        f"would be "
        "limited by its timestamps, not by its noise"
    )
    limit = option.tau_s / ratio if 0.0 < ratio < math.inf else option.tau_crit_s
    return Excluded(
        *option.names, reason, ratio, option, code="tau", figure=option.tau_s, limit=limit
    )


@dataclass(frozen=True, slots=True, eq=False)
class Exclusions(Sequence[Excluded]):
    """What a role cannot be, each record made where it is asked for.

    poor: options that break their own tau_crit; rest: everything else.  order: places in the
    two, one after the other.  beyond: options that would be there at another distance; the record
    of their sensor is among the rest.
    """

    rest: Sequence[Excluded]
    poor: Options
    order: Indices
    beyond: Options = NO_OPTIONS

    @classmethod
    def of(cls, records: Sequence[Excluded]) -> Exclusions:
        """From records that are there."""
        poor = [one.option for one in records if one.option is not None]
        rest = [one for one in records if one.option is None]
        first, second = itertools.count(), itertools.count(len(rest))
        order = [next(first if one.option is None else second) for one in records]
        return cls(rest, Options.of(poor), np.array(order, dtype=np.intp))

    @classmethod
    def in_turn(
        cls, rest: Sequence[Excluded], poor: Options, beyond: Options = NO_OPTIONS
    ) -> Exclusions:
        """The rest first."""
        return cls(rest, poor, np.arange(len(rest) + len(poor)), beyond)

    def __len__(self) -> int:
        return len(self.order)

    @overload
    def __getitem__(self, place: int) -> Excluded: ...
    @overload
    def __getitem__(self, place: slice) -> tuple[Excluded, ...]: ...
    def __getitem__(self, place: int | slice) -> Excluded | tuple[Excluded, ...]:
        if isinstance(place, slice):
            return tuple(map(self._at, self.order[place].tolist()))
        return self._at(int(self.order[place]))

    def _at(self, place: int) -> Excluded:
        count = len(self.rest)
        return self.rest[place] if place < count else breaks_own_tau_crit(self.poor[place - count])

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Exclusions) and tuple(self) == tuple(other)

    def __hash__(self) -> int:
        return hash(tuple(self))
