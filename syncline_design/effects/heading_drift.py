"""The heading drifts at a constant rate."""

from __future__ import annotations

import numpy as np

from syncline_design.effects.kinematics import down_axis_sweep, elapsed
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
    """measured yaw = true + rate (t - t0) [rad]."""
    added = np.zeros((len(rows), 3))
    added[:, 2] = values["rate_radps"] * elapsed(rows)
    return Departures(attitude_euler_rad=added)


def _sensitivity(rows: StageRows, values: Values, sensor: ActsOn) -> Array:
    """d error / d rate = (z x R q) (t - t0) [m s/rad]; (n, 3, 1)."""
    return (down_axis_sweep(rows) * elapsed(rows)[:, None])[:, :, None]


def _contribute(stage: Stage, values: Values, sensor: ActsOn, basis: Basis) -> Contribution:
    """|rate| times the mission's duration."""
    return Contribution(turn_rad=abs(values["rate_radps"]) * basis.horizon.duration_s)


EFFECT = Effect(
    name="heading_drift",
    sensors=("attitude",),
    kind="deterministic",
    parameters=(Parameter("rate_radps", 1e-9, 1e-2, "rad/s"),),
    sentence="headings drift by {rate_radps}",
    confused_with="clock_drift",
    separated_by="coming back to the same place and heading",
    source="gyro bias in an unaided heading; measured = true + rate (t - t0)",
    depart=_depart,
    sensitivity=_sensitivity,
    contribute=_contribute,
    comes_with="sensor",
    grows=True,
)
