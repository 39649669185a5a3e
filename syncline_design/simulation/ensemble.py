"""Over what a Monte Carlo's quantile runs, in data and in words."""

from __future__ import annotations

import math
from dataclasses import dataclass

from syncline_design.effects.acting import by_stage, tilts
from syncline_design.model.horizon import Horizon, duration_words
from syncline_design.model.system import System
from syncline_design.simulation.draws import entering

OVER_MISSIONS = "over_missions"
SLOW = ("correlated_noise", "height_drift")  # correlated in time: one stationary draw a sample


@dataclass(frozen=True, slots=True)
class Ensemble:
    """Every sample is a mission of its own.

    mission_constants: what is one value all through a mission, and drawn anew in each sample;
    per_sample: what else is drawn; horizon: over which time, place and tilt are drawn, None where
    nothing depends on them; outside: where a file leaves the platform's limits or the horizon.
    """

    mission_constants: tuple[str, ...]
    per_sample: tuple[str, ...]
    horizon: Horizon | None
    outside: tuple[str, ...] = ()

    def text(self) -> str:
        """One sentence for every output."""
        constants = ", ".join(self.mission_constants) or "none is random here"
        return (
            "every sample is a mission of its own, so quantiles run over missions, not within one; "
            f"constants of a mission: {constants}; drawn besides: {', '.join(self.per_sample)}"
            + (f"; {self.outside_text()}" if self.outside else "")
        )

    def outside_text(self) -> str:
        """What a trajectory does that Syncline and worst case do not allow for."""
        return (
            f"the trajectory goes beyond what the Syncline and the worst case allow for: "
            f"{'; '.join(self.outside)}"
        )

    def to_json(self) -> dict[str, object]:
        """The `ensemble` part of a simulation."""
        return {
            "over": OVER_MISSIONS,
            "mission_constants": list(self.mission_constants),
            "per_sample": list(self.per_sample),
            "outside": list(self.outside),
            "text": self.text(),
        }


def ensemble_of(
    system: System, envelope: str, of_a_file: bool = False, outside: tuple[str, ...] = ()
) -> Ensemble:
    """What is drawn in this envelope; of_a_file: its trajectory is a file's."""
    acting = [one for effects in by_stage(system).values() for one in effects]
    drawn = ["noise", "timestamp errors"]
    drawn.append(
        "the moment of the trajectory" if envelope == "trajectory" else "directions of motion"
    )
    drawn.append("line of sight")
    if acting:
        drawn += (
            ["time and place of that moment, from the file"]
            if of_a_file
            else _over_the_horizon(system, envelope)
        )
    if any(one.effect.name in SLOW for one in acting):
        drawn.append("slow noise, at its stationary size")
    return Ensemble(_constants(system), tuple(drawn), system.horizon if acting else None, outside)


def _over_the_horizon(system: System, envelope: str) -> list[str]:
    horizon = system.horizon
    drawn = [
        f"time since the start up to {duration_words(horizon.duration_s)}",
        f"place within {horizon.extent_m:g} m",
    ]
    if envelope != "trajectory" and tilts(system):
        drawn.append(f"tilt up to {math.degrees(horizon.tilt_rad):g} deg")
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
