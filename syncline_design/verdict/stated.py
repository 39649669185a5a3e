"""Requirements on a figure of the error: worst case, THU, TVU, root mean square, quantile."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

from syncline_design.effects.acting import acts
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.ends import at_distance
from syncline_design.model.system import UTC, Sensor, System
from syncline_design.model.timing import NO_ERROR
from syncline_design.simulation.figures import worst_case_m
from syncline_design.simulation.noise_shares import surely_keeps
from syncline_design.simulation.statistical import (
    Wanted,
    Worst,
    exceeds_at,
    figure,
    surely_exceeds,
)
from syncline_design.spec.requirement import DistanceLimit, Requirement

_GRID, _ZOOMS = 32, 4


@dataclass(frozen=True, slots=True)
class Certified:
    """The certified worst case; rule: as of `Wanted`."""

    rule: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True)
class Stated:
    """A figure [m] where it is the largest share of its limit [m], and the distance there [m].

    weighted_m: held against the limit at the far end of the last stage's distances; worst: the
    situation of a statistical one.
    """

    value_m: float
    weighted_m: float
    distance_m: float
    worst: Worst | None = None


def wanted_of(requirement: Requirement) -> Wanted | Certified:
    """The figure that a requirement limits."""
    rule = _rule(requirement)
    match requirement.kind:
        case "thu":
            return Wanted("horizontal", requirement.share, rule)
        case "tvu":
            return Wanted("vertical", requirement.share, rule)
        case "rmse":
            return Wanted(requirement.axis or "3d", None, rule)
        case "quantile":
            return Wanted(requirement.of or "3d", requirement.share, rule)
        case "worst_case":
            return Certified(rule)
        case _:
            raise ValueError(f"{requirement.kind} is no figure of the error")


def _rule(requirement: Requirement) -> tuple[float, float] | None:
    """(a [m], b) of a limit that grows with the last stage's distance."""
    if not isinstance(requirement.limit, DistanceLimit):
        return None
    a, b, of = requirement.limit.rule
    return (float(a), float(b)) if of is None else None


@lru_cache(maxsize=256)
def stated(system: System, wanted: Wanted | Certified, limit_m: float, seed: int) -> Stated:
    """What a requirement limits; the worst case with sensors at `coverage_factor` sigma."""
    if isinstance(wanted, Certified):
        return _certified(system, wanted)
    found = figure(system, wanted, limit_m, seed)
    return Stated(found.value_m, found.weighted_m, found.distance_m, found)


def value_m(system: System, wanted: Wanted | Certified, limit_m: float, seed: int) -> float:
    """The figure [m] that is held against the limit at the far end of the distances."""
    return stated(system, wanted, limit_m, seed).weighted_m


def _certified(system: System, wanted: Certified) -> Stated:
    """The certified worst case, over the last stage's distances where its limit grows with them.

    It is continuous in the distance, so that a grid finds its largest share of the limit.
    """
    platform = system.stages[-1].platform
    far, near = platform.distance_m, platform.nearest_m
    if near is None or wanted.rule is None:
        value = worst_case_m(system, system.coverage_factor)
        return Stated(value, value, far)
    a, b = wanted.rule

    def at(d: float) -> Stated:
        value = worst_case_m(moved(system, d), system.coverage_factor)
        return Stated(value, value * math.hypot(a, b * far) / math.hypot(a, b * d), d)

    low, high, best = near, far, at(far)
    for _ in range(_ZOOMS):
        step = (high - low) / _GRID
        found = max((at(low + step * k) for k in range(_GRID + 1)), key=lambda one: one.weighted_m)
        best = max(best, found, key=lambda one: one.weighted_m)
        low, high = max(near, best.distance_m - step), min(far, best.distance_m + step)
    return best


def moved(system: System, distance_m: float) -> System:
    """The system with the last stage's object at a distance."""
    last = system.stages[-1]
    return replace(system, stages=(*system.stages[:-1], at_distance(last, distance_m)))


def reached(
    system: System,
    wanted: Wanted | Certified,
    limit_m: float,
    seed: int,
    worst: Sequence[Worst] = (),
) -> tuple[float, Worst | None]:
    """(a value [m] that a figure reaches: above a limit only if the figure exceeds it; where).

    What fails at once is not searched any further, nor what keeps the limit by norms alone, nor
    what fails where others were worst (worst), which a search would only find again.
    Designs that differ in timestamps alone share the verdict on their noise: independent errors
    never make a symmetric, unimodal one less dispersed (T. W. Anderson, Proc. AMS 6, 1955).
    """
    if isinstance(wanted, Wanted) and surely_keeps(system, wanted, limit_m):
        return 0.0, None
    if not acts(system) and _noise_fails(_well_timed(system), wanted, limit_m, seed):
        return _above(limit_m), None
    if isinstance(wanted, Wanted) and surely_exceeds(system, wanted, limit_m, seed):
        return _above(limit_m), None
    if isinstance(wanted, Wanted) and any(
        exceeds_at(system, wanted, limit_m, one) for one in worst
    ):
        return _above(limit_m), None
    found = stated(system, wanted, limit_m, seed)
    return found.weighted_m, found.worst


def _above(limit_m: float) -> float:
    return math.nextafter(limit_m, math.inf)


@lru_cache(maxsize=1024)
def _noise_fails(system: System, wanted: Wanted | Certified, limit_m: float, seed: int) -> bool:
    """Whether noise alone exceeds a limit by more than the search's own scatter."""
    if isinstance(wanted, Certified):
        return value_m(system, wanted, limit_m, seed) > limit_m
    return surely_exceeds(system, wanted, limit_m, seed)


def _well_timed(system: System) -> System:
    """The system with every timestamp true."""

    def exact(sensor: Sensor | None) -> Sensor | None:
        return None if sensor is None else replace(sensor, timing=NO_ERROR, timeline=UTC)

    stages = tuple(
        replace(
            stage,
            position=exact(stage.position),
            attitude=exact(stage.attitude),
            ranging=exact(stage.ranging),
        )
        for stage in system.stages
    )
    return replace(system, stages=stages, clock_offsets=())
