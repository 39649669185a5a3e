"""A sensor scatters more than its data sheet says."""

from __future__ import annotations

import math

from syncline_design.effects.kinematics import column
from syncline_design.effects.record import (
    ActsOn,
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


def _depart(rows: StageRows, values: Values, sensor: ActsOn, rng: Rng) -> Departures:
    """The sensor's noise is factor times the spec's."""
    extra = column(values["factor"] - 1.0, rows)
    if sensor == "position":
        return Departures(position_noise=extra)
    if sensor == "attitude":
        return Departures(attitude_noise=extra)
    return Departures(ranging_noise=extra)


def _contribute(stage: Stage, values: Values, sensor: ActsOn, basis: Basis) -> Contribution:
    """(factor - 1) times the sensor's terms of the sensor error."""
    part = getattr(stage, sensor, None)
    if part is None:
        return Contribution()
    more = max(values["factor"] - 1.0, 0.0)
    if sensor == "position":
        return Contribution(systematic_m=more * math.hypot(*part.sigma))
    if sensor == "attitude":
        return Contribution(turn_rad=more * math.hypot(*part.sigma))
    return Contribution(
        systematic_m=more * part.sigma[0], sight_rad=more * math.hypot(*part.sigma[1:])
    )


EFFECT = Effect(
    name="noise_understated",
    sensors=("position", "attitude", "ranging"),
    kind="stochastic",
    parameters=(Parameter("factor", 1.0, 100.0, signed=False, above=0.0),),
    sentence="{sensor} data scatter {factor} times as much as the spec says",
    confused_with="heavy_tails, correlated_noise, timestamp_jitter",
    separated_by="a longer log; standing still",
    source="paper, eq. sensor_error_ub, with the standard deviations times factor",
    depart=_depart,
    sensitivity=None,
    contribute=_contribute,
    rarity=140,
    opens="factor",
    brief=("{factor} times the spec's",),
    comes_with="sensor",
)
