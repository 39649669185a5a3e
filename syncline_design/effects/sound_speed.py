"""Acoustic ranges and the directions of a flat array are computed with a wrong speed of sound."""

from __future__ import annotations

import math

import numpy as np

from syncline_design.effects.kinematics import column, ranging_vector, rotate
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

ACOUSTIC = ("usbl", "mbes")


def _applies(stage: Stage, sensor: ActsOn) -> bool:
    return stage.ranging is not None and stage.ranging.type.lower() in ACOUSTIC


def _depart(rows: StageRows, values: Values, sensor: ActsOn, _: Rng) -> Departures:
    """measured r = true r (1 + dc/c); measured sin(off normal) = true sin (1 + dc/c).

    dc: what the speed used is too high by.  A flat array, its normal along the sensor's down axis,
    tells a direction by the delay between its elements, D sin(angle off the normal) / c, so the
    sine is computed with the same wrong c (Snell's law at the array's face).  The elevation is
    counted from the array's plane: cos(measured) = cos(true) (1 + dc/c), at most 1 (grazing).
    """
    scale = 1.0 + values["relative_error"]
    level = np.minimum(np.cos(rows.elevation_rad) * scale, 1.0)
    bent = np.copysign(np.arccos(level), rows.elevation_rad)
    return Departures(
        range_scale=column(values["relative_error"], rows),
        elevation_rad=bent - rows.elevation_rad,
    )


def _sensitivity(rows: StageRows, values: Values, sensor: ActsOn) -> Array:
    """d error / d (dc/c) = R (b + r dn/d el d el), d el = -cot(el) [m]; (n, 3, 1).

    r dn/d el (-cot el) = r cot(el) [cos az sin el, sin az sin el, cos el].
    """
    azimuth, elevation = rows.azimuth_rad, rows.elevation_rad
    cosine, sine = np.cos(elevation), np.sin(elevation)
    sine = np.copysign(np.maximum(np.abs(sine), LEAST_SINE), sine)
    rise = np.stack([np.cos(azimuth) * cosine, np.sin(azimuth) * cosine, cosine**2 / sine], axis=-1)
    bent = ranging_vector(rows) + rows.range_m[:, None] * rise
    return rotate(rows.rotation, bent)[:, :, None]


def _contribute(stage: Stage, values: Values, sensor: ActsOn, basis: Basis) -> Contribution:
    """d sqrt(|e| (2 + e)), e = dc/c: a line of sight along the array's plane, the worst of all.

    There the direction is off by acos(1 - |e|) or acos(1 / (1 + e)).  At an angle a off the normal
    it is |e| d / cos(a) to first order, 1.41 |e| d at 45 degrees.
    """
    error = values["relative_error"]
    return Contribution(systematic_m=math.sqrt(abs(error) * (2.0 + error)) * basis.distance_m)


LEAST_SINE = 1e-3  # of the elevation: closer to the array's plane the slope has no bound

EFFECT = Effect(
    name="sound_speed",
    sensors=("ranging",),
    kind="deterministic",
    parameters=(Parameter("relative_error", 1e-5, 0.1, above=-1.0),),
    sentence="the speed of sound in use is too high by a share of {relative_error}",
    confused_with="range_scale and turnaround_delay, straight below",
    separated_by="beams far off the array's normal, a spread of ranges",
    source="two-way travel time: r = c t / 2; phase comparison: sin(angle) = c delay / D",
    depart=_depart,
    sensitivity=_sensitivity,
    contribute=_contribute,
    applies=_applies,
    rarity=110,
    passing=True,
)
