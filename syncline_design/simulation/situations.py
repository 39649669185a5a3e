"""The situations that a specification is held against, and the error in each of them.

A situation: how each vehicle moves (directions of velocity and rotation at their limits), leans
and looks, when and where it is, and, where one mission is asked for, what is constant in it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Any, TypeVar

import numpy as np

from syncline_design.effects.acting import by_stage
from syncline_design.effects.record import Array, Departures, StageRows
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.random_numbers import generator
from syncline_design.model.lever_arms import position_lever_arm
from syncline_design.model.roles import ROLES
from syncline_design.model.syncline import Sigma
from syncline_design.model.system import Stage, System
from syncline_design.model.underway import UnderwayCause, underway
from syncline_design.simulation import kernel
from syncline_design.simulation.ascent import (
    SYSTEM,
    FreeVector,
    Index,
    RegionKind,
    at_length_one,
    chosen,
    stacked,
)
from syncline_design.simulation.chain import ChainNoise, ConstantTwist, SensorSigma, noise_slopes
from syncline_design.simulation.drawn_effects import (
    STEP,
    Drawn,
    departed,
    numbers_drawn,
    wanderers,
    wandering,
)
from syncline_design.simulation.draws import (
    TimeShifts,
    lever_arms,
    ranging_shares,
    stage_shifts,
)
from syncline_design.simulation.known_effects import Carried, departed_error
from syncline_design.simulation.lattice import lattice
from syncline_design.simulation.sights import bearings, ranges_m, reach_m, sights
from syncline_design.simulation.surroundings import leaning, moment_at, placed_rows
from syncline_design.simulation.timing_variables import SystemTiming, timing_of
from syncline_design.simulation.undisturbed import (
    StageRun,
    relative_shifts,
    stage_run,
    state_of,
    sum_of_errors,
)
from syncline_design.simulation.undisturbed_slopes import pulled

SITUATION_STREAM = 4  # first word of the stream key, see draws.generator
_LINEAR_RAD = 0.05  # turns during a shift up to which propagation is right within 0.2 %


@dataclass(frozen=True, slots=True)
class Moments:
    """The error at n situations and M nodes of the timing variables, to first order in noise.

    mean_m (n, M, 3); slopes_m (n, M, 3, c): what each of c noises does at one sigma.
    """

    mean_m: Array
    slopes_m: Array

    def covariance(self) -> Array:
        """J J' [m2], (n, M, 3, 3)."""
        found: Array = self.slopes_m @ np.swapaxes(self.slopes_m, -1, -2)
        return found


def moments_of(runs: Sequence[StageRun]) -> Moments:
    """Of a system without effects: the errors of its stages added, their slopes side by side."""
    slopes = np.concatenate([run.slopes() for run in runs], axis=1)
    mean = np.moveaxis(sum_of_errors(runs), 0, -1)
    return Moments(mean, np.transpose(slopes, (2, 3, 0, 1)))


@dataclass(frozen=True, slots=True)
class Pulls:
    """Slopes of a figure by the errors (3, n, M) and by their slopes (3, c, n, m) at m nodes."""

    on_error: Array
    on_slopes: Array


Rows = TypeVar("Rows", StageRows, ConstantTwist, ChainNoise, Departures)


def taken(record: Rows, rows: Index) -> Rows:
    """Some rows of a record whose arrays have one each, or one for all."""
    values = {one.name: getattr(record, one.name) for one in fields(record)}
    many: dict[str, Any] = {
        name: value[rows]
        for name, value in values.items()
        if isinstance(value, np.ndarray) and value.shape[0] > 1
    }
    return replace(record, **many)


class Situations:
    """What may be chosen of a system, and its error there."""

    def __init__(self, system: System, one_mission: bool = False) -> None:
        self.system = system
        self.timing: SystemTiming = timing_of(system)
        self.held = tuple(one_mission and v.mission for v in self.timing.variables)
        self.free = tuple(k for k, held in enumerate(self.held) if not held)
        self.acting = by_stage(system)
        self.blocks = _blocks(system, self.held)
        self.size = self.blocks[-1].rows.stop
        self.drawn: tuple[Drawn, ...] = ()
        if self.acting:
            self.drawn = self._numbers_drawn()
        else:
            places = range(len(system.stages))
            self.shifts = [relative_shifts(system, self.timing, k) for k in places]

    def _numbers_drawn(self) -> tuple[Drawn, ...]:
        """What the effects that scatter draw for each sample."""
        found: list[Drawn] = []
        point = at_length_one(self.blocks, np.ones((self.size, 1)))
        self._run(point, self.steps()[:, :1], None, found)
        return tuple(found)

    @property
    def dimensions(self) -> int:
        """How many independent variables there are besides the sensors' noise."""
        return len(self.free) + len(self.drawn)

    @property
    def linear(self) -> bool:
        """Whether no effect acts and no shift turns a vehicle by more than propagation allows."""
        if self.acting:
            return False
        k = self.system.coverage_factor
        widest = 2.0 * sum(max(map(abs, v.ends_s(k))) for v in self.timing.variables)
        means = (0.0, *self.timing.mean_s.values())
        fastest = max(float(s.platform.omega_max_radps) for s in self.system.stages)
        return (widest + max(means) - min(means)) * fastest < _LINEAR_RAD

    def errors_m(self, point: Array, nodes: Array) -> Array:
        """The error without noise of sensors at points (p, n), each at all nodes: (n, M, 3)."""
        if self.acting:
            return self._run(point, nodes, None)
        return np.moveaxis(sum_of_errors(self.runs(point, nodes, slice(0))), 0, -1)

    def moments(self, point: Array, nodes: Array, slopes_at: int | None = None) -> Moments:
        """The error at points (p, n), each at all nodes (dimensions, M).

        slopes_at: how many of the nodes, from the first, have to have slopes; None: all.
        """
        if not self.acting:
            return moments_of(self.runs(point, nodes, slice(slopes_at)))
        slopes: list[Array] = []
        rows = np.arange(point.shape[1] * nodes.shape[1]).reshape(point.shape[1], -1)
        wanted = rows[:, :slopes_at]
        mean = self._run(point, nodes, (slopes, wanted.ravel()))
        found = np.concatenate(slopes, axis=2)
        return Moments(mean, found.reshape(*wanted.shape, *found.shape[1:]))

    def runs(self, point: Array, nodes: Array, slopes_at: slice) -> tuple[StageRun, ...]:
        """Every stage of a system without effects at points (p, n), each at all nodes."""
        values = self._values(point[:, :, None], nodes[:, None, :])
        return tuple(
            stage_run(state_of(self.system, self.blocks, index, point), at.at(values), slopes_at)
            for index, at in enumerate(self.shifts)
        )

    def slopes(self, point: Array, runs: Sequence[StageRun], pulls: Pulls) -> Array:
        """Slopes (p, n) of a figure at points, from those by its errors and their slopes."""
        found = np.zeros(point.shape)
        held = np.flatnonzero(self.held)
        by_value = np.zeros((len(self.held), point.shape[1]))
        for index, (run, shifts) in enumerate(zip(runs, self.shifts, strict=True)):
            mine = slice(9 * index, 9 * index + 9)
            pull = pulled(run, pulls.on_error, pulls.on_slopes[:, mine], self.system.horizon)
            for block in self.blocks:
                if block.stage == index:
                    found[block.rows] = pull.blocks[block.name]
            by_value += shifts.signs.T @ pull.on_shifts
        for k, block in zip(held, self.blocks, strict=False):  # they come first
            low, high = self.timing.variables[k].ends_s(self.system.coverage_factor)
            found[block.rows] = 0.5 * (high - low) * by_value[k]
        return found

    def _run(
        self,
        point: Array,
        nodes: Array,
        slopes: tuple[list[Array], Index] | None,
        drawn: list[Drawn] | None = None,
    ) -> Array:
        """The chain at all nodes of all points; the slopes of its stages are added to `slopes`, at
        the rows named there.

        drawn: takes up what the effects that scatter draw, which then stay at their medians.
        """
        count, each = point.shape[1], nodes.shape[1]
        total = count * each
        columns = np.repeat(point, each, axis=1)
        timing = nodes[: len(self.free)]
        shifts = self.timing.shifts(self._values(columns, np.tile(timing, count)))
        shares = (np.tile(row, count) for row in nodes[len(self.free) :])
        moment = moment_at(self.system.horizon, chosen(self.blocks, columns, SYSTEM), total)
        carried: Carried | None = None
        for index, stage in enumerate(self.system.stages):
            picked = chosen(self.blocks, columns, index)
            draw = _draw(self.system, index, picked, shifts, total)
            state, motion, noise = placed_rows(
                draw, moment, leaning(self.system.horizon, picked["lean"])
            )
            state = replace(state, pull=_bending(picked, "pull"), twist=_bending(picked, "twist"))
            rows = (state, motion, noise)
            if drawn is not None:
                found = numbers_drawn(self.acting, stage.name, state)
                drawn += found
                shares = (np.full(total, 0.5) for _ in found)
            world = departed(self.acting, stage.name, state, shares)
            carried = departed_error(rows, world, carried)
            if slopes is not None:
                added, at = slopes
                few = taken(state, at)
                rest = taken(motion, at), taken(noise, at), taken(world, at)
                added.append(noise_slopes(few, *rest, _sigma(stage, few)))
                added += wandering(self.acting, stage.name, few)
        assert carried is not None
        return carried.error_m.T.reshape(count, each, 3)

    def _values(self, columns: Array, nodes: Array) -> Array:
        """Values [s] of all variables (variables, ...): nodes of the free, ends of the held."""
        values = np.empty(
            (len(self.held), *np.broadcast_shapes(columns.shape[1:], nodes.shape[1:]))
        )
        values[list(self.free)] = nodes
        k = self.system.coverage_factor
        about = chosen(self.blocks, columns, SYSTEM)
        for j, is_held in enumerate(self.held):
            if is_held:
                low, high = self.timing.variables[j].ends_s(k)
                values[j] = 0.5 * (low + high) + 0.5 * (high - low) * about[f"held {j}"][0]
        return values

    def nodes(self, count: int) -> Array:
        """(dimensions, count), equally likely together: values of the free timing variables [s],
        then shares of what effects draw."""
        free = [self.timing.variables[k] for k in self.free]
        found = [variable.on_lattice(row, count) for row, variable in enumerate(free)]
        found += [lattice(row + 1, count)[row] for row in range(len(free), self.dimensions)]
        return np.array(found).reshape(self.dimensions, count)

    def last_ranges_m(self, point: Array) -> Array:
        """Distance of the last stage's object [m] at points (p, n): (n,)."""
        last = len(self.system.stages) - 1
        picked = chosen(self.blocks, point, last)
        return ranges_m(self.system.stages[last], picked, point.shape[1])

    def last_range_slopes_m(self) -> Array:
        """How it follows what is chosen [m] (p,)."""
        last, slopes = len(self.system.stages) - 1, np.zeros(self.size)
        for block in self.blocks:
            if (block.stage, block.name) == (last, "distance"):
                slopes[block.rows] = reach_m(self.system.stages[last])
        return slopes

    def steps(self) -> Array:
        """(dimensions, 1 + dimensions): at their means, then each one deviation off."""
        stds = [self.timing.variables[k].std_s for k in self.free]
        stds += [STEP[one.shape] - 0.5 for one in self.drawn]
        at: Array = np.array([0.0] * len(self.free) + [0.5] * len(self.drawn))[:, None]
        found: Array = at + np.concatenate([np.zeros((len(stds), 1)), np.diag(stds)], axis=1)
        return found

    def sources(self) -> tuple[str, ...]:
        """What each column of `propagated` comes from: noises stage by stage, then timing."""
        noises = tuple(
            source
            for stage in self.system.stages
            for own in (
                *(f"noise of {stage.name}.{role}" for role in ROLES),
                *wanderers(self.acting, stage.name),
            )
            for source in [own] * 3
        )
        timing = (self.timing.variables[k].source for k in self.free)
        return (*noises, *timing, *(one.source for one in self.drawn))

    def starting_points(self, seed: int, count: int) -> Array:
        """(p, count) directions at random."""
        point = generator(seed, SITUATION_STREAM).standard_normal((self.size, count))
        return at_length_one(self.blocks, point)


def _blocks(system: System, held: Sequence[bool]) -> tuple[FreeVector, ...]:
    kinds: list[tuple[int, str, RegionKind, int]] = [
        (SYSTEM, f"held {k}", "ball", 1) for k, is_held in enumerate(held) if is_held
    ]
    if system.effects:
        kinds += [(SYSTEM, "time", "ball", 1), (SYSTEM, "place", "ball", 2)]
    for index, stage in enumerate(system.stages):
        kinds += [(index, "velocity", "sphere", 3), (index, "rate", "sphere", 3)]
        kinds += [(index, "yaw", "sphere", 2), (index, "lean", "ball", 2)]
        if position_lever_arm(stage, index == 0) is None:
            kinds.append((index, "lever_arm", "sphere", 3))
        if stage.ranging is not None:
            kinds += sights(index, stage)
            if stage.platform.nearest_m is not None:
                kinds.append((index, "distance", "ball", 1))
    bends: dict[UnderwayCause, str] = {"path": "pull", "turn": "twist"}
    kinds += [
        (one.stage, bends[one.cause], "sphere", 3) for one in underway(system) if one.cause in bends
    ]
    return stacked(kinds)


def _draw(
    system: System, index: int, picked: dict[str, Array], shifts: TimeShifts, count: int
) -> kernel.Draw:
    """A stage at its limits of speed and turn rate in the chosen directions, without noise."""
    stage = system.stages[index]
    none = np.zeros((3, count))
    antenna, ranging = lever_arms(stage, index == 0, picked.get("lever_arm", none))
    aimed = stage.ranging is not None
    return kernel.Draw(
        cos_yaw=picked["yaw"][0],
        sin_yaw=picked["yaw"][1],
        velocity_mps=picked["velocity"] * float(stage.platform.v_max_mps),
        rate_radps=picked["rate"] * float(stage.platform.omega_max_radps),
        range_m=ranges_m(stage, picked, count) if aimed else np.zeros(count),
        bearing=bearings(stage, picked, count) if aimed else none,
        antenna_m=antenna,
        ranging_m=ranging,
        position_noise_m=none,
        angle_noise_rad=np.zeros((5, count)),
        range_noise_m=np.zeros(count),
        **stage_shifts(system, index, shifts, count),
    )


def _bending(picked: dict[str, Array], name: str) -> Array | None:
    """Unit vectors (n, 3) along which a path bends between samples, where one is interpolated."""
    return picked[name].T if name in picked else None


def _sigma(stage: Stage, rows: StageRows) -> SensorSigma:
    """The noise that enters a stage's estimate."""
    position = (0.0, 0.0, 0.0) if stage.position is None else stage.position.sigma
    if stage.ranging is None or stage.attitude is None:
        return SensorSigma(position)
    ranging: Sigma | Array = stage.ranging.sigma
    shares = ranging_shares(stage.ranging, rows.range_m, rows.elevation_rad + 0.5 * np.pi)
    if shares is not None:
        ranging = (shares * np.asarray(ranging)[:, None]).T[:, None, :]
    return SensorSigma(position, stage.attitude.sigma, ranging)
