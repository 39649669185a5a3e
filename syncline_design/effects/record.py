"""What an effect is: one record that simulator, budget, diagnosis and report all read.

An effect looks at the rows of one stage (`StageRows`, the true state at every stamp) and says how
the world departs from the spec (`Departures`).  The chain (`simulation.chain`) turns departures
into errors; the linear sensitivity beside it is what the diagnosis screens with.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import field, fields
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.sentences import one_of
from syncline_design.model.figure_text import to_digits
from syncline_design.model.horizon import DEFAULT_HORIZON, Horizon
from syncline_design.model.roles import RoleName
from syncline_design.model.system import Stage

Array = NDArray[np.float64]
ActsOn = RoleName | Literal["target"]
Values = Mapping[str, float]
Rng = np.random.Generator | None


@dataclass(frozen=True, slots=True)
class StageRows:
    """True state of one stage at n stamps of its ranging sensor.

    time_s (n,); position_m (n, 3) reference point in NED; rotation (n, 3, 3) R_nb;
    euler_rad (n, 3) roll, pitch, yaw; velocity_mps and acceleration_mps2 (n, 3) of the reference
    point, body axes; rate_radps (n, 3) body; range_m, azimuth_rad, elevation_rad (n,) true
    bearing in the ranging sensor's believed axes; target_m (n, 3) true object in NED.
    antenna_m, ranging_m: lever arms l_G, l_L the spec believes [m], body, (3,) or (n, 3).
    start_s: when the mission began, on the clock of time_s; None: at the first row, as in a log.
    independent: each row is a sample of a mission of its own, so what is correlated in time is
    drawn anew in each; False: the rows follow each other in time.
    pull, twist: unit vectors (n, 3), body axes, along which the path and the attitude bend between
    two samples; None: in any direction.
    lagged: of a time constant T [s], by how much a low pass of the path up to each row lags
    behind the place (n, 3) and behind R_nb (n, 3, 3), NED; None: only the present is known.
    """

    time_s: Array
    position_m: Array
    rotation: Array
    euler_rad: Array
    velocity_mps: Array
    acceleration_mps2: Array
    rate_radps: Array
    range_m: Array
    azimuth_rad: Array
    elevation_rad: Array
    antenna_m: Array
    ranging_m: Array
    target_m: Array
    start_s: float | None = None
    independent: bool = False
    lagged: Callable[[float], tuple[Array, Array]] | None = None
    pull: Array | None = None
    twist: Array | None = None

    def __len__(self) -> int:
        return int(self.time_s.shape[0])


_ZERO = np.zeros(1)
_ZERO3 = np.zeros((1, 3))


@dataclass(frozen=True, slots=True)
class Departures:
    """How the world departs from the spec, row by row; every field adds, zero means as specified.

    position_shift_s, attitude_shift_s, ranging_shift_s (n,): extra mu of that sensor.
    antenna_m, ranging_m (n, 3): true lever arm minus the spec's, body.
    attitude_rotation_rad (n, 3): alpha, measured R = R exp(S(alpha)).
    attitude_euler_rad (n, 3): added to measured roll, pitch, yaw.
    bearing_rotation_rad (n, 3): beta, true mounting of the ranging sensor exp(S(beta)).
    position_m (n, 3): added to the antenna reading, NED.
    range_m (n,), range_scale (n,): measured r = r (1 + range_scale) + range_m.
    azimuth_rad, elevation_rad (n,): added to the measured bearing.
    target_m (n, 3): surveyed object minus true object, NED.
    position_noise, attitude_noise, ranging_noise (n,): the noise draw of that sensor is taken
    times (1 + this); range_noise (n,): the range's times so much more, beside ranging_noise.
    """

    position_shift_s: Array = field(default_factory=lambda: _ZERO)
    attitude_shift_s: Array = field(default_factory=lambda: _ZERO)
    ranging_shift_s: Array = field(default_factory=lambda: _ZERO)
    antenna_m: Array = field(default_factory=lambda: _ZERO3)
    ranging_m: Array = field(default_factory=lambda: _ZERO3)
    attitude_rotation_rad: Array = field(default_factory=lambda: _ZERO3)
    attitude_euler_rad: Array = field(default_factory=lambda: _ZERO3)
    bearing_rotation_rad: Array = field(default_factory=lambda: _ZERO3)
    position_m: Array = field(default_factory=lambda: _ZERO3)
    range_m: Array = field(default_factory=lambda: _ZERO)
    range_scale: Array = field(default_factory=lambda: _ZERO)
    azimuth_rad: Array = field(default_factory=lambda: _ZERO)
    elevation_rad: Array = field(default_factory=lambda: _ZERO)
    target_m: Array = field(default_factory=lambda: _ZERO3)
    position_noise: Array = field(default_factory=lambda: _ZERO)
    attitude_noise: Array = field(default_factory=lambda: _ZERO)
    ranging_noise: Array = field(default_factory=lambda: _ZERO)
    range_noise: Array = field(default_factory=lambda: _ZERO)

    def __add__(self, other: Departures) -> Departures:
        """Both departures at once; rotation vectors add, which is exact to second order."""
        return Departures(
            **{f.name: getattr(self, f.name) + getattr(other, f.name) for f in fields(self)}
        )


NOTHING = Departures()


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter: its name carries the unit; [low, high] is its plausible magnitude.

    usual: the magnitude beyond which it is hardly ever met, where there is a source for one.
    choices: what a discrete parameter may be, by the sensor it acts on; its value is then a text.
    located: the error depends on it only through where along the log something happens.
    above, most: the values between which the effect exists at all, `above` left out (a factor of
    noise is more than 0, a share at most 1); one that is not signed is at least 0.
    whole: a whole number.
    """

    name: str
    low: float
    high: float
    unit: str = ""
    signed: bool = True
    choices: Mapping[ActsOn, tuple[str, ...]] = field(default_factory=dict)
    located: bool = False
    above: float = -math.inf
    most: float = math.inf
    whole: bool = False
    usual: float = math.inf

    def holds(self, value: float) -> bool:
        """Whether the effect exists with this value."""
        small = value <= self.above or (not self.signed and value < 0.0)
        return not (small or value > self.most or (self.whole and not value.is_integer()))

    def choices_of(self, sensor: str) -> tuple[str, ...] | None:
        """What a discrete parameter may be on a sensor; None where it does not act on it."""
        return next((words for target, words in self.choices.items() if target == sensor), None)

    def misfit(self, value: float | str, sensor: str) -> str | None:
        """What is wrong with a value for this sensor."""
        if isinstance(value, str) != bool(self.choices):
            return "wrong kind of value"
        if isinstance(value, str):
            choices = self.choices_of(sensor)  # none: the sensor itself does not fit
            return None if choices is None or value in choices else "not one of the choices"
        return None if self.holds(float(value)) else "out of range"

    @property
    def domain(self) -> str:
        """The values that `holds` takes, in words."""
        kind = "a whole number" if self.whole else "a number"
        least = (
            "at least 0"
            if not self.signed and self.above < 0.0
            else f"more than {to_digits(self.above)}"
        )
        bounds = [least] if not self.signed or self.above > -math.inf else []
        bounds += [f"at most {to_digits(self.most)}"] if self.most < math.inf else []
        return " ".join([kind, " and ".join(bounds)]).strip()


@dataclass(frozen=True, slots=True)
class Basis:
    """What the charge of an effect depends on besides its stage and its parameters.

    horizon: over which drifts, grids and tilts are charged; coverage_factor: k of a normal timing
    error's bound; distance_m: range d, 0 for a stage without a ranging sensor; arm_m: largest
    |l_L - l_G| [m], which attitude errors turn as they turn the line of sight.
    """

    horizon: Horizon = DEFAULT_HORIZON
    coverage_factor: float = 3.0
    distance_m: float = 0.0
    arm_m: float = 0.0


@dataclass(frozen=True, slots=True)
class Contribution:
    """What a known effect adds to the Syncline.

    tau_s: to the timestamp error's bound of its sensor; systematic_m: displaces the estimate by at
    most this; turn_rad: turns the measured attitude, and with it the line of sight and the arms;
    sight_rad: turns the line of sight in the body; shift_s: of position and attitude against the
    ranging sensor, beside tau; relayed_s: of what the stage locates, as the next stage takes it.
    """

    tau_s: float = 0.0
    systematic_m: float = 0.0
    turn_rad: float = 0.0
    sight_rad: float = 0.0
    shift_s: float = 0.0
    relayed_s: float = 0.0

    def total_m(self, basis: Basis) -> float:
        """Systematic term of the budget [m]: systematic + sight d + turn (d + |l_L - l_G|)."""
        d = basis.distance_m
        return self.systematic_m + self.sight_rad * d + self.turn_rad * (d + basis.arm_m)


@dataclass(frozen=True, slots=True)
class Misfit:
    """What of an entry does not fit its effect: its keys, in words, what it says and could say."""

    keys: tuple[str, ...]
    message: str
    found: str
    known: tuple[str, ...]

    @property
    def expected(self) -> str:
        """What it could say, in words."""
        return one_of(self.known)


Depart = Callable[[StageRows, Values, ActsOn, Rng], Departures]
Sensitivity = Callable[[StageRows, Values, ActsOn], Array]
Contribute = Callable[[Stage, Values, ActsOn, Basis], Contribution]
Spread = Callable[[StageRows, Values, ActsOn], Array]
Applies = Callable[[Stage, ActsOn], bool]
Unbudgeted = Callable[[Values], str]


def always_budgeted(values: Values) -> str:
    """The Syncline can charge it whatever its values; the default of `Effect.unbudgeted`."""
    return ""


def everywhere(stage: Stage, sensor: ActsOn) -> bool:
    """Whether the stage has the sensor at all; the default of `Effect.applies`."""
    return sensor == "target" or getattr(stage, sensor) is not None


SOUNDS: Final = ("usbl", "mbes", "sbes", "sonar")
VESSEL_WORDS: Final = ("vessel", "ship", "boat", "usv", "ferry")


def by_sound(stage: Stage, sensor: ActsOn) -> bool:
    """Whether the stage ranges by sound that goes there and comes back."""
    return stage.ranging is not None and stage.ranging.type.lower() in SOUNDS


def on_vessels(stage: Stage, sensor: ActsOn) -> bool:
    """Whether a positioned stage floats, by its or its vehicle's name, or as it ranges by sound."""
    words = f"{stage.name} {stage.vehicle}".lower()
    named = any(word in words for word in VESSEL_WORDS)
    return stage.position is not None and (named or by_sound(stage, sensor))


Promise = Literal["timing", "latency", "clock", "lever_arm", "mounting", "noise"]
Origin = Literal["stamps", "sensor", "build"]
Opening = Literal["", "factor", "slow", "down", "size", "tails", "episode"]
OUTLIER_FACTOR = 10.0  # what opens tails has outliers of so many times the spec's deviation
SELDOM = 1000


@dataclass(frozen=True, slots=True)
class Undoing:
    """How a log is searched for a discrete effect, and freed of it.

    tried: by sensor, the values of its one parameter, in this order.
    mend: a sensor's columns as they should be, of the columns, the sensor and the value: antenna
    in NED (n, 3), or roll, pitch, yaw (n, 3), or azimuth, elevation (n, 2); None: the positions'
    stamps are ahead by the value [s], and rows are paired anew.
    instead_of: the effect that at such a value is this one, a latency of whole seconds.
    """

    tried: Mapping[ActsOn, tuple[str | float, ...]]
    mend: Callable[[Array, ActsOn, str], Array] | None = None
    instead_of: str = ""


@dataclass(frozen=True, slots=True)
class Effect:
    """One physical effect.

    kind: deterministic (a departure given the rows), stochastic (a departure drawn anew, seen as
    covariance) or discrete (a convention; re-simulated, never linearised).
    depart: exact departures; stochastic effects draw from the generator they are given.
    sensitivity: (n, 3, p) slope of the (mean) error [m], NED, by each parameter that is neither
    located nor discrete, at zero of these; None where the mean does not move.
    contribute: what it adds to the Syncline of a stage.
    spread: white noise along the motion, (n, 3, k): covariance spread spread' [m2] per row.
    applies: whether a stage can have it.
    tilted: acts by roll and pitch, which the simulator then draws over the horizon's tilt.
    transponder: as an effect of the position, acts on a later stage's transponder too, which has
    a place but neither stamps nor noise of its own.
    accelerated: acts by acceleration, and is charged for that of the platform's hardest turn.
    unbudgeted: why the Syncline cannot charge it with these values, and the way out; "" if it can.
    follows: whose measured values its size follows, the heading or the load (the specific force
    that comes of roll and pitch); a log shows it only where these vary by far more than their own
    noise, which otherwise passes for it (errors in variables).
    rarity: where two effects fit a log equally well, the one that is met more often is named, the
    one of the lower figure, and the other listed as its alias; the order is ours, by judgement.
    opens: which of a log's noise a stochastic one sets free: the "factor" of its sensor, the "slow"
    noise of its sensor or its "down" part alone, the "size" of its own scatter, the "tails", or the
    white noise of its sensor for an "episode".  undoing: a discrete one's.
    bounded_by_k: charged with k times its standard deviation, k the coverage factor.
    memory: the parameter that is the time constant of what it remembers, "" of one without memory.
    passing: may come and go while a system is at work; what is built in acts all along.
    breaks: which assumption on a built system it breaks; `noise`: that the sensor is as its figure.
    comes_with: what it goes away with: another way of stamping, another sensor, or neither, where
    it hangs on the mounting, the site or the processing.
    grows: with the time since the start, so that a longer log shows a smaller one.
    asked_in_stretches: a built system's log is asked for it from any stamp to any other.
    asked_jointly: it is left free where a built system's log is asked for what undoes another; of
    those that break one assumption, one a sensor.
    sentence: a format string over {sensor} and the parameters; reverse: of a first one below zero.
    constant: of its first slopes the readings (sensor, axis) whose errors they are, never changing.
    brief: of noise, the same in a few words, in parts; one whose parameter is 0 falls away.
    commissioned: of which sensors a first drive is asked for it, where nothing else is said.
    implied: no spec lists it; it follows from how often and by what a system measures.
    """

    name: str
    sensors: tuple[ActsOn, ...]
    kind: Literal["deterministic", "stochastic", "discrete"]
    parameters: tuple[Parameter, ...]
    sentence: str
    confused_with: str
    separated_by: str
    source: str
    depart: Depart
    sensitivity: Sensitivity | None
    contribute: Contribute
    spread: Spread | None = None
    applies: Applies = everywhere
    tilted: bool = False
    transponder: bool = False
    accelerated: bool = False
    unbudgeted: Unbudgeted = always_budgeted
    follows: Literal["", "heading", "load"] = ""
    rarity: int = SELDOM
    opens: Opening = ""
    undoing: Undoing | None = None
    bounded_by_k: bool = False
    memory: str = ""
    passing: bool = False
    breaks: Promise = "noise"
    comes_with: Origin = "build"
    grows: bool = False
    asked_in_stretches: bool = False
    asked_jointly: bool = False
    brief: tuple[str, ...] = ()
    commissioned: tuple[ActsOn, ...] = ()
    implied: bool = False
    reverse: str = ""
    constant: tuple[tuple[RoleName, int], ...] = ()

    @property
    def wanders(self) -> bool:
        """Whether it is noise that is correlated in time."""
        return self.opens in ("slow", "down")

    @property
    def delays(self) -> bool:
        """Whether it makes a sensor late, which shows only where something moves."""
        return self.breaks == "latency"

    def misfits(self, sensor: str, values: Mapping[str, float | str]) -> Iterator[Misfit]:
        """Why the effect cannot act so on a sensor, with these parameters."""
        if sensor not in self.sensors:
            message = f"{self.name} does not act on this sensor"
            yield Misfit(("sensor",), message, sensor, self.sensors)
        names = tuple(parameter.name for parameter in self.parameters)
        for name in values:
            if name not in names:
                yield Misfit(("parameters", name), "unknown parameter", name, names)
        for one in self.parameters:
            if one.name not in values:
                yield Misfit(("parameters",), f"missing parameter {one.name}", "", (one.name,))
            elif wrong := one.misfit(values[one.name], sensor):
                wanted = one.choices_of(sensor) or (one.domain,)
                yield Misfit(("parameters", one.name), wrong, str(values[one.name]), wanted)

    def in_words(self, sensor: str, shown: Mapping[str, str]) -> str:
        """The effect in one sentence; shown: its parameters as text, with units."""
        first = self.parameters[0].name
        if self.reverse and shown[first].startswith("-"):
            return self.reverse.format(sensor=sensor, **{**shown, first: shown[first][1:]})
        return self.sentence.format(sensor=sensor, **shown)

    def slopes(self) -> tuple[Parameter, ...]:
        """The parameters that `sensitivity` has a column for."""
        return tuple(p for p in self.parameters if not p.located and not p.choices)
