"""The world's own georeferencing: what a system computes that believes its spec."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from tests.world.scenarios import Carrier
from tests.world.sensing import Reading
from tests.world.trajectory import Array


def beam(polar: Array) -> Array:
    """Vector from the ranging sensor to the object in its own axes; up is positive elevation."""
    turned = Rotation.from_euler("ZY", polar[:, 1:])
    return np.asarray(turned.apply([1.0, 0.0, 0.0]) * polar[:, :1])


def georeference(carriers: tuple[Carrier, ...], readings: tuple[Reading, ...]) -> Array:
    """Estimated place of what the last stage sights (n, 3), or of its reference point."""
    place = readings[0].antenna_m
    assert place is not None
    for carrier, reading in zip(carriers, readings, strict=True):
        turn = Rotation.from_euler("ZYX", reading.euler_rad)
        place = place - turn.apply(carrier.sensors.antenna_arm_m)
        if reading.polar is not None:
            arm = np.array(carrier.sensors.ranging_arm_m)
            place = place + turn.apply(arm + beam(reading.polar))
    return np.asarray(place)
