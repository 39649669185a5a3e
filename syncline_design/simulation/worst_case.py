"""The largest error when every magnitude is at most its Syncline term and directions are free.

Maximises |e| of the nonlinear chain over all directions, signs and relative shifts by a
multi-start ascent, and bounds it from above by geometry, so that the gap between both is a
certificate of how much a better direction could still add.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from syncline_design.effects import acting as acting_effects
from syncline_design.effects.record import Array
from syncline_design.machine.deadline import in_force
from syncline_design.model.horizon import Horizon
from syncline_design.model.lever_arms import position_lever_arm
from syncline_design.model.system import Stage, System
from syncline_design.simulation import kernel, known_effects
from syncline_design.simulation.bounds import references
from syncline_design.simulation.draws import generator, lever_arms
from syncline_design.simulation.results import WorstCase, worst_case
from syncline_design.simulation.surroundings import Moment, lean

WORST_CASE_STREAM = 2  # first word of the stream key, see draws.generator
_STEP = 1e-6  # of the forward differences, in units of each block
_MOVES = (1.0, 0.5, 0.2, 0.05, 0.01, 0.002)  # fractions of the way to the ascent direction
_STRIDES = (1.0, 3.0, 10.0, 30.0)  # multiples of the last step to go on by: climbs along ridges
_SETTLED = 0.01  # an ascent has arrived when an iteration gains less than this part of the gap
Kind = Literal["ball", "sphere"]


@dataclass(frozen=True, slots=True)
class FreeVector:
    """A vector to choose: of length at most 1 (ball) or exactly 1 (sphere)."""

    stage: int
    name: str
    kind: Kind
    rows: slice


_SYSTEM = -1  # the stage number of blocks that all stages share


def _is_placed(system: System) -> bool:
    """Whether heading, tilt, time or place can matter: else the fast level kernel will do."""
    aimed = any(stage.ranging is not None for stage in system.stages)
    return bool(system.effects) or (aimed and system.horizon.tilt_rad > 0.0)


def blocks(system: System) -> tuple[FreeVector, ...]:
    """What may be chosen: once for the system when and where, then stage by stage."""
    found: list[FreeVector] = []
    start = 0
    kinds: list[tuple[int, str, Kind, int]] = []
    if system.effects:
        kinds = [(_SYSTEM, "time", "ball", 1), (_SYSTEM, "place", "ball", 2)]
    for index, stage in enumerate(system.stages):
        kinds += [(index, *one) for one in _stage_blocks(stage, index, _is_placed(system))]
    for index, name, kind, size in kinds:
        found.append(FreeVector(index, name, kind, slice(start, start + size)))
        start += size
    return tuple(found)


def _stage_blocks(stage: Stage, index: int, placed: bool) -> list[tuple[str, Kind, int]]:
    found: list[tuple[str, Kind, int]] = [
        ("velocity", "ball", 3),
        ("rate", "ball", 3),
        ("position_shift", "ball", 1),
    ]
    if placed:
        found.append(("lean", "ball", 2))
    if placed or index > 0:  # a level vehicle alone errs alike in every heading
        found.append(("yaw", "sphere", 2))
    if index == 0:
        found.append(("position_noise", "ball", 3))
    if position_lever_arm(stage, index == 0) is None:
        found.append(("lever_arm", "sphere", 3))
    if stage.ranging is not None:
        found += [
            ("bearing", "sphere", 3),
            ("attitude_noise", "ball", 3),
            ("bearing_noise", "ball", 2),
            ("range_noise", "ball", 1),
            ("attitude_shift", "ball", 1),
        ]
    return found


def worst_cases(
    system: System,
    taus_s: Array,
    seed: int = 0,
    starts: int = 16,
    iterations: int = 200,
    enough_gap: float = 1e-4,
) -> tuple[WorstCase, ...]:
    """The worst case at each tau (n,) [s], all ascents of all taus at once.

    A tau is done when its best ascent is within `enough_gap` of the bound, or when all have
    settled.  Stochastic effects do not act in the search; the bound holds them at what the budget
    charges.
    """
    taus = np.asarray(taus_s, dtype=np.float64)
    figures = [references(system, float(tau)) for tau in taus]
    search = _Search(system, np.repeat(taus, starts), starts)
    enough = np.array([bound * (1.0 - enough_gap) for bound, _, _ in figures])
    settled = _SETTLED * enough_gap
    value = search.ascend(search.starting_points(seed), enough, settled, iterations)
    best = value.reshape(-1, starts).max(axis=1)
    return tuple(
        worst_case(float(tau), float(found), *reference, system.horizon.tilt_rad)
        for tau, found, reference in zip(taus, best, figures, strict=True)
    )


class _Search:
    """Ascents from many points at once; column k of a point belongs to tau_s[k]."""

    def __init__(self, system: System, tau_s: Array, starts: int) -> None:
        self.system = system
        self.tau_s = tau_s
        self.starts = starts
        self.blocks = blocks(system)
        self.acting = acting_effects.by_stage(system)
        self.placed = _is_placed(system)
        self.size = self.blocks[-1].rows.stop

    def error_m(self, point: Array, tau_s: Array) -> Array:
        """|e| [m] of points (p, n) at tau (n,)."""
        carried: known_effects.Carried | None = None
        moment = None
        if self.placed:
            moment = _moment(self.system.horizon, self._chosen(point, _SYSTEM), tau_s.shape[0])
        for index, stage in enumerate(self.system.stages):
            chosen = self._chosen(point, index)
            draw = _bounded_draw(stage, index == 0, chosen, tau_s)
            if moment is None:
                carried = known_effects.level_error(draw, carried)
                continue
            where = (moment, _leaning(self.system.horizon, chosen["lean"]))
            acting = self.acting.get(stage.name, ())
            carried = known_effects.placed_error(draw, where, acting, None, carried)
        assert carried is not None
        return kernel.norm(carried.error_m)

    def _chosen(self, point: Array, stage: int) -> dict[str, Array]:
        return {b.name: point[b.rows] for b in self.blocks if b.stage == stage}

    def starting_points(self, seed: int) -> Array:
        """(p, n): directions at random, every second start with its terms lined up.

        Half of the starts turn by less than half a turn, where more would only lead back.
        """
        stream = generator(seed, WORST_CASE_STREAM)
        point = stream.standard_normal((self.size, self.starts))
        for start in range(0, self.starts, 2):
            self._line_up(point[:, start], stream)
        part = np.where(np.arange(self.starts) % 4 < 2, stream.random(self.starts), math.inf)
        taus = self.tau_s.shape[0] // self.starts
        point, part = self._feasible(np.tile(point, taus)), np.tile(part, taus)
        for block in self.blocks:
            if block.name == "rate":
                turn = self.tau_s * self.system.stages[block.stage].platform.omega_max_radps
                point[block.rows] *= np.minimum(1.0, part * math.pi / np.maximum(turn, 1e-300))
        return point

    def _line_up(self, column: Array, stream: np.random.Generator) -> None:
        """Directions that make every term point the same way, to first order."""
        across, along = np.linalg.qr(stream.standard_normal((3, 2)))[0].T
        turn = np.cross(across, along)  # turn x across = along
        aligned = {
            "velocity": along,
            "rate": turn,
            "position_noise": along,
            "lever_arm": across,
            "bearing": across,
            "attitude_noise": turn,
        }
        for block in self.blocks:
            if block.name in aligned:
                column[block.rows] = aligned[block.name]

    def _feasible(self, point: Array) -> Array:
        """Every block at length 1."""
        for block in self.blocks:
            length = np.sqrt(np.sum(point[block.rows] ** 2, axis=0))
            point[block.rows] /= np.where(length > 0.0, length, 1.0)
        return point

    def ascend(self, point: Array, enough_m: Array, settled: float, iterations: int) -> Array:
        """Largest |e| [m] of each ascent, (n,); `point` ends where it was found.

        enough_m (taus,): a tau is done when reached; settled: relative gain of an iteration below
        which an ascent ends.
        """
        value = self.error_m(point, self.tau_s)
        moving = np.ones(value.shape, dtype=bool)
        before = point.copy()
        for _ in range(iterations):
            in_force().check()
            reached = value.reshape(-1, self.starts).max(axis=1) >= enough_m
            active = np.flatnonzero(moving & ~np.repeat(reached, self.starts))
            if active.size == 0:
                break
            here = point[:, active]
            stride = here - before[:, active]
            better, gained = self._step(here, stride, value[active], self.tau_s[active])
            moving[active] = gained - value[active] > settled * gained
            before[:, active], point[:, active] = here, better
            value[active] = gained
        return value

    def _step(self, point: Array, stride: Array, value: Array, tau_s: Array) -> tuple[Array, Array]:
        """The best of several moves along the ascent direction or the last step, and its |e|."""
        target = self._target(point, value, tau_s)
        moves = [point + much * stride for much in _STRIDES]
        moves += [point + part * (target - point) for part in _MOVES]
        moves += [*self._single_moves(point, target), point]
        count, columns = len(moves), point.shape[1]
        flat = self._admissible(np.concatenate(moves, axis=1))
        found = self.error_m(flat, np.tile(tau_s, count)).reshape(count, columns)
        best = np.nanargmax(found, axis=0)
        column = np.arange(columns)
        return flat[:, best * columns + column], found[best, column]

    def _single_moves(self, point: Array, target: Array) -> list[Array]:
        """Each block alone all of the way to its target."""
        moves = []
        for block in self.blocks:
            move = point.copy()
            move[block.rows] = target[block.rows]
            moves.append(move)
        return moves

    def _admissible(self, point: Array) -> Array:
        """The point with spheres brought to length 1 and balls to at most 1, in place."""
        for block in self.blocks:
            length = np.sqrt(np.sum(point[block.rows] ** 2, axis=0))
            if block.kind == "ball":
                length = np.maximum(length, 1.0)
            point[block.rows] /= np.where(length > 0.0, length, 1.0)
        return point

    def _target(self, point: Array, value: Array, tau_s: Array) -> Array:
        """Each block's gradient at length 1 (where it vanishes: the block as it is).

        For a convex |e| moving a block there never lowers it (Journee et al., J. Mach. Learn.
        Res. 11 (2010) 517-553, the generalised power method).
        """
        size, columns = point.shape
        shifted = np.repeat(point[:, None, :], size, axis=1)
        shifted[np.arange(size), np.arange(size)] += _STEP
        found = self.error_m(shifted.reshape(size, -1), np.tile(tau_s, size))
        slope = found.reshape(size, columns) - value
        target = point.copy()
        for block in self.blocks:
            length = np.sqrt(np.sum(slope[block.rows] ** 2, axis=0))
            felt = length > 1e-13 * value
            scaled = slope[block.rows] / np.where(felt, length, 1.0)
            target[block.rows] = np.where(felt, scaled, point[block.rows])
        return target


def _moment(horizon: Horizon, chosen: Mapping[str, Array], count: int) -> Moment:
    """When and where: the unit interval and disc stretched to the horizon."""
    time, place = chosen.get("time"), chosen.get("place")
    if time is None or place is None:
        return Moment(np.zeros(count), np.zeros((2, count)))
    return Moment(horizon.duration_s * 0.5 * (1.0 + time[0]), horizon.extent_m * place)


def _leaning(horizon: Horizon, disc: Array) -> Array:
    """(roll, pitch) [rad] (2, n) of points of the unit disc: as far out, as steep."""
    length = np.sqrt(disc[0] ** 2 + disc[1] ** 2)
    along, across = disc / np.where(length > 0.0, length, 1.0)
    tilt = horizon.tilt_rad * np.minimum(length, 1.0)
    return lean(np.sin(tilt), np.cos(tilt), along, across)


def _bounded_draw(
    stage: Stage, first: bool, chosen: Mapping[str, Array], tau_s: Array
) -> kernel.Draw:
    """The chosen directions at their Syncline magnitudes, as a draw (n columns)."""
    n = tau_s.shape[0]
    zero, zero3 = np.zeros(n), np.zeros((3, n))
    ranging, attitude, position = stage.ranging, stage.attitude, stage.position
    yaw = chosen.get("yaw")
    angles = np.zeros((5, n))
    distance = 0.0
    if ranging is not None and attitude is not None:
        distance = float(stage.platform.distance_m)
        np.multiply(chosen["attitude_noise"], math.hypot(*attitude.sigma), out=angles[:3])
        np.multiply(chosen["bearing_noise"], math.hypot(*ranging.sigma[1:]), out=angles[3:])
    antenna, ranging_arm = lever_arms(stage, first, chosen.get("lever_arm", zero3))
    return kernel.Draw(
        cos_yaw=np.ones(n) if yaw is None else yaw[0],
        sin_yaw=zero if yaw is None else yaw[1],
        velocity_mps=chosen["velocity"] * float(stage.platform.v_max_mps),
        rate_radps=chosen["rate"] * float(stage.platform.omega_max_radps),
        range_m=np.full(n, distance),
        bearing=chosen.get("bearing", zero3),
        antenna_m=antenna,
        ranging_m=ranging_arm,
        position_noise_m=(
            zero3 if position is None else chosen["position_noise"] * math.hypot(*position.sigma)
        ),
        angle_noise_rad=angles,
        range_noise_m=zero if ranging is None else chosen["range_noise"][0] * ranging.sigma[0],
        mu_position_s=chosen["position_shift"][0] * tau_s,
        mu_attitude_s=zero if ranging is None else chosen["attitude_shift"][0] * tau_s,
        mu_ranging_s=zero,
    )
