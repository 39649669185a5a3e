"""What lies before and after a drive that begins and ends at some speed: run-up and run-out.

A vehicle that is to begin at v gains it on the way (v^2 - v0^2) / (2 a), from the slowest speed v0
that it can hold, straight ahead, and slows down on as much after the end; what cannot stop needs
two radii of its turn.  None of it is logged or counted on; a mission flies it, and an area has to
hold it.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import to_digits
from syncline_design.planning.path import PathStates
from syncline_design.planning.vehicle import Vehicle

LEAST_M: Final = 0.05  # shorter, it is none


@dataclass(frozen=True, slots=True)
class Approach:
    """Where the run-up begins and where the run-out ends (3,) [m]; None where there is none.

    begins_mps: the speed over ground that the drive begins at.
    """

    begins_mps: float
    run_up_m: Array | None
    run_out_m: Array | None

    @property
    def places_m(self) -> list[Array]:
        """Those of the two that there are."""
        return [place for place in (self.run_up_m, self.run_out_m) if place is not None]


def approach(vehicle: Vehicle, path: PathStates) -> Approach:
    """Before and after a path, along the ways that it begins and ends on, on the level."""
    begins, ends = (_level(path.velocity_mps[k]) for k in (0, -1))
    speed = float(np.linalg.norm(begins))
    return Approach(
        speed,
        _away(path.position_m[0], -begins, vehicle),
        _away(path.position_m[-1], ends, vehicle),
    )


def run_up_words(vehicle: Vehicle, begins_mps: float) -> str:
    """How long the run-up to a leg is, to put behind what to do in it; none where there is none."""
    way_m = vehicle.run_m(begins_mps)
    if way_m <= LEAST_M:
        return ""
    return f"; before it a run-up of {to_digits(way_m, 2)} m straight on, not logged"


def _level(velocity_mps: Array) -> Array:
    level: Array = velocity_mps * np.array([1.0, 1.0, 0.0])
    return level


def _away(from_m: Array, velocity_mps: Array, vehicle: Vehicle) -> Array | None:
    """The place that far off in a direction of motion."""
    speed = float(np.linalg.norm(velocity_mps))
    way_m = vehicle.run_m(speed)
    if way_m <= LEAST_M:
        return None
    place: Array = from_m + way_m / speed * velocity_mps
    return place
