"""Frames, units and time offsets that a log may be written in, searched all at once.

The error of a log of one stage is e = a + R m - t: antenna a and target (or reference) t in the
world, R body to world, m the arms and the measured vector in the body.  Every one of the list
below is tried on some rows: signed permutations of the axes of a, of t, of both, of R on either
side (24 proper ones each, mirrors where a column is), signs and zeros of angles, degrees for
radians, powers of ten, columns under each other's name (`swapped`), and shifts of the positions' or
the attitudes' stamps.  The caller tries
the best of them by re-simulation.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from functools import partial
from typing import Final

import numpy as np

from syncline_design.diagnosis.convention import (
    EULER,
    Convention,
    Mend,
    Parts,
    angles_mended,
    antenna_turned,
    belly_down,
    everything_turned,
    parts_of,
    polar_mended,
    rotation_mended,
    scaled,
    size_of,
    sizes_of,
    truth_turned,
    turned,
    vector_of,
)
from syncline_design.diagnosis.elsewhere import logs_from_elsewhere
from syncline_design.diagnosis.swapped import swapped
from syncline_design.effects.kinematics import (
    euler_to_rotation,
    rotate,
)
from syncline_design.effects.record import Array
from syncline_design.logs.log import Log
from syncline_design.model.figure_text import to_places
from syncline_design.model.system import System

ROWS = 200  # on which all are tried
BEST = 8  # of them are handed on
SIMPLER = 1.1  # times the least error: a simpler one is as good
WORLD = (("north", "south"), ("east", "west"), ("down", "up"))
USUAL_WORLDS = ("east-north-up", "east-north-down", "north-east-up", "north-west-up")
BODY = (("forward", "back"), ("right", "left"), ("down", "up"))
UNITS = {1e-3: "in km", 1e2: "in cm", 1e3: "in mm", 1.0 / 0.3048: "in feet"}  # held over true
ANGLES = {
    1.0: "",
    math.degrees(1.0): "radians for degrees",
    math.radians(1.0): "degrees for radians",
}
OTHER_ANGLES = ANGLES | {
    math.degrees(1e-3): "milliradians for degrees",
    360.0: "turns for degrees",
    0.9: "gon for degrees",
}
POLAR = ("azimuth", "elevation")
QUARTERS = (0.0, 90.0, 180.0, -90.0)
BY_NAME: Final[
    dict[tuple[float, tuple[float, ...], float], str]
] = {  # factor, signs and zero of yaw that mend it
    (1.0, (1.0, -1.0, -1.0), 90.0): "enu: yaw from east to north, pitch up negative",
    (1.0, (1.0, 1.0, -1.0), 90.0): "yaw from east to north",
}


def is_of_unit(convention: str) -> bool:
    """Whether a convention is a unit of length; no column is in two."""
    return any(convention.endswith(words) for words in UNITS.values())


def best_conventions(system: System, log: Log) -> list[Convention]:
    """The conventions that bring the usual error down most, best first."""
    if len(system.stages) != 1 or log.stages[0].antenna_m is None:
        return []
    few = log.rows(np.linspace(0, len(log) - 1, min(ROWS, len(log))).astype(int))
    parts = parts_of(system, few)
    found = [*swapped(parts, log), *_worlds(parts, log), *_attitudes(parts), *_polars(parts)]
    found += logs_from_elsewhere(parts)
    found = [one for one in found if one.upright] or found
    found.sort(key=lambda one: (one.size_m, one.work))
    least = found[0].size_m if found else 0.0
    near = [one for one in found if one.size_m <= SIMPLER * least]
    rest = [one for one in found if one.size_m > SIMPLER * least]
    return [*sorted(near, key=lambda one: (one.work, one.size_m)), *rest][:BEST]


def signed_permutations() -> list[Array]:
    """All 48 matrices that permute axes and turn signs."""
    found = []
    for order in itertools.permutations(range(3)):
        for signs in itertools.product((1.0, -1.0), repeat=3):
            matrix = np.zeros((3, 3))
            matrix[range(3), order] = signs
            found.append(matrix)
    return found


def axes_held(matrix: Array, names: tuple[tuple[str, str], ...]) -> str:
    """`east-north-up`: what the three columns hold, held = matrix true."""
    words = []
    for row in matrix:
        axis = int(np.argmax(np.abs(row)))
        words.append(names[axis][0 if row[axis] > 0.0 else 1])
    return "-".join(words)


def _changes(matrix: Array) -> int:
    return int(np.sum(np.diag(matrix) != 1.0))


def _worlds(parts: Parts, log: Log) -> Iterator[Convention]:
    """Axes and units of the antenna's place, of the targets, and of all that is in the world."""
    carried = rotate(euler_to_rotation(parts.euler), parts.vector)
    held = "target" if log.kind == "georeference" else "reference"
    ways = itertools.product(signed_permutations(), ({1.0: ""} | UNITS).items())
    for matrix, (factor, unit) in ways:
        back = matrix.T / factor
        if np.array_equal(back, np.eye(3)):
            continue
        words = _held_words(matrix, unit)
        place, target = parts.antenna @ back.T, turned(parts.target, back)
        work = _changes(matrix) + (factor != 1.0)
        sizes = sizes_of(
            np.stack(
                (
                    place + carried - parts.target,
                    parts.antenna + carried - target,
                    place + carried - target,
                )
            )
        ).tolist()
        proper = np.linalg.det(matrix) > 0.0
        yield Convention("position", words, antenna_turned(back), work, sizes[0])
        yield Convention("target", words, truth_turned(back), work, sizes[1])
        if not _is_a_world(matrix, log):
            continue
        if factor == 1.0 or (proper and log.kind == "georeference"):
            words = f"{words} (position, velocity and {held} alike)"
            yield Convention("position", words, everything_turned(back), work + 1, sizes[2])


def _is_a_world(matrix: Array, log: Log) -> bool:
    """Whether all of a log may be turned so.

    All turned round is what places exchanged are.  To a position log all of its world is no more
    than the arm's direction, and any wrong arm has a turn that fits: there it is a usual one.
    """
    if log.kind == "position":
        return axes_held(matrix, WORLD) in USUAL_WORLDS
    return not np.array_equal(matrix, -np.eye(3))


def _held_words(matrix: Array, unit: str) -> str:
    own = "" if np.array_equal(matrix, np.eye(3)) else axes_held(matrix, WORLD)
    return ", ".join(part for part in (own, unit) if part)


def _attitudes(parts: Parts) -> Iterator[Convention]:
    """Axes of the attitude on both sides, its signs, zeros and units, and its transpose."""
    if not np.any(parts.vector):
        return
    plain = euler_to_rotation(parts.euler)
    off = parts.antenna - parts.target
    before = belly_down(plain)
    turns = [m for m in signed_permutations() if np.linalg.det(m) > 0.0]
    worlds = np.array([m.T for m in turns])
    for body in turns:
        rotation = plain @ body
        carried = rotate(rotation, parts.vector) @ np.swapaxes(worlds, 1, 2)  # exact: axes, signs
        sizes = sizes_of(off + carried).tolist()
        upright = np.median(rotation[:, :, 2] @ worlds[:, 2].T, axis=0) > 0.0
        for world, size, down in zip(turns, sizes, upright.tolist(), strict=True):
            if np.array_equal(world, np.eye(3)) and np.array_equal(body, np.eye(3)):
                continue
            words, work = _attitude_words(world, body), _changes(world) + _changes(body)
            mend = rotation_mended(partial(_between, world.T, body))
            yield Convention("attitude", words, mend, work, size, down or not before)
    yield _transposed(parts, plain, off)
    for euler, words, mend, work in _eulers(parts.euler):
        rotation = euler_to_rotation(euler)
        size = size_of(off + rotate(rotation, parts.vector))
        upright = belly_down(rotation) or not before
        yield Convention("attitude", words, mend, work, size, upright)


def _between(left: Array, right: Array, held: Array) -> Array:
    found: Array = left @ held @ right
    return found


def _transposed(parts: Parts, plain: Array, off: Array) -> Convention:
    back = np.swapaxes(plain, 1, 2)
    size = size_of(off + rotate(back, parts.vector))
    return Convention(
        "attitude", "world to body", rotation_mended(lambda r: np.swapaxes(r, 1, 2)), 2, size
    )


def _attitude_words(world: Array, body: Array) -> str:
    parts = []
    if not np.array_equal(world, np.eye(3)):
        parts.append(f"world axes {axes_held(world, WORLD)}")
    if not np.array_equal(body, np.eye(3)):
        parts.append(f"body axes {axes_held(body, BODY)}")
    return ", ".join(parts)


def _eulers(euler: Array) -> Iterator[tuple[Array, str, Mend, int]]:
    """Signs, zero of yaw and unit of the angles: (mended angles, words, mend, work)."""
    for factor in ANGLES:
        for signs in itertools.product((1.0, -1.0), repeat=3):
            for quarter in QUARTERS:
                if factor == 1.0 and signs == (1.0, 1.0, 1.0) and not quarter:
                    continue
                scale, turn = factor * np.array(signs), np.array([0.0, 0.0, math.radians(quarter)])
                mended = partial(scaled, scale=scale, turn=turn)
                work = signs.count(-1.0) + bool(quarter) + (factor != 1.0)
                said = _euler_words(factor, signs, quarter)
                yield mended(euler), said, angles_mended(mended), work
    for scale, said, work in _angle_units(EULER):
        mended = partial(scaled, scale=scale, turn=np.zeros(3))
        yield mended(euler), said, angles_mended(mended), work


def _euler_words(factor: float, signs: tuple[float, ...], quarter_deg: float) -> str:
    """What angles hold that these mend."""
    if (factor, signs, quarter_deg) in BY_NAME:
        return BY_NAME[factor, signs, quarter_deg]
    round_ = [n for n, s in zip(EULER, signs, strict=True) if s < 0]
    words = [f"{' and '.join(round_)} turned round"] if round_ else []
    words += [f"yaw off by {to_places(_held(quarter_deg), 0)} deg"] if quarter_deg else []
    return ", ".join([*words, *([ANGLES[factor]] if ANGLES[factor] else [])])


def _angle_units(names: Sequence[str]) -> Iterator[tuple[Array, str, int]]:
    """Units of all angles of a sensor, or of some of them alone: factors, words, work."""
    for factor, unit in OTHER_ANGLES.items():
        if factor == 1.0:
            continue
        for count in range(1, len(names) + 1):
            for chosen in itertools.combinations(names, count):
                whole = count == len(names)
                words = unit if whole else f"{unit} in {' and '.join(chosen)} alone"
                factors = np.array([factor if name in chosen else 1.0 for name in names])
                yield factors, words, 1 if whole else count


def yaw_quarter(off_deg: float) -> Convention:
    """The yaw that is off by a quarter turn, or by half a turn."""
    return _of_angles((1.0, 1.0, 1.0), -off_deg if off_deg < 180.0 else 180.0)


def attitude_signs() -> Iterator[tuple[Convention, ...]]:
    """One, two or all of roll, pitch and yaw turned round, each at every zero of yaw: that makes no
    difference to rates."""
    for signs in itertools.product((1.0, -1.0), repeat=3):
        if -1.0 in signs:
            yield tuple(_of_angles(signs, quarter) for quarter in QUARTERS)


def _of_angles(signs: tuple[float, ...], quarter_deg: float) -> Convention:
    turn = np.array([0.0, 0.0, math.radians(quarter_deg)])
    mended = angles_mended(partial(scaled, scale=np.array(signs), turn=turn))
    words, work = _euler_words(1.0, signs, quarter_deg), signs.count(-1.0)
    return Convention("attitude", words, mended, work)


def _polars(parts: Parts) -> Iterator[Convention]:
    """Unit of the range; sense, zero and unit of the bearing."""
    if parts.polar is None:
        return
    rotation, off = euler_to_rotation(parts.euler), parts.antenna - parts.target
    for scale, turn, words, work in _polar_ways():
        mended = partial(scaled, scale=scale, turn=turn)
        vector = vector_of(parts.arms, mended(parts.polar), len(parts.polar))
        size = size_of(off + rotate(rotation, vector))
        yield Convention("ranging", words, polar_mended(mended), work, size)


def _polar_ways() -> Iterator[tuple[Array, Array, str, int]]:
    for factor, unit in UNITS.items():
        yield np.array([1.0 / factor, 1.0, 1.0]), np.zeros(3), f"range {unit}", 1
    zeros = {0.0: "", 90.0: "elevation from the zenith", -90.0: "elevation from the nadir"}
    senses = itertools.product((1.0, -1.0), (1.0, -1.0), QUARTERS, zeros.items(), ANGLES.items())
    for azimuth, elevation, quarter, (zero, zero_words), (factor, unit) in senses:
        words = ["azimuth turned round"] if azimuth < 0.0 else []
        words += ["elevation turned round"] if elevation < 0.0 and not zero else []
        words += [f"azimuth off by {to_places(_held(quarter), 0)} deg"] if quarter else []
        words += [zero_words] if zero else []
        words += [unit] if unit else []
        if not words or (zero and elevation * zero > 0.0):
            continue
        scale = np.array([1.0, azimuth * factor, elevation * factor])
        turn = np.radians([0.0, quarter, zero])
        yield scale, turn, ", ".join(words), len(words)
    for factors, said, work in _angle_units(POLAR):
        yield np.concatenate([np.ones(1), factors]), np.zeros(3), said, work


def _held(mending_deg: float) -> float:
    """By how much the column is off, -90 to 180 deg, for what mends it."""
    return 180.0 if mending_deg == 180.0 else -mending_deg
