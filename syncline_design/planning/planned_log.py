"""A drive as the log that it will give: the noise-free readings of the spec's own system."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from syncline_design.diagnosis.scene import levers
from syncline_design.effects.kinematics import rotate
from syncline_design.effects.record import Array
from syncline_design.logs.log import Log, StageLog
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.system import System
from syncline_design.planning.aims import Aims, aims
from syncline_design.planning.path import PathStates, point_of
from syncline_design.planning.vehicle import Vehicle

AIRBORNE = ("multirotor", "fixed_wing", "level")
ROWS_OF_STAGE = (
    "antenna_m", "euler_rad", "velocity_mps", "rate_radps", "range_m", "azimuth_rad",
    "elevation_rad",
)  # fmt: skip
DWELL_S = 1.0  # for which one target is aimed at


@dataclass(frozen=True, slots=True)
class Drive:
    """States of every stage at the rows, and what the last one aims at (None: nothing to)."""

    states: tuple[PathStates, ...]
    aims: Aims | None

    @property
    def time_s(self) -> Array:
        return self.states[0].time_s


def apart(vehicles: Sequence[Vehicle], states: Sequence[PathStates]) -> tuple[PathStates, ...]:
    """The stages' motions as far from each other as a chain has them: each below the last.

    What flies does so above its targets, which lie near the origin's level; what floats is at it.
    """
    airborne = vehicles[0].motion in AIRBORNE
    placed, offset = [], np.array([0.0, 0.0, -vehicles[0].depth_m if airborne else 0.0])
    for vehicle, one in zip(vehicles, states, strict=True):
        moved = PathStates(one.time_s, one.position_m + offset, one.velocity_mps,
                       one.acceleration_mps2, one.euler_rad, one.rate_radps)  # fmt: skip
        placed.append(moved)
        d = vehicle.distance_m
        offset = offset + np.array([0.45 * d, 0.25 * d, vehicle.depth_m])
    return tuple(placed)


def drive(
    system: System,
    vehicles: Sequence[Vehicle],
    states: Sequence[PathStates],
    surveyed: Array | None = None,
) -> Drive:
    """States with the targets that the last stage aims at; rows without one in sight go."""
    if system.stages[-1].ranging is None:
        return Drive(tuple(states), None)
    last = states[-1]
    step = float(np.median(np.diff(last.time_s)))
    found = aims(vehicles[-1], last.time_s, last.position_m, max(DWELL_S, step), surveyed)
    return Drive(tuple(states), found)


def turned(planned: Drive, angle_rad: float) -> Drive:
    """The same drive, targets included, turned about the vertical through the origin."""
    cos, sin = np.cos(angle_rad), np.sin(angle_rad)
    turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    states = tuple(
        replace(
            one,
            position_m=one.position_m @ turn.T,
            velocity_mps=one.velocity_mps @ turn.T,
            acceleration_mps2=one.acceleration_mps2 @ turn.T,
            euler_rad=one.euler_rad + np.array([0.0, 0.0, angle_rad]),
        )
        for one in planned.states
    )
    found = planned.aims
    aimed = None if found is None else Aims(found.targets_m @ turn.T, found.aimed)
    return Drive(states, aimed)


def planned_log(system: System, planned: Drive) -> Log:
    """The log of a drive: every column there is, without noise and without effects."""
    seen = np.full(len(planned.time_s), True)
    truth = _reference(system, planned)
    if planned.aims is not None:
        seen = planned.aims.aimed >= 0
        truth = planned.aims.aimed_m
    ranged = planned.aims is not None
    stages = []
    for index, (stage, states) in enumerate(zip(system.stages, planned.states, strict=True)):
        antenna, arm = levers(stage, index)
        polar: tuple[Array | None, Array | None, Array | None] = (None, None, None)
        if ranged:
            polar = _polar(states, arm, _object(system, planned, index))
        stages.append(
            StageLog(
                stage.name,
                point_of(states, antenna) if index == 0 else None,
                states.euler_rad,
                states.velocity_mps,
                states.rate_radps,
                *polar,
            )
        )
    kind = "georeference" if ranged else "position"
    targets = None if planned.aims is None else planned.aims.aimed.astype(np.float64)
    log = Log(kind, planned.time_s, tuple(stages), truth, targets, len(planned.time_s), {})  # type: ignore[arg-type]
    return log.rows(np.flatnonzero(seen))


def one_after_another(logs: Sequence[Log], gap_s: float) -> tuple[Log, tuple[int, ...]]:
    """Logs as the runs of one, with gaps between them; where each begins, and the end."""
    ends = np.cumsum([0, *(len(one) for one in logs)])
    times, at = [], 0.0
    for one in logs:
        times.append(one.time_s - one.time_s[:1] + at)
        at = float(times[-1][-1]) + gap_s if len(one) else at
    stages = []
    for k, first in enumerate(logs[0].stages):
        parts = [one.stages[k] for one in logs]
        joined: dict[str, Any] = {
            name: np.concatenate([getattr(part, name) for part in parts])
            for name in ROWS_OF_STAGE
            if getattr(first, name) is not None
        }
        stages.append(replace(first, **joined))
    whole = replace(
        logs[0],
        time_s=np.concatenate(times),
        stages=tuple(stages),
        truth_m=np.concatenate([one.truth_m for one in logs]),
        target_id=None,
        rows_read=int(ends[-1]),
    )
    return whole, tuple(int(e) for e in ends)


def _reference(system: System, planned: Drive) -> Array:
    """The reference point itself: what a better system tells of a log of positions."""
    return planned.states[0].position_m


def _object(system: System, planned: Drive, index: int) -> Array:
    """What a stage's ranging sensor sights: the next stage's transponder, or the target."""
    if index + 1 == len(system.stages):
        assert planned.aims is not None
        return planned.aims.aimed_m
    arm, _ = levers(system.stages[index + 1], index + 1)
    return point_of(planned.states[index + 1], arm)


def _polar(states: PathStates, arm_m: Array, object_m: Array) -> tuple[Array, Array, Array]:
    """Range, azimuth and elevation of an object from the ranging sensor."""
    back = np.swapaxes(states.rotation, 1, 2)
    vector = rotate(back, object_m - states.position_m) - arm_m
    distance = np.linalg.norm(vector, axis=1)
    azimuth = np.arctan2(vector[:, 1], vector[:, 0])
    elevation = np.arcsin(np.clip(-vector[:, 2] / np.where(distance > 0, distance, 1), -1, 1))
    return distance, azimuth, elevation
