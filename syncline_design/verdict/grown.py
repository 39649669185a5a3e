"""Systems with one sensor grown, alone or nameless: what simulation is asked beside the spec."""

from __future__ import annotations

from dataclasses import replace

from syncline_design.model.roles import ROLES, RoleName
from syncline_design.model.system import UTC, Sensor, Stage, System
from syncline_design.model.timing import (
    NO_ERROR,
    Constant,
    Distribution,
    Empirical,
    Normal,
    TimingError,
    Uniform,
)


def with_grown(system: System, stage: int, role: RoleName, noise: float, shift: float) -> System:
    """A system with one sensor's noise and timestamp error times a factor each."""
    own = system.stages[stage]
    sensor: Sensor = getattr(own, role)
    first, second, third = sensor.sigma
    sensor = replace(
        sensor,
        sigma=(first * noise, second * noise, third * noise),
        timing=_stretched(sensor.timing, shift),
    )
    stages = list(system.stages)
    stages[stage] = own.with_sensor(role, sensor)
    return replace(system, stages=tuple(stages))


def _stretched(error: TimingError, factor: float) -> TimingError:
    """A timestamp error with all its figures times a factor."""
    match error.distribution:
        case Uniform(low, high):
            distribution: Distribution = Uniform(low * factor, high * factor)
        case Normal(mean, std):
            distribution = Normal(mean * factor, std * factor)
        case Constant(value):
            distribution = Constant(value * factor)
        case Empirical(values):
            distribution = Empirical(tuple(value * factor for value in values))
    left = None if error.calibrated_s is None else error.calibrated_s * factor
    bound = None if error.bound_s is None else error.bound_s * factor
    return replace(error, distribution=distribution, calibrated_s=left, bound_s=bound)


def noise_alone(system: System, stage: int, role: RoleName) -> System:
    """A system whose only error is the noise of one sensor; speeds then matter to nothing, and
    nothing moves while sound is under way or between samples."""
    stages = []
    perfect_stamps = {"timing": NO_ERROR, "timeline": UTC}
    at_once = {"rate_hz": None, "sound_mps": None, "travels": False}
    for index, one in enumerate(system.stages):
        perfect = {
            name: replace(sensor, **perfect_stamps, **at_once)
            if (index, name) == (stage, role)
            else replace(sensor, sigma=(0.0, 0.0, 0.0), **perfect_stamps, **at_once)
            for name in ROLES
            if (sensor := getattr(one, name)) is not None
        }
        platform = replace(
            one.platform, v_max_mps=1.0, omega_max_radps=1.0,
            acceleration_mps2=0.0, angular_acceleration_radps2=0.0,
        )  # fmt: skip
        if role == "position":
            platform = replace(platform, distance_m=1.0)
        stages.append(replace(one, platform=platform, **perfect))
    return replace(system, stages=tuple(stages), clock_offsets=(), effects=())


def without_names(system: System) -> System:
    """A system without the names of its sensors, which no simulation looks at."""
    return replace(system, stages=tuple(_nameless_stage(stage) for stage in system.stages))


def _nameless_stage(stage: Stage) -> Stage:
    def bare(sensor: Sensor | None) -> Sensor | None:
        return None if sensor is None else replace(sensor, id="")

    return replace(
        stage,
        position=bare(stage.position),
        attitude=bare(stage.attitude),
        ranging=bare(stage.ranging),
    )
