"""Multi-start ascent over directions: vectors of fixed or bounded length, everything at once.

A point is a column of stacked blocks, each a vector on its unit sphere or in its unit ball; every
column climbs a problem of its own (`of` says which), so that all starts of all problems go in one
call of the objective.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from syncline_design.effects.record import Array
from syncline_design.machine.deadline import in_force
from syncline_design.machine.quick_dataclass import dataclass

_STEP = 1e-6  # in units of each block: of forward differences, and to weigh a slope
_MOVES = (1.0, 0.5, 0.2, 0.05, 0.01, 0.002)  # fractions of the way to the ascent direction
_STRIDES = (1.0, 3.0, 10.0, 30.0)  # multiples of the last step to go on by: climbs along ridges
SYSTEM = -1  # the stage number of blocks that all stages share
RegionKind = Literal["ball", "sphere"]
Index = NDArray[np.intp]
Objective = Callable[[Array, Index], Array]  # points (p, n), problem of each (n,) -> values (n,)
Slopes = Callable[[Array, Index], Array]  # the same -> slopes by the points (p, n)


@dataclass(frozen=True, slots=True)
class FreeVector:
    """A vector to choose: of length at most 1 (ball) or exactly 1 (sphere)."""

    stage: int
    name: str
    kind: RegionKind
    rows: slice


def stacked(kinds: list[tuple[int, str, RegionKind, int]]) -> tuple[FreeVector, ...]:
    """Blocks of (stage, name, kind, length) one below the other."""
    found: list[FreeVector] = []
    start = 0
    for stage, name, kind, size in kinds:
        found.append(FreeVector(stage, name, kind, slice(start, start + size)))
        start += size
    return tuple(found)


def at_length_one(blocks: tuple[FreeVector, ...], point: Array) -> Array:
    """Every block brought to length 1, in place."""
    for block in blocks:
        length = np.sqrt(np.sum(point[block.rows] ** 2, axis=0))
        point[block.rows] /= np.where(length > 0.0, length, 1.0)
    return point


def admissible(blocks: tuple[FreeVector, ...], point: Array) -> Array:
    """Spheres brought to length 1 and balls to at most 1, in place."""
    for block in blocks:
        length = np.sqrt(np.sum(point[block.rows] ** 2, axis=0))
        if block.kind == "ball":
            length = np.maximum(length, 1.0)
        point[block.rows] /= np.where(length > 0.0, length, 1.0)
    return point


def chosen(blocks: tuple[FreeVector, ...], point: Array, stage: int) -> dict[str, Array]:
    """The blocks of one stage by name."""
    return {block.name: point[block.rows] for block in blocks if block.stage == stage}


@dataclass(frozen=True, slots=True)
class Ascent:
    """Climbs an objective over blocks from many points at once.

    slopes: its own; None: by forward differences.
    """

    blocks: tuple[FreeVector, ...]
    objective: Objective
    slopes: Slopes | None = None

    def ascend(
        self, point: Array, of: Index, enough: Array, settled: float, iterations: int
    ) -> Array:
        """Largest value of each ascent, (n,); `point` ends where it was found.

        enough (problems,): a problem is done when one of its ascents reaches it; settled: relative
        gain of an iteration below which an ascent ends.
        """
        value = self.objective(point, of)
        moving = np.ones(value.shape, dtype=bool)
        before = point.copy()
        for _ in range(iterations):
            in_force().check()
            best = np.full(enough.shape, -np.inf)
            np.maximum.at(best, of, value)
            active = np.flatnonzero(moving & ~(best >= enough)[of])
            if active.size == 0:
                break
            here = point[:, active]
            stride = here - before[:, active]
            better, gained = self._step(here, stride, value[active], of[active])
            moving[active] = gained - value[active] > settled * gained
            before[:, active], point[:, active] = here, better
            value[active] = gained
        return value

    def _step(self, point: Array, stride: Array, value: Array, of: Index) -> tuple[Array, Array]:
        """The best of several moves along the ascent direction or the last step, and its value."""
        target = self._target(point, value, of)
        moves = [point + much * stride for much in _STRIDES]
        moves += [point + part * (target - point) for part in _MOVES]
        moves += [*self._single_moves(point, target), point]
        count, columns = len(moves), point.shape[1]
        flat = admissible(self.blocks, np.concatenate(moves, axis=1))
        found = self.objective(flat, np.tile(of, count)).reshape(count, columns)
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

    def _target(self, point: Array, value: Array, of: Index) -> Array:
        """Each block's gradient at length 1 (where it vanishes: the block as it is).

        For a convex objective moving a block there never lowers it (Journee et al., J. Mach.
        Learn. Res. 11 (2010) 517-553, the generalised power method).
        """
        slope = self._gain(point, value, of)
        target = point.copy()
        for block in self.blocks:
            length = np.sqrt(np.sum(slope[block.rows] ** 2, axis=0))
            felt = length > 1e-13 * value
            scaled = slope[block.rows] / np.where(felt, length, 1.0)
            target[block.rows] = np.where(felt, scaled, point[block.rows])
        return target

    def _gain(self, point: Array, value: Array, of: Index) -> Array:
        """What a small step along each element gains (p, n)."""
        if self.slopes is not None:
            return _STEP * self.slopes(point, of)
        size, columns = point.shape
        shifted = np.repeat(point[:, None, :], size, axis=1)
        shifted[np.arange(size), np.arange(size)] += _STEP
        found = self.objective(shifted.reshape(size, -1), np.tile(of, size))
        return found.reshape(size, columns) - value
