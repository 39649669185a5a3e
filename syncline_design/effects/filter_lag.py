"""The position output is smoothed and lags behind the motion."""

from __future__ import annotations

import numpy as np

from syncline_design.effects.kinematics import antenna_velocity, rotate
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


def lag_of_the_present(rows: StageRows, time_constant_s: float) -> Array:
    """Output minus input of T dy/dt + y = x(t), x the antenna's path [m], NED, (n, 3).

    The past is what the present motion makes of it.

    y - x is minus the integral over the past of exp(-u / T) dx/dt(t - u) du.  With M(a) =
    (1 + T S(a))^-1, for a velocity that has long been turning at k w while it changes at c in
    those axes, and a body that has long been turning at w, that integral is closed:
        y - x = R (-T M(k w) v + T^2 M(k w)^2 c - T M(w) (w x l_G)),   c = a - k w x v,
    for any T and any |w| T.  k: how much of the body's turn the path takes part in, 1 in a
    coordinated turn, 0 for one that yaws and flies on straight; see `_followed`.
    """
    w, v, t = rows.rate_radps, rows.velocity_mps, time_constant_s
    turning = _followed(rows) * w
    change = rows.acceleration_mps2 - np.cross(turning, v)
    behind = -t * _turned_back(turning * t, v - t * _turned_back(turning * t, change))
    lever = np.cross(w, np.broadcast_to(rows.antenna_m, v.shape))
    return rotate(rows.rotation, behind - t * _turned_back(w * t, lever))


def _followed(rows: StageRows) -> Array:
    """k (n, 1), 0 to 1, that leaves the least of a - k w x v; 1 where w x v vanishes."""
    across = np.cross(rows.rate_radps, rows.velocity_mps)
    size = np.sum(across * across, axis=1, keepdims=True)
    shared = np.sum(across * rows.acceleration_mps2, axis=1, keepdims=True)
    part: Array = np.clip(np.divide(shared, size, out=np.ones_like(size), where=size > 0.0), 0, 1)
    return part


def _turned_back(turn: Array, vector: Array) -> Array:
    """(1 + S(a))^-1 u = (u - a x u + a (a . u)) / (1 + |a|^2), rows of a and u (n, 3)."""
    along = np.sum(turn * vector, axis=1, keepdims=True)
    size = 1.0 + np.sum(turn * turn, axis=1, keepdims=True)
    back: Array = (vector - np.cross(turn, vector) + turn * along) / size
    return back


def _depart(rows: StageRows, values: Values, sensor: ActsOn, _: Rng) -> Departures:
    """The antenna reading lags by a first-order low pass, of the path itself where it is known."""
    time_constant_s = values["time_constant_s"]
    if rows.lagged is None or time_constant_s <= 0.0:  # what a fit may try has no past
        return Departures(position_m=lag_of_the_present(rows, time_constant_s))
    place, turn = rows.lagged(time_constant_s)
    return Departures(position_m=place + rotate(turn, rows.antenna_m))


def _sensitivity(rows: StageRows, values: Values, sensor: ActsOn) -> Array:
    """d error / d T = -V at T = 0 [m/s]; (n, 3, 1)."""
    return -antenna_velocity(rows)[:, :, None]


def _contribute(stage: Stage, values: Values, sensor: ActsOn, basis: Basis) -> Contribution:
    """No motion lags by more than a latency of T would: |M| <= 1, so |y - x| <= T |V|."""
    return Contribution(tau_s=abs(values["time_constant_s"]))


EFFECT = Effect(
    name="filter_lag",
    sensors=("position",),
    kind="deterministic",
    parameters=(Parameter("time_constant_s", 1e-3, 10.0, "s", signed=False),),
    sentence="positions are smoothed with a time constant of {time_constant_s}",
    confused_with="latency",
    separated_by="accelerating hard and gently: sweep the frequency of the motion",
    source="first-order low pass T dy/dt + y = x, solved for steady turns and accelerations",
    depart=_depart,
    sensitivity=_sensitivity,
    contribute=_contribute,
    breaks="latency",
    memory="time_constant_s",
    comes_with="sensor",
    asked_in_stretches=True,
)
