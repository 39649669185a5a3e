"""Jumps of the clock that stamps, message by message: where its rhythm breaks and receipts do not.

A sensor measures at a + k T.  Where its clock jumps by s, one interval of the stamps is n T + s,
and receipt minus stamp falls by s with the same message, n counted by receipts.  A late message
moves receipts alone, a late measurement both.  So a jump is known to the message and to the
sensor's jitter, however short it lasts; one that goes back by the same amount is an episode.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from syncline_design.auditing.backlog import held_up
from syncline_design.auditing.cadence import Cadence, at_another_rate
from syncline_design.auditing.host_ticks import longest_tick, moved_together
from syncline_design.auditing.lasting_jumps import Jump, lasting, of_the_clock, went_on
from syncline_design.auditing.naming import is_whole, slipped
from syncline_design.auditing.result import StampFault
from syncline_design.auditing.series import (
    MEDIAN_SIGMA,
    NS,
    Array,
    Mask,
    Series,
    in_words,
    scatter,
    seconds,
    spread,
)
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import to_digits

_BESIDE: Final = 12  # messages on each side that tell a level
_BESIDE_MORE: Final = (_BESIDE, 4 * _BESIDE, 16 * _BESIDE)
_APART: Final = 6  # messages: receipts in bunches are even from one to the next
_LEAST: Final = 3
_MOST: Final = 4000  # intervals that are looked at
_MOST_JUMPS: Final = 200  # of a log; more are how the sensor measures
_JITTER: Final = 10.0  # times: smaller breaks are the rhythm's own
_LEVEL: Final = 5.0  # times its uncertainty that a level has to change by
_ALIKE: Final = 0.35  # how near rhythm and level agree
_SHARE: Final = 0.25  # of the delays' spread: smaller jumps are not named
_BROKEN: Final = 0.05  # of an interval: what does not fit the rhythm
_MOST_BROKEN: Final = 0.05  # of all intervals
_TICKS: Final = 2.2  # how much larger a jump is than what many intervals are off by
_GRAINS: Final = 2.2  # of the coarser time: both its values lie on a grid
_ALONE: Final = 8.0  # times what the intervals around it are off by
_REPEATED: Final = 0.9  # of an episode's stamps: old messages that are sent again
_LEAST_S: Final = 2e-5
_WHOLE_S: Final = 1e-4  # how near to whole seconds a slip of a sensor's pulse is
_CHANCE: Final = 12.0  # of the delays' spread: so late a queue may make messages
_QUEUE: Final = 64  # messages, which hardly a queue holds up
_LOADED: Final = 4096  # messages, of which no load of a host holds up all
_SLOW: Final = 2e-4  # of an interval: oscillators wander by less within a gap
_LEAST_SETS: Final = 6  # jumps that come in a beat
_LEAST_EQUAL: Final = 4  # by one size
_BEAT: Final = 0.1  # of the time between them
_PARTS: Final = (1, 2, 3)  # of the least time between jumps
_EQUAL: Final = 0.02
_WHOLE: Final = 0.25  # of an interval: how near a jump by whole ones is to the level's


@dataclass(frozen=True, slots=True)
class Mended:
    """The series without its jumps, and the jumps as faults.  settling_s: when others begin;
    hidden_s: a host's tick, by which messages were late, as if smaller steps were the stamps'."""

    series: Series
    faults: tuple[StampFault, ...]
    jumps: tuple[Jump, ...]
    settling_s: tuple[float, ...] = ()
    hidden_s: float = 0.0


def without_jumps(series: Series, pace: Cadence, least_s: float) -> Mended:
    """Steps and episodes that a regular sensor's rhythm shows; least_s: smaller ones are left."""
    nothing = Mended(series, (), ())
    if series.receive is None or not pace.regular or pace.interval.size < 2 * _BESIDE:
        return nothing
    times = series.seconds[pace.places]
    late = seconds((series.receive - series.stamp)[pace.places])
    late = late - np.median(late)
    found = _found(pace, late, least_s)
    found = [] if len(found) > _MOST_JUMPS else of_the_clock(found, times, late, pace)
    tick = longest_tick(series) if found else 0.0
    own = _own(found, late, tick)
    hidden_s = tick if len(own) < len(found) else 0.0
    found = own
    if not found:
        return replace(nothing, hidden_s=hidden_s)
    kept = lasting(found, times, late, pace)
    settling = tuple(float(times[j.place]) for j in found if j not in kept)
    kept = [j for j in kept if not went_on(j, [s for s in found if s not in kept], pace)]
    found = _paired(kept, pace.jitter_s)
    known = series.stamp[pace.places]
    found = [jump for jump in found if not _replays(jump, known)]
    stamp = series.stamp.copy()
    for jump in found:
        part = pace.places[jump.place : jump.end]
        stamp[part] -= round(jump.size_s * NS)
        if jump.end is None:
            stamp[part[-1] + 1 :] -= round(jump.size_s * NS)
    faults = _faults(found, times, pace)
    return Mended(replace(series, stamp=stamp), faults, tuple(found), settling, hidden_s)


def _own(found: list[Jump], late: Array, tick_s: float) -> list[Jump]:
    """Those that receipts at ticks of a host do not tell to be of what is stamped."""
    edges = [0, *(jump.place for jump in found), late.size]
    return [
        jump
        for jump, a, b in zip(found, edges, edges[2:], strict=False)
        if jump.again or not moved_together(late[a:b], jump.place - a, -jump.size_s, tick_s)
    ]


def _found(pace: Cadence, late: Array, least_s: float) -> list[Jump]:
    """Jumps that intervals of the stamps and levels of receipt minus stamp both show."""
    pace = _without_jumps_of_its_own(pace)
    period = pace.period_s
    noise = max(_JITTER * pace.jitter_s, _LEAST_S, _GRAINS * least_s)
    off = np.abs(pace.interval - np.round(pace.interval / period) * period)
    if float(np.mean(off > max(_BROKEN * period, noise))) > _MOST_BROKEN:
        return []  # no such rhythm
    common = float(np.percentile(off, 100.0 * (1.0 - _MOST_BROKEN)))
    if (
        common > noise
    ):  # ticks of the sensor's own task, of which an interval holds one more or less
        noise = _TICKS * common
    off_here = off > np.maximum(noise, _ALONE * _around(off))
    counted = (pace.steps != 1.0) & ~at_another_rate(pace.steps)
    odd = np.flatnonzero(off_here | counted)[:_MOST]
    if not odd.size:
        return []
    width = min(spread(late), spread(late[_APART:] - late[:-_APART]))  # no slow course enters
    floor = max(noise, _SHARE * width)
    late = np.where(held_up(pace.interval, late), np.nan, late)
    first = _undoubted(_sizes(pace, late, odd, odd[off_here[odd]], off_here, (width, floor)))
    edges = np.asarray([j.place - 1 for j in first], np.intp)
    found = _undoubted(_sizes(pace, late, odd, edges, off_here, (width, floor)))
    equal = _equal(pace, late, odd[off_here[odd]], (width, floor))
    alone = {jump.place for jump in equal}
    found = [j for j in found if j.place not in alone]
    return sorted([*equal, *found], key=lambda j: j.place)


def _undoubted(found: list[Jump]) -> list[Jump]:
    """Those that nothing doubts, and that another takes back, which lost messages never do."""
    return [
        j
        for j in found
        if not j.doubted
        or any(abs(one.size_s + j.size_s) < _EQUAL * abs(j.size_s) for one in found)
    ]


def _equal(
    pace: Cadence, late: Array, broken: NDArray[np.intp], limits: tuple[float, float]
) -> list[Jump]:
    """Jumps by one size, of a clock that is set again and again, which levels show together.

    Each moves the level by less than a few delays tell; n of them tell it sqrt(n) times as well.
    late: receipt minus stamp (n,) [s]; broken: places of the intervals that no whole number of the
    sensor's fills; limits: spread of the delays, and the least size that is named [s].
    """
    width, floor = limits
    off = pace.interval[broken] - pace.steps[broken] * pace.period_s
    near = _JITTER * pace.jitter_s
    rivals = [np.abs(off - one) <= max(near, _EQUAL * abs(one)) for one in off]
    alike = max(rivals, key=lambda own: int(own.sum()), default=np.zeros(0, bool))
    places = broken[alike]
    if places.size < _LEAST_EQUAL:
        return []
    size = float(np.median(off[alike]))
    clear_s = 3.0 / _LEVEL * math.sqrt(places.size) * abs(size)
    bounds = [0, *(int(k) + 1 for k in places), late.size]
    sides = zip(bounds, bounds[1:], bounds[2:], strict=False)
    levels = [_level(_told(late[a:k]), _told(late[k:b]), width, clear_s) for a, k, b in sides]
    told = [(moved, sure) for moved, sure in levels if sure > 0.0]
    if len(told) < _LEAST_EQUAL:
        return []
    moved = float(np.mean([one for one, _ in told]))
    sure = math.sqrt(sum(one**2 for _, one in told)) / len(told)
    least = max(floor, near / _ALIKE, _LEVEL * sure)
    if abs(size) < least or abs(size + moved) > _ALIKE * abs(size) + 2.0 * sure:
        return []
    return [Jump(int(k) + 1, size, again=True) for k in places]


def _around(off: Array) -> Array:
    """The median of the five values around each: what settles breaks one interval after another."""
    padded = np.concatenate([off[:1], off[:1], off, off[-1:], off[-1:]])
    return np.asarray(np.median(np.lib.stride_tricks.sliding_window_view(padded, 5), axis=1))


def _without_jumps_of_its_own(pace: Cadence) -> Cadence:
    """The rhythm with the mean interval of those alone that no jump lengthens."""
    single = pace.interval[pace.steps == 1.0]
    if not single.size:
        return pace  # packets of pairs: no interval is near the median one
    middle = float(np.median(single))
    near = single[np.abs(single - middle) <= _JITTER * scatter(single) + 1e-7]
    return replace(pace, period_s=float(near.mean()))


def _level(before: Array, after: Array, width: float, clear_s: float) -> tuple[float, float]:
    """(change of the level, its uncertainty) [s] by as many messages as tell whole intervals apart;
    an uncertainty of 0 where there are too few."""
    moved = sure = 0.0
    for many in _BESIDE_MORE:
        one, other = before[-many:], after[:many]
        if min(one.size, other.size) < _LEAST:
            return 0.0, 0.0
        moved = float(np.median(other) - np.median(one))
        sure = MEDIAN_SIGMA * width * float(np.sqrt(1.0 / one.size + 1.0 / other.size)) + 1e-12
        if 3.0 * sure < clear_s:
            break
    return moved, sure


def _told(late: Array) -> Array:
    """The messages that tell a level."""
    return np.asarray(late[~np.isnan(late)])


def _sizes(
    pace: Cadence, late: Array, odd: NDArray[np.intp], edges: NDArray[np.intp],
    broken: Mask, limits: tuple[float, float],
) -> list[Jump]:  # fmt: skip
    """The jumps among odd intervals; no level reaches beyond `edges`.  broken: intervals that are
    no whole number of the sensor's."""
    width, floor = limits
    apart = np.abs(pace.interval - pace.steps * pace.period_s)
    uneven = float(np.percentile(apart, 95.0))  # of one interval
    found = []
    for k in odd:
        at = int(np.searchsorted(edges, k))
        begin = int(edges[at - 1]) + 1 if at > 0 else 0
        beyond = at + 1 if at < edges.size and edges[at] == k else at
        end = int(edges[beyond]) + 1 if beyond < edges.size else late.size
        sides = _told(late[begin : k + 1]), _told(late[k + 1 : end])
        moved, sure = _level(*sides, width, 0.5 * pace.period_s)
        if sure <= 0.0:
            continue
        interval = float(pace.interval[k])
        count = max(1, round((interval + moved) / pace.period_s))
        clear = 3.0 * sure < 0.5 * pace.period_s
        if not clear and broken[k]:  # the fewest lost messages that delays allow
            count = max(1, math.ceil((interval + moved - 3.0 * sure) / pace.period_s))
        size = interval - count * pace.period_s
        least = max(floor, _LEVEL * sure, _SLOW * count * pace.period_s)
        alike = _ALIKE * abs(size) + 2.0 * sure
        sized = abs(size) > least and abs(size + moved) < alike
        if not sized or not (clear or broken[k]):
            continue
        apart_s = abs(size - round(size / pace.period_s) * pace.period_s)
        whole = apart_s <= max(_JITTER * pace.jitter_s, _LEAST_S)
        if whole and abs(size + moved) > _WHOLE * pace.period_s + 2.0 * sure:
            continue  # receipts moved by another size than stamps can have jumped by
        if whole and count > round(interval / pace.period_s) >= 1:
            continue  # receipts jumped where messages are lost: stamps keep their rhythm
        chance = whole and abs(size) < _CHANCE * width
        if not chance or abs(size + _floor(*sides)) < alike:
            lost = whole and size > 0.0  # a hole of whole intervals, which a loss leaves as well
            doubted = (chance or lost) and not _lasts(size, *sides, alike - sure)
            size = size if uneven < 2.0 * sure else -moved
            found.append(Jump(int(k) + 1, size, doubted=doubted))
    return found


def _floor(before: Array, after: Array) -> float:
    """By how much the quicker of many messages are later: a queue that forms where one is lost
    holds up a dozen, a clock that jumped by a whole interval all of them."""
    if min(before.size, after.size) < 2 * _BESIDE:
        return 0.0
    one, other = (np.percentile(x, 25.0) for x in (before[-_QUEUE:], after[:_QUEUE]))
    return float(other - one)


def _lasts(size_s: float, before: Array, after: Array, alike_s: float) -> bool:
    """Whether the quickest of very many are later by a jump, with their drift or without: a load of
    the host holds up hundreds by more than an interval, and not all of thousands."""
    one, other = before[-_LOADED:], after[:_LOADED]
    drift = min(_drift(one), _drift(other), key=abs)
    flat = one + drift * np.arange(one.size - 1, -1, -1)
    level = other - drift * np.arange(1, other.size + 1)
    moved = (other.min() - one.min(), level.min() - flat.min())
    return any(abs(size_s + float(floor)) < alike_s for floor in moved)


def _drift(late: Array) -> float:
    """By how much more each message is late than the one before [s]; 0 of few."""
    lag = late.size // 4
    return float(np.median(late[lag:] - late[:-lag])) / lag if lag >= _BESIDE else 0.0


def _paired(found: list[Jump], jitter_s: float) -> list[Jump]:
    """A jump and one after it that takes it back, as one episode: whatever jumped in between."""
    out: list[Jump] = []
    for jump in found:
        near = max(_JITTER * jitter_s, _EQUAL * abs(jump.size_s), 1e-6)
        taken = [k for k, one in enumerate(out)
                 if one.end is None and abs(one.size_s + jump.size_s) < near]  # fmt: skip
        if taken:
            out[taken[-1]] = replace(out[taken[-1]], end=jump.place)
        else:
            out.append(jump)
    return out


def _replays(jump: Jump, stamp: NDArray[np.int64]) -> bool:
    """Whether an episode's stamps were all seen before: messages that were sent once more."""
    if jump.size_s > 0.0 or jump.end is None:
        return False
    again = np.isin(stamp[jump.place : jump.end], stamp[: jump.place])
    return float(np.mean(again)) > _REPEATED


def _faults(found: list[Jump], times: Array, pace: Cadence) -> tuple[StampFault, ...]:
    """One fault a jump; one for all, where a clock is set by about as much at even times."""
    begins = times[[jump.place for jump in found]]
    sizes = np.asarray([jump.size_s for jump in found])
    even = sizes.size >= _LEAST_SETS and all(jump.end is None for jump in found)
    beat = _beat_of(np.diff(begins)) if even else None
    even = beat is not None and float(np.ptp(np.sign(sizes))) == 0.0
    if beat is None or not even:
        return tuple(_fault(jump, times, pace) for jump in found)
    size, total = float(np.median(sizes)), float(sizes.sum())
    return (StampFault(
        "step", {"seconds": size, "count": float(sizes.size), "interval_s": beat},
        float(begins[0]), float(times[-1]),
        f"stamps move by {_signed(size)} in the median every {to_digits(beat, 4)} s, "
        f"{sizes.size} times, {_signed(total)} in all: their clock is set again and again",
    ),)  # fmt: skip


def _beat_of(apart: Array) -> float | None:
    """The time of which all times between jumps are whole multiples [s], as of jumps that are too
    small to be seen every time: the shorter ones of these times, or a part of the least."""
    for part in (float(np.percentile(apart, 25.0)), *(float(apart.min()) / k for k in _PARTS)):
        turns = np.maximum(np.round(apart / part), 1.0)
        beat = float(apart.sum() / turns.sum())
        if float(np.percentile(np.abs(apart - turns * beat), 90.0)) < _BEAT * beat:
            return beat
    return None


def _signed(size_s: float) -> str:
    return f"{'+' if size_s >= 0 else '-'}{in_words(abs(size_s))}"


def _fault(jump: Jump, times: Array, pace: Cadence) -> StampFault:
    begin = float(times[jump.place])
    end = float(times[-1] if jump.end is None else times[jump.end])
    if is_whole(jump.size_s, max(_JITTER * pace.jitter_s, _WHOLE_S)):
        many = (times.size if jump.end is None else jump.end) - jump.place
        back = -jump.size_s > pace.period_s or (
            jump.end is not None and jump.size_s > pace.period_s
        )
        return slipped(round(jump.size_s), many, (begin, end), int(back), ends=jump.end is not None)
    lasts = "and stay so" if jump.end is None else f"until {to_digits(end, 4)} s"
    return StampFault(
        "step", {"seconds": jump.size_s}, begin, end,
        f"stamps move by {_signed(jump.size_s)} {lasts}: one interval breaks the "
        "sensor's rhythm by as much as receipts shift against stamps",
    )  # fmt: skip
