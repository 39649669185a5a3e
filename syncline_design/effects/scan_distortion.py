"""The points of one turn of a scanner all carry the stamp of its start."""

from __future__ import annotations

import math

from syncline_design.effects.kinematics import shift_slope, shifted
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


def _age(rows: StageRows) -> Array:
    return rows.azimuth_rad / (2.0 * math.pi)


def _depart(rows: StageRows, values: Values, sensor: ActsOn, _: Rng) -> Departures:
    """A point at azimuth az was measured az / 2 pi of a period after its stamp: mu > 0."""
    return shifted("ranging", values["period_s"] * _age(rows))


def _sensitivity(rows: StageRows, values: Values, sensor: ActsOn) -> Array:
    """d error / d period = -(V + W) az / 2 pi [m/s]; (n, 3, 1)."""
    return (shift_slope(rows, "ranging") * _age(rows)[:, None])[:, :, None]


def _contribute(stage: Stage, values: Values, sensor: ActsOn, basis: Basis) -> Contribution:
    """tau of the ranging sensor grows by half a period, az counted from -pi to pi."""
    return Contribution(tau_s=0.5 * abs(values["period_s"]))


EFFECT = Effect(
    name="scan_distortion",
    sensors=("ranging",),
    kind="deterministic",
    parameters=(Parameter("period_s", 1e-4, 2.0, "s"),),
    sentence="all points of a scan carry one stamp; a turn takes {period_s}",
    confused_with="latency",
    separated_by="a spread of bearings",
    source="motion distortion of rotating scanners; azimuth as logged, between -pi and pi",
    depart=_depart,
    sensitivity=_sensitivity,
    contribute=_contribute,
    breaks="timing",
)
