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
_FIRST_UPDATE_S: Final = 1024.0  # chronyd's largest usual poll: sources tell of a start before it


def cuts(series: ClockSeries, gap_s: float) -> NDArray[np.int64]:
    """The first rows of all runs but the first.

    After a silence longer than `gap_s` a daemon has to have begun anew: only its own word for that
    (another process, a log opened anew, a bound or a wander as at a start) makes the silence the
    end of a run.
    """
    steps = np.diff(series.time_s)
    begun = series.restart[1:] & ~series.restart[:-1]  # several such lines are one start
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
    begun = [one.time_s[one.restart | one.opened] for one in tracked]
    starts = np.sort(np.concatenate(begun)) if begun else np.zeros(0)
    return [_marked(one, starts) if _is_beside(one) and starts.shape[0] else one for one in series]


def _is_beside(one: ClockSeries) -> bool:
    return one.kind.family == TRACKING.family and one.kind != TRACKING and len(one) > 1


def _marked(one: ClockSeries, starts: Array) -> ClockSeries:
    """Rows with a start between them and the row before, or just after them."""
    until = np.searchsorted(starts, one.time_s + _FIRST_UPDATE_S, side="right")
    since = np.searchsorted(starts, one.time_s, side="right")
    opened = one.opened.copy()
    opened[1:] |= (until[1:] > since[:-1]) & (np.diff(one.time_s) > _FIRST_UPDATE_S)
    return replace(one, opened=opened)
