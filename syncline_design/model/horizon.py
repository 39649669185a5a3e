"""How long, how wide and how steep a mission is."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Horizon:
    """What drifts, grids and heave are charged for and simulated over.

    duration_s: time since the start is at most this; extent_m: objects lie within this distance
    of the origin, level; tilt_rad: largest angle of a vehicle's down axis to the vertical.
    """

    duration_s: float = 3600.0
    extent_m: float = 1000.0
    tilt_rad: float = math.radians(10.0)


DEFAULT_HORIZON = Horizon()
