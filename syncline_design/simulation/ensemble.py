"""Over what a Monte Carlo's quantile runs, in data and in words."""

from __future__ import annotations

import math

from syncline_design.effects.acting import acting_of, implied, listed, tilts
from syncline_design.model.figure_text import format_duration, to_digits
from syncline_design.model.system import System
from syncline_design.simulation.draws import entering
from syncline_design.simulation.results import Ensemble


def ensemble_of(
    system: System, envelope: str, of_a_file: bool = False, outside: tuple[str, ...] = ()
) -> Ensemble:
    """What is drawn in this envelope; of_a_file: its trajectory is a file's."""
    acting = acting_of(system)
    drawn = ["noise", "timestamp errors"]
    drawn.append(
        "the moment of the trajectory" if envelope == "trajectory" else "directions of motion"
    )
    drawn.append("line of sight")
    if listed(system):
        drawn += (
            ["time and place of that moment, from the file"]
            if of_a_file
            else _over_the_horizon(system, envelope)
        )
    if any(one.effect.wanders for one in acting):  # one stationary draw a sample
        drawn.append("slow noise, at its stationary size")
    if any(one.effect.kind == "stochastic" for one in implied(system)):
        drawn.append("how far between two samples, and which way the path bends there")
    constants = _constants(system)
    told = (
        "every sample is a mission of its own, so quantiles run over missions, not within one; "
        f"constants of a mission: {', '.join(constants) or 'none is random here'}; drawn besides: "
        + ", ".join(drawn)
        + (f"; {outside_words(outside)}" if outside else "")
    )
    return Ensemble("over_missions", constants, tuple(drawn), outside, told)


def outside_words(outside: tuple[str, ...]) -> str:
    """What a trajectory does that Syncline and worst case do not allow for."""
    return (
        "the trajectory goes beyond what the Syncline and the worst case allow for: "
        f"{'; '.join(outside)}"
    )


def _over_the_horizon(system: System, envelope: str) -> list[str]:
    horizon = system.horizon
    drawn = [
        f"time since the start up to {format_duration(horizon.duration_s)}",
        f"place within {to_digits(horizon.extent_m)} m",
    ]
    if envelope != "trajectory" and tilts(system):
        drawn.append(f"tilt up to {to_digits(math.degrees(horizon.tilt_rad))} deg")
    return drawn


def _constants(system: System) -> tuple[str, ...]:
    """Clock offsets and calibration remainders."""
    found = [f"offset of the clock {timeline}" for timeline, _ in system.clock_offsets]
    found += [
        f"calibration remainder of {stage.name}.{sensor.role}"
        for stage in system.stages
        for sensor in entering(stage)
        if sensor.timing.calibrated_s
    ]
    return tuple(found)
