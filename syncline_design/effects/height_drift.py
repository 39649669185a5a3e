"""Heights wander slowly."""

from __future__ import annotations

import numpy as np

from syncline_design.effects.kinematics import wander
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

AXES = np.array([0.0, 0.0, 1.0])


def _depart(rows: StageRows, values: Values, sensor: ActsOn, rng: Rng) -> Departures:
    """The antenna reading wanders by a first-order Gauss-Markov process in height."""
    if rng is None:
        return Departures()
    draws = rng.standard_normal((len(rows), 3)) * AXES
    return Departures(position_m=values["std_m"] * wander(rows, values["time_constant_s"], draws))


def _contribute(stage: Stage, values: Values, sensor: ActsOn, basis: Basis) -> Contribution:
    """std: one standard deviation, as the sensor's own term."""
    return Contribution(systematic_m=values["std_m"] * float(np.linalg.norm(AXES)))


EFFECT = Effect(
    name="height_drift",
    sensors=("position",),
    kind="stochastic",
    parameters=(
        Parameter("std_m", 1e-4, 50.0, "m", signed=False),
        Parameter("time_constant_s", 0.1, 1e4, "s", signed=False),
    ),
    sentence="heights wander by {std_m}, with a time constant of {time_constant_s}",
    confused_with="correlated_noise",
    separated_by="comparing height with the horizontal axes",
    source="first-order Gauss-Markov process (Gelb, Applied Optimal Estimation, 1974)",
    depart=_depart,
    sensitivity=None,
    contribute=_contribute,
    opens="down",
    brief=("slow in height, {std_m} over {time_constant_s}",),
    comes_with="sensor",
)
