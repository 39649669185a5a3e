"""A chosen design as a System: what the Syncline, the simulator and the effects take."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from typing import NamedTuple

from syncline_design.choice.option import Option
from syncline_design.choice.table import Design, Problem
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model import timing
from syncline_design.model.roles import ROLES, RoleName
from syncline_design.model.system import UTC, Look, Platform, Sensor, ShareCurve, Stage, System
from syncline_design.spec.case import Case, RoleCase, StageCase
from syncline_design.spec.catalog import ClockEntry, SensorEntry
from syncline_design.spec.exact import fraction_of
from syncline_design.spec.existence import SOUND_MPS, is_acoustic, is_charged
from syncline_design.spec.facts import FieldOfView
from syncline_design.spec.noise_table import NoiseTable
from syncline_design.spec.timestamp_errors import (
    ConstantError,
    NormalError,
    TimestampError,
    UniformError,
)

Vector = tuple[float, float, float]


def system_of(case: Case, problem: Problem, design: Design) -> System:
    """The system that a design of this problem is, with the known effects of its spec."""
    chosen = {
        (table.stage, table.role): table.options[place]
        for table, place in zip(problem.roles, design.options, strict=True)
    }
    stages = tuple(
        _stage(case, stage, {role: chosen.get((stage.index, role)) for role in ROLES})
        for stage in case.stages
    )
    offsets = []
    for vehicle, place in zip(problem.vehicles, design.clocks, strict=True):
        clock = case.clock(vehicle.name, vehicle.clocks[place].id)
        if clock is not None:
            offsets.append((host_timeline(vehicle.name), clock_error(clock)))
    factor = float(case.spec.coverage_factor)
    return System(stages, factor, tuple(offsets), case.effects, case.spec.horizon.horizon())


def host_timeline(vehicle: str) -> str:
    """Name of the timeline of a vehicle's host clock."""
    return f"host:{vehicle}"


def timing_error(entry: TimestampError) -> timing.TimingError:
    """A catalog's timestamp error as the model takes it."""
    left = None if entry.calibrated is None else float(entry.calibrated)
    bound = None if entry.bound is None else float(entry.bound)
    return timing.TimingError(_distribution(entry), left, bound_s=bound)


def _distribution(entry: TimestampError) -> timing.Distribution:
    if isinstance(entry, UniformError):
        return timing.Uniform(float(entry.low), float(entry.high))
    if isinstance(entry, NormalError):
        return timing.Normal(float(entry.mean), float(entry.std))
    if isinstance(entry, ConstantError):
        return timing.Constant(float(entry.value))
    return timing.Empirical(tuple(float(value) for value in entry.values or ()))


def clock_error(entry: ClockEntry) -> timing.TimingError:
    """Offset of a host clock against UTC, with what it drifts away in holdover.

    The drift's sign is unknown: plus and minus drift times holdover, beside the offset's own draw.
    """
    offset = timing_error(entry.offset)
    if entry.drift is None or entry.holdover is None:
        return offset
    return replace(offset, drifted_s=abs(float(entry.drift)) * float(entry.holdover))


def _stage(case: Case, stage: StageCase, chosen: dict[RoleName, Option | None]) -> Stage:
    choice, entry = stage.choice, stage.platform.entry
    platform = Platform(
        float(entry.v_max), float(entry.omega_max), float(entry.distance), float(entry.baseline),
        None if choice.distance is None else float(stage.distances[0]),
        float(entry.acceleration or 0.0), float(entry.angular_acceleration or 0.0),
    )  # fmt: skip
    sensors = {
        name: None
        if option is None or (role := stage.role(name)) is None
        else _sensor(case, stage, role, option)
        for name, option in chosen.items()
    }
    transponder = choice.position.lever_arm if stage.index > 0 and choice.position else None
    return Stage(
        name=choice.name,
        vehicle=choice.vehicle_name,
        platform=platform,
        position=sensors["position"],
        attitude=sensors["attitude"],
        ranging=sensors["ranging"],
        transponder_lever_arm_m=_vector(transponder),
        look=None if choice.look is None else _look(choice.look),
    )


def _look(view: FieldOfView) -> Look:
    ends = (None if one is None else (one.low, one.high) for one in (view.azimuth, view.elevation))
    return Look(*ends)


def _vector(arm: Sequence[float] | None) -> Vector | None:
    return None if arm is None else (float(arm[0]), float(arm[1]), float(arm[2]))


def _sensor(case: Case, stage: StageCase, role: RoleCase, option: Option) -> Sensor:
    entry = role.sensor(option.sensor)
    stamping = role.inline or role.method(option.method)
    assert entry is not None
    assert stamping is not None
    sampled, shares = _sampling(case, stage, role.role, entry), _shapes(stage, entry)
    return Sensor(
        id=option.sensor,
        role=role.role,
        sigma=sigma_of(entry, role.role),
        timing=timing_error(stamping.error),
        timeline=UTC if option.timeline == "utc" else host_timeline(stage.choice.vehicle_name),
        lever_arm_m=_vector(role.choice.lever_arm),
        type=entry.type,
        rate_hz=sampled.rate_hz,
        sound_mps=sampled.sound_mps,
        travels=sampled.travels,
        range_shape=shares.by_range,
        range_by_beam=shares.range_by_beam,
        bearing_by_beam=shares.bearing_by_beam,
    )


@dataclass(frozen=True, slots=True)
class _Shapes:
    """Noise that depends: on the range, and on the angle of sight."""

    by_range: ShareCurve = ()
    range_by_beam: ShareCurve = ()
    bearing_by_beam: ShareCurve = ()


def _shapes(stage: StageCase, entry: SensorEntry) -> _Shapes:
    """How noise that depends does so, as shares of the figure where the stage uses it."""
    found = _Shapes()
    far = fraction_of(stage.platform.entry.distance)
    for name, table in entry.tables.items():
        if table.of == "range":
            beyond = [place for place, _ in table.rows if place > far][:1]  # for who explains it
            places = (*table.bends(Fraction(0), far), far, *beyond)
            found = replace(found, by_range=_shares(table, places))
            continue
        beam = _shares(table, [place for place, _ in table.rows])
        if name == "sigma_range":
            found = replace(found, range_by_beam=beam)
        else:
            found = replace(found, bearing_by_beam=beam)
    return found


def _shares(table: NoiseTable, places: Sequence[Fraction]) -> ShareCurve:
    return tuple((float(one), float(table.at(one) / table.exact)) for one in places)


class _Sampling(NamedTuple):
    """What between two samples, and while sound is under way, goes on."""

    rate_hz: float | None
    sound_mps: float | None
    travels: bool


def _sampling(case: Case, stage: StageCase, role: RoleName, entry: SensorEntry) -> _Sampling:
    """How far apart a sensor's samples are and how long its sound is under way, where it matters:
    where the vehicle that they are interpolated for is said to accelerate, or sound is charged."""
    later = case.stages[stage.index + 1 : stage.index + 2]
    told = {
        "position": (stage.platform.entry.acceleration,),
        "attitude": (stage.platform.entry.angular_acceleration,),
        "ranging": tuple(one.platform.entry.acceleration for one in later),
    }[role]
    interpolated = any(one is not None for one in told)
    echoes = role == "ranging" and is_acoustic(entry.type)
    travels = echoes and is_charged(entry, case.spec.strict_facts)
    rate = None if entry.rate is None or not interpolated else float(entry.rate)
    waited = echoes and (interpolated or travels)
    return _Sampling(
        rate, float(stage.choice.sound_speed or SOUND_MPS) if waited else None, travels
    )


def sigma_of(entry: SensorEntry, role: RoleName) -> Vector:
    """Standard deviations per axis; one figure holds for each of them."""
    if role == "ranging":
        azimuth, elevation = _axes(entry.sigma_bearing, 2)
        return (float(entry.sigma_range or 0.0), azimuth, elevation)
    north, east, down = _axes(
        entry.sigma_position if role == "position" else entry.sigma_attitude, 3
    )
    return (north, east, down)


def _axes(figures: float | Sequence[float] | None, count: int) -> tuple[float, ...]:
    if figures is None or isinstance(figures, float | int):
        return (float(figures or 0.0),) * count
    return tuple(float(figure) for figure in figures)
