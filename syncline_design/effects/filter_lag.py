"""The position output is smoothed and lags behind the motion."""

from __future__ import annotations

from syncline_design.effects.base import (
    Array,
    Basis,
    Contribution,
    Departures,
    Effect,
    Parameter,
    Rng,
    StageRows,
    Target,
    Values,
)
from syncline_design.effects.kinematics import antenna_velocity, rotate
from syncline_design.model.system import Stage


def _lag(rows: StageRows, time_constant_s: float) -> Array:
    """Output minus input of a first-order low pass [m], NED, (n, 3): -T V + T^2 dV/dt - ...

    The series of 1 / (1 + T d/dt), cut after the second term; dV/dt is the reference point's.
    """
    rate = rotate(rows.rotation, rows.acceleration_mps2)
    return -time_constant_s * antenna_velocity(rows) + time_constant_s**2 * rate


def _depart(rows: StageRows, values: Values, sensor: Target, _: Rng) -> Departures:
    """The antenna reading lags by a first-order low pass."""
    return Departures(position_m=_lag(rows, values["time_constant_s"]))


def _sensitivity(rows: StageRows, values: Values, sensor: Target) -> Array:
    """d error / d T = -V at T = 0 [m/s]; (n, 3, 1)."""
    return -antenna_velocity(rows)[:, :, None]


def _contribute(stage: Stage, values: Values, sensor: Target, basis: Basis) -> Contribution:
    """A lag acts as a latency of T."""
    return Contribution(tau_s=abs(values["time_constant_s"]))


EFFECT = Effect(
    name="filter_lag",
    sensors=("position",),
    kind="deterministic",
    parameters=(Parameter("time_constant_s", 1e-3, 2.0, "s", signed=False),),
    sentence="positions are smoothed with a time constant of {time_constant_s}",
    confused_with="latency",
    separated_by="accelerating hard and gently: sweep the frequency of the motion",
    source="first-order low pass T dy/dt + y = x, series in T",
    depart=_depart,
    sensitivity=_sensitivity,
    contribute=_contribute,
)
