"""A hull sinks deeper the faster it goes, and its heights do not say so."""

from __future__ import annotations

import numpy as np

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
    """The down reading is too small by sinkage (v / 1 m/s)^2 [m]."""
    added = np.zeros((len(rows), 3))
    added[:, 2] = -values["sinkage_m"] * np.sum(rows.velocity_mps**2, axis=1)
    return Departures(position_m=added)


def _sensitivity(rows: StageRows, values: Values, sensor: ActsOn) -> Array:
    """d error / d sinkage = -(v / 1 m/s)^2 down [-]; (n, 3, 1)."""
    slope = np.zeros((len(rows), 3, 1))
    slope[:, 2, 0] = -np.sum(rows.velocity_mps**2, axis=1)
    return slope


def _contribute(stage: Stage, values: Values, sensor: ActsOn, basis: Basis) -> Contribution:
    """|sinkage| (v_max / 1 m/s)^2."""
    return Contribution(systematic_m=abs(values["sinkage_m"]) * stage.platform.v_max_mps**2)


EFFECT = Effect(
    name="squat",
    sensors=("position",),
    kind="deterministic",
    parameters=(Parameter("sinkage_m", 1e-4, 0.2, "m"),),
    sentence="the draught grows with the square of the speed, by {sinkage_m} at 1 m/s, and heights "
    "do not follow",
    confused_with="height_drift; latency on slopes",
    separated_by="the same line slow and fast",
    source="ship squat grows with the square of the speed (Barrass, Derrett, Ship Stability)",
    depart=_depart,
    sensitivity=_sensitivity,
    contribute=_contribute,
    applies=on_vessels,
)
