"""Effects that follow measured values, in logs where these values are little but noise.

A regressor of spread s that carries white noise sigma, the noise that is in the error as well,
correlates with it (errors in variables): a false slope of sigma^2 / (sigma^2 + s^2), worth
    n/2 (sigma / s)^2 [nat]
in n rows where that noise is all there is.
Source: Fuller, Measurement Error Models (1987), ch. 1.
"""

from __future__ import annotations

import numpy as np

from syncline_design.diagnosis.scene import Scene
from syncline_design.effects.kinematics import GRAVITY_MPS2, specific_force
from syncline_design.effects.record import Array, Effect

HEADING_NATS = 0.5  # that the noise of a heading may be worth: it is nearly all of its error
LOAD_NATS = 2.0  # that of roll and pitch, beside the ranging sensor's own


def follows_noise(view: Scene, effect: Effect, index: int) -> bool:
    """Whether the noise of what an effect of a stage follows could pass for it."""
    if effect.follows == "heading":
        return heading_is_noise(view, index)
    return effect.follows == "load" and load_is_noise(view, index)


def heading_is_noise(view: Scene, index: int) -> bool:
    """Whether the noise of a stage's logged heading could pass for what follows the heading."""
    attitude = view.system.stages[index].attitude
    if attitude is None:
        return False
    yaw = np.unwrap(view.rows[index].euler_rad[:, 2])
    return _is_noise(yaw, attitude.sigma[2], HEADING_NATS)


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
