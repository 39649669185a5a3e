"""The epoch of a stream beside its other faults: declared, of a counter, of a stretch only."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from syncline_design.auditing.epochs import LARGE_SLIP_S, epoch_fault
from syncline_design.auditing.result import Consequence, StampFault
from syncline_design.auditing.series import Array, Mask, Series, seconds
from syncline_design.auditing.shifts import Shifts
from syncline_design.logs.readers.stream import Stamps, Stream

_NONE: Final = Stamps("", None, np.zeros(0, np.int64))
# epochs of a counter without a calendar
_COUNTERS: Final = ("boot", "unknown", "week_seconds", "day_seconds", "hour_seconds")


def as_declared(epoch: StampFault | None, stream: Stream) -> StampFault | None:
    """GPS time where the format says GPS time is no fault."""
    declared = stream.timeline == "gps" and "gps" in (stream.stamps or _NONE).primary.lower()
    if epoch is None or not declared or epoch.parameters["kind"] != "gps":
        return epoch
    return replace(epoch, counts=False, evidence=f"{epoch.evidence}, as the format says")


def with_epoch(found: list[StampFault], epoch: StampFault | None) -> list[StampFault]:
    """The epoch beside the others; a counter that wraps has none, so that is its consequence."""
    if epoch is None:
        return found
    wraps = [f for f in found if f.fault == "counter_wrap"]
    if not wraps or epoch.parameters["kind"] not in _COUNTERS:
        return [*found, epoch]
    follows = Consequence("epoch_offset", epoch.parameters, epoch.evidence)
    whole = replace(wraps[0], consequences=(*wraps[0].consequences, follows))
    return [whole if f is wraps[0] else f for f in found]


def epoch_behind_shifts(epoch: StampFault | None, series: Series) -> StampFault | None:
    """The exact epoch that shows once steps and drifts are taken out, where they hid it.

    A stamp of the right epoch is hardly ahead of its receipt, so that a step or a drift forward
    takes the median of stamp minus receipt past the constant that it began with.
    """
    if epoch is not None and epoch.parameters["kind"] != "unknown":
        return None
    again = epoch_fault(series)
    return again if again is not None and known_offset(again, series, False) is not None else None


def as_epochs(
    slips: Shifts, series: Series, whole: StampFault | None
) -> tuple[Shifts, StampFault | None]:  # fmt: skip
    """Slips of many seconds are stretches of another epoch; the stretch without one is right.

    Returns them with the epoch of what was taken as the base.
    """
    times = series.seconds
    large = [f for f in slips.faults if abs(float(f.parameters["seconds"])) >= LARGE_SLIP_S]
    inside = [_within(f, times) for f in large]
    rest = series.good & ~np.logical_or.reduce(inside)
    base = epoch_fault(replace(series, good=rest))
    faults = [f for f in slips.faults if f not in large]
    right = base is None
    for slip, mask in zip(large, inside, strict=True):
        own = epoch_fault(replace(series, good=series.good & mask))
        if own is not None:
            faults.append(replace(own, from_s=slip.from_s, to_s=slip.to_s))
        elif base is None:
            faults.append(slip)
        right |= own is None
    if base is not None:
        ends = times[rest][[0, -1]]
        spans = (None, None) if not right or base is whole else (float(ends[0]), float(ends[1]))
        faults.append(replace(base, from_s=spans[0], to_s=spans[1]))
    return replace(slips, faults=tuple(faults)), base


def _within(fault: StampFault, times: Array) -> Mask:
    begin, end = fault.from_s or 0.0, fault.to_s or 0.0
    last = bool(end >= times[-1])
    return np.asarray((times >= begin) & ((times < end) | last))


def known_offset(epoch: StampFault | None, series: Series, unit: bool) -> float | None:
    """Stamp minus receipt that has a name [s]; None where the constant is of no known epoch."""
    if epoch is None:
        return None if unit or _far_off(series) else 0.0
    exact = ("tai", "gps", "tai_gps", "time_zone", "gps_epoch", "adjusted_gps", "ntp_epoch",
             "week_rollover")  # fmt: skip
    value = epoch.parameters.get("seconds")
    if epoch.parameters["kind"] in exact and isinstance(value, float):
        return value
    return None


def _far_off(series: Series) -> bool:
    if series.receive is None or not series.good.any():
        return True
    return abs(float(np.median(seconds((series.receive - series.stamp)[series.good])))) > 60.0
