"""Stamps of several streams on one timeline, with what was done to them in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from syncline_design.logs.readers.epochs import (
    NANO,
    TAI_MINUS_GPS_S,
    WEEK_S,
    WEEK_SECONDS,
    gps_to_utc,
    utc_to_gps,
    week_start_ns,
)
from syncline_design.logs.readers.stream import UNSET, Nanoseconds, Timeline
from syncline_design.logs.readers.timelines import EARLIEST_NS
from syncline_design.logs.refusals import refuse
from syncline_design.logs.stream_values import StreamValues
from syncline_design.model.figure_text import to_places
from syncline_design.spec.log_block import LogChoice

CALENDARS: Final = ("utc", "gps", "tai")
UTC_CLOCK: Final = "clock_utc_ns"
LEAST_PAIRS: Final = 3
GPS_MINUS_UTC_S: Final = 18  # since 2017
ASSUMED_GPS: Final = "taken as GPS time, which the file does not tell"
TELL_CLOCK: Final = "log: {timeline: utc} if they are UTC"


def on_one_timeline(several: Sequence[StreamValues], choice: LogChoice) -> bool:
    """Bring the stamps onto UTC if any stream tells it; whether they are calendar times now.

    Streams that all count from the same unknown zero stay as they are.
    """
    timelines = {id(one): _timeline(one, choice) for one in several}
    _boots_that_tell_utc(several, timelines)
    _with_weeks(several, timelines, choice)
    calendars = [one for one in several if timelines[id(one)] in CALENDARS]
    others = [one for one in several if timelines[id(one)] not in CALENDARS]
    if not calendars:
        _demand_one_zero(several, timelines)
        return False
    pairs = {id(one.offer.recording): _boot_pairs(one, several) for one in others}
    for one in others:
        if timelines[id(one)] == "boot":
            _booted(one, pairs[id(one.offer.recording)])
        else:
            raise refuse(
                one.offer.path,
                f"{one.offer.name}: its timeline is not known, that of "
                f"{calendars[0].offer.name} is {timelines[id(calendars[0])]}",
                expected="stamps that can be compared",
                hint="say it: log: {timeline: utc} (or gps, tai), or log: {gps_week: N}",
            )
    for one in calendars:
        _as_utc(one, timelines[id(one)])
    return True


def _boots_that_tell_utc(several: Sequence[StreamValues], timelines: dict[int, Timeline]) -> None:
    """Boots of files beside others are made UTC where they tell it: no other counts from them."""
    if len({id(one.offer.recording) for one in several}) < 2:
        return
    booted = [one for one in several if timelines[id(one)] == "boot"]
    pairs = {id(one.offer.recording): _boot_pairs(one, several) for one in booted}
    for one in booted:
        apart = pairs[id(one.offer.recording)]
        if np.count_nonzero(apart > EARLIEST_NS) >= LEAST_PAIRS:
            _booted(one, apart)
            timelines[id(one)] = "utc"


def _timeline(one: StreamValues, choice: LogChoice) -> Timeline:
    told = one.offer.stream.timeline
    if told == "unknown" and choice.timeline is not None and not _counts_weeks(one):
        one.note(f"stamps are taken as {choice.timeline}, as the spec says")
        return choice.timeline
    return told


def _counts_weeks(one: StreamValues) -> bool:
    stamps = one.offer.stream.stamps
    return stamps is not None and stamps.primary == WEEK_SECONDS


def _with_weeks(
    several: Sequence[StreamValues], timelines: dict[int, Timeline], choice: LogChoice
) -> None:
    """Seconds of the week get their week: the spec's, or that of another file of the call.

    They count on the clock that the spec names; without one GPS's is assumed, and said.
    """
    lacking = [one for one in several if timelines[id(one)] == "unknown" and _counts_weeks(one)]
    for one in lacking:
        _over_week_end(one)
        week, source = choice.gps_week, "as the spec says"
        if week is None:
            week, source = _week_beside(one, several, timelines)
        if week is None:
            continue
        set_ = one.time_ns != UNSET
        one.time_ns = np.where(set_, one.time_ns + week_start_ns(week), UNSET)
        told = choice.timeline if choice.timeline in CALENDARS else None
        timelines[id(one)] = told or "gps"
        one.note(f"seconds of the week are of GPS week {week}, {source}")
        clock = f"in {told.upper()}, as the spec says" if told else f"{ASSUMED_GPS} ({TELL_CLOCK})"
        one.note(f"seconds of the week are {clock}")


def _over_week_end(one: StreamValues) -> None:
    """Seconds of the week that begin again within a log go on: the first are of the next week.

    Told by their size, whatever the order of the rows: no log lasts half a week.
    """
    known = one.time_ns != UNSET
    half = WEEK_S * NANO // 2
    last = int(one.time_ns[known].max()) if np.any(known) else 0
    again = known & (one.time_ns < last - half)
    if np.any(again):
        one.time_ns = np.where(again, one.time_ns + 2 * half, one.time_ns)
        one.note("seconds of the week that begin again were counted on, into the next week")


def _week_beside(
    one: StreamValues, several: Sequence[StreamValues], timelines: Mapping[int, Timeline]
) -> tuple[int | None, str]:
    """The week in which the stamps come nearest to another stream's."""
    own = one.time_ns[one.time_ns != UNSET]
    for other in several:
        known = other.time_ns[other.time_ns != UNSET]
        kind = timelines[id(other)]
        if kind not in CALENDARS or not known.shape[0] or not own.shape[0]:
            continue
        gps = _gps_of(known[:1], kind)
        apart = int(gps[0]) - int(own[0])
        week = round((apart - week_start_ns(0)) / (WEEK_S * NANO))
        return week, f"as {other.offer.name} stands in it"
    return None, ""


def _gps_of(stamps: Nanoseconds, kind: Timeline) -> Nanoseconds:
    if kind == "utc":
        return utc_to_gps(stamps)
    return stamps - TAI_MINUS_GPS_S * NANO if kind == "tai" else stamps


def _as_utc(one: StreamValues, kind: Timeline) -> None:
    if kind == "utc":
        return
    known = one.time_ns[one.time_ns != UNSET]
    before = int(known[0]) if known.shape[0] else 0
    gps = np.where(one.time_ns == UNSET, UNSET, _gps_of(one.time_ns, kind))
    one.time_ns = gps_to_utc(gps)
    known = one.time_ns[one.time_ns != UNSET]
    apart = (before - int(known[0])) // NANO if known.shape[0] else 0
    name = {"gps": "GPS", "tai": "TAI"}[kind]
    one.note(f"{name} stamps were made UTC: {apart} s taken off (leap second table)")


def _boot_pairs(one: StreamValues, several: Sequence[StreamValues]) -> Nanoseconds:
    """UTC minus boot [ns] of the messages of a recording that tell both, as the file has them."""
    pairs = [
        other.columns[UTC_CLOCK].astype(np.int64) - other.time_ns
        for other in several
        if other.offer.recording is one.offer.recording and UTC_CLOCK in other.columns
    ]
    return np.concatenate(pairs) if pairs else np.zeros(0, dtype=np.int64)


def _booted(one: StreamValues, apart: Nanoseconds) -> None:
    """Stamps since boot by the recording's own pairs of boot and UTC."""
    apart = apart[apart > EARLIEST_NS]
    if apart.shape[0] < LEAST_PAIRS:
        raise refuse(
            one.offer.path,
            f"{one.offer.name} counts since boot, and nothing in its file tells UTC",
            expected="stamps of one timeline in all files, or a GNSS stream with UTC beside",
        )
    middle = int(apart[0]) + round(float(np.median(apart - apart[0])))
    one.time_ns = np.where(one.time_ns == UNSET, UNSET, one.time_ns + middle)
    one.note(
        f"stamps since boot were made UTC: {to_places(middle / NANO, 6)} s added (median of pairs)"
    )


def _demand_one_zero(several: Sequence[StreamValues], timelines: Mapping[int, Timeline]) -> None:
    kinds = {timelines[id(one)] for one in several}
    recordings = {id(one.offer.recording) for one in several}
    if kinds == {"boot"} and len(recordings) > 1:
        raise refuse(
            several[-1].offer.path,
            "stamps since boot in several files count from several boots",
            expected="one timeline in all files",
            hint="merge them with a log that tells UTC, or give one file",
        )
    if kinds == {"unknown"} and len(recordings) > 1:
        several[0].note("the timeline is not told; all files are taken to count from one zero")
