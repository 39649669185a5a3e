"""What an effect does against noise that stays the same over the whole log.

A sensor whose every reading is off by one and the same c standard deviations makes the error
    L(t) c,  L (n, 3, r) what one standard deviation of each of its readings does [m].
An effect whose error e is that is within what the spec lets the sensor be wrong by where c is no
rarer than RARE: noise that never changes has c ~ N(0, 1) in every reading, and |c|^2 is chi-square
of r.  A log in which the sensor's error never changes cannot tell the two apart.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from syncline_design.diagnosis.consequence import compared
from syncline_design.diagnosis.expected_noise import channels
from syncline_design.diagnosis.fitting import Data
from syncline_design.diagnosis.result import WithinNoise
from syncline_design.effects.record import Array
from syncline_design.model.distributions import chi_square_beyond

LEFT: Final = 0.2  # of an effect's RMS that may be left: as little as does not matter
RARE: Final = 0.05  # of logs whose noise never changes, in which it is as large


def within_noise(data: Data, made: Array) -> WithinNoise | None:
    """The sensor whose constant error most often makes an effect's error (n, 3) [m] or a larger
    one; None where none does."""
    known = compared(data)
    right = np.where(known, made, 0.0).ravel()
    whole = float(np.linalg.norm(right))
    found = []
    for (stage, sensor), loading in channels(data.view):
        columns = (loading * known[:, :, None]).reshape(right.size, -1)
        share, *_ = np.linalg.lstsq(columns, right, rcond=None)
        left = float(np.linalg.norm(right - columns @ share))
        most = float(np.max(np.abs(share)))
        chance = chi_square_beyond(float(share @ share), len(share))
        if left <= LEFT * whole and most > 0.0 and chance >= RARE:
            found.append(WithinNoise(stage, sensor, most, chance))
    return max(found, key=lambda one: one.chance, default=None)
