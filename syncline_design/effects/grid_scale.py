"""The survey's grid has another scale than the positions."""

from __future__ import annotations

from typing import Final

import numpy as np

from syncline_design.effects.record import (
    ActsOn,
    Array,
    Basis,
    Contribution,
    Departures,
    Effect,
    Parameter,
    Rng,
    StageRows,
    Values,
)
from syncline_design.model.system import Stage

PROJECTED: Final = 1e-3  # of UTM 0.9996 to 1.00098 (Snyder, USGS Professional Paper 1395, 1987)


def _depart(rows: StageRows, values: Values, sensor: ActsOn, _: Rng) -> Departures:
    """surveyed object = true (1 + scale), horizontally, about the local origin."""
    return Departures(target_m=values["scale"] * _level(rows))


def _level(rows: StageRows) -> Array:
    """North and east of the object [m], NED with down 0, (n, 3)."""
    level: Array = rows.target_m * np.array([1.0, 1.0, 0.0])
    return level


def _sensitivity(rows: StageRows, values: Values, sensor: ActsOn) -> Array:
    """d error / d scale = -(p_north, p_east, 0) [m]; (n, 3, 1)."""
    return -_level(rows)[:, :, None]


def _contribute(stage: Stage, values: Values, sensor: ActsOn, basis: Basis) -> Contribution:
    """|scale| times the extent, the farthest that an object lies from the origin."""
    return Contribution(systematic_m=abs(values["scale"]) * basis.horizon.extent_m)


EFFECT = Effect(
    name="grid_scale",
    sensors=("target",),
    kind="deterministic",
    parameters=(Parameter("scale", 1e-7, 0.01, above=-1.0, usual=PROJECTED),),
    sentence="the survey's grid is too large by a share of {scale}",
    confused_with="datum_offset on a short baseline",
    separated_by="a long baseline",
    source="map projection point scale; surveyed = true (1 + scale)",
    depart=_depart,
    sensitivity=_sensitivity,
    contribute=_contribute,
)
