"""The antenna or the ranging sensor sits elsewhere than the spec says."""

from __future__ import annotations

import numpy as np

from syncline_design.effects.kinematics import row_vector
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
    """dl [m], body axes: the true lever arm is the spec's plus dl."""
    offset = row_vector(values["x_m"], values["y_m"], values["z_m"])
    return Departures(antenna_m=offset) if sensor == "position" else Departures(ranging_m=offset)


def _sensitivity(rows: StageRows, values: Values, sensor: ActsOn) -> Array:
    """d error / d dl = R for the antenna, -R for the ranging sensor; (n, 3, 3).

    The antenna reads p + R (l_G + dl) while the spec takes off R l_G; the object is at
    p + R (l_L + dl + b) while the spec adds R l_L.
    """
    return rows.rotation if sensor == "position" else -rows.rotation


def _contribute(stage: Stage, values: Values, sensor: ActsOn, basis: Basis) -> Contribution:
    """|dl|."""
    return Contribution(
        systematic_m=float(np.linalg.norm([values["x_m"], values["y_m"], values["z_m"]]))
    )


EFFECT = Effect(
    name="lever_arm",
    sensors=("position", "ranging"),
    kind="deterministic",
    parameters=tuple(Parameter(f"{axis}_m", 1e-3, 20.0, "m") for axis in "xyz"),
    sentence="the lever arm is off by {x_m} forward, {y_m} right, {z_m} down",
    confused_with="a datum offset at fixed heading; the other sensor's lever arm, up to sign "
    "and the rate term",
    separated_by="turn and tilt; from the other lever arm measure one of them on the vehicle",
    source="paper, eq. meas_gnss_frames and analytic_direct_georef",
    depart=_depart,
    sensitivity=_sensitivity,
    contribute=_contribute,
    transponder=True,
    rarity=20,
    commissioned=("position",),
    breaks="lever_arm",
    asked_in_stretches=True,
    asked_jointly=True,
)
