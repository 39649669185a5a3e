"""A constant added to every range."""

from __future__ import annotations

from syncline_design.effects.kinematics import bearing, column, rotate
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
    """measured r = true r + bias [m]."""
    return Departures(range_m=column(values["bias_m"], rows))


def _sensitivity(rows: StageRows, values: Values, sensor: ActsOn) -> Array:
    """d error / d bias = R n; (n, 3, 1)."""
    return rotate(rows.rotation, bearing(rows.azimuth_rad, rows.elevation_rad))[:, :, None]


def _contribute(stage: Stage, values: Values, sensor: ActsOn, basis: Basis) -> Contribution:
    """|bias|."""
    return Contribution(systematic_m=abs(values["bias_m"]))


EFFECT = Effect(
    name="range_bias",
    sensors=("ranging",),
    kind="deterministic",
    parameters=(Parameter("bias_m", 1e-3, 20.0, "m"),),
    sentence="ranges are {bias_m} too long",
    confused_with="range_scale",
    separated_by="a spread of ranges",
    source="paper, eq. bear_posvec; measured = true + bias",
    depart=_depart,
    sensitivity=_sensitivity,
    contribute=_contribute,
    rarity=40,
    passing=True,
    commissioned=("ranging",),
    comes_with="sensor",
    asked_in_stretches=True,
    asked_jointly=True,
    constant=(("ranging", 0),),
)
