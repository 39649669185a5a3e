"""Series to sessions: where one ends and the next begins, and what in it is no steady state."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from typing import Final, Literal

import numpy as np

from syncline_design.clocks.chrony import TRACKING
from syncline_design.clocks.series import Array, ClockSeries, Flags
from syncline_design.clocks.starts import OF_NO_STARTS, cuts
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.normal import OF_MEDIAN_DEVIATION

EventKind = Literal[
    "startup", "step", "unlock", "holdover", "gap", "relock", "leap_second", "frequency_jump"
]
# after which a clock in steady state was off; a start comes before, a rate brings what it brings
DISTURBANCES: Final[tuple[EventKind, ...]] = (
    "step", "unlock", "holdover", "gap", "relock", "leap_second",
)  # fmt: skip
STARTUP_FACTOR: Final = 10.0  # of the session's median hard bound: what a start leaves behind
GAP_FACTOR: Final = 10.0  # of the median interval between samples
STEP_SIGMAS: Final = 12.0
LEAST_SAMPLES: Final = 20
SHORTEST_S: Final = 90.0
USUAL_SHARE: Final = 0.95  # of a session's time
PIECES: Final = 20  # of a silence
BEYOND_USUAL: Final = 3.0  # times what a session keeps to: a first row that a silence brought
MOST_SKEW: Final = 1e-3  # larger ones say that the daemon knows nothing yet
_DAY: Final = 86400.0


@dataclass(frozen=True, slots=True)
class ClockEvent:
    """Something that is no steady state; size_s: the largest |offset| that it brought.

    daemon_s: how far off the clock may have been meanwhile by the daemon's own word.
    """

    kind: EventKind
    from_s: float
    to_s: float
    size_s: float
    daemon_s: float = 0.0

    @property
    def bound_s(self) -> float:
        """How far off the clock was, or may have been [s]."""
        return max(self.size_s, self.daemon_s)


@dataclass(frozen=True, slots=True)
class ClockSession:
    """One run of the clock, from a start to its end.

    steady: rows that the bounds are made of.  slow: rows in lock of its start, after the first
    update, which are of the statistical bound and not of the daemon's own.  silences: of times
    without samples, in pieces, how far off the clock was by what was seen at either end [s], and
    for how long [s].
    """

    series: ClockSeries
    steady: Flags
    slow: Flags
    weight_s: Array
    events: tuple[ClockEvent, ...]
    silences: Array

    @property
    def duration_s(self) -> float:
        """From the first row to the last."""
        return float(self.series.time_s[-1] - self.series.time_s[0])

    @property
    def offsets(self) -> Array:
        """Offsets of the steady state [s]."""
        return self.series.offset_s[self.steady]

    @property
    def is_signed(self) -> bool:
        """Whether all offsets of the steady state have a sign."""
        return not np.any(self.series.unsigned[self.steady])

    @property
    def is_counted(self) -> bool:
        """Whether it is long enough to say anything."""
        return int(np.sum(self.steady)) >= LEAST_SAMPLES and self.duration_s >= SHORTEST_S

    def quantile_s(self, share: float) -> float:
        """The |offset| that is kept for this share of the time.

        In a silence it is taken to go evenly from what was seen before to what was seen after.
        """
        offsets, weights = self.told
        return weighted_quantile(np.abs(offsets), weights, share)

    @property
    def told(self) -> tuple[Array, Array]:
        """Offsets of all the time in lock, and for how long each [s]: of steady state, a slow start
        and silences."""
        rows = self.steady | self.slow
        offsets = np.concatenate([self.series.offset_s[rows], self.silences[:, 0]])
        return offsets, np.concatenate([self.weight_s[rows], self.silences[:, 1]])

    @property
    def start_s(self) -> float:
        """The largest |offset| in lock after the first update and before the steady state."""
        return _size(self.series.offset_s[self.slow])

    @property
    def in_lock_s(self) -> float:
        """For how much of its time it says how far off the clock was while it was in lock."""
        return min(float(np.sum(self.told[1])), self.duration_s)

    @property
    def hard_s(self) -> float:
        """The largest hard bound of the steady state, with drift over the time between samples."""
        hard = np.where(_of_unlocked(self.series), math.nan, self.series.hard_s)[self.steady]
        if not np.any(np.isfinite(hard)):
            return math.nan
        skew = np.nan_to_num(self.series.skew[self.steady])
        aged = hard + np.where(skew < MOST_SKEW, skew, 0.0) * self.weight_s[self.steady]
        return float(np.nanmax(aged))


def weighted_quantile(values: Array, weights: Array, share: float) -> float:
    """The smallest value below or at which at least this share of the weight lies."""
    order = np.argsort(values, kind="stable")
    heaped = np.cumsum(weights[order])
    place = int(np.searchsorted(heaped, share * heaped[-1] * (1.0 - 1e-12)))
    return float(values[order][min(place, len(values) - 1)])


def sessions_of(series: ClockSeries, gap_s: float) -> list[ClockSession]:
    """A log cut at starts (`starts.cuts`), and where stamps begin anew."""
    if not len(series):
        return []
    ends = [0, *cuts(series, gap_s).tolist(), len(series)]
    parts = [series.part(slice(a, b)) for a, b in itertools.pairwise(ends)]
    found = [_session(part) for part in parts]
    if series.kind.family in OF_NO_STARTS:
        pairs = itertools.pairwise(found)
        found[1:] = [_after_silence(before, after) for before, after in pairs]
    return found


def _after_silence(before: ClockSession, after: ClockSession) -> ClockSession:
    """What a silence between sessions brought, where the log would not tell a start from it."""
    series = after.series
    begins, ends = float(before.series.time_s[-1]), float(series.time_s[0])
    size = _size(series.offset_s[:1])
    usual = after.quantile_s(USUAL_SHARE) if np.any(after.steady) else math.inf
    if ends <= begins or series.restart[0] or size <= BEYOND_USUAL * usual:
        return after
    return replace(after, events=(ClockEvent("gap", begins, ends, size), *after.events))


def count_of(series: ClockSeries, gap_s: float) -> int:
    """How many sessions there would be."""
    return int(cuts(series, gap_s).shape[0]) + 1


def went_back(series: ClockSeries) -> list[tuple[float, float]]:
    """Where stamps of UTC go back: (stamp before, by how much) [s]."""
    if series.kind.stamps != "utc":
        return []
    steps = np.diff(series.time_s)
    return [(float(series.time_s[k]), float(-steps[k])) for k in np.flatnonzero(steps < -1.0)]


def _session(series: ClockSeries) -> ClockSession:
    order = np.argsort(series.time_s, kind="stable")
    series = series.part(order) if np.any(np.diff(order) < 0) else series  # type: ignore[arg-type]
    longest = _longest_interval(series.time_s)
    known = np.isfinite(series.offset_s)
    startup = _startup(series)
    steady = known & series.locked & ~startup
    slow = _after_the_first(known & series.locked & startup)
    events = [*_startup_events(series, startup), *_lock_events(series, startup, longest),
              *_gap_events(series, longest), *_step_events(series, steady),
              *_frequency_events(series, steady)]  # fmt: skip
    events.sort(key=lambda event: (event.from_s, event.kind))
    weights = _weights(series.time_s, longest)
    return ClockSession(
        series, steady, slow, weights, tuple(events), _silences(series, steady, longest)
    )


def _longest_interval(time_s: Array) -> float:
    """The longest time between two samples that is no gap: daemons change their own interval."""
    steps = np.diff(time_s)
    steps = steps[steps > 0.0]
    if not steps.shape[0]:
        return math.inf
    return float(max(GAP_FACTOR * np.median(steps), 3.0 * np.quantile(steps, 0.9)))


def _weights(time_s: Array, longest: float) -> Array:
    """How much time each row stands for: half of what lies to its neighbours."""
    if time_s.shape[0] < 2 or time_s[0] == time_s[-1]:
        return np.ones(time_s.shape)
    steps = np.minimum(np.diff(time_s), longest)
    halves = np.concatenate([steps[:1], steps, steps[-1:]])
    weights = 0.5 * (halves[:-1] + halves[1:])
    floor = 1e-6 * float(np.max(weights))
    raised: Array = np.maximum(weights, floor)
    return raised


def _silences(series: ClockSeries, steady: Flags, longest: float) -> Array:
    """Of times without samples between two steady rows, in pieces: |offset| and how long each is.

    A clock left alone with the frequency error that it had runs off evenly or, as that grows,
    later rather than sooner; of a piece the larger end is taken.
    """
    steps = np.diff(series.time_s)
    places = np.flatnonzero((steps > longest) & steady[1:] & steady[:-1])
    before, after = np.abs(series.offset_s[places]), np.abs(series.offset_s[places + 1])
    low, high = np.minimum(before, after), np.maximum(before, after)
    parts = np.arange(1, PIECES + 1) / PIECES
    sizes = low[:, None] + (high - low)[:, None] * parts
    lengths = np.repeat(steps[places] / PIECES, PIECES)
    signs = np.sign(series.offset_s[np.where(before > after, places, places + 1)])
    found: Array = np.column_stack([(sizes * signs[:, None]).ravel(), lengths])
    return found


def _startup(series: ClockSeries) -> Flags:
    """The rows before lock is first reached, or before the daemon's own bound has come down."""
    good = series.locked & np.isfinite(series.offset_s)
    hard = series.hard_s[good]
    if np.any(np.isfinite(hard)):
        usual = float(np.nanmedian(hard))
        good &= ~(series.hard_s > STARTUP_FACTOR * usual)
    first = int(np.argmax(good)) if np.any(good) else len(series)
    return np.arange(len(series)) < first


def _after_the_first(rows: Flags) -> Flags:
    """All but the first of them: the first update tells how far off the clock was before it."""
    found = rows.copy()
    if np.any(rows):
        found[int(np.argmax(rows))] = False
    return found


def _of_unlocked(series: ClockSeries) -> Flags:
    """Rows that lock came back with, whose bound is of the time before it: chronyd's `Max. error`
    is what the clock was within until the update that a row tells of."""
    found = np.zeros(len(series), dtype=bool)
    if series.kind.name == TRACKING.name:
        found[1:] = series.locked[1:] & ~series.locked[:-1]
    return found


def _size(offsets: Array) -> float:
    known = np.abs(offsets[np.isfinite(offsets)])
    return float(np.max(known)) if known.shape[0] else 0.0


def _drifted(series: ClockSeries, first: int, last: int) -> float:
    """What a clock may have drifted between two rows by the daemon's skew before; 0: unknown."""
    skew = float(series.skew[first])
    span = float(series.time_s[last] - series.time_s[first])
    return skew * span if 0.0 < skew < MOST_SKEW else 0.0


def _startup_events(series: ClockSeries, startup: Flags) -> list[ClockEvent]:
    count = int(np.sum(startup))
    if not count:
        return []
    end = series.time_s[min(count, len(series) - 1)]
    return [ClockEvent("startup", float(series.time_s[0]), float(end),
                       _size(series.offset_s[:count]))]  # fmt: skip


def _lock_events(series: ClockSeries, startup: Flags, longest: float) -> list[ClockEvent]:
    """Where lock was lost, what the clock did until it came back, and its offset then."""
    out = ~series.locked & ~startup
    edges = np.flatnonzero(np.diff(np.concatenate([[False], out, [False]]).astype(int)))
    found: list[ClockEvent] = []
    for start, stop in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        back = min(stop, len(series) - 1)
        begins, ends = float(series.time_s[start]), float(series.time_s[back])
        size = _size(series.offset_s[start : back + 1]) + _drifted(series, max(0, start - 1), back)
        daemon = _size(series.hard_s[start:stop])
        found.append(ClockEvent("unlock", begins, ends, size, daemon))
        if ends - begins > longest or (stop - start > 1 and ends > begins):
            found.append(ClockEvent("holdover", begins, ends, size, daemon))
        if stop < len(series):
            found.append(ClockEvent("relock", ends, ends, _size(series.offset_s[stop : stop + 1])))
    return found


def _gap_events(series: ClockSeries, longest: float) -> list[ClockEvent]:
    """Times without samples: the larger offset at the two ends, and what the skew brings.

    Of a daemon that steers it is a holdover too: nothing told it of the time meanwhile.
    """
    places = np.flatnonzero(np.diff(series.time_s) > longest)
    steers = series.kind.family not in OF_NO_STARTS and series.kind.steering == "servo"
    found = []
    for k in places.tolist():
        begins, ends = float(series.time_s[k]), float(series.time_s[k + 1])
        size = _size(series.offset_s[k : k + 2]) + _drifted(series, k, k + 1)
        found.append(ClockEvent("gap", begins, ends, size))
        if steers and series.locked[k] and series.locked[k + 1]:  # else it is one of lost lock
            found.append(ClockEvent("holdover", begins, ends, size))
    return found


def _step_events(series: ClockSeries, steady: Flags) -> list[ClockEvent]:
    """Jumps from one sample to the next beyond anything that the session's noise does."""
    places = np.flatnonzero(steady)
    if places.shape[0] < LEAST_SAMPLES:
        return []
    offsets, times = series.offset_s[places], series.time_s[places]
    jumps = np.diff(offsets)
    spread = OF_MEDIAN_DEVIATION * float(np.median(np.abs(jumps - np.median(jumps))))
    least = max(STEP_SIGMAS * spread, _usual(jumps))
    found: list[ClockEvent] = []
    for k in np.flatnonzero(np.abs(jumps) > least):
        size = max(abs(float(jumps[k])), abs(float(offsets[k])), abs(float(offsets[k + 1])))
        kind: EventKind = "step"
        if series.kind.stamps == "utc" and is_leap(float(times[k + 1]), float(jumps[k])):
            kind = "leap_second"
        found.append(ClockEvent(kind, float(times[k]), float(times[k + 1]), size))
    return found


def _usual(jumps: Array) -> float:
    """What a jump has to exceed besides: common ones, and the log's own resolution."""
    sizes = np.abs(jumps)
    moved = sizes[sizes > 0.0]
    finest = float(np.min(moved)) if moved.shape[0] > 5 else 0.0
    return max(3.0 * float(np.quantile(sizes, 0.9)), 5.0 * finest, 1e-12)


def is_leap(time_s: float, jump_s: float) -> bool:
    """A second in or out at a UTC midnight."""
    from_midnight = (time_s + _DAY / 2.0) % _DAY - _DAY / 2.0
    return abs(abs(jump_s) - 1.0) < 0.1 and abs(from_midnight) < 1100.0


def _frequency_events(series: ClockSeries, steady: Flags) -> list[ClockEvent]:
    """Jumps of the frequency correction; the size is what they bring until the next sample."""
    rate, times = series.rate[steady], series.time_s[steady]
    known = np.isfinite(rate)
    rate, times = rate[known], times[known]
    if rate.shape[0] < LEAST_SAMPLES:
        return []
    jumps = np.diff(rate)
    spread = OF_MEDIAN_DEVIATION * float(np.median(np.abs(jumps - np.median(jumps))))
    places = np.flatnonzero(np.abs(jumps) > max(STEP_SIGMAS * spread, _usual(jumps), 1e-9))
    return [
        ClockEvent("frequency_jump", float(times[k]), float(times[k + 1]),
                   abs(float(jumps[k])) * float(times[k + 1] - times[k]))
        for k in places
    ]  # fmt: skip
