"""Where a stage looks and how far, as blocks to choose and as vectors."""

from __future__ import annotations

import numpy as np

from syncline_design.effects.record import Array
from syncline_design.model.system import Stage
from syncline_design.simulation.ascent import RegionKind
from syncline_design.simulation.draws import sight


def sights(index: int, stage: Stage) -> list[tuple[int, str, RegionKind, int]]:
    """Blocks of a line of sight: any direction, or the height and azimuth of a `look`."""
    if stage.look is None:
        return [(index, "bearing", "sphere", 3)]
    around: tuple[int, str, RegionKind, int] = (index, "azimuth", "sphere", 2)
    if stage.look.azimuth is not None:
        around = (index, "azimuth", "ball", 1)
    return [around, (index, "elevation", "ball", 1)]


def bearings(stage: Stage, picked: dict[str, Array], count: int) -> Array:
    """Line of sight in the body's axes, (3, count)."""
    if stage.look is None:
        return np.broadcast_to(picked["bearing"], (3, count))
    at = picked["azimuth"]
    if stage.look.azimuth is None:
        across = 0.5 + np.arctan2(at[1], at[0]) / (2.0 * np.pi)
    else:
        across = 0.5 * (at[0] + 1.0)
    return sight(stage.look, across, 0.5 * (picked["elevation"][0] + 1.0))


def ranges_m(stage: Stage, picked: dict[str, Array], count: int) -> Array:
    """Distance of the object [m], (count,): the one there is, or as chosen between both ends."""
    far = float(stage.platform.distance_m)
    if "distance" not in picked or stage.platform.nearest_m is None:
        return np.full(count, far)
    near = float(stage.platform.nearest_m)
    between: Array = 0.5 * (near + far) + reach_m(stage) * picked["distance"][0]
    return between


def reach_m(stage: Stage) -> float:
    """Half of what lies between the nearest and the farthest object [m]."""
    near = stage.platform.nearest_m
    return 0.0 if near is None else 0.5 * (float(stage.platform.distance_m) - float(near))
