"""A magnetic heading errs with the sine and cosine of the heading."""

from __future__ import annotations

import math

from syncline_design.effects.kinematics import heading_departure, heading_slope
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
    """measured yaw = true + A sin(yaw) + B cos(yaw) [rad]."""
    return heading_departure(rows, values, 1)


def _sensitivity(rows: StageRows, values: Values, sensor: ActsOn) -> Array:
    """d error / d (A, B) = (z x R q) (sin yaw, cos yaw) [m/rad]; (n, 3, 2)."""
    return heading_slope(rows, 1)


def _contribute(stage: Stage, values: Values, sensor: ActsOn, basis: Basis) -> Contribution:
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
    follows="heading",
)
