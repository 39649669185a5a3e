"""Transport that all streams share, as of a radio link or a busy host, against a recorder's clock.

Transport only delays: receipts come later for a while, never earlier than over an idle link.  So
levels of receipt minus stamp lie on a line (idle, by a clock that drifts) or above it, on the line
before and after each swell.  What a clock does lasts, or goes below that line.  The line is the low
quantile of the levels that is straight.  A log that begins or ends within a swell has no level on
one side of it: a clock that is slewed then looks the same, and none is named.
Source: Koenker and Bassett, Econometrica 46 (1978), on regression quantiles.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from syncline_design.auditing.blocks import Blocks
from syncline_design.auditing.clock_shapes import Shape
from syncline_design.auditing.series import Array

_QUANTILE: Final = 0.25
_IDLE: Final = 1.0 / 3.0  # share of the levels on each side that have to be of an idle link
_NEAR: Final = 0.05  # of a shape's size: how near the line an idle level lies
_NOISE: Final = 3.0  # and of the levels' scatter
_FEWEST: Final = 3  # levels on each side
_LEAST_S: Final = 3.0  # and for how long: a swell near an end of the log is not over before that


def lasting(blocks: Blocks, shapes: Sequence[Shape], sharp: Sequence[Shape] = ()) -> list[Shape]:
    """Shapes but for those that transport makes by itself; sharp: from one message to the next."""
    if len(blocks) < 2 * _FEWEST:
        return list(shapes)
    above = blocks.low_s - _idle_line(blocks.time_s, blocks.low_s)
    return [one for one in shapes if one in sharp or not _is_transport(blocks, above, one)]


def _is_transport(blocks: Blocks, above: Array, shape: Shape) -> bool:
    near = _NEAR * abs(shape.size_s) + _NOISE * blocks.noise_s
    sides = (blocks.time_s < shape.begin_s, blocks.time_s > _over_s(shape))
    told = [
        side for side in sides
        if np.sum(side) >= _FEWEST and np.ptp(blocks.time_s[side]) >= _LEAST_S
    ]  # fmt: skip
    return bool(np.all(above >= -near)) and all(
        np.mean(np.abs(above[side]) <= near) >= _IDLE for side in told
    )


def _over_s(shape: Shape) -> float:
    """When a shape has come to where it stays."""
    return shape.begin_s if shape.kind == "step" else shape.end_s


def _idle_line(time_s: Array, low_s: Array) -> Array:
    """a + b t of least sum of q r+ + (1 - q) r-, r the levels less the line; a linear programme."""
    from scipy.optimize import linprog

    count = time_s.size
    line = np.column_stack([np.ones(count), (time_s - time_s[0]) / np.ptp(time_s)])
    cost = np.concatenate([np.zeros(2), np.full(count, _QUANTILE), np.full(count, 1.0 - _QUANTILE)])
    scale = max(float(np.ptp(low_s)), 1e-12)
    equal = np.hstack([line, np.eye(count), -np.eye(count)])
    bounds = [(None, None)] * 2 + [(0.0, None)] * (2 * count)
    right = (low_s - low_s.min()) / scale
    solved = linprog(cost, A_eq=equal, b_eq=right, bounds=bounds, method="highs")
    found: Array = low_s.min() + scale * (line @ solved.x[:2])
    return found
