"""Where a run of a clock ends and the next one begins, by what the logs hold of starts.

A silence of a daemon's log is none: the server may have been away, and the clock ran free.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from syncline_design.clocks.chrony import TRACKING
from syncline_design.clocks.series import Array, ClockSeries, DaemonName

# Programs that only compare: nothing in their logs would tell a start of the clock from a silence.
OF_NO_STARTS: Final[tuple[DaemonName, ...]] = ("csv", "gpsd", "ppstest")
NTPD: Final[DaemonName] = "ntpd"
# ntpd's wander is an average over eight updates (ntp_loopfilter.c) and keeps 93 % of what it was
# from one to the next: from two of the last digit of loopstats it falls to none at a start only
_LEAST_WANDER: Final = 1.5e-12
_FIRST_UPDATE_S: Final = 1024.0  # chronyd's largest usual poll: sources tell of a start before it


def cuts(series: ClockSeries, gap_s: float) -> NDArray[np.int64]:
    """The first rows of all runs but the first.

    A daemon that says that it began anew (another process, a bound or a wander as at a start)
    begins a run, however short it was away.  After a silence longer than `gap_s` a log that was
    opened anew is such a word too: a silence alone is none.
    """
    steps = np.diff(series.time_s)
    begun = series.restart[1:] & ~series.restart[:-1]  # several such lines are one start
    if series.kind.family == NTPD:
        begun |= series.opened[1:] & (series.skew[:-1] >= _LEAST_WANDER)
    opened = series.opened[1:] & ~series.opened[:-1]
    silent = steps > gap_s
    if series.kind.family not in OF_NO_STARTS:
        silent &= opened
    return np.flatnonzero(silent | (steps < -1.0) | begun) + 1


def silences(series: ClockSeries, gap_s: float) -> list[int]:
    """Rows before silences longer than `gap_s` that are taken as outages within one run."""
    steps = np.diff(series.time_s)
    begins = np.zeros(len(series), dtype=bool)
    begins[cuts(series, gap_s)] = True
    found: list[int] = np.flatnonzero((steps > gap_s) & ~begins[1:]).tolist()
    return found


def with_starts(series: Sequence[ClockSeries]) -> list[ClockSeries]:
    """Starts that chronyd tells of in its tracking log, in its other logs too."""
    tracked = [one for one in series if one.kind == TRACKING]
    opened = [one.time_s[one.opened & ~one.restart] for one in tracked]
    openings = np.sort(np.concatenate(opened)) if opened else np.zeros(0)
    breaks = [pair for one in tracked for pair in _breaks(one)]
    return [_begun(_marked(one, openings), breaks) if _is_beside(one) else one for one in series]


def _breaks(tracking: ClockSeries) -> list[tuple[float, float]]:
    """Of each start within a tracking log: the stamps of the last row before it and its first."""
    places = np.flatnonzero(tracking.restart[1:] & ~tracking.restart[:-1])
    return [(float(tracking.time_s[k]), float(tracking.time_s[k + 1])) for k in places]


def _begun(one: ClockSeries, breaks: Sequence[tuple[float, float]]) -> ClockSeries:
    """A run begins after the longest silence of those that lie in a break of the tracking log.

    Sources are measured before the first update that the tracking log tells of, and after the last.
    """
    restart, steps = one.restart.copy(), np.diff(one.time_s)
    for before, after in breaks:
        places = np.flatnonzero((one.time_s[:-1] < after) & (one.time_s[1:] > before))
        if places.shape[0]:
            restart[places[np.argmax(steps[places])] + 1] = True
    return replace(one, restart=restart)


def _is_beside(one: ClockSeries) -> bool:
    return one.kind.family == TRACKING.family and one.kind != TRACKING and len(one) > 1


def _marked(one: ClockSeries, starts: Array) -> ClockSeries:
    """Rows with a start between them and the row before, or just after them."""
    until = np.searchsorted(starts, one.time_s + _FIRST_UPDATE_S, side="right")
    since = np.searchsorted(starts, one.time_s, side="right")
    opened = one.opened.copy()
    opened[1:] |= (until[1:] > since[:-1]) & (np.diff(one.time_s) > _FIRST_UPDATE_S)
    return replace(one, opened=opened)
