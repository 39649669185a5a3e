"""Locks that jump and settle, by the stamps alone: message by message against the rhythm.

After it jumped by s a clock that settles with the time constant tau is s exp(-t / tau) off, and
that is how far its stamps stray from a + k T.  A sensor keeps its rhythm to its jitter, which is
far less than what delays scatter by: of few messages levels hardly show such a course.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Final

import numpy as np

from syncline_design.auditing.cadence import Cadence
from syncline_design.auditing.clock_shapes import Shape, course
from syncline_design.auditing.series import Array, Series, seconds
from syncline_design.machine.deadline import in_force

_JITTER: Final = 10.0  # times: smaller breaks are the rhythm's own
_LEAST_S: Final = 2e-5
_GRAINS: Final = 2.2  # of the coarser time
_TRIED: Final = 4  # intervals, those that are off by most
_LEAST: Final = 12  # messages
_MOST: Final = 2000
_TRIALS: Final = 24  # time constants
_LASTS: Final = 3.0  # time constants: what was settled before the log's end
_AROUND: Final = 6.0  # time constants in which levels have to follow
_NEAR: Final = 0.1  # of a jump: how near to it what settles is
_REST: Final = 0.05  # of it: what stamps lie off the course
_ASIDE: Final = 2  # messages
_HALF: Final = 0.5  # of it: how near to it levels are
_CHANCE: Final = 4.0  # sigma


def without_locks(
    series: Series, pace: Cadence, least_s: float
) -> tuple[Series, tuple[Shape, ...]]:
    """The series without locks whose course its stamps show, and these; least_s: smaller ones
    are left."""
    if series.receive is None or not pace.regular or pace.interval.size < 2 * _LEAST:
        return series, ()
    # by the rhythm, in which no two are measured at once
    times = np.concatenate([[0.0], np.cumsum(np.maximum(pace.steps, 1.0) * pace.period_s)])
    late = seconds((series.receive - series.stamp)[pace.places])
    shapes = _found(pace, times, late, least_s)
    begins = series.seconds[pace.places][np.searchsorted(times, [s.begin_s for s in shapes])]
    received = tuple(
        replace(s, begin_s=float(t), end_s=float(t)) for s, t in zip(shapes, begins, strict=True)
    )
    return series.stamped_later(course(shapes, times)), received


def _found(pace: Cadence, times: Array, late: Array, least_s: float) -> tuple[Shape, ...]:
    """Locks that stamps show against the rhythm and levels of receipt minus stamp against both."""
    off = pace.interval - pace.steps * pace.period_s
    strayed = np.concatenate([[0.0], np.cumsum(off)])
    noise = max(_JITTER * pace.jitter_s, _LEAST_S, _GRAINS * least_s)
    broken = np.argsort(-np.abs(off))[:_TRIED]
    places = sorted(int(k) + 1 for k in broken if abs(off[k]) > noise)
    shapes: list[Shape] = []
    for place in places:
        in_force().check()
        ends = {min([k for k in places if k > place], default=times.size), times.size}
        trials = [s for end in ends for s in _locks(pace.period_s, times, strayed, (place, end))]
        shape = min(trials, key=lambda s: _levels(s, times, late)[1], default=None)
        if shape is not None and _levels(shape, times, late)[0]:
            shapes.append(shape)
            own = course((shape,), times)
            strayed, late = strayed + own, late - own
    return tuple(shapes)


def _locks(period_s: float, times: Array, strayed: Array, part: tuple[int, int]) -> Iterator[Shape]:
    """By least squares over time constants; none where stamps lie off such a course.

    It begins where stamps jump by as much as they settle, but for whole intervals, which nobody
    counts: a jump by about an interval may be a message or two aside.  part: from which to which
    message it settles.
    """
    first, end = part
    if end - first < _LEAST:
        return
    some = first + np.unique(np.geomspace(1.0, end - first, _MOST).astype(np.intp)) - 1
    when, told = times[some] - times[first], strayed[some]
    settle_s = _settling(when, told)
    if settle_s is None:
        return
    size, left = _fit(when, told, settle_s)
    scatter = float(np.std(left))
    for place in range(max(1, first - _ASIDE), min(first + _ASIDE, end - 1) + 1):
        begin_s = float(times[place])
        own = size * float(np.exp((times[first] - begin_s) / settle_s))
        apart = own - float(strayed[place] - strayed[place - 1])
        apart -= round(apart / period_s) * period_s
        if abs(apart) < _NEAR * abs(own) and scatter < _REST * abs(own):
            sigma = scatter / float(np.sqrt(when.size))
            yield Shape("relock", -own, sigma, begin_s, begin_s, settle_s)


def _settling(when: Array, told: Array) -> float | None:
    """The time constant [s] that leaves least."""
    from scipy.optimize import minimize_scalar

    shortest, longest = float(when[2]), float(when[-1]) / _LASTS
    if not 0.0 < shortest < longest:
        return None

    def rest(log_s: float) -> float:
        return float(np.std(_fit(when, told, float(np.exp(log_s)))[1]))

    trials = np.linspace(np.log(shortest), np.log(longest), _TRIALS)
    best = int(np.argmin([rest(float(x)) for x in trials]))
    around = trials[max(0, best - 1)], trials[min(_TRIALS - 1, best + 1)]
    return float(np.exp(minimize_scalar(rest, bounds=around, method="bounded").x))


def _fit(when: Array, told: Array, settle_s: float) -> tuple[float, Array]:
    """(size, what is left) of a course that settles beside a drift."""
    columns = np.stack([np.exp(-when / settle_s), np.ones(when.size), when], axis=1)
    sizes = np.linalg.lstsq(columns, told, rcond=None)[0]
    return float(sizes[0]), np.asarray(told - columns @ sizes)


def _levels(shape: Shape, times: Array, late: Array) -> tuple[bool, float]:
    """(whether receipt minus stamp shows the lock, what it leaves): receipts go on with the rhythm.
    Those of a sensor that measures so itself go with its stamps."""
    near = np.abs(times - shape.begin_s) < _AROUND * shape.settle_s
    when, told = times[near] - shape.begin_s, late[near]
    columns = np.stack([shape.size_s * shape.at(times[near]), np.ones(when.size), when], axis=1)
    sizes = np.linalg.lstsq(columns, told, rcond=None)[0]
    left = float(np.std(told - columns @ sizes))
    sigma = left * float(np.sqrt(np.linalg.pinv(columns.T @ columns)[0, 0]))
    share = float(sizes[0])
    return abs(share - 1.0) < _HALF and share > _CHANCE * sigma, left
