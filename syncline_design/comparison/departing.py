"""A departure that would break assumptions, with its figures, wherever it was told."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import cache

from syncline_design.comparison.acceptance import MeasuredFigure
from syncline_design.comparison.assumptions import Assumed
from syncline_design.diagnosis.instead import JointFigure
from syncline_design.diagnosis.result import Estimate, Finding, Rival
from syncline_design.diagnosis.stretches import OtherFit, Stands
from syncline_design.effects import registry
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import format_duration, rounded, to_digits
from syncline_design.model.normal import NORMAL_95


@dataclass(frozen=True, slots=True)
class Departing:
    """One effect of sensors of a stage, and what it would be; no parameters: by no figure."""

    effect: str
    sensors: tuple[str, ...]
    stage: str
    parameters: Mapping[str, Estimate]

    @property
    def words(self) -> str:
        """`latency (ranging) of 32 ms`."""
        told = ", ".join(amount(value, unit) for value, unit in self._amounts())
        return f"{self.name} of {told}" if told else self.name

    @property
    def name(self) -> str:
        """`latency (ranging)`."""
        return f"{self.effect} ({' and '.join(self.sensors)})"

    def _amounts(self) -> Iterator[tuple[float, str]]:
        for one in self.parameters.values():
            if one.seen and not isinstance(one.value, str):
                yield float(one.value), one.unit


def with_room(figure: MeasuredFigure, value: float, room: float) -> MeasuredFigure:
    """The figure with an interval of at least `room` on either side of its value."""
    low, high = value - room, value + room
    if figure.low is not None and figure.high is not None:
        low, high = min(low, figure.low), max(high, figure.high)
    return MeasuredFigure(value, low, high)


def of_finding(one: Finding) -> Departing:
    """What a diagnosis found, in all sensors that share it."""
    return Departing(one.effect, (one.sensor, *(one.also or ())), one.stage, one.parameters)


def of_others(one: Finding) -> tuple[Departing, ...]:
    """The same in the sensors that share it, without the one that it is named by."""
    return (Departing(one.effect, one.also, one.stage, one.parameters),) if one.also else ()


def of_rival(one: Rival) -> Departing:
    """What may be in its place."""
    return Departing(one.effect, (one.sensor,), one.stage, one.parameters or {})


def of_joint(named: tuple[str, str, str], figures: Sequence[JointFigure]) -> Departing:
    """One of several that would be in its place together."""
    effect, sensor, stage = named
    units = {p.name: p.unit for p in registry()[effect].parameters}
    own = [f for f in figures if f.departure == named]
    told = {f.parameter: _estimate(f.value, f.spread, units[f.parameter]) for f in own}
    return Departing(effect, (sensor,), stage, told)


def of_stretch(one: Stands | OtherFit) -> Departing:
    """What stands out in a stretch of a log, or fits there as well."""
    effect, sensor, _ = one.label
    units = {p.name: p.unit for p in registry()[effect].parameters}
    figures = zip(one.parameters, one.values, one.spreads, strict=True)
    told = {name: _estimate(value, spread, units[name]) for name, value, spread in figures}
    return Departing(effect, (sensor,), one.stage, told)


def _estimate(value: float, spread: float, unit: str) -> Estimate:
    half = NORMAL_95 * spread
    return Estimate(value, spread, unit, True, amount(value, unit), (value - half, value + half))


def figure_of(one: Assumed, parameters: Mapping[str, Estimate]) -> MeasuredFigure | None:
    """A departure's size with its interval; of several components, of their root sum of squares.

    None where the parameters are not in the assumption's unit, nor of noise its factor: degrees of
    freedom are none.  The moment of a step is no size.
    """
    if one.unit == "1":
        factor = parameters.get("factor")
        if factor is None:
            return None
        return MeasuredFigure(float(factor.value), *(factor.interval95 or (None, None)))
    sizes = {name: p for name, p in parameters.items() if name not in _moments()}
    parts = [p for p in sizes.values() if _fits(p, one.unit)]
    values = [float(p.value) for p in parts]
    if not parts or len(parts) < len(sizes):
        return None
    if len(values) == 1:
        low, high = parts[0].interval95 or (None, None)
        return MeasuredFigure(values[0], low, high)
    ends = [p.interval95 for p in parts]
    if any(end is None for end in ends):
        return MeasuredFigure(math.hypot(*values))
    spans = [end for end in ends if end is not None]
    least = math.hypot(*(0.0 if a <= 0.0 <= b else min(abs(a), abs(b)) for a, b in spans))
    most = math.hypot(*(max(abs(a), abs(b)) for a, b in spans))
    return MeasuredFigure(math.hypot(*values), least, most)


@cache
def _moments() -> frozenset[str]:
    """Parameters of effects that say when, not by how much."""
    return frozenset(p.name for e in registry().values() for p in e.parameters if p.located)


def _fits(part: Estimate, unit: str) -> bool:
    return not isinstance(part.value, str) and part.unit == unit


def amount(value: float, unit: str) -> str:
    """Two digits are enough of what is an estimate."""
    shown = rounded(value, 2)
    if unit == "s":
        return format_duration(shown)
    if unit.startswith("rad"):
        return f"{to_digits(math.degrees(shown), 2)} deg{unit[3:]}"
    return f"{to_digits(shown)} {unit}".rstrip()
