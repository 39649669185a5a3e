"""Evidence of stamps: what an audit of messages says of a sensor's timestamping."""

from __future__ import annotations

from typing import Final

from syncline_design.auditing.result import Audit, StreamAudit
from syncline_design.comparison.acceptance import MeasuredFigure
from syncline_design.comparison.assumptions import Assumed
from syncline_design.comparison.judgement import Judgement
from syncline_design.model.quantity import format_duration

_LATE: Final = "stamped_on_arrival"  # as a design may mean it


def by_stamps(one: Assumed, found: Audit) -> Judgement | None:
    """Of the stream that plays the role, if one does: a fault breaks its timing.

    Receipt minus stamp holds transport too: it can bear a bound out, never break it alone.
    """
    stream = next((s for s in found.streams if s.role == f"{one.stage}.{one.role}"), None)
    if stream is None or one.value is None:
        return None
    faults = [f for f in stream.faults if f.counts and not (one.on_arrival and f.fault == _LATE)]
    late = any(fault.fault == _LATE for fault in stream.faults)
    size = stream.residual_s.as_recorded if late else stream.residual_s.bound
    if faults:
        jumps = [v for f in faults for k, v in f.parameters.items() if k == "seconds"]
        sizes = [abs(v) for v in jumps if isinstance(v, float)]
        figure = MeasuredFigure(max(sizes)) if sizes else None
        words = "; ".join(f"{fault.fault}: {fault.evidence}" for fault in faults)
        return Judgement("broken", f"stream {stream.name}: {words}", figure)
    if stream.stamps.secondary is None or size is None:
        return Judgement("not_shown", f"stream {stream.name} has one time a message")
    return _sound(one.value, stream, abs(stream.offset_s or 0.0) + size)


def _sound(bound_s: float, stream: StreamAudit, size: float) -> Judgement:
    """size: the longest time between a stamp and its receipt, which bounds the stamp's error."""
    seen, asked = format_duration(size), format_duration(bound_s)
    lead = f"stream {stream.name} is sound; receipts come within {seen} of their stamps"
    if size <= bound_s:
        return Judgement("holds", f"{lead}, and {asked} are assumed",
                         MeasuredFigure(size))  # fmt: skip
    return Judgement("not_shown", f"{lead}, transport included: more than the {asked} assumed",
                     MeasuredFigure(size))  # fmt: skip
