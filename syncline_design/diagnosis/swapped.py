"""Columns under each other's name: two angles of one sensor, or the places of vehicle and targets.

Of the vehicle's places and those of a better system the log tells by their noise which is which: an
error of two lever arms would be made by an arm of the wrong sign as well.  North under the name of
east is an order of axes, see `conventions`.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from syncline_design.diagnosis.convention import (
    EULER,
    Convention,
    Parts,
    angles_mended,
    belly_down,
    first_changed,
    polar_mended,
    size_of,
    vector_of,
)
from syncline_design.effects.kinematics import euler_to_rotation, rotate
from syncline_design.effects.record import ActsOn, Array
from syncline_design.logs.derivatives import derived_velocity
from syncline_design.logs.log import Log, StageLog

NED = ("north", "east", "down")
ROUGHER = 2.0  # times as rough as the places of the better system are those that are measured


def swapped(parts: Parts, log: Log) -> Iterator[Convention]:
    """Every exchange of two columns, or of two groups of them."""
    yield from _attitudes(parts)
    yield from _bearings(parts)
    yield from _places(parts, log)


def _named(sensor: ActsOn, names: Sequence[str]) -> partial[Convention]:
    words = f"{' and '.join(names)} under each other's name"
    sentence = f"The columns of {' and '.join(names)} are under each other's name"
    return partial(Convention, sensor, words, work=1, sentence=sentence)


def angles_exchanged() -> Iterator[Convention]:
    """Two of roll, pitch and yaw under each other's name."""
    for names, order in _exchanges(EULER, 0):
        yield _named("attitude", names)(mend=angles_mended(partial(_ordered, order=order)))


def _attitudes(parts: Parts) -> Iterator[Convention]:
    off = parts.antenna - parts.target
    before = belly_down(euler_to_rotation(parts.euler))
    orders = (order for _, order in _exchanges(EULER, 0))
    for one, order in zip(angles_exchanged(), orders, strict=True):
        rotation = euler_to_rotation(parts.euler[:, order])
        size = size_of(off + rotate(rotation, parts.vector))
        upright = belly_down(rotation) or not before
        yield replace(one, size_m=size, upright=upright)


def _bearings(parts: Parts) -> Iterator[Convention]:
    if parts.polar is None:
        return
    rotation, off = euler_to_rotation(parts.euler), parts.antenna - parts.target
    for names, order in _exchanges(("range", "azimuth", "elevation"), 1):
        vector = vector_of(parts.arms, parts.polar[:, order], len(parts.polar))
        size = size_of(off + rotate(rotation, vector))
        mend = polar_mended(partial(_ordered, order=order))
        yield _named("ranging", names)(mend=mend, size_m=size)


def _exchanges(names: Sequence[str], first: int) -> Iterator[tuple[tuple[str, str], list[int]]]:
    """Two of the columns from the first on, and the order that puts them right."""
    for one, other in itertools.combinations(range(first, len(names)), 2):
        order = list(range(len(names)))
        order[one], order[other] = other, one
        yield (names[one], names[other]), order


def _ordered(held: Array, order: list[int]) -> Array:
    return held[:, order]


def _places(parts: Parts, log: Log) -> Iterator[Convention]:
    """Places of vehicle and targets as a whole: one axis looks like one that both mirror."""
    if log.kind != "position":
        yield from _of_axes(parts, [0, 1, 2], "target")
        return
    for count in (3, 2, 1):
        for axes in map(list, itertools.combinations(range(3), count)):
            if _is_rougher(log, axes):
                yield from _of_axes(parts, axes, "reference")


def _of_axes(parts: Parts, axes: list[int], group: str) -> Iterator[Convention]:
    antenna, target = _exchanged(parts.antenna, parts.target, axes)
    if not np.array_equal(np.isfinite(antenna), np.isfinite(parts.antenna)):
        return
    whose = "" if len(axes) == len(NED) else f"{' and '.join(NED[k] for k in axes)} of "
    names = (f"{whose}the position", f"{whose}the {group}")
    size = size_of(antenna + rotate(euler_to_rotation(parts.euler), parts.vector) - target)
    mend = partial(_places_exchanged, axes=axes)
    yield _named("position", names)(mend=mend, size_m=size)


def _exchanged(one: Array, other: Array, axes: list[int]) -> tuple[Array, Array]:
    first, second = one.copy(), other.copy()
    first[:, axes], second[:, axes] = other[:, axes], one[:, axes]
    return first, second


def _places_exchanged(log: Log, axes: list[int]) -> Log:
    held = log.stages[0].antenna_m
    assert held is not None
    antenna, truth = _exchanged(held, log.truth_m, axes)

    def changed(held: StageLog) -> StageLog:
        placed = replace(held, antenna_m=antenna)
        if not held.follows_position:
            return placed
        return replace(
            placed, velocity_mps=derived_velocity(log.time_s, antenna), velocity_track=None
        )

    return replace(first_changed(log, changed), truth_m=truth)


def _is_rougher(log: Log, axes: list[int]) -> bool:
    """Whether what is called the better system's places scatter more than what is measured."""
    held = log.stages[0].antenna_m
    assert held is not None
    return all(_roughness(log.truth_m[:, k]) > ROUGHER * _roughness(held[:, k]) for k in axes)


def _roughness(place_m: Array) -> float:
    """Usual third difference of the places from row to row [m], to which motion adds little."""
    return float(np.median(np.abs(np.diff(place_m, 3)))) if len(place_m) > 3 else 0.0
