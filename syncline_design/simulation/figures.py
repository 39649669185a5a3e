"""The figures of a design beside the Syncline: certified worst case and statistical budget."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache

import numpy as np

from syncline_design.effects import registry
from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.records import Record, optional
from syncline_design.model.known import EffectEntry
from syncline_design.model.system import Sensor, Stage, System
from syncline_design.simulation.ascent import SYSTEM, chosen
from syncline_design.simulation.certified import certified_worst_case_m
from syncline_design.simulation.lattice import POINTS
from syncline_design.simulation.propagation import columns_at
from syncline_design.simulation.sights import bearings, ranges_m
from syncline_design.simulation.situations import Situations
from syncline_design.simulation.statistical import (
    AXES,
    Wanted,
    Worst,
    statistical_figures,
)
from syncline_design.simulation.surroundings import leaning, moment_at

Vector = tuple[float, float, float]
CONFIDENCE = 0.95
WANTED: Mapping[str, Wanted] = {
    "horizontal": Wanted("horizontal"),
    "vertical": Wanted("vertical"),
    "3d": Wanted("3d"),
    "thu95_m": Wanted("horizontal", CONFIDENCE),
    "tvu95_m": Wanted("vertical", CONFIDENCE),
    "quantile95_3d_m": Wanted("3d", CONFIDENCE),
}


@dataclass(frozen=True, slots=True)
class MissionFigures(Record):
    """Statistical figures [m], each at its own worst situation.

    rmse_m: root mean square by axis (horizontal, vertical, 3d); thu95_m, tvu95_m: 95 % of the
    horizontal and of the vertical errors lie within; quantile95_3d_m: of the whole.
    """

    rmse_m: Mapping[str, float]
    thu95_m: float
    tvu95_m: float
    quantile95_3d_m: float


@dataclass(frozen=True, slots=True)
class VarianceShare(Record):
    """Part of the mean square error that a source makes, 0 to 1."""

    source: str
    share: float


@dataclass(frozen=True, slots=True)
class StageSituation(Record):
    """One vehicle in a situation; vectors in its body's axes, angles of its attitude.

    distance_m: of its object, where the stage gives several; path_bends, turn_bends: unit vectors,
    which way position and attitude depart between two samples, where they are interpolated.
    """

    stage: str
    velocity_mps: Vector
    rate_radps: Vector
    roll_rad: float
    pitch_rad: float
    yaw_rad: float
    look: Vector | None = optional()
    position_arm_m: Vector | None = optional()
    distance_m: float | None = optional()
    path_bends: Vector | None = optional()
    turn_bends: Vector | None = optional()


@dataclass(frozen=True, slots=True)
class WorstSituation(Record):
    """Where a figure is largest, and what makes it; elapsed_s, place_m: when effects act."""

    figure: str
    stages: tuple[StageSituation, ...]
    shares: tuple[VarianceShare, ...]
    elapsed_s: float | None = optional()
    place_m: tuple[float, float] | None = optional()


@dataclass(frozen=True, slots=True)
class Statistics:
    """Over missions, for one mission (what is constant in it at its worst), and where."""

    over_missions: MissionFigures
    one_mission: MissionFigures
    worst_at: tuple[WorstSituation, ...]


@lru_cache(maxsize=64)
def error_statistics(system: System, seed: int) -> Statistics:
    """The statistical figures of a design; raises SimulationError where it makes no sense."""
    wanted = tuple(WANTED.values())
    over = statistical_figures(system, wanted, seed=seed)
    situations = Situations(system)
    one = over
    if any(variable.mission for variable in situations.timing.variables):
        one = statistical_figures(system, wanted, one_mission=True, seed=seed)
    worst_at = tuple(
        _situation(situations, name, worst) for name, worst in zip(WANTED, over, strict=True)
    )
    return Statistics(_named(over), _named(one), worst_at)


def worst_case_m(system: System, sensors: float) -> float:
    """Certified worst case [m] with every sensor at so many standard deviations."""
    return certified_worst_case_m(with_sensors_at(system, sensors))


def with_sensors_at(system: System, sensors: float) -> System:
    """The system with every sensor's noise at so many standard deviations."""
    stages = tuple(_scaled(stage, sensors) for stage in system.stages)
    effects = tuple(_wider(one, sensors) for one in system.effects)
    return replace(system, stages=stages, effects=effects)


def _wider(entry: EffectEntry, factor: float) -> EffectEntry:
    """An effect that is noise of its own with its standard deviation times a factor."""
    effect = registry().get(entry.effect)
    if effect is None or not effect.wanders:
        return entry
    parameters = tuple(
        (name, value * factor if name == "std_m" and not isinstance(value, str) else value)
        for name, value in entry.parameters
    )
    return replace(entry, parameters=parameters)


def _scaled(stage: Stage, factor: float) -> Stage:
    def scaled(sensor: Sensor | None) -> Sensor | None:
        if sensor is None:
            return None
        first, second, third = (factor * one for one in sensor.sigma)
        return replace(sensor, sigma=(first, second, third))

    return replace(
        stage,
        position=scaled(stage.position),
        attitude=scaled(stage.attitude),
        ranging=scaled(stage.ranging),
    )


def _named(found: tuple[Worst, ...]) -> MissionFigures:
    by_name = {name: worst.value_m for name, worst in zip(WANTED, found, strict=True)}
    rmse: Mapping[str, float] = {axis: by_name.pop(axis) for axis in AXES}
    return MissionFigures(rmse, **by_name)


def _situation(situations: Situations, name: str, worst: Worst) -> WorstSituation:
    point = worst.point[:, None]
    about = chosen(situations.blocks, point, SYSTEM)
    acts = "time" in about
    moment = moment_at(situations.system.horizon, about, 1)
    north, east = moment.place_m[:, 0].tolist()
    return WorstSituation(
        figure=f"rmse_m.{name}" if name in AXES else name,
        stages=stage_situations(situations, point),
        shares=_shares(situations, worst),
        elapsed_s=float(moment.elapsed_s[0]) if acts else None,
        place_m=(north, east) if acts else None,
    )


def stage_situations(situations: Situations, point: Array) -> tuple[StageSituation, ...]:
    """Every vehicle of a point (p, 1)."""
    return tuple(_stage(situations, k, point) for k in range(len(situations.system.stages)))


def _stage(situations: Situations, index: int, point: Array) -> StageSituation:
    system = situations.system
    stage, picked = system.stages[index], chosen(situations.blocks, point, index)
    roll, pitch = leaning(system.horizon, picked["lean"])[:, 0].tolist()
    arm = picked.get("lever_arm")
    return StageSituation(
        stage=stage.name,
        velocity_mps=_vector(stage.platform.v_max_mps * picked["velocity"]),
        rate_radps=_vector(stage.platform.omega_max_radps * picked["rate"]),
        roll_rad=roll,
        pitch_rad=pitch,
        yaw_rad=math.atan2(picked["yaw"][1, 0], picked["yaw"][0, 0]),
        look=None if stage.ranging is None else _vector(bearings(stage, picked, 1)),
        position_arm_m=None if arm is None else _vector(stage.platform.baseline_m * arm),
        distance_m=float(ranges_m(stage, picked, 1)[0]) if "distance" in picked else None,
        path_bends=_vector(picked["pull"]) if "pull" in picked else None,
        turn_bends=_vector(picked["twist"]) if "twist" in picked else None,
    )


def _vector(column: Array) -> Vector:
    x, y, z = column[:, 0].tolist()
    return x, y, z


def _shares(situations: Situations, worst: Worst) -> tuple[VarianceShare, ...]:
    """Each source's part of the mean square to first order, largest first; means are `bias`."""
    point = worst.point[:, None]
    mean, columns = columns_at(situations, point)
    axes = AXES[worst.wanted.axis]
    parts = {"bias": float(np.sum(mean[0, axes] ** 2))}
    squares = np.sum(columns[0, axes] ** 2, axis=0)
    if situations.drawn:  # they may scale the noise
        slopes = situations.moments(point, situations.nodes(POINTS)).slopes_m[0, :, axes]
        squares[: slopes.shape[2]] = np.mean(np.sum(slopes**2, axis=1), axis=0)
    for source, square in zip(situations.sources(), squares, strict=True):
        parts[source] = parts.get(source, 0.0) + float(square)
    total = math.fsum(parts.values()) or 1.0
    ordered = sorted(parts.items(), key=lambda part: -part[1])
    return tuple(VarianceShare(source, part / total) for source, part in ordered if part > 0.0)
