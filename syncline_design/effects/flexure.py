"""The ranging sensor's mount bends under its load: acceleration and gravity."""

from __future__ import annotations

import math

import numpy as np

from syncline_design.effects.kinematics import GRAVITY_MPS2, specific_force
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
    """true lever arm = spec + (x f_x, y f_y, z f_z) [m], body, f the specific force."""
    bend = np.array([values["x"], values["y"], values["z"]])
    return Departures(ranging_m=bend * specific_force(rows))


def _sensitivity(rows: StageRows, values: Values, sensor: ActsOn) -> Array:
    """d error / d C_k = -R e_k f_k [m/s2]; (n, 3, 3)."""
    return -rows.rotation * specific_force(rows)[:, None, :]


def _contribute(stage: Stage, values: Values, sensor: ActsOn, basis: Basis) -> Contribution:
    """The sag of the tilt at which it is largest, and the bend of the platform's hardest turn.

    g sqrt((z cos t)^2 + (max(x, y) sin t)^2), t up to the horizon's tilt, + max(x, y, z) v omega.
    """
    across, along = max(abs(values["x"]), abs(values["y"])), abs(values["z"])
    tilt = min(basis.horizon.tilt_rad, 0.5 * math.pi) if across > along else 0.0
    sag = GRAVITY_MPS2 * math.hypot(along * math.cos(tilt), across * math.sin(tilt))
    turn = stage.platform.v_max_mps * stage.platform.omega_max_radps
    return Contribution(systematic_m=sag + max(across, along) * turn)


EFFECT = Effect(
    name="flexure",
    sensors=("ranging",),
    kind="deterministic",
    parameters=tuple(Parameter(axis, 1e-5, 0.5, "m/(m/s2)") for axis in "xyz"),
    sentence="the ranging sensor's mount bends by {x}, {y}, {z} forward, right, down",
    confused_with="filter_lag, acceleration_tilt; lever_arm (level at constant speed)",
    separated_by="accelerations along each axis and tilts, at different ranges",
    source="linear elasticity: displacement proportional to the specific force a - g, per axis",
    depart=_depart,
    sensitivity=_sensitivity,
    contribute=_contribute,
    tilted=True,
    accelerated=True,
    follows="load",
    breaks="mounting",
)
