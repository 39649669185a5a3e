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


def duration_words(duration_s: float) -> str:
    """`1 h`, `20 min`, `45 s`."""
    for unit, size in (("h", 3600.0), ("min", 60.0)):
        if duration_s >= size:
            return f"{duration_s / size:.4g} {unit}"
    return f"{duration_s:.4g} s"
