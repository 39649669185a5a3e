"""Messages that come in another order than they were measured in.

Transport without a queue (datagrams, threads that share a topic) lets one message overtake
another: each stamp is right, and put in order they keep the sensor's rhythm.  A wrong stamp lies
where another message was measured already.  Where two messages exchanged their stamps the rhythm
is whole as well, but the first of them comes before it can have been measured.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from syncline_design.auditing.result import StampFault
from syncline_design.auditing.series import NS, Mask, Series
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import to_digits

_DEEPEST_NS: Final = 2 * 10**9  # a stamp further back was not overtaken, its clock was set
_USUAL_DEPTH, _DEEPER = 98.0, 3.0  # per cent of what was overtaken; times that: set back as well
_WHOLE_NS: Final = 5e7  # from whole seconds
_MOST: Final = 0.8
_LEAST_MESSAGES: Final = 40
_NEAR: Final = 0.2  # of an interval: how near to the rhythm stamps are once in order
_MOST_ODD: Final = 0.1  # of all intervals
_MOST_WRONG: Final = 0.3  # of all falls
_PAIRS: Final = 0.9  # of all disordered stretches: two messages each
_MOST_PAIRED: Final = 0.6  # of all messages
_EARLY: Final = 0.2  # of an interval before the fastest message near by
_MOST_EARLY: Final = 0.3  # of the pairs
_BESIDE: Final = 15  # messages on each side


@dataclass(frozen=True, slots=True, eq=False)
class Disorder:
    """How to put messages in the order of their stamps; order None: they are, or no rhythm tells.

    fault: where stamps were exchanged.  falls: stamps before the one of the message before;
    deepest_s: by how much at most.
    """

    order: NDArray[np.intp] | None = None
    fault: StampFault | None = None
    falls: int = 0
    deepest_s: float = 0.0

    def put(self, series: Series) -> Series:
        """Messages moved with both their times; of exchanged stamps these alone go back."""
        if self.order is None:
            return series
        if self.fault is not None:
            return replace(series, stamp=series.stamp[self.order])
        receive = None if series.receive is None else series.receive[self.order]
        return replace(
            series, stamp=series.stamp[self.order], receive=receive, good=series.good[self.order]
        )


def disorder_of(series: Series) -> Disorder:
    """What changed the order of messages: transport, without a fault, or two stamps that were
    exchanged."""
    places = series.places()
    if series.receive is None or places.size < _LEAST_MESSAGES:
        return Disorder()
    stamp = series.stamp[places]
    falls = np.flatnonzero(np.diff(stamp) < 0)
    if not falls.size:
        return Disorder()
    sorted_ = _sorted(stamp)
    period = _period(stamp, stamp[sorted_])
    if period is None or np.array_equal(sorted_, np.arange(stamp.size)):
        return Disorder()
    order = np.arange(series.stamp.size)
    order[places] = places[sorted_]
    left = int(np.sum(np.diff(stamp[sorted_]) < 0))
    count = int(falls.size) - left
    if count <= 0:
        return Disorder()
    fell = np.diff(stamp)
    deepest = float(-fell[fell >= -_DEEPEST_NS].min()) / NS
    late = (series.receive[places] - stamp).astype(np.float64)
    away = late - np.median(late)
    if _in_whole_seconds(away[falls + 1]) or _in_whole_seconds(away[falls]):
        return Disorder()
    exchanged = _exchanged(sorted_, late, period)
    fault = _fault(series, places[falls + 1], count, deepest) if exchanged else None
    return Disorder(order, fault, count, deepest)


def _in_whole_seconds(away: NDArray[np.float64]) -> bool:
    """Whether what seems overtaken, or to overtake, is off by the same whole seconds: slips of
    single stamps."""
    whole = round(float(np.median(away)) / NS)
    return whole != 0 and float(np.mean(np.abs(away - whole * NS) < _WHOLE_NS)) > _MOST


def _sorted(stamp: NDArray[np.int64]) -> NDArray[np.intp]:
    """The order of stamps within stretches whose clock was not set back."""
    order = np.arange(stamp.size)
    fell = np.diff(stamp)
    usual = float(np.percentile(-fell[fell < 0], _USUAL_DEPTH))
    deep = np.flatnonzero(fell < -min(_DEEPER * usual, _DEEPEST_NS)) + 1
    for part in np.split(order.copy(), deep):
        depth = np.maximum.accumulate(stamp[part]) - stamp[part]
        if int(depth.max()) <= _DEEPEST_NS:
            order[part[0] : part[-1] + 1] = part[np.argsort(stamp[part], kind="stable")]
    return order


def _period(stamp: NDArray[np.int64], ordered: NDArray[np.int64]) -> float | None:
    """The sensor's interval [ns] where stamps in order keep a rhythm, no two on one place of it."""
    change = np.diff(ordered).astype(np.float64)
    forward = change[change > 0.0]
    if forward.size < _LEAST_MESSAGES // 2:
        return None
    period = float(np.median(forward))
    before = np.diff(stamp).astype(np.float64)
    if float(np.mean(_odd(forward[forward < 2.5 * period], period))) > _MOST_ODD:
        return None
    # a message whose place another took already is odd, and so is what was measured between two
    odd = int(np.sum(_odd(change, period))) - int(np.sum(_odd(before[before >= 0.0], period)))
    return period if odd <= _MOST_WRONG * int(np.sum(before < 0.0)) else None


def _odd(change: NDArray[np.float64], period: float) -> Mask:
    """Intervals that are no whole number of the sensor's, or none at all."""
    counts = np.round(change / period)
    return np.asarray((counts == 0.0) | (np.abs(change - counts * period) > _NEAR * period))


def _exchanged(
    sorted_: NDArray[np.intp], late: NDArray[np.float64], period: float
) -> bool:  # fmt: skip
    """Whether pairs of stamps were exchanged: the first of each is too early to be true."""
    moved = sorted_ != np.arange(sorted_.size)
    firsts = np.flatnonzero((sorted_[:-1] == np.arange(1, sorted_.size)) & moved[:-1])
    firsts = firsts[sorted_[firsts + 1] == firsts]
    if 2 * firsts.size < _PAIRS * moved.sum() or moved.mean() > _MOST_PAIRED:
        return False
    early = [late[k] < _fastest(late, ~moved, int(k)) - _EARLY * period for k in firsts]
    return float(np.mean(early)) > _MOST_EARLY


def _fastest(late: NDArray[np.float64], calm: Mask, at: int) -> float:
    """The least lateness of messages near by that are in order."""
    near = slice(max(0, at - _BESIDE), at + _BESIDE)
    return float(late[near][calm[near]].min(initial=np.inf))


def _fault(
    series: Series, at: NDArray[np.intp], count: int, deepest_s: float
) -> StampFault:  # fmt: skip
    times = series.seconds[at]
    return StampFault(
        "backward_jump", {"count": float(count), "seconds": -deepest_s}, float(times[0]),
        float(times[-1]), f"{count} times two messages carry each other's stamp, by up to "
        f"{to_digits(deepest_s, 6)} s: the first of them came before it was measured",
    )  # fmt: skip
