"""Data wait for the next packet and take its stamp: an age uniform on 0 to the interval."""

from __future__ import annotations

import math

from syncline_design.effects.kinematics import column, shift_slope, shifted
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


def _depart(rows: StageRows, values: Values, sensor: ActsOn, rng: Rng) -> Departures:
    """mu = -age, age uniform on [0, interval]; its mean where nothing is drawn."""
    if rng is None:
        return shifted(sensor, column(-0.5 * values["interval_s"], rows))
    return shifted(sensor, -rng.uniform(0.0, values["interval_s"], len(rows)))


def _sensitivity(rows: StageRows, values: Values, sensor: ActsOn) -> Array:
    """d mean error / d interval = -V/2 or -W/2 [m/s]; (n, 3, 1)."""
    return (-0.5 * shift_slope(rows, sensor))[:, :, None]


def _spread(rows: StageRows, values: Values, sensor: ActsOn) -> Array:
    """Cov += interval^2 / 12 V V' [m2]: a uniform age; mean over standard deviation is sqrt(3)."""
    size = values["interval_s"] / math.sqrt(12.0)
    return (size * shift_slope(rows, sensor))[:, :, None]


def _contribute(stage: Stage, values: Values, sensor: ActsOn, basis: Basis) -> Contribution:
    """tau grows by the whole interval, the oldest that data can be."""
    return Contribution(tau_s=abs(values["interval_s"]))


EFFECT = Effect(
    name="packetised_timestamps",
    sensors=("position", "attitude"),
    kind="stochastic",
    parameters=(Parameter("interval_s", 1e-4, 1.0, "s", signed=False),),
    sentence="{sensor} data are older than their stamps by 0 to {interval_s}, evenly spread: they "
    "wait for a packet, or for a busy host",
    confused_with="latency together with timestamp_jitter",
    separated_by="the scatter of the stamps: 0.577 of their mean age",
    source="uniform distribution on [0, D]: mean D/2, variance D^2/12",
    depart=_depart,
    sensitivity=_sensitivity,
    contribute=_contribute,
    spread=_spread,
    opens="size",
    breaks="timing",
    comes_with="stamps",
)
