"""Errors of a stage on which known effects act: the row-wise chain beside the fast kernel."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from syncline_design.effects.acting import Acting, departures
from syncline_design.effects.record import Array, Departures, StageRows
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.simulation import kernel
from syncline_design.simulation.chain import ChainMotion, ChainNoise, stage_error
from syncline_design.simulation.surroundings import Moment, placed_rows


@dataclass(frozen=True, slots=True)
class Carried:
    """What a stage hands on to the next one.

    error_m (3, n): error of the object it georeferences, NED; ranging_shift_s (n,): what effects
    add to mu of its ranging sensor, whose stamp the next stage's position carries.
    """

    error_m: Array
    ranging_shift_s: Array


def level_error(draw: kernel.Draw, before: Carried | None) -> Carried:
    """Error of one stage where no stage has an effect: the fast kernel, level."""
    error = kernel.stage_error(draw, None if before is None else before.error_m)
    return Carried(error, _NO_SHIFT)


def leaning_error(draw: kernel.Draw, lean_rad: Array, before: Carried | None) -> Carried:
    """The same of vehicles that roll and pitch (2, n) [rad]; sight and yaw may be of any length."""
    length = np.sqrt(draw.cos_yaw**2 + draw.sin_yaw**2)
    sight = kernel.norm(draw.bearing)
    unit = replace(
        draw,
        cos_yaw=draw.cos_yaw / length,
        sin_yaw=draw.sin_yaw / length,
        bearing=draw.bearing / np.where(sight > 0.0, sight, 1.0),
    )
    error = kernel.leaning_error(unit, lean_rad, None if before is None else before.error_m)
    return Carried(error, _NO_SHIFT)


def placed_error(
    draw: kernel.Draw,
    around: tuple[Moment, Array],
    acting: tuple[Acting, ...],
    generator: np.random.Generator | None,
    before: Carried | None,
) -> Carried:
    """Error of one stage at its moment and lean (roll, pitch), with effects: the row-wise chain."""
    return moved_error(placed_rows(draw, *around), acting, generator, before)


def moved_error(
    rows: tuple[StageRows, ChainMotion, ChainNoise],
    acting: tuple[Acting, ...],
    generator: np.random.Generator | None,
    before: Carried | None,
) -> Carried:
    """Error of one stage, row by row; without a generator stochastic effects do not act."""
    world = departures(acting, rows[0], generator, systematic_only=generator is None)
    return departed_error(rows, world, before)


def departed_error(
    rows: tuple[StageRows, ChainMotion, ChainNoise], world: Departures, before: Carried | None
) -> Carried:
    """Error of one stage in a world that departs from the spec by `world`."""
    state, motion, noise = rows
    carried = None
    if before is not None:
        carried = before.error_m.T
        noise = replace(noise, mu_position_s=noise.mu_position_s + before.ranging_shift_s)
    error = np.ascontiguousarray(stage_error(state, motion, noise, world, carried).T)
    return Carried(error, world.ranging_shift_s)


_NO_SHIFT = np.zeros(1)
