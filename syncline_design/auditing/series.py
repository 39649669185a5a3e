"""The two times of a stream's messages while they are being audited."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from syncline_design.logs.readers.stream import UNSET, Nanoseconds
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import to_digits, to_places
from syncline_design.model.normal import OF_MEDIAN_DEVIATION

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
NS = 1e9
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
    low, high = np.percentile(values, [25, 75])
    return float(high - low)


def scatter(values: Array) -> float:
    """1.4826 times the median absolute deviation: sigma of a normal law, blind to outliers."""
    if not values.size:
        return 0.0
    return OF_MEDIAN_DEVIATION * float(np.median(np.abs(values - np.median(values))))
