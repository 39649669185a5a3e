"""Statistics of ntpd and NTPsec: loopstats and peerstats (RFC 5905: reference minus local)."""

from __future__ import annotations

import re
from typing import Final

from syncline_design.clocks.series import Row, SourceKind

_MJD_EPOCH: Final = 40587  # of 1970-01-01
_DAYS: Final = range(_MJD_EPOCH, 90000)
_STATUS: Final = re.compile(r"[0-9a-fA-F]{4}")
_SELECTED: Final = 6  # sys.peer; 7: pps.peer

PEERSTATS: Final = "ntpd peerstats"
LOOPSTATS: Final = SourceKind("ntpd loopstats", "ntpd", 1, "servo", "utc")


def row(line: str) -> tuple[SourceKind, Row, str] | None:
    """A line of loopstats or peerstats; None: no such line."""
    cells = line.split()
    if not 6 <= len(cells) <= 9 or not cells[0].isdigit() or int(cells[0]) not in _DAYS:
        return None
    try:
        second = float(cells[1])
        if not 0.0 <= second <= 86401.0:
            return None
        time_s = 86400.0 * (int(cells[0]) - _MJD_EPOCH) + second
        address = "." in cells[2] or ":" in cells[2] or "(" in cells[2]
        if _STATUS.fullmatch(cells[3]) and address and len(cells) in (7, 8):
            return _peer(time_s, cells)
        if len(cells) == 7:
            rate = 1e-6 * float(cells[3])
            skew = 1e-6 * float(cells[5])
            # ntpd begins with no wander at all
            row = Row(time_s, -float(cells[2]), rate=rate, skew=skew, opened=skew == 0.0)
            return LOOPSTATS, row, ""
    except ValueError:
        pass
    return None


def _peer(time_s: float, cells: list[str]) -> tuple[SourceKind, Row, str]:
    """Hard bound: |offset| + delay / 2 + dispersion; a peer that is not selected steers nothing."""
    offset, delay, dispersion = map(float, cells[4:7])
    hard = abs(offset) + delay / 2.0 + dispersion
    selected = (int(cells[3], 16) >> 8) & 7 >= _SELECTED
    kind = SourceKind(f"{PEERSTATS} {cells[2]}", "ntpd", 2, "servo", "utc", cells[2])
    return kind, Row(time_s, -offset, hard), cells[2] if selected else ""
