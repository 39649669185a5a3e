"""Heave is measured away from where it is used, so roll and pitch add to it."""

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
    on_vessels,
)
from syncline_design.model.system import Stage


def _heave(rows: StageRows) -> Array:
    """Down component of (R - I) l per unit l [-], (n, 3): -sin p, sin r cos p, cos r cos p - 1."""
    slope: Array = rows.rotation[:, 2, :] - np.array([0.0, 0.0, 1.0])
    return slope


def _depart(rows: StageRows, values: Values, sensor: ActsOn, _: Rng) -> Departures:
    """The down reading is off by the down component of (R - I) l."""
    lever = np.array([values["x_m"], values["y_m"], values["z_m"]])
    added = np.zeros((len(rows), 3))
    added[:, 2] = _heave(rows) @ lever
    return Departures(position_m=added)


def _sensitivity(rows: StageRows, values: Values, sensor: ActsOn) -> Array:
    """d error / d l: the down row only [-]; (n, 3, 3)."""
    slope = np.zeros((len(rows), 3, 3))
    slope[:, 2, :] = _heave(rows)
    return slope


def _contribute(stage: Stage, values: Values, sensor: ActsOn, basis: Basis) -> Contribution:
    """hypot(x, y) sin t + |z| (1 - cos t), t the horizon's tilt: the largest at any tilt below."""
    tilt = basis.horizon.tilt_rad
    level = math.hypot(values["x_m"], values["y_m"])
    lift = abs(values["z_m"]) * (1.0 - math.cos(tilt))
    return Contribution(systematic_m=level * math.sin(tilt) + lift)


EFFECT = Effect(
    name="induced_heave",
    sensors=("position",),
    kind="deterministic",
    parameters=tuple(Parameter(f"{axis}_m", 1e-2, 50.0, "m") for axis in "xyz"),
    sentence="heave is measured {x_m} forward, {y_m} right, {z_m} down of where it is used",
    confused_with="height_drift; lever_arm",
    separated_by="roll and pitch at different headings",
    source="rigid-body kinematics of remote heave",
    depart=_depart,
    sensitivity=_sensitivity,
    contribute=_contribute,
    applies=on_vessels,
    tilted=True,
)
