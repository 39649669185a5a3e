"""What is left of receipt minus stamp once every named fault is taken out."""

from __future__ import annotations

from typing import Final

import numpy as np

from syncline_design.auditing.cadence import Cadence, cadence, counted_over_gaps
from syncline_design.auditing.coarse_rhythm import (
    WHOLE_TICK,
    counted_behind,
    timed_by_receipts,
)
from syncline_design.auditing.envelope import above_floor
from syncline_design.auditing.frames import FULL_SPEED_S, TICKS_S
from syncline_design.auditing.late_scatter import come_at_once, long_waits_of, waits_of
from syncline_design.auditing.result import FaultName, ResidualTime, StampFault
from syncline_design.auditing.series import Array, Series, seconds, spread
from syncline_design.machine.quick_dataclass import dataclass

LATE_OR_COARSE: Final = frozenset({"packetised", "truncated_stamps", "stamped_on_arrival"})
_FLOOR: Final = 48  # messages, of which the fastest hardly waits
_SAME: Final = 1e-3  # of a tick
_CLOCKS: Final = 5e-5  # that a sensor's clock and the host's differ by; crystals: 10 to 50 ppm


def residual_of(raw: Series, series: Series, faults: tuple[StampFault, ...]) -> ResidualTime:
    """Receipt minus stamp above its envelope, of a series without its named faults."""
    if series.receive is None or series.good.sum() < 2:
        return ResidualTime(None, None, None)
    drifts = any(f.fault == "drift" for f in faults)
    whole = tuple(f for f in faults if f.fault != "stamped_on_arrival" or f.from_s is None)
    restored = _restored(series, whole)
    if restored is None:
        return ResidualTime(None, None, None)
    left = above_floor(series.seconds[series.places()], restored.late, sloping=drifts)
    left += restored.unseen_s
    bound = float(left.max())
    recorded = max(bound, float(np.ptp(_recorded(raw, series))))
    return ResidualTime(bound, float(np.percentile(left, 95.0)), recorded)


@dataclass(frozen=True, slots=True, eq=False)
class _Restored:
    """Receipt minus stamp [s] of stamps put back to their sensor's rhythm; unseen_s: by how much
    more some may have waited for a tick."""

    late: Array
    unseen_s: float = 0.0


def _restored(series: Series, faults: tuple[StampFault, ...]) -> _Restored | None:
    """Receipt minus stamp, stamps of a coarse or late clock put back to their sensor's rhythm.

    None where stamps are arrivals and no rhythm says of what: how late they are is not known.
    """
    assert series.receive is not None
    places = series.places()
    whole = (series.receive - series.stamp)[places]
    late = seconds(whole - whole.min())
    names = {f.fault for f in faults}
    if not names & LATE_OR_COARSE:
        return _Restored(late)
    when = seconds(series.stamp[places] - series.stamp[places[0]])
    tick_s = _tick_of(faults)
    rhythm = _of_coarse(series, when, tick_s, names) if tick_s > 0.0 else None
    if rhythm is None:
        rhythm = _rhythm(when, cadence(series), tick_s)
        if "packetised" not in names and rhythm is not None and tick_s > 0.0:  # cut off, no later
            rhythm = rhythm if float(np.ptp(when - rhythm)) < WHOLE_TICK * tick_s else None
    if rhythm is not None:
        held_s = _timer_of(tick_s) if "packetised" in names else _frame_of(faults)
        unseen_s = _unseen(when - rhythm, when, held_s)
        return _Restored(np.asarray(late + when - rhythm), unseen_s)
    return None if names & {"packetised", "stamped_on_arrival"} else _Restored(late)


def _unseen(waits: Array, when: Array, tick_s: float) -> float:
    """By how much waits for a chip's timer or a bus's frame may differ more than they seem to [s].

    Where a sensor's interval is a simple part or multiple of the tick its messages come at a few
    places of it, and the sensor's clock may move within what lies between them without a trace.
    """
    return min(max(0.0, tick_s - float(np.ptp(waits))), _CLOCKS * float(when[-1]))


def _timer_of(tick_s: float) -> float:
    """The length of packets that a chip's timer or a bus's frame makes [s]; 0 of others, which are
    of whole numbers of messages that no clock moves."""
    timers = (*TICKS_S, FULL_SPEED_S)
    return tick_s if min(abs(tick_s / timer - 1.0) for timer in timers) <= _SAME else 0.0


def _tick_of(faults: tuple[StampFault, ...]) -> float:
    """By how much packets or a grid make stamps late [s]; 0 of others."""
    for fault in faults:
        if fault.fault in ("packetised", "truncated_stamps"):
            size = fault.parameters.get("interval_s") or fault.parameters["resolution_s"]
            return float(size)
    return 0.0


def _frame_of(faults: tuple[StampFault, ...]) -> float:
    """The frames of a bus at whose ends messages were stamped [s]; 0 of others."""
    whole = [f for f in faults if f.fault == "stamped_on_arrival" and f.from_s is None]
    return max((float(f.parameters.get("interval_s") or 0.0) for f in whole), default=0.0)


def _of_coarse(series: Series, when: Array, tick_s: float, names: set[FaultName]) -> Array | None:
    """When messages with stamps in packets, or on a grid, were measured, each counted."""
    count = counted_behind(series, names, tick_s)
    if count is None:
        return None
    if "packetised" in names:
        count = timed_by_receipts(count, series)
    waits = count.waits(when)
    return np.asarray(when - waits) if float(np.ptp(waits)) < WHOLE_TICK * tick_s else None


def _rhythm(when: Array, pace: Cadence, tick_s: float) -> Array | None:
    """When a regular sensor measured, from its own mean rhythm; None of an irregular one."""
    if when.size < 40 or when[-1] <= 0.0:
        return None
    over = None if come_at_once(when) else counted_over_gaps(when)  # else nothing is missing
    ways = [np.arange(when.size, dtype=np.float64) if over is None else over]
    if pace.regular and 2.0 * tick_s < pace.period_s:  # with losses counted
        ways.append(np.concatenate([[0.0], np.cumsum(pace.steps)]))
    for counts in ways:
        first, mean = np.polynomial.polynomial.polyfit(counts, when, 1)
        even = np.asarray(first + mean * counts)
        grain = float(np.percentile(np.diff(when), 99.0))
        if float(np.ptp(when - even)) < 2.0 * grain + 2.0 * float(mean):
            return even
        if _keeps_to(when, even):
            return even
    return None


def _keeps_to(when: Array, even: Array) -> bool:
    """Whether messages that wait for longer than an interval keep to a line: their floor does."""
    waits = waits_of(when) or long_waits_of(when)
    if waits is None:
        return False
    away = (when - even)[: when.size // _FLOOR * _FLOOR].reshape(-1, _FLOOR)
    return float(spread(away.min(axis=1))) < spread(waits.about_s)


def _recorded(raw: Series, series: Series) -> Array:
    """Receipt minus stamp as the file has them, of the messages in use [s]."""
    assert raw.receive is not None
    whole = (raw.receive - raw.stamp)[series.good]
    return seconds(whole - whole.min())
