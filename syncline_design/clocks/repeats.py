"""One session given twice: as it is, in part, or as another program exported it.

An export may count its time from another start, or in another zone: then the same offsets follow
one another at the same intervals.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

import numpy as np

from syncline_design.clocks.files import refused
from syncline_design.clocks.series import Array, ClockSeries
from syncline_design.model.figure_text import format_duration

Rows = tuple[Array, Array]  # stamps and offsets [s]
_HINT: Final = "a session counts once: give each once"
_DEVIATIONS: Final = 6.0  # of a count by chance
_FEWEST: Final = 10  # rows whose offsets can be told to move alike
_SAME_STAMP: Final = 0.05  # of the usual time between rows: what an export rounds off
_ALIKE: Final = 0.99  # correlation of what two logs' offsets move from row to row
_ROUNDED: Final = 0.95  # share of rows that differ by no more than the coarser log's rounding
_FINEST_S: Final = 1e-15  # below it offsets differ by arithmetic alone
_PROBE: Final = 12  # rows in a row by which one log is looked for in another
_LEVELS: Final = 6  # steps that these take: fewer come back by chance, or by a drift
_THINNED: Final = 10  # an export that keeps each tenth row is still looked for
_DAY_S: Final = 86400.0  # zones are less apart
_BIN: Final = 8  # rows of the sparser log: their mean hardly depends on where they were taken
_FEWEST_BINS: Final = 20
_BINS_ALIKE: Final = 0.9  # correlation of second differences of such means, free of a common day
_BETWEEN: Final = 0.97  # correlation of second differences of rows, read between the other's
_FEWEST_BETWEEN: Final = 30
_STARTS: Final = (0.0, 0.35, 0.7)  # shares of a log at which such rows begin


def demand_once(series: Sequence[ClockSeries]) -> None:
    """Rows of one source in two logs are one session given twice, whole or in part.

    Within a log a row that comes back is one too: a rotation and its copy.
    """
    for index, one in enumerate(series):
        rows = one.time_s + 1j * one.offset_s
        most = max(2, len(one) // 20)
        for other in series[:index]:
            if other.kind.name != one.kind.name:
                continue
            _demand_apart(one, other, most)
            if _apart(one, other):
                continue
            exactly = int(np.sum(np.isin(rows, other.time_s + 1j * other.offset_s)))
            twice = max(exactly, _followed(one, other))
            if twice > most + _by_chance(one, other):
                raise refused(Path(one.files[0]), f"the same session as in {other.files[0]}",
                              found=f"{twice} rows of {one.kind.name} with the same stamps, whose "
                              "offsets are the same but for unit or rounding",
                              hint=_HINT)  # fmt: skip
            if _resampled(one, other):
                raise refused(Path(one.files[0]), f"the same session as in {other.files[0]}",
                              found=f"{len(one)} rows of {one.kind.name} at the same time, whose "
                              "offsets move as there: resampled, or averaged",
                              hint=_HINT)  # fmt: skip
        if len(one.files) > 1 and len(one) - np.unique(rows).shape[0] > most:
            raise refused(Path(one.files[-1]), f"the same session as in {one.files[0]}",
                          found="rows with the same stamp and offset", hint=_HINT)  # fmt: skip


def _by_chance(one: ClockSeries, other: ClockSeries) -> float:
    """Rows that two logs of a coarse resolution share without being one, by what their own values
    are: the shared stamps times the chance of one value in both, and six of its deviations.

    Rows that are one agree in all, and a whole log of few values in no more than that chance.
    """
    shared = int(np.sum(np.isin(one.time_s, other.time_s)))
    values, own = np.unique(one.offset_s[np.isfinite(one.offset_s)], return_counts=True)
    others, theirs = np.unique(other.offset_s[np.isfinite(other.offset_s)], return_counts=True)
    _, here, there = np.intersect1d(values, others, assume_unique=True, return_indices=True)
    chance = float(np.sum(own[here] / np.sum(own) * (theirs[there] / np.sum(theirs))))
    expected = shared * min(chance, 1.0)
    return expected + _DEVIATIONS * float(np.sqrt(expected * (1.0 - min(chance, 1.0))))


def _demand_apart(one: ClockSeries, other: ClockSeries, most: int) -> None:
    """Refuses a log whose offsets another holds as well, one after the other, at another time."""
    rows, later_s = _elsewhere(one, other)
    if rows > most:
        when = f"{format_duration(abs(later_s))} {'later' if later_s > 0.0 else 'earlier'}"
        found = (f"{rows} rows of {one.kind.name} whose offsets follow one another as there, "
                 f"stamped {when if abs(later_s) < _DAY_S else 'from another start'}")  # fmt: skip
        raise refused(Path(one.files[0]), f"the same session as in {other.files[0]}",
                      found=found, hint=_HINT)  # fmt: skip


def _elsewhere(one: ClockSeries, other: ClockSeries) -> tuple[int, float]:
    """How many rows of one log another one holds at other stamps, and by how much later [s]."""
    rows, later_s = _held(one, other)
    if rows:
        return rows, later_s
    rows, earlier_s = _held(other, one)
    return rows, -earlier_s


def _held(one: ClockSeries, other: ClockSeries) -> tuple[int, float]:
    """As `_elsewhere`, where each row of one, or each second, third ... of other is one of one."""
    own, others = one.offset_s, other.offset_s
    coarser = max(_resolution(own[np.isfinite(own)]), _resolution(others[np.isfinite(others)]))
    least = 0.51 * coarser + _FINEST_S
    for sign in (1.0, -1.0):
        for first, stride in _places(own, sign * others, least):
            there = first + stride * np.arange(len(one))
            inside = (there >= 0) & (there < len(other))
            near = np.abs(own[inside] - sign * others[there[inside]]) <= least
            later = one.time_s[inside] - other.time_s[there[inside]]
            later_s, step = float(np.median(later)), float(np.median(np.diff(one.time_s)))
            near &= np.abs(later - later_s) <= 0.5 * step
            if float(np.mean(near)) > _ROUNDED and abs(later_s) > _SAME_STAMP * step:
                return int(np.sum(near)), later_s
    return 0, 0.0


def _places(own: Array, others: Array, least: float) -> Iterator[tuple[int, int]]:
    """Where some of one's rows follow one another in others: the first row's place, the stride."""
    for share in _STARTS:
        begin = int(share * own.shape[0])
        probe = own[begin : begin + _PROBE]
        if probe.shape[0] < _PROBE or np.unique(np.round(np.diff(probe) / least)).size < _LEVELS:
            continue
        begun = np.flatnonzero(np.abs(others - probe[0]) <= least)
        for stride in range(1, _THINNED + 1):
            at = begun[begun + stride * (_PROBE - 1) < others.shape[0]]
            for k, value in enumerate(probe[1:], 1):
                if not at.size:  # as for most logs, after a row or two
                    break
                at = at[np.abs(others[at + k * stride] - value) <= least]
            yield from ((int(where) - begin * stride, stride) for where in at[:1])


def _apart(one: ClockSeries, other: ClockSeries) -> bool:
    """Whether no stamp of one can be a stamp of the other."""
    return bool(np.min(one.time_s) > np.max(other.time_s)
                or np.min(other.time_s) > np.max(one.time_s))  # fmt: skip


def _followed(one: ClockSeries, other: ClockSeries) -> int:
    """How many rows of one log the other holds too, in another unit or rounded; 0: it does not.

    Two clocks that are compared at the same moments do not move alike from row to row.  Stamps that
    count from a start come back with the next one.
    """
    if one.kind.stamps != "utc":
        return 0
    own, others = _at_one_time(one, other)
    if own.shape[0] < _FEWEST:
        return 0
    coarser = max(_resolution(own), _resolution(others))
    near = np.abs(own - others) <= 0.51 * coarser + _FINEST_S
    if float(np.mean(near)) > _ROUNDED:
        return int(own.shape[0])
    return int(own.shape[0]) if _correlation(np.diff(own), np.diff(others)) > _ALIKE else 0


def _correlation(own: Array, others: Array) -> float:
    """|correlation| about the means: two clocks left alone both drift; 0 where one never moves."""
    own, others = own - np.mean(own), others - np.mean(others)
    size = float(np.linalg.norm(own) * np.linalg.norm(others))
    return abs(float(own @ others)) / size if size > 0.0 else 0.0


def _resampled(one: ClockSeries, other: ClockSeries) -> bool:
    """Whether one log tells at its own stamps what the other told at others: of one clock, then."""
    if one.kind.stamps != "utc":
        return False
    apart_s = max(float(np.median(np.diff(log.time_s))) if len(log) > 1 else 0.0
                  for log in (one, other))  # fmt: skip
    logs = (_known(one), _known(other))
    return apart_s > 0.0 and (
        _moves_between(*logs) or _moves_between(*logs[::-1])
        or _averages_alike(logs, _BIN * apart_s)
    )  # fmt: skip


def _moves_between(one: Rows, other: Rows) -> bool:
    """Whether one's rows are what is read between other's rows."""
    times, offsets = one
    if not other[0].shape[0]:
        return False
    inside = (times >= other[0][0]) & (times <= other[0][-1])
    if int(np.sum(inside)) < _FEWEST_BETWEEN:
        return False
    read = np.interp(times[inside], *other)
    return _correlation(np.diff(offsets[inside], 2), np.diff(read, 2)) > _BETWEEN


def _averages_alike(logs: tuple[Rows, Rows], bin_s: float) -> bool:
    """Whether means over the same stretches of time bend alike."""
    if not all(times.shape[0] for times, _ in logs):
        return False
    begin, end = max(t[0] for t, _ in logs), min(t[-1] for t, _ in logs)
    count = int((end - begin) / bin_s)
    if count < _FEWEST_BINS:
        return False
    edges = begin + bin_s * np.arange(count + 1)
    own, others = (_bends(log, edges) for log in logs)
    return _correlation(own, others) > _BINS_ALIKE


def _bends(log: Rows, edges: Array) -> Array:
    """Second differences of the means between edges, brought to the middles: without a drift."""
    rows, _ = np.histogram(log[0], edges)
    full = rows > 0
    times, means = (np.histogram(log[0], edges, weights=x)[0][full] / rows[full] for x in log)
    found: Array = np.diff(np.interp(0.5 * (edges[:-1] + edges[1:]), times, means), 2)
    return found


def _known(log: ClockSeries) -> Rows:
    """Stamps and offsets [s] of the rows that have one, in the order of time."""
    order = np.argsort(log.time_s, kind="stable")
    order = order[np.isfinite(log.offset_s[order])]
    return log.time_s[order], log.offset_s[order]


def _at_one_time(one: ClockSeries, other: ClockSeries) -> tuple[Array, Array]:
    """Offsets [s] of both logs at the stamps that they share."""
    order = np.argsort(other.time_s, kind="stable")
    stamps = other.time_s[order]
    near = np.clip(np.searchsorted(stamps, one.time_s), 1, max(stamps.shape[0] - 1, 1))
    near = np.minimum(near, stamps.shape[0] - 1)
    before = np.maximum(near - 1, 0)
    near = np.where(
        np.abs(stamps[before] - one.time_s) < np.abs(stamps[near] - one.time_s), before, near
    )
    steps = np.diff(np.unique(one.time_s))
    least = _SAME_STAMP * float(np.median(steps)) if steps.shape[0] else 0.0
    own, others = one.offset_s, other.offset_s[order][near]
    shared = np.abs(stamps[near] - one.time_s) <= least
    shared &= np.isfinite(own) & np.isfinite(others)
    return own[shared], others[shared]


def _resolution(offsets: Array) -> float:
    """The smallest difference between two values [s]: what the last digit can say."""
    steps = np.diff(np.unique(offsets))
    steps = steps[steps > _FINEST_S]
    return float(np.min(steps)) if steps.shape[0] else 0.0
