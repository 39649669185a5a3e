"""From logs of a clock to what may be claimed of it: the whole of `timing`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import field
from pathlib import Path
from typing import Final, Literal

import numpy as np

from syncline_design import __version__
from syncline_design.clocks import stability
from syncline_design.clocks.doubts import doubts
from syncline_design.clocks.files import refused
from syncline_design.clocks.reading import read_logs
from syncline_design.clocks.remarks import MOST_EVENTS, SeenFigures, remarks
from syncline_design.clocks.reservations import reservations
from syncline_design.clocks.result import (
    ClockEntryKind,
    EventResult,
    HoldoverPoint,
    RestsOn,
    SessionResult,
    SourceResult,
    StabilityPoint,
    Timing,
    TimingClaim,
    TracePoint,
)
from syncline_design.clocks.selection import SourceSelection, select, sign_of
from syncline_design.clocks.series import Array
from syncline_design.clocks.sessions import (
    DISTURBANCES,
    ClockSession,
    count_of,
    sessions_of,
    weighted_quantile,
)
from syncline_design.clocks.times import moment
from syncline_design.clocks.tolerance import (
    LEAST_SESSIONS,
    sessions_of_order_statistic,
    tolerance_bound,
    unseen_share,
)
from syncline_design.clocks.trend import SessionCourse
from syncline_design.machine.deadline import in_force
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import percent

MOST_BINS: Final = 1500
MOST_SESSIONS: Final = 20_000
VALUES: Final = 999  # quantiles that stand for the distribution in a catalog
_HOLDOVERS_S: Final = (60.0, 600.0, 3600.0, 14400.0)
Use = Literal["larger", "statistical", "hard"]


@dataclass(frozen=True, slots=True)
class TimingSettings:
    """How logs are cut and what is to be claimed.

    coverage: share of a session's time; session_share: of sessions; declared: what no log shows
    and is added to the bound, by name [s].
    """

    gap_s: float = 3600.0
    coverage: float = 0.95
    session_share: float = 0.95
    confidence: float = 0.95
    source: str | None = None
    independent: bool = False
    use: Use = "larger"
    kind: ClockEntryKind = "clock"
    declared: Mapping[str, float] = field(default_factory=dict)
    conditions: str | None = None


@dataclass(frozen=True, slots=True)
class TimingStudy:
    """The result, and the distribution of offsets [s] (local minus reference) behind it."""

    timing: Timing
    offsets_s: Array


def study_logs(paths: Sequence[str | Path], settings: TimingSettings) -> TimingStudy:
    """Read the logs and say what they bear out; BadInput where one cannot be used."""
    files = [Path(path) for path in paths]
    logs = read_logs(files)
    in_force().doing("cutting the logs into sessions")
    chosen = select(logs.series, settings.source, settings.kind, files[0])
    count = sum(count_of(one, settings.gap_s) for one in (*chosen.used, *chosen.others))
    if count > MOST_SESSIONS:
        raise refused(files[0], f"{count} sessions", expected=f"at most {MOST_SESSIONS}",
                      hint="is --session shorter than the time between samples?")  # fmt: skip
    sessions = [s for one in chosen.used for s in sessions_of(one, settings.gap_s)]
    sessions.sort(key=lambda s: (s.series.kind.stamps, s.series.time_s[0], s.series.files))
    doubted = (*chosen.doubts, *doubts(chosen.used, sessions))
    in_force().doing("bounding the clock's error")
    counted = [s for s in sessions if s.is_counted]
    quantiles = np.array([s.quantile_s(settings.coverage) for s in counted])
    course = SessionCourse() if doubted else SessionCourse.of(counted, quantiles, settings.coverage)
    claimable = not doubted and course.forbids is None
    figures = _figures(counted, sessions, settings, course.effective, claimable=claimable)
    figures = figures.in_doubt() if doubted else figures
    claim = _claim(counted, chosen, settings, figures, (doubted, course))
    reserved = (*chosen.reservations, *reservations(sessions))
    results = tuple(_session(s, settings.coverage) for s in sessions)
    seen = SeenFigures(figures.quantiles, figures.bound_s, figures.statistical_s, figures.hard_s,
                       settings.gap_s)  # fmt: skip
    timing = Timing(
        sessions=results,
        bound_s=figures.bound_s,
        event_bound_s=figures.event_s,
        statistical_bound_s=figures.statistical_s,
        hard_bound_s=figures.hard_s,
        claim=claim,
        events=_events(sessions),
        entry=None,
        use=settings.use,
        sources=_sources(chosen, settings),
        declared=dict(settings.declared),
        holdover=_holdover(counted, figures.bound_s),
        stability=_stability(counted),
        trace=_trace(sessions),
        conditions=settings.conditions,
        evidence=logs.files,
        doubts=doubted,
        notes=(
            *logs.notes,
            *chosen.notes,
            *reserved,
            *remarks(sessions, results, seen),
            *course.words,
        ),
        reservations=(*course.reservations, *reserved),
        version=__version__,
    )
    return TimingStudy(timing, _distribution(counted))


@dataclass(frozen=True, slots=True)
class _Figures:
    quantiles: Array
    statistical_s: float | None
    hard_s: float | None
    bound_s: float | None
    event_s: float | None
    method: str | None

    def in_doubt(self) -> _Figures:
        """Of logs of which something has to be explained first: no bound of any kind."""
        return _Figures(self.quantiles, None, None, None, None, None)


def _figures(
    counted: Sequence[ClockSession], sessions: Sequence[ClockSession], settings: TimingSettings,
    effective: float, *, claimable: bool,
) -> _Figures:  # fmt: skip
    """The bounds.  With too few sessions for a statistical one, that of these sessions alone; so of
    sessions that are not alike, of which nothing can be claimed."""
    quantiles = np.array([s.quantile_s(settings.coverage) for s in counted])
    if not counted:
        return _Figures(quantiles, None, None, None, None, None)
    declared = math.fsum(settings.declared.values())
    statistical, method = None, None
    seen = float(np.max(quantiles)) + declared
    if claimable and len(counted) >= LEAST_SESSIONS:
        raised, method = tolerance_bound(
            quantiles, settings.session_share, settings.confidence, effective
        )
        statistical = seen = raised + declared
    known = [s.hard_s for s in counted if not math.isnan(s.hard_s)]
    hard = max(known) if known else None
    bound = {"larger": max(seen, hard or 0.0), "statistical": seen, "hard": hard}[settings.use]
    sizes = [e.bound_s for s in sessions for e in s.events if e.kind in DISTURBANCES]
    sizes += [s.start_s for s in sessions]
    event = max([bound or 0.0, *(size + declared for size in sizes)])
    return _Figures(quantiles, statistical, hard, bound, event, method)


def _claim(
    counted: Sequence[ClockSession], chosen: SourceSelection, settings: TimingSettings,
    figures: _Figures, against: tuple[Sequence[str], SessionCourse],
) -> TimingClaim:  # fmt: skip
    """against: doubts of the logs, and what the order of sessions tells."""
    doubted, course = against
    missing = max(0, LEAST_SESSIONS - len(counted))
    why = None
    if doubted:
        why = "the logs are in doubt"
    elif not counted:
        why = "no session is long enough"
    elif missing:
        why = ("one session says nothing about the next start" if len(counted) == 1
               else f"{len(counted)} sessions are too few")  # fmt: skip
    elif min(int(np.sum(s.steady)) for s in counted) * (1.0 - settings.coverage) < 1.0:
        why = ("too few samples in a session to say what holds for "
               f"{percent(settings.coverage, 6)} of its time")  # fmt: skip
    elif course.forbids is not None:
        why = course.forbids
    elif figures.bound_s is None:
        why = "the logs hold nothing that a hard bound could be made of"
    durations = [s.duration_s for s in counted]
    telling = min(len(counted), course.effective)
    return TimingClaim(
        coverage=settings.coverage, session_share=settings.session_share,
        confidence=settings.confidence, sessions=len(counted),
        hours=math.fsum(durations) / 3600.0, rests_on=_rests_on(chosen, settings),
        made=why is None, needs_sessions=missing,
        shape_free_from=sessions_of_order_statistic(settings.session_share, settings.confidence),
        session_s=float(np.median(durations)) if durations else None,
        method=figures.method, why_not=why,
        unseen_share=unseen_share(telling, settings.confidence) if counted else None,
        effective_sessions=None if math.isinf(course.effective) else course.effective,
        lock_share=_lock_share(counted),
    )  # fmt: skip


def _lock_share(counted: Sequence[ClockSession]) -> float | None:
    """The share of the time logged of which the claim tells."""
    logged = math.fsum(s.duration_s for s in counted)
    return math.fsum(s.in_lock_s for s in counted) / logged if logged > 0.0 else None


def _rests_on(chosen: SourceSelection, settings: TimingSettings) -> RestsOn:
    """Whether the offsets are the servo's own, which nulls them whatever the clock's error is."""
    steering = {one.kind.steering for one in chosen.used}
    if settings.independent or steering == {"independent"}:
        return "independent"
    if "servo" in steering:
        return "servo_and_declared" if settings.declared else "servo"
    return "unknown_and_declared" if settings.declared else "unknown"


def _session(session: ClockSession, coverage: float) -> SessionResult:
    series, offsets = session.series, session.offsets
    stamps = series.kind.stamps
    begin, end = float(series.time_s[0]), float(series.time_s[-1])
    some = offsets.shape[0] > 0
    hard = session.hard_s if some else math.nan
    memory, stationary = _memory(session)
    return SessionResult(
        from_=moment(begin, stamps), to=moment(end, stamps), samples=int(offsets.shape[0]),
        median_s=weighted_quantile(offsets, session.weight_s[session.steady], 0.5)
        if some and session.is_signed else None,
        quantile_s=session.quantile_s(coverage) if some else None,
        duration_s=end - begin, counted=session.is_counted,
        hard_s=None if math.isnan(hard) else hard,
        autocorrelation_s=memory, stationary=stationary, files=series.files,
    )  # fmt: skip


def _memory(session: ClockSession) -> tuple[float | None, bool | None]:
    """How long one sample speaks for, and whether both halves of the session are alike."""
    if not session.is_counted:
        return None, None
    in_force().check()
    times = session.series.time_s[session.steady]
    step, grid = stability.on_a_grid(times, session.offsets)
    if grid.shape[0] < 4:
        return None, None
    memory = stability.autocorrelation_s(step, grid)
    return memory, stability.is_stationary(grid, session.duration_s / memory)


def _events(sessions: Sequence[ClockSession]) -> tuple[EventResult, ...]:
    """Events in the order of sessions and time; of very many the largest."""
    found = [(event, index, session.series.kind.stamps) for index, session in enumerate(sessions)
             for event in session.events]  # fmt: skip
    if len(found) > MOST_EVENTS:
        least = sorted(event.size_s for event, *_ in found)[-MOST_EVENTS]
        found = [one for one in found if one[0].size_s >= least][:MOST_EVENTS]
    return tuple(
        EventResult(event.kind, moment(event.from_s, stamps), moment(event.to_s, stamps),
                    event.size_s, index)
        for event, index, stamps in found
    )  # fmt: skip


def _sources(chosen: SourceSelection, settings: TimingSettings) -> tuple[SourceResult, ...]:
    names = list(dict.fromkeys(one.kind.name for one in (*chosen.used, *chosen.others)))
    found = []
    for name in names:
        parts = [one for one in (*chosen.used, *chosen.others) if one.kind.name == name]
        counted = [s for one in parts for s in sessions_of(one, settings.gap_s) if s.is_counted]
        quantiles = [s.quantile_s(settings.coverage) for s in counted]
        hard = [s.hard_s for s in counted if not math.isnan(s.hard_s)]
        found.append(SourceResult(
            name, sign_of(name), parts[0].kind.steering, sum(len(one) for one in parts),
            len(counted), max(quantiles, default=None), max(hard, default=None),
            name == chosen.used[0].kind.name, all(one.kind.whole_way for one in parts),
            all(one.kind.of_host for one in parts),
        ))  # fmt: skip
    return tuple(found)


def _holdover(counted: Sequence[ClockSession], bound_s: float | None) -> tuple[HoldoverPoint, ...]:
    """bound + t max |frequency(s + t) - frequency(s)|, as far as the sessions show it.

    A clock left alone keeps the last frequency: what that was seen to move in t is what the error
    may grow by each second.
    """
    found = []
    for after in _HOLDOVERS_S:
        moved = [_moved(session, after) for session in counted]
        seen = [one for one in moved if one is not None]
        if seen and bound_s is not None:
            found.append(HoldoverPoint(after, bound_s + after * max(seen)))
    return tuple(found)


def _moved(session: ClockSession, after_s: float) -> float | None:
    rate, times = session.series.rate[session.steady], session.series.time_s[session.steady]
    known = np.isfinite(rate)
    rate, times = rate[known], times[known]
    if rate.shape[0] < 2 or times[-1] - times[0] < after_s:
        return None
    later = np.searchsorted(times, times + after_s)
    inside = later < times.shape[0]
    return float(np.max(np.abs(rate[later[inside]] - rate[inside]))) if np.any(inside) else None


def _stability(counted: Sequence[ClockSession]) -> tuple[StabilityPoint, ...]:
    """TDEV and MTIE of the longest session whose offsets have a sign."""
    signed = [s for s in counted if s.is_signed]
    if not signed:
        return ()
    longest = max(signed, key=lambda s: s.duration_s)
    times = longest.series.time_s[longest.steady]
    step, grid = stability.on_a_grid(times, longest.offsets)
    points = []
    for n in stability.averaging_factors(grid.shape[0], 3):
        in_force().check()
        deviation = stability.tdev(grid, n)
        points.append(StabilityPoint(n * step, None if math.isnan(deviation) else deviation,
                                     stability.mtie(grid, n)))  # fmt: skip
    return tuple(points)


def _trace(sessions: Sequence[ClockSession]) -> tuple[TracePoint, ...]:
    """Offsets over time, thinned to the smallest and largest of each stretch."""
    bins = max(4, MOST_BINS // max(1, len(sessions)))
    found: list[TracePoint] = []
    for index, session in enumerate(sessions[:MOST_BINS]):
        times, offsets = session.series.time_s[session.steady], session.offsets
        if not offsets.shape[0]:
            continue
        edges = np.unique(np.linspace(0, offsets.shape[0], bins + 1).astype(int))
        for a, b in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
            part = offsets[a:b]
            found.append(TracePoint(index, float(times[a]), float(np.min(part)),
                                    float(np.max(part))))  # fmt: skip
    return tuple(found)


def _distribution(counted: Sequence[ClockSession]) -> Array:
    """Quantiles of the offsets in lock, every session with the same weight; sizes without a sign
    stand with either."""
    if not counted:
        return np.zeros(0)
    told = [s.told if s.is_signed else _either_sign(*s.told) for s in counted]
    offsets = np.concatenate([one for one, _ in told])
    weights = np.concatenate([weight / np.sum(weight) for _, weight in told])
    order = np.argsort(offsets, kind="stable")
    heaped = np.cumsum(weights[order])
    levels = (np.arange(VALUES) + 0.5) / VALUES * heaped[-1]
    places = np.minimum(np.searchsorted(heaped, levels), offsets.shape[0] - 1)
    found: Array = offsets[order][places]
    return found


def _either_sign(offsets: Array, weights: Array) -> tuple[Array, Array]:
    return np.concatenate([offsets, -offsets]), np.concatenate([weights, weights])
