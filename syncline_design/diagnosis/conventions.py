"""Frames, units and time offsets that a log may be written in, searched all at once.

The error of a log of one stage is e = a + R m - t: antenna a and target (or reference) t in the
world, R body to world, m the arms and the measured vector in the body.  Every one of the list
below is tried on some rows: signed permutations of the axes of a, of t, of both, of R on either
side (24 proper ones each, mirrors where a column is), signs and zeros of angles, degrees for
radians, powers of ten, and shifts of the positions' or the attitudes' stamps.  The caller tries
the best of them by re-simulation.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from syncline_design.diagnosis.scene import levers
from syncline_design.effects.kinematics import (
    bearing,
    euler_to_rotation,
    rotate,
    rotation_to_euler,
)
from syncline_design.effects.record import ActsOn, Array
from syncline_design.logs.log import Log, LogTrack, StageLog
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import to_places
from syncline_design.model.system import System

ROWS = 200  # on which all are tried
BEST = 8  # of them are handed on
SIMPLER = 1.1  # times the least error: a simpler one is as good
WORLD = (("north", "south"), ("east", "west"), ("down", "up"))
BODY = (("forward", "back"), ("right", "left"), ("down", "up"))
UNITS = {1e-3: "in km", 1e2: "in cm", 1e3: "in mm", 1.0 / 0.3048: "in feet"}  # held over true
ANGLES = {
    1.0: "",
    math.degrees(1.0): "radians for degrees",
    math.radians(1.0): "degrees for radians",
}
QUARTERS = (0.0, 90.0, 180.0, -90.0)
ENU_ANGLES = 1.0, (1.0, -1.0, -1.0), 90.0
ENU_WORDS = "enu: yaw from east to north, pitch up negative"
Mend = Callable[[Log], Log]


def is_of_unit(convention: str) -> bool:
    """Whether a convention is a unit of length; no column is in two."""
    return any(convention.endswith(words) for words in UNITS.values())


@dataclass(frozen=True, slots=True)
class Convention:
    """One way in which columns may be written: what they hold, and the log mended.

    work: how much it changes, for ties; upright: whether the vehicle keeps its belly down.
    """

    sensor: ActsOn
    convention: str
    mend: Mend
    work: int
    size_m: float = math.inf
    upright: bool = True


@dataclass(frozen=True, slots=True)
class _Parts:
    """Some rows of a log of one stage; see above."""

    antenna: Array
    euler: Array
    arms: Array  # (3,) body: ranging less position
    polar: Array | None  # range, azimuth, elevation (n, 3)
    target: Array

    @property
    def vector(self) -> Array:
        return _vector(self.arms, self.polar, len(self.euler))


def best_conventions(system: System, log: Log) -> list[Convention]:
    """The conventions that bring the usual error down most, best first."""
    if len(system.stages) != 1 or log.stages[0].antenna_m is None:
        return []
    few = log.rows(np.linspace(0, len(log) - 1, min(ROWS, len(log))).astype(int))
    parts = _parts(system, few)
    found = [*_worlds(parts, log), *_attitudes(parts), *_polars(parts)]
    found = [one for one in found if one.upright] or found
    found.sort(key=lambda one: (one.size_m, one.work))
    least = found[0].size_m if found else 0.0
    near = [one for one in found if one.size_m <= SIMPLER * least]
    rest = [one for one in found if one.size_m > SIMPLER * least]
    return [*sorted(near, key=lambda one: (one.work, one.size_m)), *rest][:BEST]


def _parts(system: System, log: Log) -> _Parts:
    held = log.stages[0]
    antenna, ranging = levers(system.stages[0], 0)
    polar = None
    if held.range_m is not None and held.azimuth_rad is not None and held.elevation_rad is not None:
        polar = np.stack([held.range_m, held.azimuth_rad, held.elevation_rad], axis=1)
    arms = -antenna if polar is None else ranging - antenna
    assert held.antenna_m is not None
    return _Parts(held.antenna_m, held.euler_rad, arms, polar, log.truth_m)


def _vector(arms: Array, polar: Array | None, rows: int) -> Array:
    if polar is None:
        return np.broadcast_to(arms, (rows, 3))
    found: Array = arms + polar[:, :1] * bearing(polar[:, 1], polar[:, 2])
    return found


def _size(error: Array) -> float:
    return float(_sizes(error))


def _sizes(error: Array) -> Array:
    """Median length of each error (..., n, 3)."""
    found: Array = np.median(np.sqrt(np.nansum(error**2, axis=-1)), axis=-1)
    return found


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


def _worlds(parts: _Parts, log: Log) -> Iterator[Convention]:
    """Axes and units of the antenna's place, of the targets, and of all that is in the world."""
    carried = rotate(euler_to_rotation(parts.euler), parts.vector)
    held = "target" if log.kind == "georeference" else "reference"
    ways = itertools.product(signed_permutations(), ({1.0: ""} | UNITS).items())
    for matrix, (factor, unit) in ways:
        back = matrix.T / factor
        if np.array_equal(back, np.eye(3)):
            continue
        words = _held_words(matrix, unit)
        place, target = parts.antenna @ back.T, _turned(parts.target, back)
        work = _changes(matrix) + (factor != 1.0)
        sizes = _sizes(
            np.stack(
                (
                    place + carried - parts.target,
                    parts.antenna + carried - target,
                    place + carried - target,
                )
            )
        ).tolist()
        proper = np.linalg.det(matrix) > 0.0
        yield Convention("position", words, _antenna(back), work, sizes[0])
        yield Convention("target", words, _truth(back), work, sizes[1])
        if factor == 1.0 or (proper and log.kind == "georeference"):
            words = f"{words} (position, velocity and {held} alike)"
            yield Convention("position", words, _everything(back), work + 1, sizes[2])


def _held_words(matrix: Array, unit: str) -> str:
    own = "" if np.array_equal(matrix, np.eye(3)) else axes_held(matrix, WORLD)
    return ", ".join(part for part in (own, unit) if part)


def _turned(values: Array, matrix: Array) -> Array:
    """Rows turned; an axis that is not known stays so wherever it goes."""
    known = np.isfinite(values).astype(float)
    turned = np.nan_to_num(values) @ matrix.T
    return np.where(known @ np.abs(matrix.T) > 0.0, turned, np.nan)


def _attitudes(parts: _Parts) -> Iterator[Convention]:
    """Axes of the attitude on both sides, its signs, zeros and units, and its transpose."""
    if not np.any(parts.vector):
        return
    plain = euler_to_rotation(parts.euler)
    off = parts.antenna - parts.target
    before = _belly_down(plain)
    turns = [m for m in signed_permutations() if np.linalg.det(m) > 0.0]
    worlds = np.array([m.T for m in turns])
    for body in turns:
        rotation = plain @ body
        carried = rotate(rotation, parts.vector) @ np.swapaxes(worlds, 1, 2)  # exact: axes, signs
        sizes = _sizes(off + carried).tolist()
        belly_down = np.median(rotation[:, :, 2] @ worlds[:, 2].T, axis=0) > 0.0
        for world, size, down in zip(turns, sizes, belly_down.tolist(), strict=True):
            if np.array_equal(world, np.eye(3)) and np.array_equal(body, np.eye(3)):
                continue
            words, work = _attitude_words(world, body), _changes(world) + _changes(body)
            mend = _rotation(partial(_between, world.T, body))
            yield Convention("attitude", words, mend, work, size, down or not before)
    yield _transposed(parts, plain, off)
    for euler, words, mend, work in _eulers(parts.euler):
        rotation = euler_to_rotation(euler)
        size = _size(off + rotate(rotation, parts.vector))
        upright = _belly_down(rotation) or not before
        yield Convention("attitude", words, mend, work, size, upright)


def _between(left: Array, right: Array, held: Array) -> Array:
    found: Array = left @ held @ right
    return found


def _transposed(parts: _Parts, plain: Array, off: Array) -> Convention:
    back = np.swapaxes(plain, 1, 2)
    size = _size(off + rotate(back, parts.vector))
    return Convention(
        "attitude", "world to body", _rotation(lambda r: np.swapaxes(r, 1, 2)), 2, size
    )


def _belly_down(rotation: Array) -> bool:
    return bool(np.median(rotation[:, 2, 2]) > 0.0)


def _attitude_words(world: Array, body: Array) -> str:
    parts = []
    if not np.array_equal(world, np.eye(3)):
        parts.append(f"world axes {axes_held(world, WORLD)}")
    if not np.array_equal(body, np.eye(3)):
        parts.append(f"body axes {axes_held(body, BODY)}")
    return ", ".join(parts)


def _eulers(euler: Array) -> Iterator[tuple[Array, str, Mend, int]]:
    """Signs, zero of yaw and unit of the angles: (mended angles, words, mend, work)."""
    for factor, unit in ANGLES.items():
        for signs in itertools.product((1.0, -1.0), repeat=3):
            for quarter in QUARTERS:
                if factor == 1.0 and signs == (1.0, 1.0, 1.0) and not quarter:
                    continue
                scale, turn = factor * np.array(signs), np.array([0.0, 0.0, math.radians(quarter)])
                turned = [n for n, s in zip(("roll", "pitch", "yaw"), signs, strict=True) if s < 0]
                words = [f"{' and '.join(turned)} turned round"] if turned else []
                words += [f"yaw off by {to_places(_held(quarter), 0)} deg"] if quarter else []
                words += [unit] if unit else []
                words = [ENU_WORDS] if (factor, signs, quarter) == ENU_ANGLES else words

                def mended(held: Array, scale: Array = scale, turn: Array = turn) -> Array:
                    return held * scale + turn

                work = len(turned) + bool(quarter) + (factor != 1.0)
                yield mended(euler), ", ".join(words), _angles(mended), work


def _polars(parts: _Parts) -> Iterator[Convention]:
    """Unit of the range; sense, zero and unit of the bearing."""
    if parts.polar is None:
        return
    rotation, off = euler_to_rotation(parts.euler), parts.antenna - parts.target
    for scale, turn, words, work in _polar_ways():
        polar = parts.polar * scale + turn
        vector = _vector(parts.arms, polar, len(polar))
        size = _size(off + rotate(rotation, vector))
        yield Convention("ranging", words, _polar(scale, turn), work, size)


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


def _held(mending_deg: float) -> float:
    """By how much the column is off, -90 to 180 deg, for what mends it."""
    return 180.0 if mending_deg == 180.0 else -mending_deg


def _first(log: Log, change: Callable[[StageLog], StageLog]) -> Log:
    return replace(log, stages=(change(log.stages[0]), *log.stages[1:]))


def _antenna(back: Array) -> Mend:
    def changed(held: StageLog) -> StageLog:
        assert held.antenna_m is not None
        turned = replace(held, antenna_m=held.antenna_m @ back.T)
        return _velocity(turned, back) if held.follows_position else turned

    return lambda log: _first(log, changed)


def _truth(back: Array) -> Mend:
    return lambda log: replace(log, truth_m=_turned(log.truth_m, back))


def _everything(back: Array) -> Mend:
    def mend(log: Log) -> Log:
        both = _truth(back)(_antenna(back)(log))
        if log.stages[0].follows_position:
            return both
        return _first(both, lambda held: _velocity(held, back))

    return mend


def _velocity(held: StageLog, back: Array) -> StageLog:
    track = held.velocity_track
    turned = None if track is None else LogTrack(track.time_s, track.value @ back.T)
    return replace(held, velocity_mps=held.velocity_mps @ back.T, velocity_track=turned)


def _angles(mended: Callable[[Array], Array]) -> Mend:
    return lambda log: _first(log, lambda held: replace(held, euler_rad=mended(held.euler_rad)))


def _rotation(mended: Callable[[Array], Array]) -> Mend:
    return _angles(lambda euler: rotation_to_euler(mended(euler_to_rotation(euler))))


def _polar(scale: Array, turn: Array) -> Mend:
    def changed(held: StageLog) -> StageLog:
        assert held.range_m is not None
        assert held.azimuth_rad is not None
        assert held.elevation_rad is not None
        polar = np.stack([held.range_m, held.azimuth_rad, held.elevation_rad], axis=1)
        distance, azimuth, elevation = (polar * scale + turn).T
        return replace(held, range_m=distance, azimuth_rad=azimuth, elevation_rad=elevation)

    return lambda log: _first(log, changed)
