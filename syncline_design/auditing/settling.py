"""Locks that settle within few stretches of a log, message by message."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from syncline_design.auditing.blocks import Blocks
from syncline_design.auditing.clock_shapes import Shape, course
from syncline_design.auditing.series import Array

_COARSE: Final = 12.0  # stretches: what settles more slowly they tell well
_BEFORE, _AFTER = 3.0, 6.0  # time constants
_LEAST, _MOST = 12, 4000  # messages
_NEAR: Final = 0.25  # of a size and a time constant that stretches told
_REST: Final = 0.05  # of a lock: what stretches leave of it
_LASTS: Final = 5.0  # time constants


def settled(
    shapes: tuple[Shape, ...], time_s: Array, late: Array, blocks: Blocks
) -> tuple[Shape, ...]:
    """Shapes with the sizes and time constants of quick locks told by messages, without the small
    ones that stand for what stretches were too coarse for."""
    shapes = tuple(s for s in shapes if not any(_is_rest(s, other, blocks) for other in shapes))
    for shape in shapes:
        if _is_quick(shape, blocks):
            others = tuple(s for s in shapes if s is not shape)
            better = _by_messages(shape, time_s, late - course(others, time_s), blocks)
            shapes = tuple(better if s is shape else s for s in shapes)
    return shapes


def _is_quick(shape: Shape, blocks: Blocks) -> bool:
    return shape.kind == "relock" and shape.settle_s < _COARSE * blocks.length_s


def _is_rest(shape: Shape, lock: Shape, blocks: Blocks) -> bool:
    """Whether a shape is a small part of a lock's course that begins while it settles."""
    if shape is lock or shape.kind not in ("relock", "holdover") or not _is_quick(lock, blocks):
        return False
    after = lock.begin_s - blocks.length_s < shape.end_s < lock.begin_s + _LASTS * lock.settle_s
    return after and abs(shape.size_s) < _REST * abs(lock.size_s)


def _by_messages(shape: Shape, time_s: Array, late: Array, blocks: Blocks) -> Shape:
    """Size and time constant by robust least squares; as it was where these would be others."""
    from scipy.optimize import least_squares

    first = shape.begin_s - _BEFORE * shape.settle_s
    near = np.flatnonzero((time_s > first) & (time_s < shape.begin_s + _AFTER * shape.settle_s))
    near = near[:: max(1, near.size // _MOST)]
    when, told = time_s[near], late[near]
    before = when < shape.begin_s
    if near.size < _LEAST or not before.any():
        return shape
    width = max(blocks.spread_s, 1e-9)

    def apart(values: Array) -> Array:
        size, settle = values[0], shape.settle_s * np.exp(values[1])
        trial = replace(shape, size_s=1.0, settle_s=float(settle))
        return np.asarray((told - size * trial.at(when) - values[2]) / width)

    start = np.asarray([shape.size_s, 0.0, float(np.median(told[before]))])
    scale = np.asarray([abs(shape.size_s), 1.0, abs(shape.size_s)])
    found = least_squares(apart, start, x_scale=scale, loss="soft_l1", max_nfev=60)
    size, slower = float(found.x[0]), float(found.x[1])
    if abs(size - shape.size_s) > _NEAR * abs(shape.size_s) or abs(slower) > _NEAR:
        return shape
    return replace(shape, size_s=size, settle_s=shape.settle_s * float(np.exp(slower)))
