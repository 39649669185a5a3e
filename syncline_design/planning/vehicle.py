"""What a vehicle can do on a drive: from the spec's platform, or by what its kind usually can.

Stated figures of the platform count.  What is not stated is taken from the kind of `motion` (the
table of docs/plan.md), and is said with the plan as assumed.
"""

from __future__ import annotations

import math
from typing import Final, Literal, NamedTuple

from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import format_duration, to_digits
from syncline_design.spec.case import Case, StageCase
from syncline_design.spec.load import BadInput
from syncline_design.spec.yaml_text import Flaw

Motion = Literal["multirotor", "fixed_wing", "ground", "surface", "underwater", "level"]
SHARE: Final = 0.9  # of v_max that a plan asks for: drivers and autopilots need room
TURN_SHARE: Final = 0.75  # of omega_max, so that roll and pitch fit beside a turn
ACROSS: Final = 0.8  # of the acceleration, for turns
ALONG: Final = 0.6  # of it, for changes of speed: with turns beside them that is all of it
SEA_TILT: Final = 3.0  # the horizon's tilt is so many standard deviations of the sea's motion
SEA_RATE_SHARE: Final = 0.12  # of omega_max that the sea's own turn rate is at most (rms)
MOST_TILT_RAD: Final = math.radians(30.0)
GRAVITY_MPS2: Final = 9.80665
LEANING: Final = ("multirotor", "fixed_wing")  # motions that lean with their acceleration
BELOW: Final = ("mbes", "sonar", "usbl", "echo", "imaging_sonar", "multibeam")
LONGEST_TURN_S: Final = 3600.0  # a turn about that takes longer is none
HEIGHT_SHARE: Final = 0.6  # of the range d that the targets lie below
LINED_UP: Final = 2.0  # radii of a turn after which a vehicle that came round is on its line
FAR: Final = 0.95  # of the range d at which targets are at most
STEEP_RAD: Final = math.radians(75.0)  # below the level, at most: beyond, azimuths mean nothing
HIGHEST: Final = FAR * math.sin(STEEP_RAD)  # of the range d, over targets that are in sight


class Usual(NamedTuple):
    """What a kind usually can: acceleration [m/s2], turn radius [m] (None: v_max over omega_max),
    slowest speed over v_max, time over which commands are rounded [s]."""

    acceleration_mps2: float
    turn_radius_m: float | None
    slowest: float
    rounding_s: float
    hovers: bool = False
    reverses: bool = False
    climbs: bool = False


USUAL: Final[dict[Motion, Usual]] = {
    "multirotor": Usual(2.5, 0.0, 0.0, 0.35, hovers=True, reverses=True, climbs=True),
    "fixed_wing": Usual(4.0, None, 0.6, 0.6, climbs=True),
    "ground": Usual(2.0, 6.0, 0.0, 0.5, reverses=True),
    "surface": Usual(0.3, None, 0.0, 1.5, reverses=True),
    "underwater": Usual(0.15, None, 0.3, 1.5, climbs=True),
    "level": Usual(1.0, None, 0.0, 0.6),
}


@dataclass(frozen=True, slots=True)
class Vehicle:
    """Limits of one stage's vehicle, and where the objects of its ranging sensor are.

    area_m: north and east extent within which a drive has to stay; None: anywhere.
    depth_m: how far below the reference point targets lie on average; 0: around it.
    assumed: figures that the spec does not state, in words.  calm: whether there are no waves.
    """

    stage: str
    motion: Motion
    v_max_mps: float
    omega_max_radps: float
    acceleration_mps2: float
    turn_radius_m: float
    slowest_mps: float
    tilt_rad: float
    distance_m: float
    depth_m: float
    area_m: tuple[float, float] | None = None
    assumed: tuple[str, ...] = ()
    calm: bool = False

    @property
    def usual(self) -> Usual:
        return USUAL[self.motion]

    @property
    def hovers(self) -> bool:
        """Whether it stands still and turns there: not where a turning radius is stated."""
        return self.usual.hovers and self.turn_radius_m == 0.0

    @property
    def fast_mps(self) -> float:
        """The speed of a fast leg."""
        return max(SHARE * self.v_max_mps, self.slowest_mps)

    @property
    def join_mps(self) -> float:
        """The speed at which one leg ends and the next begins: where it turns fastest.

        There radius and acceleration bind alike, v / R = 0.8 a / v.
        """
        if self.hovers:
            return 0.0
        quickest = math.sqrt(ACROSS * self.acceleration_mps2 * self.turn_radius_m)
        return min(max(self.slowest_mps, self.fast_mps / 3.0, quickest), self.fast_mps)

    @property
    def rounding_s(self) -> float:
        """Standard deviation of the Gaussian that rounds commands [s].

        Who leans by atan(a / g) goes from one side to the other at 2 a / (g s sqrt(2 pi)), which
        has to stay as far below omega_max as turns do.
        """
        usual = self.usual.rounding_s
        if self.motion not in LEANING:
            return usual
        across = ACROSS * self.acceleration_mps2
        if self.motion == "fixed_wing":
            across = max(v * self.turn_radps(v) for v in (self.fast_mps, self.join_mps))
        slope = 2.0 * across / (GRAVITY_MPS2 * math.sqrt(2.0 * math.pi))
        return max(usual, slope / (TURN_SHARE * self.omega_max_radps))

    def gaining_m(self, speed_mps: float) -> float:
        """Way from the slowest speed v0 to another, or back: (v^2 - v0^2) / (2 a) [m]; straight on,
        so that all of the acceleration is for it."""
        return max(speed_mps**2 - self.slowest_mps**2, 0.0) / (2.0 * self.acceleration_mps2)

    def run_m(self, speed_mps: float) -> float:
        """Way [m] straight on before a drive that begins at a speed, and after one that ends at it.

        What cannot stop comes from anywhere at some speed: it needs room to get onto the line, and
        turns off it before the last place that it is sent to; two radii of its turn.
        """
        gaining_m = self.gaining_m(speed_mps)
        if self.slowest_mps <= 0.0 or speed_mps <= 0.0:
            return gaining_m
        return max(gaining_m, LINED_UP * speed_mps / self.turn_radps(speed_mps))

    def turn_radps(self, speed_mps: float) -> float:
        """Largest turn rate at a speed: omega_max, a lateral acceleration, a radius."""
        limit = TURN_SHARE * self.omega_max_radps
        if speed_mps > 0.0:
            limit = min(limit, ACROSS * self.acceleration_mps2 / speed_mps)
        if self.turn_radius_m > 0.0:
            limit = min(limit, speed_mps / self.turn_radius_m)
        return limit


def vehicles(case: Case, ranging_types: tuple[str, ...]) -> tuple[Vehicle, ...]:
    """The vehicle of every stage; BadInput for one that cannot turn or move."""
    return tuple(
        _vehicle(case, stage, kind) for stage, kind in zip(case.stages, ranging_types, strict=False)
    )


def _vehicle(case: Case, stage: StageCase, ranging_type: str) -> Vehicle:
    entry = stage.platform.entry
    v_max, omega = float(entry.v_max), float(entry.omega_max)
    _demand_motion(case, stage, v_max, omega)
    motion: Motion = entry.motion or "level"
    usual, assumed = USUAL[motion], []
    if entry.motion is None:
        assumed.append("motion: level (it keeps level, heads where it goes, neither hovers nor "
                       "reverses; `motion:` of the platform says more)")  # fmt: skip
    accelerates = _stated(entry.acceleration, _usual_acceleration(usual, v_max))
    if entry.acceleration is None:
        waves = ", on the level: the waves' heave adds to it" if motion == "surface" else ""
        assumed.append(f"acceleration: {to_digits(accelerates, 3)} m/s^2{waves}")
    radius = usual.turn_radius_m if usual.turn_radius_m is not None else v_max / omega
    if entry.minimum_turn_radius is None and radius > 0.0:
        assumed.append(f"minimum_turn_radius: {to_digits(radius, 3)} m")
    slowest = _stated(entry.minimum_speed, usual.slowest * v_max)
    if entry.minimum_speed is None and slowest > 0.0:
        assumed.append(f"minimum_speed: {to_digits(slowest, 3)} m/s")
    tilt = min(float(case.spec.horizon.tilt), MOST_TILT_RAD)
    found = Vehicle(
        stage.choice.name,
        motion,
        v_max,
        omega,
        accelerates,
        _stated(entry.minimum_turn_radius, radius),
        min(slowest, SHARE * v_max),
        tilt,
        float(entry.distance),
        _depth_m(entry.height, float(entry.distance), motion, ranging_type),
        _area(entry.area),
        tuple(assumed),
    )
    _demand_turns(case, stage, found)
    _demand_sight(case, stage, found)
    return found


def _usual_acceleration(usual: Usual, v_max: float) -> float:
    """The kind's, and at most the one that reaches v_max in 2 s: slow vehicles are gentle."""
    return min(usual.acceleration_mps2, 0.5 * v_max)


def _stated(figure: float | None, otherwise: float) -> float:
    return otherwise if figure is None else float(figure)


def _area(stated: float | tuple[float, ...] | None) -> tuple[float, float] | None:
    if stated is None:
        return None
    north, east = stated if isinstance(stated, tuple) else (stated, stated)
    return float(north), float(east)


def _depth_m(
    height: float | None, distance: float, motion: Motion, ranging_type: str
) -> float:  # fmt: skip
    """How far below the vehicle its objects lie: the stated height, or a share of d.

    Around the vehicle where it is on the ground or afloat and looks through air.
    """
    if height is not None:
        return float(height)
    afloat = motion in ("ground", "surface")
    looks_down = any(word in ranging_type for word in BELOW)
    return 0.0 if afloat and not looks_down else HEIGHT_SHARE * distance


def _demand_motion(case: Case, stage: StageCase, v_max: float, omega: float) -> None:
    for key, value, cannot in (("omega_max", omega, "turn"), ("v_max", v_max, "move")):
        if value <= 0.0:
            raise _cannot(case, stage, key, cannot, f"{key} is 0", f"{key} above 0")


def _demand_turns(case: Case, stage: StageCase, found: Vehicle) -> None:
    """BadInput where a turn about takes longer than any drive, with the figure that binds."""
    rate = found.turn_radps(found.join_mps)
    if rate * LONGEST_TURN_S >= math.pi:
        return
    tight = found.turn_radius_m > 0.0 and rate < TURN_SHARE * found.omega_max_radps
    key = "minimum_turn_radius" if tight else "omega_max"
    most = format_duration(LONGEST_TURN_S)
    why = f"a turn about at {to_digits(found.join_mps, 3)} m/s takes longer than {most}"
    raise _cannot(case, stage, key, "turn", why, f"a turn about within {most}")


def _demand_sight(case: Case, stage: StageCase, found: Vehicle) -> None:
    """BadInput where from the stated height no target is in sight: its figures would be of another
    drive."""
    height, most = stage.platform.entry.height, HIGHEST * found.distance_m
    if stage.role("ranging") is None or height is None or float(height) <= most:
        return
    flaw = Flaw(
        str(case.path),
        *case.position(("stages", stage.index, "platform")),
        f"stages.{stage.index}.platform.height",
        f"the platform of stage {stage.choice.name!r} keeps {to_digits(float(height), 4)} m over "
        f"its targets, and they are at most {to_digits(FAR * found.distance_m, 4)} m away and at "
        f"most {to_digits(math.degrees(STEEP_RAD), 2)} deg below the level",
        f"a height of at most {to_digits(100 * HIGHEST, 2)} % of its distance, "
        f"{to_digits(most, 3)} m",
        hint="state the distance at which the sensor is used, or the height at which it is flown",
    )
    raise BadInput((flaw,))


def _cannot(
    case: Case, stage: StageCase, key: str, cannot: str, why: str, expected: str
) -> BadInput:
    flaw = Flaw(
        str(case.path),
        *case.position(("stages", stage.index, "platform")),
        f"stages.{stage.index}.platform.{key}",
        f"the platform of stage {stage.choice.name!r} cannot {cannot} ({why}), and what tells "
        f"effects apart is how it {cannot}s",
        expected,
        hint="state what the vehicle of the test drive can do",
    )
    return BadInput((flaw,))
