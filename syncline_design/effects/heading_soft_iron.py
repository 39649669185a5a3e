"""Iron that the field magnetises bends headings twice a turn."""

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
    """measured yaw = true + D sin(2 yaw) + E cos(2 yaw) [rad]."""
    return heading_departure(rows, values, 2)


def _sensitivity(rows: StageRows, values: Values, sensor: ActsOn) -> Array:
    """d error / d (D, E) = (z x R q) (sin 2 yaw, cos 2 yaw) [m/rad]; (n, 3, 2)."""
    return heading_slope(rows, 2)


def _contribute(stage: Stage, values: Values, sensor: ActsOn, basis: Basis) -> Contribution:
    """sqrt(D^2 + E^2): the worst heading."""
    return Contribution(turn_rad=math.hypot(values["sin_rad"], values["cos_rad"]))


EFFECT = Effect(
    name="heading_soft_iron",
    sensors=("attitude",),
    kind="deterministic",
    parameters=(
        Parameter("sin_rad", 1e-5, 0.3, "rad"),
        Parameter("cos_rad", 1e-5, 0.3, "rad"),
    ),
    sentence="headings err with twice the heading: {sin_rad} times its sine, {cos_rad} times its "
    "cosine",
    confused_with="attitude latency on reciprocal lines; heading_bias on few headings",
    separated_by="full circles both ways",
    source="magnetic compass deviation, coefficients D and E (two turns per circle)",
    depart=_depart,
    sensitivity=_sensitivity,
    contribute=_contribute,
    follows="heading",
)
