"""How a stage moves, and what its sensors err by there, exactly: figures behind the tables."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

from syncline_design.choice.option import Bend
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.roles import RoleName
from syncline_design.spec.case import Case, StageCase
from syncline_design.spec.catalog import (
    SensorEntry,
)
from syncline_design.spec.exact import bend_of, fraction_of, norm, travel_m
from syncline_design.spec.existence import (
    SOUND_MPS,
    is_acoustic,
    is_charged,
)
from syncline_design.spec.noise_table import NoiseTable


@dataclass(frozen=True, slots=True)
class StageMotion:
    """How a stage moves, exactly: v_max [m/s], d [m] (0 without ranging), omega_max [rad/s].

    nearest: the other end of its distances [m], where it has several.
    """

    speed: Fraction
    distance: Fraction
    turn: Fraction
    ranges: bool
    nearest: Fraction | None = None

    @property
    def near_end(self) -> StageMotion | None:
        """The stage at the near end of its distances; None where it has only one."""
        if self.nearest is None or self.nearest == self.distance:
            return None
        return replace(self, distance=self.nearest, nearest=None)

    def lets_in(self, role: RoleName) -> bool:
        """Whether a role's noise enters the error: attitude alone does not."""
        return self.ranges or role == "position"

    @property
    def turning(self) -> Fraction:
        """d omega_max [m/s]."""
        return self.distance * self.turn

    @property
    def rate(self) -> Fraction:
        """v_max + d omega_max [m/s]."""
        return self.speed + self.turning


def sensor_error(sensor: SensorEntry, role: RoleName, motion: StageMotion) -> Fraction:
    """A role's term of the sensor-induced error [m] (eq. sensor_error_ub)."""
    if not motion.lets_in(role):
        return Fraction(0)
    if role == "position":
        return norm(sensor.sigma_position or 0.0, 3)
    if role == "attitude":
        return norm(sensor.sigma_attitude or 0.0, 3) * motion.distance
    bearing = norm(sensor.sigma_bearing or 0.0, 2) * motion.distance
    return range_sigma(sensor, motion.distance) + bearing


def range_sigma(sensor: SensorEntry, distance: Fraction) -> Fraction:
    """Deviation of the range [m], at a distance."""
    sigma = sensor.sigma_range or 0.0
    by_range = isinstance(sigma, NoiseTable) and sigma.of == "range"
    return sigma.at(distance) if isinstance(sigma, NoiseTable) and by_range else fraction_of(sigma)


def bends_of(sensor: SensorEntry, role: RoleName, motion: StageMotion) -> tuple[Bend, ...]:
    """What a sensor's error is where its noise by range bends inside the stage's distances."""
    sigma, near = sensor.sigma_range, motion.near_end
    if role != "ranging" or near is None or not isinstance(sigma, NoiseTable):
        return ()
    if sigma.of != "range":
        return ()
    found = []
    for place in sigma.bends(min(near.distance, motion.distance), motion.distance):
        there = replace(motion, distance=place, nearest=None)
        rate = own_rate(role, there)
        found.append(Bend(place, sensor_error(sensor, role, there), rate))
    return tuple(found)


def underway_m(
    sensor: SensorEntry, role: RoleName, motion: StageMotion, case: Case, stage: StageCase
) -> Fraction:
    """What a sensor adds by sound under way and by interpolation [m]: see model/underway.py.

    A ranging sensor's fixes are the next stage's positions, whose vehicle moves while sound is
    under way as well; its rate is at most c / (2 d).
    """
    platform = stage.platform.entry
    if role == "position":
        return bend_of(platform.acceleration, sensor.rate, Fraction(0))
    if role == "attitude":
        turn = bend_of(platform.angular_acceleration, sensor.rate, Fraction(0))
        return turn * motion.distance
    sound = fraction_of(stage.choice.sound_speed or SOUND_MPS)
    found = echo = Fraction(0)
    following = case.stages[stage.index + 1 : stage.index + 2]
    if is_acoustic(sensor.type):
        echo = 2 * motion.distance / sound
        if is_charged(sensor, case.spec.strict_facts):
            objects = sum((motion_of(one).speed for one in following), Fraction(0))
            found = travel_m(motion.rate + objects, motion.distance, sound)
    return found + sum(
        (bend_of(one.platform.entry.acceleration, sensor.rate, echo) for one in following),
        Fraction(0),
    )


def may_be_underway(case: Case) -> bool:
    """Whether some sensor that a spec may use adds by sound under way or by interpolation."""
    return any(
        underway_m(one.entry, role.role, motion_of(stage), case, stage) > 0
        for stage in case.stages
        for role in stage.roles
        for one in role.sensors
    )


def own_rate(role: RoleName, motion: StageMotion) -> Fraction | None:
    """What a sensor's own tau_crit is taken against [m/s]; None where motion does not matter."""
    rate = motion.speed if role == "position" else motion.rate
    return rate if motion.lets_in(role) and rate > 0 else None


def motion_of(stage: StageCase) -> StageMotion:
    """How the platform of a stage moves."""
    platform, ranges = stage.platform.entry, stage.role("ranging") is not None
    distance = fraction_of(platform.distance) if ranges else Fraction(0)
    nearest = fraction_of(stage.distances[0]) if stage.choice.distance is not None else None
    return StageMotion(
        fraction_of(platform.v_max), distance, fraction_of(platform.omega_max), ranges, nearest
    )
