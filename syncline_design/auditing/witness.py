"""What the rhythm of a regular sensor says of a slow course of receipt minus stamp.

A sensor measures at a + k T by some oscillator.  Counting its messages gives a second clock beside
the one that stamps: a stamp's clock that bends, settles or is slewed leaves the count, latency that
breathes does not.  A line is seen by neither: T itself is known only to the sensor's own ppm.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Final, Literal

import numpy as np

from syncline_design.auditing.blocks import Blocks
from syncline_design.auditing.cadence import Cadence
from syncline_design.auditing.clock_shapes import Shape, course
from syncline_design.auditing.levels import SURE
from syncline_design.auditing.series import Array, Series, median, scatter, seconds
from syncline_design.auditing.whole_holes import counted
from syncline_design.machine.quick_dataclass import dataclass

Side = Literal["stamp", "receipt", "unknown"]
SLOW: Final = ("bend", "ramp", "relock", "holdover")
_OWN: Final = 0.4  # of a course: how near to it the count's must be
_NONE: Final = 0.35  # and how little of it where it is not the stamps'
_BLURRED: Final = 0.5  # of a course: a count that scatters more says nothing
# of a drift's span: how far from a line a crystal's may be, and one that no crystal has
_STRAIGHT, _STRAIGHTER = 0.35, 0.12
_CRYSTAL: Final = 100e-6
_OSCILLATOR: Final = 300e-6  # no crystal is off by more; steeper courses are of transport
_COUNTED: Final = 0.2  # of an interval: how near to whole ones most are
_BENDS: Final = 16  # polynomials of a course
_MANY: Final = 3  # shapes of one clock: more likely one course
_SAME: Final = 0.3
_LEAST_SHARE: Final = 0.25  # of the delays' spread
_LEAST_RUN_S: Final = 2e-5
_PARTS: Final = 12  # of a log, to see whether it runs along a line
_SHARP: Final = 0.6  # of a step: seen between the messages just before and after
_BESIDE: Final = 12  # messages on each side


@dataclass(frozen=True, slots=True, eq=False)
class Witness:
    """Stamps against the count of messages, in the blocks of receipt minus stamp [s]."""

    time_s: Array
    level_s: Array
    noise_s: float


def witness_of(series: Series, pace: Cadence, blocks: Blocks) -> Witness | None:
    """None where messages cannot be counted."""
    if pace.period_s <= 0.0 or series.receive is None or pace.interval.size < 20:
        return None
    off = np.abs(pace.interval - pace.steps * pace.period_s)
    if float(np.percentile(off, 90.0)) > _COUNTED * pace.period_s:
        return None
    apart = against_count(series, pace)
    level = np.asarray([median(apart[a:b]) for a, b in _pairs(blocks.edges)])
    use = blocks.usable
    if use.sum() < 8:
        return None
    around = np.diff(level)
    return Witness(blocks.time_s[use], level[use], scatter(around) / float(np.sqrt(2.0)))


def against_count(series: Series, pace: Cadence) -> Array:
    """Stamps less the even count of messages [s]."""
    count = np.concatenate([[0.0], np.cumsum(counted(series, pace))])
    when = seconds(series.stamp[pace.places] - series.stamp[pace.places[0]])
    return np.asarray(when - pace.period_s * count)


def _pairs(edges: np.ndarray) -> list[tuple[int, int]]:
    return [(int(a), int(b)) for a, b in pairwise(edges)]


def sides(
    witness: Witness | None, shapes: Sequence[Shape], known: Sequence[Side]
) -> list[Side]:  # fmt: skip
    """Whose every shape is: known says it of steps, the count of what is slow."""
    slow = [k for k, s in enumerate(shapes) if s.kind in SLOW or _open(s, known[k])]
    found = list(known)
    if witness is None or not slow:
        return found
    steps = tuple(s for k, s in enumerate(shapes) if k not in slow and known[k] == "stamp")
    told = bent(witness.level_s + course(steps, witness.time_s), witness.time_s)
    whole = bent(course(tuple(shapes[k] for k in slow), witness.time_s), witness.time_s)
    joint = _side(told, whole)
    for k in slow:
        alone = _side_of(witness.time_s, told, shapes, slow, k) if joint == "unknown" else joint
        found[k] = known[k] if alone == "unknown" else alone
    return found


def _open(shape: Shape, side: Side) -> bool:
    return shape.kind in ("step", "episode") and side == "unknown"


def bent(values: Array, time_s: Array) -> Array:
    """Without its best line."""
    x = time_s - time_s.mean()
    y = values - values.mean()
    return np.asarray(y - x * float(x @ y) / max(float(x @ x), 1e-30))


def _side(told: Array, whole: Array) -> Side:
    """Of a course of receipt minus stamp `whole` and the count's `told`: stamps that move by -d
    show a course of +d."""
    power = float(whole @ whole)
    if power <= 0.0:
        return "unknown"
    share = -float(told @ whole) / power
    rest = float(np.sqrt(np.mean((told + share * whole) ** 2)))
    if rest > _BLURRED * float(np.sqrt(power / whole.size)):
        return "unknown"
    if abs(share - 1.0) < _OWN:
        return "stamp"
    return "receipt" if abs(share) < _NONE else "unknown"


def _side_of(
    time_s: Array, told: Array, shapes: Sequence[Shape], slow: Sequence[int], which: int
) -> Side:  # fmt: skip
    """The same of one shape among several, by least squares."""
    courses = np.stack([bent(shapes[k].size_s * shapes[k].at(time_s), time_s) for k in slow], 1)
    sizes, *_ = np.linalg.lstsq(courses, -told, rcond=None)
    rest = told + courses @ sizes
    own = courses[:, slow.index(which)]
    if float(np.sqrt(np.mean(rest**2))) > _BLURRED * float(np.sqrt(np.mean(own**2))):
        return "unknown"
    share = float(sizes[slow.index(which)])
    if abs(share - 1.0) < _OWN:
        return "stamp"
    return "receipt" if abs(share) < _NONE else "unknown"


def drifts(
    shapes: Sequence[Shape], sides_of: Sequence[Side], sharp_ones: Sequence[bool], blocks: Blocks
) -> tuple[bool, bool]:
    """Whether what runs away is a clock's drift, and whether its bends are that clock's.

    Where the count shows the bends they are.  Else they are latency, unless all of it is no more
    than an oscillator does: nearly a line, of some hundred ppm at most.  sharp_ones: of steps,
    those that messages show; what fits as a step and is none belongs to the course.
    """
    slow = [k for k, s in enumerate(shapes) if s.kind in SLOW or s.kind == "drift"]
    bent = [k for k in slow if shapes[k].kind in SLOW]
    if bent and all(sides_of[k] == "stamp" for k in bent):
        return True, True
    jumps = [k for k, s in enumerate(shapes) if k not in slow and not sharp_ones[k]]
    left = [k for k in (*slow, *jumps) if sides_of[k] != "stamp"]
    others = tuple(s for k, s in enumerate(shapes) if k not in left)
    time_s, low = blocks.time_s[blocks.usable], blocks.low_s[blocks.usable]
    line = straight(time_s, low - course(others, time_s), blocks.noise_s)
    whole = course(tuple(shapes[k] for k in left), time_s)
    rate = np.abs(np.diff(whole) / np.diff(time_s))
    only_bends = all(shapes[k].kind in ("bend", "drift") for k in left)
    steady = line and only_bends and float(rate.max(initial=0.0)) < _OSCILLATOR
    return line, steady


def wander(found: Witness | None, own: tuple[Shape, ...], blocks: Blocks) -> tuple[Shape, ...]:
    """A course that stamps show against the count and receipts against the stamps, as bends.

    It is what is left of both once the named shapes are taken out: the one as the other's mirror.
    """
    if found is None or found.time_s.size < 3 * _BENDS:
        return ()
    time_s = found.time_s
    told = bent(found.level_s + course(own, time_s), time_s)
    late = bent(blocks.low_s[blocks.usable] - course(own, time_s), time_s)
    floor = max(SURE * found.noise_s, SURE * blocks.noise_s, _LEAST_SHARE * blocks.spread_s)
    if float(np.ptp(told)) < max(floor, _LEAST_RUN_S) or not _alike(late, -told):
        return ()
    ends = float(time_s[0]), float(time_s[-1])
    bends = [Shape("bend", 1.0, 0.0, *ends, order=k) for k in range(2, _BENDS)]
    courses = np.stack([np.ones(time_s.size), time_s, *(b.at(time_s) for b in bends)], axis=1)
    sizes, *_ = np.linalg.lstsq(courses, late, rcond=None)
    if not _alike(late, courses @ sizes):
        return ()
    sigma = blocks.noise_s / float(np.sqrt(time_s.size))
    return tuple(
        replace(b, size_s=float(s), sigma_s=sigma) for b, s in zip(bends, sizes[2:], strict=True)
    )


def mirrored(found: Witness | None, blocks: Blocks) -> Blocks | None:
    """What stamps show against the count, as levels of receipt minus stamp, where these follow it.

    Finer than the levels by as much as the sensor's jitter is below transport's.
    """
    if found is None or found.time_s.size < 8:
        return None
    told = bent(found.level_s, found.time_s)
    late = bent(blocks.low_s[blocks.usable], found.time_s)
    floor = max(SURE * blocks.noise_s, _LEAST_SHARE * blocks.spread_s, _LEAST_RUN_S)
    if float(np.ptp(told)) < floor or not _alike(late, -told):
        return None
    use = np.ones(found.time_s.size, bool)
    noise = max(found.noise_s, 1e-10)
    return Blocks(found.time_s, -found.level_s, use, noise, blocks.spread_s, blocks.edges)


def is_stamps(found: Witness, blocks: Blocks, least_s: float) -> bool:
    """Whether the stamps leave the count by a course that receipts against them take as well."""
    told = bent(found.level_s, found.time_s)
    late = bent(blocks.low_s[blocks.usable], found.time_s)
    floor = max(_LEAST_SHARE * blocks.spread_s, _LEAST_RUN_S, least_s)
    return float(np.ptp(told)) >= floor and _side(told, late) == "stamp"


def simplest(found: Witness | None, own: tuple[Shape, ...], blocks: Blocks) -> tuple[Shape, ...]:
    """Shapes, or in place of many one clock that wanders, where that explains as much."""
    straight = tuple(s for s in own if s.kind == "drift")
    if len(own) - len(straight) >= _MANY:
        alone = wander(found, straight, blocks)
        if alone:
            return (*straight, *alone)
    return (*own, *wander(found, own, blocks))


def _alike(one: Array, other: Array) -> bool:
    """Whether two courses differ by little of their size."""
    return float(np.std(one - other)) < _SAME * float(np.std(one))


def straight(time_s: Array, level_s: Array, noise_s: float) -> bool:
    """Whether levels run along a line rather than to and fro."""
    parts = np.array_split(np.arange(time_s.size), min(_PARTS, time_s.size))
    when = np.asarray([float(time_s[p].mean()) for p in parts])
    level = np.asarray([float(np.median(level_s[p])) for p in parts])
    away = bent(level, when)
    chance = 4.0 * noise_s / float(np.sqrt(time_s.size / when.size))
    span = float(np.ptp(level - away))
    steep = span > _CRYSTAL * float(np.ptp(when))
    return float(np.ptp(away)) - chance < (_STRAIGHTER if steep else _STRAIGHT) * span


def sharp(shape: Shape, time_s: Array, late: Array) -> bool:
    """Whether a step is seen between the messages just before and after: latency that moves
    slowly has none."""
    edges = [shape.begin_s] if shape.kind == "step" else [shape.begin_s, shape.end_s]
    seen = []
    for edge in edges:
        k = int(np.searchsorted(time_s, edge))
        before, after = late[max(0, k - _BESIDE) : k], late[k : k + _BESIDE]
        if min(before.size, after.size) >= 4:
            moved = abs(float(np.median(after) - np.median(before)))
            seen.append(moved / max(abs(shape.size_s), 1e-12))
    return not seen or max(seen) > _SHARP
