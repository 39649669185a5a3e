"""What forbids a claim until somebody has explained it: steps of the time scale, units mixed up."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from syncline_design.clocks.chrony import ITSELF
from syncline_design.clocks.ntpd import PEERSTATS
from syncline_design.clocks.series import Array, ClockSeries
from syncline_design.clocks.sessions import ClockSession, is_leap, went_back
from syncline_design.clocks.times import moment, shown
from syncline_design.model.figure_text import format_duration, percent, to_digits

TAI_MINUS_UTC_S: Final = 37.0  # since 2017
WHOLE_STEP_S: Final = 0.5
OF_NO_UTC: Final = 10  # stratum from which on a server, by custom, has no reference of its own
SELDOM: Final = 0.01  # of rows: less is no more than an outage
_LARGEST_S, _SMALLEST_S = 0.5, 1e-11
_THOUSANDS: Final = (1e3, 1e6, 1e9)
_BLOCK, _FEWEST_BLOCKS = 10, 3  # samples of a block, blocks of either unit
_LAST_BLOCKS: Final = (
    2  # of the larger unit where it lasts to the file's end: no start, nor a while
)


def doubts(series: Sequence[ClockSeries], sessions: Sequence[ClockSession]) -> tuple[str, ...]:
    """Every doubt as a sentence without its stop."""
    found = [
        *(said for one in series for said in (*_stamps(one), *_summer_time(one))),
        *(said for one in sessions for said in _steps(one)),
        *_no_utc(series),
        *_levels(sessions),
        *_units(sessions),
        *_unit_slip(sessions),
        *_own_bound(sessions),
        *_stuck(sessions),
    ]
    return tuple(dict.fromkeys(found))


def _stamps(one: ClockSeries) -> Iterator[str]:
    found = went_back(one)
    for time_s, back_s in found[:1]:
        hours = back_s / 3600.0
        dst = abs(hours - round(hours)) * 3600.0 < 60.0 and round(hours) in (1, 2)
        why = "local time set back (DST)? give stamps in UTC" if dst else "was the clock set?"
        yield (f"{one.kind.name}: the stamps go back by {format_duration(back_s)} at "
               f"{moment(time_s, one.kind.stamps)}{_times(len(found))}: {why}")  # fmt: skip


def _times(count: int) -> str:
    return "" if count < 2 else f", and {count - 1} times more"


def _summer_time(one: ClockSeries) -> Iterator[str]:
    """A table whose stamps leave out an hour on a Sunday, as local time does in spring."""
    if one.kind.family != "csv" or one.kind.stamps != "utc":
        return
    steps = np.diff(one.time_s)
    usual = float(np.median(steps)) if steps.shape[0] else 0.0
    for k in np.flatnonzero(np.abs(steps - 3600.0 - usual) < max(0.5 * usual, 1.0)):
        at = float(one.time_s[k])
        if 0.0 < usual < 600.0 and int(at // 86400.0 + 4) % 7 == 0:
            yield (f"{one.kind.name}: the stamps leave out an hour at "
                   f"{moment(at, one.kind.stamps)}, a Sunday: local time set ahead (DST)? give "
                   "stamps in UTC")  # fmt: skip


def _steps(session: ClockSession) -> Iterator[str]:
    series = session.series
    offsets, times = session.offsets, series.time_s[session.steady]
    jumps = np.diff(offsets)
    for k in np.flatnonzero(np.abs(jumps) >= WHOLE_STEP_S)[:3]:
        jump, at = float(jumps[k]), float(times[k + 1])
        leap = series.kind.stamps == "utc" and is_leap(at, jump)
        hour = abs(abs(jump) - 3600.0) < 60.0
        why = ("a leap second?" if leap else "an hour: local time (DST)?" if hour
               else "was the clock set?")  # fmt: skip
        yield (f"{series.kind.name}: the offset jumps by {shown(jump)} at "
               f"{moment(at, series.kind.stamps)}: {why} The logs before and after "
               "do not tell of one clock")  # fmt: skip


def _no_utc(series: Sequence[ClockSeries]) -> Iterator[str]:
    """Clocks that follow what says that it follows nothing, or themselves."""
    for one in series:
        deep = one.stratum[np.isfinite(one.offset_s)] >= OF_NO_UTC
        itself = [r for r in (*one.references, one.kind.reference) if r.startswith(ITSELF)]
        if itself and one.kind.name == f"{PEERSTATS} {itself[0]}":
            yield f"{one.kind.name}: ntpd's own clock, against which it is never off"
        elif deep.shape[0] and float(np.mean(deep)) > SELDOM:
            yield (f"{one.kind.name}: a stratum of {OF_NO_UTC} or more in "
                   f"{percent(float(np.mean(deep)), 2)} of its rows: what it follows "
                   "says that it follows no UTC (chronyd's `local stratum`, ntpd's own clock)"
                   )  # fmt: skip


def _levels(sessions: Sequence[ClockSession]) -> Iterator[str]:
    for session in sessions:
        if not session.is_counted:
            continue
        median = float(np.median(session.offsets))
        typical = float(np.median(np.abs(session.offsets)))
        name = session.series.kind.name
        if abs(abs(median) - TAI_MINUS_UTC_S) < 0.5:
            yield (
                f"{name}: off by {shown(median)}: TAI against UTC (37 s): one side counts leap "
                "seconds, the other does not (phc2sys -O, or the grandmaster's UTC offset)"
            )
            return
        if typical > _LARGEST_S:
            yield (f"{name}: offsets of {shown(typical)}: is that the unit, and is it a "
                   "synchronised clock?")  # fmt: skip
            return
        if 0.0 < typical < _SMALLEST_S:
            yield f"{name}: offsets of {shown(typical)}: is that the unit? No clock is as good"
            return


def _units(sessions: Sequence[ClockSession]) -> Iterator[str]:
    """Sessions whose levels stand a thousand apart, with nothing between.

    A bad start moves the level of a session alone, another unit its scatter too.  The format of a
    daemon fixes its unit: between two of its files nothing is mixed up.
    """
    levels = [(float(np.median(np.abs(s.offsets))), s) for s in sessions if s.is_counted]
    levels = sorted((level for level in levels if level[0] > 0.0), key=lambda level: level[0])
    for (low, small), (high, large) in itertools.pairwise(levels):
        below = [level for level, _ in levels if level <= low]
        above = [level for level, _ in levels if level >= high]
        ratio = float(np.median(above)) / float(np.median(below))
        apart = small.series.files != large.series.files
        tables = [s for s in (small, large) if s.series.kind.family == "csv"]
        if high <= 100.0 * low or not tables or not _is_unit(ratio):
            continue
        if not _is_unit(_scatter(large) / _scatter(small)):
            continue
        if apart:
            yield (f"offsets in {large.series.files[0]} are {to_digits(ratio, 3)} times those in "
                   f"{small.series.files[0]}: are the units the same?")  # fmt: skip
            return
        if large.series.kind.family == "csv":
            at = moment(float(large.series.time_s[0]), large.series.kind.stamps)
            yield (f"{large.series.kind.name}: in {large.series.files[0]} offsets and their "
                   f"scatter are {to_digits(ratio, 3)} times as large in the session from {at}: is "
                   "it in another unit?")  # fmt: skip
            return


def _is_unit(ratio: float) -> bool:
    """Whether one unit for another would do that."""
    return any(0.3 < ratio / thousand < 3.0 for thousand in _THOUSANDS)


def _scatter(session: ClockSession) -> float:
    """How far one sample is from the next [s]; not 0."""
    return max(float(np.median(np.abs(np.diff(session.offsets)))), 1e-30)


def _unit_slip(sessions: Sequence[ClockSession]) -> Iterator[str]:
    """Tables in which another unit begins under the same column name.

    Level and scatter then grow by the same thousand at once.  A step or a bad start moves the
    level alone; what decays passes through all sizes between.  Formats of daemons fix their unit.
    """
    tables = [s for s in sessions if s.is_counted and s.series.kind.family == "csv"]
    for files, group in itertools.groupby(tables, key=lambda s: s.series.files):
        blocks = np.concatenate([_blocks(s) for s in group])
        level = np.median(np.abs(blocks[:, 1:]), axis=1)
        scatter = np.median(np.abs(np.diff(blocks[:, 1:], axis=1)), axis=1)
        split = _gap(level)
        if split is None or not np.median(scatter[level <= split]) > 0.0:
            continue
        large, small = level > split, level <= split
        ratio, of_scatter = (
            float(np.median(size[large]) / np.median(size[small])) for size in (level, scatter)
        )
        if _is_unit(ratio) and _is_unit(of_scatter):
            first = int(np.flatnonzero(large != large[0])[0])
            kind = tables[0].series.kind
            yield (f"{kind.name}: in {files[0]} offsets and their scatter change by "
                   f"{to_digits(ratio, 3)} times at about "
                   f"{moment(float(blocks[first, 0]), kind.stamps)}: does another unit begin there?"
                   )  # fmt: skip
            return


def _blocks(session: ClockSession) -> Array:
    """Rows of a time and the `_BLOCK` offsets (s) from there on."""
    whole = session.offsets.shape[0] // _BLOCK * _BLOCK
    times = session.series.time_s[session.steady][:whole:_BLOCK]
    return np.column_stack((times, session.offsets[:whole].reshape(-1, _BLOCK)))


def _gap(level: Array) -> float | None:
    """The lower edge of the widest empty factor between two groups of levels, if beyond 100.

    A start settles and a disturbance passes within few blocks; a unit lasts to the file's end.
    """
    ordered = np.sort(level[level > 0.0])
    if ordered.shape[0] < _FEWEST_BLOCKS + _LAST_BLOCKS:
        return None
    factors = ordered[1:] / ordered[:-1]
    k = int(np.argmax(factors))
    small, large = k + 1, ordered.shape[0] - k - 1
    lasts = large >= _LAST_BLOCKS and bool(np.all(level[-large:] > ordered[k]))
    few = small < _FEWEST_BLOCKS or (large < _FEWEST_BLOCKS and not lasts)
    return None if few or factors[k] <= 100.0 else float(ordered[k])


def _own_bound(sessions: Sequence[ClockSession]) -> Iterator[str]:
    for session in sessions:
        hard = session.series.hard_s[session.steady]
        known = np.isfinite(hard)
        beyond = np.abs(session.offsets[known]) > hard[known] * (1.0 + 1e-9)
        if np.sum(known) >= 20 and float(np.mean(beyond)) > 0.5:
            yield (f"{session.series.kind.name}: most offsets are beyond the bound given beside "
                   "them: are the units the same?")  # fmt: skip
            return


def _stuck(sessions: Sequence[ClockSession]) -> Iterator[str]:
    """A session whose offset never changes; whole nanoseconds of linuxptp may well not."""
    for session in sessions:
        offsets = session.offsets
        if not session.is_counted or session.series.kind.family == "linuxptp":
            continue
        if bool(np.all(offsets == offsets[0])):
            stamps = session.series.kind.stamps
            yield (f"{session.series.kind.name}: the offset never changes in the session from "
                   f"{moment(float(session.series.time_s[0]), stamps)} "
                   f"({offsets.shape[0]} samples of {shown(float(offsets[0]))}): is the log stuck?"
                   )  # fmt: skip
            return
