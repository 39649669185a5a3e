"""Lever arms of a stage as its spec gives them, and how long they are."""

from __future__ import annotations

import math

from syncline_design.model.system import Stage


def position_lever_arm(stage: Stage, first: bool) -> tuple[float, float, float] | None:
    """l_G [m], body, as the spec gives it: the antenna's, later the transponder's."""
    if first:
        return None if stage.position is None else stage.position.lever_arm_m
    return stage.transponder_lever_arm_m


def arm_lengths(stage: Stage, first: bool) -> tuple[float, float]:
    """(|l_G|, largest |l_L - l_G|) [m]; a free l_G has length b and any direction.

    Without a ranging sensor the antenna itself is located: (|l_G|, 0).
    """
    given = position_lever_arm(stage, first)
    length = float(stage.platform.baseline_m) if given is None else math.hypot(*given)
    if stage.ranging is None:
        return length, 0.0
    ranging = stage.ranging.lever_arm_m or (0.0, 0.0, 0.0)
    if given is None:
        return length, length + math.hypot(*ranging)
    return length, math.dist(given, ranging)


def arm_difference(stage: Stage, first: bool) -> tuple[float, float, float] | None:
    """l_L - l_G [m], body; None where l_G is free or nothing ranges."""
    given = position_lever_arm(stage, first)
    if given is None or stage.ranging is None:
        return None
    x, y, z = stage.ranging.lever_arm_m or (0.0, 0.0, 0.0)
    return x - given[0], y - given[1], z - given[2]


def ranging_arm_m(stage: Stage) -> float:
    """|l_L| [m]; 0 where it is not given or nothing ranges."""
    if stage.ranging is None or stage.ranging.lever_arm_m is None:
        return 0.0
    return math.hypot(*stage.ranging.lever_arm_m)
