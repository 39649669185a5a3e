"""The ranging sensor's mount bends under acceleration."""

from __future__ import annotations

import math

import numpy as np

from syncline_design.effects.base import (
    Array,
    Basis,
    Contribution,
    Departures,
    Effect,
    Parameter,
    Rng,
    StageRows,
    Target,
    Values,
)
from syncline_design.model.system import Stage


def _depart(rows: StageRows, values: Values, sensor: Target, _: Rng) -> Departures:
    """true lever arm = spec + (x a_x, y a_y, z a_z) [m], body."""
    bend = np.array([values["x"], values["y"], values["z"]])
    return Departures(ranging_m=bend * rows.acceleration_mps2)


def _sensitivity(rows: StageRows, values: Values, sensor: Target) -> Array:
    """d error / d C_k = -R e_k a_k [m/s2]; (n, 3, 3)."""
    return -rows.rotation * rows.acceleration_mps2[:, None, :]


def _contribute(stage: Stage, values: Values, sensor: Target, basis: Basis) -> Contribution:
    """|C| v omega: the bend in the platform's hardest turn."""
    bend = math.hypot(values["x"], values["y"], values["z"])
    turn = stage.platform.v_max_mps * stage.platform.omega_max_radps
    return Contribution(systematic_m=bend * turn)


EFFECT = Effect(
    name="flexure",
    sensors=("ranging",),
    kind="deterministic",
    parameters=tuple(Parameter(axis, 1e-5, 0.5, "m/(m/s2)") for axis in "xyz"),
    sentence="the ranging sensor's mount bends by {x}, {y}, {z} forward, right, down",
    confused_with="filter_lag, acceleration_tilt",
    separated_by="accelerations along each axis at different ranges",
    source="linear elasticity: displacement proportional to acceleration, per axis",
    depart=_depart,
    sensitivity=_sensitivity,
    contribute=_contribute,
)
