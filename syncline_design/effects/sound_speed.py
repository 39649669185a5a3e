"""Acoustic ranges are computed with a wrong speed of sound."""

from __future__ import annotations

from syncline_design.effects.base import (
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
from syncline_design.effects.kinematics import column, ranging_vector, rotate
from syncline_design.model.system import Stage

ACOUSTIC = ("usbl", "mbes")


def _applies(stage: Stage, sensor: Target) -> bool:
    return stage.ranging is not None and stage.ranging.type.lower() in ACOUSTIC


def _depart(rows: StageRows, values: Values, sensor: Target, _: Rng) -> Departures:
    """measured r = true r (1 + dc/c), dc what the speed used is too high by."""
    return Departures(range_scale=column(values["relative_error"], rows))


def _sensitivity(rows: StageRows, values: Values, sensor: Target) -> Array:
    """d error / d (dc/c) = R b [m]; (n, 3, 1)."""
    return rotate(rows.rotation, ranging_vector(rows))[:, :, None]


def _contribute(stage: Stage, values: Values, sensor: Target, basis: Basis) -> Contribution:
    """|dc/c| d."""
    return Contribution(systematic_m=abs(values["relative_error"]) * stage.platform.distance_m)


EFFECT = Effect(
    name="sound_speed",
    sensors=("ranging",),
    kind="deterministic",
    parameters=(Parameter("relative_error", 1e-5, 0.1),),
    sentence="the speed of sound in use is too high by a share of {relative_error}",
    confused_with="range_scale, which is the same to any log; turnaround_delay",
    separated_by="a spread of ranges",
    source="two-way travel time: r = c t / 2",
    depart=_depart,
    sensitivity=_sensitivity,
    contribute=_contribute,
    applies=_applies,
)
