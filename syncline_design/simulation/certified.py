"""The certified worst case of a system: every timestamp anywhere in its own support."""

from __future__ import annotations

import math

from syncline_design.model import timing
from syncline_design.model.system import UTC, Sensor, System
from syncline_design.simulation.bounds import StageShifts, pairwise_bounds
from syncline_design.simulation.settings import demand_simulable

Span = tuple[float, float]


def certified_worst_case_m(system: System) -> float:
    """Upper bound [m] of |e| with every sensor at one sigma and timestamps in their supports.

    Uniform and measured timestamp errors lie between their ends, normal ones within mean plus and
    minus k std, likewise clock offsets and what a calibration leaves; tilt, time, place and known
    effects as in `bounds`.  Each pair has its own largest shift, which is at most the tau of the
    whole system that the Syncline takes for all.  Raises SimulationError for a system that makes
    no sense.
    """
    demand_simulable(system)
    parts = pairwise_bounds(system, largest_shifts_s(system))
    return math.fsum(part.bound_m for part in parts)


def largest_shifts_s(system: System) -> tuple[StageShifts, ...]:
    """Of each stage the largest |relative shift| [s] of its pairs, and of position to attitude.

    Position: the stage's own, from the second stage on the ranging sensor before it; both against
    the stage's ranging sensor.  Without one the position is held against true time.
    """
    found: list[StageShifts] = []
    before: Sensor | None = None
    for stage in system.stages:
        located = stage.position if before is None else before
        position = attitude = between = 0.0
        if located is not None:
            position = _largest_difference(system, located, stage.ranging)
        if stage.ranging is not None and stage.attitude is not None:
            attitude = _largest_difference(system, stage.attitude, stage.ranging)
            if located is not None:
                between = _largest_difference(system, located, stage.attitude)
        found.append((position, attitude, between))
        before = stage.ranging
    return tuple(found)


def _largest_difference(system: System, sensor: Sensor, reference: Sensor | None) -> float:
    """Largest |m_i - m_ref| [s], m = mu - o; an offset o common to both cancels."""
    against = UTC if reference is None else reference.timeline
    offsets = sensor.timeline != against
    low, high = _span(system, sensor, offsets)
    least, most = (0.0, 0.0) if reference is None else _span(system, reference, offsets)
    return max(abs(low - most), abs(high - least))


def _span(system: System, sensor: Sensor, offset_counts: bool) -> Span:
    """(smallest, largest) shift [s] of a sensor, against its timeline or against true time."""
    k = system.coverage_factor
    low, high = timing.support(sensor.timing, k)
    if not offset_counts:
        return low, high
    behind, ahead = timing.support(system.clock_offset(sensor.timeline), k)
    return low - ahead, high - behind
