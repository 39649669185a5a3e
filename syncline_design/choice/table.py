"""The design problem as tables: options per role, every constant resolved, no physics left in it.

Floats are what the fast roads add up; `exact_*` hold the same figure as a fraction where the
spec's decimal text gives more (None: the float itself is exact).  `problem.build_problem` makes
these tables from a loaded spec.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Literal, Protocol

from syncline_design.model.roles import RoleName

Objective = Literal["cost", "mass", "power", "error"]
ResourceName = Literal["cost", "mass", "power"]
SyncModel = Literal["syncline", "per_sensor"]
RESOURCES: tuple[ResourceName, ...] = ("cost", "mass", "power")


@dataclass(frozen=True, slots=True)
class Resources:
    """What a choice uses up, exactly as written; None: the catalog does not say."""

    cost: Fraction | None = None  # in the spec's currency
    mass: Fraction | None = None  # kg
    power: Fraction | None = None  # W

    def of(self, name: ResourceName) -> Fraction | None:
        """The amount of one resource."""
        if name == "cost":
            return self.cost
        return self.mass if name == "mass" else self.power


@dataclass(frozen=True, slots=True)
class Option:
    """One (sensor, primitive, timestamping method) for a role, every constant resolved."""

    sensor: str
    primitive: str
    method: str
    sensor_error_m: float  # this sensor's term of the roof
    tau_s: float  # bound of its timestamp error, with what known effects add
    tau_crit_s: float  # inf when motion does not matter
    timeline: Literal["host", "utc"]
    resources: Resources  # sensor plus timestamping, per sensor
    requires: tuple[tuple[str, int], ...] = ()  # (infrastructure id, channels)
    exact_error_m: Fraction | None = None
    exact_tau_s: Fraction | None = None
    systematic_m: float = 0.0  # known effects whose size hangs on this sensor
    exact_systematic_m: Fraction | None = None
    noise_systematic_m: Fraction = Fraction(0)  # the share of it that is in proportion to the noise
    own_rate_mps: Fraction | None = None  # what the sensor's own tau_crit is taken against

    @property
    def names(self) -> tuple[str, str, str]:
        """What tells this option from the others of its role; ties are broken by it."""
        return (self.sensor, self.primitive, self.method)

    def error(self) -> Fraction:
        """Sensor error [m], exactly."""
        return exactly(self.sensor_error_m, self.exact_error_m)

    def tau(self) -> Fraction:
        """Bound of the timestamp error [s], exactly."""
        return exactly(self.tau_s, self.exact_tau_s)

    def systematic(self) -> Fraction:
        """Known systematic error that comes with this sensor [m], exactly."""
        return exactly(self.systematic_m, self.exact_systematic_m)


@dataclass(frozen=True, slots=True)
class Excluded:
    """A candidate removed before the choice, with the reason in words and by how much it misses.

    primitive, method: empty where the reason is the sensor's.
    """

    sensor: str
    primitive: str
    method: str
    reason: str
    ratio: float | None = None  # tau / tau_crit where that is the reason
    option: Option | None = None  # what it would be, were the sync limit relaxed
    code: str = "primitive"
    figure: float | str | None = None  # what the entry says
    limit: float | str | None = None  # what is asked of it
    impossible: tuple[Option, ...] = ()  # what cannot work here, whatever limit is relaxed


@dataclass(frozen=True, slots=True)
class RoleTable:
    """Options of one role; no two of them have the same names."""

    stage: int
    stage_name: str
    role: RoleName
    vehicle: int
    options: tuple[Option, ...]
    excluded: tuple[Excluded, ...] = ()


@dataclass(frozen=True, slots=True)
class ClockOption:
    """How a vehicle's host clock is disciplined; id None: timelines taken as common."""

    id: str | None
    offset_bound_s: float
    resources: Resources
    requires: tuple[tuple[str, int], ...] = ()
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

    def budget(self, name: ResourceName) -> Fraction | None:
        """The budget of one resource, None when there is none."""
        if name == "cost":
            return self.cost
        return self.mass if name == "mass" else self.power


@dataclass(frozen=True, slots=True)
class Judgement:
    """What simulation says of one design: ids of the requirements it fails or leaves open."""

    failed: tuple[str, ...] = ()
    undecided: tuple[str, ...] = ()

    @property
    def passed(self) -> bool:
        """Whether every simulated requirement is met."""
        return not self.failed and not self.undecided


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

    def hopeless(self, problem: Problem, role: int, option: Option) -> bool:
        """Whether a sensor's noise alone already fails a limit, whatever it is combined with."""
        ...

    def judge(self, problem: Problem, design: Design) -> Judgement:
        """Simulate one design of a problem against every limit."""
        ...

    def reached_m(self, problem: Problem, design: Design, requirement: str) -> float:
        """A limit [m] that one design keeps, as near to its quantile as simulation tells."""
        ...

    def with_limits(self, limits: tuple[tuple[str, float], ...]) -> Judge:
        """The same with other limits; a requirement that is not named is lifted."""
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
    judge: Judge | None = field(default=None, compare=False)  # None: sums decide everything

    def fixed_error(self) -> Fraction:
        """Systematic terms that every design has [m], exactly."""
        return exactly(self.fixed_error_m, self.exact_fixed_error_m)

    def sync_rate(self) -> Fraction:
        """Sync rate of the chain [m/s], exactly."""
        return exactly(self.sync_rate_mps, self.exact_sync_rate_mps)

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


def exactly(value: float, fraction: Fraction | None) -> Fraction:
    """The exact figure behind a float: the fraction where there is one, else the float itself."""
    return Fraction(value) if fraction is None else fraction


def with_limits(problem: Problem, limits: Limits) -> Problem:
    """The same problem under other limits; a relaxed sync limit brings excluded options back."""
    if limits.sync == problem.limits.sync:
        return replace(problem, limits=limits)
    roles = tuple(_under_sync_limit(table, limits.sync) for table in problem.roles)
    return replace(problem, roles=roles, limits=limits)


def sync_ratio(option: Option) -> float:
    """tau / tau_crit of one option, rounded once; 0 where motion does not matter."""
    if option.tau_crit_s == float("inf") or option.tau_s == 0.0:
        return 0.0
    if option.own_rate_mps is not None:
        caused, error = option.tau() * option.own_rate_mps, option.error()
        return float(caused / error) if error > 0 else float("inf")
    return option.tau_s / option.tau_crit_s if option.tau_crit_s > 0.0 else float("inf")


def breaks_own_tau_crit(option: Option, ratio: float) -> Excluded:
    """The record of an option whose timestamps are too poor for its own noise."""
    reason = (
        f"its timestamp error reaches {ratio:.3g} times its own tau_crit: the sensor would be "
        "limited by its timestamps, not by its noise"
    )
    limit = option.tau_s / ratio if 0.0 < ratio < math.inf else option.tau_crit_s
    return Excluded(
        *option.names, reason, ratio, option, code="tau", figure=option.tau_s, limit=limit
    )


def with_impossible(problem: Problem) -> Problem:
    """The problem with what cannot work put back: what a spec that pins it has to be judged by."""
    roles = []
    for table in problem.roles:
        back = [option for one in table.excluded for option in one.impossible]
        options = tuple(sorted((*table.options, *back), key=lambda option: option.names))
        rest = tuple(one for one in table.excluded if not one.impossible)
        roles.append(replace(table, options=options, excluded=rest))
    vehicles = tuple(
        replace(v, clocks=(*v.clocks, *(one.clock for one in v.excluded)), excluded=())
        for v in problem.vehicles
    )
    return replace(problem, roles=tuple(roles), vehicles=vehicles)


def is_empty(problem: Problem) -> bool:
    """Whether a role has no option, or a vehicle no clock, so that there is no design at all."""
    return not all(role.options for role in problem.roles) or not all(
        vehicle.clocks for vehicle in problem.vehicles
    )


def _under_sync_limit(table: RoleTable, limit: float) -> RoleTable:
    """Options and exclusions of a role sorted anew under another sync limit."""
    pool = [(option, sync_ratio(option)) for option in table.options]
    pool += [
        (one.option, one.ratio)
        for one in table.excluded
        if one.option is not None and one.ratio is not None
    ]
    pool.sort(key=lambda entry: entry[0].names)
    keep = tuple(option for option, ratio in pool if ratio < limit)
    out = tuple(breaks_own_tau_crit(option, ratio) for option, ratio in pool if not ratio < limit)
    return replace(
        table,
        options=keep,
        excluded=(*(one for one in table.excluded if one.option is None), *out),
    )
