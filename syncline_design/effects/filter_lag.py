"""The position output is smoothed and lags behind the motion."""

from __future__ import annotations

import numpy as np

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
    """Output minus input of T dy/dt + y = x(t), x the antenna's path [m], NED, (n, 3).

    y - x is minus the integral over the past of exp(-u / T) dx/dt(t - u) du.  For a vehicle that
    has long been turning at the row's rate w, its body velocity changing at the row's dv/dt
    (zero in a steady turn), that integral is closed:
        y - x = R (-T M (v + w x l_G) + T^2 M^2 dv/dt),   M = (1 + T S(w))^-1,
    for any T and any |w| T; M turns the lag back and shortens it, by sqrt(1 + (w T)^2) across w.
    """
    w, v, t = rows.rate_radps, rows.velocity_mps, time_constant_s
    lever = np.broadcast_to(rows.antenna_m, v.shape)
    change = rows.acceleration_mps2 - np.cross(w, v)
    behind = -t * _turned_back(w * t, v + np.cross(w, lever) - t * _turned_back(w * t, change))
    return rotate(rows.rotation, behind)


def _turned_back(turn: Array, vector: Array) -> Array:
    """(1 + S(a))^-1 u = (u - a x u + a (a . u)) / (1 + |a|^2), rows of a and u (n, 3)."""
    along = np.sum(turn * vector, axis=1, keepdims=True)
    size = 1.0 + np.sum(turn * turn, axis=1, keepdims=True)
    back: Array = (vector - np.cross(turn, vector) + turn * along) / size
    return back


def _depart(rows: StageRows, values: Values, sensor: Target, _: Rng) -> Departures:
    """The antenna reading lags by a first-order low pass."""
    return Departures(position_m=_lag(rows, values["time_constant_s"]))


def _sensitivity(rows: StageRows, values: Values, sensor: Target) -> Array:
    """d error / d T = -V at T = 0 [m/s]; (n, 3, 1)."""
    return -antenna_velocity(rows)[:, :, None]


def _contribute(stage: Stage, values: Values, sensor: Target, basis: Basis) -> Contribution:
    """No motion lags by more than a latency of T would: |M| <= 1, so |y - x| <= T |V|."""
    return Contribution(tau_s=abs(values["time_constant_s"]))


EFFECT = Effect(
    name="filter_lag",
    sensors=("position",),
    kind="deterministic",
    parameters=(Parameter("time_constant_s", 1e-3, 2.0, "s", signed=False),),
    sentence="positions are smoothed with a time constant of {time_constant_s}",
    confused_with="latency",
    separated_by="accelerating hard and gently: sweep the frequency of the motion",
    source="first-order low pass T dy/dt + y = x, solved for a steady turn and acceleration",
    depart=_depart,
    sensitivity=_sensitivity,
    contribute=_contribute,
)
