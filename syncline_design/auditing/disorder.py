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

from syncline_design.auditing.measured_order import sequence_of
from syncline_design.auditing.result import StampFault
from syncline_design.auditing.series import NS, Mask, Series, seconds
from syncline_design.auditing.unrhythmic_order import order_without_rhythm
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import to_digits

_WHOLE_NS: Final = 5e7  # from whole seconds
_MOST: Final = 0.8
_IN_A_ROW: Final = 1.5  # messages of a slip on the average; fewer are single ones
_PAIRS: Final = 0.9  # of all disordered stretches: two messages each
_MOST_PAIRED: Final = 0.6  # of all messages
_EARLY: Final = 0.2  # of an interval before the fastest message near by
_MOST_EARLY: Final = 0.3  # of the pairs
_BESIDE: Final = 15  # messages on each side
_TOGETHER: Final = 0.1  # of the mean interval
_BUNCHED: Final = 0.25  # share of messages that come together
_READ_S: Final = 4e-4  # that reading a message of a packet hardly takes


@dataclass(frozen=True, slots=True, eq=False)
class Disorder:
    """How to put messages in the order of their stamps; order None: they are, or no rhythm tells.

    wrong: messages, in that order, whose stamps the rhythm has no place for.
    fault: where stamps were exchanged.  falls: stamps before the one of the message before;
    deepest_s: by how much at most.  by_rhythm: of clocks that may be set beside.
    """

    order: NDArray[np.intp] | None = None
    wrong: Mask | None = None
    fault: StampFault | None = None
    falls: int = 0
    deepest_s: float = 0.0
    by_rhythm: bool = True

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

    def without_wrong(self, series: Series) -> Series:
        """A series put in order, of stamps that the rhythm has a place for."""
        return series if self.wrong is None else replace(series, good=series.good & ~self.wrong)


def disorder_of(series: Series) -> Disorder:
    """What changed the order of messages: transport, without a fault, or two stamps that were
    exchanged."""
    places = series.places()
    falls = np.flatnonzero(np.diff(series.stamp[places]) < 0)
    if falls.size and _in_packets(series.stamp[places]):
        packets = _without_rhythm(series)
        if packets.order is not None:
            return packets
    sequence = sequence_of(series) if falls.size else None
    if sequence is None or series.receive is None:
        return _without_rhythm(series) if falls.size else Disorder()
    overtaken = sequence.behind_ns > 0.0
    if not overtaken.any() or _in_whole_seconds(sequence.away_ns, overtaken):
        return Disorder(wrong=None if overtaken.any() else sequence.wrong)
    order = sequence.order
    rank = np.cumsum(series.good) - 1
    sorted_ = rank[order[series.good[order]]]
    stamp = series.stamp[places]
    count = int(falls.size) - int(np.sum(np.diff(stamp[sorted_]) < 0))
    if count <= 0:
        return Disorder()
    deepest = float(sequence.behind_ns.max()) / NS
    late = (series.receive[places] - stamp).astype(np.float64)
    if not _exchanged(sorted_, late, sequence.period_ns):
        return Disorder(order, sequence.wrong[order], None, count, deepest)
    alone = np.arange(order.size)
    alone[places] = places[sorted_]
    return Disorder(
        alone, None, _fault(series, places[falls + 1], count, deepest), count, deepest
    )  # fmt: skip


def _in_packets(stamp: NDArray[np.int64]) -> bool:
    """Whether many stamps, in their order, follow one another as messages of a packet are read:
    every so many of them keep a rhythm as well, which is the packets'."""
    apart = seconds(np.diff(stamp[np.argsort(stamp)]))
    near = apart < _TOGETHER * float(apart.mean())
    return float(near.mean()) > _BUNCHED and float(np.median(apart[near])) < _READ_S


def _without_rhythm(series: Series) -> Disorder:
    """What threads noted out of order among stamps of packets, of a grid, or on arrival."""
    order = order_without_rhythm(series)
    if order is None:
        return Disorder()
    behind = _behind(series)
    put_right = behind.copy()
    put_right[order] -= _behind(replace(series, stamp=series.stamp[order], good=series.good[order]))
    count = int(np.sum(put_right > 0))
    return Disorder(order, None, None, count, float(put_right.max()) / NS, by_rhythm=False)


def _behind(series: Series) -> NDArray[np.int64]:
    """How far each usable stamp lies behind one of a message before [ns]."""
    known = np.where(series.good, series.stamp, np.iinfo(np.int64).min)
    return np.where(series.good, np.maximum.accumulate(known) - series.stamp, 0)


def _in_whole_seconds(away_ns: NDArray[np.float64], overtaken: Mask) -> bool:
    """Whether what seems overtaken is late by the same whole seconds, several in a row: a slip.

    Single ones took the place of the rhythm that is theirs, or would be among the wrong: they were
    sent again a second later.
    """
    away = away_ns[overtaken]
    whole = round(float(np.median(away)) / NS)
    if whole == 0 or float(np.mean(np.abs(away - whole * NS) < _WHOLE_NS)) <= _MOST:
        return False
    begins = int(np.sum(np.diff(np.concatenate([[False], overtaken]).astype(np.int8)) > 0))
    return away.size > _IN_A_ROW * begins


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
