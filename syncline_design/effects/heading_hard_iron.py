"""A magnetic heading errs with the sine and cosine of the heading."""

from __future__ import annotations

import math

import numpy as np

from syncline_design.effects.kinematics import down_axis_sweep
from syncline_design.effects.record import (
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
    """measured yaw = true + A sin(yaw) + B cos(yaw) [rad]."""
    yaw = rows.euler_rad[:, 2]
    added = np.zeros((len(rows), 3))
    added[:, 2] = values["sin_rad"] * np.sin(yaw) + values["cos_rad"] * np.cos(yaw)
    return Departures(attitude_euler_rad=added)


def _sensitivity(rows: StageRows, values: Values, sensor: Target) -> Array:
    """d error / d (A, B) = (z x R q) (sin yaw, cos yaw) [m/rad]; (n, 3, 2)."""
    yaw = rows.euler_rad[:, 2]
    wave = np.stack([np.sin(yaw), np.cos(yaw)], axis=-1)
    slope: Array = down_axis_sweep(rows)[:, :, None] * wave[:, None, :]
    return slope


def _contribute(stage: Stage, values: Values, sensor: Target, basis: Basis) -> Contribution:
    """sqrt(A^2 + B^2): the worst heading."""
    return Contribution(turn_rad=math.hypot(values["sin_rad"], values["cos_rad"]))


EFFECT = Effect(
    name="heading_hard_iron",
    sensors=("attitude",),
    kind="deterministic",
    parameters=(
        Parameter("sin_rad", 1e-5, 0.5, "rad"),
        Parameter("cos_rad", 1e-5, 0.5, "rad"),
    ),
    sentence="headings err with the heading: {sin_rad} times its sine, {cos_rad} times its cosine",
    confused_with="attitude latency on reciprocal lines; heading_drift",
    separated_by="full circles both ways",
    source="magnetic compass deviation, coefficients B and C (one turn per circle)",
    depart=_depart,
    sensitivity=_sensitivity,
    contribute=_contribute,
    by_heading=True,
)
