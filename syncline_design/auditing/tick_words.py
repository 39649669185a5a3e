"""Stamps on ticks that an even rhythm waits for, told by how many ticks pass between neighbours.

A message measured at a + k T is stamped at a tick q that follows: of T = 50 ms and q = 40 ms after
1, 1, 1, 2, 1, 1, 1, 2, ... ticks, two numbers next to one another whose sum never leaves a line by
a tick (balanced sequences: Morse and Hedlund 1940).  Losses at random, publishers in turn and pings
that follow the depth leave it.  A sensor of interval q that leaves out one of five keeps it, too:
there receipts tell, where they come evenly at T though stamps do not, or numbers that never repeat
themselves, as no count of messages makes them.  Else nothing does.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from syncline_design.auditing.cadence import Cadence
from syncline_design.auditing.coarse_rhythm import counted, evener
from syncline_design.auditing.local_rhythm import off_course
from syncline_design.auditing.series import Array, Series, in_words, seconds
from syncline_design.auditing.ticks import ONE_RATE, near_a_line, rates_apart
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import to_digits

LEAST_TICK_S: Final = 0.004  # quicker ones are of a sensor's own task
_LEAST: Final = 128  # messages
_STRETCH: Final = 24  # messages: two of a hundred lost leave most stretches whole
_RARE: Final = 2.0  # % of intervals that may be of neither number
_NOISY: Final = 0.05  # of a tick: interrupts that come later than that hide it
_EXACT: Final = 0.002  # of a tick: how near to whole ticks intervals are
_SIGMA: Final = 4.0  # of what noise makes of a mean
_OFF: Final = 0.03  # of the intervals
_MOST_LOST: Final = 0.1  # of the rarer number: else losses explain it as well
_REACH: Final = 1.03  # ticks
_PERIODS: Final = 24  # messages of which a count, or a rate that is a simple part, repeats itself
_TURNED: Final = 0.5  # places of a period: a repeated pattern that moves by two is none
_ALIKE: Final = 0.97  # of the distances between what is left out: a strict count
_LAGS: Final = (1, 2, 4, 8, 16, 32, 64)  # messages
_SUMS: Final = 12
_CLOCKS: Final = 5e-5  # that a sensor's clock and the timer's differ by


@dataclass(frozen=True, slots=True, eq=False)
class Paced:
    """Stamps on ticks of one length.

    waits_s: after the rhythm, but for a constant.  repeats: as a count of messages makes them, too.
    evenly: receipts keep the rhythm that stamps do not.
    """

    tick_s: float
    period_s: float
    places: NDArray[np.intp]
    waits_s: Array
    repeats: bool
    evenly: bool

    @property
    def sure(self) -> bool:
        return self.evenly or not self.repeats

    def hidden_s(self, series: Series) -> float:
        """By how much more than they seem to [s] messages may be late if a timer stamped them."""
        assert series.receive is not None
        late = seconds((series.receive - series.stamp)[self.places])
        more = max(0.0, float(np.ptp(late + self.waits_s) - np.ptp(late)))
        between = max(0.0, self.tick_s - float(np.ptp(self.waits_s)))
        return more + min(between, _CLOCKS * float(np.ptp(series.seconds[self.places])))

    @property
    def words(self) -> str:
        return (f"whether a timer of {in_words(self.tick_s)} stamped it: its stamps follow one "
                f"another as those of {to_digits(1.0 / self.period_s, 4)} Hz do on such ticks, and "
                "as those of a sensor that measures at every tick and leaves some out "
                "in turn")  # fmt: skip


def paced(series: Series, places: NDArray[np.intp]) -> Paced | None:
    """The ticks that stamps show by two numbers of them between neighbours."""
    if series.receive is None or places.size < _LEAST:
        return None
    when = seconds(series.stamp[places] - series.stamp[places[0]])
    passed = np.diff(when)
    tick = _tick_of(passed)
    if tick is None or not _balanced(np.round(passed / tick)):
        return None
    count = counted(when, tick)
    if count is None or float(count.lost.sum()) > _MOST_LOST * _rarer(passed, tick).size:
        return None
    waits = count.waits(when)
    if float(np.ptp(waits)) > _REACH * tick:
        return None
    late = seconds((series.receive - series.stamp)[places])
    longest = max(np.split(np.arange(passed.size), np.flatnonzero(count.lost)), key=np.size)
    repeats = _repeats(passed[longest[1:]], tick, count.period_s)
    return Paced(tick, count.period_s, places, waits, repeats, evener(late + waits, late))


@dataclass(frozen=True, slots=True)
class Told:
    """Whether messages come after their stamps on a grid as if they had been measured there.

    sigma: in units of chance, positive of what was measured (or taken) there, negative of stamps
    that the grid cut off.  even: of a sensor of one interval.
    """

    sigma: float
    even: bool

    @property
    def followed(self) -> bool:
        return self.sigma > _SIGMA

    @property
    def open(self) -> bool:
        """Whether neither is sure, of a sensor whose interval changes: it may keep the grid."""
        return not self.even and abs(self.sigma) <= _SIGMA


def told_by_receipts(series: Series, pace: Cadence, grain_s: float) -> Told | None:
    """Of a smooth course c, w = s - c and delays d: cut-off stamps leave r - s = d - w, those of
    messages that were measured or taken at s leave d.  So r - s changes from message to message by
    what delays do less what w does, or by the first alone: the likelihoods of both, of delays whose
    changes are Laplace's (sums of absolute values), apart by more than chance makes them.

    The course is a + k T, or that of the messages around; without one nothing tells.  None without
    receipts.
    """
    places = pace.places
    if series.receive is None or places.size < 2:
        return None
    when = seconds(series.stamp[places] - series.stamp[places[0]])
    late = seconds((series.receive - series.stamp)[places])
    count = counted(when, grain_s)
    waits = None if count is None else count.waits(when)
    even = waits is not None and float(np.ptp(waits)) <= _REACH * grain_s
    pieces = (waits, late) if waits is not None and even else off_course(when, late, grain_s)
    one_rate = even or rates_apart(np.diff(when), grain_s) < ONE_RATE
    if pieces is None:
        return Told(0.0, one_rate or pace.regular)
    return Told(_nearer(*(np.atleast_2d(piece) for piece in pieces)), one_rate)


def _nearer(off: Array, late: Array) -> float:
    """How much nearer [sigma] receipts are to what was measured there than to what was cut off, by
    messages as far apart as stamps show most; off, late: rows of messages one after another [s].

    Chance is that of sums over a twelfth of the messages each, as delays remember others.
    """
    lags = [lag for lag in _LAGS if 2 * lag <= off.shape[1]]
    apart = max(lags, key=lambda lag: float(np.mean(np.abs(off[:, lag:] - off[:, :-lag]))))
    moved, later = (rows[:, apart:] - rows[:, :-apart] for rows in (off, late))
    nearer = np.abs(later + moved) - np.abs(later)
    sums = np.asarray([float(part.sum()) for part in np.array_split(nearer.ravel(), _SUMS)])
    chance = float(np.std(sums, ddof=1)) * float(np.sqrt(_SUMS))
    return float(sums.sum()) / chance if chance > 0.0 else 0.0


def _tick_of(passed: Array) -> float | None:
    """What intervals of two kinds differ by, where both are whole numbers of it."""
    low, high = np.percentile(passed, [_RARE, 100.0 - _RARE])
    about = float(high - low)
    if about < LEAST_TICK_S or low < -_NOISY * about:
        return None
    kinds = [passed[np.abs(passed - kind) < _NOISY * about] for kind in (low, high)]
    few = min(kind.size for kind in kinds) < 2  # a percentile between two kinds
    if few or sum(kind.size for kind in kinds) < (1.0 - _OFF) * passed.size:
        return None
    short, long_ = (float(kind.mean()) for kind in kinds)
    tick = long_ - short
    unsure = _SIGMA * float(np.hypot(*(kind.std() / np.sqrt(kind.size) for kind in kinds)))
    whole = round(short / tick)
    return tick if abs(short - whole * tick) < (_EXACT + whole * unsure / tick) * tick else None


def _balanced(counts: Array) -> bool:
    """Whether most stretches of numbers stay near a line: short ones, in most of which no message
    is missing."""
    near, _ = near_a_line(counts, _STRETCH)
    return float(np.mean(near)) > 0.5


def _repeats(passed: Array, tick: float, interval: float) -> bool:
    """Whether some messages' numbers of ticks come again and again."""
    ticks = np.concatenate([[0.0], np.cumsum(np.round(passed / tick))])
    number = np.arange(ticks.size)
    for period in range(1, _PERIODS + 1):
        away = ticks - round(period * interval / tick) / period * number
        if float(np.ptp(away)) <= 1.0 + _TURNED / period:
            return True
    apart, often = np.unique(np.diff(_rarer(passed, tick)), return_counts=True)
    if not apart.size:
        return True
    alike = int(np.argmax(often))
    return bool(apart[alike] > _PERIODS and often[alike] > _ALIKE * often.sum())


def _rarer(passed: Array, tick: float) -> NDArray[np.intp]:
    """Where the rarer of the two numbers of ticks passes."""
    counts = np.round(passed / tick)
    values, often = np.unique(counts, return_counts=True)
    rarer = values[np.argsort(often)[-2]] if values.size > 1 else values[0]
    return np.flatnonzero(counts == rarer)
