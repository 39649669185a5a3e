"""How stamps follow one another: the rhythm of a sensor, messages that are missing from it.

A regular sensor measures at a + k T.  Its stamps show it, however late messages arrive: what moves
against the rhythm is the clock of the stamps, what does not is transport or the recorder.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Final

import numpy as np

from syncline_design.auditing.coarse_rhythm import Counted
from syncline_design.auditing.pauses import LONG_GAP, Pauses, pauses_of
from syncline_design.auditing.result import StampFault
from syncline_design.auditing.series import NS, Array, Mask, Series, scatter, seconds, spread
from syncline_design.logs.readers.stream import UNSET
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import percent, to_digits

_LEAST_INTERVALS: Final = 20  # to know a rhythm by
_MOST_GAPS: Final = 0.05  # of all intervals, or two: more are how the messages come
_MOST_LOST: Final = 0.2  # of all messages: more are left out on purpose
_LEAST_BY_CHANCE: Final = 100  # intervals that tell chance from a pattern
_MOST_BY_CHANCE: Final = 0.5  # of all messages: of more the rhythm itself is not known
_AS_LIKELY: Final = 0.2  # how near runs of missing messages are to the geometric law
_UNRELATED: Final = 0.05  # correlation of one missing message with the next ones
_UNEVEN: Final = 0.03  # of an interval: from here on a late message may look like a lost one
REGULAR: Final = 0.35  # of an interval: larger irregularities are no rhythm
_PLACED: Final = 0.2  # of an interval: how near to its place a message after a loss is
_LAG: Final = 16
_EVEN: Final = 0.05  # of an interval: stamps whose every loss is sure
_MOST_IN_GAPS: Final = 0.5  # of a log's time: more is how messages come
_STRETCH: Final = 24  # messages over which a rhythm is followed
_MOST_STRETCHES: Final = 5000
_GROWTH: Final = 2.0  # of irregularity over 16 intervals against over one: a rhythm 1, a walk 4
_EXACT: Final = 1e-4  # of an interval: irregularities that matter nowhere
_HOLE: Final = 0.85  # of an interval: more than a late message
_WALK: Final = 2.5  # irregularity over 16 intervals against over one; a walk shows 4, a rhythm 1
_AS_EVER: Final = 0.5  # of a hole's messages that are not missing among receipts
_IN_A_ROW: Final = 8  # intervals that are lengthened alike: no chance losses
_NEXT: Final = 8  # intervals on each side: by chance not all of them hold a loss as well
_BEYOND: Final = 1.5  # of the shortest about it: less is no hole


@dataclass(frozen=True, slots=True, eq=False)
class Cadence:
    """The rhythm of the good messages' stamps.

    period_s: median interval, of regular stamps the fitted one.  regular: stamps follow a rhythm.
    jitter_s: scatter of a stamp about it.  steps: intervals between neighbours in whole periods.
    pauses: where silence belongs to how it measures.
    """

    period_s: float
    regular: bool
    jitter_s: float
    steps: Array
    interval: Array  # s
    places: np.ndarray
    pauses: Pauses | None = None


def cadence(series: Series) -> Cadence:
    places = series.places()
    interval = seconds(np.diff(series.stamp[places]))
    forward = interval[interval > 0.0]
    if forward.size < 4:
        period = float(np.median(forward)) if forward.size else 0.0
        return Cadence(period, False, 0.0, np.ones(interval.size), interval, places)
    period = _period(forward)
    steps = np.maximum(np.round(interval / period), 0.0)
    off = interval - steps * period
    usual = (steps > 0) & (steps < 3)
    jitter = scatter(off[usual]) / np.sqrt(2.0)
    # few intervals of an irregular sensor may look even by chance: all of them have to
    told = usual if interval.size >= _LEAST_BY_CHANCE else steps > 0
    within = float(np.mean(np.abs(off[told]) < REGULAR * period)) if usual.any() else 0.0
    # how an irregular sensor betrays itself: its intervals do not add up
    even = within > 0.93
    regular = even and not _walks(off, usual, period)
    pauses = pauses_of(interval, steps, period) if even else None
    regular = regular and not (pauses is not None and pauses.anew)
    return Cadence(period, regular, float(jitter), steps, interval, places, pauses)


def _period(forward: Array) -> float:
    """The median interval, made finer by the mean of those that are near it."""
    middle = float(np.median(forward))
    near = forward[np.abs(forward - middle) < 0.25 * middle]
    return float(near.mean()) if near.size > 0.5 * forward.size else middle


def _walks(off: Array, usual: Mask, period: float) -> bool:
    """Whether irregularities add up over 16 intervals instead of making good for one another."""
    clean = np.where(usual & (np.abs(off) < REGULAR * period), off, 0.0)
    if clean.size < 4 * _LAG:
        return False
    total = np.concatenate([[0.0], np.cumsum(clean)])
    one, sixteen = scatter(clean), scatter(total[_LAG:] - total[:-_LAG])
    return sixteen > _WALK * one and sixteen > 0.05 * period


def counted_over_gaps(when: Array) -> Array | None:
    """The number of each message [intervals] of stamps that scatter, with what gaps left out.

    Between gaps messages are counted one by one, as rounding intervals that scatter goes astray;
    over a gap the earliest messages of either side tell how many are missing.  None without gaps.
    """
    interval = np.diff(when)
    edges = np.flatnonzero(interval > LONG_GAP * float(np.median(interval))) + 1
    edges = edges[np.diff(edges, append=when.size) >= _LAG]
    edges = edges[np.diff(edges, prepend=0) >= _LAG]
    if not edges.size or np.median(interval) <= 0.0:
        return None
    if float(interval[edges - 1].sum()) > _MOST_IN_GAPS * float(when[-1] - when[0]):
        return None
    longest = max(np.split(when, edges), key=lambda piece: piece.size)
    period = float(np.polynomial.polynomial.polyfit(np.arange(longest.size), longest, 1)[1])
    if period <= 0.0:
        return None
    counts = np.arange(when.size, dtype=np.float64)
    floors = [float(piece.min()) for piece in np.split(when - period * counts, edges)]
    missing_ = np.round((np.asarray(floors[1:]) - floors[0]) / period)
    for edge, so_far in zip(edges, np.diff(missing_, prepend=0.0), strict=True):
        counts[edge:] += so_far
    return counts


def without_losses(when: Array, pace: Cadence) -> Array:
    """Stamps [s] of an even sensor as if none of its messages were missing, nor any pause made."""
    if pace.pauses is not None and pace.pauses.anew:
        paused = np.where(pace.steps > LONG_GAP, pace.interval - pace.period_s, 0.0)
        return np.asarray(when - np.concatenate([[0.0], np.cumsum(paused)]))
    if not pace.regular or pace.jitter_s > _EVEN * pace.period_s:
        return when
    left_out = np.maximum(pace.steps - 1.0, 0.0) * pace.period_s
    return np.asarray(when - np.concatenate([[0.0], np.cumsum(left_out)]))


def about_rhythm(when: Array) -> Array | None:
    """How far each message is from an even rhythm of the messages around it [s].

    None where there is no rhythm: irregularities that add up.  Stretches in which messages are
    missing are left out.
    """
    if when.size < 4 * _STRETCH:
        return None
    count = np.arange(when.size, dtype=np.float64)
    usual = float(np.median(when[_LAG:] - when[:-_LAG])) / _LAG
    dev = when - usual * count
    one, far = scatter(np.diff(dev)), scatter(dev[_LAG:] - dev[:-_LAG])
    if usual <= 0.0 or far > max(_GROWTH * one, _EXACT * usual) or one > usual:
        return None
    pieces = dev[: dev.size // _STRETCH * _STRETCH].reshape(-1, _STRETCH)
    pieces = pieces[:: max(1, pieces.shape[0] // _MOST_STRETCHES)]
    whole = np.max(np.abs(np.diff(pieces, axis=1)), axis=1) < _HOLE * usual
    pieces = pieces[whole]
    if pieces.shape[0] < 4:
        return None
    k = np.arange(_STRETCH) - 0.5 * (_STRETCH - 1)
    level = pieces - np.outer(pieces @ k / float(k @ k), k)
    return np.asarray((level - np.median(level, axis=1, keepdims=True)).ravel())


def missing(
    series: Series, pace: Cadence, level_s: float, *, blurred: bool = False,
    count: Counted | None = None, arrived: bool = False,
) -> tuple[StampFault, ...]:  # fmt: skip
    """Gaps and single losses: stamps and receipts leave out what should have come.

    level_s: scatter of receipts minus stamps; an interval that only the stamps show is a step.
    blurred: stamps are too coarse, or scatter too much, to tell a late message from a lost one.
    count: how the messages of coarse stamps were counted instead.  arrived: stamps are of arrival,
    so that one that waited leaves an interval that the next makes good for.
    """
    if pace.interval.size < _LEAST_INTERVALS or pace.period_s <= 0.0:
        return ()
    if count is not None:
        pace = replace(pace, period_s=count.period_s, steps=count.lost + 1.0, regular=True)
        level_s = max(level_s, count.tick_s)  # within a tick receipts and stamps differ anyhow
        lost = _of_both(series, pace, _beside_unusable(count.lost, pace), level_s)
    else:
        lost = _lost(series, pace, level_s, late=arrived) if pace.regular else _holes(pace)
        lost[pace.interval < _BEYOND * _about(pace.interval)] = 0.0
    if not lost.any():
        return ()
    few = lost[(lost > 0) & (lost < LONG_GAP)]
    share = float(few.sum()) / (pace.interval.size + float(lost.sum()))
    long_ = (lost >= LONG_GAP) if pace.regular else lost > 0
    if few.size > 5 and pace.regular:  # how long a chance run of single losses may be
        run = LONG_GAP
        while pace.interval.size * share**run > 0.02 and run < 50:
            run += 1
        long_ = lost >= run
    if count is not None:  # several may show at once
        long_ &= pace.interval > 0.5 * lost * pace.period_s
    if long_.sum() > max(2.0, _MOST_GAPS * long_.size):
        return ()
    if pace.pauses is not None:
        lost = np.where(pace.steps > LONG_GAP, 0.0, lost)
        long_ &= lost > 0
    left_out = float(lost[~long_].sum()) + float(np.sum(at_another_rate(pace.steps)))
    blurred = blurred or (left_out > _MOST_LOST * lost.size and not _by_chance(pace.steps))
    singles = () if blurred else _losses(series, pace, np.where(long_, 0.0, lost))
    return (*_gaps(series, pace, long_), *singles)


def _about(interval: Array) -> Array:
    """The shortest of the intervals about each: a sensor that measures ever faster, or less
    often for a while, leaves out nothing."""
    least = np.full(interval.size, np.inf)
    for apart in range(1, min(_NEXT, interval.size - 1) + 1):
        np.minimum(least[apart:], interval[:-apart], out=least[apart:])
        np.minimum(least[:-apart], interval[apart:], out=least[:-apart])
    return least


def _lost(series: Series, pace: Cadence, level_s: float, *, late: bool) -> Array:
    """Missing messages of every interval, those taken out as unusable not counted."""
    between = np.diff(pace.places) - 1.0
    lost = np.maximum(pace.steps - 1.0 - between, 0.0)
    lost[at_another_rate(pace.steps)] = 0.0
    lost = _of_both(series, pace, lost, level_s)
    off = np.abs(pace.interval - pace.steps * pace.period_s)
    lost[off > np.maximum(_PLACED * pace.period_s, 0.02 * pace.interval)] = 0.0
    if late or pace.jitter_s > _UNEVEN * pace.period_s:
        for k in np.flatnonzero(lost):
            if not _stays(series, pace, int(k)):
                lost[k] = 0.0
    return lost


def _beside_unusable(lost: Array, pace: Cadence) -> Array:
    """Missing messages without those taken out as unusable, which are counted a little later than
    they are where several come in a tick."""
    more = np.cumsum(lost) - np.cumsum(np.diff(pace.places) - 1.0)
    return np.diff(np.maximum.accumulate(np.maximum(more, 0.0)), prepend=0.0)


def _of_both(series: Series, pace: Cadence, lost: Array, level_s: float) -> Array:
    """Those that receipts leave out as well as stamps."""
    if series.receive is None:
        return lost
    late = seconds(np.diff((series.receive - series.stamp)[pace.places]))
    shifted = np.abs(late) > np.maximum(6.0 * level_s + 1e-6, 0.5 * lost * pace.period_s)
    lost = np.where(shifted & (late < 0.0), 0.0, lost)
    return np.where(_as_ever(series, pace, lost), 0.0, lost)


def _as_ever(series: Series, pace: Cadence, lost: Array) -> Mask:
    """Long holes of the stamps around which as many messages come as ever: their clock jumped, or
    they were stamped when they came at last."""
    assert series.receive is not None
    receive = series.receive[pace.places]
    when = np.sort(series.receive[series.receive != UNSET])  # of messages left out as well
    out = np.zeros(lost.size, bool)
    for k in np.flatnonzero(lost >= LONG_GAP):
        beside = round(lost[k] * pace.period_s * NS)
        first, last = sorted((int(receive[k]) - beside, int(receive[k + 1]) + beside))
        first, last = max(first, int(when[0])), min(last, int(when[-1]))
        came = int(np.searchsorted(when, last, "right") - np.searchsorted(when, first))
        expected = (last - first) / NS / pace.period_s
        out[k] = expected - came < _AS_EVER * lost[k]
    return out


def at_another_rate(steps: Array) -> Mask:
    """Intervals of one and the same number of periods in a row: the sensor measures less often."""
    out = np.zeros(steps.size, bool)
    edges = np.flatnonzero(np.diff(np.concatenate([[-1.0], steps, [-1.0]])) != 0)
    for begin, end in pairwise(edges):
        if end - begin >= _IN_A_ROW and steps[begin] > 1.0:
            out[begin:end] = True
    return out


def _by_chance(steps: Array) -> bool:
    """Whether messages are missing at random, each as likely as the others: runs of missing ones
    are geometric, and none tells the next.  What is left out on purpose follows a pattern."""
    steps = steps[steps > 0.0]
    share = 1.0 - steps.size / float(steps.sum())
    if steps.size < _LEAST_BY_CHANCE or not 0.0 < share < _MOST_BY_CHANCE:
        return False
    for run in (1, 2, 3):
        expected = (1.0 - share) * share ** (run - 1)
        if abs(float(np.mean(steps == run)) - expected) > max(
            _AS_LIKELY * expected, 4.0 * np.sqrt(expected / steps.size)
        ):
            return False
    missed = (steps > 1.0) - float(np.mean(steps > 1.0))
    bound = _UNRELATED + 4.0 / float(np.sqrt(steps.size))
    power = float(missed @ missed)
    return all(abs(float(missed[lag:] @ missed[:-lag])) < bound * power for lag in range(1, 9))


def _stays(series: Series, pace: Cadence, k: int) -> bool:
    """Whether messages after an interval are all later by it, not only the next one."""
    around = np.arange(max(0, k - 14), min(pace.places.size, k + 16))
    stamp = series.stamp[pace.places[around]]
    dev = seconds(stamp - stamp[0]) - (around - around[0]) * pace.period_s
    after = around > k
    moved = float(np.median(dev[after]) - np.median(dev[~after]))
    return moved > 0.6 * pace.period_s


def _holes(pace: Cadence) -> Array:
    """Of irregular stamps: intervals far beyond the tail of all others."""
    usual = float(np.percentile(pace.interval, 99.0))
    second = np.sort(pace.interval)[-min(pace.interval.size, 1 + pace.interval.size // 200)]
    far = pace.interval > max(6.0 * usual, 4.0 * float(second) if pace.interval.size > 400 else 0.0)
    return np.where(far, np.round(pace.interval / pace.period_s), 0.0)


def _gaps(series: Series, pace: Cadence, long_: Mask) -> tuple[StampFault, ...]:
    times = series.seconds[pace.places]
    return tuple(
        StampFault(
            "gap", {"interval_s": float(pace.interval[k])}, float(times[k]), float(times[k + 1]),
            f"no message for {to_digits(pace.interval[k], 4)} s; usually one every "
            f"{to_digits(pace.period_s, 4)} s",
        )
        for k in np.flatnonzero(long_)
    )  # fmt: skip


def _losses(series: Series, pace: Cadence, lost: Array) -> tuple[StampFault, ...]:
    count = int(lost.sum())
    if not count:
        return ()
    places = np.flatnonzero(lost)
    times = series.seconds[pace.places]
    share = count / (pace.interval.size + 1 + count)
    return (StampFault(
        "lost_messages", {"count": float(count)}, float(times[places[0]]),
        float(times[places[-1] + 1]),
        f"{count} of {pace.interval.size + 1 + count} messages ({percent(share, 2)}) "
        f"are missing "
        f"from the rhythm of {to_digits(pace.period_s, 4)} s, {places.size} times",
    ),)  # fmt: skip


def level_scatter(series: Series) -> float:
    """Interquartile range of receipt minus stamp after its slow changes are taken off [s]."""
    if series.receive is None:
        return 0.0
    places = series.places()
    late = seconds(series.receive[places] - series.stamp[places])
    if late.size < 8:
        return spread(late)
    return float(min(spread(late), 1.0 * spread(np.diff(late))))
