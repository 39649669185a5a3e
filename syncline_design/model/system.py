"""A fully resolved system: every sensor chosen, every figure in SI.

This is what the Syncline, the simulator, the effects and the diagnosis all take.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from syncline_design.model.horizon import DEFAULT_HORIZON, Horizon
from syncline_design.model.known import EffectEntry
from syncline_design.model.roles import RoleName
from syncline_design.model.timing import NO_ERROR, TimingError

UTC = "utc"
ShareCurve = tuple[tuple[float, float], ...]  # place and share, rising in place; straight between


class SimulationError(ValueError):
    """A simulation that cannot be run as asked; the text says what was expected and found."""


@dataclass(frozen=True, slots=True)
class Platform:
    """How a vehicle moves: v_max [m/s], omega_max [rad/s], range d [m], largest lever arm b [m].

    nearest_m: where its object is at any range from there to d, the least of them [m].
    acceleration_mps2, angular_acceleration_radps2: at most, 0 where nobody says.
    """

    v_max_mps: float
    omega_max_radps: float
    distance_m: float
    baseline_m: float = 0.0
    nearest_m: float | None = None
    acceleration_mps2: float = 0.0
    angular_acceleration_radps2: float = 0.0


@dataclass(frozen=True, slots=True)
class Sensor:
    """One chosen sensor.

    sigma: standard deviations; position (north, east, down) [m]; attitude (roll, pitch, yaw)
    [rad]; ranging (range [m], azimuth [rad], elevation [rad]).
    timing: timestamp error mu against its timeline.
    timeline: "utc", or "host:VEHICLE" for the vehicle's host clock.
    lever_arm_m: body vector [m], None when the spec gives none.  Position: l_G, from the
    reference point to the antenna; ranging: l_L, from the reference point to the ranging sensor.
    type: the catalog's free type word (gnss, ins, lidar, usbl, mbes ...).
    rate_hz: how often it measures, told where samples are interpolated; sound_mps: speed of sound
    of one that waits for its echo; travels: whether nobody corrects for the way of the sound.
    range_shape: of noise that hangs on the range, (range [m], share of sigma); range_by_beam,
    bearing_by_beam: on the angle of sight from the down axis, (angle [rad], share of sigma).
    """

    id: str
    role: RoleName
    sigma: tuple[float, float, float]
    timing: TimingError
    timeline: str = UTC
    lever_arm_m: tuple[float, float, float] | None = None
    type: str = ""
    rate_hz: float | None = None
    sound_mps: float | None = None
    travels: bool = False
    range_shape: ShareCurve = ()
    range_by_beam: ShareCurve = ()
    bearing_by_beam: ShareCurve = ()


@dataclass(frozen=True, slots=True)
class Look:
    """Directions of azimuth and elevation [rad] between two ends each; None: every one of them."""

    azimuth: tuple[float, float] | None = None
    elevation: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True)
class Stage:
    """One vehicle that georeferences something; in a chain the object carries the next stage.

    position is None from the second stage on: there the chain before yields the position, and
    `transponder_lever_arm_m` is the body vector [m] from the reference point to the transponder.
    look: where its object is, in the body's axes; None: in any direction.
    """

    name: str
    vehicle: str
    platform: Platform
    position: Sensor | None
    attitude: Sensor | None
    ranging: Sensor | None
    transponder_lever_arm_m: tuple[float, float, float] | None = None
    look: Look | None = None

    def with_sensor(self, role: RoleName, sensor: Sensor | None) -> Stage:
        """The stage with another sensor in a role."""
        match role:
            case "position":
                return replace(self, position=sensor)
            case "attitude":
                return replace(self, attitude=sensor)
            case "ranging":
                return replace(self, ranging=sensor)

    def sensors(self) -> tuple[Sensor, ...]:
        """Sensors the stage has, in the order position, attitude, ranging."""
        return tuple(s for s in (self.position, self.attitude, self.ranging) if s is not None)


@dataclass(frozen=True, slots=True)
class System:
    """Stages of a chain, first to last, with the host clocks' offsets against UTC.

    clock_offsets: (timeline, its offset = host - UTC [s], as a distribution); a timeline not listed
    is taken as common with UTC (offset 0).
    horizon: how long, wide and steep the mission is, for effects that depend on it.
    """

    stages: tuple[Stage, ...]
    coverage_factor: float = 3.0
    clock_offsets: tuple[tuple[str, TimingError], ...] = ()
    effects: tuple[EffectEntry, ...] = ()
    horizon: Horizon = DEFAULT_HORIZON

    def clock_offset(self, timeline: str) -> TimingError:
        """Offset of a timeline against UTC; zero when none is declared."""
        return dict(self.clock_offsets).get(timeline, NO_ERROR)
