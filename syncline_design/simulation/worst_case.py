"""The largest error when every magnitude is at most its Syncline term and directions are free.

Maximises |e| of the nonlinear chain over all directions, signs and relative shifts by a
multi-start ascent, and bounds it from above by geometry, so that the gap between both is a
certificate of how much a better direction could still add.
"""

from __future__ import annotations

import math

import numpy as np

from syncline_design.effects import acting as acting_effects
from syncline_design.effects.record import Array
from syncline_design.machine.random_numbers import generator
from syncline_design.model.lever_arms import position_lever_arm
from syncline_design.model.system import Stage, System
from syncline_design.simulation import kernel, known_effects
from syncline_design.simulation.ascent import (
    SYSTEM,
    Ascent,
    FreeVector,
    Index,
    RegionKind,
    at_length_one,
    chosen,
    stacked,
)
from syncline_design.simulation.bounds import references
from syncline_design.simulation.draws import lever_arms, shaped
from syncline_design.simulation.results import WorstCase, worst_case
from syncline_design.simulation.sights import bearings, sights
from syncline_design.simulation.surroundings import leaning, moment_at

WORST_CASE_STREAM = 2  # first word of the stream key, see draws.generator
_SETTLED = 0.01  # an ascent has arrived when an iteration gains less than this part of the gap


def _is_placed(system: System) -> bool:
    """Whether heading, tilt, time or place can matter: else the fast level kernel will do."""
    aimed = any(stage.ranging is not None for stage in system.stages)
    return acting_effects.acts(system) or (aimed and system.horizon.tilt_rad > 0.0)


def blocks(system: System) -> tuple[FreeVector, ...]:
    """What may be chosen: once for the system when and where, then stage by stage."""
    kinds: list[tuple[int, str, RegionKind, int]] = []
    if system.effects:
        kinds = [(SYSTEM, "time", "ball", 1), (SYSTEM, "place", "ball", 2)]
    for index, stage in enumerate(system.stages):
        kinds += [(index, *one) for one in _stage_blocks(stage, index, _is_placed(system))]
    return stacked(kinds)


def _stage_blocks(stage: Stage, index: int, placed: bool) -> list[tuple[str, RegionKind, int]]:
    found: list[tuple[str, RegionKind, int]] = [
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
            *(one[1:] for one in sights(index, stage)),
            ("attitude_noise", "ball", 3),
            ("bearing_noise", "ball", 2),
            ("range_noise", "ball", 1),
            ("attitude_shift", "ball", 1),
        ]
    return found


def worst_cases(
    system: System,
    taus_s: Array,
    seed: int,
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
    search = _Search(system, taus)
    enough = np.array([bound * (1.0 - enough_gap) for bound, _, _ in figures])
    of = np.repeat(np.arange(taus.shape[0]), starts)
    point = search.starting_points(seed, starts)
    ascent = Ascent(search.blocks, search.error_m)
    value = ascent.ascend(point, of, enough, _SETTLED * enough_gap, iterations)
    best = value.reshape(-1, starts).max(axis=1)
    return tuple(
        worst_case(float(tau), float(found), *reference, system.horizon.tilt_rad)
        for tau, found, reference in zip(taus, best, figures, strict=True)
    )


class _Search:
    """The error of points, each at one of several taus."""

    def __init__(self, system: System, taus_s: Array) -> None:
        self.system = system
        self.taus_s = taus_s
        self.blocks = blocks(system)
        self.acting = acting_effects.by_stage(system)
        self.placed = _is_placed(system)
        self.size = self.blocks[-1].rows.stop

    def error_m(self, point: Array, of: Index) -> Array:
        """|e| [m] of points (p, n), each at tau number `of` (n,)."""
        tau_s = self.taus_s[of]
        carried: known_effects.Carried | None = None
        moment = None
        if self.placed:
            about = chosen(self.blocks, point, SYSTEM)
            moment = moment_at(self.system.horizon, about, tau_s.shape[0])
        for index, stage in enumerate(self.system.stages):
            picked = chosen(self.blocks, point, index)
            draw = _bounded_draw(stage, index == 0, picked, tau_s)
            if moment is None:
                carried = known_effects.level_error(draw, carried)
                continue
            lean = leaning(self.system.horizon, picked["lean"])
            if not self.acting:
                carried = known_effects.leaning_error(draw, lean, carried)
                continue
            where = (moment, lean)
            acting = self.acting.get(stage.name, ())
            carried = known_effects.placed_error(draw, where, acting, None, carried)
        assert carried is not None
        return kernel.norm(carried.error_m)

    def starting_points(self, seed: int, starts: int) -> Array:
        """(p, taus * starts): directions at random, every second start with its terms lined up.

        Half of the starts turn by less than half a turn, where more would only lead back.
        """
        stream = generator(seed, WORST_CASE_STREAM)
        point = stream.standard_normal((self.size, starts))
        for start in range(0, starts, 2):
            self._line_up(point[:, start], stream)
        part = np.where(np.arange(starts) % 4 < 2, stream.random(starts), math.inf)
        count = self.taus_s.shape[0]
        point, part = at_length_one(self.blocks, np.tile(point, count)), np.tile(part, count)
        tau_s = np.repeat(self.taus_s, starts)
        for block in self.blocks:
            if block.name == "rate":
                turn = tau_s * self.system.stages[block.stage].platform.omega_max_radps
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


def _bounded_draw(stage: Stage, first: bool, chosen: dict[str, Array], tau_s: Array) -> kernel.Draw:
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
    looked = zero3 if ranging is None else bearings(stage, chosen, n)
    noise = {"range_noise_m": zero.copy(), "angle_noise_rad": angles}
    if ranging is not None:
        noise["range_noise_m"] = chosen["range_noise"][0] * ranging.sigma[0]
        shaped(noise, ranging, np.full(n, distance), looked[2])
    return kernel.Draw(
        cos_yaw=np.ones(n) if yaw is None else yaw[0],
        sin_yaw=zero if yaw is None else yaw[1],
        velocity_mps=chosen["velocity"] * float(stage.platform.v_max_mps),
        rate_radps=chosen["rate"] * float(stage.platform.omega_max_radps),
        range_m=np.full(n, distance),
        bearing=looked,
        antenna_m=antenna,
        ranging_m=ranging_arm,
        position_noise_m=(
            zero3 if position is None else chosen["position_noise"] * math.hypot(*position.sigma)
        ),
        angle_noise_rad=noise["angle_noise_rad"],
        range_noise_m=noise["range_noise_m"],
        mu_position_s=chosen["position_shift"][0] * tau_s,
        mu_attitude_s=zero if ranging is None else chosen["attitude_shift"][0] * tau_s,
        mu_ranging_s=zero,
    )
