"""Velocity columns in the axes or the unit that the places were in, undone with these.

With the places undone by a matrix B, velocities v stay as they are or become B v.  Which of the two
the slope s of the places bears out is one figure, the regression of s - v on B v - v: 0 or 1.
"""

from __future__ import annotations

import numpy as np

from syncline_design.diagnosis.convention import first_changed, velocity_turned
from syncline_design.effects.record import Array
from syncline_design.logs.derivatives import derived_velocity
from syncline_design.logs.log import Log

EXACT = 1e-6  # of the places: what a matrix may leave of them
TURNED = 0.5  # from which a velocity is nearer to the turned one


def with_velocity_alike(before: Log, after: Log) -> Log | None:
    """A log whose places were undone, its velocities undone alike; None: they are right."""
    held, now = before.stages[0], after.stages[0]
    derived = held.follows_position or held.follows_reference
    if derived or len(before) != len(after) or now.velocity_mps is not held.velocity_mps:
        return None
    back = _matrix(before, after)
    if back is None:
        return None
    known = np.all(np.isfinite(after.truth_m), axis=1)
    better = after.kind == "position" and bool(np.all(known))
    place = after.truth_m if better else now.antenna_m
    assert place is not None
    slope, by = derived_velocity(after.time_s, place), held.velocity_mps @ back.T
    change = by - held.velocity_mps
    share = float(np.sum((slope - held.velocity_mps) * change)) / max(np.sum(change**2), 1e-300)
    if share < TURNED:
        return None
    return first_changed(after, lambda one: velocity_turned(one, back))


def _matrix(before: Log, after: Log) -> Array | None:
    """By which the places were turned or scaled, if they were by one; of a position log's
    reference where that was."""
    pairs = [(before.stages[0].antenna_m, after.stages[0].antenna_m)]
    if before.kind == "position":
        pairs.append((before.truth_m, after.truth_m))
    for old, new in pairs:
        if old is None or new is None or old is new or not np.all(np.isfinite([old, new])):
            continue
        if np.array_equal(old, new):
            continue
        found = np.asarray(np.linalg.lstsq(old, new, rcond=None)[0].T, dtype=np.float64)
        left = np.max(np.abs(new - old @ found.T))
        return found if left < EXACT * np.max(np.abs(new)) else None
    return None
