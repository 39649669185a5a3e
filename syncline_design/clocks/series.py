"""What every reader of clock logs makes: rows of one source, offsets local minus reference."""

from __future__ import annotations

import math
from array import array
from collections.abc import Sequence
from dataclasses import field
from typing import Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from syncline_design.machine.quick_dataclass import dataclass

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
DaemonName = Literal["chrony", "ntpd", "linuxptp", "gpsd", "ppstest", "csv"]
Steering = Literal["servo", "independent", "unknown"]
TimeBase = Literal["utc", "boot"]
FARTHEST_S: Final = 1e11  # 3 000 years: neither a stamp nor an offset


class Row(NamedTuple):
    """One line of a log.

    offset_s: local minus reference, not a number in a line that only says that lock was lost.
    hard_s: bound of the error by the daemon's own dispersions and delays; not a number: none
    known.  rate: frequency against the reference [s/s].  skew: what that rate is uncertain by.
    restart: the daemon says that it begins anew.  opened: its log was opened anew before this
    line, which a start does (and no outage).  stratum: the clock's own.  combined: from how many
    sources its time was made.  unsigned: offset_s is a size, the sign of which is not told.
    """

    time_s: float
    offset_s: float
    hard_s: float = math.nan
    locked: bool = True
    rate: float = math.nan
    skew: float = math.nan
    restart: bool = False
    opened: bool = False
    stratum: float = math.nan
    combined: float = math.nan
    unsigned: bool = False


@dataclass(frozen=True, slots=True)
class SourceKind:
    """What is known of a source before its rows are read.

    rank: which source of a family is taken first.  steering: whether the clock is steered by just
    these offsets (a servo nulls what it measures).  reference: what it is held against, where it
    has a name that another log of the family uses.  whole_way: whether a bound of its own holds the
    way to the reference too: a card's error is none of phc2sys' business, a pulse's delay none of a
    reference clock's.  of_host: whether it is the host's clock that it tells of, and no card's.
    """

    name: str
    family: DaemonName
    rank: int
    steering: Steering
    stamps: TimeBase
    reference: str = ""
    whole_way: bool = True
    of_host: bool = True


@dataclass(slots=True)
class Sheet:
    """Rows of one source of one file, under construction."""

    kind: SourceKind
    figures: array[float] = field(default_factory=lambda: array("d"))
    references: set[str] = field(default_factory=set)

    def add(self, row: Row) -> None:
        """One more row."""
        self.figures.extend(row)

    def move(self, time_s: Array) -> None:
        """Other stamps of the same rows."""
        columns = self.columns.copy()
        columns[:, 0] = time_s
        self.figures = array("d", columns.tobytes())

    @property
    def columns(self) -> Array:
        """One row of the result is one field of `Row`."""
        found: Array = np.frombuffer(self.figures, dtype=np.float64).reshape(-1, len(Row._fields))
        return found


@dataclass(frozen=True, slots=True)
class ClockSeries:
    """Rows of one source of one log (all its rotations), in the order of time."""

    kind: SourceKind
    files: tuple[str, ...]
    time_s: Array
    offset_s: Array
    hard_s: Array
    locked: Flags
    rate: Array
    skew: Array
    restart: Flags
    opened: Flags
    stratum: Array
    combined: Array
    unsigned: Flags
    references: frozenset[str] = frozenset()

    def __len__(self) -> int:
        return int(self.time_s.shape[0])

    def part(self, chosen: slice | Flags) -> ClockSeries:
        """Some of the rows."""
        return ClockSeries(
            self.kind, self.files, self.time_s[chosen], self.offset_s[chosen], self.hard_s[chosen],
            self.locked[chosen], self.rate[chosen], self.skew[chosen], self.restart[chosen],
            self.opened[chosen], self.stratum[chosen], self.combined[chosen],
            self.unsigned[chosen], self.references,
        )  # fmt: skip


def series_of(
    kind: SourceKind, files: tuple[str, ...], sheets: Sequence[Sheet]
) -> ClockSeries:  # fmt: skip
    """Rows of several files as columns."""
    table = np.concatenate([sheet.columns for sheet in sheets])
    references = frozenset[str]().union(*(sheet.references for sheet in sheets))
    (time_s, offset_s, hard_s, locked, rate, skew, restart, opened, stratum, combined,
     unsigned) = table.T.copy()  # fmt: skip
    return ClockSeries(
        kind, files, time_s, offset_s, hard_s, locked > 0.5, rate, skew, restart > 0.5,
        opened > 0.5, stratum, combined, unsigned > 0.5, references,
    )  # fmt: skip
