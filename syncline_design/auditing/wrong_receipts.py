"""Receipts of single messages that the recorder cannot have noted: a damaged figure, a bit that
flipped, a clock that was wrong for an instant.

Receipts are noted one after another, so that no message was received long after messages that
follow it.  The fewest messages are left out so that receipts rise (longest rising subsequence:
Fredman 1975); those of them are wrong that lie far from both neighbours while their stamps do not.
"""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from syncline_design.auditing.order import Repaired, without_unset
from syncline_design.auditing.result import StampFault
from syncline_design.auditing.series import NS, Series, in_words, spread
from syncline_design.logs.readers.stream import Nanoseconds

FAR_NS: Final = 5 * 10**8  # no thread that notes messages waits so long
MOST_IN_ROW: Final = 50  # messages; of more a clock was set, and set back
MOST_AT_END: Final = 3  # messages: a clock that was set is told by four
_SPREADS: Final = 20.0
_AROUND: Final = 60  # messages
_MOST_SHARE: Final = 0.1  # of the messages: beyond it receipts are of no one clock


def without_wrong_receipts(series: Series) -> Repaired:
    """Messages whose receipt is wrong left out, and received when their neighbours were."""
    if series.receive is None or not np.any(np.diff(series.receive) < -FAR_NS):
        return Repaired(series)
    places = without_unset(series).series.places()  # how late these are says nothing
    if places.size < 2 * MOST_AT_END:
        return Repaired(series)
    receive = series.receive[places]
    late = receive - series.stamp[places]
    wrong = _wrong(receive, late)
    count = int(wrong.sum())
    if not count or count > _MOST_SHARE * places.size:
        return Repaired(series)
    right = np.flatnonzero(~wrong)
    before = np.clip(np.searchsorted(right, np.arange(wrong.size), "right") - 1, 0, None)
    beside = receive[right[before]]
    far = (late - late[right[before]])[wrong]
    whole, good = series.receive.copy(), series.good.copy()
    whole[places[wrong]] = beside[wrong]
    good[places[wrong]] = False
    start = int(beside[0]) if series.start == int(receive[0]) else series.start
    left = replace(series, receive=whole, good=good, start=start)
    return Repaired(left, (_fault(far, left.seconds[places[wrong]]),))


def _fault(far: Nanoseconds, times: NDArray[np.float64]) -> StampFault:
    """seconds: of the farthest receipt, after its neighbours positive."""
    deepest = int(far[np.argmax(np.abs(far))])
    side = "after" if deepest > 0 else "before"
    one = far.size == 1
    words = f"{far.size} receipt{' lies' if one else 's lie'} far from those of the messages around"
    return StampFault(
        "wrong_receipts", {"count": float(far.size), "seconds": deepest / NS}, float(times[0]),
        float(times[-1]), f"{words}{' it' if one else ' them'}, by up to "
        f"{in_words(abs(deepest) / NS)} {side} them, while the stamps go on as if nothing were",
    )  # fmt: skip


def _wrong(receive: Nanoseconds, late: Nanoseconds) -> NDArray[np.bool_]:
    """Receipts that lie far from both neighbours, by how late their messages are too."""
    stamp = receive - late
    usual = MOST_AT_END * np.median(np.abs(np.diff(stamp)))
    out = np.ones(receive.size, bool)
    out[rising(receive)] = False
    wrong = np.zeros(receive.size, bool)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], out.astype(np.int8), [0]])))
    for begin, end in edges.reshape(-1, 2):
        at_end = begin == 0 or end == receive.size
        if end - begin > (MOST_AT_END if at_end else MOST_IN_ROW):
            continue
        sides = late[max(0, begin - _AROUND) : begin], late[end : end + _AROUND]
        around = np.concatenate(sides)
        far = max(FAR_NS, _SPREADS * spread(np.diff(around).astype(np.float64)))
        away = np.abs(late[begin:end] - np.median(around)) > far
        beside = [k for k in (begin - 1, end) if 0 <= k < receive.size]
        apart = np.abs(receive[begin:end, None] - receive[beside]).min(axis=1) > far
        own, low, high = stamp[begin:end], stamp[beside].min(), stamp[beside].max()
        beyond = far + usual if at_end else far  # an end has a neighbour on one side alone
        steady = (own > low - beyond) & (own < high + beyond)
        wrong[begin:end] = away & apart & steady & (at_end or not _set_between(*sides))
    return wrong


def _set_between(before: Nanoseconds, after: Nanoseconds) -> bool:
    """Whether a clock was set between them: messages of both sides may have changed places."""
    return abs(float(np.median(after) - np.median(before))) > FAR_NS / 2


def rising(values: Nanoseconds) -> list[int]:
    """Places of the longest subsequence that never falls."""
    tops: list[int] = []
    ends: list[int] = []
    before: list[int] = []
    for k, value in enumerate(values.tolist()):
        at = bisect_right(tops, value)
        before.append(ends[at - 1] if at else -1)
        if at == len(tops):
            tops.append(value)
            ends.append(k)
        else:
            tops[at], ends[at] = value, k
    found: list[int] = []
    at = ends[-1] if ends else -1
    while at >= 0:
        found.append(at)
        at = before[at]
    return found[::-1]
