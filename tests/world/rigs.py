"""Plain vehicles of the hidden world whose errors can be written down by hand."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tests.world.hidden import Hidden
from tests.world.motions import Sensors
from tests.world.noise import SILENT
from tests.world.scenarios import Carrier, Scenario
from tests.world.trajectory import Path, fit, grid
from tests.world.worldlog import make_log

Array = NDArray[np.float64]
SPEED_MPS = 8.0


def track(
    place: Callable[[Array], list[Array]],
    yaw: Callable[[Array], Array] | None = None,
    **tilt: float,
) -> Path:
    time_s = grid(120.0)
    zero = np.zeros_like(time_s)
    heading = zero if yaw is None else yaw(time_s)
    angles = [heading, zero + tilt.get("pitch", 0.0), zero + tilt.get("roll", 0.0)]
    return fit(time_s, np.column_stack(place(time_s)), np.column_stack(angles))


def north_bound(**tilt: float) -> Path:
    return track(lambda t: [SPEED_MPS * t, 0 * t, 0 * t], None, **tilt)


def standing(**tilt: float) -> Path:
    return track(lambda t: [0 * t, 0 * t, 0 * t], None, **tilt)


def run_of(path: Path, target: list[float], kind: str = "georeference") -> Scenario:
    """A carrier without arms that sights one target, twice a second."""
    sensors = Sensors(antenna_arm_m=(0.0, 0.0, 0.0), ranging_arm_m=(0.0, 0.0, 0.0))
    if kind == "position":
        sensors = replace(sensors, ranging=None, attitude_rad=None)
    carrier = Carrier("rig", path, sensors, 10.0, 1.0, 10.0)
    stamps = np.arange(200, dtype=np.float64) * 0.5
    sighted = np.zeros(200, np.int64)
    return Scenario("rig", 3, kind, 100.0, 2.0, stamps, (carrier,), np.array([target]), sighted)


def caused(run: Scenario, *effects: Hidden) -> Array:
    return make_log(run, effects, SILENT).error()


def close(found: Array, expected: list[float], within: float = 1e-9) -> None:
    np.testing.assert_allclose(found, np.broadcast_to(expected, found.shape), atol=within)
