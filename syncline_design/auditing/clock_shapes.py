"""What a clock's offset does over a log: courses of one size each, and their families.

Shapes are those that clocks have: drift, slow bends of it, ramps of a slewed clock, steps,
episodes, a lock that settles after it jumped or drifted away.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Final, Literal

import numpy as np

from syncline_design.auditing.series import Array, Mask
from syncline_design.machine.quick_dataclass import dataclass

Kind = Literal["drift", "bend", "ramp", "step", "episode", "relock", "holdover"]
KNOTS: Final = 36
SETTLINGS: Final = (0.01, 0.02, 0.04, 0.08, 0.16)  # of the log


@dataclass(frozen=True, slots=True)
class Shape:
    """An offset over time; size: seconds of receipt minus stamp (drift: over the whole log).

    begin_s, end_s: of a step its place and the end of the log; settle_s: time constant.  bend: how
    a rate changes slowly, a Legendre polynomial of `order` over the log.  ramp: drift that begins
    and may end within the log, as of a clock that is slewed.
    """

    kind: Kind
    size_s: float = 0.0
    sigma_s: float = 0.0
    begin_s: float = 0.0
    end_s: float = 0.0
    settle_s: float = 0.0
    order: int = 1

    def at(self, time_s: Array) -> Array:
        """Its course for a size of 1."""
        if self.kind == "drift":
            return (time_s - self.begin_s) / (self.end_s - self.begin_s)
        if self.kind == "bend":
            return _legendre(time_s, self)
        if self.kind == "step":
            return np.where(time_s >= self.begin_s, 1.0, 0.0)
        if self.kind == "episode":
            return np.where((time_s >= self.begin_s) & (time_s < self.end_s), 1.0, 0.0)
        back = np.exp(-np.maximum(time_s - self.end_s, 0.0) / (self.settle_s or 1.0))
        if self.kind == "relock":
            return np.where(time_s >= self.begin_s, back, 0.0)
        away = np.clip((time_s - self.begin_s) / (self.end_s - self.begin_s), 0.0, 1.0)
        return np.asarray(away if self.kind == "ramp" else away * back)


ShapeFamily = tuple[list[Shape], Array]


def _legendre(time_s: Array, shape: Shape) -> Array:
    place = 2.0 * (time_s - shape.begin_s) / (shape.end_s - shape.begin_s) - 1.0
    only = np.zeros(shape.order + 1)
    only[-1] = 1.0
    return np.asarray(np.polynomial.legendre.legval(place, only))


def course(shapes: tuple[Shape, ...], time_s: Array) -> Array:
    """Sum of all shapes [s]."""
    total = np.zeros(time_s.size)
    for shape in shapes:
        total += shape.size_s * shape.at(time_s)
    return total


def straddling(shapes: tuple[Shape, ...], time_s: Array, within_s: float) -> Mask:
    """Blocks near a jump: they hold both sides of it."""
    out = np.zeros(time_s.size, bool)
    for shape in shapes:
        edges = {"step": (shape.begin_s,), "relock": (shape.begin_s,),
                 "episode": (shape.begin_s, shape.end_s)}  # fmt: skip
        for edge in edges.get(shape.kind, ()):
            out |= np.abs(time_s - edge) <= within_s
    return out


def families(time_s: Array) -> Iterator[ShapeFamily]:
    first, last = float(time_s[0]), float(time_s[-1])
    edges = 0.5 * (time_s[1:] + time_s[:-1])
    drift = [Shape("drift", begin_s=first, end_s=last)]
    yield drift, _courses(drift, time_s)
    bends = [Shape("bend", begin_s=first, end_s=last, order=k) for k in (2, 3, 4)]
    yield bends, np.stack([bend.at(time_s) for bend in bends])
    steps = [Shape("step", begin_s=float(e), end_s=last) for e in edges[1:-1]]
    yield steps, _courses(steps, time_s)
    knots = edges[:: max(1, edges.size // KNOTS)]
    episodes = [Shape("episode", begin_s=float(a), end_s=float(b))
                for i, a in enumerate(knots) for b in knots[i + 1 :]]  # fmt: skip
    yield episodes, _courses(episodes, time_s)
    length = last - first
    relocks = [
        Shape("relock", begin_s=float(e), end_s=float(e), settle_s=share * length)
        for e in edges[1:-3] for share in SETTLINGS
    ]  # fmt: skip
    yield relocks, _courses(relocks, time_s)
    coarse = knots[::2]
    ramps = [Shape("ramp", begin_s=float(a), end_s=float(b))
             for i, a in enumerate(coarse) for b in (*coarse[i + 1 :], last)
             if (a, b) != (edges[0], last)]  # fmt: skip
    yield ramps, _courses(ramps, time_s)
    holdovers = [
        Shape("holdover", begin_s=float(a), end_s=float(b), settle_s=share * length)
        for i, a in enumerate(coarse) for b in coarse[i + 1 : -1] for share in SETTLINGS[1:4]
    ]  # fmt: skip
    if holdovers:
        yield holdovers, _courses(holdovers, time_s)


def _courses(shapes: list[Shape], time_s: Array) -> Array:
    """One row a shape."""
    begin = np.asarray([s.begin_s for s in shapes])[:, None]
    end = np.asarray([s.end_s for s in shapes])[:, None]
    settle = np.asarray([s.settle_s or 1.0 for s in shapes])[:, None]
    row = time_s[None, :]
    kind = shapes[0].kind
    if kind == "drift":
        return np.asarray((row - begin) / (end - begin))
    if kind == "step":
        return np.where(row >= begin, 1.0, 0.0)
    if kind == "episode":
        return np.where((row >= begin) & (row < end), 1.0, 0.0)
    back = np.exp(-np.maximum(row - end, 0.0) / settle)
    if kind == "relock":
        return np.where(row >= begin, back, 0.0)
    away = np.clip((row - begin) / (end - begin), 0.0, 1.0)
    return np.asarray(away if kind == "ramp" else away * back)


def around(shape: Shape, width: float, scale: float, last_s: float) -> Iterator[Shape]:
    moves = (-2.0, -1.0, 0.0, 1.0, 2.0)
    if shape.kind == "step":
        return
    if shape.kind == "relock":
        for factor in (0.55, 0.75, 0.9, 1.1, 1.35, 1.8):
            settle = shape.settle_s * (1.0 + (factor - 1.0) * scale)
            for move in (-0.5, 0.0, 0.5):
                begin = shape.begin_s + move * width
                yield replace(shape, begin_s=begin, end_s=begin, settle_s=settle)
        return
    for a in moves:
        for b in moves:
            begin, end = shape.begin_s + a * width, shape.end_s + b * width
            end = min(end, last_s) if shape.kind == "ramp" else end
            if end - begin < 0.5 * width:
                continue
            for factor in (0.6, 1.0, 1.6) if shape.kind == "holdover" else (1.0,):
                settle = shape.settle_s * (1.0 + (factor - 1.0) * scale)
                yield replace(shape, begin_s=begin, end_s=end, settle_s=settle)
