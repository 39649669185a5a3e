"""What makes the error in one situation, for people who work it out by hand.

The situation itself, the exact mean and covariance there, and of listed effects what a formula of
sensors and timestamps does not hold.  Units SI; errors north, east, down.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Mapping

import numpy as np

from syncline_design.effects.acting import Acting
from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.roles import ROLES, RoleName
from syncline_design.model.system import System
from syncline_design.simulation.ascent import chosen
from syncline_design.simulation.draws import ranging_shares
from syncline_design.simulation.figures import StageSituation, stage_situations
from syncline_design.simulation.lattice import MANY_POINTS, POINTS
from syncline_design.simulation.propagation import averaged, columns_at
from syncline_design.simulation.sights import bearings, ranges_m
from syncline_design.simulation.situations import Moments, Situations
from syncline_design.simulation.timing_variables import SystemTiming

Displacement = tuple[float, float, float]  # north, east, down
_GROWN = 1e-12  # relative: noise that an effect leaves alone


@dataclass(frozen=True, slots=True)
class Composition:
    """The error at a situation (p,), apart.

    mean_m (3,), covariance_m2 (3, 3): over all timestamps and noise; timing: what shifts sensors.
    displaced: of each listed effect where it displaces the estimate; scattered: by source what one
    standard deviation of each number does that a listed effect draws; growth: by stage and role
    how many times its noise listed effects make it; shares: by stage, what of sigma the noise of
    range, azimuth and elevation has here.
    """

    stages: tuple[StageSituation, ...]
    timing: SystemTiming
    mean_m: Array
    covariance_m2: Array
    displaced: tuple[tuple[str, Displacement], ...]
    scattered: tuple[tuple[str, Displacement], ...]
    growth: Mapping[tuple[int, RoleName], float]
    shares: tuple[Displacement, ...]


def composition(system: System, point: Array) -> Composition:
    """What makes the error of a system at a situation."""
    situations = Situations(system)
    column = point[:, None]
    nodes = situations.nodes(POINTS if situations.linear else MANY_POINTS)
    moments = situations.moments(column, nodes)
    mean, covariance = averaged(moments)
    listed = [one for own in situations.acting.values() for one in own if not one.effect.implied]
    return Composition(
        stage_situations(situations, column),
        situations.timing,
        mean[0],
        covariance[0],
        tuple(_displaced(situations, column, listed)) if listed else (),
        tuple(_scattered(situations, column)) if listed else (),
        _growth(situations, column, nodes, _mean_squares(moments)) if listed else {},
        tuple(_shares(situations, column, k) for k in range(len(system.stages))),
    )


def _with(situations: Situations, keep: Callable[[Acting], bool]) -> Situations:
    """The situations with only some effects acting, on the same points and nodes."""
    found = copy.copy(situations)
    found.acting = {
        stage: tuple(one for one in own if keep(one)) for stage, own in situations.acting.items()
    }
    return found


def _displaced(
    situations: Situations, column: Array, listed: list[Acting]
) -> list[tuple[str, Displacement]]:
    """What each effect displaces beside those before it, timestamps and draws at their middle."""
    still = situations.steps()[:, :1]
    found: list[tuple[str, Displacement]] = []
    labels = {one.label for one in listed}

    def error(allowed: set[tuple[str, str, int]]) -> Array:
        some = _with(situations, lambda one: one.effect.implied or one.label in allowed)
        return np.asarray(some.errors_m(column, still)[0, 0])

    before = error(set())
    for number, one in enumerate(listed, 1):
        after = error({other.label for other in listed[:number]} & labels)
        if np.any(after != before):
            stage = situations.system.stages[one.stage].name
            found.append((f"{one.effect.name} on {stage}.{one.sensor}", _vector(after - before)))
        before = after
    return found


def _scattered(situations: Situations, column: Array) -> list[tuple[str, Displacement]]:
    """Slopes of what listed effects draw; timestamps and sensors have formulas of their own."""
    _, columns = columns_at(situations, column)
    own = {"noise of ", "timestamp of ", "calibration of ", "drift of ", "clock ", "interpolation"}
    found = []
    for source, slope in zip(situations.sources(), columns[0].T, strict=True):
        if not source.startswith(tuple(own)) and np.any(slope):
            found.append((source, _vector(slope)))
    return found


def _growth(
    situations: Situations, column: Array, nodes: Array, noise: Array
) -> Mapping[tuple[int, RoleName], float]:
    """Root mean square of each sensor's noise over that without listed effects."""
    plain = _with(situations, lambda one: one.effect.implied)
    alone = _mean_squares(plain.moments(column, nodes))
    found: dict[tuple[int, RoleName], float] = {}
    for index, stage in enumerate(situations.system.stages):
        for role in ROLES:
            name = f"noise of {stage.name}.{role}"
            square = _of(plain, alone, name)
            times = _of(situations, noise, name) / square if square > 0.0 else 1.0
            if abs(times - 1.0) > _GROWN:
                found[index, role] = math.sqrt(times)
    return found


def _shares(situations: Situations, column: Array, index: int) -> Displacement:
    """What of sigma the noise of a stage's ranging sensor has at its range and line of sight."""
    stage = situations.system.stages[index]
    if stage.ranging is None:
        return 1.0, 1.0, 1.0
    picked = chosen(situations.blocks, column, index)
    down = np.clip(bearings(stage, picked, 1)[2], -1.0, 1.0)
    found = ranging_shares(stage.ranging, ranges_m(stage, picked, 1), np.arccos(down))
    return (1.0, 1.0, 1.0) if found is None else _vector(np.asarray(found[:, 0]))


def _mean_squares(moments: Moments) -> Array:
    """Of each noise at one situation, over its timestamps [m2], (c,)."""
    found: Array = np.mean(np.sum(moments.slopes_m[0] ** 2, axis=1), axis=0)
    return found


def _of(situations: Situations, squares: Array, source: str) -> float:
    """The squares of one source's columns, summed."""
    names = situations.sources()[: squares.shape[0]]
    return math.fsum(
        square for name, square in zip(names, squares.tolist(), strict=True) if name == source
    )


def _vector(values: Array) -> Displacement:
    x, y, z = values.tolist()
    return x, y, z
