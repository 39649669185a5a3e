"""Requirements on a figure of the error: worst case, THU, TVU, root mean square, quantile."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

from syncline_design.model.system import UTC, Sensor, System
from syncline_design.model.timing import NO_ERROR
from syncline_design.simulation.figures import worst_case_m
from syncline_design.simulation.statistical import Wanted, figure_m, surely_exceeds
from syncline_design.spec.requirement import Requirement


def wanted_of(requirement: Requirement) -> Wanted | None:
    """The statistical figure that a requirement limits; None: the certified worst case."""
    match requirement.kind:
        case "thu":
            return Wanted("horizontal", requirement.share)
        case "tvu":
            return Wanted("vertical", requirement.share)
        case "rmse":
            return Wanted(requirement.axis or "3d")
        case "quantile":
            return Wanted(requirement.of or "3d", requirement.share)
        case "worst_case":
            return None
        case _:
            raise ValueError(f"{requirement.kind} is no figure of the error")


@lru_cache(maxsize=256)
def value_m(system: System, wanted: Wanted | None, limit_m: float, seed: int) -> float:
    """What a requirement limits [m]; the worst case with sensors at `coverage_factor` sigma."""
    if wanted is None:
        return worst_case_m(system, system.coverage_factor)
    return figure_m(system, wanted, limit_m, seed)


def keeps(system: System, wanted: Wanted | None, limit_m: float, seed: int) -> bool:
    """Whether a system keeps a limit; what fails at once is not searched any further.

    Designs that differ in timestamps alone share the verdict on their noise: independent errors
    never make a symmetric, unimodal one less dispersed (T. W. Anderson, Proc. AMS 6, 1955).
    """
    if not system.effects and _noise_fails(_well_timed(system), wanted, limit_m, seed):
        return False
    if wanted is not None and surely_exceeds(system, wanted, limit_m, seed):
        return False
    return value_m(system, wanted, limit_m, seed) <= limit_m


@lru_cache(maxsize=1024)
def _noise_fails(system: System, wanted: Wanted | None, limit_m: float, seed: int) -> bool:
    """Whether noise alone exceeds a limit by more than the search's own scatter."""
    if wanted is None:
        return value_m(system, None, limit_m, seed) > limit_m
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
