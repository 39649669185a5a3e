"""The water level rises or falls while heights are held against one level."""

from __future__ import annotations

import numpy as np

from syncline_design.effects.kinematics import elapsed
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
    on_vessels,
)
from syncline_design.model.system import Stage


def _depart(rows: StageRows, values: Values, sensor: ActsOn, _: Rng) -> Departures:
    """The down reading is too large by rate (t - t0) [m]: the level rose and was not told."""
    added = np.zeros((len(rows), 3))
    added[:, 2] = values["rate_mps"] * elapsed(rows)
    return Departures(position_m=added)


def _sensitivity(rows: StageRows, values: Values, sensor: ActsOn) -> Array:
    """d error / d rate = (t - t0) down [s]; (n, 3, 1)."""
    slope = np.zeros((len(rows), 3, 1))
    slope[:, 2, 0] = elapsed(rows)
    return slope


def _contribute(stage: Stage, values: Values, sensor: ActsOn, basis: Basis) -> Contribution:
    """|rate| times the mission's duration."""
    return Contribution(systematic_m=abs(values["rate_mps"]) * basis.horizon.duration_s)


EFFECT = Effect(
    name="tide",
    sensors=("position",),
    kind="deterministic",
    parameters=(Parameter("rate_mps", 1e-7, 2e-3, "m/s"),),
    sentence="heights run off by {rate_mps}, as with a tide that is not taken off",
    confused_with="height_drift, which is noise; a datum that is off in height",
    separated_by="a longer log, or the same place early and late",
    source="a tide of 12.4 h and 12 m range rises by at most 0.85 mm/s",
    depart=_depart,
    sensitivity=_sensitivity,
    contribute=_contribute,
    applies=on_vessels,
)
