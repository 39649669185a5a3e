"""Data older than their stamp by a constant time."""

from __future__ import annotations

from syncline_design.effects.kinematics import antenna_velocity, column, sweep_velocity
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
    """mu = -latency for every row of the sensor (paper, eq. state_space_y)."""
    shift = column(-values["latency_s"], rows)
    if sensor == "position":
        return Departures(position_shift_s=shift)
    if sensor == "attitude":
        return Departures(attitude_shift_s=shift)
    return Departures(ranging_shift_s=shift)


def _sensitivity(rows: StageRows, values: Values, sensor: ActsOn) -> Array:
    """d error / d latency [m/s]: -V, -W, or V + W for the reference itself; (n, 3, 1)."""
    if sensor == "position":
        slope = -antenna_velocity(rows)
    elif sensor == "attitude":
        slope = -sweep_velocity(rows)
    else:
        slope = antenna_velocity(rows) + sweep_velocity(rows)
    return slope[:, :, None]


def _contribute(stage: Stage, values: Values, sensor: ActsOn, basis: Basis) -> Contribution:
    """tau of the sensor grows by |latency|."""
    return Contribution(tau_s=abs(values["latency_s"]))


EFFECT = Effect(
    name="latency",
    sensors=("position", "attitude", "ranging"),
    kind="deterministic",
    parameters=(Parameter("latency_s", 1e-4, 2.0, "s"),),
    sentence="{sensor} data are {latency_s} older than their stamps",
    reverse="{sensor} data are {latency_s} younger than their stamps",
    confused_with="a forward lever arm at constant speed (position); hard iron on reciprocal "
    "lines (attitude); position and attitude latency of equal size (ranging)",
    separated_by="vary the speed, stop, reverse; roll, pitch and turns both ways",
    source="Jellum et al., The Syncline Model, eq. state_space_y, meas_gnss, meas_ins",
    depart=_depart,
    sensitivity=_sensitivity,
    contribute=_contribute,
    rarity=10,
    commissioned=("position", "attitude"),
    breaks="latency",
    passing=True,
    comes_with="stamps",
    asked_in_stretches=True,
    asked_jointly=True,
)
