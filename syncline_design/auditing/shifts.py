"""Names for how an offset moves: steps, drift, a lock that settles.

A shift counts as the stamps' own where the rhythm of a regular sensor shows it too; where the
stamps keep their rhythm and receipts move, it is the recorder or transport.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from syncline_design.auditing import witness
from syncline_design.auditing.blocks import Blocks, blocks_of
from syncline_design.auditing.cadence import Cadence, cadence
from syncline_design.auditing.clock_shapes import Shape, course
from syncline_design.auditing.host_ticks import longest_tick, moved_together, ticks_of
from syncline_design.auditing.jumps import without_jumps
from syncline_design.auditing.lasting_jumps import Jump
from syncline_design.auditing.levels import SURE, believed, has_size, polished, shapes_of
from syncline_design.auditing.locks import without_locks
from syncline_design.auditing.naming import all_named
from syncline_design.auditing.plain_step import without_plain_step
from syncline_design.auditing.result import StampFault
from syncline_design.auditing.series import Array, Series, seconds
from syncline_design.auditing.settling import settled
from syncline_design.auditing.wandering import wandering
from syncline_design.auditing.whole_holes import breaks_none, passed
from syncline_design.auditing.witness import Side
from syncline_design.machine.quick_dataclass import dataclass

_WANDER: Final = 0.1  # of how far a clock drifts: smaller shifts may be its wander
_BEAT: Final = 1.2  # ticks
_REST: Final = 0.025  # of a jump: how well its size is known at once
_OTHER_RATE: Final = 0.3  # of an interval
_CHANCE: Final = 4.0  # sigma of a mean interval, of sensors without a rhythm
_HOLE: Final = 4.0  # intervals: of so long a one it is not known what jumped within it
_LOOK: Final = 4.0  # blocks around a jump in which the rhythm may break


@dataclass(frozen=True, slots=True)
class Shift:
    """A change of receipt minus stamp that is not the stamps' own, or may not be."""

    at_s: float
    to_s: float | None
    size_s: float  # of receipt minus stamp
    side: Side
    window_s: float


@dataclass(frozen=True, slots=True, eq=False)
class Shifts:
    """What was found, the series without it, and shifts to hold against other streams."""

    series: Series
    faults: tuple[StampFault, ...]
    shifts: tuple[Shift, ...]
    blocks: Blocks | None
    breathing_s: float = 0.0  # how far receipts move to and fro while stamps keep their rhythm
    seen: tuple[Shape, ...] = ()  # in the levels, whosever they are
    beat_s: float = 0.0  # what is slow and smaller may be a beat with a host's ticks
    own: int = 0  # shapes of which the faults of slow courses are made
    hidden_s: float = 0.0  # steps up to a host's tick that its receipts do not tell


def without_shifts(series: Series, *, least_s: float = 0.0) -> Shifts:
    """Steps, drift, episodes and settling, named where they are the stamps' own."""
    nothing = Shifts(series, (), (), None)
    if series.receive is None or series.good.sum() < 2:
        return nothing
    given = series
    series, locks = without_locks(series, cadence(series), least_s)
    mended = without_jumps(series, cadence(series), least_s)
    series = mended.series
    assert series.receive is not None
    places = series.places()
    time_s = series.seconds[places]
    late = seconds((series.receive - series.stamp)[places])
    late = late - np.median(late)
    own = tuple(_shift_of(jump, time_s) for jump in mended.jumps)
    moved = _slow_shifts(series, places, time_s, late, least_s, mended.settling_s)
    near_s = 2.0 * moved.blocks.length_s if moved.blocks is not None else 0.0
    faults = _joined((*mended.faults, *all_named(locks, time_s)), moved.faults, near_s)
    if moved.blocks is None and not faults:  # few messages
        whole, faults = without_plain_step(moved.series, cadence(series), least_s)
        moved = replace(moved, series=whole)
    hidden_s = max(moved.hidden_s, mended.hidden_s)
    found = replace(moved, faults=faults, shifts=(*own, *moved.shifts), hidden_s=hidden_s)
    freed, shapes = found.series, len(mended.faults) + len(locks) + moved.own
    if not faults:  # what was seen, whosever it is, may tell more than a walk does
        freed, shapes = put_back(given, moved.seen), len(moved.seen)
    one = wandering(given, freed, shapes, least_s)
    if one is None:
        return found
    return replace(
        found, series=one.series, faults=(one.fault,), shifts=(), seen=(), breathing_s=0.0
    )


def _joined(
    jumps: tuple[StampFault, ...], slow: tuple[StampFault, ...], near_s: float
) -> tuple[StampFault, ...]:
    """Both, but for what the size of a step beside, or the course of a lock, was off by."""
    kept = list(jumps)
    rest: list[StampFault] = []
    for fault in slow:
        k = next((k for k, one in enumerate(kept) if _is_rest(fault, one, near_s)), None)
        if k is not None:
            size = float(kept[k].parameters["seconds"]) + float(fault.parameters["seconds"])
            kept[k] = replace(kept[k], parameters={**kept[k].parameters, "seconds": size})
        elif not any(_is_rest(fault, one, near_s) for one in slow if one.fault == "relock"):
            rest.append(fault)
    return (*kept, *rest)


def _is_rest(fault: StampFault, larger: StampFault, near_s: float) -> bool:
    """Whether one begins beside a step, or in the course of a lock, of a multiple of its size."""
    alike = fault.fault in ("step", "relock") and larger.fault in (fault.fault, "relock")
    if not alike or "interval_s" in larger.parameters or fault.from_s is None:
        return False
    first = larger.from_s or 0.0
    last = first if larger.fault == "step" else larger.to_s or first
    near = first - near_s <= fault.from_s <= last + near_s
    share = abs(float(fault.parameters["seconds"]) / float(larger.parameters["seconds"]))
    return near and share < _REST


def _shift_of(jump: Jump, time_s: Array) -> Shift:
    end = None if jump.end is None else float(time_s[jump.end])
    return Shift(float(time_s[jump.place]), end, -jump.size_s, "stamp", 0.0)


def _slow_shifts(
    series: Series, places: np.ndarray, time_s: Array, late: Array, least_s: float,
    settling_s: tuple[float, ...],
) -> Shifts:  # fmt: skip
    """What levels of stretches show."""
    nothing = Shifts(series, (), (), None)
    blocks = blocks_of(time_s, late)
    if blocks is None or not bool(np.all(np.diff(time_s) >= 0)):
        return replace(nothing, blocks=blocks)
    pace = cadence(series)
    placed = [
        _placed(s, time_s, late, blocks)
        for s in shapes_of(blocks, least_s=least_s, settling_s=settling_s)
    ]
    seen = tuple(placed)
    by = passed(series, pace) if placed else pace.steps
    judged = [_judged((pace, by), shape, time_s, blocks) for shape in placed]
    tick = longest_tick(series) if placed else 0.0
    hidden = any(_with_what_it_stamps(shape, time_s, late, tick) for shape, _ in judged)
    judged = [(s, side) for s, side in judged if not hidden or abs(s.size_s) > tick]
    rest = late - course(tuple(shape for shape, _ in judged), time_s)
    beat_s = _BEAT * ticks_of(series, rest)
    # what is slow may be a beat between sensor and ticks
    judged = [(s, side) for s, side in judged if side == "stamp" or abs(s.size_s) > beat_s]
    found, sides = tuple(shape for shape, _ in judged), [side for _, side in judged]
    found = polished(found, [side == "stamp" for side in sides], blocks)
    sides = [side for s, side in zip(found, sides, strict=True) if has_size(s, least_s)]
    found = tuple(s for s in found if has_size(s, least_s))
    count = None if hidden else witness.witness_of(series, pace, blocks)
    sides = witness.sides(count, found, sides)
    sharp = [s.kind in ("step", "episode") and witness.sharp(s, time_s, late) for s in found]
    own = _own(found, sides, sharp, time_s, blocks)
    told = witness.mirrored(count, blocks) if not own else None
    if told is not None:
        again = shapes_of(told, least_s=least_s, settling_s=settling_s)
        own = tuple(s for s in again if s.kind != "drift")
    if len(own) < len(found):  # without what is transport, sizes are others
        fitted = polished(own, [True] * len(own), blocks)
        if told is None:
            own = tuple(s for s in fitted if believed(s, blocks, least_s))
        elif all(abs(s.size_s) > SURE * s.sigma_s for s in fitted):
            own = fitted  # else the levels go with what is left out: stamps alone tell sizes
    own = witness.simplest(count, own, blocks)
    left = tuple(s for s in found if s not in own and s.kind not in ("step", "episode"))
    own = settled(own, time_s, late, blocks)
    faults = tuple(all_named(own, time_s))
    shifts = tuple(
        Shift(s.begin_s, None if s.kind == "step" else s.end_s, s.size_s, side, blocks.length_s)
        for s, side, seen in zip(found, sides, sharp, strict=True) if seen or side == "stamp"
    )  # fmt: skip
    breathing = float(np.ptp(course(left, blocks.time_s))) if left else 0.0
    told_s = tick if hidden else 0.0
    return Shifts(
        put_back(series, own), faults, shifts, blocks, breathing, seen, max(beat_s, told_s),
        len(own), told_s,
    )  # fmt: skip


def put_back(series: Series, shapes: tuple[Shape, ...]) -> Series:
    """The series with the course of these shapes taken out of its stamps."""
    return series.stamped_later(course(shapes, series.seconds[series.places()]))


def _with_what_it_stamps(shape: Shape, time_s: Array, late: Array, tick_s: float) -> bool:
    """Whether receipts at ticks of a host tell that no clock made a step."""
    place = int(np.searchsorted(time_s, shape.begin_s))
    return shape.kind == "step" and moved_together(late, place, shape.size_s, tick_s)


def _own(
    found: tuple[Shape, ...], sides: Sequence[Side], sharp: Sequence[bool], time_s: Array,
    blocks: Blocks,
) -> tuple[Shape, ...]:  # fmt: skip
    """What is the stamps' own: seen in their rhythm, or such as no transport does."""
    if not found:
        return ()
    drift, bends = witness.drifts(found, sides, sharp, blocks)
    wander = float(np.ptp(course(tuple(s for s in found if s.kind in ("drift", "bend")), time_s)))
    kept = []
    for shape, side, seen in zip(found, sides, sharp, strict=True):
        if side == "stamp":
            kept.append(shape)
        elif shape.kind == "drift" or shape.kind == "bend":
            kept += [shape] if (drift if shape.kind == "drift" else bends) else []
        elif side == "unknown" and shape.kind in ("step", "episode"):
            other = _may_be_wander(shape, wander) or _changes_rate(time_s, shape, blocks)
            kept += [shape] if seen and not other else []
    return tuple(kept)


def _changes_rate(time_s: Array, shape: Shape, blocks: Blocks) -> bool:
    """Whether messages come at another rate from where something begins or ends: they wait for one
    another more, or less, from then on."""
    edges = (shape.begin_s,) if shape.kind == "step" else (shape.begin_s, shape.end_s)
    for edge in edges:
        width = 3.0 * blocks.length_s
        spans = ((edge - width, edge), (edge, edge + width))
        near = [time_s[(time_s > a) & (time_s < b)] for a, b in spans]
        if min(part.size for part in near) < 8:
            continue
        waits = [np.diff(part) for part in near]
        one, other = (float(np.mean(part)) for part in waits)
        chance = _CHANCE * float(np.sqrt(sum(np.var(part) / part.size for part in waits)))
        if abs(one - other) > max(_OTHER_RATE * min(one, other), chance):
            return True
    return False


def _placed(shape: Shape, time_s: Array, late: Array, blocks: Blocks) -> Shape:
    """Begin (and end) to the message: where the jump parts the messages best."""
    if shape.kind in ("drift", "bend", "ramp", "holdover"):
        return shape
    begin = _change(shape.begin_s, shape.size_s, time_s, late, blocks)
    if shape.kind == "episode":
        end = _change(shape.end_s, -shape.size_s, time_s, late, blocks)
        return replace(shape, begin_s=begin, end_s=end)
    return replace(shape, begin_s=begin, end_s=begin if shape.kind == "relock" else shape.end_s)


def _change(at_s: float, size_s: float, time_s: Array, late: Array, blocks: Blocks) -> float:
    """The moment within two blocks of a jump that parts lower from higher messages best."""
    width = 3.0 * blocks.length_s
    a, b = np.searchsorted(time_s, [at_s - width, at_s + width])
    near = late[a:b]
    if near.size < 4:
        return at_s
    sign = 1.0 if size_s > 0 else -1.0
    limit = 3.0 * max(blocks.spread_s, abs(size_s))
    middle = np.median(near)
    value = np.clip(sign * (near - middle), -limit, limit)
    value = value - value.mean()
    split = int(np.argmin(np.cumsum(value)[:-1])) + 1
    return float(time_s[a + split])


def _judged(
    told: tuple[Cadence, Array], shape: Shape, time_s: Array, blocks: Blocks
) -> tuple[Shape, Side]:
    """A shape put where the stamps' own rhythm breaks, and whether it breaks there at all; told: a
    rhythm, and how many of its intervals passed between messages."""
    pace = told[0]
    if shape.kind in ("drift", "bend", "ramp", "holdover") or not pace.regular:
        return shape, "unknown"
    side, at = _broken(told, shape.begin_s, -shape.size_s, time_s, blocks, shape.settle_s)
    if at is not None:
        end = at if shape.kind == "relock" else shape.end_s
        shape = replace(shape, begin_s=at, end_s=end)
    if shape.kind == "episode":
        other, at = _broken(told, shape.end_s, shape.size_s, time_s, blocks)
        early = shape.begin_s < float(time_s[0]) + 0.05 * float(time_s[-1] - time_s[0])
        if other == "stamp" and side != "stamp" and early:  # only the other edge is a jump
            begin = shape.end_s if at is None else at
            last = float(time_s[-1])
            return replace(
                shape, kind="step", size_s=-shape.size_s, begin_s=begin, end_s=last
            ), other
        shape = shape if at is None else replace(shape, end_s=at)
        side = other if side == "unknown" else side
    return shape, side


def _broken(
    told: tuple[Cadence, Array],
    at_s: float,
    jump_s: float,
    time_s: Array,
    blocks: Blocks,
    settle_s: float = 0.0,
) -> tuple[Side, float | None]:
    """Whether stamps leave their rhythm by a jump near a moment, and where.

    The interval that does is the jump longer; where the rhythm scatters too much for one interval,
    the sum of all near by.  What settles was larger, had it begun earlier than it was put.
    """
    pace, by = told
    width = _LOOK * blocks.length_s
    inside = np.flatnonzero((time_s[1:] > at_s - width) & (time_s[:-1] < at_s + width))
    if not inside.size:
        return "unknown", None
    period, noise = pace.period_s, 6.0 * pace.jitter_s + 1e-9
    large = abs(jump_s) > 0.4 * period
    steps = by[inside] if large else pace.steps[inside]
    off = pace.interval[inside] - steps * period
    sizes = np.full(inside.size, jump_s)
    if settle_s > 0.0:
        sizes *= np.exp(np.clip((at_s - time_s[inside + 1]) / settle_s, -3.0, 3.0))
    apart = np.abs(off - sizes) / np.abs(sizes)
    nearest = int(np.argmin(apart))
    if abs(sizes[nearest]) > noise and apart[nearest] < 0.35:
        return "stamp", float(time_s[inside[nearest] + 1])
    if large:
        holes = inside[pace.interval[inside] > _HOLE * period]
        keeps = breaks_none(pace, holes, jump_s, blocks.spread_s)
        return ("unknown" if holes.size and not keeps else "receipt"), None
    moved = float(off.sum())
    bound = max(0.35 * abs(jump_s), noise)
    if noise < abs(jump_s) and abs(moved - jump_s) < bound:
        return "stamp", None
    return ("receipt" if noise < abs(jump_s) and abs(moved) < bound else "unknown"), None


def _may_be_wander(shape: Shape, wander_s: float) -> bool:
    """Whether a small shift of a clock that runs away may be how its rate changes."""
    return shape.kind not in ("drift", "bend") and abs(shape.size_s) < _WANDER * wander_s


def common(shifts: Sequence[Shift]) -> float:
    """The size of a shift that several streams show [s]."""
    return float(np.median([s.size_s for s in shifts]))
