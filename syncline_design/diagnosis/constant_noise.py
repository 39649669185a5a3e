"""What an effect does against noise that stays the same over the whole log.

A sensor whose every reading is off by one and the same c standard deviations makes the error
    L(t) c,  L (n, 3, r) what one standard deviation of each of its readings does [m].
An effect whose error e is that, for some c of at most one, is within what the spec lets the sensor
be wrong by: a log in which the sensor's error never changes cannot tell the two apart.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from syncline_design.diagnosis.consequence import compared
from syncline_design.diagnosis.expected_noise import channels
from syncline_design.diagnosis.fitting import Data
from syncline_design.diagnosis.result import WithinNoise
from syncline_design.effects.record import Array

LEFT: Final = 0.2  # of an effect's RMS that may be left: as little as does not matter
MOST: Final = 1.0  # standard deviations


def within_noise(data: Data, made: Array) -> WithinNoise | None:
    """The sensor whose constant error makes an effect's error (n, 3) [m] with the least of its
    standard deviations; None where none does."""
    known = compared(data)
    right = np.where(known, made, 0.0).ravel()
    whole = float(np.linalg.norm(right))
    found = []
    for (stage, sensor), loading in channels(data.view):
        columns = (loading * known[:, :, None]).reshape(right.size, -1)
        share, *_ = np.linalg.lstsq(columns, right, rcond=None)
        left = float(np.linalg.norm(right - columns @ share))
        most = float(np.max(np.abs(share)))
        if left <= LEFT * whole and 0.0 < most <= MOST:
            found.append(WithinNoise(stage, sensor, most))
    return min(found, key=lambda one: one.sigmas, default=None)
