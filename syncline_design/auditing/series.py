"""The two times of a stream's messages while they are being audited."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from syncline_design.logs.readers.stream import UNSET, Nanoseconds
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import to_digits, to_places
from syncline_design.model.normal import OF_MEDIAN_DEVIATION

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
NS = 1e9
MEDIAN_SIGMA = 1.25 / 1.35  # uncertainty of a median of n normal values, in quartile distances
_FEW = 256  # numbers; beyond it numpy's partition is quicker than to sort them
UNIX_S = 6e8  # later than this since 1970: a calendar's clock (1989)


@dataclass(frozen=True, slots=True, eq=False)
class Series:
    """Messages in the order of the file.

    stamp, receive: nanoseconds; receive None: the file tells one time only, or two of one clock.
    good: those whose stamp is usable.  start: receipt (or stamp) of the run's first message.
    """

    stamp: Nanoseconds
    receive: Nanoseconds | None
    good: Mask
    start: int

    @property
    def seconds(self) -> Array:
        """Seconds of the latest receipt so far since the first message of the run; without
        receipts, of the latest stamp."""
        if self.receive is not None:
            return seconds(np.maximum.accumulate(self.receive) - self.start)
        known = np.where(self.good, self.stamp, np.iinfo(np.int64).min)
        return seconds(np.maximum(np.maximum.accumulate(known), self.start) - self.start)

    def places(self) -> NDArray[np.intp]:
        return np.flatnonzero(self.good)

    def stamped_later(self, by_s: Array) -> Series:
        """The series with its usable stamps later by so much each [s]."""
        stamp = self.stamp.copy()
        stamp[self.places()] += np.round(by_s * NS).astype(np.int64)
        return replace(self, stamp=stamp)


def series_of(stamp: Nanoseconds, receive: Nanoseconds | None, start: int | None = None) -> Series:
    """A series of all messages; of those without a stamp none is good."""
    good = stamp != UNSET
    if receive is not None:
        good &= receive != UNSET
    times = stamp if receive is None else receive
    first = int(times[good][0]) if bool(good.any()) else 0
    return Series(stamp, receive, good, first if start is None else start)


def seconds(whole: Nanoseconds) -> Array:
    """Differences in nanoseconds as seconds."""
    return whole / NS


def in_words(length_s: float) -> str:
    """A length of time without exponents: `12.5 us`, `4.2 ms`, `1760000000.014 s`."""
    size = abs(length_s)
    for unit, factor in (("ns", 1e9), ("us", 1e6), ("ms", 1e3)):
        if size * factor < 999.95 and (size > 0.0 or unit == "ms"):
            return f"{to_digits(length_s * factor, 4)} {unit}"
    digits = 3 if size >= 10.0 else 4
    return to_places(length_s, digits).rstrip("0").rstrip(".") + " s"


def spread(values: Array) -> float:
    """Interquartile range; 0 of nothing."""
    if not values.size:
        return 0.0
    if values.size > _FEW or values.dtype != np.float64:
        low, high = np.percentile(values, [25, 75])
        return float(high - low)
    ordered = np.sort(values, axis=None)
    return _quantile(ordered, 0.75) - _quantile(ordered, 0.25)


def percentile(values: Array, percent: float) -> float:
    """As numpy's, to the bit; of few numbers its preparations take ten times as long as they."""
    if not 0 < values.size <= _FEW or values.dtype != np.float64:
        return float(np.percentile(values, percent))
    return _quantile(np.sort(values, axis=None), percent / 100)


def median(values: Array) -> float:
    """As numpy's, to the bit, and as quick as `percentile`."""
    if not 0 < values.size <= _FEW or values.dtype != np.float64:
        return float(np.median(values))
    ordered = np.sort(values, axis=None)
    half = ordered.size // 2
    if np.isnan(ordered[-1]):  # sorted to the end
        return float("nan")
    upper = float(ordered[half])
    return upper if ordered.size % 2 else (float(ordered[half - 1]) + upper) / 2.0


def _quantile(ordered: Array, part: float) -> float:
    """Between neighbours as numpy goes: from the nearer one.  A NaN is the last of sorted ones."""
    at = (ordered.size - 1) * part
    below = min(int(at), ordered.size - 1)
    low, high = float(ordered[below]), float(ordered[min(below + 1, ordered.size - 1)])
    if np.isnan(ordered[-1]):
        return float("nan")
    weight = at - below
    return high - (high - low) * (1.0 - weight) if weight >= 0.5 else low + (high - low) * weight


def scatter(values: Array) -> float:
    """1.4826 times the median absolute deviation: sigma of a normal law, blind to outliers."""
    if not values.size:
        return 0.0
    return OF_MEDIAN_DEVIATION * median(np.abs(values - median(values)))
