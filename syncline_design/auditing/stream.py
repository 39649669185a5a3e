"""One stream: every fault is named and taken out before the next is looked for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from syncline_design.auditing import arrival, grains, order, scans
from syncline_design.auditing.blocks import Blocks
from syncline_design.auditing.cadence import (
    Cadence,
    cadence,
    level_scatter,
    missing,
)
from syncline_design.auditing.clock_shapes import Shape
from syncline_design.auditing.coarse_drift import drift_behind
from syncline_design.auditing.coarse_rhythm import counted_behind
from syncline_design.auditing.counters import unwrapped
from syncline_design.auditing.disorder import Disorder, disorder_of
from syncline_design.auditing.epochs import LARGE_SLIP_S, constant_fault, epoch_fault, in_one_unit
from syncline_design.auditing.levels import smallest
from syncline_design.auditing.lone_slips import without_lone_slips
from syncline_design.auditing.receipts import in_order_of_receipt, with_receipts_forward
from syncline_design.auditing.residual import LATE_OR_COARSE, residual_of
from syncline_design.auditing.result import (
    Consequence,
    EnvelopePoint,
    FaultName,
    ResidualTime,
    SmallestSeen,
    StampFault,
)
from syncline_design.auditing.series import NS, Series, seconds, series_of
from syncline_design.auditing.shifts import Shift, Shifts, without_shifts
from syncline_design.auditing.slips import without_slips
from syncline_design.auditing.sorted_receipts import put_where_measured
from syncline_design.auditing.stream_epochs import (
    as_declared,
    as_epochs,
    epoch_behind_shifts,
    known_offset,
    with_epoch,
)
from syncline_design.auditing.stuck import without_stuck
from syncline_design.auditing.tick_words import Paced, paced
from syncline_design.auditing.wild_times import without_wild_times
from syncline_design.auditing.wrong_receipts import without_wrong_receipts
from syncline_design.logs.readers.stream import UNSET, Nanoseconds, Stamps, Stream
from syncline_design.machine.deadline import in_force
from syncline_design.machine.quick_dataclass import dataclass

RECEIVED: Final = ("log time", "record", "receive", "capture", "arrival")
_SAMPLE: Final = 100_000  # messages that tell a resolution
_AT_EDGES: Final = 0.1  # of the messages that were overtaken
_STRAY: Final = 0.01
# what a stamp outside its scan follows from
_OFF: Final = frozenset({"ahead_of_receipt", "epoch_offset", "whole_second_slip"})
EDGE_S: Final = 1.5  # how near to the end of a shift a repeated stamp is its own
TRACE_POINTS: Final = 240
_COARSE: Final = 0.2  # of an interval: stamps of such grains are counted
_UNEVEN: Final = 0.1  # of an interval
_LARGE_STEP_NS: Final = 1e6


@dataclass(frozen=True, slots=True, eq=False)
class Examined:
    """A stream and all that its own stamps say; shifts: to be held against other streams.

    raw: as recorded, in the order of measurement.  whole: the same with stamps of one unit, and
    counters made continuous.
    """

    stream: Stream
    raw: Series
    whole: Series
    series: Series  # every named fault taken out
    faults: tuple[StampFault, ...]
    shifts: tuple[Shift, ...]
    pace: Cadence
    offset_s: float | None
    residual: ResidualTime
    smallest: SmallestSeen
    trace: tuple[EnvelopePoint, ...]
    constant_s: float | None  # latency, or a clock that is wrong: stamps cannot tell
    blocks: Blocks | None = None  # levels of receipt minus stamp, without jumps of the stamps' own
    seen: tuple[Shape, ...] = ()  # in these levels
    breathing_s: float = 0.0  # of receipts, while the stamps keep their rhythm
    overtaken: Disorder = Disorder()  # messages that came after later ones
    copied: bool = False  # receipts are the stamps once more
    hidden: arrival.Hidden | None = None  # what stamps on arrival could hide here
    undecided: tuple[str, ...] = ()  # what its stamps may have done, or transport


def examined(stream: Stream, start: int | None = None) -> Examined:
    """All faults of one stream; start: receipt of the run's first message [ns]."""
    in_force().check()
    stamps = stream.stamps
    assert stamps is not None
    found: list[StampFault] = []
    recorded = put_where_measured(series_of(stamps.primary_ns, _receipts(stamps), start))
    recorded = _take(without_wild_times(recorded), found)
    raw = in_order_of_receipt(_with_wild_ones(without_wrong_receipts(recorded), found))
    series, unit, step_ns = _in_one_unit(raw, found, stamps.primary_factor)
    series = _take(without_lone_slips(series), found)
    series = _take(without_stuck(series), found)
    disorder = disorder_of(series)
    series = disorder.put(series)
    if disorder.fault is None:
        raw = disorder.put(raw)
    else:
        found.append(disorder.fault)
    told = series.stamp
    series = _continuous(series, disorder, found)
    continuous = replace(series, receive=raw.receive)
    grain, ticks = _grain(series, told, step_ns, found)
    series = _without_arrivals(series, grain, step_ns, found)
    spikes = order.without_spikes(series)
    series = _take(_beside(disorder, spikes), found)
    epoch = None if unit else epoch_fault(series)
    found[:] = with_epoch(found, as_declared(epoch, stream))
    known = known_offset(epoch, series, unit is not None)
    slips = without_slips(series, known)
    if any(abs(float(f.parameters["seconds"])) >= LARGE_SLIP_S for f in slips.faults):
        slips, base = as_epochs(slips, series, epoch)
        found = [f for f in found if f is not epoch]
        known = known_offset(base, slips.series, False)
    even, turning_s = grains.without_turns(slips.series, cadence(slips.series))
    slips = replace(slips, series=slips.series if grain else even)
    known_s = grain.size_s if grain is not None else arrival.frame_of(slips.series)
    known_s = known_s or grains.may_be_cut(slips.series, cadence(slips.series))
    least = max(_coarse(raw), step_ns / NS, known_s, turning_s)
    moved = _but_for_turns(without_shifts(slips.series, least_s=least), found, told)
    if grain is not None and not any(f.fault == "drift" for f in moved.faults):
        names = {f.fault for f in found}
        series, slow = drift_behind(moved.series, names, grain.size_s, _coarse(raw))
        moved = replace(moved, series=series, faults=(*moved.faults, *slow))
    series = moved.series
    again = None if unit else epoch_behind_shifts(epoch, series)
    if again is not None and moved.faults:
        found[:] = with_epoch([f for f in found if f is not epoch], as_declared(again, stream))
        known = known_offset(again, series, False)
    pace = cadence(series)
    found = _with_jumps(found, [*slips.faults, *moved.faults], pace.period_s)
    _last((slips.series, series), pace, stream, known, grain, found)
    found = [f for f in found if not _at_edges(f, disorder)]
    hidden = None if _late_or_coarse(found) else arrival.hidden_in(series, pace, ticks)
    found, hidden = arrival.but_for_left_out(found, hidden, pace)
    one = _summed(stream, (raw, continuous, series), pace, found, (slips, moved), known)
    return replace(one, overtaken=disorder, copied=_copied(one), hidden=hidden)


def _without_arrivals(
    series: Series, grain: grains.Grain | None, step_ns: float, found: list[StampFault]
) -> Series:
    """Without stamps that were given on arrival, where some were, and without duplicates."""
    part = None if grain else arrival.arrived_in_part(series, cadence(series))
    arrived = None if grain or part else arrival.stamped_on_arrival(series, cadence(series))
    if part is not None:
        found.append(part.fault)
        own = ~np.isin(np.arange(series.good.size), part.places)
        series = replace(series, good=series.good & own)
    if arrived is not None:
        found.append(_with_alike(series, arrived))
        return series
    if step_ns >= _LARGE_STEP_NS:  # duplicates are the unit's
        return order.without_duplicates(series).series
    if grain is None or not grain.explains_duplicates:
        return _take(order.without_duplicates(series), found)
    return series


def _late_or_coarse(found: Sequence[StampFault]) -> bool:
    """Whether stamps are known to be of arrivals, of packets or of a grid."""
    return bool({f.fault for f in found} & LATE_OR_COARSE)


def _receipts(stamps: Stamps) -> Nanoseconds | None:
    """The second time where another clock told it: one clock cannot be held against itself."""
    second = stamps.secondary_ns
    told = is_receipt(stamps.secondary) and second is not None and bool(np.any(second != UNSET))
    return second if told else None


def is_receipt(name: str | None) -> bool:
    """Whether a time of this name was told by what received a message."""
    return name is not None and name.replace("_", " ").lower().startswith(RECEIVED)


def _in_one_unit(
    raw: Series, found: list[StampFault], factor: float
) -> tuple[Series, StampFault | None, float]:
    """Unset stamps left out, receipts of a clock that was set put forward, one unit."""
    series = _take(order.without_unset(raw), found)
    series = _take(with_receipts_forward(series), found)
    unit = in_one_unit(series, factor)
    if unit.fault is not None:
        found.append(unit.fault)
    return unit.series, unit.fault, unit.step_ns


def _continuous(series: Series, disorder: Disorder, found: list[StampFault]) -> Series:
    """Counters made continuous; a wrong stamp among them counts no turn and takes that of the
    message before it."""
    whole = unwrapped(disorder.without_wrong(series))
    found += whole.faults
    places = whole.series.places()
    if not places.size:
        return series
    before = np.searchsorted(places, np.arange(series.stamp.size), "right") - 1
    turned = (whole.series.stamp - series.stamp)[places[np.maximum(before, 0)]]
    mended = replace(series, stamp=np.where(series.good, series.stamp + turned, series.stamp))
    if disorder.order is None or disorder.wrong is None:
        return mended  # in their place, where they show by themselves
    return _take(order.without_wrong(mended, disorder.wrong), found)


def _with_wild_ones(left: order.Repaired, found: list[StampFault]) -> Series:
    """Without messages whose times are wild; wrong receipts of both ways of telling are one."""
    for fault in left.faults:
        alike = next((f for f in found if f.fault == fault.fault == "wrong_receipts"), None)
        if alike is None:
            found.append(fault)
            continue
        count = float(alike.parameters["count"]) + float(fault.parameters["count"])
        span = [t for f in (alike, fault) for t in (f.from_s, f.to_s) if t is not None]
        sizes = [float(f.parameters["seconds"]) for f in (alike, fault)]
        parts: dict[str, float | str] = {"count": count, "seconds": max(sizes, key=abs)}
        found[found.index(alike)] = replace(
            alike, parameters=parts, from_s=min(span), to_s=max(span),
            evidence=f"{alike.evidence}; {fault.evidence}",
        )  # fmt: skip
    return left.series


def _take(repaired: order.Repaired, found: list[StampFault]) -> Series:
    found += repaired.faults
    return repaired.series


def _beside(disorder: Disorder, spikes: order.Repaired) -> order.Repaired:
    """Stamps out of order, where they are more than where a clock is set while messages overtake
    one another, and not of those that were put in order."""
    few = sum(float(f.parameters["count"]) for f in spikes.faults) < _AT_EDGES * disorder.falls
    return replace(spikes, faults=()) if few and disorder.by_rhythm else spikes


def _copied(one: Examined) -> bool:
    """Whether every receipt equals its stamp though nothing was stamped on arrival."""
    raw = one.raw
    alike = raw.receive is not None and bool(np.array_equal(raw.stamp, raw.receive))
    return alike and not any(f.fault == "stamped_on_arrival" for f in one.faults)


def _at_edges(fault: StampFault, disorder: Disorder) -> bool:
    """Losses that are so few that they may be messages put in order where a clock was set."""
    lost = fault.fault == "lost_messages" and disorder.by_rhythm
    return lost and float(fault.parameters["count"]) < _STRAY * disorder.falls


def _grain(
    series: Series, told: Nanoseconds, step_ns: float, found: list[StampFault]
) -> tuple[grains.Grain | None, Paced | None]:
    series = without_slips(series, None).series  # whole seconds are no whole number of ticks
    pace = cadence(series)
    grain = grains.truncated(series, pace, step_ns, told)
    ticks = paced(series, pace.places)
    grain = grain or grains.packetised(series, pace, step_ns, ticks)
    if grain is not None:
        found.append(grain.fault)
    return grain, ticks


def _with_alike(series: Series, arrived: StampFault) -> StampFault:
    """Stamps of messages that came at once follow from being stamped on arrival."""
    alike = order.without_duplicates(series).faults
    follows = tuple(Consequence("duplicates", f.parameters, f.evidence) for f in alike)
    return replace(arrived, consequences=follows)


def _with_jumps(
    found: list[StampFault], jumps: list[StampFault], period_s: float
) -> list[StampFault]:
    """Shifts beside what was found; a stamp that comes twice where one sets stamps back by an
    interval is its consequence."""
    twice = [f for f in found if f.fault == "duplicates"]
    back = [(f.from_s, float(f.parameters.get("seconds", 0.0))) for f in jumps]
    back += [(f.to_s, -size) for f, (_, size) in zip(jumps, back, strict=True)]
    edges = [at for at, size in back if at is not None and abs(size + period_s) < 0.5 * period_s]
    if not twice or not edges or float(twice[0].parameters["count"]) > len(edges):
        return [*found, *jumps]
    near = [min(abs(e - at) for e in edges) for at in (twice[0].from_s, twice[0].to_s)
            if at is not None]  # fmt: skip
    if max(near) > EDGE_S:
        return [*found, *jumps]
    follows = Consequence("duplicates", twice[0].parameters, twice[0].evidence)
    first = replace(jumps[0], consequences=(*jumps[0].consequences, follows))
    return [*(f for f in found if f is not twice[0]), first, *jumps[1:]]


def _coarse(raw: Series) -> float:
    """Resolution of the receipts [s]: smaller shifts may be theirs."""
    if raw.receive is None or raw.receive.size < 20:
        return 0.0
    return grains.grain_of(raw.receive[:_SAMPLE]) / NS


def _but_for_turns(moved: Shifts, found: list[StampFault], told: Nanoseconds) -> Shifts:
    """Without steps of less than a grain that come of a counter whose range is no whole number of
    the grains that its stamps are cut off to."""
    grain = grains.grain_of(told)
    turns = [f.parameters["wrap_s"] for f in found if f.fault == "counter_wrap"]
    if not grain or all(round(float(turn) * NS) % grain == 0 for turn in turns):
        return moved
    kept = [
        f for f in moved.faults
        if f.fault != "step" or abs(float(f.parameters["seconds"])) * NS > grain
    ]  # fmt: skip
    return replace(moved, faults=tuple(kept))


def _last(
    states: tuple[Series, Series], pace: Cadence, stream: Stream, known: float | None,
    grain: grains.Grain | None, found: list[StampFault],
) -> None:  # fmt: skip
    """What is looked for once everything else is taken out; states: the series with its shifts
    and without."""
    shifted, series = states
    names = {fault.fault for fault in found}
    packets = "packetised" in names
    coarse = grain is not None and (packets or grain.size_s > _COARSE * pace.period_s)
    count = counted_behind(series, names, grain.size_s) if grain is not None and coarse else None
    arrived_so = [f for f in found if f.fault == "stamped_on_arrival" and f.from_s is None]
    late = any(_blurs(f, pace) for f in found if f.fault == "stamped_on_arrival")
    blurred = late or (coarse and count is None)
    shown = replace(pace, regular=False) if packets and count is None else pace  # holes alone
    found += missing(
        series, shown, level_scatter(series), blurred=blurred, count=count, arrived=bool(arrived_so)
    )
    if not names & LATE_OR_COARSE:
        arrived = arrival.stamped_on_arrival(series, pace)
        found += [arrived] if arrived is not None else []
    if known is not None:
        found += _constant(series, known, grain.size_s if grain else _coarse(series), names)
    found[:] = _with_ahead(found)
    explained = names & {"whole_second_slip", "counter_wrap", "step", "relock"}
    fall = None if explained else order.remaining_falls(shifted, series)
    found += [fall] if fall is not None and "backward_jump" not in names else []
    scan = scans.scan(series, stream.points, pace.period_s)
    if scan is not None and not (scan.counts and {f.fault for f in found} & _OFF):
        found.append(scan)


def _with_ahead(found: Sequence[StampFault]) -> list[StampFault]:
    """Stamps after their receipts follow from a clock that wanders at least as far."""
    ahead = next((f for f in found if f.fault == "ahead_of_receipt"), None)
    wanders = next((f for f in found if f.parameters.get("kind") == "wandering"), None)
    if ahead is None or wanders is None:
        return list(found)
    if float(ahead.parameters["seconds"]) > float(wanders.parameters["span_s"]):
        return list(found)
    follows = Consequence("ahead_of_receipt", ahead.parameters, ahead.evidence)
    caused = replace(wanders, consequences=(*wanders.consequences, follows))
    return [caused if f is wanders else f for f in found if f is not ahead]


def _blurs(arrived: StampFault, pace: Cadence) -> bool:
    """Whether arrivals are so uneven that a late message looks as a lost one."""
    frame = float(arrived.parameters.get("interval_s", 0.0))
    return max(pace.jitter_s, frame) > _UNEVEN * pace.period_s


def _constant(
    series: Series, known: float, resolution_s: float, names: set[FaultName]
) -> list[StampFault]:  # fmt: skip
    """A constant without a name, or stamps after their receipts."""
    constant = constant_fault(series, known)
    if constant is not None:
        return [constant]
    ahead = arrival.ahead(series, known, resolution_s)
    # where these begin is not known to the last us
    moves = names & {"drift", "step", "relock", "recorder_clock"}
    return [ahead] if ahead is not None and (not moves or ahead.from_s is None) else []


def _summed(
    stream: Stream, states: tuple[Series, Series, Series], pace: Cadence, found: list[StampFault],
    moved: tuple[Shifts, Shifts], known: float | None,
) -> Examined:  # fmt: skip
    """Everything that was found, with what is left of the delays; states: the series as recorded,
    made continuous, and without its faults."""
    raw, whole, series = states
    told = series.receive is not None and series.good.sum() > 1
    constant = None
    if told and known is not None:
        late = seconds((series.receive - series.stamp)[series.places()])  # type: ignore[operator]
        constant = float(np.min(late)) + known
    faults = tuple(found)
    return Examined(
        stream, raw, whole, series, faults, (*moved[0].shifts, *moved[1].shifts), pace,
        _offset(raw, series), residual_of(raw, series, faults), _smallest(moved[1]),
        _trace(raw) if told else (), constant, moved[1].blocks, moved[1].seen, moved[1].breathing_s,
    )  # fmt: skip


def without_clock_step(one: Examined, shift: Shift) -> Examined:
    """The stream with its receipts put back by a step of the recorder's clock."""
    series = one.series
    assert series.receive is not None
    after = series.seconds >= shift.at_s
    receive = series.receive - np.where(after, round(shift.size_s * NS), 0)
    put_back = replace(series, receive=receive)
    return replace(one, series=put_back, residual=residual_of(one.raw, put_back, one.faults))


def _smallest(moved: Shifts) -> SmallestSeen:
    blocks = moved.blocks
    if blocks is None:
        return SmallestSeen(None, None)
    step, over = smallest(blocks)
    length = float(blocks.time_s[-1] - blocks.time_s[0])
    if not np.isfinite(step) or length <= 0.0:
        return SmallestSeen(None, None)
    return SmallestSeen(max(step, moved.hidden_s), 1e6 * max(over, moved.beat_s) / length)


def _offset(raw: Series, series: Series) -> float | None:
    """Stamp minus receipt of the fastest message as the file has it [s], but for those that were
    left out, of which one alone may be far off."""
    told = raw.good & series.good if bool(np.any(raw.good & series.good)) else raw.good
    if raw.receive is None or not told.any():
        return None
    return float(seconds(np.max((raw.stamp - raw.receive)[told])))


def _trace(raw: Series) -> tuple[EnvelopePoint, ...]:
    """Receipt minus stamp over time: least and largest of each stretch, without the median."""
    assert raw.receive is not None
    places = raw.places()
    if places.size < 2:
        return ()
    late = seconds((raw.receive - raw.stamp)[places])
    late = late - float(np.median(late))
    times = raw.seconds[places]
    parts = np.array_split(np.arange(places.size), min(TRACE_POINTS, places.size))
    return tuple(
        EnvelopePoint(float(times[p].mean()), float(late[p].min()), float(late[p].max()))
        for p in parts
    )  # fmt: skip
