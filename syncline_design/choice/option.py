"""One option of a role: a sensor with primitive and method, what it errs by and what it takes."""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction
from typing import Literal

from syncline_design.machine.quick_dataclass import dataclass

ResourceName = Literal["cost", "mass", "power"]


Requires = tuple[tuple[str, int], ...]  # (infrastructure id, channels)


Names = tuple[str, str, str]  # sensor, primitive, method


Interval = tuple[float, float]  # from, to


EVERYWHERE: Interval = (0.0, math.inf)


@dataclass(frozen=True, slots=True)
class Resources:
    """What a choice uses up, exactly as written; None: the catalog does not say."""

    cost: Fraction | None = None  # in the spec's currency
    mass: Fraction | None = None  # kg
    power: Fraction | None = None  # W

    def of(self, name: ResourceName) -> Fraction | None:
        """The amount of one resource."""
        if name == "cost":
            return self.cost
        return self.mass if name == "mass" else self.power


@dataclass(frozen=True, slots=True)
class Bend:
    """Where a sensor's noise by range bends between the ends of the distances.

    error_m: its sensor error there; rate_mps: what its own tau_crit is taken against, None where
    motion does not matter.
    """

    distance_m: Fraction
    error_m: Fraction
    rate_mps: Fraction | None

    @property
    def crit_s(self) -> float:
        """Its own tau_crit there [s]."""
        return float(self.error_m / self.rate_mps) if self.rate_mps else math.inf

    def scaled(self, ratio: Fraction) -> Bend:
        """With so many times the error."""
        return replace(self, error_m=self.error_m * ratio)


@dataclass(frozen=True, slots=True)
class Option:
    """One (sensor, primitive, timestamping method) for a role, every constant resolved."""

    sensor: str
    primitive: str
    method: str
    sensor_error_m: float  # this sensor's term of the roof
    tau_s: float  # bound of its timestamp error, with what known effects add
    tau_crit_s: float  # inf when motion does not matter
    timeline: Literal["host", "utc"]
    resources: Resources  # sensor plus timestamping, per sensor
    requires: Requires = ()
    exact_error_m: Fraction | None = None
    exact_tau_s: Fraction | None = None
    systematic_m: float = 0.0  # known effects whose size hangs on this sensor
    exact_systematic_m: Fraction | None = None
    noise_systematic_m: Fraction = Fraction(0)  # the share of it that is in proportion to the noise
    own_rate_mps: Fraction | None = None  # what the sensor's own tau_crit is taken against
    near_error_m: Fraction | None = None  # at the near end of the stage's distances, and
    near_rate_mps: Fraction | None = None  # what its tau_crit is taken against there
    bends: tuple[Bend, ...] = ()  # where its noise by range bends in between
    reach_m: Interval = EVERYWHERE  # distances between which the sensor measures
    rate_hz: Fraction | None = None  # how often it measures; None: not told, or not asked
    sound_mps: Fraction | None = None  # of a sensor that waits for its echo

    @property
    def names(self) -> Names:
        """What tells this option from the others of its role; ties are broken by it."""
        return (self.sensor, self.primitive, self.method)

    def error(self) -> Fraction:
        """Sensor error [m], exactly."""
        return exactly(self.sensor_error_m, self.exact_error_m)

    def tau(self) -> Fraction:
        """Bound of the timestamp error [s], exactly."""
        return exactly(self.tau_s, self.exact_tau_s)

    def systematic(self) -> Fraction:
        """Known systematic error that comes with this sensor [m], exactly."""
        return exactly(self.systematic_m, self.exact_systematic_m)

    def nearer_m(self) -> Fraction:
        """How much smaller its sensor error is at the near end of the stage's distances [m]."""
        return Fraction(0) if self.near_error_m is None else self.error() - self.near_error_m

    def spacing_m(self, speed_mps: Fraction, distance_m: Fraction) -> Fraction:
        """Ground between two samples [m], as far as it is told: v max(1 / rate, 2 d / c)."""
        waits = [Fraction(0)]
        waits += [1 / self.rate_hz] if self.rate_hz else []
        waits += [2 * distance_m / self.sound_mps] if self.sound_mps else []
        return speed_mps * max(waits)

    def added_m(self) -> float:
        """What the sensor adds to the total [m], its systematic part included."""
        if self.systematic_m == 0.0:
            return self.sensor_error_m
        return float(self.error() + self.systematic())


def exactly(value: float, fraction: Fraction | None) -> Fraction:
    """The exact figure behind a float: the fraction where there is one, else the float itself."""
    return Fraction(value) if fraction is None else fraction


def sync_ratio(option: Option) -> float:
    """tau / tau_crit of one option, rounded once; 0 where motion does not matter."""
    if option.tau_crit_s == float("inf") or option.tau_s == 0.0:
        return 0.0
    if option.own_rate_mps is not None:
        ends = [(option.own_rate_mps, option.error())]
        if option.near_error_m is not None and option.near_rate_mps is not None:
            ends.append((option.near_rate_mps, option.near_error_m))
        ends += [(one.rate_mps, one.error_m) for one in option.bends if one.rate_mps]
        ratios = [option.tau() * rate / error if error > 0 else None for rate, error in ends]
        return max(float("inf") if ratio is None else float(ratio) for ratio in ratios)
    return option.tau_s / option.tau_crit_s if option.tau_crit_s > 0.0 else float("inf")
