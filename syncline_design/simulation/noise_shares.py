"""What each sensor's noise adds to a figure in one situation, at least: sums that rule designs out.

A figure of the error is its largest over all situations, so that no design has a smaller one than
in any single situation g.  There independent errors never make normal noise less dispersed (T. W.
Anderson, Proc. AMS 6, 1955), and the variance of the noise is a sum over sensors: with s_k what one
unit of noise k does in g,
  RMS^2 >= sum over sensors of sum_k sigma_k^2 |P s_k|^2,
and a quantile Q of |P e| has Q^2 >= c times that sum, c the smallest Q^2 of any normal noise of
trace 1 in as many axes.  Shifts turn s_k by at most an angle a: |P s_k| falls by at most a |s_k|.

The other way round, in any situation noise of a known length and timestamps in their supports give
  Q <= sqrt(C) sqrt(sum of sigma_k^2 |s_k|^2) + (what timestamps alone give at most),
C the largest such Q^2; for the root mean square C is 1 (Minkowski).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import lru_cache

import numpy as np

from syncline_design.effects.acting import acts
from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.lever_arms import arm_lengths
from syncline_design.model.roles import ROLES, RoleName
from syncline_design.model.system import UTC, Sensor, Stage, System
from syncline_design.model.timing import NO_ERROR
from syncline_design.simulation.certified import certified_worst_case_m
from syncline_design.simulation.situations import Moments, Situations
from syncline_design.simulation.statistical import AXES, Axis, Wanted, exact

Key = tuple[int, RoleName]  # stage, role
_SPLITS = 12  # of the trace over the axes, on the way to the smallest quantile
_BELOW = 0.99  # what a grid of splits and a lattice may be off
SURE_SIGMA = 6.0
_STEEPEST = 1.4  # pitch [rad] beyond which no slope is trusted


@dataclass(frozen=True, slots=True, eq=False)
class NoiseAt:
    """What unit noise of each sensor does in one situation, without shifts.

    within: |P s_k| by stage and role, (3,); whole: |s_k|; tilt_rad: how far vehicles lean at most.
    """

    within: Mapping[Key, Array]
    whole: Mapping[Key, Array]
    tilt_rad: float

    def least(self, key: Key, turns_rad: Mapping[int, float]) -> Array:
        """What unit noise adds to |P e|^2 at least where shifts turn each stage so far, (3,).

        The slope by pitch stands across the measured heading, which turns by 1 / cos(pitch) more.
        """
        stage, role = key
        angle = 0.0 if role == "position" else turns_rad.get(stage, 0.0)
        if role == "attitude":
            angle *= 1.0 + 1.0 / math.cos(min(self.tilt_rad + angle, _STEEPEST))
        found: Array = np.maximum(self.within[key] - angle * self.whole[key], 0.0) ** 2
        return found


def noise_at(system: System, wanted: Wanted, point: Array) -> NoiseAt:
    """The slopes of every sensor's noise at a situation (p,)."""
    situations = Situations(_with_unit_noise(system))
    still = np.zeros((situations.dimensions, 1))
    slopes = situations.moments(point[:, None], still).slopes_m[0, 0]
    within, whole = {}, {}
    for index in range(len(system.stages)):
        for number, role in enumerate(ROLES):
            first = 9 * index + 3 * number
            own = slopes[:, first : first + 3]
            within[index, role] = np.sqrt(np.sum(own[AXES[wanted.axis]] ** 2, axis=0))
            whole[index, role] = np.sqrt(np.sum(own**2, axis=0))
    return NoiseAt(within, whole, system.horizon.tilt_rad)


def most_noise(wanted: Wanted, limit_m: float) -> float:
    """The largest such sum [m2] with which a figure may still keep a limit."""
    least = 1.0 if wanted.p is None else least_quantile(wanted.axis, wanted.p)
    return limit_m**2 / least


def surely_keeps(system: System, wanted: Wanted, limit_m: float) -> bool:
    """Whether a figure keeps a limit in every situation, by norms alone: a quick yes, never a no.

    |de/dEuler angle| <= d + |l_L - l_G|, |de/drange| = 1, |de/dbearing| <= d; normal timestamp
    errors count to SURE_SIGMA deviations, beyond which one in 5e8 lies.  Without known effects.
    """
    if acts(system) or wanted.rule is not None:
        return False
    squares = sum(
        _largest_noise(stage, index == 0, wanted) for index, stage in enumerate(system.stages)
    )
    most = 1.0 if wanted.p is None else _quantiles(wanted.axis, wanted.p)[1]
    still = _with_noise(replace(system, coverage_factor=SURE_SIGMA), 0.0)
    return math.sqrt(most * squares) + certified_worst_case_m(still) <= limit_m


def _largest_noise(stage: Stage, first: bool, wanted: Wanted) -> float:
    """The largest mean square of the noise of a stage [m2]."""
    found = 0.0
    if stage.position is not None:
        sigma = np.array(stage.position.sigma)
        found += float(np.sum(sigma[AXES[wanted.axis]] ** 2))
    if stage.ranging is not None and stage.attitude is not None:
        d, (_, arm) = float(stage.platform.distance_m), arm_lengths(stage, first)
        along, azimuth, elevation = stage.ranging.sigma
        found += along**2 + (azimuth**2 + elevation**2) * d**2
        found += sum(one**2 for one in stage.attitude.sigma) * (d + arm) ** 2
    return found


def least_quantile(axis: Axis, p: float) -> float:
    """The smallest p-quantile of |z|^2 of normal noise z with trace 1 [1], over all its shapes."""
    return _quantiles(axis, p)[0]


@lru_cache(maxsize=32)
def _quantiles(axis: Axis, p: float) -> tuple[float, float]:
    """The smallest and the largest one, on the safe side."""
    size = AXES[axis].stop - AXES[axis].start
    rest = range(_SPLITS + 1)
    splits = [(a, b, _SPLITS - a - b) for a in rest for b in rest if a + b <= _SPLITS]
    if size == 1:
        splits = [(0, 0, _SPLITS)]
    elif size == 2:
        splits = [split for split in splits if split[2] == 0]
    values = [_quantile(split, Wanted(axis, p)) for split in splits if split[0] >= split[1]]
    return _BELOW * min(values) ** 2, max(values) ** 2 / _BELOW


def _quantile(split: tuple[int, int, int], wanted: Wanted) -> float:
    nodes = 1021
    slopes = np.diag(np.sqrt(np.array(split) / _SPLITS))
    moments = Moments(np.zeros((1, nodes, 3)), np.broadcast_to(slopes, (1, nodes, 3, 3)))
    return exact(moments, replace(wanted, rule=None), 0)


def _with_unit_noise(system: System) -> System:
    """The system with true stamps, every sensor with a standard deviation of 1 on each axis."""
    found = _with_noise(system, 1.0)

    def exact_stamp(sensor: Sensor | None) -> Sensor | None:
        return None if sensor is None else replace(sensor, timing=NO_ERROR, timeline=UTC)

    return replace(_each(found, exact_stamp), clock_offsets=())


def _with_noise(system: System, sigma: float) -> System:
    """The system with that standard deviation on every axis of every sensor."""

    def noisy(sensor: Sensor | None) -> Sensor | None:
        return None if sensor is None else replace(sensor, sigma=(sigma, sigma, sigma))

    return _each(system, noisy)


def _each(system: System, change: Callable[[Sensor | None], Sensor | None]) -> System:
    """The system with every sensor changed."""

    stages = tuple(
        replace(
            stage,
            position=change(stage.position),
            attitude=change(stage.attitude),
            ranging=change(stage.ranging),
        )
        for stage in system.stages
    )
    return replace(system, stages=stages)
