"""Effects that follow measured values, in logs where these values are little but noise.

A regressor of spread s that carries white noise sigma, the noise that is in the error as well,
correlates with it (errors in variables): a false slope of sigma^2 / (sigma^2 + s^2), worth
    n/2 (sigma / s)^2 [nat]
in n rows where that noise is all there is.  An acceleration that is the second derivative of the
logged places, D p, holds D of their noise.  An error e of which it is a share c is worth
    n/2 c^2 cov(e, D e)^2 / (var(e) var(D p)),   c = sigma^2 / var(e) at most   [nat].
Source: Fuller, Measurement Error Models (1987), ch. 1.
"""

from __future__ import annotations

import numpy as np

from syncline_design.diagnosis.scene import Scene
from syncline_design.diagnosis.trajectory import smooth_bend
from syncline_design.effects.kinematics import GRAVITY_MPS2, specific_force
from syncline_design.effects.record import Array, Effect

HEADING_NATS = 0.5  # that the noise of a heading may be worth: it is nearly all of its error
LOAD_NATS = 2.0  # that of roll and pitch, beside the ranging sensor's own
PLACE_NATS = 2.0  # that of places of which the acceleration is derived


def follows_noise(view: Scene, effect: Effect, index: int) -> bool:
    """Whether the noise of what an effect of a stage follows could pass for it."""
    if effect.follows == "heading":
        return heading_is_noise(view, index)
    if effect.accelerated and acceleration_is_noise(view, index):
        return True
    return effect.follows == "load" and load_is_noise(view, index)


def heading_is_noise(view: Scene, index: int) -> bool:
    """Whether the noise of a stage's logged heading could pass for what follows the heading."""
    attitude = view.system.stages[index].attitude
    if attitude is None:
        return False
    yaw = np.unwrap(view.rows[index].euler_rad[:, 2])
    return _is_noise(yaw, attitude.sigma[2], HEADING_NATS)


def acceleration_is_noise(view: Scene, index: int) -> bool:
    """Whether the noise of a stage's places could pass for what follows its acceleration.

    Of a log with velocity columns it cannot: their noise is not in the places.
    """
    logged, position = view.log.stages[index], view.system.stages[index].position
    if not logged.follows_position or logged.antenna_m is None or position is None:
        return False
    time_s, error = view.log.time_s, view.error()
    known = np.flatnonzero(np.all(np.isfinite(error), axis=0))
    return any(
        _place_nats(time_s, logged.antenna_m[:, [k]], error[:, [k]], position.sigma[k]) > PLACE_NATS
        for k in known
    )


def _place_nats(time_s: Array, place_m: Array, error: Array, sigma: float) -> float:
    """What noise of places along an axis (n, 1) may be worth to their acceleration [nat]."""
    bent = smooth_bend(time_s, place_m, time_s, error)
    derived = smooth_bend(time_s, place_m, time_s)
    whole, most = float(np.var(error)), float(np.var(derived))
    if whole == 0.0 or most == 0.0:
        return 0.0
    together = float(np.mean((error - error.mean()) * (bent - bent.mean())))
    share = min(sigma**2 / whole, 1.0)
    return 0.5 * len(error) * (share * together) ** 2 / (whole * most)


def load_is_noise(view: Scene, index: int) -> bool:
    """Whether the noise of roll or pitch could pass for what follows the load.

    Of a vehicle that stands, goes straight or turns in balance the specific force forward and to
    the right varies by hardly more than g times the noise of pitch and of roll.
    """
    attitude = view.system.stages[index].attitude
    if attitude is None:
        return False
    force = specific_force(view.rows[index])
    return any(
        _is_noise(force[:, axis], GRAVITY_MPS2 * attitude.sigma[angle], LOAD_NATS)
        for axis, angle in ((0, 1), (1, 0))
    )


def _is_noise(values: Array, sigma: float, most_nats: float) -> bool:
    """Whether white noise in values may be worth more than so many nat."""
    least = sigma * np.sqrt(0.5 * len(values) / most_nats)
    return bool(np.std(values) < least)
