"""A constant added to every elevation of the ranging sensor."""

from __future__ import annotations

import numpy as np

from syncline_design.effects.kinematics import column, rotate
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
    """measured elevation = true + bias [rad]."""
    return Departures(elevation_rad=column(values["bias_rad"], rows))


def _sensitivity(rows: StageRows, values: Values, sensor: ActsOn) -> Array:
    """d error / d bias = R r dn/del [m/rad]; (n, 3, 1)."""
    sin_el = np.sin(rows.elevation_rad)
    slope = np.stack(
        [
            -np.cos(rows.azimuth_rad) * sin_el,
            -np.sin(rows.azimuth_rad) * sin_el,
            -np.cos(rows.elevation_rad),
        ],
        axis=-1,
    )
    return rotate(rows.rotation, rows.range_m[:, None] * slope)[:, :, None]


def _contribute(stage: Stage, values: Values, sensor: ActsOn, basis: Basis) -> Contribution:
    """|bias| of the line of sight."""
    return Contribution(sight_rad=abs(values["bias_rad"]))


EFFECT = Effect(
    name="elevation_bias",
    sensors=("ranging",),
    kind="deterministic",
    parameters=(Parameter("bias_rad", 1e-6, 0.2, "rad"),),
    sentence="elevations of the ranging sensor are {bias_rad} too large",
    confused_with="boresight",
    separated_by="bearings all around",
    source="paper, bearing vector before eq. bear_posvec; measured = true + bias",
    depart=_depart,
    sensitivity=_sensitivity,
    contribute=_contribute,
    rarity=100,
    breaks="mounting",
    comes_with="sensor",
    asked_in_stretches=True,
    constant=(("ranging", 2),),
)
