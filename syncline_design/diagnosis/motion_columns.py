"""Motion columns that contradict the poses: what the poses say takes their place.

A delay of 60 ms beside velocities that hold a constant 0.4 m/s leaves 24 mm in every row, which
only a datum could explain: a cause that is none.  The slope of the places has no such constant.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from syncline_design.diagnosis.checks import contradicted_columns
from syncline_design.diagnosis.result import Check
from syncline_design.diagnosis.scene import Scene
from syncline_design.effects import registry
from syncline_design.effects.acting import Acting
from syncline_design.logs.derivatives import derived_rate, derived_velocity
from syncline_design.logs.log import Log, StageLog

MEMORIES_S = np.geomspace(0.1, 10.0, 14)  # of a filter, one and a half times the last


def is_excusable(view: Scene) -> bool:
    """Whether a smoothed position might be all that is wrong with the velocity columns.

    Some effect with a memory then brings both together, and what is found decides.
    """
    if not contradictions(view):
        return True
    slow = [one for one in registry().values() if one.memory and "position" in one.sensors]
    return any(
        not contradictions(view, [Acting(one, "position", 0, {one.memory: float(constant_s)})])
        for one in slow
        for constant_s in MEMORIES_S
    )


def contradictions(view: Scene, named: Sequence[Acting] = ()) -> tuple[Check, ...]:
    """Columns that the poses can stand in for; named: what was found, which may excuse them.

    Places of a later stage are as noisy as the chain before it, and no better than its velocities.
    """
    first = view.system.stages[0].name
    return tuple(
        one
        for one in contradicted_columns(view, named)
        if one.code == "rate_columns" or one.stage == first
    )


def with_slopes(log: Log, wrong: Sequence[Check]) -> Log:
    """The log with the slopes of its poses where its columns contradict them, and a note of it."""
    stages, notes = [], []
    for stage in log.stages:
        codes = [one.code for one in wrong if one.stage == stage.name]
        if "velocity_columns" in codes:
            stage, source = _with_velocity(log, stage)
            notes.append(f"velocity of {stage.name} is the slope of {source}, not its columns")
        if "rate_columns" in codes:
            rate = derived_rate(log.time_s, stage.euler_rad)
            stage = replace(stage, rate_radps=rate, rate_track=None)
            notes.append(f"rates of {stage.name} are the slope of its attitude, not its columns")
        stages.append(stage)
    return replace(log, stages=tuple(stages), notes=(*log.notes, *notes))


def _with_velocity(log: Log, stage: StageLog) -> tuple[StageLog, str]:
    better = log.kind == "position" and bool(np.all(np.isfinite(log.truth_m)))
    place_m = log.truth_m if better else stage.antenna_m
    assert place_m is not None
    found = replace(
        stage,
        velocity_mps=derived_velocity(log.time_s, place_m),
        velocity_track=None,
        follows_position=not better,
        follows_reference=better,
    )
    return found, "the reference positions" if better else "its own positions"


def columns_of(said: Sequence[Check]) -> set[tuple[str, str]]:
    """Which columns of which stage a contradiction is about."""
    return {(one.code, one.stage) for one in said}


def merged_checks(said: Sequence[Check], after: Sequence[Check]) -> tuple[Check, ...]:
    """What was said of columns before they were replaced, and what else there is to say."""
    known = columns_of(said)
    rest = [one for one in after if (one.code, one.stage) not in known]
    return tuple(sorted((*said, *rest), key=lambda c: c.severity != "contradiction"))
