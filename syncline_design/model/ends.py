"""Systems at one distance each, of stages whose objects are at several distances.

For one draw of everything else the error is e = a + d b in each stage's distance d, so that |e| is
largest at an end; sums of sensor errors and rates are of the same form.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import replace

from syncline_design.model.system import ShareCurve, Stage, System


def stage_ends(stage: Stage) -> tuple[Stage, ...]:
    """The stage with its object at the far end of its distances, at the near end, and where its
    ranging noise bends in between, if any."""
    platform = stage.platform
    if stage.ranging is None or platform.nearest_m is None:
        return (stage,)
    near, far = platform.nearest_m, platform.distance_m
    bends = (place for place, _ in stage.ranging.range_shape if near < place < far)
    return tuple(at_distance(stage, d) for d in dict.fromkeys((far, near, *bends)))


def at_distance(stage: Stage, distance_m: float) -> Stage:
    """The stage with its object at one distance [m], and its noise as it is there."""
    moved = replace(stage.platform, distance_m=distance_m, nearest_m=None)
    ranging = stage.ranging
    if ranging is None or not ranging.range_shape:
        return replace(stage, platform=moved)
    share = share_at(ranging.range_shape, distance_m)
    first, second, third = ranging.sigma
    shape = tuple((place, one / share) for place, one in ranging.range_shape)
    there = replace(ranging, sigma=(first * share, second, third), range_shape=shape)
    return replace(stage, platform=moved, ranging=there)


def share_at(shape: ShareCurve, place: float) -> float:
    """The share of a shape at a place, a straight line between two; the outermost hold beyond."""
    before = shape[0]
    for here in shape:
        if place <= here[0]:
            width = here[0] - before[0]
            return (
                here[1]
                if not width
                else (before[1] + (here[1] - before[1]) * (place - before[0]) / width)
            )
        before = here
    return before[1]


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
