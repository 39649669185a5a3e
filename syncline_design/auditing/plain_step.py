"""A step of few messages, so plain that it needs neither levels of stretches nor a rhythm.

Where receipt minus stamp of every message before a moment lies apart from that of every one after,
by more than either scatters, chance has no part in it: n independent delays fall so into two runs
once in C(n, k) ways.  The rhythm of a regular sensor says whether stamps or receipts moved.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from syncline_design.auditing.cadence import REGULAR, Cadence
from syncline_design.auditing.result import StampFault
from syncline_design.auditing.series import NS, Array, Series, in_words, seconds
from syncline_design.model.figure_text import to_digits

_LEAST: Final = 4  # messages on each side
_PLAIN: Final = 3.0  # times what either side reaches over
_ALIKE: Final = 0.35  # how near rhythm and level agree


def without_plain_step(
    series: Series, pace: Cadence, least_s: float
) -> tuple[Series, tuple[StampFault, ...]]:
    """The series without a step that parts all its messages, and that step; else as it is."""
    places = series.places()
    if series.receive is None or places.size < 2 * _LEAST:
        return series, ()
    late = seconds((series.receive - series.stamp)[places])
    at = _parting(late, least_s)
    if at is None:
        return series, ()
    size = float(np.median(late[:at]) - np.median(late[at:]))
    if pace.regular:
        broken = _broken_by(series, pace, at)
        if broken is None or abs(broken - size) > _ALIKE * abs(size):
            return series, ()
        size = broken  # which delays do not blur
    stamp = series.stamp.copy()
    stamp[places[at] :] -= round(size * NS)
    times = series.seconds[places]
    fault = StampFault(
        "step", {"seconds": size}, float(times[at]), float(times[-1]),
        f"stamps move by {'+' if size > 0 else '-'}{in_words(abs(size))} against receipts and stay "
        f"so: {to_digits(at, 6)} messages lie on one side, all {to_digits(late.size - at, 6)} "
        "after them on the other",
    )  # fmt: skip
    return replace(series, stamp=stamp), (fault,)


def _parting(late: Array, least_s: float) -> int | None:
    """The first message on the other side; None where none parts them so."""
    lowest, highest = np.minimum.accumulate(late), np.maximum.accumulate(late)
    lowest_on = np.minimum.accumulate(late[::-1])[::-1]
    highest_on = np.maximum.accumulate(late[::-1])[::-1]
    after = np.arange(_LEAST, late.size - _LEAST + 1)
    before = after - 1
    apart = np.maximum(lowest_on[after] - highest[before], lowest[before] - highest_on[after])
    at = int(np.argmax(apart))
    k = int(after[at])
    reach = max(float(np.ptp(late[:k])), float(np.ptp(late[k:])), least_s)
    return k if float(apart[at]) > _PLAIN * reach else None


def _broken_by(series: Series, pace: Cadence, at: int) -> float | None:
    """By how much the stamps leave their rhythm there [s], counted by receipts; None where one
    stamp is the next of the other and nothing is missing."""
    assert series.receive is not None
    places = series.places()
    came = float(series.receive[places[at]] - series.receive[places[at - 1]]) / NS
    measured = float(series.stamp[places[at]] - series.stamp[places[at - 1]]) / NS
    if abs(measured - pace.period_s) < REGULAR * pace.period_s:
        return None
    return measured - round(came / pace.period_s) * pace.period_s
