"""A loaded spec to a Problem: tables of options with every constant resolved.

Sync rate of the chain (E. R. Jellum et al., arXiv:2209.01136v2, eq. sync_error_ub): the sum over
stages of v_max + d omega_max [m/s].
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from fractions import Fraction

from syncline_design.choice.candidates import NO_SENSOR, BySensor, SensorEffects, candidates
from syncline_design.choice.options import RESOURCES
from syncline_design.choice.prices import resources_of
from syncline_design.choice.stage_motion import StageMotion, motion_of
from syncline_design.choice.table import (
    NO_CLOCK,
    ClockOption,
    Design,
    ExcludedClock,
    Infrastructure,
    Limits,
    Nearer,
    Pair,
    Problem,
    RoleTable,
    VehicleTable,
    with_impossible,
    with_limits,
)
from syncline_design.model.known import NOTHING_KNOWN, Known
from syncline_design.spec.barred import barred_clock
from syncline_design.spec.case import CandidateEntry, Case, RoleCase, StageCase
from syncline_design.spec.catalog import ClockEntry
from syncline_design.spec.exact import fraction_of, tau_bound
from syncline_design.spec.selection import ClockSelection, RoleSelection, Selection


def build_problem(
    case: Case, known: Known = NOTHING_KNOWN, by_sensor: BySensor = NO_SENSOR
) -> Problem:
    """Tables of everything a loaded spec leaves to choose.

    known: what effects add to every design; by_sensor: what they add where it hangs on the sensor
    (its tau in place of that of `known`).
    """
    spec = case.spec
    motions = [motion_of(stage) for stage in case.stages]
    limits = _limits(case)
    vehicles = list(dict.fromkeys(stage.vehicle_name for stage in spec.stages))
    tables = tuple(
        _role_table(case, stage, role, limits, vehicles, known, by_sensor)
        for stage in case.stages
        for role in stage.roles
    )
    vehicle_tables = tuple(_vehicle(case, name) for name in vehicles)
    fixed = sum((Fraction(value) for _, _, value in known.systematic), Fraction(0))
    problem = Problem(
        roles=tables,
        pairs=(),
        vehicles=vehicle_tables,
        infrastructure=tuple(_infrastructure(case, _required(tables, vehicle_tables))),
        sync_rate_mps=0.0,
        fixed_error_m=float(fixed),
        limits=limits,
        sync_model=spec.sync_model,
        objective=spec.objective,
        exact_fixed_error_m=fixed,
    )
    return with_motions(problem, motions)


def with_motions(problem: Problem, motions: Sequence[StageMotion]) -> Problem:
    """The problem with the rates at which its stages move."""
    rate = sum((motion.rate for motion in motions), Fraction(0))
    pairs = _pairs(problem.roles, motions)
    nearer = tuple(
        Nearer(stage, motion.rate - near.rate)
        for stage, motion in enumerate(motions)
        if (near := motion.near_end) is not None
    )
    return replace(
        problem, pairs=pairs, sync_rate_mps=float(rate), exact_sync_rate_mps=rate, nearer=nearer
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
    if problem.combinations > 1:
        return None
    everything = with_everything(with_impossible(problem))
    if everything.combinations != 1:
        return None
    return everything, Design((0,) * len(everything.roles), (0,) * len(everything.vehicles))


def _limits(case: Case) -> Limits:
    """The tightest limit of each kind; without a sync requirement 1.0 is implied."""
    tightest: dict[str, tuple[Fraction, str]] = {}
    for requirement in case.spec.requirements:
        exact = case.choice_limit(requirement)
        known = tightest.get(requirement.kind)
        if exact is not None and (known is None or exact < known[0]):
            tightest[requirement.kind] = (exact, requirement.id)
    budgets = {name: tightest[name][0] if name in tightest else None for name in RESOURCES}
    accuracy = float(tightest["accuracy"][0]) if "accuracy" in tightest else None
    written = any(one.kind == "sync" for one in case.spec.requirements)
    sync = math.inf if written else 1.0
    sync = float(tightest["sync"][0]) if "sync" in tightest else sync
    spacing = float(tightest["sample_spacing"][0]) if "sample_spacing" in tightest else None
    ids = tuple((kind, name) for kind, (_, name) in tightest.items() if kind != "monte_carlo")
    return Limits(accuracy, sync, budgets["cost"], budgets["mass"], budgets["power"], ids, spacing)


def _role_table(
    case: Case,
    stage: StageCase,
    role: RoleCase,
    limits: Limits,
    vehicles: list[str],
    known: Known,
    by_sensor: BySensor,
) -> RoleTable:
    usual = SensorEffects(known.extra_tau_s.get((stage.choice.name, role.role), 0.0))
    found = candidates(case, stage, role, usual, by_sensor)
    return found.table(vehicles.index(stage.choice.vehicle_name), limits)


def _pairs(tables: tuple[RoleTable, ...], motions: Sequence[StageMotion]) -> tuple[Pair, ...]:
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


def _clock(case: Case, clock: CandidateEntry[ClockEntry]) -> ClockOption:
    entry = clock.entry
    offset = tau_bound(entry.offset, case.spec.coverage_factor)
    if entry.drift is not None and entry.holdover is not None:
        offset += abs(fraction_of(entry.drift)) * fraction_of(entry.holdover)
    requires = tuple(sorted(entry.requires.items()))
    return ClockOption(clock.id, float(offset), resources_of(case, entry), requires, offset)


def _required(tables: Sequence[RoleTable], vehicles: Sequence[VehicleTable]) -> set[str]:
    """Shared hardware that any option or clock requires, excluded options included.

    What cannot work is bought only where a spec leaves nothing else.
    """
    needs = [kind for table in tables for kind in table.anywhere().required]
    if not all(len(table.options) for table in tables):
        needs += [o.requires for t in tables for one in t.excluded.rest for o in one.impossible]
    for vehicle in vehicles:
        offered = vehicle.clocks or [one.clock for one in vehicle.excluded]
        needs += [clock.requires for clock in offered]
    return {name for requires in needs for name, _ in requires}


def _infrastructure(case: Case, required: set[str]) -> Iterator[Infrastructure]:
    """Shared hardware that a design may buy: what is only on the shelf has no influence."""
    for identity, one in case.hardware.items():
        if identity in required:
            yield Infrastructure(identity, int(one.entry.channels), resources_of(case, one.entry))
