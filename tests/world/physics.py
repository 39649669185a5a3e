"""What is physically wrong with a system, as things that are moved, turned, late or misread."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from tests.world.trajectory import Array

ROLES = ("position", "attitude", "ranging")
PerRow = Callable[[Array, Array], Array]  # (stamps [s], channel) -> what is added to the channel
Age = Callable[[Array], Array]  # stamps [s] -> how much older the data are [s]


def _zero() -> Array:
    return np.zeros(3)


@dataclass
class NoiseFault:
    """How a sensor's noise differs from the spec."""

    scale: float = 1.0  # true standard deviation over stated one
    degrees_of_freedom: float | None = None  # Student's t with the stated scale
    outlier_rate: float = 0.0
    wander: list[tuple[Array, float]] = field(default_factory=list)  # (std per axis, time constant)


@dataclass
class Faults:
    """Everything that differs between one stage as specified and one stage as it is."""

    age: dict[str, list[Age]] = field(default_factory=lambda: {role: [] for role in ROLES})
    antenna_moved_m: Array = field(default_factory=_zero)  # or the transponder, on a later stage
    ranging_moved_m: Array = field(default_factory=_zero)
    ranging_bends: Array = field(default_factory=_zero)  # m per m/s2, body axes
    ranging_turned: Rotation = field(default_factory=Rotation.identity)
    attitude_turned: Rotation = field(default_factory=Rotation.identity)
    heave_sensor_moved_m: Array = field(default_factory=_zero)
    height_lost: list[PerRow] = field(default_factory=list)  # of the output; channel: speed
    lag_s: float = 0.0  # first-order low pass of the position output
    pendulum_gain: float = 0.0  # share of the apparent vertical in the attitude's vertical
    scan_period_s: float = 0.0
    yaw_added: list[PerRow] = field(default_factory=list)  # channel: true yaw
    range_added: list[PerRow] = field(default_factory=list)  # channel: true range
    sound_used: float = 1.0  # the processing's sound speed over the water's
    azimuth_bias_rad: float = 0.0
    elevation_bias_rad: float = 0.0
    target_listed: list[Callable[[Array], Array]] = field(default_factory=list)
    convention: dict[str, str] = field(default_factory=dict)
    noise: dict[str, NoiseFault] = field(
        default_factory=lambda: {role: NoiseFault() for role in ROLES}
    )

    def age_of(self, role: str, stamps_s: Array) -> Array:
        """How much older than their stamps a sensor's data are [s], row by row."""
        return np.asarray(sum((age(stamps_s) for age in self.age[role]), np.zeros_like(stamps_s)))
