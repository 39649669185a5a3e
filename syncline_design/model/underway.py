"""What happens between two samples and while sound is on its way: terms beside noise and stamps.

While sound goes to the object and back, 2 d / c, the vehicle moves: (v_max + d omega_max) 2 d / c
[m], and the object by its own v_max 2 d / c where it carries the next stage, unless the maker
corrects for it: a fix of the ping's moment is stamped when its echo is back.  Position and attitude
are wanted between two of their samples, T apart: the straight line between them is off by at most
a_max T^2 / 8 from a path of that acceleration (the error of linear interpolation, h^2 / 8 max
|f''|, NIST DLMF 3.3.4), an attitude by alpha_max T^2 / 8, which moves an object by d times as much.
In a chain the fixes that the stage before relays are interpolated too.  These terms add to the
total, not to sensor error or tau_crit.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from syncline_design.model.pairing import distance_m
from syncline_design.model.roles import RoleName
from syncline_design.model.system import Sensor, Stage, System

TRAVEL = "(v_max+d*omega_max)*2d/c"
MOVED = "v_object*2d/c"
PATH = "a_max*T^2/8"
TURN = "alpha_max*T^2/8*d"
UnderwayCause = Literal["travel", "object", "path", "turn"]


@dataclass(frozen=True, slots=True)
class Underway:
    """One such term, of a sensor of a stage as it enters its estimate.

    role: what is shifted or interpolated; sensor, owner: which sensor does it, of which stage;
    size: 2 d / c [s] (travel, object), a_max T^2 / 8 [m] or alpha_max T^2 / 8 [rad]; value_m: the
    term.
    interval_s: T, of an interpolated one.
    """

    cause: UnderwayCause
    stage: int
    role: RoleName
    sensor: Sensor
    owner: Stage
    size: float
    value_m: float
    interval_s: float = 0.0

    @property
    def term(self) -> str:
        """Its name in the ledger."""
        return {"travel": TRAVEL, "object": MOVED, "path": PATH, "turn": TURN}[self.cause]


def echo_s(sensor: Sensor, distance: float) -> float:
    """2 d / c [s], how long sound takes to the object and back; 0 of what does not wait for it."""
    return 0.0 if sensor.sound_mps is None else 2.0 * distance / sensor.sound_mps


def interval_s(sensor: Sensor, distance: float) -> float:
    """T [s] between two samples, max(1 / rate, 2 d / c) as far as it is told; 0: it is not."""
    waits = 0.0 if sensor.rate_hz is None else 1.0 / sensor.rate_hz
    return max(waits, echo_s(sensor, distance))


def underway(system: System) -> tuple[Underway, ...]:
    """All such terms of a system that are not 0, stage by stage."""
    found: list[Underway] = []
    before: Stage | None = None
    for index, stage in enumerate(system.stages):
        moved = (*_of_stage(index, stage, before), *_of_object(index, system.stages[index:]))
        found += (one for one in moved if one.value_m)
        before = stage
    return tuple(found)


def _of_object(index: int, stages: tuple[Stage, ...]) -> Iterator[Underway]:
    """How far the vehicle that the first of some stages locates moves until its fix is stamped."""
    ranging = stages[0].ranging
    if ranging is not None and ranging.travels and len(stages) > 1:
        echo = echo_s(ranging, distance_m(stages[0]))
        speed = float(stages[1].platform.v_max_mps)
        yield Underway("object", index, "ranging", ranging, stages[0], echo, speed * echo)


def _of_stage(index: int, stage: Stage, before: Stage | None) -> Iterator[Underway]:
    platform, d = stage.platform, distance_m(stage)
    ranging, attitude = stage.ranging, stage.attitude
    if ranging is not None and ranging.travels:
        echo = echo_s(ranging, d)
        rate = float(platform.v_max_mps) + d * float(platform.omega_max_radps)
        yield Underway("travel", index, "ranging", ranging, stage, echo, rate * echo)
    owner, fixes = (stage, stage.position) if before is None else (before, before.ranging)
    if fixes is not None:
        apart = interval_s(fixes, distance_m(owner))
        bend = float(platform.acceleration_mps2) * apart**2 / 8.0
        yield Underway("path", index, "position", fixes, owner, bend, bend, apart)
    if ranging is not None and attitude is not None:
        apart = interval_s(attitude, 0.0)
        turn = float(platform.angular_acceleration_radps2) * apart**2 / 8.0
        yield Underway("turn", index, "attitude", attitude, stage, turn, turn * d, apart)
