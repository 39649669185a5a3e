"""The design problem as tables: options per role, every constant resolved, no physics left in it.

Floats are what the fast roads add up; `exact_*` hold the same figure as a fraction where the
spec's decimal text gives more (None: the float itself is exact).  `problem.build_problem` makes
these tables from a loaded spec.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import field, replace
from fractions import Fraction
from typing import Literal, Protocol

import numpy as np

from syncline_design.choice.exclusions import Exclusions
from syncline_design.choice.option import Requires, ResourceName, Resources, exactly
from syncline_design.choice.options import Bools, Floats, Options
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.roles import RoleName

NOTHING = Exclusions.of(())
Objective = Literal["cost", "mass", "power", "error"]
SyncModel = Literal["syncline", "per_sensor"]


@dataclass(frozen=True, slots=True)
class RoleTable:
    """Options of one role; no two of them have the same names.

    distance_m, speed_mps: where and how fast its stage is, for what depends on it; nearest_m: the
    other end of its distances, where it has several.
    """

    stage: int
    stage_name: str
    role: RoleName
    vehicle: int
    options: Options
    excluded: Exclusions = NOTHING
    distance_m: Fraction = Fraction(0)
    speed_mps: Fraction = Fraction(0)
    nearest_m: Fraction | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.options, Options):  # given one by one
            object.__setattr__(self, "options", Options.of(self.options))
        if not isinstance(self.excluded, Exclusions):
            object.__setattr__(self, "excluded", Exclusions.of(self.excluded))

    def pool(self) -> Options:
        """The options with those that break their own tau_crit."""
        return self.options.joined(self.excluded.poor)

    def anywhere(self) -> Options:
        """The options at this and at any other distance, poor ones included."""
        return self.pool().joined(self.excluded.beyond)

    def settled(self, every: Options, limits: Limits) -> RoleTable:
        """The table with those of these options that work where it is, under these limits."""
        here, beyond = every.parted(self.works(every, limits.spacing_m))
        return self.with_pool(here, limits.sync, beyond)

    def works(self, options: Options, spacing_m: float | None) -> Bools:
        """Which options are in reach here, and take samples close enough."""
        far = float(self.distance_m)
        near = far if self.nearest_m is None else float(self.nearest_m)
        in_reach = options.reach_all(near, far)
        return in_reach & options.keep_spacing(self.speed_mps, self.distance_m, spacing_m)

    def with_pool(self, pool: Options, limit: float, beyond: Options | None = None) -> RoleTable:
        """The table with these options, as far as they keep their own tau_crit times a limit.

        beyond: those that are out of reach, where they are others than before.
        """
        if np.any(np.diff(pool.rank) < 0):
            pool = pool.take(pool.by_name())
        keeps = pool.keep_own_tau_crit(limit)
        kept, poor = pool.parted(keeps)
        out = self.excluded.beyond if beyond is None else beyond
        gone = Exclusions.in_turn(self.excluded.rest, poor, out)
        return replace(self, options=kept, excluded=gone)


@dataclass(frozen=True, slots=True)
class ClockOption:
    """How a vehicle's host clock is disciplined; id None: timelines taken as common."""

    id: str | None
    offset_bound_s: float
    resources: Resources
    requires: Requires = ()
    exact_offset_s: Fraction | None = None

    def offset(self) -> Fraction:
        """Bound of the host clock's offset against UTC [s], exactly."""
        return exactly(self.offset_bound_s, self.exact_offset_s)


NO_CLOCK = ClockOption(None, 0.0, Resources(Fraction(0), Fraction(0), Fraction(0)))


@dataclass(frozen=True, slots=True)
class ExcludedClock:
    """A clock that cannot work on its vehicle."""

    clock: ClockOption
    reason: str
    code: str
    figure: float | str | None = None
    limit: float | str | None = None


@dataclass(frozen=True, slots=True)
class VehicleTable:
    name: str
    stages: tuple[int, ...]
    clocks: tuple[ClockOption, ...]  # empty only where all that are offered are excluded
    excluded: tuple[ExcludedClock, ...] = ()


@dataclass(frozen=True, slots=True)
class Infrastructure:
    """Shared hardware: bought once per vehicle and per full set of channels."""

    id: str
    channels: int
    resources: Resources


@dataclass(frozen=True, slots=True)
class Pair:
    """Two roles whose timestamps meet: relative error bound tau_a + tau_b + timeline offset.

    role, reference: indices into Problem.roles; reference None: against true time, on UTC.
    rate_mps: how fast the estimate moves with that relative error (per_sensor model).
    """

    role: int
    reference: int | None
    rate_mps: float
    exact_rate_mps: Fraction | None = None

    def rate(self) -> Fraction:
        """Rate [m/s], exactly."""
        return exactly(self.rate_mps, self.exact_rate_mps)


@dataclass(frozen=True, slots=True)
class Nearer:
    """The near end of a stage's distances: sync is held against it as well.

    slower: by how much the sync rate v_max + d omega_max is smaller there [m/s].
    """

    stage: int
    slower: Fraction


@dataclass(frozen=True, slots=True)
class Limits:
    """The tightest limit of each kind with its requirement ids; None: not required.

    accuracy: total <= accuracy_m.  sync: every tau_i < sync * tau_crit_i and
    tau_sys < sync * tau_crit of the system (strict).  Budgets: sum <= limit, exact.
    """

    accuracy_m: float | None
    sync: float
    cost: Fraction | None = None
    mass: Fraction | None = None
    power: Fraction | None = None
    ids: tuple[tuple[str, str], ...] = field(default=())  # (kind, requirement id)
    spacing_m: float | None = None  # between two samples of a ranging sensor

    def budget(self, name: ResourceName) -> Fraction | None:
        """The budget of one resource, None when there is none."""
        if name == "cost":
            return self.cost
        return self.mass if name == "mass" else self.power


@dataclass(frozen=True, slots=True)
class SimulatedJudgement:
    """What simulation says of one design: ids of the requirements it fails or leaves open."""

    failed: tuple[str, ...] = ()
    undecided: tuple[str, ...] = ()

    @property
    def passed(self) -> bool:
        """Whether every simulated requirement is met."""
        return not self.failed and not self.undecided


@dataclass(frozen=True, slots=True, eq=False)
class Cut:
    """A sum over the roles that no design keeping a requirement exceeds.

    weights: of each role what each of its options adds; most: the sum's limit.
    """

    requirement: str
    weights: tuple[Floats, ...]
    most: float


class Judge(Protocol):
    """Requirements that sums do not decide: those on simulated quantiles.

    limits: (requirement id, limit [m]) of each.
    """

    @property
    def limits(self) -> tuple[tuple[str, float], ...]: ...

    @property
    def refusals(self) -> int:
        """How often a search ended because too many designs had been simulated."""
        ...

    def hopeless(self, problem: Problem, role: int, place: int) -> bool:
        """Whether an option's sensor alone, by its noise, fails a limit whatever joins it."""
        ...

    def cuts(self, problem: Problem, known: int = 0) -> Sequence[Cut]:
        """Sums that rule designs out, as learned so far, those after the first `known`."""
        ...

    def judge(self, problem: Problem, design: Design) -> SimulatedJudgement:
        """Simulate one design of a problem against every limit."""
        ...

    def reached_m(self, problem: Problem, design: Design, requirement: str) -> float:
        """A limit [m] that one design keeps, as near to its quantile as simulation tells."""
        ...

    def estimate_m(self, problem: Problem, design: Design, requirement: str) -> float:
        """The figure of one design [m] itself, as its verdict would show it."""
        ...

    def with_limits(self, limits: tuple[tuple[str, float], ...]) -> Judge:
        """The same with other limits; a requirement that is not named is lifted."""
        ...

    def spending(self, most: int) -> AbstractContextManager[None]:
        """A question that may simulate so many more designs, and leaves the rest to the next."""
        ...


@dataclass(frozen=True, slots=True)
class Problem:
    roles: tuple[RoleTable, ...]
    pairs: tuple[Pair, ...]
    vehicles: tuple[VehicleTable, ...]
    infrastructure: tuple[Infrastructure, ...]
    sync_rate_mps: float  # sum over stages of v_max + d omega_max
    fixed_error_m: float  # systematic terms of known effects, the same for every design
    limits: Limits
    sync_model: SyncModel
    objective: Objective
    exact_sync_rate_mps: Fraction | None = None
    exact_fixed_error_m: Fraction | None = None
    nearer: tuple[Nearer, ...] = ()  # of stages whose object is at several distances
    judge: Judge | None = field(default=None, compare=False)  # None: sums decide everything

    def fixed_error(self) -> Fraction:
        """Systematic terms that every design has [m], exactly."""
        return exactly(self.fixed_error_m, self.exact_fixed_error_m)

    def sync_rate(self) -> Fraction:
        """Sync rate of the chain [m/s], exactly."""
        return exactly(self.sync_rate_mps, self.exact_sync_rate_mps)

    def near_ends(self) -> Iterator[tuple[Nearer, ...]]:
        """Every way in which some of these stages are at their near end."""
        for count in range(1, len(self.nearer) + 1):
            yield from itertools.combinations(self.nearer, count)

    @property
    def combinations(self) -> int:
        """How many designs there are before any requirement."""
        count = 1
        for role in self.roles:
            count *= len(role.options)
        for vehicle in self.vehicles:
            count *= len(vehicle.clocks)
        return count


@dataclass(frozen=True, slots=True)
class Design:
    """What was chosen: an option index per role, a clock index per vehicle."""

    options: tuple[int, ...]
    clocks: tuple[int, ...]


def with_limits(problem: Problem, limits: Limits) -> Problem:
    """The same problem under other limits; relaxed ones of sync and spacing bring options back."""
    if limits.spacing_m != problem.limits.spacing_m:
        roles = tuple(table.settled(table.anywhere(), limits) for table in problem.roles)
        return replace(problem, roles=roles, limits=limits)
    if limits.sync == problem.limits.sync:
        return replace(problem, limits=limits)
    roles = tuple(table.with_pool(table.pool(), limits.sync) for table in problem.roles)
    return replace(problem, roles=roles, limits=limits)


def with_impossible(problem: Problem) -> Problem:
    """The problem with what cannot work put back: what a spec that pins it has to be judged by."""
    roles = []
    for table in problem.roles:
        back = [option for one in table.excluded.rest for option in one.impossible]
        if not back:
            roles.append(table)
            continue
        options = Options.of(sorted((*table.options, *back), key=lambda option: option.names))
        rest = [one for one in table.excluded.rest if not one.impossible]
        excluded = Exclusions.in_turn(rest, table.excluded.poor, table.excluded.beyond)
        roles.append(replace(table, options=options, excluded=excluded))
    vehicles = tuple(
        replace(v, clocks=(*v.clocks, *(one.clock for one in v.excluded)), excluded=())
        for v in problem.vehicles
    )
    return replace(problem, roles=tuple(roles), vehicles=vehicles)


def is_empty(problem: Problem) -> bool:
    """Whether a role has no option, or a vehicle no clock, so that there is no design at all."""
    return not all(len(role.options) for role in problem.roles) or not all(
        vehicle.clocks for vehicle in problem.vehicles
    )
