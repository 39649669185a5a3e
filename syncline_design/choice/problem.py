"""A loaded spec to a Problem: tables of options with every constant resolved.

Formulas (E. R. Jellum et al., arXiv:2209.01136v2, and the design rules):
sensor error per role: sigma_p; sigma_Theta d; sigma_r + sigma_u d (eq. sensor_error_ub);
own tau_crit = that error / rate, rate v_max for position, v_max + d omega_max otherwise
(eq. t_crit per sensor).  Every figure is worked out in fractions and rounded once.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from syncline_design.choice.chosen_system import system_of
from syncline_design.choice.table import (
    NO_CLOCK,
    RESOURCES,
    ClockOption,
    Design,
    Excluded,
    ExcludedClock,
    Infrastructure,
    Limits,
    Objective,
    Option,
    Pair,
    Problem,
    ResourceName,
    Resources,
    RoleTable,
    SyncModel,
    VehicleTable,
    breaks_own_tau_crit,
    exactly,
    sync_ratio,
    with_impossible,
    with_limits,
)
from syncline_design.machine.deadline import unhurried
from syncline_design.model.known import NOTHING_KNOWN, Known
from syncline_design.model.quantity import Quantity
from syncline_design.model.roles import RoleName
from syncline_design.spec.case import Candidate, Case, RoleCase, StageCase, usable_primitives
from syncline_design.spec.catalog import (
    ClockEntry,
    InfrastructureEntry,
    SensorEntry,
    TimestampingEntry,
)
from syncline_design.spec.exact import fraction_of, norm, tau_bound
from syncline_design.spec.gnss import Barred, barred_clock, barred_method, barred_sensor
from syncline_design.spec.selection import ClockSelection, RoleSelection, Selection
from syncline_design.spec.spec import InlineTimestamping

__all__ = [
    "NO_CLOCK",
    "RESOURCES",
    "ClockOption",
    "Design",
    "Excluded",
    "Infrastructure",
    "Limits",
    "Objective",
    "Option",
    "Pair",
    "Problem",
    "ResourceName",
    "Resources",
    "RoleTable",
    "SyncModel",
    "VehicleTable",
    "build_problem",
    "exactly",
    "selection_of",
    "sole_design",
    "sync_ratio",
    "system_of",
    "with_everything",
    "with_limits",
]

INLINE = "inline"


@dataclass(frozen=True, slots=True)
class SensorEffects:
    """What known effects add where one sensor takes a role: its whole extra tau, exactly the
    systematic errors that hang on it, and their share in proportion to its noise."""

    tau_s: float = 0.0
    systematic_m: Fraction = Fraction(0)
    noise_m: Fraction = Fraction(0)


BySensor = Mapping[tuple[str, RoleName, str], SensorEffects]  # stage name, role, sensor
NO_SENSOR: BySensor = {}


def build_problem(
    case: Case, known: Known = NOTHING_KNOWN, by_sensor: BySensor = NO_SENSOR
) -> Problem:
    """Tables of everything a loaded spec leaves to choose.

    known: what effects add to every design; by_sensor: what they add where it hangs on the sensor
    (its tau in place of that of `known`).
    """
    spec = case.spec
    motions = [_motion(stage) for stage in case.stages]
    limits = _limits(case)
    vehicles = list(dict.fromkeys(stage.vehicle_name for stage in spec.stages))
    tables = tuple(
        _role_table(
            case, stage, role, motions[stage.index], limits.sync, vehicles, known, by_sensor
        )
        for stage in case.stages
        for role in stage.roles
    )
    vehicle_tables = tuple(_vehicle(case, name) for name in vehicles)
    rate = sum((motion.rate for motion in motions), Fraction(0))
    fixed = sum((Fraction(value) for _, _, value in known.systematic), Fraction(0))
    return Problem(
        roles=tables,
        pairs=_pairs(tables, motions),
        vehicles=vehicle_tables,
        infrastructure=tuple(_infrastructure(case, _required(tables, vehicle_tables))),
        sync_rate_mps=float(rate),
        fixed_error_m=float(fixed),
        limits=limits,
        sync_model=spec.sync_model,
        objective=spec.objective,
        exact_sync_rate_mps=rate,
        exact_fixed_error_m=fixed,
    )


def selection_of(problem: Problem, design: Design) -> Selection:
    """The names of a design."""
    roles = []
    for table, place in zip(problem.roles, design.options, strict=True):
        option = table.options[place]
        roles.append(RoleSelection(table.stage_name, table.role, *option.names))
    clocks = [
        ClockSelection(vehicle.name, vehicle.clocks[place].id)
        for vehicle, place in zip(problem.vehicles, design.clocks, strict=True)
    ]
    return Selection(tuple(roles), tuple(clocks))


def with_everything(problem: Problem) -> Problem:
    """The problem with no sync limit: options that break their own tau_crit are back in."""
    return with_limits(problem, replace(problem.limits, sync=math.inf))


def sole_design(problem: Problem) -> tuple[Problem, Design] | None:
    """The one design of a spec that leaves nothing open, sync requirement or not.

    Comes with the problem in which its indices hold: an option that breaks its own tau_crit, or
    that cannot work where it stands, is part of it, so that the design can be verified and found to
    fail.
    """
    everything = with_everything(with_impossible(problem))
    if everything.combinations != 1:
        return None
    return everything, Design((0,) * len(everything.roles), (0,) * len(everything.vehicles))


@dataclass(frozen=True, slots=True)
class _Motion:
    """How a stage moves, exactly: v_max [m/s], d [m] (0 without ranging), d omega_max [m/s]."""

    speed: Fraction
    distance: Fraction
    turning: Fraction
    ranges: bool

    @property
    def rate(self) -> Fraction:
        """v_max + d omega_max [m/s]."""
        return self.speed + self.turning


def _motion(stage: StageCase) -> _Motion:
    platform, ranges = stage.platform.entry, stage.role("ranging") is not None
    distance = fraction_of(platform.distance) if ranges else Fraction(0)
    speed = fraction_of(platform.v_max)
    return _Motion(speed, distance, distance * fraction_of(platform.omega_max), ranges)


def _limits(case: Case) -> Limits:
    """The tightest limit of each kind; without a sync requirement 1.0 is implied."""
    tightest: dict[str, tuple[Fraction, str]] = {}
    for requirement in case.spec.requirements:
        exact = case.limit(requirement)
        known = tightest.get(requirement.kind)
        if known is None or exact < known[0]:
            tightest[requirement.kind] = (exact, requirement.id)
    budgets = {name: tightest[name][0] if name in tightest else None for name in RESOURCES}
    accuracy = float(tightest["accuracy"][0]) if "accuracy" in tightest else None
    sync = float(tightest["sync"][0]) if "sync" in tightest else 1.0
    ids = tuple((kind, name) for kind, (_, name) in tightest.items() if kind != "monte_carlo")
    return Limits(accuracy, sync, budgets["cost"], budgets["mass"], budgets["power"], ids)


def _sensor_error(sensor: SensorEntry, role: RoleName, motion: _Motion) -> Fraction:
    """The role's term of the sensor-induced error [m] (eq. sensor_error_ub)."""
    if role == "position":
        return norm(sensor.sigma_position or 0.0, 3)
    if role == "attitude":
        return norm(sensor.sigma_attitude or 0.0, 3) * motion.distance
    bearing = norm(sensor.sigma_bearing or 0.0, 2) * motion.distance
    return fraction_of(sensor.sigma_range or 0.0) + bearing


def _role_table(
    case: Case,
    stage: StageCase,
    role: RoleCase,
    motion: _Motion,
    sync_limit: float,
    vehicles: list[str],
    known: Known,
    by_sensor: BySensor,
) -> RoleTable:
    name = stage.choice.name
    usual = SensorEffects(known.extra_tau_s.get((name, role.role), 0.0))
    effects = _EffectsOf(name, role.role, usual, by_sensor)
    options: list[Option] = []
    excluded: list[Excluded] = []
    for one in unhurried(_candidates(case, stage, role, motion, effects)):
        ratio = sync_ratio(one) if isinstance(one, Option) else 0.0
        if isinstance(one, Excluded):
            excluded.append(one)
        elif ratio < sync_limit:
            options.append(one)
        else:
            excluded.append(breaks_own_tau_crit(one, ratio))
    options.sort(key=lambda option: option.names)
    vehicle = vehicles.index(stage.choice.vehicle_name)
    return RoleTable(stage.index, name, role.role, vehicle, tuple(options), tuple(excluded))


@dataclass(frozen=True, slots=True)
class _EffectsOf:
    """Known effects of one role, by its sensor."""

    stage: str
    role: RoleName
    usual: SensorEffects
    by_sensor: BySensor

    def of(self, sensor: str) -> SensorEffects:
        return self.by_sensor.get((self.stage, self.role, sensor), self.usual)


def _candidates(
    case: Case, stage: StageCase, role: RoleCase, motion: _Motion, effects: _EffectsOf
) -> Iterator[Option | Excluded]:
    """Every (sensor, primitive, method) that the spec lets a role take, or why it cannot."""
    for sensor in role.sensors:
        figures = _Figures(case, role, motion, effects.of(sensor.id), sensor.id, sensor.entry)
        if role.inline is not None:
            found = _given_in_place(figures, role.inline)
        else:
            found = _stamped(figures, stage)
        if (barred := barred_sensor(case, stage.choice, sensor)) is not None:
            yield _impossible(sensor.id, "", "", barred, found)
        else:
            yield from found


def _given_in_place(figures: _Figures, stamping: InlineTimestamping) -> Iterator[Option | Excluded]:
    """A sensor whose timestamp error the spec gives; a primitive that is pinned has to be its."""
    name, offered, pinned = figures.name, figures.sensor.serves, figures.role.choice.primitive
    if pinned is not None and pinned not in offered:
        offers = ", ".join(offered)
        reason = f"{pinned} is asked for; {name} has {offers}"
        yield Excluded(name, "", INLINE, reason, figure=offers, limit=pinned)
        return
    tau = tau_bound(stamping.error, figures.case.spec.coverage_factor)
    yield figures.option(pinned or INLINE, INLINE, tau, stamping.timeline, None)


def _stamped(figures: _Figures, stage: StageCase) -> Iterator[Option | Excluded]:
    """Every way of stamping one sensor, or why it is none."""
    case, pinned = figures.case, figures.role.choice.primitive
    name, sensor = figures.name, figures.sensor
    for method in figures.role.methods:
        entry = method.entry
        primitives = usable_primitives(sensor, entry, pinned)
        tau = tau_bound(entry.error, case.spec.coverage_factor)
        barred = barred_method(case, stage.choice, method)
        for primitive in primitives:
            option = figures.option(primitive, method.id, tau, entry.timeline, entry)
            one = (option,)
            yield option if barred is None else _impossible(name, primitive, method.id, barred, one)
        if not primitives:
            served = ", ".join(entry.primitives)
            offers = pinned or ", ".join(sensor.serves)
            reason = f"{method.id} serves {served}; {name} has {offers}"
            yield Excluded(name, "", method.id, reason, figure=served, limit=offers)


def _impossible(
    sensor: str, primitive: str, method: str, barred: Barred, found: Iterable[Option | Excluded]
) -> Excluded:
    """The record of what cannot work on its stage, with the options that it takes along."""
    options: list[Option] = []
    for one in found:
        options += [one] if isinstance(one, Option) else one.impossible
    return Excluded(
        sensor,
        primitive,
        method,
        barred.reason,
        code=barred.code,
        figure=barred.figure,
        limit=barred.limit,
        impossible=tuple(options),
    )


@dataclass(frozen=True, slots=True)
class _Figures:
    """A sensor in a role, before it is known how it is stamped."""

    case: Case
    role: RoleCase
    motion: _Motion
    effects: SensorEffects
    name: str
    sensor: SensorEntry

    def option(
        self,
        primitive: str,
        method: str,
        tau: Fraction,
        timeline: str,
        entry: TimestampingEntry | None,
    ) -> Option:
        """The option with one way of stamping."""
        role = self.role.role
        enters = self.motion.ranges or role == "position"
        error = _sensor_error(self.sensor, role, self.motion) if enters else Fraction(0)
        rate = self.motion.speed if role == "position" else self.motion.rate
        matters = enters and rate > 0
        crit = float(error / rate) if matters else math.inf
        tau = tau + Fraction(self.effects.tau_s)
        systematic = self.effects.systematic_m
        return Option(
            sensor=self.name,
            primitive=primitive,
            method=method,
            sensor_error_m=float(error),
            tau_s=float(tau),
            tau_crit_s=crit,
            timeline="utc" if timeline == "utc" else "host",
            resources=_resources(self.case, self.sensor, entry),
            requires=tuple(sorted(entry.requires.items())) if entry else (),
            exact_error_m=error,
            exact_tau_s=tau,
            systematic_m=float(systematic),
            exact_systematic_m=systematic if systematic else None,
            noise_systematic_m=self.effects.noise_m,
            own_rate_mps=rate if matters else None,
        )


def _resources(
    case: Case,
    *entries: SensorEntry | TimestampingEntry | ClockEntry | InfrastructureEntry | None,
) -> Resources:
    """Sums over entries; None where one of them does not say."""
    sums: dict[str, Fraction | None] = {}
    for name in RESOURCES:
        amounts = [getattr(entry, name) for entry in entries if entry is not None]
        said = [a for a in amounts if a is not None]
        known = [a for one in said if (a := _amount(case, name, one)) is not None]
        sums[name] = sum(known, Fraction(0)) if len(known) == len(amounts) else None
    return Resources(**sums)


def _amount(case: Case, name: str, amount: float) -> Fraction | None:
    """The amount; None in a currency without a rate (loading refuses those of a spec's own)."""
    if name == "cost" and isinstance(amount, Quantity):
        return case.spec.in_currency(amount) if case.spec.can_convert(amount) else None
    return fraction_of(amount)


def _pairs(tables: tuple[RoleTable, ...], motions: list[_Motion]) -> tuple[Pair, ...]:
    """Pairs of timestamps that meet: (position, ranging) and (attitude, ranging) of each stage."""
    place = {(table.stage, table.role): r for r, table in enumerate(tables)}
    pairs = []
    for stage, motion in enumerate(motions):
        reference = place.get((stage, "ranging"))
        before = place[0, "position"] if stage == 0 else place[stage - 1, "ranging"]
        pairs.append(Pair(before, reference, float(motion.speed), motion.speed))
        if reference is not None:
            own = place[stage, "attitude"]
            pairs.append(Pair(own, reference, float(motion.turning), motion.turning))
    return tuple(pairs)


def _vehicle(case: Case, name: str) -> VehicleTable:
    stages = [i for i, stage in enumerate(case.spec.stages) if stage.vehicle_name == name]
    offered = case.clocks(name)
    if not offered:
        return VehicleTable(name, tuple(stages), (NO_CLOCK,))
    clocks: list[ClockOption] = []
    excluded: list[ExcludedClock] = []
    for one in offered:
        clock = _clock(case, one)
        barred = barred_clock(case, name, one)
        if barred is None:
            clocks.append(clock)
        else:
            why = (barred.reason, barred.code, barred.figure, barred.limit)
            excluded.append(ExcludedClock(clock, *why))
    return VehicleTable(name, tuple(stages), tuple(clocks), tuple(excluded))


def _clock(case: Case, clock: Candidate[ClockEntry]) -> ClockOption:
    entry = clock.entry
    offset = tau_bound(entry.offset, case.spec.coverage_factor)
    if entry.drift is not None and entry.holdover is not None:
        offset += abs(fraction_of(entry.drift)) * fraction_of(entry.holdover)
    requires = tuple(sorted(entry.requires.items()))
    return ClockOption(clock.id, float(offset), _resources(case, entry), requires, offset)


def _required(tables: Sequence[RoleTable], vehicles: Sequence[VehicleTable]) -> set[str]:
    """Shared hardware that any option or clock requires, excluded options included."""
    back = [one.option for table in tables for one in table.excluded if one.option is not None]
    needs = [option.requires for table in tables for option in table.options]
    needs += [option.requires for option in back]
    needs += [clock.requires for vehicle in vehicles for clock in vehicle.clocks]
    return {name for requires in needs for name, _ in requires}


def _infrastructure(case: Case, required: set[str]) -> Iterator[Infrastructure]:
    """Shared hardware that a design may buy: what is only on the shelf has no influence."""
    for identity, one in case.hardware.items():
        if identity in required:
            yield Infrastructure(identity, int(one.entry.channels), _resources(case, one.entry))
