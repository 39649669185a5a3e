"""Clocks that are seconds apart: the shift of a sensor's stamps at which a log fits best.

The places (or attitudes) of the whole log are moved along its stamps, and the usual error is taken
on some rows for every shift of a grid, then more finely about the best.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from syncline_design.diagnosis.scene import levers
from syncline_design.effects.kinematics import bearing, euler_to_rotation, rotate, rotation_to_euler
from syncline_design.effects.record import ActsOn, Array
from syncline_design.logs.log import Log
from syncline_design.logs.stamps import per_stamp
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.system import System
from syncline_design.simulation.chain import rotation_exp

ROWS = 150
MOST_S = 300.0  # and no more than leaves enough rows
STEP_S = 0.2
FINER, TIMES = 25, 3  # shifts to either side of the best, and how often
AT_ONCE = 100  # shifts
LEAST_INSIDE = 0.4  # of the rows
WHOLE_S = 0.03  # a shift this near to whole seconds is one


@dataclass(frozen=True, slots=True)
class StampShift:
    """stamp = true + seconds, of one sensor."""

    sensor: ActsOn
    seconds: float
    size_m: float

    @property
    def whole(self) -> bool:
        """Whether it is a number of whole seconds."""
        return bool(round(self.seconds)) and abs(self.seconds - round(self.seconds)) < WHOLE_S


def best_shifts(system: System, log: Log) -> list[StampShift]:
    """The best shift of the positions and of the attitudes of a log of one stage."""
    held = log.stages[0]
    if len(system.stages) != 1 or held.antenna_m is None or len(log) < ROWS // 10:
        return []
    rows = np.linspace(0, len(log) - 1, min(ROWS, len(log))).astype(int)
    few = log.rows(rows)
    antenna, ranging = levers(system.stages[0], 0)
    vector: Array = np.broadcast_to(-antenna, (len(few), 3))
    one = few.stages[0]
    if one.range_m is not None and one.azimuth_rad is not None and one.elevation_rad is not None:
        pointing = bearing(one.azimuth_rad, one.elevation_rad)
        vector = ranging - antenna + one.range_m[:, None] * pointing
    times, places = per_stamp(log.time_s, held.antenna_m)
    swung = rotate(euler_to_rotation(few.stages[0].euler_rad), vector)
    turns = euler_to_rotation(held.euler_rad)
    middle = 0.5 * (log.time_s[1:] + log.time_s[:-1])
    assert one.antenna_m is not None
    off = one.antenna_m - few.truth_m

    def of_position(wanted: Array) -> Array:
        place = np.stack([np.interp(wanted, times, places[:, k]) for k in range(3)], axis=-1)
        found: Array = place + swung - few.truth_m
        return found

    def of_attitude(wanted: Array) -> Array:
        near = np.searchsorted(middle, wanted)
        ahead = (wanted - log.time_s[near])[..., None] * held.rate_radps[near]
        turned: Array = np.einsum("gnij,nj->gni", turns[near] @ rotation_exp(ahead), vector)
        return off + turned

    found = [_best("position", few.time_s, of_position, log)]
    if np.any(vector):
        found.append(_best("attitude", few.time_s, of_attitude, log))
    return found


def _best(sensor: ActsOn, stamps_s: Array, error: Callable[[Array], Array], log: Log) -> StampShift:
    """error: (g, n, 3) [m] of the rows at times (g, n), one line for every shift."""
    most = min(MOST_S, (1.0 - LEAST_INSIDE) * log.duration_s)
    first, last = log.time_s[0], log.time_s[-1]

    def sizes(shifts: Array) -> Array:
        wanted = stamps_s + shifts[:, None]
        inside = (wanted >= first) & (wanted <= last)
        length = np.sqrt(np.nansum(error(wanted) ** 2, axis=2))
        enough = np.mean(inside, axis=1) >= LEAST_INSIDE
        found: Array = np.where(enough, _medians(length, inside), np.inf)
        return found

    step = max(STEP_S, most / 2000.0)
    grid = np.arange(-most, most + step, step)
    for _ in range(TIMES):
        starts = range(0, grid.shape[0], AT_ONCE)
        found = np.concatenate([sizes(grid[start : start + AT_ONCE]) for start in starts])
        best = int(np.argmin(found))
        centre = float(grid[best])
        grid = centre + step * np.linspace(-1.0, 1.0, 2 * FINER + 1)
        step /= FINER
    return StampShift(sensor, centre, float(found[best]))


def _medians(values: Array, inside: NDArray[np.bool_]) -> Array:
    """Of every line (g, n), over what is inside; infinite where nothing is."""
    ordered = np.sort(np.where(inside, values, np.inf), axis=1)
    count = np.sum(inside, axis=1)[:, None]
    pair = [np.take_along_axis(ordered, at, axis=1) for at in ((count - 1) // 2, count // 2)]
    middle: Array = 0.5 * (pair[0] + pair[1])[:, 0]
    return middle


def attitude_restamped(log: Log, seconds: float) -> Log:
    """The log with every attitude paired with the rows it belongs to; rates go with it."""
    from scipy.spatial.transform import Rotation, Slerp

    held = log.stages[0]
    times = np.unique(log.time_s)
    wanted = log.time_s + seconds
    inside = (wanted >= times[0]) & (wanted <= times[-1])
    first = np.searchsorted(log.time_s, times)
    turns = Slerp(times, Rotation.from_matrix(euler_to_rotation(held.euler_rad[first])))
    found = turns(np.clip(wanted, times[0], times[-1])).as_matrix()
    rates = np.stack([np.interp(wanted, log.time_s, held.rate_radps[:, k]) for k in range(3)], 1)
    moved = replace(held, euler_rad=rotation_to_euler(found), rate_radps=rates)
    return replace(log, stages=(moved, *log.stages[1:])).rows(inside)
