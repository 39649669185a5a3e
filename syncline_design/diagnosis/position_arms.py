"""Lever arms that a log of positions of one vehicle tells, for what else would look like them."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from syncline_design.diagnosis.result import Finding
from syncline_design.diagnosis.scene import Scene
from syncline_design.effects import registry
from syncline_design.effects.record import Array


def holds_arms(view: Scene) -> bool:
    """Whether an arm of such a log may be something else: that of one vehicle's positions."""
    return view.log.kind == "position" and len(view.system.stages) == 1


def with_arms_told(
    named: Sequence[Finding], view: Scene, tell: Callable[[Finding, Array], Finding]
) -> tuple[Finding, ...]:
    """The findings, each arm as told by `tell` from the spec's own arm [m], shape (3,)."""
    arm_m = np.broadcast_to(view.rows[0].antenna_m, (len(view), 3))[0]
    return tuple(tell(one, arm_m) if _is_arm(one) else one for one in named)


def _is_arm(one: Finding) -> bool:
    return registry()[one.effect].breaks == "lever_arm" and one.sensor == "position"
