"""Logs of chronyd: tracking, statistics, measurements, refclocks (chrony.conf(5), `log`).

tracking.log and statistics.log hold local minus reference, measurements.log and refclocks.log
reference minus local.
"""

from __future__ import annotations

import calendar
import re
from dataclasses import field
from functools import lru_cache
from typing import Final

from syncline_design.clocks.series import Row, SourceKind
from syncline_design.machine.quick_dataclass import dataclass

_STAMP: Final = re.compile(r"(\d{4})-(\d\d)-(\d\d)$")
_CLOCK: Final = re.compile(r"(\d\d):(\d\d):(\d\d(?:\.\d+)?)$")
_DATED: Final = re.compile(r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d")
_LEAPS: Final = frozenset("N+-?")
_TESTS: Final = re.compile(r"[01]{3}")
_DISTANT_SKEW: Final = 1e5  # ppm; chronyd starts with 1e6 where no drift file says better
UNSET: Final = "0.0.0.0"
ITSELF: Final = "127.127.1."  # chronyd's and ntpd's own clock as a reference
_BANNER: Final = "===="
_BANNER_EACH: Final = 32  # lines, by default (chrony.conf(5), logbanner)
_CYCLE_S: Final = 3600.0  # lines with a banner between them and no longer apart are of one run
_STARTING_S: Final = 1.0  # chronyd's root dispersion at its start: no silence of days reaches it

TRACKING: Final = SourceKind("chrony tracking", "chrony", 1, "servo", "utc")


@dataclass(slots=True)
class ChronyReader:
    """One file; which of its lines say that the daemon began anew, or its log was opened anew.

    chronyd writes a banner before the first line that it writes into a file, and each so many lines
    from there on: one that comes out of turn is a start of the daemon, or of its logs alone
    (`chronyc cyclelogs`).  Before a line without a reference and with the bound of a start it is
    the daemon's: a server that is lost writes such a line as well, but in turn with others.
    """

    lines: int = 0
    turns: set[int] = field(default_factory=lambda: {_BANNER_EACH})
    after_banner: bool = False
    named: set[str] = field(default_factory=set)  # sources since the last banner
    anew: bool = False
    counted: bool = False  # a file may begin between two banners
    in_lock: bool = True  # of the tracking log, before this line
    small: bool = False  # the bound of that line
    last_s: float = float("nan")

    def row(self, line: str) -> tuple[SourceKind, Row, str] | None:
        """As `row`, with what the banners before it say."""
        if line.startswith(_BANNER):
            self.after_banner = True
            return None
        found = row(line)
        if found is None:
            return None
        kind, said, reference = found
        as_at_start = said.opened and not said.locked
        begun = self._turn(said.time_s, as_at_start=as_at_start) if self.after_banner else False
        self.lines, self.last_s = self.lines + 1, said.time_s
        # without a reference chronyd's dispersion is 1 s as well: no start where it was so before
        by_bound = said.opened and said.locked and self.in_lock
        opened = by_bound or (self.anew and kind.name not in self.named)
        begun |= by_bound and self.small and _bound_before(line) >= _STARTING_S
        self.in_lock, self.small = said.locked, not said.opened
        self.named.add(kind.name)
        restart = said.restart or begun
        return kind, said._replace(restart=restart, opened=opened), reference

    def _turn(self, time_s: float, *, as_at_start: bool) -> bool:
        """What the banner before this line says; True: the daemon began anew."""
        in_turn = self.lines in self.turns
        begun = as_at_start and not (self.counted and in_turn)
        if time_s - self.last_s <= _CYCLE_S and not begun:
            self.turns.add(self.lines)
        self.anew = self.counted and self.lines not in self.turns
        self.counted = True
        self.after_banner, self.lines = False, 0
        self.named.clear()
        return begun


def row(line: str) -> tuple[SourceKind, Row, str] | None:
    """A line of any of the four logs: source, row, the reference it names; None: no such line."""
    cells = line.split()
    if len(cells) < 9 or _DATED.search(line.lstrip(), 1):  # cut, and the next line joined to it
        return None
    time_s = stamp(cells[0], cells[1])
    if time_s is None:
        return None
    try:
        return _row(time_s, cells)
    except (ValueError, IndexError):
        return None


def is_repeat(line: str) -> bool:
    """A filtered sample of refclocks.log: it has no raw offset and sums up the ones before."""
    cells = line.split()
    return len(cells) == 9 and cells[6] == "-" and stamp(cells[0], cells[1]) is not None


def stamp(date: str, clock: str) -> float | None:
    """`2026-11-22 03:34:54` as Unix time; a leap second 60 is the one after 59."""
    whole, hours = _midnight(date), _CLOCK.match(clock)
    if whole is None or hours is None:
        return None
    return whole + 3600.0 * int(hours[1]) + 60.0 * int(hours[2]) + float(hours[3])


@lru_cache(256)
def _midnight(date: str) -> int | None:
    day = _STAMP.match(date)
    try:
        return calendar.timegm((int(day[1]), int(day[2]), int(day[3]), 0, 0, 0)) if day else None
    except ValueError:
        return None


def _row(time_s: float, cells: list[str]) -> tuple[SourceKind, Row, str] | None:
    if len(cells) >= 17 and cells[3] in _LEAPS and _TESTS.fullmatch(cells[5]):
        return _measurement(time_s, cells)
    if len(cells) >= 11 and cells[7] in _LEAPS:
        return TRACKING, _tracking(time_s, cells), cells[2]
    if len(cells) == 9 and cells[4] in _LEAPS:
        return _refclock(time_s, cells)
    if len(cells) in (12, 13) and cells[9].isdigit() and cells[10].isdigit():
        kind = SourceKind(f"chrony statistics {cells[2]}", "chrony", 3, "servo", "utc", cells[2])
        return kind, Row(time_s, float(cells[4]), skew=float(cells[7])), ""
    return None


def _tracking(time_s: float, cells: list[str]) -> Row:
    """Hard bound: the larger of `Max. error` and |offset| + root dispersion + root delay / 2."""
    skew, offset = float(cells[5]), float(cells[6])
    hard = float("nan")
    if len(cells) >= 13:
        delay, dispersion = float(cells[11]), float(cells[12])
        hard = abs(offset) + dispersion + delay / 2.0
        if len(cells) >= 14:
            hard = max(hard, float(cells[13]))
    locked = cells[7] != "?" and cells[2] != UNSET
    restart = not locked and skew >= _DISTANT_SKEW
    rate = 1e-6 * float(cells[4])
    return Row(time_s, offset, hard, locked, rate, 1e-6 * skew, restart, hard >= _STARTING_S,
               float(cells[3]), float(cells[8]))  # fmt: skip


def _bound_before(line: str) -> float:
    """`Max. error` [s]: what the clock was within before the update that the line tells of.

    A run in lock does not come near the 1.5 s of a start, whatever the offset or the next server.
    """
    cells = line.split()
    return float(cells[13]) if len(cells) >= 14 else float("nan")


def _measurement(time_s: float, cells: list[str]) -> tuple[SourceKind, Row, str]:
    """Hard bound: (peer delay + root delay) / 2 + both dispersions + |offset|."""
    offset, delay, dispersion, root_delay, root_dispersion = map(float, cells[11:16])
    hard = (delay + root_delay) / 2.0 + dispersion + root_dispersion + abs(offset)
    good = "0" not in cells[5] + cells[6] and cells[3] != "?"
    kind = SourceKind(f"chrony measurements {cells[2]}", "chrony", 2, "servo", "utc", cells[2])
    return kind, Row(time_s, -offset, hard, good, stratum=float(cells[4]) + 1.0), ""


def is_refclock(reference: str) -> bool:
    """Whether a reference that a tracking log names is a clock of the host's own, and no server."""
    return bool(reference) and not set(reference) & set(".:")


def _refclock(time_s: float, cells: list[str]) -> tuple[SourceKind, Row, str] | None:
    if cells[6] == "-":
        return None
    offset, dispersion = float(cells[7]), float(cells[8])
    kind = SourceKind(f"chrony refclock {cells[2]}", "chrony", 2, "servo", "utc", cells[2], False)
    return kind, Row(time_s, -offset, abs(offset) + dispersion, cells[4] != "?"), ""
