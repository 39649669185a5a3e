"""Accelerations tilt the vertical that the attitude sensor believes."""

from __future__ import annotations

import numpy as np

from syncline_design.effects.kinematics import GRAVITY_MPS2, antenna_to_object, rotate
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


def _tilt(rows: StageRows) -> Array:
    """R' (z x a_n) / g [rad per unit gain], body axes, (n, 3).

    A sensor that takes the direction of the specific force for the vertical is tilted by a / g.
    """
    acceleration = rotate(rows.rotation, rows.acceleration_mps2)
    lean = np.cross(np.array([0.0, 0.0, 1.0]), acceleration) / GRAVITY_MPS2
    return rotate(np.swapaxes(rows.rotation, 1, 2), lean)


def _depart(rows: StageRows, values: Values, sensor: ActsOn, _: Rng) -> Departures:
    """measured R = R exp(S(gain times the tilt))."""
    return Departures(attitude_rotation_rad=values["gain"] * _tilt(rows))


def _sensitivity(rows: StageRows, values: Values, sensor: ActsOn) -> Array:
    """d error / d gain = R (tilt x q) [m]; (n, 3, 1)."""
    return rotate(rows.rotation, np.cross(_tilt(rows), antenna_to_object(rows)))[:, :, None]


def _contribute(stage: Stage, values: Values, sensor: ActsOn, basis: Basis) -> Contribution:
    """|gain| omega v / g: the tilt of the platform's hardest turn."""
    p = stage.platform
    tilt = p.v_max_mps * p.omega_max_radps / GRAVITY_MPS2
    return Contribution(turn_rad=abs(values["gain"]) * tilt)


EFFECT = Effect(
    name="acceleration_tilt",
    sensors=("attitude",),
    kind="deterministic",
    parameters=(Parameter("gain", 1e-4, 2.0),),
    sentence="accelerations tilt the attitude by {gain} of the apparent vertical",
    confused_with="flexure",
    separated_by="ranges: a tilt grows with them, flexure does not",
    source="levelling by accelerometers: specific force f = a - g",
    depart=_depart,
    sensitivity=_sensitivity,
    contribute=_contribute,
    accelerated=True,
    comes_with="sensor",
)
