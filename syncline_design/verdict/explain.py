"""A requirement worked out by hand: each figure as its formula with the numbers put in.

`numbers` is plain arithmetic in SI (+ - * / ** sqrt sin cos max min abs and brackets) whose value
is `value`, so that whoever checks can put it into a calculator; a name in it is an earlier step's.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

from syncline_design.effects.acting import known_of
from syncline_design.model import timing
from syncline_design.model.ends import at_ends, distances_of
from syncline_design.model.pairing import distance_m
from syncline_design.model.roles import RoleName
from syncline_design.model.system import UTC, Sensor, Stage, System
from syncline_design.model.timing import Constant, Empirical, Normal, TimingError, Uniform
from syncline_design.model.underway import Underway, underway
from syncline_design.spec.requirement import STATED_KINDS
from syncline_design.verdict.explain_figures import figure_steps
from syncline_design.verdict.explain_shared import Worked, apart
from syncline_design.verdict.named import ExplainedRequirement, ExplainedStep, NamedDesign
from syncline_design.verdict.tree import RequirementResult

# (relative bound, its rate in numbers, the rate [m/s], the steps before it) of one pair
Pair = tuple[ExplainedStep, str, float, list[ExplainedStep]]


def explained(
    worked: Worked, rows: Iterable[RequirementResult]
) -> tuple[ExplainedRequirement, ...]:
    """Requirements worked out by hand."""
    return tuple(
        ExplainedRequirement(
            row.id, row.kind, row.limit, row.unit, tuple(_steps(worked, row)), row.limit_written
        )
        for row in rows
    )


def _steps(worked: Worked, row: RequirementResult) -> Iterator[ExplainedStep]:
    if row.kind == "accuracy":
        yield from _error(worked)
    elif row.kind == "sync":
        yield from _ratios(worked)
    elif row.kind in ("cost", "mass", "power"):
        yield from _sum(worked, row)
    elif row.kind == "feasible" and row.value is not None:
        formula = f"entries that cannot work where they stand: {row.note}"
        each = " + ".join(["1"] * int(row.value))
        yield ExplainedStep(row.id, formula, each, row.value, row.unit)
    elif row.kind == "sample_spacing" and row.value is not None:
        formula = "largest v_max / rate over the ranging sensors, by sound v_max * 2 d / c"
        yield ExplainedStep(row.id, formula, _n(row.value), row.value, row.unit)
    elif row.kind in STATED_KINDS and row.value is not None:
        yield from figure_steps(worked, row)
    elif row.value is not None:
        formula = "quantile of |error| over the samples of the simulation"
        yield ExplainedStep(row.id, formula, _n(row.value), row.value, row.unit)


def _n(value: float) -> str:
    """A number as it is calculated with, in full."""
    return repr(float(value))


def _root(values: Iterable[float]) -> str:
    return f"sqrt({' + '.join(f'{_n(v)}**2' for v in values)})"


def _name(what: str, stage: Stage) -> str:
    return f"{what}_{stage.name}".replace("-", "_").replace(" ", "_")


def _sensor_steps(worked: Worked, stage: Stage, first: bool) -> list[ExplainedStep]:
    """The terms of one stage's sensor error [eq:sensor_error_ub]."""
    found: list[ExplainedStep] = []
    d = distance_m(stage)
    position, attitude, ranging = stage.position, stage.attitude, stage.ranging
    if position is not None and first:
        found.append(
            ExplainedStep(
                _name("sigma_p", stage), "|(s_north, s_east, s_down)|", _root(position.sigma),
                math.hypot(*position.sigma), "m", worked.source(position.id),
            )
        )  # fmt: skip
    if attitude is not None and ranging is not None:
        found.append(
            ExplainedStep(
                _name("sigma_Theta_d", stage), "|(s_roll, s_pitch, s_yaw)| d",
                f"{_root(attitude.sigma)} * {_n(d)}", math.hypot(*attitude.sigma) * d, "m",
                worked.source(attitude.id),
            )
        )  # fmt: skip
    if ranging is not None and attitude is not None:
        r, *angles = ranging.sigma
        source = worked.source(ranging.id)
        about = "s_range"
        if ranging.range_shape:
            about += f", by range, at {_n(d)} m"
        elif ranging.range_by_beam:
            about += ", by beam angle, at the worst that is looked at"
        found.append(ExplainedStep(_name("sigma_r", stage), about, _n(r), r, "m", source))
        found.append(
            ExplainedStep(
                _name("sigma_u_d", stage), "|(s_azimuth, s_elevation)| d",
                f"{_root(angles)} * {_n(d)}", math.hypot(*angles) * d, "m", source,
            )
        )  # fmt: skip
    return found


def _tau(worked: Worked, owner: Stage, sensor: Sensor, role: RoleName) -> ExplainedStep:
    """The bound of one sensor's timestamp error, with what known effects add."""
    k = worked.system.coverage_factor
    formula, numbers = _bound(sensor.timing, k)
    value = timing.bound(sensor.timing, k)
    extra = known_of(worked.system).extra_tau_s.get((owner.name, role), 0.0)
    if extra:
        formula, numbers, value = f"{formula} + effects", f"{numbers} + {_n(extra)}", value + extra
    name = _name(f"tau_{role}", owner)
    return ExplainedStep(name, formula, numbers, value, "s", worked.stamped(owner, role))


def _bound(error: TimingError, k: float) -> tuple[str, str]:
    """(formula, numbers) of a bound of |mu| [s]."""
    middle = timing.mean(error.distribution) if error.calibrated_s is not None else 0.0
    less = f" - {_n(middle)}" if middle else ""
    match error.distribution:
        case Normal(mean, std):
            formula, numbers = "|mean| + k std", f"abs({_n(mean)}{less}) + {_n(k)} * {_n(std)}"
        case Uniform(low, high):
            formula = "largest end"
            numbers = f"max(abs({_n(low)}{less}), abs({_n(high)}{less}))"
        case Constant(value):
            formula, numbers = "|value|", f"abs({_n(value)}{less})"
        case Empirical(values):
            ends = f"abs({_n(min(values))}{less}), abs({_n(max(values))}{less})"
            formula, numbers = "largest measured", f"max({ends})"
    for word, size in (("what its calibration leaves", error.calibrated_s),
                       ("drift x holdover", error.drifted_s)):  # fmt: skip
        if size:
            formula, numbers = f"{formula} + {word}", f"{numbers} + {_n(size)}"
    return formula, numbers


def _pairs(worked: Worked) -> Iterator[Pair]:
    """(relative bound, its rate in numbers, the rate, the steps before) of all pairs."""
    before: Stage | None = None
    for stage in worked.system.stages:
        ranging = stage.ranging
        located = (stage, stage.position, "position") if before is None else (
            before, before.ranging, "ranging"
        )  # fmt: skip
        v, omega, d = stage.platform.v_max_mps, stage.platform.omega_max_radps, distance_m(stage)
        reference = None if ranging is None else _tau(worked, stage, ranging, "ranging")
        owner, sensor, role = located
        if sensor is not None:
            yield _pair(worked, (owner, sensor, role), stage, reference, (_n(v), float(v)))  # type: ignore[arg-type]
        if stage.attitude is not None and ranging is not None:
            rate = (f"{_n(d)} * {_n(omega)}", d * float(omega))
            yield _pair(worked, (stage, stage.attitude, "attitude"), stage, reference, rate)
        before = stage


def _pair(
    worked: Worked,
    of: tuple[Stage, Sensor, RoleName],
    stage: Stage,
    reference: ExplainedStep | None,
    rate: tuple[str, float],
) -> Pair:
    owner, sensor, role = of
    own = _tau(worked, owner, sensor, role)
    steps = [own]
    names, value = [own.name], own.value
    against = UTC if stage.ranging is None else stage.ranging.timeline
    if reference is not None:
        steps.append(reference)
        names.append(reference.name)
        value += reference.value
    for timeline in (sensor.timeline, against):
        if sensor.timeline != against and timeline != UTC:
            offset = worked.system.clock_offset(timeline)
            formula, numbers = _bound(offset, worked.system.coverage_factor)
            bound = timing.bound(offset, worked.system.coverage_factor)
            name = f"offset_{timeline.removeprefix('host:')}".replace("-", "_").replace(" ", "_")
            steps.append(ExplainedStep(name, f"of the host clock: {formula}", numbers, bound, "s"))
            names.append(name)
            value += bound
    what = "attitude" if role == "attitude" else "position"
    relative = ExplainedStep(
        _name(f"tau_pair_{what}", stage), "tau_i + tau_ref + clock offsets", " + ".join(names),
        value, "s",
    )  # fmt: skip
    return relative, rate[0], rate[1], steps


def _error(worked: Worked) -> Iterator[ExplainedStep]:
    """The Syncline: sensor error + systematic + sync error."""
    parts: list[ExplainedStep] = []
    for index, stage in enumerate(worked.system.stages):
        parts += _sensor_steps(worked, stage, index == 0)
    for number, (term, stage_name, value) in enumerate(known_of(worked.system).systematic, 1):
        about = f"{term} on {stage_name}, as the budget charges it"
        parts.append(ExplainedStep(f"effect_{number}", about, _n(value), value, "m"))
    parts += _underway(worked)
    yield from parts
    pairs = list(_pairs(worked))
    told: set[str] = set()
    for relative, _, _, steps in pairs:
        for step in (*steps, relative):
            if step.name not in told:
                told.add(step.name)
                yield step
    sync = _sync(worked, pairs)
    yield from sync
    parts = [part for part in parts if part.unit == "m"]
    names = [part.name for part in parts]
    total = math.fsum([*(part.value for part in parts), sync[-1].value])
    formula = "sum of the sensor terms, known effects, what is under way, and the sync error"
    yield ExplainedStep("total", formula, " + ".join([*names, sync[-1].name]), total, "m")


def _underway(worked: Worked) -> Iterator[ExplainedStep]:
    """Sound under way and interpolation, each from its figures."""
    for one in underway(worked.system):
        stage = worked.system.stages[one.stage]
        platform, d = stage.platform, distance_m(stage)
        source = worked.source(one.sensor.id)
        if one.cause in ("travel", "object"):
            yield replace(_echoed(worked, one), source=source)
            continue
        waits = ExplainedStep(
            _name(f"T_{one.role}", stage), *apart(one), one.interval_s, "s", source
        )
        yield waits
        if one.cause == "path":
            about = "a_max T^2 / 8"
            numbers = f"{_n(platform.acceleration_mps2)} * {waits.name}**2 / 8"
        else:
            about = "alpha_max T^2 / 8 d"
            numbers = f"{_n(platform.angular_acceleration_radps2)} * {waits.name}**2 / 8 * {_n(d)}"
        name = _name(f"between_{one.role}", stage)
        yield ExplainedStep(name, about, numbers, one.value_m, "m", source)


def _echoed(worked: Worked, one: Underway) -> ExplainedStep:
    """What the vehicle, or the one that it locates, moves while sound is under way."""
    stage = worked.system.stages[one.stage]
    platform, d = stage.platform, distance_m(stage)
    echo = f"2 * {_n(d)} / {_n(one.sensor.sound_mps or 0.0)}"
    if one.cause == "travel":
        about = "(v_max + d omega_max) 2 d / c"
        rate = f"({_n(platform.v_max_mps)} + {_n(d)} * {_n(platform.omega_max_radps)})"
        return ExplainedStep(_name("travel", stage), about, f"{rate} * {echo}", one.value_m, "m")
    located = worked.system.stages[one.stage + 1]
    about = f"v_max of {located.name} 2 d / c, while sound goes there and back"
    numbers = f"{_n(located.platform.v_max_mps)} * {echo}"
    return ExplainedStep(_name("travel_object", stage), about, numbers, one.value_m, "m")


def _sync(worked: Worked, pairs: Sequence[Pair]) -> list[ExplainedStep]:
    """The sync error by the model that decides [eq:sync_error_ub]."""
    if worked.model != "syncline":
        numbers = " + ".join(f"{rate} * {pair.name}" for pair, rate, _, _ in pairs)
        value = math.fsum(speed * pair.value for pair, _, speed, _ in pairs)
        formula = "sum over pairs of rate x tau_pair"
        return [ExplainedStep("sync_error", formula, numbers, value, "m")]
    rate, tau = _system(pairs)
    value = rate.value * tau.value
    error = ExplainedStep("sync_error", "rate x tau_sys", "rate * tau_sys", value, "m")
    return [rate, tau, error]


def _system(pairs: Sequence[Pair]) -> tuple[ExplainedStep, ExplainedStep]:
    """The system's rate, and its tau: the largest of any pair."""
    rate = math.fsum(speed for _, _, speed, _ in pairs)
    numbers = " + ".join(one for _, one, _, _ in pairs)
    largest = max((pair.value for pair, _, _, _ in pairs), default=0.0)
    names = ", ".join(["0.0", *(pair.name for pair, _, _, _ in pairs)])
    return (
        ExplainedStep("rate", "sum over stages of v_max + d omega_max", numbers, rate, "m/s"),
        ExplainedStep("tau_sys", "largest of the pairs", f"max({names})", largest, "s"),
    )


def _ratios(worked: Worked) -> Iterator[ExplainedStep]:
    """tau / tau_crit of every sensor and of the system, the largest last.

    Where stages give several distances, at those of their ends where it is largest.
    """
    found = []
    for end in at_ends(worked.system):
        steps = list(_ratios_at(replace(worked, system=end)))
        found.append((steps[-1].value, [*_distances(worked.system, end), *steps]))
    yield from max(found, key=lambda one: one[0])[1]


def _distances(system: System, end: System) -> Iterator[ExplainedStep]:
    for name, d in distances_of(system, end).items():
        formula = "the end of its distances where tau / tau_crit is largest"
        name = f"d_{name}".replace("-", "_").replace(" ", "_")
        yield ExplainedStep(name, formula, _n(d), d, "m")


def _ratios_at(worked: Worked) -> Iterator[ExplainedStep]:
    left_out = ("total", "sync_error", "rate", "tau_sys")
    steps = {one.name: one for one in _error(worked) if one.name not in left_out}
    steps |= {one.name: one for one in _system(list(_pairs(worked)))}
    names: list[str] = []
    values: list[float] = []
    for stage in worked.system.stages:
        first = stage is worked.system.stages[0]
        for role, parts, rate, speed in _own(stage, first):
            known = [_name(part, stage) for part in parts]
            error = math.fsum(steps[name].value for name in known)
            own = _own_tau(worked, stage, role, steps)
            steps[own.name] = own
            if error and speed:
                crit = ExplainedStep(
                    _name(f"tau_crit_{role}", stage), "sensor error / rate",
                    f"({' + '.join(known)}) / ({rate})", error / speed, "s",
                )  # fmt: skip
                steps[crit.name] = crit
                names.append(f"{own.name} / {crit.name}")
                values.append(own.value / crit.value)
    sensors = [one for one in steps.values() if one.name.startswith("sigma_")]
    error, rate_mps = math.fsum(one.value for one in sensors), steps["rate"].value
    if rate_mps and error:
        numbers = f"({' + '.join(one.name for one in sensors)}) / rate"
        steps["tau_crit_sys"] = ExplainedStep(
            "tau_crit_sys", "sensor error / rate", numbers, error / rate_mps, "s"
        )
        names.append("tau_sys / tau_crit_sys")
        values.append(steps["tau_sys"].value / steps["tau_crit_sys"].value)
    beside = ("effect_", "travel_", "between_", "T_")
    yield from (one for one in steps.values() if not one.name.startswith(beside))
    largest = ", ".join(["0.0", *names])
    yield ExplainedStep(
        "ratio", "largest tau / tau_crit", f"max({largest})", max([0.0, *values]), "1"
    )


def _own_tau(
    worked: Worked, stage: Stage, role: RoleName, steps: Mapping[str, ExplainedStep]
) -> ExplainedStep:
    """A sensor's own tau; without a ranging sensor it is held against true time."""
    if stage.ranging is None:
        return steps[_name("tau_pair_position", stage)]
    return _tau(worked, stage, getattr(stage, role), role)


def _own(stage: Stage, first: bool) -> Iterator[tuple[RoleName, tuple[str, ...], str, float]]:
    """(role, its error terms, the rate of its tau_crit in numbers, the rate) of each sensor."""
    v, omega, d = stage.platform.v_max_mps, stage.platform.omega_max_radps, distance_m(stage)
    both = (f"{_n(v)} + {_n(d)} * {_n(omega)}", float(v) + d * float(omega))
    if first and stage.position is not None:
        yield "position", ("sigma_p",), _n(v), float(v)
    if stage.attitude is not None and stage.ranging is not None:
        yield "attitude", ("sigma_Theta_d",), *both
        yield "ranging", ("sigma_r", "sigma_u_d"), *both


def _sum(worked: Worked, row: RequirementResult) -> Iterator[ExplainedStep]:
    """A sum over what is bought; shared hardware and clocks with their price."""
    names: list[str] = []
    total = 0.0
    for name, label, value in _items(worked.design, row.kind):
        if value is not None:
            step = ExplainedStep(name, label, _n(value), value, row.unit)
            names.append(name)
            total += value
            yield step
    if row.kind == "cost" and row.value is not None:
        yield ExplainedStep("total", "sum", " + ".join(names) or "0.0", total, row.unit)
    elif row.value is not None:
        rest = row.value - total
        if abs(rest) > 1e-12 * abs(row.value):
            yield ExplainedStep("shared", "shared hardware and clocks", _n(rest), rest, row.unit)
            names.append("shared")
        yield ExplainedStep("total", "sum", " + ".join(names) or "0.0", row.value, row.unit)


def _items(design: NamedDesign, kind: str) -> Iterator[tuple[str, str, float | None]]:
    number = 0
    for stage in design.stages:
        for role, one in stage.roles.items():
            number += 1
            label = f"{stage.name}.{role}: {one.name} with {one.timestamping_name}"
            yield f"item_{number}", label, getattr(one, kind)
    if kind == "cost":
        for shared in design.infrastructure:
            number += 1
            label = f"{shared.count} x {shared.name} on {shared.vehicle}"
            yield f"item_{number}", label, shared.cost
        for clock in design.clocks:
            number += 1
            yield f"item_{number}", f"clock of {clock.vehicle}: {clock.name}", clock.cost
