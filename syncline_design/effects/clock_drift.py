"""The sensor's clock runs fast or slow, so its data age as the log goes on."""

from __future__ import annotations

from typing import Final

from syncline_design.effects.kinematics import elapsed, shift_slope, shifted
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

CRYSTAL: Final = 1e-4  # of crystals 20 ppm (Micro Crystal RV-3028-C7), of a lidar 58 ppm (HDL-64E)


def _depart(rows: StageRows, values: Values, sensor: ActsOn, _: Rng) -> Departures:
    """stamp = true + rate (t - t0), so mu = -rate (t - t0), t0 the mission's start."""
    return shifted(sensor, -values["rate"] * elapsed(rows))


def _sensitivity(rows: StageRows, values: Values, sensor: ActsOn) -> Array:
    """d error / d rate = -V, -W or V + W times (t - t0) [m]; (n, 3, 1)."""
    return (-shift_slope(rows, sensor) * elapsed(rows)[:, None])[:, :, None]


def _contribute(stage: Stage, values: Values, sensor: ActsOn, basis: Basis) -> Contribution:
    """tau grows by |rate| times the mission's duration."""
    return Contribution(tau_s=abs(values["rate"]) * basis.horizon.duration_s)


EFFECT = Effect(
    name="clock_drift",
    sensors=("position", "attitude", "ranging"),
    kind="deterministic",
    parameters=(Parameter("rate", 1e-7, 1e-2, usual=CRYSTAL),),
    sentence="the clock that stamps the {sensor} data runs fast by {rate}",
    confused_with="timestamp_step; heading_drift (attitude)",
    separated_by="repeating the same manoeuvre early and late",
    source="ITU-T G.810, frequency offset; stamp = true + rate (t - t0)",
    depart=_depart,
    sensitivity=_sensitivity,
    contribute=_contribute,
    breaks="clock",
    comes_with="stamps",
)
