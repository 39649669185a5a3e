"""The certified worst case worked out by hand: every bound of `simulation.bounds` in numbers.

The formulas are those of docs/simulation.md, with sensors at k standard deviations and each pair's
shift between the ends of its own timestamps.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

from syncline_design.effects.acting import Acting, known_of, stage_contributions
from syncline_design.effects.record import Contribution
from syncline_design.effects.underway import OF_CAUSE
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import to_digits
from syncline_design.model.lever_arms import arm_difference, position_lever_arm
from syncline_design.model.pairing import distance_m
from syncline_design.model.roles import RoleName
from syncline_design.model.system import UTC, Sensor, Stage, System
from syncline_design.model.timing import Constant, Empirical, Normal, TimingError, Uniform, mean
from syncline_design.model.underway import underway
from syncline_design.simulation.bounds import azimuth_apart, near_share
from syncline_design.simulation.figures import with_sensors_at
from syncline_design.verdict.explain_shared import Worked, apart
from syncline_design.verdict.explain_sheet import (
    Calculation,
    between_rows,
    chord,
    number,
    root_of_squares,
    suffixes,
    total,
)
from syncline_design.verdict.named import ExplainedStep

_HALF_PI = repr(0.5 * math.pi)
Value = Callable[[Contribution], float]


def certificate(worked: Worked, system: System, last: str) -> tuple[ExplainedStep, ...]:
    """The certified worst case of a system, whose last stage stands at one distance."""
    sheet = Calculation()
    sheet.given(
        "k", "coverage_factor: standard deviations of every sensor", system.coverage_factor, "1"
    )
    scaled = with_sensors_at(system, system.coverage_factor)
    bounds = [
        _stage(_At(sheet, worked, system, scaled, index, name))
        for index, name in enumerate(suffixes(system))
    ]
    sheet.line(last, "sum over stages of the bounds", total(bounds))
    return sheet.leading_to(last)


@dataclass(frozen=True, slots=True)
class _At:
    """One stage on the sheet; scaled: the system with its sensors at k standard deviations."""

    sheet: Calculation
    worked: Worked
    system: System
    scaled: System
    index: int
    suffix: str

    @property
    def stage(self) -> Stage:
        return self.system.stages[self.index]

    @property
    def before(self) -> Stage | None:
        """The stage that locates this one, if any."""
        return self.system.stages[self.index - 1] if self.index else None

    def line(self, what: str, formula: str, numbers: str, unit: str = "m", source: str = "") -> str:
        return self.sheet.line(f"{what}_{self.suffix}", formula, numbers, unit, source)


def _stage(at: _At) -> str:
    """One stage's bound; its name."""
    stage, platform = at.stage, at.stage.platform
    v = at.line("v_max", "of the platform", number(platform.v_max_mps), "m/s")
    w = at.line("omega_max", "of the platform", number(platform.omega_max_radps), "rad/s")
    shift, added = _shift(at, "position"), _added_shift(at, "position")
    arm = _antenna(at)
    parts = [f"{v} * ({shift} + {added})"]
    if stage.position is not None:
        parts.append(at.line("sigma_p", "k |(s_north, s_east, s_down)|",
                             f"k * {root_of_squares(stage.position.sigma)}", "m",
                             at.worked.of(stage.position)))  # fmt: skip
    parts += _effects(at, "displaced", "what known effects displace by at most",
                      lambda what: what.systematic_m, "m", _stretched(at))  # fmt: skip
    moved = at.line("moved", "v (shift + added) + k sigma_p + effects", total(parts))
    turned = at.line(
        "antenna", "(chord(omega shift) + chord(omega added)) |l_G|",
        f"({chord(f'{w} * {shift}')} + {chord(f'{w} * {added}')}) * {arm}",
    )  # fmt: skip
    if stage.ranging is None or stage.attitude is None:
        return at.line("bound", "moved + antenna", f"{moved} + {turned}")
    seen = _seen(at, w)
    alone, beside = _apart(at, w, arm, added)
    return at.line("bound", "moved + the smaller of antenna + sight, alone + sight_3",
                   f"{moved} + min({turned} + {seen}, {alone} + {beside})")  # fmt: skip


def _apart(at: _At, w: str, arm: str, added: str) -> tuple[str, str]:
    """The antenna's arm on its own, turned by how far position and attitude are apart; the rest."""
    assert at.stage.ranging is not None
    name = at.suffix
    between = _shift(at, "position", at.stage.attitude)
    turn = f"{w} * ({between} - shift_attitude_{name}) + a_{name}"
    alone = at.line(
        "alone", "chord(omega (shift_between - shift_attitude) + a) |l_G| + chord(omega added) "
        "|l_G|: the ranging sensor's stamp does not matter to it",
        f"({chord(turn)} + {chord(f'{w} * {added}')}) * {arm}",
    )  # fmt: skip
    other = at.stage.ranging.lever_arm_m or (0.0, 0.0, 0.0)
    beside = at.line(
        "sight_3", "chord(a) |l_L| + the root of sight_1",
        f"{chord(f'a_{name}')} * {root_of_squares(other)} + cosines_{name}",
    )  # fmt: skip
    return alone, beside


def _antenna(at: _At) -> str:
    """|l_G|, given or of the baseline's length in any direction."""
    given = position_lever_arm(at.stage, at.index == 0)
    if given is None:
        length = number(at.stage.platform.baseline_m)
        return at.line("l_G", "baseline: a lever arm that is not given, in any direction", length)
    return at.line("l_G", "length of the position's lever arm", root_of_squares(given))


def _seen(at: _At, w: str) -> str:
    """What attitude, bearing and range move the object by: the smaller of two bounds."""
    stage, worked = at.stage, at.worked
    assert stage.attitude is not None
    assert stage.ranging is not None
    d = at.line("d", "distance of the object, the farthest", number(stage.platform.distance_m))
    euler = [f"k * {root_of_squares(stage.attitude.sigma)}"]
    euler += _effects(at, "scatter", "what known effects add to the noise of roll, pitch, yaw",
                      lambda what: what.turn_rad, "rad", only=_scatters)  # fmt: skip
    sigma_a = at.line("sigma_Theta", "k |(s_roll, s_pitch, s_yaw)| + effects", total(euler), "rad",
                      worked.of(stage.attitude))  # fmt: skip
    angles = stage.ranging.sigma[1:]
    source = worked.of(stage.ranging)
    sigma_r = at.line("sigma_r", f"k s_range{_hangs_on(stage.ranging)}",
                      f"k * {_at_d(stage.ranging, d, at)}", "m", source)  # fmt: skip
    sight = [f"k * {root_of_squares(angles)}"]
    sight += _effects(at, "bent", "what known effects turn the line of sight by at most",
                      lambda what: what.sight_rad, "rad")  # fmt: skip
    sigma_u = at.line("sigma_u", "k |(s_azimuth, s_elevation)| + effects", total(sight), "rad",
                      source)  # fmt: skip
    turn = [f"{w} * ({_shift(at, 'attitude')} + {_added_shift(at, 'attitude')})"]
    turn += _effects(at, "turned", "what known effects turn the measured attitude by at most",
                     lambda what: what.turn_rad, "rad", only=_turns)  # fmt: skip
    turned = at.line("turn", "omega (shift + added) + effects", total(turn), "rad")
    return _swing(at, d, (turned, sigma_a, sigma_u, sigma_r))


def _at_d(ranging: Sensor, d: str, at: _At) -> str:
    """s_range at d: between two rows of its table, if it has one."""
    sigma = float(ranging.sigma[0])
    return between_rows(ranging.range_shape, sigma, at.sheet.known[d], d) or number(sigma)


def _hangs_on(ranging: Sensor) -> str:
    if ranging.range_shape:
        return ", by range, at d"
    return ", by beam angle, the worst that is looked at" if ranging.range_by_beam else ""


def _swing(at: _At, d: str, errors: tuple[str, str, str, str]) -> str:
    """min of: arms and sight apart, or turned as a whole; both by the law of cosines."""
    turned, sigma_a, sigma_u, sigma_r = errors
    tilt = at.line("tilt", "horizon.tilt", number(at.system.horizon.tilt_rad), "rad")
    leans = f"{tilt} + {turned} + {sigma_a}"
    pitch = at.line("pitch", "tilt + turn + sigma_Theta, at most pi/2",
                    f"min({leans}, {_HALF_PI})", "rad")  # fmt: skip
    grown = f"sqrt(1 + sin({pitch}))"
    off = at.line("a", "turn + sigma_Theta sqrt(1 + sin pitch): how far the attitude is off",
                  f"{turned} + {sigma_a} * {grown}", "rad")  # fmt: skip
    swung = at.line("a_sight", "the same for the line of sight, near the vertical less",
                    f"{turned} + {sigma_a} * {_growth(at, grown, leans)}", "rad")  # fmt: skip
    lever = _difference(at)
    cosines = "sqrt({r}**2 + {d} * ({d} + {r}) * ({swing})**2)"
    sight = at.line(
        "cosines", "law of cosines by a_sight + sigma_u, range longer by sigma_r",
        cosines.format(r=sigma_r, d=d, swing=chord(f"({swung} + {sigma_u})")),
    )  # fmt: skip
    apart_ = at.line("sight_1", "chord(a) |l_L - l_G| + law of cosines by a_sight + sigma_u",
                     f"{chord(off)} * {lever} + {sight}")  # fmt: skip
    whole = at.line(
        "sight_2", "chord(a) largest |l_L - l_G + d n| + law of cosines by sigma_u",
        f"{chord(off)} * {_longest(at, d, lever)} + "
        + cosines.format(r=sigma_r, d=d, swing=chord(sigma_u)),
    )  # fmt: skip
    return at.line("sight", "the smaller of both bounds", f"min({apart_}, {whole})")


def _growth(at: _At, grown: str, leans: str) -> str:
    """sqrt(1 + sin pitch), for sights at most g from the vertical at most sqrt(1 + sin(g)^2)."""
    look = at.stage.look
    if look is None or look.elevation is None:
        return grown
    low, high = look.elevation
    steepness = 0.0 if low <= 0.0 <= high else min(abs(low), abs(high))
    g = at.line("g", "from the vertical a line of sight is at most, leans included",
                f"min({_HALF_PI} - {number(steepness)} + sqrt(2) * ({leans}), {_HALF_PI})",
                "rad")  # fmt: skip
    return f"min({grown}, sqrt(1 + sin({g})**2))"


def _difference(at: _At) -> str:
    """|l_L - l_G|, at most."""
    vector = arm_difference(at.stage, at.index == 0)
    if vector is not None:
        return at.line("l", "length of l_L - l_G", root_of_squares(vector))
    assert at.stage.ranging is not None
    other = at.stage.ranging.lever_arm_m or (0.0, 0.0, 0.0)
    return at.line("l", "|l_G| + |l_L|", f"l_G_{at.suffix} + {root_of_squares(other)}")


def _longest(at: _At, d: str, lever: str) -> str:
    """Largest |l_L - l_G + d n| over the lines of sight."""
    stage, vector = at.stage, arm_difference(at.stage, at.index == 0)
    if stage.look is None or vector is None:
        return f"({d} + {lever})"
    x, y, z = vector
    level = math.hypot(x, y) * math.cos(azimuth_apart(stage.look, math.atan2(y, x)))
    low, high = stage.look.elevation or (-0.5 * math.pi, 0.5 * math.pi)
    best = min(max(math.atan2(-z, level), low), high)
    level_name = at.line("l_ahead", "level part of l_L - l_G towards the nearest azimuth looked at",
                         number(level))  # fmt: skip
    along = ", ".join(
        f"{level_name} * cos({number(e)}) - {number(z)} * sin({number(e)})"
        for e in dict.fromkeys((low, high, best))
    )
    along = f"max({along})" if low != high else along
    name = at.line("l_along", "of l_L - l_G along a line of sight, at most", along)
    return at.line("longest", "largest |l_L - l_G + d n|",
                   f"sqrt(max({lever}**2 + {d}**2 + 2 * {d} * {name}, 0.0))")  # fmt: skip


def _shift(at: _At, role: RoleName, against: Sensor | None = None) -> str:
    """Largest |m_i - m_ref|, end against end; the reference is the ranging sensor if not given."""
    stage, reference = at.stage, against or at.stage.ranging
    owner: tuple[Stage, Sensor | None, str] = (stage, getattr(stage, role), at.suffix)
    if role == "position" and at.before is not None:
        owner = (at.before, at.before.ranging, suffixes(at.system)[at.index - 1])
    name, formula = f"shift_{role}", "largest difference of both stamps, end against end"
    if against is not None:
        name, formula = "shift_between", f"the same of {role} and attitude"
    if owner[1] is None:
        return at.line(name, "no such sensor", "0.0", "s")
    offsets = owner[1].timeline != (UTC if reference is None else reference.timeline)
    low, high = _span(at, owner[1], owner[0], owner[2], offsets)
    if reference is None:
        formula = "largest error of the stamp against true time"
        return at.line(name, formula, f"max(abs({low}), abs({high}))", "s")
    least, most = _span(at, reference, stage, at.suffix, offsets)
    numbers = f"max(abs({low} - {most}), abs({high} - {least}))"
    return at.line(name, formula, numbers, "s")


def _span(at: _At, sensor: Sensor, stage: Stage, suffix: str, offsets: bool) -> tuple[str, str]:
    """Names of (earliest, latest) shift of a sensor, against its timeline or true time."""
    k = at.system.coverage_factor
    role = sensor.role
    source = at.worked.stamped(stage, role)
    (formula, low), (_, high) = _ends(sensor.timing, k)
    kind = ""
    if offsets and sensor.timeline != UTC:
        kind = "_utc"
        (_, behind), (_, ahead) = _ends(at.system.clock_offset(sensor.timeline), k)
        low, high = f"{low} - ({ahead})", f"{high} - ({behind})"
        formula += ", less the host clock's offset"
    names = (f"low_{role}{kind}_{suffix}", f"high_{role}{kind}_{suffix}")
    at.sheet.line(names[0], f"least timestamp error: {formula}", low, "s", source)
    at.sheet.line(names[1], f"largest timestamp error: {formula}", high, "s", source)
    return names


def _ends(error: TimingError, k: float) -> tuple[tuple[str, str], tuple[str, str]]:
    """((words, least), (words, largest)) of a timestamp error."""
    extra = [("what its calibration leaves", error.calibrated_s or 0.0),
             ("drift x holdover", error.drifted_s)]  # fmt: skip
    if error.bound_s is not None:
        words, low, high = "bound", number(-error.bound_s), number(error.bound_s)
        extra = extra[1:]
    else:
        match error.distribution:
            case Uniform(least, most):
                words, low, high = "end", number(least), number(most)
            case Normal(middle, std):
                words = f"mean and {to_digits(k)} std"
                low, high = (
                    f"{number(middle)} {sign} {number(k)} * {number(std)}" for sign in "-+"
                )
            case Constant(value):
                words, low, high = "constant", number(value), number(value)
            case Empirical(values):
                words, low, high = "measured", number(min(values)), number(max(values))
        if error.calibrated_s is not None:
            middle = mean(error.distribution)
            words += ", less the mean"
            low, high = f"{low} - {number(middle)}", f"{high} - {number(middle)}"
    for told, size in extra:
        if size:
            words, low, high = (
                f"{words}, {told}",
                f"{low} - {number(size)}",
                f"{high} + {number(size)}",
            )
    return (words, low), (words, high)


def _added_shift(at: _At, role: RoleName) -> str:
    """What known effects and sound under way add to a shift."""
    known, stage = known_of(at.scaled).extra_tau_s, at.stage
    own: tuple[str, RoleName] = (stage.name, role)
    if role == "position" and at.before is not None:
        own = (at.before.name, "ranging")
    keys = [own] if stage.ranging is None else [own, (stage.name, "ranging")]
    parts = [number(known[key]) for key in keys if known.get(key)]
    later = list(_numbers(at, at.index, lambda what: what.shift_s))
    relayed: list[str] = []
    if role == "position" and at.before is not None:
        relayed = list(_numbers(at, at.index - 1, lambda what: what.relayed_s))
    parts += _net(at, total(later), total(relayed)) if relayed else later
    formula = "what known effects and sound under way add to it"
    return at.line(f"added_{role}", formula, total(parts), "s")


def _net(at: _At, later: str, relayed: str) -> list[str]:
    """The stage's own 2 r / c less that of the fix, at the ends of both distances."""
    assert at.before is not None
    own, fixed = number(near_share(at.stage)), number(near_share(at.before))
    return [f"max(abs(({later}) * {own} - ({relayed})), abs({later} - ({relayed}) * {fixed}))"]


def _scatters(one: Acting) -> bool:
    return one.effect.kind == "stochastic" and not one.effect.implied


def _turns(one: Acting) -> bool:
    return not _scatters(one)


def _stretched(at: _At) -> Callable[[Acting], str]:
    """What moves the measured object at d moves it by s_r / d more with range noise."""
    stage = at.stage
    d = distance_m(stage)
    d = d if stage.platform.nearest_m is None else float(stage.platform.nearest_m)
    if stage.ranging is None or not d > 0.0:
        return lambda _: ""
    more = f" * (1 + k * {number(stage.ranging.sigma[0])} / {number(d)})"
    return lambda one: more if one.sensor == "ranging" else ""


def _effects(
    at: _At,
    what: str,
    formula: str,
    value: Value,
    unit: str,
    times: Callable[[Acting], str] = lambda _: "",
    only: Callable[[Acting], bool] = lambda _: True,
) -> list[str]:
    """One line for what the effects of a stage add somewhere; nothing where they do not."""
    parts = list(_numbers(at, at.index, value, times, only))
    if not parts:
        return []
    told = ", ".join(
        dict.fromkeys(one.effect.name for one, has in _contributed(at, at.index) if value(has)
                      and only(one))
    )  # fmt: skip
    return [at.line(what, f"{formula}: {told}", total(parts), unit)]


def _contributed(at: _At, index: int) -> tuple[tuple[Acting, Contribution], ...]:
    return stage_contributions(at.scaled, index)


def _numbers(
    at: _At,
    index: int,
    value: Value,
    times: Callable[[Acting], str] = lambda _: "",
    only: Callable[[Acting], bool] = lambda _: True,
) -> Iterator[str]:
    for one, what in _contributed(at, index):
        if value(what) and only(one):
            yield f"{_amount(at, index, one, value(what))}{times(one)}"


def _amount(at: _At, index: int, one: Acting, value: float) -> str:
    """A figure of an effect; of sound under way and interpolation from what it follows."""
    for each in underway(at.system):
        if each.stage != index or OF_CAUSE[each.cause] is not one.effect:
            continue
        platform = at.system.stages[index].platform
        if each.cause in ("travel", "object"):
            assert each.sensor.sound_mps is not None
            return f"2 * {number(distance_m(each.owner))} / {number(each.sensor.sound_mps)}"
        bends = (platform.acceleration_mps2 if each.cause == "path"
                 else platform.angular_acceleration_radps2)  # fmt: skip
        return f"{number(bends)} * ({apart(each)[1]})**2 / 8"
    return number(value)
