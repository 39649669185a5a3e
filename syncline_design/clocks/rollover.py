"""Stamps of a table that count within a day, a week or a counter's range, and begin anew.

Such a fold is no start of the clock: taken for one, it would make two sessions of one, and the
claim would rest on more starts than there were.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from syncline_design.clocks.series import Array
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import to_places

_PERIODS: Final = {
    "the hour": 3600.0,
    "a counter of 32 bit in us": 2.0**32 * 1e-6,
    "the day": 86400.0,
    "the GPS week": 604800.0,
    "a counter of 32 bit in ms": 2.0**32 * 1e-3,
}  # seconds
_STEPS: Final = 3.0  # usual steps that may be missing at a fold: a restart hits that by chance only


@dataclass(frozen=True, slots=True)
class Unfolded:
    """Stamps that run on [s], how often they began anew, and within what they count."""

    time_s: Array
    folds: int
    within: str


def unfolded(time_s: Array) -> Unfolded:
    """Stamps counted on over each end of a period, where all of them lie within one."""
    steps = np.diff(time_s)
    ahead = steps[steps > 0.0]
    if ahead.size and np.any(steps < 0.0) and float(np.min(time_s)) >= 0.0:
        missing = _STEPS * float(np.median(ahead))
        for within, period in _PERIODS.items():
            # below half a period: else a fold could not be told from one row out of order
            if float(np.max(time_s)) < period and missing < period / 2.0:
                over = steps + period
                begun = (steps < 0.0) & (over <= missing)
                if np.any(begun):
                    runs = np.concatenate([[0.0], np.cumsum(begun)])
                    return Unfolded(time_s + period * runs, int(runs[-1]), within)
    return Unfolded(time_s, 0, "")


def said(found: Unfolded) -> str:
    """What the reader says of it."""
    often = "once" if found.folds == 1 else f"{to_places(found.folds, 0)} times"
    return f"stamps begin anew {often}, as those do that count within {found.within}: counted on"
