"""Whether the two times of a message are two, and how evenly its stamps follow one another.

Receipt minus stamp bounds a stamp's error from one side alone: data are received after they were
measured, so a stamp is early by no more than that; a stamp that was taken late, near its receipt,
is as near to it as a true one.  How late stamps come by turns shows against the sensor's own
rhythm a + k T, which late ones leave; a constant shows in neither.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from syncline_design.auditing.cadence import Cadence, cadence, counted_over_gaps
from syncline_design.auditing.grains import grain_of
from syncline_design.auditing.series import NS, Array, Series, seconds
from syncline_design.machine.quick_dataclass import dataclass

_ROUNDED_S: Final = 1e-6  # seconds since 1970 as 64-bit floats lie 0.24 us apart; no host's wait
# for a message keeps to within this
_DIGITS: Final = 10  # after the point: stamps are whole nanoseconds, less is arithmetic
_LEAST: Final = 20  # messages that tell either
_SAMPLE: Final = 100_000  # messages that tell a resolution


@dataclass(frozen=True, slots=True)
class TwoTimes:
    """uneven_s: reach of the stamps about an even rhythm, None where they keep none; copied: all
    receipts are the stamps once more, but for a constant and the rounding of the file."""

    uneven_s: float | None
    copied: bool


def two_times(whole: Series, series: Series) -> TwoTimes:
    """Of messages as recorded in one unit (whole), those that were left out of series aside."""
    used = whole.good & series.good
    stamp = whole.stamp[used]
    if stamp.size < _LEAST:
        return TwoTimes(None, copied=False)
    copied = False
    if whole.receive is not None:
        grain_s = grain_of(whole.receive[used][:_SAMPLE]) / NS
        reach_s = float(np.ptp(seconds(whole.receive[used] - stamp)))
        copied = reach_s <= _ROUNDED_S or reach_s < grain_s
    kept = Series(whole.stamp, whole.receive, used, whole.start)
    return TwoTimes(_uneven(seconds(stamp - stamp[0]), cadence(kept)), copied)


def _uneven(when: Array, pace: Cadence) -> float | None:
    """The least reach about a line over the messages' numbers, whichever way these are counted.

    None where even the least is more than an interval: which message is which is not known then.
    """
    if pace.period_s <= 0.0:
        return None
    over = counted_over_gaps(when)
    ways = [np.concatenate([[0.0], np.cumsum(pace.steps)])]
    ways.append(np.arange(when.size, dtype=np.float64) if over is None else over)
    least = round(min(_about_line(counts, when) for counts in ways), _DIGITS)
    return least if least < pace.period_s else None


def _about_line(counts: Array, when: Array) -> float:
    if counts[-1] <= 0.0:
        return float("inf")
    first, period = np.polynomial.polynomial.polyfit(counts, when, 1)
    return float(np.ptp(when - first - period * counts))
