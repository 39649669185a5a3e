"""Stamps of a clock that stood still while messages went on coming.

Message after message carries one stamp, or some microseconds more, and receipts go on at the
sensor's pace.  On a coarse grid most stamps do so, and messages of one packet come at once: a clock
that stands still does it seldom, and for longer than some messages.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Final

import numpy as np

from syncline_design.auditing.order import Repaired
from syncline_design.auditing.result import StampFault
from syncline_design.auditing.series import Array, Series, in_words, median, seconds
from syncline_design.model.figure_text import to_digits

_STILL: Final = 0.02  # of the usual interval
_LEAST: Final = 4  # messages in a row, beside the one that was stamped last
_PASSED: Final = 0.5  # of the time that so many messages take
_MOST: Final = 0.3  # of all messages: more are how it stamps
_ELSEWHERE: Final = 0.05  # of the others


def without_stuck(series: Series) -> Repaired:
    """The series without messages that were stamped while the clock stood still."""
    places = series.places()
    if series.receive is None or places.size < 4 * _LEAST:
        return Repaired(series)
    interval, came = (seconds(np.diff(x[places])) for x in (series.stamp, series.receive))
    forward = interval[interval > 0.0]
    usual = median(forward) if forward.size else 0.0
    still = (interval >= 0.0) & (interval < _STILL * usual)
    found = [run for run in _runs(still) if _waits(came, run, usual)]
    count = sum(end - begin for begin, end in found)
    others = int(still.sum()) - count
    if not found or count > _MOST * places.size or others > _ELSEWHERE * places.size:
        return Repaired(series)
    good = series.good.copy()
    for begin, end in found:
        good[places[begin + 1 : end + 1]] = False
    return Repaired(replace(series, good=good), (_fault(series.seconds[places], came, found),))


def _runs(still: np.ndarray) -> list[tuple[int, int]]:
    """Stretches of intervals in which stamps hardly move."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], still.astype(np.int8), [0]])))
    return [(int(a), int(b)) for a, b in list(pairwise(edges))[::2]]


def _waits(came: Array, run: tuple[int, int], usual: float) -> bool:
    begin, end = run
    passed = float(came[begin:end].sum())
    return end - begin >= _LEAST and passed > _PASSED * (end - begin) * usual


def _fault(times: Array, came: Array, found: Sequence[tuple[int, int]]) -> StampFault:
    count = sum(end - begin for begin, end in found)
    longest = max(float(came[begin:end].sum()) for begin, end in found)
    often = f"{to_digits(len(found), 6)} times, " if len(found) > 1 else ""
    return StampFault(
        "duplicates", {"count": float(count)}, float(times[found[0][0] + 1]),
        float(times[found[-1][1]]),
        f"stamps stood still {often}for up to {in_words(longest)} while {to_digits(count, 6)} "
        "messages came, as of a clock that stopped",
    )  # fmt: skip
