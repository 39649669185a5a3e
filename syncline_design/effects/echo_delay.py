"""Acoustic data are stamped when the echo comes back, not when it was there."""

from __future__ import annotations

from syncline_design.effects.kinematics import antenna_velocity, shifted, sweep_velocity
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
    by_sound,
)
from syncline_design.model.system import Stage

SOUND_SPEED_MPS = 1500.0


def _depart(rows: StageRows, values: Values, sensor: ActsOn, _: Rng) -> Departures:
    """Data are older than their stamp by a share of the way's time: mu = -share r / c."""
    return shifted("ranging", -values["share"] * rows.range_m / SOUND_SPEED_MPS)


def _sensitivity(rows: StageRows, values: Values, sensor: ActsOn) -> Array:
    """d error / d share = (V + W) r / c [m]; (n, 3, 1)."""
    moved = antenna_velocity(rows) + sweep_velocity(rows)
    return (moved * (rows.range_m / SOUND_SPEED_MPS)[:, None])[:, :, None]


def _contribute(stage: Stage, values: Values, sensor: ActsOn, basis: Basis) -> Contribution:
    """tau of the ranging grows by |share| d / c."""
    return Contribution(tau_s=abs(values["share"]) * basis.distance_m / SOUND_SPEED_MPS)


EFFECT = Effect(
    name="echo_delay",
    sensors=("ranging",),
    kind="deterministic",
    parameters=(Parameter("share", 1e-2, 3.0),),
    sentence="{sensor} data are older than their stamps by {share} times the one-way travel time",
    confused_with="latency (ranging), where all ranges are alike",
    separated_by="the same motion over near and far targets",
    source="echo at r / c after the ping, back at 2 r / c, c = 1500 m/s",
    depart=_depart,
    sensitivity=_sensitivity,
    contribute=_contribute,
    applies=by_sound,
    breaks="latency",
)
