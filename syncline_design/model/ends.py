"""Systems at one distance each, of stages whose objects are at several distances.

For one draw of everything else the error is e = a + d b in each stage's distance d, so that |e| is
largest at an end; sums of sensor errors and rates are of the same form.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import replace

from syncline_design.model.system import Stage, System


def stage_ends(stage: Stage) -> tuple[Stage, ...]:
    """The stage with its object at the far end of its distances, and at the near end, if any."""
    platform = stage.platform
    if stage.ranging is None or platform.nearest_m is None:
        return (stage,)
    ends = dict.fromkeys((platform.distance_m, platform.nearest_m))
    return tuple(
        replace(stage, platform=replace(platform, distance_m=d, nearest_m=None)) for d in ends
    )


def at_ends(system: System) -> Iterator[System]:
    """The system at every combination of ends, the far ones first; itself where there are none."""
    if not any(len(stage_ends(stage)) > 1 for stage in system.stages):
        yield system
        return
    for stages in itertools.product(*map(stage_ends, system.stages)):
        yield replace(system, stages=stages)


def distances_of(system: System, end: System) -> Mapping[str, float]:
    """Where the objects of stages with several distances are in one of them [m], by stage."""
    return {
        stage.name: float(there.platform.distance_m)
        for stage, there in zip(system.stages, end.stages, strict=True)
        if stage.ranging is not None and stage.platform.nearest_m is not None
    }
