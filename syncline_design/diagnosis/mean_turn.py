"""A lever arm that attitudes off by a constant turn would show as well, in a log of positions.

A small turn a of the measured attitude R exp(S(a)) moves the place of the reference point by
R (l x a), l the spec's arm, as an arm that is off by d = l x a does: no motion tells the two.  Of d
across l the least such turn is a = d x l / |l|^2; what is along l no turn makes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from syncline_design.diagnosis.position_arms import holds_arms, with_arms_told
from syncline_design.diagnosis.result import Finding
from syncline_design.diagnosis.scene import Scene
from syncline_design.effects import registry
from syncline_design.effects.record import Array
from syncline_design.model.figure_text import format_quantity
from syncline_design.model.quantity import Dimension

BROKEN, ALONG = "mounting", "xyz"  # the assumption that such a turn breaks


def with_mean_turn(named: Sequence[Finding], view: Scene) -> tuple[Finding, ...]:
    """The findings, an arm of a position log with the turn of the attitudes that it may be."""
    return with_arms_told(named, view, _with_turn) if holds_arms(view) else tuple(named)


def _with_turn(one: Finding, arm_m: Array) -> Finding:
    turn_rad = least_turn_rad(one, arm_m)
    if turn_rad is None:
        return one
    size = format_quantity(turn_rad, Dimension.ANGLE, 2)
    words = (
        f"attitudes that are off by {size} on the average would make the same error: look at them "
        "before the arm is changed"
    )
    return replace(one, evidence=f"{one.evidence}; {words}")


def least_turn_rad(one: Finding, arm_m: Array) -> float | None:
    """The least turn that makes the error of an arm; None where none makes it, or none so large."""
    length2 = float(arm_m @ arm_m)
    figures = [one.parameters[f"{axis}_m"] for axis in ALONG]
    reach = [f.interval95 for f in figures]
    if length2 == 0.0 or any(r is None for r in reach):
        return None
    off_m = np.array([float(f.value) for f in figures])
    half_m = np.array([0.5 * (high - low) for low, high in filter(None, reach)])
    along = arm_m / math.sqrt(length2)
    if abs(float(off_m @ along)) > float(np.linalg.norm(along * half_m)):
        return None
    turn_rad = float(np.linalg.norm(np.cross(off_m, arm_m))) / length2
    return turn_rad if turn_rad <= _most_rad() else None


def _most_rad() -> float:
    """How far a mounting may be turned before the log is taken for something else."""
    names = [f"{axis}_rad" for axis in ALONG]
    return min(
        parameter.high
        for one in registry().values()
        if one.breaks == BROKEN and [p.name for p in one.parameters] == names
        for parameter in one.parameters
    )
