"""The ranging sensor is turned against the mounting that the spec believes."""

from __future__ import annotations

import numpy as np

from syncline_design.effects.kinematics import ranging_vector, rotate, row_vector
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
    """beta [rad], body axes: the true mounting is the spec's times exp(S(beta))."""
    return Departures(
        bearing_rotation_rad=row_vector(values["x_rad"], values["y_rad"], values["z_rad"])
    )


def _sensitivity(rows: StageRows, values: Values, sensor: ActsOn) -> Array:
    """d error / d beta_k = -R (e_k x b) [m/rad]; (n, 3, 3)."""
    b = ranging_vector(rows)
    return np.stack([-rotate(rows.rotation, np.cross(axis, b)) for axis in np.eye(3)], axis=-1)


def _contribute(stage: Stage, values: Values, sensor: ActsOn, basis: Basis) -> Contribution:
    """|beta| of the line of sight."""
    angle = float(np.linalg.norm([values["x_rad"], values["y_rad"], values["z_rad"]]))
    return Contribution(sight_rad=angle)


EFFECT = Effect(
    name="boresight",
    sensors=("ranging",),
    kind="deterministic",
    parameters=tuple(Parameter(f"{axis}_rad", 1e-5, 0.2, "rad") for axis in "xyz"),
    sentence="the ranging sensor is turned by {x_rad}, {y_rad}, {z_rad} about forward, right, down",
    confused_with="the attitude sensor's mounting",
    separated_by="a spread of ranges, tilt",
    source="paper, eq. meas_lidar; R_true = R_spec exp(S(beta))",
    depart=_depart,
    sensitivity=_sensitivity,
    contribute=_contribute,
    rarity=30,
    commissioned=("ranging",),
    breaks="mounting",
    asked_in_stretches=True,
    asked_jointly=True,
)
