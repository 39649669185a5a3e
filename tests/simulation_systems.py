"""Systems that the simulator's tests share; figures from the paper's tables."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from syncline_design.model.horizon import Horizon
from syncline_design.model.system import Platform, Sensor, Stage, System
from syncline_design.model.timing import Distribution, TimingError, Uniform
from syncline_design.simulation.chain import ChainNoise

DEG = math.pi / 180.0
DEFAULT_ERROR = Uniform(-2e-4, 2e-4)


def sensor(
    role: str,
    sigma: tuple[float, float, float],
    distribution: Distribution = DEFAULT_ERROR,
    lever_arm: tuple[float, float, float] | None = None,
    timeline: str = "host:vehicle",
) -> Sensor:
    return Sensor(role, role, sigma, TimingError(distribution), timeline, lever_arm)  # type: ignore[arg-type]


def tilted(system: System, tilt_rad: float = 0.0) -> System:
    """The same with this largest tilt, level by default."""
    return dataclasses.replace(system, horizon=Horizon(tilt_rad=tilt_rad))


def fixed_wing(distribution: Distribution = DEFAULT_ERROR) -> System:
    """UAV fixed wing with F9P RTK, MRU5, VUX-1UAV."""
    stage = Stage(
        "uav",
        "uav",
        Platform(21.0, 77.9 * DEG, 100.0, 1.0),
        sensor("position", (0.01, 0.01, 0.01), distribution, (0.3, 0.1, -0.2)),
        sensor("attitude", (0.002 * DEG,) * 3, distribution),
        sensor("ranging", (0.01, 0.006 * DEG, 0.006 * DEG), distribution, (0.0, 0.05, 0.1)),
    )
    return System((stage,))


def survey(distribution: Distribution = DEFAULT_ERROR) -> System:
    """Small SV with F9P RTK, MRU5, HiPAP 502 over an AUV with MRU5, Sonic 2026."""
    vessel = Stage(
        "vessel",
        "vessel",
        Platform(4.0, 17.0 * DEG, 1000.0, 10.0),
        sensor("position", (0.01, 0.02, 0.03), distribution, None, "host:vessel"),
        sensor("attitude", (0.002 * DEG,) * 3, distribution, None, "host:vessel"),
        sensor("ranging", (0.02, 0.06 * DEG, 0.06 * DEG), distribution, None, "host:vessel"),
    )
    vehicle = Stage(
        "auv",
        "auv",
        Platform(2.0779, 8.7 * DEG, 30.0, 5.0),
        None,
        sensor("attitude", (0.002 * DEG,) * 3, distribution, None, "host:auv"),
        sensor("ranging", (0.001, 0.45 * DEG, 0.45 * DEG), distribution, None, "host:auv"),
    )
    return System((vessel, vehicle))


def position_only() -> System:
    """A car that locates itself: no attitude, no ranging."""
    stage = Stage(
        "car",
        "car",
        Platform(30.0, 17.3 * DEG, 50.0, 3.0),
        sensor("position", (0.02, 0.02, 0.05)),
        None,
        None,
    )
    return System((stage,))


def altered(system: System, **platform: float) -> System:
    """The system with figures of its first platform replaced."""
    first = system.stages[0]
    changed = dataclasses.replace(first, platform=dataclasses.replace(first.platform, **platform))
    return dataclasses.replace(system, stages=(changed, *system.stages[1:]))


def no_noise(rows: int) -> ChainNoise:
    """A draw without noise and without timestamp errors."""
    vector, scalar = np.zeros((rows, 3)), np.zeros(rows)
    return ChainNoise(vector, vector, scalar, scalar, scalar, scalar, scalar, scalar)
