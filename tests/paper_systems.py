"""Platforms and sensors of the paper's tables, and systems made of them."""

from __future__ import annotations

import math
from typing import Any

from syncline_design.model.roles import RoleName
from syncline_design.model.system import Platform, Sensor, Stage, System
from syncline_design.model.timing import Constant, TimingError, Uniform

DEG = math.pi / 180.0
# Typed in from the paper's tables (tab:examples, tab:sensor_accuracy): v m/s, omega deg/s, d m.
# "auv" is the row its survey table was computed with, see docs/theory.md.
PLATFORMS = {
    "usv": (5.0, 17.0, 30.0),
    "car": (30.0, 17.3, 50.0),
    "multi_rotor": (5.0, 311.8, 5.0),
    "fixed_wing": (21.0, 77.9, 100.0),
    "large_sv": (2.5, 4.5, 1000.0),
    "small_sv": (4.0, 17.0, 1000.0),
    "auv": (2.0779, 8.7, 30.0),
}
SENSORS: dict[str, tuple[RoleName, tuple[float, float, float]]] = {  # m, deg
    "f9p_pvt": ("position", (1.5, 1.5, 1.5)),
    "f9p_rtk": ("position", (0.01, 0.01, 0.01)),
    "r12_rtk": ("position", (0.008, 0.008, 0.008)),
    "ellipse": ("attitude", (0.1, 0.1, 0.2)),
    "mru5": ("attitude", (0.002, 0.002, 0.002)),
    "alpha_prime": ("ranging", (0.04, 0.1, 0.2)),
    "vux1": ("ranging", (0.01, 0.006, 0.006)),
    "hipap502": ("ranging", (0.02, 0.06, 0.06)),
    "usbl7000": ("ranging", (0.015, 0.04, 0.04)),
    "sonic2026": ("ranging", (0.001, 0.45, 0.45)),
    "m3": ("ranging", (0.01, 0.9, 0.5)),
}


def sigma_si(sensor: str) -> tuple[RoleName, tuple[float, float, float]]:
    role, (x, y, z) = SENSORS[sensor]
    if role == "attitude":
        return role, (x * DEG, y * DEG, z * DEG)
    return role, (x, y, z) if role == "position" else (x, y * DEG, z * DEG)


def sensor_of(name: str, timing: TimingError, **more: Any) -> Sensor:
    role, sigma = sigma_si(name)
    return Sensor(name, role, sigma, timing, **more)


def platform_of(name: str, baseline_m: float = 0.0) -> Platform:
    v, omega, d = PLATFORMS[name]
    return Platform(v, omega * DEG, d, baseline_m)


def survey(vessel: str, baseline_m: float = 0.0, **lever_arm: Any) -> System:
    """The paper's second example: vessel with R12 RTK, MRU5, USBL7000; AUV with MRU5, Sonic."""
    exact = TimingError(Constant(0.0))
    first = Stage(
        "vessel",
        "vessel",
        platform_of(vessel, baseline_m),
        sensor_of("r12_rtk", exact, **lever_arm),
        sensor_of("mru5", exact),
        sensor_of("usbl7000", TimingError(Uniform(-1e-3, 1e-3))),
    )
    second = Stage(
        "auv", "auv", platform_of("auv", 5.0), None, sensor_of("mru5", exact),
        sensor_of("sonic2026", exact),
    )  # fmt: skip
    return System((first, second))
