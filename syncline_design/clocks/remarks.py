"""What has to be said of sessions and figures beside the claim."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from syncline_design.clocks.result import SessionResult
from syncline_design.clocks.series import Array
from syncline_design.clocks.sessions import ClockSession
from syncline_design.clocks.starts import silences
from syncline_design.clocks.times import moment
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import format_duration, rounded, to_digits

MOST_EVENTS: Final = 1000
ONE_CRYSTAL: Final = 3e-5  # [s/s], range of an AT-cut crystal from -20 to 70 degC, about
APART: Final = 3.0  # times the next largest session, from which one alone makes a bound wide
LONG_ENOUGH: Final = 10.0  # times what a session remembers


@dataclass(frozen=True, slots=True)
class SeenFigures:
    """What the bounds came out as [s], and by which silence a log was to be cut [s]."""

    quantiles: Array
    bound_s: float | None
    statistical_s: float | None
    hard_s: float | None
    gap_s: float


def remarks(
    sessions: Sequence[ClockSession], results: Sequence[SessionResult], figures: SeenFigures
) -> list[str]:
    """Every one a sentence without its stop."""
    said = [*_outages(sessions, figures.gap_s), *_other_crystals(sessions), *_unsigned(sessions)]
    short = sum(not s.is_counted for s in sessions)
    if short:
        said.append(f"{short} of {len(sessions)} sessions are empty or too short to count "
                    "(less than 20 samples in lock, or than 90 s)")  # fmt: skip
    brief = sum(
        one.counted
        and one.autocorrelation_s is not None
        and one.duration_s < LONG_ENOUGH * one.autocorrelation_s
        for one in results
    )
    if brief:
        said.append(f"{brief} of {len(results)} sessions are shorter than ten times what they "
                    "remember: the claim is for sessions no longer than these")  # fmt: skip
    largest = float(np.max(figures.quantiles, initial=0.0))
    if figures.statistical_s is not None and figures.statistical_s > 3.0 * largest > 0.0:
        times = figures.statistical_s / largest
        said.append(f"the bound is {to_digits(times, 3)} times the largest session: more would "
                    f"narrow it{_stands_apart(sessions, figures.quantiles)}")  # fmt: skip
    lengths = [s.duration_s for s in sessions if s.is_counted]
    if lengths and max(lengths) > 2.0 * min(lengths):
        said.append(f"sessions of {format_duration(min(lengths))} to "
                    f"{format_duration(max(lengths))}: the claim is for such a mixture, "
                    "drift makes long ones worse")  # fmt: skip
    alone = max((e.daemon_s for s in sessions for e in s.events), default=0.0)
    if alone > (figures.bound_s or 0.0):
        most = format_duration(rounded(alone, 3))
        said.append(f"while lock was lost the clock may have been {most} off, by the daemon's own "
                    "word: the bound with events says so")  # fmt: skip
    total = sum(len(s.events) for s in sessions)
    if total > MOST_EVENTS:
        said.append(f"{total} events, of which the {MOST_EVENTS} largest are listed")
    if figures.hard_s is None and figures.bound_s is not None:
        said.append("no hard bound: what is used of these logs holds no dispersions or delays")
    return said


def _stands_apart(sessions: Sequence[ClockSession], quantiles: Array) -> str:
    """Which session of a few makes the bound wide, where one is far beyond all others."""
    order = np.argsort(quantiles)
    if quantiles.shape[0] < 2 or quantiles[order[-1]] <= APART * quantiles[order[-2]]:
        return ""
    one = [s for s in sessions if s.is_counted][int(order[-1])].series
    begin = moment(float(one.time_s[0]), one.kind.stamps)
    sizes = [format_duration(rounded(float(quantiles[k]), 3)) for k in (order[-1], order[-2])]
    return (f"; the session from {begin} alone makes it so wide ({sizes[0]}, the others "
            f"{sizes[1]} at most): see what happened there")  # fmt: skip


def _other_crystals(sessions: Sequence[ClockSession]) -> Iterator[str]:
    """Corrections of the frequency that one crystal seldom needs, by session."""
    counted = [one.series.rate[one.steady] for one in sessions if one.is_counted]
    rates = [float(np.nanmedian(one)) for one in counted if np.any(np.isfinite(one))]
    apart = max(rates) - min(rates) if rates else 0.0
    if apart > ONE_CRYSTAL:
        yield (f"the sessions' frequency corrections stand {to_digits(1e6 * apart, 3)} ppm apart, "
               "more than one crystal's in common weather: are these several hosts?"
               )  # fmt: skip


def _unsigned(sessions: Sequence[ClockSession]) -> Iterator[str]:
    """Offsets of which the size alone is told."""
    count = sum(int(np.sum(one.series.unsigned)) for one in sessions)
    if count:
        total = sum(len(one.series) for one in sessions)
        yield (f"{count} of {total} rows are summary lines, whose `max` has no sign: whether the "
               "clock was early or late is not told (no median, TDEV or MTIE of such sessions), "
               "and the values of an entry stand with either sign")  # fmt: skip


def _outages(sessions: Sequence[ClockSession], gap_s: float) -> Iterator[str]:
    """Silences that would have ended a session, had the log held a sign of a start."""
    found = [(one.series, k) for one in sessions for k in silences(one.series, gap_s)]
    if not found:
        return
    series, k = found[0]
    lasts = float(series.time_s[k + 1] - series.time_s[k])
    at = moment(float(series.time_s[k]), series.kind.stamps)
    yield (f"{len(found)} silence{'s' if len(found) > 1 else ''} of more than "
           f"{format_duration(gap_s)} (the first of {format_duration(rounded(lasts, 3))} at {at}) "
           "with no sign of a start after: taken as outages, in which the clock ran free. If it "
           "was off, give the log of each run as a file of its own")  # fmt: skip
