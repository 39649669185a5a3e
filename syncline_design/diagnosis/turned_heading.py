"""A lever arm that a heading off by quarter turns would show as well, where no way tells the two.

With a yaw that is off by q, places R l of a level vehicle look like an arm Rz(-q) l.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from syncline_design.diagnosis.borne_out import FALLS_TO, WITHIN_RAD, heading_off
from syncline_design.diagnosis.position_arms import holds_arms, with_arms_told
from syncline_design.diagnosis.result import Finding
from syncline_design.diagnosis.scene import Scene
from syncline_design.effects.kinematics import euler_to_rotation
from syncline_design.effects.record import Array
from syncline_design.model.figure_text import to_places

QUARTERS_DEG = (90.0, 180.0, -90.0)


def with_turned_heading(named: Sequence[Finding], view: Scene) -> tuple[Finding, ...]:
    """The findings, an arm of a position log with the turn of the heading that it may be."""
    if not holds_arms(view):
        return tuple(named)
    off = heading_off(view)
    if off is not None and abs(off) < WITHIN_RAD:
        return tuple(named)
    return with_arms_told(named, view, _with_turn)


def _with_turn(one: Finding, arm_m: Array) -> Finding:
    found = np.array([float(e.value) for e in one.parameters.values()])
    for quarter in QUARTERS_DEG:
        (turn,) = euler_to_rotation(np.array([[0.0, 0.0, -math.radians(quarter)]]))
        left = np.linalg.norm(found - (turn @ arm_m - arm_m))
        if left < FALLS_TO * np.linalg.norm(found):
            words = (
                f"a yaw that is off by {to_places(quarter, 0)} deg would make the same error, and "
                "the way the vehicle goes does not tell: look at the heading before the arm is "
                "changed"
            )
            return replace(one, evidence=f"{one.evidence}; {words}")
    return one
