"""The surveyed coordinates are off by a constant."""

from __future__ import annotations

import math

import numpy as np

from syncline_design.effects.kinematics import row_vector
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
    """surveyed object = true + offset [m], NED."""
    return Departures(target_m=row_vector(values["north_m"], values["east_m"], values["down_m"]))


def _sensitivity(rows: StageRows, values: Values, sensor: ActsOn) -> Array:
    """d error / d offset = -I; (n, 3, 3)."""
    return np.broadcast_to(-np.eye(3), (len(rows), 3, 3))


def _contribute(stage: Stage, values: Values, sensor: ActsOn, basis: Basis) -> Contribution:
    """|offset|."""
    return Contribution(
        systematic_m=math.hypot(values["north_m"], values["east_m"], values["down_m"])
    )


EFFECT = Effect(
    name="datum_offset",
    sensors=("target",),
    kind="deterministic",
    parameters=tuple(
        Parameter(f"{axis}_m", 1e-3, 100.0, "m") for axis in ("north", "east", "down")
    ),
    sentence="surveyed coordinates are {north_m} north, {east_m} east, {down_m} down of true",
    confused_with="a lever arm at fixed heading; slow position noise",
    separated_by="turning: a datum offset stays put",
    source="measured = true + bias, of the survey",
    depart=_depart,
    sensitivity=_sensitivity,
    contribute=_contribute,
    rarity=60,
    asked_in_stretches=True,
    constant=tuple(("position", axis) for axis in range(3)),
)
