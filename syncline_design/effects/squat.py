"""A hull sinks deeper the faster it goes, and its heights do not say so."""

from __future__ import annotations

import numpy as np

from syncline_design.effects.record import (
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
from syncline_design.model.system import Stage

VESSEL_WORDS = ("vessel", "ship", "boat", "usv", "ferry")
ACOUSTIC = ("usbl", "mbes", "sbes", "sonar")


def _applies(stage: Stage, sensor: Target) -> bool:
    """Vessels: by the stage's or vehicle's name, or by an acoustic ranging sensor."""
    if stage.position is None:
        return False
    words = f"{stage.name} {stage.vehicle}".lower()
    kind = "" if stage.ranging is None else stage.ranging.type.lower()
    return kind in ACOUSTIC or any(word in words for word in VESSEL_WORDS)


def _depart(rows: StageRows, values: Values, sensor: Target, _: Rng) -> Departures:
    """The down reading is too small by gain v^2 [m], gain in s2/m."""
    added = np.zeros((len(rows), 3))
    added[:, 2] = -values["gain"] * np.sum(rows.velocity_mps**2, axis=1)
    return Departures(position_m=added)


def _sensitivity(rows: StageRows, values: Values, sensor: Target) -> Array:
    """d error / d gain = -v^2 down [m2/s2]; (n, 3, 1)."""
    slope = np.zeros((len(rows), 3, 1))
    slope[:, 2, 0] = -np.sum(rows.velocity_mps**2, axis=1)
    return slope


def _contribute(stage: Stage, values: Values, sensor: Target, basis: Basis) -> Contribution:
    """|gain| v_max^2."""
    return Contribution(systematic_m=abs(values["gain"]) * stage.platform.v_max_mps**2)


EFFECT = Effect(
    name="squat",
    sensors=("position",),
    kind="deterministic",
    parameters=(Parameter("gain", 1e-4, 0.2),),
    sentence="the draught grows with the square of the speed, {gain} m per (m/s)^2, and heights "
    "miss it",
    confused_with="height_drift; latency on slopes",
    separated_by="the same line slow and fast",
    source="ship squat grows with the square of the speed (Barrass, Derrett, Ship Stability)",
    depart=_depart,
    sensitivity=_sensitivity,
    contribute=_contribute,
    applies=_applies,
)
