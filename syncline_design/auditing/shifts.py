"""Names for how an offset moves: slips of whole seconds, steps, drift, a lock that settles.

A shift counts as the stamps' own where the rhythm of a regular sensor shows it too; where the
stamps keep their rhythm and receipts move, it is the recorder or transport.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Final

import numpy as np

from syncline_design.auditing import witness
from syncline_design.auditing.blocks import Blocks, blocks_of
from syncline_design.auditing.cadence import Cadence, cadence
from syncline_design.auditing.clock_shapes import Shape, course
from syncline_design.auditing.grains import best_timer
from syncline_design.auditing.jumps import Jump, without_jumps
from syncline_design.auditing.levels import believed, polished, shapes_of
from syncline_design.auditing.naming import all_named
from syncline_design.auditing.result import Consequence, StampFault
from syncline_design.auditing.series import NS, Array, Series, seconds, spread
from syncline_design.auditing.witness import Side
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import to_places

_WHOLE: Final = 0.1  # s that a slip may be from whole seconds
_LEAST_RUN: Final = 3  # messages of a slip
_ENTERS: Final = 0.45  # s that the first message of a slip may be from whole seconds
_TRANSPORT_S: Final = 0.05
_BLUR_S: Final = 0.2  # interquartile range of delays: from here on whole seconds are no mark
_DRIFTING_S: Final = 0.03  # over the log: slower drifts do not blur whole seconds
_WANDER: Final = 0.1  # of how far a clock drifts: smaller shifts may be its wander
_TAIL: Final = 0.15  # skewness of quantiles; of gamma delays about 0.4, of a wait for a tick 0
_OTHER_TICKS: Final = 3  # receipts that show a tick
_OTHER_RATE: Final = 0.3  # of an interval
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


def without_slips(series: Series, known_s: float | None) -> Shifts:
    """Stretches whose stamps are off by whole seconds; known_s: constant offset of the stream.

    Which stretch is right: the one whose stamps lie just before their receipts, where the constant
    is known; else the longest.
    """
    nothing = Shifts(series, (), (), None)
    if series.receive is None or series.good.sum() < 2 * _LEAST_RUN:
        return nothing
    places = series.places()
    late = seconds((series.receive - series.stamp)[places])
    middle = float(np.median(late))
    late = late - _slope(series.seconds[places], late)
    if spread(late - np.round(late - middle)) > _BLUR_S:
        return nothing  # delays that are as long as a slip
    turns = np.round(late - middle)
    if not turns.any():
        return nothing
    base = _right(late + (known_s or 0.0), turns, known_s is not None)
    turns = np.round(late - float(np.median(late[turns == base])))
    single = 1 + np.flatnonzero((turns[1:-1] != turns[:-2]) & (turns[:-2] == turns[2:]))
    turns[single] = turns[single - 1]  # one late message ends no stretch
    pace = cadence(series)
    found = [r for r in _runs(turns) if _is_slip(late, turns, r, pace, series, places)]
    if not found:
        return nothing
    own = [r for r in found if _side_of(series, places, pace, r[0], r[1]) != "receipt"]
    moved = series.stamp.copy()
    for begin, end in own:
        moved[places[begin:end]] += round(turns[begin]) * 10**9
    faults = tuple(_slip(series.seconds[places], turns, run, series.stamp[places]) for run in own)
    others = tuple(
        Shift(float(series.seconds[places[b]]), None, float(turns[b]), "receipt", 1.0)
        for b, e in found if (b, e) not in own and e == places.size
    )  # fmt: skip
    return Shifts(replace(series, stamp=moved), faults, others, None)


def _slope(time_s: Array, late: Array) -> Array:
    """The drift of most messages, as seconds from the middle of the log; 0 where it is small."""
    lag = max(1, late.size // 10)
    passed = time_s[lag:] - time_s[:-lag]
    use = passed > 0.0
    if not use.any():
        return np.zeros(late.size)
    slope = float(np.median((late[lag:] - late[:-lag])[use] / passed[use]))
    drift = slope * (time_s - time_s[time_s.size // 2])
    return drift if abs(slope) * float(np.ptp(time_s)) > _DRIFTING_S else np.zeros(late.size)


def _right(late: Array, turns: Array, known: bool) -> float:
    values, often = np.unique(turns, return_counts=True)
    frequent = values[often >= max(_LEAST_RUN, 0.01 * turns.size)]
    if known and frequent.size:
        lows = [(float(np.percentile(late[turns == v], 10)), v) for v in frequent]
        causal = [(low, v) for low, v in lows if low > -_TRANSPORT_S]
        if causal:
            return float(min(causal)[1])
    return float(values[int(np.argmax(often))])


def _runs(turns: Array) -> Iterator[tuple[int, int]]:
    """Stretches of one number of seconds that is not 0."""
    edges = np.flatnonzero(np.diff(np.concatenate([[np.nan], turns, [np.nan]])) != 0)
    for begin, end in pairwise(edges):
        if turns[begin] != 0:
            yield int(begin), int(end)


def _is_slip(
    late: Array, turns: Array, run: tuple[int, int], pace: Cadence, series: Series,
    places: np.ndarray,
) -> bool:  # fmt: skip
    """Long enough, whole seconds off, and level: waiting messages come ever less late."""
    begin, end = run
    if end - begin < _LEAST_RUN:
        return False
    right = late[turns == 0]
    inside = late[begin:end] - turns[begin]
    apart = abs(float(np.median(inside)) - float(np.median(right)))
    calm = max(3.0 * spread(right), 1e-3)
    level = spread(inside) < max(3.0 * spread(right), 0.02)
    change = turns[begin] - turns[begin - 1]
    enters = begin == 0 or abs(late[begin] - late[begin - 1] - change) < _ENTERS
    return apart < min(_WHOLE, max(calm, 0.01)) and level and enters


def _side_of(
    series: Series, places: np.ndarray, pace: Cadence, begin: int, end: int
) -> Side:  # fmt: skip
    """Whose interval is odd where a slip begins (or, of one that begins the log, ends)."""
    assert series.receive is not None
    k = begin if begin > 0 else end
    if not 0 < k < places.size:
        return "unknown"
    a, b = places[k - 1], places[k]
    stamp = (series.stamp[b] - series.stamp[a]) / NS
    receive = (series.receive[b] - series.receive[a]) / NS
    expected = float(b - a) * pace.period_s  # messages between may be left out, as duplicates are
    odd_stamp, odd_receive = abs(stamp - expected), abs(receive - expected)
    if odd_receive > 0.6 and odd_stamp < 0.4:
        return "receipt"
    return "stamp"


def _slip(times: Array, turns: Array, run: tuple[int, int], stamp: np.ndarray) -> StampFault:
    begin, end = run
    size = -float(turns[begin])
    ends = end < times.size
    change = np.diff(stamp[max(0, begin - 1) : end + 1])
    falls = int(np.sum(change < 0))
    back = Consequence("backward_jump", {"count": float(falls)},
                       "stamps go back where the slip begins or ends")  # fmt: skip
    return StampFault(
        "whole_second_slip", {"seconds": size, "count": float(end - begin)}, float(times[begin]),
        float(times[end] if ends else times[-1]),
        f"{end - begin} messages are stamped {to_places(abs(size), 0)} s "
        f"{'ahead' if size > 0 else 'behind'}" + ("" if ends else ", to the end of the log"),
        (back,) if falls else (),
    )  # fmt: skip


def without_shifts(series: Series, *, least_s: float = 0.0) -> Shifts:
    """Steps, drift, episodes and settling, named where they are the stamps' own."""
    nothing = Shifts(series, (), (), None)
    if series.receive is None or series.good.sum() < 2:
        return nothing
    mended = without_jumps(series, cadence(series), least_s)
    series = mended.series
    assert series.receive is not None
    places = series.places()
    time_s = series.seconds[places]
    late = seconds((series.receive - series.stamp)[places])
    late = late - np.median(late)
    own = tuple(_shift_of(jump, time_s) for jump in mended.jumps)
    moved = _slow_shifts(series, places, time_s, late, least_s, mended.settling_s)
    return replace(moved, faults=(*mended.faults, *moved.faults), shifts=(*own, *moved.shifts))


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
    judged = [_judged(pace, shape, time_s, blocks) for shape in placed]
    rest = late - course(tuple(shape for shape, _ in judged), time_s)
    tick = _ticks_of(series, rest) if judged else 0.0
    # what is slow may be a beat between sensor and ticks
    judged = [(s, side) for s, side in judged if side == "stamp" or abs(s.size_s) > 1.2 * tick]
    found, sides = tuple(shape for shape, _ in judged), [side for _, side in judged]
    found = polished(found, [side == "stamp" for side in sides], blocks)
    count = witness.witness_of(series, pace, blocks)
    sides = witness.sides(count, found, sides)
    sharp = [s.kind in ("step", "episode") and witness.sharp(s, time_s, late) for s in found]
    own = _own(found, sides, sharp, time_s, blocks)
    told = witness.mirrored(count, blocks) if not own else None
    if told is not None:
        own = tuple(s for s in shapes_of(told, least_s=least_s) if s.kind != "drift")
    if len(own) < len(found):  # without what is transport, sizes are others
        own = polished(own, [True] * len(own), blocks)
        own = own if told is not None else tuple(s for s in own if believed(s, blocks, least_s))
    own = witness.simplest(count, own, blocks)
    whole = series.stamp.copy()
    whole[places] += np.round(course(own, time_s) * NS).astype(np.int64)
    faults = tuple(all_named(own, time_s))
    shifts = tuple(
        Shift(s.begin_s, None if s.kind == "step" else s.end_s, s.size_s, side, blocks.length_s)
        for s, side, seen in zip(found, sides, sharp, strict=True) if seen or side == "stamp"
    )  # fmt: skip
    left = tuple(s for s in found if s not in own and s.kind not in ("step", "episode"))
    breathing = float(np.ptp(course(left, blocks.time_s))) if left else 0.0
    return Shifts(replace(series, stamp=whole), faults, shifts, blocks, breathing, seen)


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
        one, other = (float(np.mean(np.diff(part))) for part in near)
        if abs(one - other) > _OTHER_RATE * min(one, other):
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


def _ticks_of(series: Series, late: Array) -> float:
    """The host's tick [s] where receipts keep to one, and delays are not those of transport; or 0.

    A sensor whose interval is nearly a multiple of the host's tick waits a little less each time:
    a beat, which looks like drift, of a tick at most.  An even sensor is on many grids itself; what
    shows a tick is a receipt that comes whole ticks sooner or later than the sensor's interval.
    Transport's delays have a tail, waits for a tick have none.
    """
    assert series.receive is not None
    receive = np.sort(series.receive[series.good])
    when = seconds(receive - receive[0])
    tick = best_timer(when)
    if tick is None or _has_tail(late):
        return 0.0
    counts = np.round(np.diff(when) / tick)
    values, often = np.unique(counts, return_counts=True)
    usual = values[int(np.argmax(often))]
    whole = counts % usual == 0.0 if usual > 0.0 else np.zeros(counts.size, bool)
    return tick if int(np.sum(~whole | (counts == 0.0))) >= _OTHER_TICKS else 0.0


def _has_tail(late: Array) -> bool:
    """Whether delays reach further above their median than below it, block by block."""
    skews = []
    pieces = np.array_split(late, max(4, late.size // 64))
    for piece in pieces[:: max(1, len(pieces) // 1000)]:
        k = np.arange(piece.size) - 0.5 * (piece.size - 1)
        low, middle, high = np.percentile(piece - k * float(k @ piece) / float(k @ k), [5, 50, 95])
        if high > low:
            skews.append(((high - middle) - (middle - low)) / (high - low))
    return bool(skews) and float(np.median(skews)) > _TAIL


def _judged(pace: Cadence, shape: Shape, time_s: Array, blocks: Blocks) -> tuple[Shape, Side]:
    """A shape put where the stamps' own rhythm breaks, and whether it breaks there at all."""
    if shape.kind in ("drift", "bend", "ramp", "holdover") or not pace.regular:
        return shape, "unknown"
    side, at = _broken(pace, shape.begin_s, -shape.size_s, time_s, blocks, shape.settle_s)
    if at is not None:
        end = at if shape.kind == "relock" else shape.end_s
        shape = replace(shape, begin_s=at, end_s=end)
    if shape.kind == "episode":
        other, at = _broken(pace, shape.end_s, shape.size_s, time_s, blocks)
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
    pace: Cadence,
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
    width = _LOOK * blocks.length_s
    inside = np.flatnonzero((time_s[1:] > at_s - width) & (time_s[:-1] < at_s + width))
    if not inside.size:
        return "unknown", None
    period, noise = pace.period_s, 6.0 * pace.jitter_s + 1e-9
    large = abs(jump_s) > 0.4 * period
    steps = 1.0 if large else pace.steps[inside]
    off = pace.interval[inside] - steps * period
    sizes = np.full(inside.size, jump_s)
    if settle_s > 0.0:
        sizes *= np.exp(np.clip((at_s - time_s[inside + 1]) / settle_s, -3.0, 3.0))
    apart = np.abs(off - sizes) / np.abs(sizes)
    nearest = int(np.argmin(apart))
    if abs(sizes[nearest]) > noise and apart[nearest] < 0.35:
        return "stamp", float(time_s[inside[nearest] + 1])
    if large:
        hole = bool(np.any(pace.interval[inside] > 4.0 * period))
        return ("unknown" if hole else "receipt"), None
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
