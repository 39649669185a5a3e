"""Which timestamps meet in a system, and how far apart they can be.

A stage's estimate takes the position and the attitude as of the moment at which its ranging
sensor measured, so what counts is each one's timestamp error relative to the ranging sensor's.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from syncline_design.model import timing
from syncline_design.model.known import Known
from syncline_design.model.roles import RoleName
from syncline_design.model.system import UTC, Sensor, Stage, System


@dataclass(frozen=True, slots=True)
class PairRow:
    """One pair of timestamps: relative error at most tau_s = tau_a + tau_ref + offset.

    stage, role: whose estimate it enters and as what (position or attitude); sensor: the sensor
    that measured it (in a later stage's position pair the ranging sensor of the stage before);
    reference: the ranging sensor of the stage, "" for true time, which is on UTC.
    rate_mps: how fast the estimate moves with the relative error; sync_error_m = rate_mps * tau_s.
    """

    stage: str
    role: RoleName
    sensor: str
    reference: str
    tau_s: float
    offset_s: float
    rate_mps: float
    sync_error_m: float


def largest(values: Iterable[float]) -> float:
    """The largest value; nan if any is nan (plain `max` would depend on the order); 0 of none."""
    result = 0.0
    for value in values:
        if math.isnan(value):
            return math.nan
        result = max(result, float(value))
    return result


def distance_m(stage: Stage) -> float:
    """Range d [m] of a stage: 0 for one without a ranging sensor, which locates itself only."""
    return 0.0 if stage.ranging is None else float(stage.platform.distance_m)


def tau_s(system: System, stage: Stage, sensor: Sensor, known: Known) -> float:
    """Bound tau_i [s] of a sensor's timestamp error against its timeline, plus what is added."""
    own = timing.bound(sensor.timing, system.coverage_factor)
    return own + known.extra_tau_s.get((stage.name, sensor.role), 0.0)


def offset_s(system: System, first: str, second: str) -> float:
    """Bound [s] of the offset between two timelines.

    0 on one and the same timeline, where a common offset cancels; otherwise the sum of both
    bounds against UTC (which is 0 for UTC itself).
    """
    if first == second:
        return 0.0
    bounds = (
        timing.bound(system.clock_offset(timeline), system.coverage_factor)
        for timeline in (first, second)
    )
    return math.fsum(bounds)


def pair_rows(system: System, known: Known) -> tuple[PairRow, ...]:
    """All pairs of the system, stage by stage: position, then attitude.

    In the first stage position and attitude against the ranging sensor; from the second stage on
    the position is the chain before it, stamped by that stage's ranging sensor.  A stage without
    a ranging sensor has its position stamp against true time: nothing cancels there, so a stamp
    of the host clock carries that clock's offset against UTC.
    """
    rows: list[PairRow] = []
    before: Stage | None = None
    for stage in system.stages:
        for role, owner, sensor, rate in _entering(stage, before):
            rows.append(_pair_row(system, known, stage, role, (owner, sensor), rate))
        before = stage
    return tuple(rows)


def _entering(stage: Stage, before: Stage | None) -> list[tuple[RoleName, Stage, Sensor, float]]:
    """(role, stage that owns the sensor, sensor, rate [m/s]) of what enters a stage's estimate."""
    platform = stage.platform
    owner, sensor = (stage, stage.position) if before is None else (before, before.ranging)
    if sensor is None:
        raise ValueError(f"stage {stage.name!r} has no position: {owner.name!r} does not give one")
    entering: list[tuple[RoleName, Stage, Sensor, float]] = [
        ("position", owner, sensor, float(platform.v_max_mps))
    ]
    if stage.ranging is not None:
        if stage.attitude is None:
            raise ValueError(f"stage {stage.name!r} has a ranging sensor but no attitude sensor")
        turning = distance_m(stage) * platform.omega_max_radps
        entering.append(("attitude", stage, stage.attitude, turning))
    return entering


def _pair_row(
    system: System,
    known: Known,
    stage: Stage,
    role: RoleName,
    measured_by: tuple[Stage, Sensor],
    rate_mps: float,
) -> PairRow:
    owner, sensor = measured_by
    reference = stage.ranging
    relative = tau_s(system, owner, sensor, known)
    against, name = UTC, ""
    if reference is not None:
        against, name = reference.timeline, reference.id
        relative += tau_s(system, stage, reference, known)
    offset = offset_s(system, sensor.timeline, against)
    relative += offset
    return PairRow(
        stage.name, role, sensor.id, name, relative, offset, rate_mps, rate_mps * relative
    )
