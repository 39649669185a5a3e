"""From some moment on the stamps of a sensor are off by a constant."""

from __future__ import annotations

import math

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


def _after(rows: StageRows, values: Values) -> Array:
    """1 from time_s after the mission's start on, 0 before, (n,)."""
    after: Array = (elapsed(rows) >= values["time_s"]).astype(float)
    return after


def _depart(rows: StageRows, values: Values, sensor: ActsOn, _: Rng) -> Departures:
    """stamp = true + step from time_s on, so mu = -step there."""
    return shifted(sensor, -values["step_s"] * _after(rows, values))


def _sensitivity(rows: StageRows, values: Values, sensor: ActsOn) -> Array:
    """d error / d step = -V, -W or V + W from time_s on [m/s]; (n, 3, 1)."""
    return (-shift_slope(rows, sensor) * _after(rows, values)[:, None])[:, :, None]


def _contribute(stage: Stage, values: Values, sensor: ActsOn, basis: Basis) -> Contribution:
    """tau of the sensor grows by |step|, whenever in a mission it may happen."""
    return Contribution(tau_s=abs(values["step_s"]))


EFFECT = Effect(
    name="timestamp_step",
    sensors=("position", "attitude", "ranging"),
    kind="deterministic",
    parameters=(
        Parameter("step_s", 1e-4, 2.0, "s"),
        Parameter("time_s", 0.0, math.inf, "s", located=True),
    ),
    sentence="from {time_s} after the start on the {sensor} stamps are ahead by {step_s}",
    confused_with="a jump of the positions themselves; clock_drift",
    separated_by="speed: a timestamp step scales with it, a jump does not",
    source="ITU-T G.810, time error step; stamp = true + step",
    depart=_depart,
    sensitivity=_sensitivity,
    contribute=_contribute,
    breaks="timing",
    comes_with="stamps",
)
