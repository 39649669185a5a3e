"""Known effects that scatter, as independent variables of a budget instead of random draws.

An effect draws from whatever generator it is given.  Here it is given shares of the unit cube, one
row for each number that it draws, and gets the number at that share of its distribution: a sum over
evenly spread shares is then an integral over the effect, as over a timestamp.  What wanders is
normal and adds to a position, as the receiver's own noise does: it joins that instead.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import Any, Literal, cast

import numpy as np

from syncline_design.effects.acting import ByStage, departures
from syncline_design.effects.record import NOTHING, Array, Departures, StageRows
from syncline_design.machine.quick_dataclass import dataclass

Shape = Literal["normal", "uniform", "other"]
STEP: dict[Shape, float] = {
    "normal": 0.8413447460685429,  # one standard deviation above the mean
    "uniform": 0.5 + 12.0**-0.5,
    "other": 0.5,  # scales noise and moves nothing
}


@dataclass(frozen=True, slots=True)
class Drawn:
    """One number that an effect draws for every sample; source: the effect and where it acts."""

    source: str
    shape: Shape


class ShareDraws:
    """Stands in for a random generator: each number at its share (rows, n) of its distribution.

    shapes: what was asked for so far, row by row.
    """

    def __init__(self, shares: Iterator[Array], count: int) -> None:
        self.shares, self.count = shares, count
        self.shapes: list[Shape] = []

    def standard_normal(self, size: int | tuple[int, int]) -> Array:
        """Standard normal numbers, (n,) or (n, k)."""
        from scipy.special import ndtri

        if isinstance(size, int):
            return cast("Array", ndtri(self._next("normal")))
        rows = [ndtri(self._next("normal")) for _ in range(size[1])]
        return np.stack(rows, axis=-1)

    def uniform(self, low: float, high: float, size: int) -> Array:
        """Uniform numbers (n,)."""
        spread: Array = low + (high - low) * self._next("uniform")
        return spread

    def random(self, size: int) -> Array:
        """Uniform numbers (n,) between 0 and 1."""
        return self._next("other")

    def chisquare(self, freedom: float, size: int) -> Array:
        """Chi-square numbers (n,)."""
        from scipy.special import gammaincinv

        return cast("Array", 2.0 * gammaincinv(0.5 * freedom, self._next("other")))

    def _next(self, shape: Shape) -> Array:
        self.shapes.append(shape)
        return next(self.shares)


def departed(acting: ByStage, stage: str, rows: StageRows, shares: Iterator[Array]) -> Departures:
    """How the effects of a stage depart, those that scatter at given shares."""
    total = NOTHING
    for one in acting.get(stage, ()):
        if one.effect.wanders:
            continue
        draws = ShareDraws(shares, len(rows))
        total = total + departures((one,), rows, cast("Any", draws))
    return total


def numbers_drawn(acting: ByStage, stage: str, rows: StageRows) -> list[Drawn]:
    """The numbers that the effects of a stage draw, in their order."""
    found = []
    for one in acting.get(stage, ()):
        if one.effect.wanders:
            continue
        draws = ShareDraws(itertools.repeat(np.full(len(rows), 0.5)), len(rows))
        departures((one,), rows, cast("Any", draws))
        source = f"{one.effect.name} of {stage}.{one.sensor}"
        found += [Drawn(source, shape) for shape in draws.shapes]
    return found


class _OneAxis:
    """Stands in for a random generator: one standard deviation along one axis."""

    def __init__(self, axis: int) -> None:
        self.axis = axis

    def standard_normal(self, size: tuple[int, int]) -> Array:
        """One along the axis, (n, k)."""
        found = np.zeros(size)
        found[:, self.axis] = 1.0
        return found


def wandering(acting: ByStage, stage: str, rows: StageRows) -> list[Array]:
    """How effects that wander move the error, one standard deviation an axis: (n, 3, 3) each."""
    found = []
    for one in acting.get(stage, ()):
        if one.effect.wanders:
            moved = [
                departures((one,), rows, cast("Any", _OneAxis(axis))).position_m
                for axis in range(3)
            ]
            found.append(np.stack(np.broadcast_arrays(*moved), axis=-1))
    return found


def wanderers(acting: ByStage, stage: str) -> tuple[str, ...]:
    """The same by name."""
    return tuple(
        f"{one.effect.name} of {stage}.{one.sensor}"
        for one in acting.get(stage, ())
        if one.effect.wanders
    )
