"""The attitude sensor is turned against the mounting that the spec believes."""

from __future__ import annotations

import math

import numpy as np

from syncline_design.effects.kinematics import antenna_to_object, rotate, row_vector
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
    """alpha [rad], body axes: the true mounting is the spec's times exp(S(alpha))."""
    turned = row_vector(values["x_rad"], values["y_rad"], values["z_rad"])
    return Departures(attitude_rotation_rad=turned)


def _sensitivity(rows: StageRows, values: Values, sensor: ActsOn) -> Array:
    """d error / d alpha_k = R (e_k x q) [m/rad]; (n, 3, 3)."""
    q = antenna_to_object(rows)
    return np.stack([rotate(rows.rotation, np.cross(axis, q)) for axis in np.eye(3)], axis=-1)


def _contribute(stage: Stage, values: Values, sensor: ActsOn, basis: Basis) -> Contribution:
    """|alpha|."""
    return Contribution(turn_rad=math.hypot(values["x_rad"], values["y_rad"], values["z_rad"]))


EFFECT = Effect(
    name="mounting",
    sensors=("attitude",),
    kind="deterministic",
    parameters=tuple(Parameter(f"{axis}_rad", 1e-5, 0.2, "rad") for axis in "xyz"),
    sentence="the attitude sensor is turned by {x_rad}, {y_rad}, {z_rad} about its axes",
    confused_with="boresight together with a lever arm; heading_bias when level",
    separated_by="a spread of ranges, tilt",
    source="paper, eq. meas_ins; R_true = R_spec exp(S(alpha))",
    depart=_depart,
    sensitivity=_sensitivity,
    contribute=_contribute,
    rarity=80,
    breaks="mounting",
    asked_in_stretches=True,
    asked_jointly=True,
    constant=(("attitude", 0), ("attitude", 1)),
)
