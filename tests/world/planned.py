"""A planned drive as a run of the world: the plan's rows become true splines."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import make_interp_spline

from tests.world.motions import Sensors
from tests.world.scenarios import Carrier, Indices, Scenario
from tests.world.trajectory import Array, Path

MARGIN = 40  # steps straight on before the first row and after the last


def true_path(time_s: Array, place_m: Array, euler_rad: Array) -> Path:
    """Splines through rows of place and (roll, pitch, yaw); straight on at both ends."""
    step = float(np.median(np.diff(time_s)))
    off = step * np.arange(1, MARGIN + 1)
    first, last = (place_m[1] - place_m[0]) / step, (place_m[-1] - place_m[-2]) / step
    times = np.concatenate([time_s[0] - off[::-1], time_s, time_s[-1] + off])
    before, after = place_m[0] - off[::-1, None] * first, place_m[-1] + off[:, None] * last
    angles = np.unwrap(euler_rad[:, ::-1], axis=0)
    ends = [np.tile(angles[k], (MARGIN, 1)) for k in (0, -1)]
    return Path(
        make_interp_spline(times, np.concatenate([before, place_m, after]), k=5),
        make_interp_spline(times, np.concatenate([ends[0], angles, ends[1]]), k=5),
    )


def driven(
    name: str,
    seed: int,
    time_s: Array,
    place_m: Array,
    euler_rad: Array,
    targets_m: Array,
    aimed: Indices,
    sensors: Sensors,
    limits: tuple[float, float, float],
) -> Scenario:
    """The rows of a plan, driven; rows that aim at nothing are not logged."""
    carrier = Carrier("vehicle", true_path(time_s, place_m, euler_rad), sensors, *limits)
    seen = aimed >= 0
    stamps = np.round(time_s[seen], 4)
    rate = 1.0 / float(np.median(np.diff(time_s)))
    return Scenario(name, seed, "georeference", float(stamps[-1]), rate, stamps, (carrier,),
                    targets_m, aimed[seen])  # fmt: skip
