"""What each sensor and each timestamp does to the error in one situation, line by line.

To first order, as in `simulation.chain.noise_slopes` and `effects.kinematics`: with the attitude
R = Rz(yaw) Ry(pitch) Rx(roll), the lever q = l_L - l_G + d n and the axes of roll, pitch and yaw
  position: its own axes; attitude: axis x R q; range: R n; bearing: d R dn/d(azimuth, elevation);
  timestamps: V = R (v + w x l_G) of the position's, W = R (w x q) of the attitude's, -(V + W) of
  the ranging sensor's, whose stamp the next stage's position carries.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import field

from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.lever_arms import position_lever_arm
from syncline_design.model.roles import RoleName
from syncline_design.model.system import UTC, Sensor, Stage, System
from syncline_design.model.timing import (
    Constant,
    Empirical,
    Normal,
    TimingError,
    Uniform,
    expected,
)
from syncline_design.model.underway import Underway, underway
from syncline_design.simulation.composition import Composition
from syncline_design.simulation.draws import entering
from syncline_design.simulation.figures import StageSituation
from syncline_design.simulation.timing_variables import TimingVariable
from syncline_design.verdict.explain_shared import Worked, apart
from syncline_design.verdict.explain_sheet import (
    Calculation,
    between_rows,
    number,
    suffixes,
    total,
)

AxisLines = tuple[str, str, str]  # lines or terms, north, east, down (or x, y, z of the body)
NOTHING: AxisLines = ("", "", "")
_NED, _XYZ = "ned", "xyz"
_ROTATION: dict[str, str] = {
    "nx": "cos({p}) * cos({y})", "ex": "cos({p}) * sin({y})", "dx": "-sin({p})",
    "ny": "sin({r}) * sin({p}) * cos({y}) - cos({r}) * sin({y})",
    "ey": "sin({r}) * sin({p}) * sin({y}) + cos({r}) * cos({y})", "dy": "sin({r}) * cos({p})",
    "nz": "cos({r}) * sin({p}) * cos({y}) + sin({r}) * sin({y})",
    "ez": "cos({r}) * sin({p}) * sin({y}) - sin({r}) * cos({y})", "dz": "cos({r}) * cos({p})",
}  # fmt: skip
_UNITS = {"position": "m", "attitude": "rad"}
# share 4 u (1 - u) of the largest departure, u uniform between two samples: mean and deviation
_MEAN_SHARE, _STD_SHARE = "2 / 3", "sqrt(4 / 45)"


def moved_by(
    sheet: Calculation, worked: Worked, system: System, found: Composition
) -> tuple[AxisLines, list[AxisLines]]:
    """(mean error in writing, lines of what one standard deviation of each source does)."""
    stages = [
        _At(sheet, worked, system, found, index, name)
        for index, name in enumerate(suffixes(system))
    ]
    columns: list[AxisLines] = []
    means: list[AxisLines] = []
    for at in stages:
        at.place()
        columns += at.noise()
    rates = _rates(stages)
    for number_, variable in enumerate(found.timing.variables, 1):
        columns.append(_stamp(sheet, worked, system, number_, variable, rates))
    means += _late(sheet, worked, system, rates)
    for one in underway(system):
        mean, column = _underway(stages, one)
        means.append(mean)
        columns.append(column)
    for place, (source, vector) in enumerate(found.displaced, 1):
        about = f"{source}, displaces by"
        means.append(_numbers(sheet, f"effect_{place}", about, vector))
    for place, (source, vector) in enumerate(found.scattered, 1):
        about = f"{source}, one standard deviation"
        columns.append(_numbers(sheet, f"scatter_{place}", about, vector))
    north, east, down = (total([mean[k] for mean in means if mean[k]]) for k in range(3))
    return (north, east, down), columns


def _numbers(sheet: Calculation, name: str, about: str, vector: Sequence[float]) -> AxisLines:
    return _each(
        sheet.given(f"{name}_{axis}", f"{about}, {_long(axis)}", value) if value else ""
        for axis, value in zip(_NED, vector, strict=True)
    )


def _each(names: Iterator[str]) -> AxisLines:
    north, east, down = names
    return north, east, down


def _long(axis: str) -> str:
    return {"n": "north", "e": "east", "d": "down"}[axis]


@dataclass
class _At:
    """One stage on the sheet."""

    sheet: Calculation
    worked: Worked
    system: System
    found: Composition
    index: int
    suffix: str
    lines: dict[str, AxisLines] = field(default_factory=dict)

    @property
    def stage(self) -> Stage:
        return self.system.stages[self.index]

    @property
    def here(self) -> StageSituation:
        return self.found.stages[self.index]

    def line(self, what: str, formula: str, numbers: str, unit: str = "m", source: str = "") -> str:
        return self.sheet.line(f"{what}_{self.suffix}", formula, numbers, unit, source)

    def name(self, what: str) -> str:
        return f"{what}_{self.suffix}"

    def body(self, what: str, formula: str, numbers: Sequence[str], unit: str) -> AxisLines:
        """Three lines in the body's axes."""
        return _each(
            self.line(f"{what}_{axis}", f"{formula}, {axis}", one, unit)
            for axis, one in zip(_XYZ, numbers, strict=True)
        )

    def level(self, what: str, formula: str, vector: AxisLines, unit: str) -> AxisLines:
        """R times a vector of the body: three lines north, east, down."""
        return _each(
            self.line(
                f"{what}_{axis}", f"{formula}, {_long(axis)}", self._turned(axis, vector), unit
            )
            for axis in _NED
        )

    def _turned(self, axis: str, vector: Sequence[str]) -> str:
        """One row of R times a vector."""
        row = (self.name(f"R_{axis}{k}") for k in _XYZ)
        return total(f"{entry} * {one}" for entry, one in zip(row, vector, strict=True))

    def place(self) -> None:
        """How the vehicle lies, moves and looks where the figure is largest."""
        here, platform = self.here, self.stage.platform
        angles = {
            "r": self.line("roll", "in the situation that is worst", number(here.roll_rad), "rad"),
            "p": self.line(
                "pitch", "in the situation that is worst", number(here.pitch_rad), "rad"
            ),
            "y": self.line("yaw", "in the situation that is worst", number(here.yaw_rad), "rad"),
        }
        for entry, formula in _ROTATION.items():
            about = f"of R = Rz(yaw) Ry(pitch) Rx(roll): {entry[1]} of the body, {_long(entry[0])}"
            self.line(f"R_{entry}", about, formula.format(**angles), "1")
        v = self._directed("v", "v_max", platform.v_max_mps, here.velocity_mps, "m/s")
        w = self._directed("w", "omega_max", platform.omega_max_radps, here.rate_radps, "rad/s")
        arm = self._antenna()
        inner = [f"{v[i]} + {w[j]} * {arm[k]} - {w[k]} * {arm[j]}"
                 for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1))]  # fmt: skip
        antenna = self.body("V", "v + w x l_G", inner, "m/s")
        self.lines["V"] = self.level("V", "R (v + w x l_G), the antenna moves", antenna, "m/s")
        if self.stage.ranging is not None:
            self._look(w, arm)

    def _directed(
        self, what: str, limit: str, most: float, vector: Sequence[float], unit: str
    ) -> AxisLines:
        """A vector of the largest length in its direction."""
        size = float(most)
        parts = [one / size if size else 0.0 for one in vector]
        return self.body(what, f"{limit} x direction", [f"{number(size)} * {number(one)}"
                                                        for one in parts], unit)  # fmt: skip

    def _antenna(self) -> AxisLines:
        """l_G."""
        given = position_lever_arm(self.stage, self.index == 0)
        if given is None:
            free = self.here.position_arm_m or (0.0, 0.0, 0.0)
            about = "lever arm of the position, not given: baseline long, in the worst direction"
            return self.body("l_G", about, [number(one) for one in free], "m")
        return self.body("l_G", "lever arm of the position", [number(one) for one in given], "m")

    def _look(self, w: AxisLines, arm: AxisLines) -> None:
        """The line of sight n, the lever q and what a turning vehicle sweeps."""
        here, ranging = self.here, self.stage.ranging
        assert here.look is not None
        assert ranging is not None
        away = here.distance_m
        away = float(self.stage.platform.distance_m) if away is None else away
        d = self.line("d", "distance of the object", number(away))
        n = self.body("look", "line of sight n", [number(one) for one in here.look], "1")
        own = ranging.lever_arm_m or (0.0, 0.0, 0.0)
        levers = [f"{number(a)} - {b} + {d} * {c}" for a, b, c in zip(own, arm, n, strict=True)]
        q = self.body("q", "l_L - l_G + d n", levers, "m")
        turned = [f"{w[j]} * {q[k]} - {w[k]} * {q[j]}" for j, k in ((1, 2), (2, 0), (0, 1))]
        sweep = self.body("W", "w x q", turned, "m/s")
        self.lines["W"] = self.level("W", "R (w x q), the lever sweeps", sweep, "m/s")
        self.lines["q"] = self.level("q", "R q", q, "m")
        self.lines["n"] = n

    def noise(self) -> list[AxisLines]:
        """What one standard deviation of each of the stage's sensors does, axis by axis."""
        found: list[AxisLines] = []
        stage = self.stage
        if stage.position is not None:
            found += self._position(stage.position)
        if stage.ranging is not None and stage.attitude is not None:
            found += self._attitude(stage.attitude)
            found += self._ranging(stage.ranging)
        return found

    def _sigma(self, sensor: Sensor, what: str, place: int, share: float = 1.0) -> str:
        """One standard deviation's line, grown by effects where they do; "" of none."""
        value = float(sensor.sigma[place])
        if not value:
            return ""
        numbers, formula = number(value), f"one standard deviation of {sensor.role}, {what}"
        rows = self._of_table(sensor, place, value)
        if rows:
            numbers, formula = rows, f"{formula}, between two rows of its table"
        elif share != 1.0:
            numbers, formula = f"{numbers} * {number(share)}", f"{formula}, here"
        times = self.found.growth.get((self.index, sensor.role))
        if times is not None:
            numbers = f"{numbers} * {number(times)}"
            formula += " x what known effects make of it"
        unit = _UNITS.get(sensor.role, "rad" if place else "m")
        return self.line(f"s_{what}", formula, numbers, unit, self.worked.of(sensor))

    def _of_table(self, sensor: Sensor, place: int, sigma: float) -> str:
        """A deviation from the rows of its table, by range or by the beam's angle; "" without."""
        if sensor.role != "ranging":
            return ""
        if place == 0 and sensor.range_shape:
            d = self.name("d")
            return between_rows(sensor.range_shape, sigma, self.sheet.known[d], d)
        shape = sensor.bearing_by_beam if place else sensor.range_by_beam
        if not shape:
            return ""
        down = min(max(self.sheet.known[self.lines["n"][2]], -1.0), 1.0)
        beam = self.line("beam", "of n from straight down: its cosine is look_z",
                         number(math.acos(down)), "rad")  # fmt: skip
        return between_rows(shape, sigma, self.sheet.known[beam], beam)

    def _position(self, sensor: Sensor) -> Iterator[AxisLines]:
        for place, axis in enumerate(_NED):
            sigma = self._sigma(sensor, _long(axis), place)
            if sigma:
                yield _each(sigma if axis == other else "" for other in _NED)

    def _attitude(self, sensor: Sensor) -> Iterator[AxisLines]:
        """axis x R q: of roll the body's x, of pitch level and across the heading, of yaw down."""
        q, yaw = self.lines["q"], self.name("yaw")
        x = [self.name(f"R_{axis}x") for axis in _NED]
        turns = {
            "roll": [f"({x[j]} * {q[k]} - {x[k]} * {q[j]})" for j, k in ((1, 2), (2, 0), (0, 1))],
            "pitch": [f"cos({yaw}) * {q[2]}", f"sin({yaw}) * {q[2]}",
                      f"(-sin({yaw}) * {q[1]} - cos({yaw}) * {q[0]})"],
            "yaw": [f"(-{q[1]})", q[0], ""],
        }  # fmt: skip
        for place, (what, parts) in enumerate(turns.items()):
            sigma = self._sigma(sensor, what, place)
            if sigma:
                yield self._times(what, f"{what} noise moves the object", sigma, parts)

    def _times(self, what: str, formula: str, sigma: str, parts: Sequence[str]) -> AxisLines:
        return _each(
            self.line(f"by_{what}_{axis}", f"{formula} {_long(axis)}", f"{sigma} * {part}")
            if part else ""
            for axis, part in zip(_NED, parts, strict=True)
        )  # fmt: skip

    def _ranging(self, sensor: Sensor) -> Iterator[AxisLines]:
        """R n of the range, d R dn/d(azimuth, elevation) of the bearing."""
        n, d = self.lines["n"], self.name("d")
        here = self.found.shares[self.index]
        flat = self.line("look_level", "level part of n", f"sqrt({n[0]}**2 + {n[1]}**2)", "1")
        ahead, aside = f"{n[0]} / {flat}", f"{n[1]} / {flat}"
        if not self.sheet.known[flat] > 0.0:  # straight up or down: its azimuth counts as 0
            ahead, aside = "1.0", "0.0"
        slopes = {
            "range": n,
            "azimuth": (f"(-{n[1]})", n[0], "0.0"),
            "elevation": (f"{ahead} * {n[2]}", f"{aside} * {n[2]}", f"(-{flat})"),
        }
        for place, (what, slope) in enumerate(slopes.items()):
            sigma = self._sigma(sensor, what, place, here[place])
            if not sigma:
                continue
            far = "" if what == "range" else f"{d} * "
            parts = [f"{far}({self._turned(axis, slope)})" for axis in _NED]
            yield self._times(what, f"{what} noise moves the object", sigma, parts)


Rates = dict[
    tuple[str, RoleName], list[tuple[int, str]]
]  # of a sensor: (sign, line with {axis} left open)


def _rates(stages: Sequence[_At]) -> Rates:
    """How fast each sensor's stamp moves the error: sums of V and W of the stages."""
    found: Rates = {}

    def add(stage: Stage, role: RoleName, sign: int, what: str, at: _At) -> None:
        found.setdefault((stage.name, role), []).append((sign, f"{what}_{{}}_{at.suffix}"))

    for at in stages:
        owner, role = (at.stage, "position") if not at.index else (
            stages[at.index - 1].stage, "ranging"
        )  # fmt: skip
        add(owner, role, 1, "V", at)  # type: ignore[arg-type]
        if at.stage.ranging is None:
            continue
        add(at.stage, "attitude", 1, "W", at)
        add(at.stage, "ranging", -1, "V", at)
        add(at.stage, "ranging", -1, "W", at)
    return found


def _along(rates: Rates, keys: Sequence[tuple[str, RoleName]], axis: str) -> str:
    """The sum of some sensors' rates along an axis, what cancels left out; "" of nothing."""
    summed: dict[str, int] = {}
    for key in keys:
        for sign, what in rates.get(key, ()):
            summed[what] = summed.get(what, 0) + sign
    times = {1: "", -1: "-"}
    left = [
        f"{times.get(many, f'{many} * ')}{what.format(axis)}"
        for what, many in summed.items()
        if many
    ]
    return total(left) if left else ""


def _stamp(
    sheet: Calculation,
    worked: Worked,
    system: System,
    place: int,
    variable: TimingVariable,
    rates: Rates,
) -> AxisLines:
    """What one standard deviation of a timing variable does."""
    source = ""
    if len(variable.moves) == 1:
        name, role = variable.moves[0]
        stage = next(one for one in system.stages if one.name == name)
        source = worked.stamped(stage, role)
    match variable.centred:
        case Uniform(low, high):
            words = "uniform: width / sqrt(12)"
            numbers = f"({number(high)} - {number(low)}) / sqrt(12)"
        case Normal(_, own):
            words, numbers = "normal", number(own)
        case Empirical() | Constant():
            words, numbers = "of what was measured", number(variable.std_s)
    std = sheet.line(f"std_{place}", f"standard deviation of {variable.source}, {words}", numbers,
                     "s", source)  # fmt: skip
    parts = [(axis, _along(rates, variable.moves, axis)) for axis in _NED]
    return _each(
        sheet.line(f"by_stamp_{place}_{axis}", f"{variable.source} moves the object {_long(axis)}",
                   f"{std} * ({part})") if part else ""
        for axis, part in parts
    )  # fmt: skip


def _late(sheet: Calculation, worked: Worked, system: System, rates: Rates) -> Iterator[AxisLines]:
    """What sensors that are late or early on average displace."""
    for stage, suffix in zip(system.stages, suffixes(system), strict=True):
        for sensor in entering(stage):
            formula, numbers = _middle(sensor.timing)
            if sensor.timeline != UTC:
                offset = _middle(system.clock_offset(sensor.timeline))[1]
                if offset:
                    numbers = f"{numbers or '0.0'} - ({offset})"
                    formula = f"{formula}, less that of the host's clock"
            if not numbers:
                continue
            name = sheet.line(f"mu_{sensor.role}_{suffix}", f"mean timestamp error: {formula}",
                              numbers, "s", worked.stamped(stage, sensor.role))  # fmt: skip
            yield _each(_times_rate(name, _along(rates, [(stage.name, sensor.role)], axis))
                        for axis in _NED)  # fmt: skip


def _times_rate(name: str, rate: str) -> str:
    return f"{name} * ({rate})" if rate else ""


def _middle(error: TimingError) -> tuple[str, str]:
    """(words, numbers) of a mean that is left; "" of none."""
    if not expected(error):
        return "none", ""
    match error.distribution:
        case Uniform(low, high):
            return "(low + high) / 2", f"({number(low)} + {number(high)}) / 2"
        case _:
            return "mean", number(expected(error))


def _underway(stages: Sequence[_At], one: Underway) -> tuple[AxisLines, AxisLines]:
    """(mean, one standard deviation) of sound under way or of what is interpolated."""
    at = stages[one.stage]
    if one.cause in ("travel", "object"):
        return _echoed(stages, one), NOTHING
    source = at.worked.of(one.sensor)
    waits = at.line(f"T_{one.role}", *apart(one), "s", source)
    platform = at.stage.platform
    if one.cause == "path":
        bends, size = at.here.path_bends, number(platform.acceleration_mps2)
        most = at.line("path", "a_max T^2 / 8", f"{size} * {waits}**2 / 8")
        way = at.body("pull", "which way the path bends", [number(x) for x in bends or (0,) * 3],
                      "1")  # fmt: skip
        moved = at.level("pull", "R times it", way, "1")
    else:
        bends, size = at.here.turn_bends, number(platform.angular_acceleration_radps2)
        most = at.line("turns", "alpha_max T^2 / 8", f"{size} * {waits}**2 / 8", "rad")
        way = at.body("twist", "about which axis the turn departs",
                      [number(x) for x in bends or (0,) * 3], "1")  # fmt: skip
        q = _each(at.name(f"q_{axis}") for axis in _XYZ)
        inner = [f"{way[j]} * {q[k]} - {way[k]} * {q[j]}" for j, k in ((1, 2), (2, 0), (0, 1))]
        moved = at.level("twist", "R (axis x q)",
                         at.body("sway", "axis x q", inner, "m"), "m")  # fmt: skip
    mean = _each(f"{_MEAN_SHARE} * {most} * {part}" for part in moved)
    what = "path" if one.cause == "path" else "turn"
    column = _each(
        at.line(f"by_{what}_{axis}", f"interpolation, {_long(axis)}: sqrt(4/45) of its most",
                f"{_STD_SHARE} * {most} * {part}")
        for axis, part in zip(_NED, moved, strict=True)
    )  # fmt: skip
    return mean, column


def _echoed(stages: Sequence[_At], one: Underway) -> AxisLines:
    """What is late by 2 d / c."""
    at = stages[one.stage]
    assert one.sensor.sound_mps is not None
    echo = at.line("echo", "2 d / c: sound goes to the object and back",
                   f"2 * {at.name('d')} / {number(one.sensor.sound_mps)}", "s",
                   at.worked.of(one.sensor))  # fmt: skip
    if one.cause == "travel":
        return _each(f"{echo} * ({at.name(f'V_{axis}')} + {at.name(f'W_{axis}')})"
                     for axis in _NED)  # fmt: skip
    after = stages[one.stage + 1]
    return _each(f"-{echo} * {after.name(f'V_{axis}')}" for axis in _NED)
