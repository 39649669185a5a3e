"""Evidence of stamps: what an audit of messages says of a sensor's timestamping."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Final

from syncline_design.auditing.result import Audit, StampFault, StreamAudit
from syncline_design.auditing.stream import is_receipt
from syncline_design.comparison.acceptance import MeasuredFigure
from syncline_design.comparison.assumptions import Assumed
from syncline_design.comparison.by_clock import LONGER
from syncline_design.comparison.judgement import Judgement
from syncline_design.model.figure_text import format_duration, to_digits

# faults of the recorder and of the way to it, not of the stamps
_ON_THE_WAY: Final = (
    "recorder_clock", "wrong_receipts", "batched_by_recorder", "lost_messages", "gap", "duplicates",
)  # fmt: skip
_LATE: Final = "stamped_on_arrival"  # as a design may mean it
# Messages of which the worst one is, with 95 % confidence, beyond 95 % of all: 0.95^59 < 0.05
# (Wilks, Ann. Math. Stat. 12, 1941); fewer bear no bound out.
LEAST_MESSAGES: Final = 59
ENDED: Final = 0.95  # of the log: what stops before that has stopped


def by_stamps(one: Assumed, found: Audit, horizon_s: float) -> Judgement | None:
    """Of the stream that plays the role, if one does: a fault breaks its timing.

    Receipt minus stamp holds transport too: it can bear a bound out, never break it alone.
    horizon_s: for how long the spec's clocks have to keep their bounds.
    """
    stream = next((s for s in found.streams if s.role == f"{one.stage}.{one.role}"), None)
    if stream is None or one.value is None:
        return None
    faults = [f for f in stream.faults if f.counts and not (one.on_arrival and f.fault == _LATE)]
    own = [_going_on(f, stream) for f in faults if f.fault not in _ON_THE_WAY]
    if faults:
        words = "; ".join(f"{f.fault}: {f.evidence}" for f in own or faults)
        words += _over_horizon(own, stream, horizon_s)
        if own and _within(own, stream, one.value, horizon_s):
            beyond = _beyond(own, stream, horizon_s)
            apart = _apart(stream, _recorded(own, stream, horizon_s), beyond)
            return _sound(one.value, stream, apart, horizon_s, own, words)
        if own:
            return Judgement("broken", f"stream {stream.name}: {words}", _figure(own, horizon_s))
        return Judgement("not_shown", f"stream {stream.name}: its receipts say nothing: {words}")
    late = any(fault.fault == _LATE for fault in stream.faults)
    size = stream.residual_s.as_recorded if late else stream.residual_s.bound
    if not is_receipt(stream.stamps.secondary) or size is None:
        return Judgement("not_shown", f"stream {stream.name} {_lacks(stream)}")
    return _sound(one.value, stream, _apart(stream, size), horizon_s)


def _lacks(stream: StreamAudit) -> str:
    """Why nothing is known of its receipts."""
    first, second = stream.stamps.primary, stream.stamps.secondary
    if second is None or first is None:
        return "has one time a message"
    if is_receipt(second):
        return "keeps no rhythm that would tell how late its stamps on arrival are"
    return (f"has two times a message, {first} and {second}, which one clock told, and no receipt: "
            "it cannot be held against itself")  # fmt: skip


def _apart(stream: StreamAudit, size: float, beyond: float = 0.0) -> float:
    """The longest time between a stamp and its receipt, either way.

    Receipt minus stamp goes from that of the fastest message to `size` above it; of stamps ahead of
    their receipts the fastest message is the worst one.  beyond: by how much that one is ahead
    because the log goes on for longer than is promised.
    """
    fastest = -(stream.offset_s or 0.0) + beyond
    return max(abs(fastest), abs(fastest + size))


def _recorded(faults: Sequence[StampFault], stream: StreamAudit, horizon_s: float) -> float:
    """The longest time between stamp and receipt with every fault in it, a drift's over the
    horizon: it goes on after a log, and a longer log has more of it than is promised."""
    if any(map(_drifts, faults)):
        bound = stream.residual_s.bound
        return math.inf if bound is None else bound + _together(faults, horizon_s)
    size = stream.residual_s.as_recorded
    return math.inf if size is None else size


def _beyond(faults: Sequence[StampFault], stream: StreamAudit, horizon_s: float) -> float:
    """How far stamps run ahead of their receipts after the horizon [s]."""
    lasts_s = max((stream.duration_s or 0.0) - horizon_s, 0.0)
    rates = (fault.parameters["ppm"] for fault in faults if _drifts(fault))
    return sum(max(rate, 0.0) * 1e-6 * lasts_s for rate in rates if isinstance(rate, float))


def _going_on(fault: StampFault, stream: StreamAudit) -> StampFault:
    """A drift that the end of the log alone ends has none: it grows on."""
    ends = fault.to_s is not None and fault.to_s < ENDED * (stream.duration_s or 0.0)
    return fault if ends or "ppm" not in fault.parameters else replace(fault, to_s=None)


def _drifts(fault: StampFault) -> bool:
    """Whether it grows all along the log, and so beyond."""
    return "ppm" in fault.parameters and fault.to_s is None


def _over_horizon(faults: Sequence[StampFault], stream: StreamAudit, horizon_s: float) -> str:
    """What a drift comes to over the spec's horizon, be the log longer or shorter than that."""
    drifts = filter(_drifts, faults)
    grown_s = max((size for one in drifts for size in _sizes(one, horizon_s)), default=0.0)
    if not grown_s or math.isclose(horizon_s, stream.duration_s or 0.0, rel_tol=LONGER - 1.0):
        return ""
    return (f"; that makes {format_duration(grown_s)} over the spec's horizon of "
            f"{format_duration(horizon_s)}")  # fmt: skip


def _within(
    faults: Sequence[StampFault], stream: StreamAudit, bound_s: float, horizon_s: float
) -> bool:
    """Whether faults keep the bound as long as the horizon lasts, drifts grown to that.

    Receipts hold transport too: by them alone nothing is beyond a bound.
    """
    return (
        all(any(True for _ in _sizes(fault, horizon_s)) for fault in faults)
        and all(size <= bound_s for fault in faults for size in _sizes(fault, horizon_s))
        and min(_together(faults, horizon_s), _recorded(faults, stream, horizon_s)) <= bound_s
    )


def _together(faults: Sequence[StampFault], horizon_s: float) -> float:
    """The most that stamps are off by at any time, with every fault that has begun by then."""
    moved, highest, lowest, others = 0.0, 0.0, 0.0, 0.0
    for fault in sorted(faults, key=lambda one: one.from_s or 0.0):
        by = fault.parameters.get("seconds")
        if isinstance(by, float):
            moved += by
            highest, lowest = max(highest, moved), min(lowest, moved)
        others += sum(_sizes(fault, horizon_s)) - (abs(by) if isinstance(by, float) else 0.0)
    return highest - lowest + others


def _figure(faults: Sequence[StampFault], horizon_s: float) -> MeasuredFigure | None:
    """How far off stamps are by the worst of their faults; None where none has a size in time."""
    sizes = [size for fault in faults for size in _sizes(fault, horizon_s)]
    return MeasuredFigure(max(sizes)) if sizes else None


def _sizes(fault: StampFault, horizon_s: float) -> Iterator[float]:
    """Times that stamps are off by [s]: of a drift what it grows to while it lasts, or in the
    horizon."""
    if "ppm" in fault.parameters:
        lasts_s = horizon_s if fault.to_s is None else fault.to_s - (fault.from_s or 0.0)
        yield _fastest_ppm(fault) * 1e-6 * min(lasts_s, horizon_s)
    for key in ("seconds", "interval_s"):
        value = fault.parameters.get(key)
        if isinstance(value, float):
            yield abs(value)


def _fastest_ppm(fault: StampFault) -> float:
    """Of a drift, at any time; 0 of what does not drift."""
    rates = (fault.parameters.get(key, 0.0) for key in ("ppm", "ppm_low", "ppm_high"))
    return max(abs(rate) for rate in rates if isinstance(rate, float))


def _sound(
    bound_s: float,
    stream: StreamAudit,
    size: float,
    horizon_s: float,
    faults: Sequence[StampFault] = (),
    but: str = "",
) -> Judgement:
    """size: the longest time between a stamp and its receipt: so much too early stamps can be.

    faults: smaller than what is assumed; but: the same in words.

    How late stamps come by turns shows against the sensor's rhythm alone, as receipts come after
    them whatever they were late by.  A delay before a stamp that is constant shows in neither; that
    is what `latency` asks.
    """
    uneven = stream.uneven_s
    most = size if uneven is None else max(size, uneven)
    state = f"stays within what is assumed ({but})" if but else "is sound"
    figure = MeasuredFigure(most, 0.0, most)
    lead = (f"stream {stream.name} {state}; receipts come within {format_duration(size)} of their "
            "stamps")  # fmt: skip
    if uneven is not None:
        lead += f", which keep an even rhythm within {format_duration(uneven)}"
    drift_ppm = max(map(_fastest_ppm, faults), default=0.0)
    why = _why_not(bound_s, stream, size, (horizon_s, drift_ppm))
    if why:
        return Judgement("not_shown", lead + why, figure)
    return Judgement("holds", f"{lead}, and {format_duration(bound_s)} are assumed; a constant "
                     "delay before the stamp was taken would not show here (`latency`)", figure
                     )  # fmt: skip


def _why_not(bound_s: float, stream: StreamAudit, size: float, over: tuple[float, float]) -> str:
    """Why a stream without a fault beyond the bound does not bear it out; "" where it does."""
    asked, uneven = format_duration(bound_s), stream.uneven_s
    if stream.copied:
        return ("; but for a constant and the file's rounding the receipts are copies of the "
                "stamps, and no second time: record when each message arrives")  # fmt: skip
    if stream.messages < LEAST_MESSAGES:
        return f", but {stream.messages} messages bear no bound out: {LEAST_MESSAGES} are needed"
    if size > bound_s:
        return f"; transport included, that is more than the {asked} assumed"
    if uneven is None:
        return (", but they keep no even rhythm, so that a stamp that was taken late, near its "
                "receipt, would not show: a log of its clock would tell")  # fmt: skip
    if uneven > bound_s:
        return (f", more than the {asked} assumed: late stamps or a sensor that measures unevenly, "
                "receipts follow both")  # fmt: skip
    return _too_short(bound_s, stream, *over)


def _too_short(bound_s: float, stream: StreamAudit, horizon_s: float, drift_ppm: float) -> str:
    """Why a log is too short for the spec's horizon: a drift that it would not have shown.

    drift_ppm: what did show, which may be more by as much.
    """
    lasts_s, least = stream.duration_s or 0.0, stream.smallest_seen.drift_ppm
    if horizon_s <= LONGER * lasts_s:
        return ""
    lasts, over = format_duration(lasts_s), format_duration(horizon_s)
    asked = format_duration(bound_s)
    if least is None:
        return f", but {lasts} are too short to show a drift, and the spec's horizon is {over}"
    grown_s = least * 1e-6 * horizon_s
    if grown_s + drift_ppm * 1e-6 * horizon_s <= bound_s:
        return ""
    if drift_ppm:
        return (f", but in {lasts} {to_digits(least, 2)} ppm more do not show, and over the spec's "
                f"horizon of {over} both make more than the {asked} assumed: a longer log would "
                "tell")  # fmt: skip
    return (f", but in {lasts} a drift of less than {to_digits(least, 2)} ppm does not show, which "
            f"makes {format_duration(grown_s)} over the spec's horizon of {over}, more than the "
            f"{asked} assumed: a longer log would show it")  # fmt: skip
