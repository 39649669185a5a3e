"""Which shapes a clock's offset has over a log: drift, steps, episodes, a lock that settles.

The low quantiles of stretches are fitted by least squares with one shape after another, each time
the one that explains most, as long as it explains far more than noise would.  Shapes are those that
clocks have; an episode of longer delays has another spread and was left out before.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from syncline_design.auditing.blocks import Blocks
from syncline_design.auditing.clock_shapes import (
    KNOTS,
    SETTLINGS,
    Shape,
    ShapeFamily,
    around,
    course,
    families,
    straddling,
)
from syncline_design.auditing.series import Array, Mask
from syncline_design.machine.deadline import in_force

_LONGEST: Final = 0.3  # of the log: what settles more slowly is drift
_WILD: Final = (
    10.0  # of what is seen, or of all shapes together: sizes that nearly cancel one another
)
_LEAST_BLOCKS: Final = 3  # of an episode
MOST_SHAPES: Final = 6
SURE: Final = 8.0  # sigma of a size that is believed
# what a shape has to explain beyond chance for its freedom, in units of the noise squared
_PENALTY: Final = {
    "drift": 0.0, "bend": 12.0, "ramp": 14.0, "step": 6.0, "episode": 14.0, "relock": 14.0,
    "holdover": 20.0,
}  # fmt: skip
_RIVAL: Final = 0.5  # of the best: shapes of coarse places that may turn out better
_EXTRA: Final = 0.004  # of what a shape explains: its freedom also fits what is nearly right
_STEP_SHARE: Final = 0.25  # of the delays' spread: smaller steps are not named
_DRIFT_SHARE: Final = 0.4  # of the delays' spread, over the whole log
_ENDS_S, _ENDS = 3.0, 0.05  # of a log, within which a queue drains or fills: seconds, and a share
_LASTS: Final = 0.5  # of a drift: as much of it is there between the ends
_LEAST_RUN_S: Final = 2e-5  # over the log: hosts that are disciplined wander by as much


def shapes_of(
    blocks: Blocks, *, least_s: float = 0.0, settling_s: Sequence[float] = ()
) -> tuple[Shape, ...]:
    """The shapes that the levels show; least_s: smaller ones cannot be told from transport.

    settling_s: when something is known to have jumped that settles.
    """
    use = blocks.usable
    time_s, low = blocks.time_s[use], blocks.low_s[use]
    if time_s.size < 8:
        return ()
    found = _known_to_settle(time_s, low, settling_s, blocks)
    kinds = tuple(families(time_s))
    for _ in range(MOST_SHAPES):
        in_force().check()
        keep = ~straddling(found, time_s, blocks.length_s)
        best = _best(time_s[keep], low[keep], found, blocks, kinds, keep)
        if best is None:
            break
        better = (*found, best)
        grown = polished(better, [True] * len(better), blocks, within=1.1)
        reach = min(float(np.ptp(low)), float(np.ptp(course(grown, time_s))))
        wild = any(abs(s.size_s) > _WILD * reach for s in grown)
        if wild or not believed(grown[-1], blocks, least_s):
            break
        found = grown
    found = _in_two_rates(found, blocks)
    keep = ~straddling(found, time_s, blocks.length_s)
    kept = _pruned(time_s[keep], low[keep], _without_end_drift(found, blocks), blocks)
    return tuple(s for s in kept if believed(s, blocks, least_s))


def _without_end_drift(found: tuple[Shape, ...], blocks: Blocks) -> tuple[Shape, ...]:
    """Shapes less a drift that the levels at the ends of the log make: a clock drifts all along,
    while a queue that drains as a log begins, or one that fills as it ends, delays but a few."""
    time_s = blocks.time_s
    end_s = max(_ENDS_S, _ENDS * float(np.ptp(time_s)))
    inside = (time_s > time_s[0] + end_s) & (time_s < time_s[-1] - end_s)
    keep = blocks.usable & inside & ~straddling(found, time_s, blocks.length_s)
    drifts = any(s.kind == "drift" for s in found)
    if not drifts or int(keep.sum()) < len(found) + 6:
        return found
    inner = _fitted(time_s[keep], blocks.low_s[keep], found, blocks)
    return tuple(a for a, b in zip(found, inner, strict=True)
                 if a.kind != "drift" or b.size_s * a.size_s > _LASTS * a.size_s**2)  # fmt: skip


def _known_to_settle(
    time_s: Array, low: Array, begins: Sequence[float], blocks: Blocks
) -> tuple[Shape, ...]:
    """Locks that settle from known moments on, with the time constants that explain most."""
    length = float(time_s[-1] - time_s[0])
    drift = Shape("drift", begin_s=float(time_s[0]), end_s=float(time_s[-1]))
    found: tuple[Shape, ...] = (drift,) if begins else ()  # a needless one is pruned
    for begin in begins[:MOST_SHAPES]:
        keep = ~straddling((Shape("step", begin_s=begin),), time_s, blocks.length_s)
        base = np.linalg.qr(_columns(found, time_s[keep]))[0]
        rest = low[keep] - base @ (base.T @ low[keep])
        trials = [Shape("relock", begin_s=begin, end_s=begin, settle_s=share * length)
                  for share in (0.5 * SETTLINGS[0], *SETTLINGS)]  # fmt: skip
        best = max(trials, key=lambda s: _gain(s, time_s[keep], base, rest))
        grown = polished((*found, best), [True] * (len(found) + 1), blocks, within=1.1)
        if abs(grown[-1].size_s) > SURE * grown[-1].sigma_s:
            found = grown
    return found


def _in_two_rates(found: tuple[Shape, ...], blocks: Blocks) -> tuple[Shape, ...]:
    """In place of several slow shapes one change of rate, where that explains as much."""
    slow = [s for s in found if s.kind not in ("step", "episode")]
    if not any(s.kind != "drift" for s in slow):
        return found
    others = tuple(s for s in found if s not in slow)
    keep = blocks.usable & ~straddling(found, blocks.time_s, blocks.length_s)
    time_s, low = blocks.time_s[keep], blocks.low_s[keep]
    if time_s.size < 12:
        return found
    first, last = float(time_s[0]), float(time_s[-1])
    drift = Shape("drift", begin_s=first, end_s=last)
    trials = [(*others, drift, Shape("ramp", begin_s=float(e), end_s=last)) for e in time_s[3:-3]]
    worst = [float(np.sum(_rest(time_s, low, trial) ** 2)) for trial in trials]
    best = polished(trials[int(np.argmin(worst))], [True] * (len(others) + 2), blocks)
    now = float(np.sum(_rest(time_s, low, found) ** 2))
    new = float(np.sum(_rest(time_s, low, best) ** 2))
    more = sum(_PENALTY[s.kind] for s in slow) - _PENALTY["ramp"]
    return best if new < now + more * blocks.noise_s**2 else found


def believed(shape: Shape, blocks: Blocks, least_s: float) -> bool:
    """Whether a shape is large enough to be named."""
    share = _DRIFT_SHARE if shape.kind == "drift" else _STEP_SHARE
    least_s = max(least_s, _LEAST_RUN_S if shape.kind in ("drift", "bend", "ramp") else 0.0)
    floor = max(share * blocks.spread_s, least_s, SURE * shape.sigma_s)
    return abs(shape.size_s) > floor and (
        shape.kind in ("drift", "bend", "ramp", "step") or _seen(shape, blocks)
    )


def has_size(shape: Shape, least_s: float) -> bool:
    """Whether anything is left of a step once its edges are known to the message: blocks that hold
    both sides of an edge tell no size, and a short episode may lie in such alone."""
    jumps = shape.kind in ("step", "episode", "relock")
    return not jumps or abs(shape.size_s) > max(shape.sigma_s, least_s)


def _seen(shape: Shape, blocks: Blocks) -> bool:
    """Whether what an episode does is seen in enough blocks, and not while the host was busy."""
    away = np.abs(shape.at(blocks.time_s)) > 0.1
    return int(away.sum()) >= _LEAST_BLOCKS and float(np.mean(blocks.usable[away])) > 0.75


def _columns(shapes: tuple[Shape, ...], time_s: Array) -> Array:
    return np.stack([np.ones(time_s.size), *(s.at(time_s) for s in shapes)], axis=1)


def _fitted(
    time_s: Array, low: Array, shapes: tuple[Shape, ...], blocks: Blocks
) -> tuple[Shape, ...]:
    """All sizes anew, with what they are worth."""
    columns = _columns(shapes, time_s)
    sizes, *_ = np.linalg.lstsq(columns, low, rcond=None)
    rest = low - columns @ sizes
    noise = max(blocks.noise_s, float(np.sqrt(np.mean(np.minimum(rest**2, 9 * blocks.noise_s**2)))))
    spread = np.sqrt(np.maximum(np.diag(np.linalg.pinv(columns.T @ columns)), 0.0)) * noise
    return tuple(
        replace(shape, size_s=float(sizes[k + 1]), sigma_s=float(spread[k + 1]))
        for k, shape in enumerate(shapes)
    )


def _rest(time_s: Array, low: Array, shapes: tuple[Shape, ...]) -> Array:
    columns = _columns(shapes, time_s)
    sizes, *_ = np.linalg.lstsq(columns, low, rcond=None)
    return np.asarray(low - columns @ sizes)


def _best(
    time_s: Array, low: Array, found: tuple[Shape, ...], blocks: Blocks,
    families: tuple[ShapeFamily, ...], keep: Mask,
) -> Shape | None:  # fmt: skip
    """The shape that explains most of what is left, in units of the noise."""
    base = np.linalg.qr(_columns(found, time_s))[0]
    rest = low - base @ (base.T @ low)
    best, rivals = SURE**2, []
    for shapes, all_courses in families:
        courses = all_courses[:, keep]
        own = courses - (courses @ base) @ base.T
        norm = np.einsum("ij,ij->i", own, own)
        usable = norm > 0.5
        gain = np.zeros(norm.size)
        gain[usable] = (own[usable] @ rest) ** 2 / norm[usable] / blocks.noise_s**2
        shape = shapes[int(np.argmax(gain))]
        worth = _worth(shape, float(gain.max()))
        best = max(best, worth)
        rivals.append((worth, shape))
    refined = [_refined(time_s, low, found, s) for worth, s in rivals if worth > _RIVAL * best]
    worths = [_worth(s, _gain(s, time_s, base, rest) / blocks.noise_s**2) for s in refined]
    if not worths or max(worths) <= SURE**2:
        return None
    return refined[int(np.argmax(worths))]


def _worth(shape: Shape, gain: float) -> float:
    """What a shape explains beyond what its freedom would by chance."""
    penalty = _PENALTY[shape.kind]
    return gain * (1.0 - _EXTRA * penalty) - penalty


def _refined(time_s: Array, low: Array, found: tuple[Shape, ...], shape: Shape) -> Shape:
    """Begin, end and settling of a shape, made finer one after another."""
    if shape.kind in ("drift", "bend"):
        return shape
    base = np.linalg.qr(_columns(found, time_s))[0]
    rest = low - base @ (base.T @ low)
    width = float(np.median(np.diff(time_s)))
    knot = max(width, float(time_s[-1] - time_s[0]) / KNOTS)
    best, gained = shape, _gain(shape, time_s, base, rest)
    for scale in (1.0, 0.5, 0.25):
        for trial in list(around(best, scale * knot, scale, float(time_s[-1]))):
            gain = _gain(trial, time_s, base, rest)
            if gain > gained * (1.0 + 1e-9):
                best, gained = trial, gain
    return best


def _gain(shape: Shape, time_s: Array, base: Array, rest: Array) -> float:
    own = shape.at(time_s)
    own = own - base @ (base.T @ own)
    norm = float(own @ own)
    return float(own @ rest) ** 2 / norm if norm > 0.5 else 0.0


def _pruned(
    time_s: Array, low: Array, shapes: tuple[Shape, ...], blocks: Blocks
) -> tuple[Shape, ...]:
    """Shapes that later ones made needless are left out."""
    kept = shapes
    changed = True
    while changed and kept:
        changed = False
        kept = _fitted(time_s, low, kept, blocks)
        full = float(np.sum(_rest(time_s, low, kept) ** 2))
        for shape in kept:
            others = tuple(s for s in kept if s is not shape)
            worse = float(np.sum(_rest(time_s, low, others) ** 2)) - full
            if worse < SURE**2 * blocks.noise_s**2:
                kept, changed = others, True
                break
    return kept


def polished(
    shapes: tuple[Shape, ...], fixed: Sequence[bool], blocks: Blocks, within: float = 0.5
) -> tuple[Shape, ...]:
    """Sizes and time constants by robust least squares, begins kept where they are known.

    Blocks in which something begins or ends hold both sides of it and are left out; within: how
    far from it, in blocks.
    """
    from scipy.optimize import least_squares

    curved = [s for s in shapes if s.kind in ("relock", "holdover", "ramp")]
    use = blocks.usable & ~straddling(shapes, blocks.time_s, within * blocks.length_s)
    time_s, low = blocks.time_s[use], blocks.low_s[use]
    if time_s.size < len(shapes) + 3:
        return shapes
    if not curved:
        return _fitted(time_s, low, shapes, blocks)
    start, scale = _free(shapes, fixed, blocks)
    if time_s.size < start.size + len(shapes) + 4:
        return _fitted(time_s, low, shapes, blocks)

    span = float(np.ptp(time_s))
    settle = math.log(blocks.length_s), math.log(_LONGEST * span)
    limits = *settle, float(time_s[0]), float(time_s[-1])

    def rest(values: Array) -> Array:
        moved = _set(shapes, fixed, start + values * scale, limits)
        return _rest(time_s, low, moved) / blocks.noise_s

    found = least_squares(rest, np.zeros(start.size), loss="soft_l1", f_scale=2.0, max_nfev=60)
    best = _set(shapes, fixed, start + found.x * scale, limits)
    return _fitted(time_s, low, best, blocks)


def _free(
    shapes: tuple[Shape, ...], fixed: Sequence[bool], blocks: Blocks
) -> tuple[Array, Array]:  # fmt: skip
    """What is free of curved shapes, and how far a unit of it goes."""
    values, scale = [], []
    for shape, known in zip(shapes, fixed, strict=True):
        if shape.kind in ("relock", "holdover"):
            values.append(math.log(shape.settle_s))
            scale.append(0.1)
            if not known:
                values.append(shape.end_s)
                scale.append(blocks.length_s)
            if shape.kind == "holdover":
                values.append(shape.begin_s)
                scale.append(blocks.length_s)
        elif shape.kind == "ramp":
            values += [shape.begin_s, shape.end_s]
            scale += 2 * [blocks.length_s]
    return np.asarray(values), np.asarray(scale)


def _set(
    shapes: tuple[Shape, ...], fixed: Sequence[bool], values: Array,
    limits: tuple[float, float, float, float],
) -> tuple[Shape, ...]:  # fmt: skip
    """The shapes with those values, in the order of `_free`; limits: of log settling times, and the
    log's begin, before which nothing drifts away."""
    left = [float(v) for v in values]
    shortest, longest, first, last = limits
    out = []
    for shape, known in zip(shapes, fixed, strict=True):
        if shape.kind in ("relock", "holdover"):
            settle = math.exp(min(max(left.pop(0), shortest), longest))
            end = shape.end_s if known else left.pop(0)
            away = max(left.pop(0), first) if shape.kind == "holdover" else end
            begin = min(away, end - 1e-6) if shape.kind == "holdover" else end
            shape = replace(shape, settle_s=settle, begin_s=begin, end_s=end)
        elif shape.kind == "ramp":
            begin = min(max(left.pop(0), first), last - 1e-3)
            shape = replace(shape, begin_s=begin, end_s=min(max(left.pop(0), begin + 1e-3), last))
        out.append(shape)
    return tuple(out)


def smallest(blocks: Blocks) -> tuple[float, float]:
    """The smallest step in the middle of the log [s] and drift over it [s] that would be named."""
    time_s = blocks.time_s[blocks.usable]
    if time_s.size < 8:
        return np.inf, np.inf
    middle = float(np.median(time_s))
    step = _fitted(time_s, 0.0 * time_s, (Shape("step", begin_s=middle),), blocks)[0].sigma_s
    drift = Shape("drift", begin_s=float(time_s[0]), end_s=float(time_s[-1]))
    over = _fitted(time_s, 0.0 * time_s, (drift,), blocks)[0].sigma_s
    return (
        max(SURE * step, _STEP_SHARE * blocks.spread_s),
        max(SURE * over, _DRIFT_SHARE * blocks.spread_s, _LEAST_RUN_S),
    )
