"""Errors in ECEF, as the paper writes its equations; the chain itself works in NED.

The paper takes R_en as constant during a shift, so ECEF errors are NED ones turned by it and
their lengths are the same.
"""

from __future__ import annotations

import math

import numpy as np

from syncline_design.effects.record import Array
from syncline_design.model.system import SimulationError


def ecef_from_ned(latitude_rad: float, longitude_rad: float) -> Array:
    """R_en, (3, 3): takes NED vectors at a geodetic latitude and longitude to ECEF.

    Its columns are north, east and down, as pymap3d turns them.
    """
    from pymap3d import enu2uvw

    if not (math.isfinite(longitude_rad) and abs(latitude_rad) <= 0.5 * math.pi):
        raise SimulationError(
            "place: expected a latitude of at most 90 deg and a finite longitude, found "
            f"{math.degrees(latitude_rad):g} deg, {math.degrees(longitude_rad):g} deg"
        )
    north_east_down = ((0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, -1.0))  # as east, north, up
    columns = [enu2uvw(*enu, latitude_rad, longitude_rad, deg=False) for enu in north_east_down]
    return np.array(columns, dtype=np.float64).T


def errors_in_ecef(errors_ned_m: Array, latitude_rad: float, longitude_rad: float) -> Array:
    """Errors [m] (n, 3) NED at a place, in ECEF: e^e = R_en e^n."""
    turned: Array = errors_ned_m @ ecef_from_ned(latitude_rad, longitude_rad).T
    return turned
