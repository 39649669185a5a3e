"""What-ifs on a problem: a column or two changed, the rest of the tables as they are."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from fractions import Fraction

import numpy as np

from syncline_design.choice.candidates import NO_SENSOR, Candidates, SensorEffects, candidates
from syncline_design.choice.core import Beside, may_improve, total_least
from syncline_design.choice.evaluate import Incumbent
from syncline_design.choice.option import Option
from syncline_design.choice.options import MARGIN, Bools, Floats, Options
from syncline_design.choice.problem import with_motions
from syncline_design.choice.stage_motion import StageMotion, motion_of, sensor_error
from syncline_design.choice.table import Design, Problem, RoleTable
from syncline_design.choice.variations import (
    PLATFORM_FIGURES,
    Build,
    PlatformFigure,
    SheetFigure,
    quantity,
    with_changed,
    with_platform_figure,
)
from syncline_design.machine.deadline import in_force
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.quantity import Quantity
from syncline_design.spec.case import CandidateEntry, Case
from syncline_design.spec.catalog import SensorEntry


def same_design(problem: Problem, design: Design, other: Problem) -> Design | None:
    """The design of the same names in another problem; None where an option is gone."""
    places = []
    for place in same_places(problem, design, other):
        if place is None:
            return None
        places.append(place)
    return Design(tuple(places), design.clocks)


def same_places(problem: Problem, design: Design, other: Problem) -> Iterator[int | None]:
    """Where another problem has the options of the same names; None where one is gone."""
    for own, table, place in zip(problem.roles, other.roles, design.options, strict=True):
        yield table.options.place_like(own.options, place)


def of_sensor(problem: Problem, r: int, place: int) -> Bools:
    """Which of a role's candidates have the sensor of one of its options."""
    pool = problem.roles[r].pool()
    return np.asarray(pool.sensor == pool.sensor[pool.place_like(problem.roles[r].options, place)])


def of_method(problem: Problem, r: int, place: int) -> Bools:
    """Which of a role's candidates have the method of one of its options, in any primitive."""
    pool = problem.roles[r].pool()
    return np.asarray(pool.method == pool.method[pool.place_like(problem.roles[r].options, place)])


def with_sensor_error(
    problem: Problem, r: int, rows: Bools, error_m: Fraction, near_error_m: Fraction | None = None
) -> Problem:
    """The problem with the error of one sensor, that of these candidates of a role, set.

    What known effects add in proportion grows with it, and its error at the near end of the stage's
    distances, unless that is told.
    """
    pool = problem.roles[r].pool()
    own = pool[int(np.argmax(rows))]

    def grown(option: Option) -> Option:
        if option.sensor != own.sensor:
            return option
        ratio = error_m / option.error()
        crit = option.tau_crit_s
        crit = float(Fraction(crit) * ratio) if math.isfinite(crit) else crit
        near = None if option.near_error_m is None else option.near_error_m * ratio
        if near is not None and near_error_m is not None:
            near = near_error_m
            crit = _crit(option, error_m, near, ratio)
        added = option.systematic() + option.noise_systematic_m * (ratio - 1)
        return replace(
            option,
            sensor_error_m=float(error_m),
            exact_error_m=error_m,
            tau_crit_s=crit,
            near_error_m=near,
            bends=tuple(one.scaled(ratio) for one in option.bends),
            systematic_m=float(added),
            exact_systematic_m=added if added else None,
            noise_systematic_m=option.noise_systematic_m * ratio,
        )

    new = grown(own)
    figures = {"error": new.sensor_error_m, "added": new.added_m(), "crit": new.tau_crit_s}
    figures["nearer"] = float(new.nearer_m())
    return _with_pool(problem, r, pool.changed(rows, grown, **figures))


def _crit(option: Option, error: Fraction, near: Fraction, ratio: Fraction) -> float:
    """A sensor's own tau_crit [s] with these errors at both ends of the distances."""
    ends = ((error, option.own_rate_mps), (near, option.near_rate_mps))
    found = [float(one / rate) for one, rate in ends if rate]
    found += [one.scaled(ratio).crit_s for one in option.bends]
    return min(found, default=math.inf)


def with_method_tau(problem: Problem, r: int, rows: Bools, tau_s: Fraction) -> Problem:
    """The problem with the error of one method, that of these candidates of a role, set."""
    pool = problem.roles[r].pool()
    own = pool[int(np.argmax(rows))]

    def grown(option: Option) -> Option:
        if option.method != own.method:
            return option
        return replace(option, tau_s=float(tau_s), exact_tau_s=tau_s)

    return _with_pool(problem, r, pool.changed(rows, grown, tau=float(tau_s)))


def _with_pool(problem: Problem, r: int, pool: Options) -> Problem:
    """The problem with options changed; those that now keep or break their tau_crit move over."""
    in_force().check()
    table = problem.roles[r].with_pool(pool, problem.limits.sync)
    return replace(problem, roles=(*problem.roles[:r], table, *problem.roles[r + 1 :]))


def with_sheet_figure(
    case: Case, problem: Problem, numbers: Numbers, figure: SheetFigure, value: Quantity
) -> Problem:
    """The problem with one datasheet figure changed, in a case without known effects."""
    for r, table in enumerate(problem.roles):
        stage = case.stages[table.stage]
        if figure.place not in (None, (table.stage, table.role)):
            continue
        number = numbers[r].get(figure.sensor)
        rows = table.pool().sensor == number
        if number is not None and rows.any():
            entry = candidates_of(case, table)[number].entry
            changed = with_changed(entry, figure, value)
            motion = motion_of(stage)
            error = sensor_error(changed, table.role, motion)
            near = None
            if motion.near_end is not None:
                near = sensor_error(changed, table.role, motion.near_end)
            problem = with_sensor_error(problem, r, rows, error, near) if error else problem
    return problem


Numbers = list[dict[str, int]]


def numbers_of(case: Case, problem: Problem) -> Numbers:
    """Of each role the numbers of its sensors in its columns."""
    return [
        {one.id: number for number, one in enumerate(candidates_of(case, table))}
        for table in problem.roles
    ]


def candidates_of(case: Case, table: RoleTable) -> tuple[CandidateEntry[SensorEntry], ...]:
    """The sensors that may take a role; their places are the numbers in its columns."""
    role = case.stages[table.stage].role(table.role)
    return () if role is None else role.sensors


def sensors_that_matter(
    case: Case, problem: Problem, known: Incumbent, beside: Beside, shares: Mapping[str, float]
) -> set[str]:
    """Sensors that may be part of a design no worse than a known one, were their errors smaller.

    shares: of each sensor's figures the least that any falls to.  An error is a sum of Euclidean
    norms, so that it falls to no smaller a share of itself; one sensor at a time.
    """
    named = [candidates_of(case, table) for table in problem.roles]
    every = [np.array([shares.get(one.id, 1.0) for one in sensors]) for sensors in named]
    gains = [_gains(table, share) for table, share in zip(problem.roles, every, strict=True)]
    out = {
        table.options[place].sensor
        for table, place in zip(problem.roles, known.design.options, strict=True)
    }
    for r, table in enumerate(problem.roles):
        pool, others = table.pool(), [q for q in range(len(problem.roles)) if q != r]
        elsewhere = np.zeros(len(named[r]))
        for q in others:
            gained = {one.id: gain for one, gain in zip(named[q], gains[q].tolist(), strict=True)}
            elsewhere += [gained.get(one.id, 0.0) for one in named[r]]
        gained_here = (gains[r] + elsewhere)[pool.sensor]
        total = total_least(problem, r, pool) * (1.0 - MARGIN) - gained_here
        amount, rest = beside.amounts(pool), beside.of(problem, others, {})
        keeps = may_improve(problem, known, amount, total, rest, beside)
        out |= {named[r][number].id for number in np.unique(pool.sensor[keeps]).tolist()}
    return out


def _gains(table: RoleTable, share: Floats) -> Floats:
    """By how much the error of each sensor of a role falls with its figures [m]."""
    pool, error = table.pool(), np.zeros(len(share))
    error[pool.sensor] = pool.error
    return np.asarray(error * (1.0 - share))


@dataclass(frozen=True, slots=True)
class Moving:
    """A stage that may move otherwise, in a case without known effects.

    sources: the candidates of its roles, by place in the problem.
    """

    case: Case
    stage: int
    sources: dict[int, Candidates]

    @classmethod
    def of(cls, case: Case, problem: Problem, stage: int) -> Moving:
        """Its candidates are looked at once."""
        here, sources = case.stages[stage], {}
        for r, table in enumerate(problem.roles):
            role = here.role(table.role)
            if table.stage == stage and role is not None:
                sources[r] = candidates(case, here, role, SensorEffects(), NO_SENSOR)
        return cls(case, stage, sources)

    def at(self, problem: Problem, figure: PlatformFigure, value: float) -> Problem:
        """The problem with one figure of the stage's platform set."""
        in_force().check()
        motions = [motion_of(stage) for stage in self.case.stages]
        motion = motions[self.stage] = _with_figure(motions[self.stage], figure, Fraction(value))
        roles = tuple(
            self.sources[r].moved(table, motion, problem.limits) if r in self.sources else table
            for r, table in enumerate(problem.roles)
        )
        return with_motions(replace(problem, roles=roles), motions)


def _with_figure(motion: StageMotion, figure: PlatformFigure, value: Fraction) -> StageMotion:
    if figure == "v_max":
        return replace(motion, speed=value)
    if figure == "omega_max":
        return replace(motion, turn=value)
    if not motion.ranges:
        return motion
    nearest = None if motion.nearest is None else min(motion.nearest, value)
    return replace(motion, distance=value, nearest=nearest)


def hangs_on_motion(case: Case, problem: Problem) -> bool:
    """Whether something besides noise and timing changes with how a platform moves."""
    tables = (one.entry.tables for s in case.stages for role in s.roles for one in role.sensors)
    return (
        bool(case.effects)
        or any(tables)
        or any(bool((table.pool().added != table.pool().error).any()) for table in problem.roles)
    )


WhatIf = Callable[[Problem, PlatformFigure, float], Problem]


def platform_what_if(case: Case, problem: Problem, build: Build, stage: int) -> WhatIf:
    """A problem by the value of a figure of one stage's platform.

    Known effects and simulation hang on how a platform moves: there the whole is built anew.
    """
    if not hangs_on_motion(case, problem) and problem.judge is None:
        return Moving.of(case, problem, stage).at

    def built(_: Problem, figure: PlatformFigure, at: float) -> Problem:
        value = quantity(at, PLATFORM_FIGURES[figure][1])
        return build(with_platform_figure(case, stage, figure, value))

    return built
