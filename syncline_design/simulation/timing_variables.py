"""What the timestamps of a system depend on: independent random variables with their reach.

The same distributions as `draws.timing_draws` draws from, taken apart: the shift of sensor i is
mu_i = constant + sum of eps_i + rho_i - o, each variable independent of the others
(budget_convention: eps a draw of its option, rho what a calibration leaves, o the offset of the
host clock, one for all sensors stamped on it, with what the clock has drifted away).
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.roles import RoleName
from syncline_design.model.system import System
from syncline_design.model.timing import (
    Constant,
    Distribution,
    Empirical,
    Normal,
    TimingError,
    Uniform,
    expected,
    mean,
    support,
)
from syncline_design.simulation.draws import entering
from syncline_design.simulation.lattice import lattice, normal_row

StampKey = tuple[str, RoleName]  # of a sensor: stage and role


@dataclass(frozen=True, slots=True)
class TimingVariable:
    """One independent variable u with mean 0 [s]; every sensor in `moves` is shifted by sign u.

    source: what it is, for people; mission: one value all through a mission.
    centred: its distribution less its mean, never Constant.
    """

    source: str
    mission: bool
    centred: Distribution
    sign: float
    moves: tuple[StampKey, ...]

    @property
    def std_s(self) -> float:
        """Standard deviation [s]."""
        match self.centred:
            case Uniform(low, high):
                return (high - low) / math.sqrt(12.0)
            case Normal(_, std):
                return std
            case Empirical(values):
                return math.sqrt(math.fsum(v * v for v in values) / len(values))
            case Constant():
                return 0.0

    def ends_s(self, coverage_factor: float) -> tuple[float, float]:
        """Support [s]; of a normal one k standard deviations to either side."""
        return support(TimingError(self.centred), coverage_factor)

    def on_lattice(self, row: int, count: int) -> Array:
        """Equally likely values [s] (count,), by one of the lattice's dimensions."""
        share = lattice(row + 1, count)[row]
        match self.centred:
            case Uniform(low, high):
                spread: Array = low + (high - low) * share
                return spread
            case Normal(_, std):
                normal: Array = std * normal_row(row, count)
                return normal
            case Empirical(values):
                ordered = np.sort(np.asarray(values, dtype=np.float64))
                place = np.minimum((share * len(values)).astype(np.intp), len(values) - 1)
                found: Array = ordered[place]
                return found
            case Constant():
                return np.zeros(count)


@dataclass(frozen=True, slots=True)
class SystemTiming:
    """A system's timestamp errors: mean of each sensor's mu [s], and what scatters about it."""

    mean_s: dict[StampKey, float]
    variables: tuple[TimingVariable, ...]

    def shifts(self, values: Array) -> dict[StampKey, Array]:
        """mu [s] of every sensor at values (variables, n) of the variables."""
        found = {key: np.full(values.shape[1], mean_s) for key, mean_s in self.mean_s.items()}
        for variable, row in zip(self.variables, values, strict=True):
            for key in variable.moves:
                found[key] = found[key] + variable.sign * row
        return found

    def signs(self, key: StampKey) -> Array:
        """How mu of a sensor follows each variable (variables,): 1, -1 or 0."""
        return np.array([v.sign if key in v.moves else 0.0 for v in self.variables])


def timing_of(system: System) -> SystemTiming:
    """The timing variables of a system; clocks of different vehicles are independent."""
    means: dict[StampKey, float] = {}
    variables: list[TimingVariable] = []
    on_clock: dict[str, list[StampKey]] = {}
    for stage in system.stages:
        for sensor in entering(stage):
            key: StampKey = (stage.name, sensor.role)
            means[key] = expected(sensor.timing)
            on_clock.setdefault(sensor.timeline, []).append(key)
            name = f"timestamp of {stage.name}.{sensor.role}"
            variables += _variables(name, sensor.timing, 1.0, (key,), mission=False)
    for timeline, offset in system.clock_offsets:
        keys = tuple(on_clock.get(timeline, ()))
        if not keys:
            continue
        for key in keys:
            means[key] -= expected(offset)
        name = f"clock {timeline.removeprefix('host:')}"
        variables += _variables(name, offset, -1.0, keys, mission=True)
    return SystemTiming(means, tuple(variables))


def _variables(
    name: str, error: TimingError, sign: float, keys: tuple[StampKey, ...], mission: bool
) -> Iterator[TimingVariable]:
    """The distribution about its mean, what a calibration leaves, what a clock drifted away."""
    own = TimingVariable(name, mission, _centred(error.distribution), sign, keys)
    if own.std_s > 0.0:
        yield own
    for what, size in (("calibration of", error.calibrated_s), ("drift of", error.drifted_s)):
        if size:
            yield TimingVariable(f"{what} {name}", True, Uniform(-size, size), sign, keys)


def _centred(distribution: Distribution) -> Distribution:
    middle = mean(distribution)
    match distribution:
        case Uniform(low, high):
            return Uniform(low - middle, high - middle)
        case Normal(_, std):
            return Normal(0.0, std)
        case Constant():
            return Constant(0.0)
        case Empirical(values):
            return Empirical(tuple(value - middle for value in values))
