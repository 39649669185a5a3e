"""The transponder answers later than the ranging believes."""

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

SOUND_SPEED_MPS = 1500.0


def _applies(stage: Stage, sensor: ActsOn) -> bool:
    return stage.ranging is not None and stage.ranging.type.lower() == "usbl"


def _depart(rows: StageRows, values: Values, sensor: ActsOn, _: Rng) -> Departures:
    """measured r = true r + c dt / 2 [m]."""
    return Departures(range_m=column(0.5 * SOUND_SPEED_MPS * values["delay_s"], rows))


def _sensitivity(rows: StageRows, values: Values, sensor: ActsOn) -> Array:
    """d error / d dt = R n c / 2 [m/s]; (n, 3, 1)."""
    line = rotate(rows.rotation, bearing(rows.azimuth_rad, rows.elevation_rad))
    return 0.5 * SOUND_SPEED_MPS * line[:, :, None]


def _contribute(stage: Stage, values: Values, sensor: ActsOn, basis: Basis) -> Contribution:
    """|c dt / 2|."""
    return Contribution(systematic_m=0.5 * SOUND_SPEED_MPS * abs(values["delay_s"]))


EFFECT = Effect(
    name="turnaround_delay",
    sensors=("ranging",),
    kind="deterministic",
    parameters=(Parameter("delay_s", 1e-6, 0.05, "s"),),
    sentence="the transponder answers {delay_s} later than assumed",
    confused_with="range_bias, which is the same to any log; sound_speed",
    separated_by="a spread of ranges",
    source="two-way travel time with c = 1500 m/s: r = c (t - dt) / 2",
    depart=_depart,
    sensitivity=_sensitivity,
    contribute=_contribute,
    applies=_applies,
    rarity=120,
    breaks="latency",
    comes_with="sensor",
)
