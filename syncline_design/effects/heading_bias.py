"""A constant added to every heading."""

from __future__ import annotations

from syncline_design.effects.kinematics import down_axis_sweep, row_vector
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
    """measured yaw = true + bias [rad]."""
    return Departures(attitude_euler_rad=row_vector(0.0, 0.0, values["bias_rad"]))


def _sensitivity(rows: StageRows, values: Values, sensor: ActsOn) -> Array:
    """d error / d bias = z x R q [m/rad]; (n, 3, 1)."""
    return down_axis_sweep(rows)[:, :, None]


def _contribute(stage: Stage, values: Values, sensor: ActsOn, basis: Basis) -> Contribution:
    """|bias|."""
    return Contribution(turn_rad=abs(values["bias_rad"]))


EFFECT = Effect(
    name="heading_bias",
    sensors=("attitude",),
    kind="deterministic",
    parameters=(Parameter("bias_rad", 1e-5, 0.5, "rad"),),
    sentence="headings are {bias_rad} too large",
    confused_with="boresight or mounting about the down axis when level; grid_convergence",
    separated_by="roll and pitch while pointing all around",
    source="paper, eq. R_nb; measured = true + bias",
    depart=_depart,
    sensitivity=_sensitivity,
    contribute=_contribute,
    rarity=50,
    passing=True,
    breaks="mounting",
    comes_with="sensor",
    asked_in_stretches=True,
    constant=(("attitude", 2),),
)
