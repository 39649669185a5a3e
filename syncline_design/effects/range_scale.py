"""Every range is too long by the same share."""

from __future__ import annotations

from syncline_design.effects.kinematics import column, ranging_vector, rotate
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
    """measured r = true r (1 + scale)."""
    return Departures(range_scale=column(values["scale"], rows))


def _sensitivity(rows: StageRows, values: Values, sensor: ActsOn) -> Array:
    """d error / d scale = R b [m]; (n, 3, 1)."""
    return rotate(rows.rotation, ranging_vector(rows))[:, :, None]


def _contribute(stage: Stage, values: Values, sensor: ActsOn, basis: Basis) -> Contribution:
    """|scale| d."""
    return Contribution(systematic_m=abs(values["scale"]) * stage.platform.distance_m)


EFFECT = Effect(
    name="range_scale",
    sensors=("ranging",),
    kind="deterministic",
    parameters=(Parameter("scale", 1e-6, 0.2, above=-1.0),),
    sentence="ranges are too long by a share of {scale}",
    confused_with="range_bias; sound_speed, straight below the array",
    separated_by="a spread of ranges",
    source="paper, eq. bear_posvec; measured = true (1 + scale)",
    depart=_depart,
    sensitivity=_sensitivity,
    contribute=_contribute,
    rarity=70,
    comes_with="sensor",
)
