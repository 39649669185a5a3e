"""The survey's grid north is turned against true north."""

from __future__ import annotations

import math

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


def _depart(rows: StageRows, values: Values, sensor: ActsOn, _: Rng) -> Departures:
    """surveyed object = true turned by gamma about down, at the local origin."""
    cos, sin = math.cos(values["rotation_rad"]), math.sin(values["rotation_rad"])
    north, east = rows.target_m[:, 0], rows.target_m[:, 1]
    turned = np.stack([cos * north - sin * east, sin * north + cos * east], axis=-1)
    moved = np.zeros((len(rows), 3))
    moved[:, :2] = turned - rows.target_m[:, :2]
    return Departures(target_m=moved)


def _sensitivity(rows: StageRows, values: Values, sensor: ActsOn) -> Array:
    """d error / d gamma = -z x p = (p_east, -p_north, 0) [m/rad]; (n, 3, 1)."""
    return -np.cross(np.array([0.0, 0.0, 1.0]), rows.target_m)[:, :, None]


def _contribute(stage: Stage, values: Values, sensor: ActsOn, basis: Basis) -> Contribution:
    """|gamma| times the extent, the farthest that an object lies from the origin."""
    return Contribution(systematic_m=abs(values["rotation_rad"]) * basis.horizon.extent_m)


EFFECT = Effect(
    name="grid_convergence",
    sensors=("target",),
    kind="deterministic",
    parameters=(Parameter("rotation_rad", 1e-7, 0.2, "rad"),),
    sentence="the survey's grid is turned by {rotation_rad} about the down axis",
    confused_with="heading_bias",
    separated_by="a long baseline",
    source="map projection convergence; surveyed = true turned about the local origin",
    depart=_depart,
    sensitivity=_sensitivity,
    contribute=_contribute,
)
