"""A sensor scatters more for a while: epochs without fixed ambiguities, a dusty stretch."""

from __future__ import annotations

import math

import numpy as np

from syncline_design.effects.kinematics import elapsed
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
    """The sensor's noise is factor times the spec's from from_s to to_s after the start."""
    since = elapsed(rows)
    inside = (since >= values["from_s"]) & (since <= values["to_s"])
    extra = np.where(inside, values["factor"] - 1.0, 0.0)
    if sensor == "position":
        return Departures(position_noise=extra)
    if sensor == "attitude":
        return Departures(attitude_noise=extra)
    return Departures(ranging_noise=extra)


def _contribute(stage: Stage, values: Values, sensor: ActsOn, basis: Basis) -> Contribution:
    """(factor - 1) times the sensor's terms: the error while it lasts."""
    part, more = getattr(stage, sensor, None), max(values["factor"] - 1.0, 0.0)
    if part is None:
        return Contribution()
    if sensor == "ranging":
        sight_rad = more * math.hypot(*part.sigma[1:])
        return Contribution(systematic_m=more * part.sigma[0], sight_rad=sight_rad)
    size = more * math.hypot(*part.sigma)
    return Contribution(turn_rad=size) if sensor == "attitude" else Contribution(systematic_m=size)


EFFECT = Effect(
    name="noise_episode",
    sensors=("position", "attitude", "ranging"),
    kind="stochastic",
    parameters=(
        Parameter("factor", 1.0, 1000.0, signed=False, above=0.0),
        Parameter("from_s", 0.0, math.inf, "s", signed=False, located=True),
        Parameter("to_s", 0.0, math.inf, "s", signed=False, located=True),
    ),
    sentence="from {from_s} to {to_s} after the start {sensor} data scatter {factor} times as much "
    "as otherwise",
    confused_with="an effect that shows only while the vehicle moves so; heavy_tails",
    separated_by="the status of the fixes; the same motion at another time",
    source="paper, eq. sensor_error_ub, with the standard deviations times factor for a while, as "
    "of RTK positions while their ambiguities are not fixed",
    depart=_depart,
    sensitivity=None,
    contribute=_contribute,
    opens="episode",
    brief=("{factor} times as much from {from_s} to {to_s} after the start",),
    comes_with="sensor",
)
