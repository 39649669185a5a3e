"""What areas keep vehicles from, in words: for who reads a plan."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from syncline_design.model.figure_text import to_digits, to_places
from syncline_design.planning.approach import approach
from syncline_design.planning.placing import AREA_SHARE, Place, way_of
from syncline_design.planning.planned_log import Drive
from syncline_design.planning.setup import Setup


def beyond_areas(setup: Setup, driven: Drive) -> Iterator[str]:
    """Vehicles that leave their area."""
    for vehicle, states in zip(setup.world.vehicles, driven.states, strict=True):
        places = np.vstack([states.position_m, *approach(vehicle, states).places_m])[:, :2]
        north, east = (float(size) for size in np.ptp(places, axis=0))
        if vehicle.area_m is not None and (north > vehicle.area_m[0] or east > vehicle.area_m[1]):
            own, most = _size((north, east)), _size(vehicle.area_m)
            yield f"The drive of {vehicle.stage} takes {own}, beyond its area of {most}."


def tight_areas(setup: Setup) -> Iterator[str]:
    """Vehicles that could drive more legs if their area were wider."""
    for stage, vehicle in enumerate(setup.world.vehicles):
        own = [told for told in setup.told if told.leg.stage == stage]
        fitting = [told for told in own if way_of([told]).within(told.area_m)]
        if vehicle.area_m is None or len(fitting) == len(own):
            continue
        north, east = (max(way_of([told]).extent_m[k] for told in own) for k in range(2))
        widest = _size((north / AREA_SHARE, east / AREA_SHARE))
        yield (
            f"{len(fitting)} of the {len(own)} legs that {vehicle.stage} can drive stay within its "
            f"area of {_size(vehicle.area_m)}: a wider one may do, or be done with sooner "
            f"({widest} for all of them)."
        )


def _size(extent_m: Place) -> str:
    north, east = (to_places(size, 0) if size >= 10.0 else to_digits(size, 2) for size in extent_m)
    return f"{north} m by {east} m"
