"""Sources of one chronyd that cannot all be right: beyond what the path allows."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from syncline_design.clocks.chrony import TRACKING
from syncline_design.clocks.series import Array, ClockSeries
from syncline_design.model.figure_text import format_duration, rounded

_FEWEST: Final = 20  # rows of both
_REACH_S: Final = 1024.0  # chronyd's largest usual poll: a bound is taken to last so long
_MEASURED: Final = "chrony measurements "


def disagreeing(series: Sequence[ClockSeries]) -> Iterator[tuple[str, str]]:
    """Names of sources that say more of the clock's offset, as a rule, than the bound of the
    tracking log and their own path allow together; and that in words.

    Servers whose measurements are there are asked by these: statistics hold no delays.
    """
    tracked = _bounds([one for one in series if one.kind.name == TRACKING.name])
    measured = {one.kind.reference for one in series if one.kind.name.startswith(_MEASURED)}
    rest = [one for one in series if one.kind.family == TRACKING.family
            and one.kind.name != TRACKING.name]  # fmt: skip
    for name in dict.fromkeys(one.kind.name for one in rest):
        parts = [one for one in rest if one.kind.name == name]
        if name.startswith("chrony statistics") and parts[0].kind.reference in measured:
            continue
        apart = np.concatenate([_beyond(one, tracked) for one in parts])
        if apart.shape[0] < _FEWEST or float(np.median(apart[:, 2])) <= 0.0:
            continue
        off, bound = (format_duration(float(rounded(np.median(apart[:, k]), 3))) for k in (0, 1))
        own = "" if parts[0].kind.name.startswith(("chrony refclock", _MEASURED)) else (
            "; if its path is what is wrong, measurements.log says so")  # fmt: skip
        yield name, (f"{name} puts the clock {off} off, where the tracking log at the same time "
                     f"bounds that by {bound}: one of both is wrong (the edge or delay of a pulse, "
                     f"a server){own}")  # fmt: skip


def _bounds(tracked: Sequence[ClockSeries]) -> Array:
    """Stamps and bounds [s] of rows in lock, in the order of time."""
    rows = [np.column_stack([one.time_s, one.hard_s])[one.locked & np.isfinite(one.hard_s)]
            for one in tracked]  # fmt: skip
    found = np.concatenate(rows) if rows else np.zeros((0, 2))
    ordered: Array = found[np.argsort(found[:, 0], kind="stable")]
    return ordered


def _beyond(one: ClockSeries, tracked: Array) -> Array:
    """Of rows with a bound of the tracking log about them: |offset|, that bound, and how far the
    offset is beyond it and beyond what the row's own path allows."""
    if tracked.shape[0] < 2:
        return np.zeros((0, 3))
    after = np.clip(np.searchsorted(tracked[:, 0], one.time_s), 1, tracked.shape[0] - 1)
    bound = np.maximum(tracked[after - 1, 1], tracked[after, 1])
    near = (np.abs(tracked[after, 0] - one.time_s) <= _REACH_S) & (
        np.abs(tracked[after - 1, 0] - one.time_s) <= _REACH_S
    )
    off = np.abs(one.offset_s)
    own = np.nan_to_num(one.hard_s - off)
    rows = near & one.locked & np.isfinite(off)
    told: Array = np.column_stack([off, bound, off - bound - own])[rows]
    return told
