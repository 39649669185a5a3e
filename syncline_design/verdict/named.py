"""Designs in the names of the spec and its catalogs, and what is told of the choice."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Literal

from syncline_design.choice.outcome import PriceStep, Proof
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.records import Record, optional

FactFigure = float | str | None


@dataclass(frozen=True, slots=True)
class NamedRole(Record):
    """Who takes a role, how it is stamped, and with what errors.

    tau_crit_lever_arm_s: its tau_crit where lever arms count.
    """

    sensor: str
    name: str
    primitive: str
    timestamping: str
    timestamping_name: str
    timeline: str
    tau_s: float
    tau_crit_s: float | None
    tau_crit_lever_arm_s: float | None
    sensor_error_m: float
    cost: float | None
    mass: float | None
    power: float | None


@dataclass(frozen=True, slots=True)
class NamedStage(Record):
    """A stage of a design; platform: its id; roles: by `position`, `attitude`, `ranging`."""

    name: str
    vehicle: str
    platform: str
    roles: Mapping[str, NamedRole]


@dataclass(frozen=True, slots=True)
class SharedHardware(Record):
    """Hardware that several sensors of a vehicle share; cost: of all units together."""

    id: str
    name: str
    vehicle: str
    count: int
    cost: float | None


@dataclass(frozen=True, slots=True)
class HostClock(Record):
    """The clock that a vehicle's host keeps time by."""

    vehicle: str
    id: str
    name: str
    offset_bound_s: float
    cost: float | None


@dataclass(frozen=True, slots=True)
class BillLine(Record):
    """What is bought for a stage (or a vehicle of several): cost, mass, power of all pieces.

    use: what it is for; item: its name; entry: its id in the catalog; basis: what its figures
    stand on.  Money is in the spec's currency, to the cent.  None: the entry does not say.
    missions: those that it is bought for, where not for all of several.
    """

    stage: str
    use: str
    item: str
    entry: str
    quantity: int
    cost: float | None
    mass: float | None
    power: float | None
    basis: str
    missions: tuple[str, ...] | None = optional()


@dataclass(frozen=True, slots=True)
class NamedDesign(Record):
    """A design in the names of the spec and its catalogs, the `design` of a verdict.

    A sum is None where an entry does not say its part.
    """

    cost: float | None
    mass: float | None
    power: float | None
    currency: str
    infrastructure: tuple[SharedHardware, ...]
    clocks: tuple[HostClock, ...]
    stages: tuple[NamedStage, ...]

    @property
    def roles(self) -> Iterator[tuple[NamedStage, str, NamedRole]]:
        """Every role in order, with its stage and name."""
        return ((s, name, role) for s in self.stages for name, role in s.roles.items())


@dataclass(frozen=True, slots=True)
class Exclusion(Record):
    """What was ruled out before the choice: a sensor, one of its options, or a clock.

    primitive and method: None where the reason is the sensor's; role: `clock` for a clock.  figure:
    what the entry says; limit: what is asked of it.
    """

    stage: str
    role: str
    sensor: str | None
    primitive: str | None
    method: str | None
    reason: str
    code: str = ""
    figure: FactFigure = None
    limit: FactFigure = None


@dataclass(frozen=True, slots=True, kw_only=True)
class FrontDesign(Record):
    """A point of a front; of cost, mass and power it has the one that the front sets against error.

    undecided: simulated requirements that its samples leave open; figure_m: the figure of the
    error that the front is drawn over, where it is not the Syncline's.
    """

    cost: float | None = optional()
    mass: float | None = optional()
    power: float | None = optional()
    error_m: float
    design: NamedDesign
    undecided: tuple[str, ...] | None = optional()
    figure_m: float | None = optional()


@dataclass(frozen=True, slots=True)
class StampingRange(Record):
    """Designs of the same sensors, however they are stamped and whatever clocks there are.

    designs: how many meet every requirement (simulated false: every sum; what is simulated was not
    asked); cost, error_m: the least and the most of them.
    """

    designs: int
    cost: tuple[float, float] | None
    error_m: tuple[float, float]
    simulated: bool


@dataclass(frozen=True, slots=True)
class RankedDesign(Record):
    """A design among the best, with what it takes (None: an entry does not say) and reaches.

    stampings: where it stands for all designs of its sensors, their range; not there where they
    are too many to be counted.
    """

    cost: float | None
    mass: float | None
    power: float | None
    error_m: float
    design: NamedDesign
    undecided: tuple[str, ...] | None = optional()
    stampings: StampingRange | None = optional()


@dataclass(frozen=True, slots=True)
class Alternative(Record):
    """The best design without one of the sensors of the chosen one.

    places: the roles that the sensor takes; instead: what every role takes that then changes, as
    `uav.position: trimble_r12_rtk by pps, hardware`.  dearer_by, worse_by: than the chosen design.
    Of a spec that has no design without it, all but the verdict is null or empty.
    """

    sensor: str
    places: tuple[str, ...]
    verdict: Literal["meets", "infeasible", "indeterminate"]
    cost: float | None
    error_m: float | None
    dearer_by: float | None
    worse_by: float | None
    instead: tuple[str, ...]
    design: NamedDesign | None


@dataclass(frozen=True, slots=True)
class Bargain(Record):
    """A step of the exact front of cost from the chosen design that is worth a thought.

    better: `extra` more money takes the error from `error_from_m` to `error_to_m`, at least 5 % off
    and at least twice the share by which the price rises.  cheaper: `extra` (below 0) if the error
    may grow from `error_from_m` (the limit, where it is the price that is least) to `error_to_m`.
    """

    kind: Literal["better", "cheaper"]
    extra: float
    cost: float
    error_from_m: float
    error_to_m: float
    design: NamedDesign


@dataclass(frozen=True, slots=True)
class MissedLimit(Record):
    """A requirement that the nearest design misses: what it reaches of what is asked."""

    requirement: str | None
    kind: str
    value: float
    limit: float
    unit: str
    limit_written: str | None = optional()


@dataclass(frozen=True, slots=True)
class PricedError(Record):
    """A design of the front of an infeasible spec: what it costs, how much it errs, what it misses.

    misses: the tightest requirements on cost and accuracy that it does not keep.
    """

    cost: float
    error_m: float
    misses: tuple[MissedLimit, ...] | None = optional()
    design: NamedDesign | None = optional()


@dataclass(frozen=True, slots=True)
class Nearest(Record):
    """The best design once the limits are moved that need to move least, as a share of themselves.

    front: of cost against error over the designs that keep every sum but cost and accuracy, where
    prices are known.
    """

    cost: float | None
    mass: float | None
    power: float | None
    error_m: float
    misses: tuple[MissedLimit, ...]
    design: NamedDesign
    front: tuple[PricedError, ...]


@dataclass(frozen=True, slots=True)
class CloudDesign(Record):
    """One of all designs, for a picture; payload: sensors and how each is stamped.

    breaks: kinds of requirement that its sums break, accuracy aside, or `simulated`; what is
    simulated is not asked of designs that the front beats.
    """

    cost: float
    error_m: float
    payload: str
    breaks: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class FiguredDesign(Record):
    """A design of the front of cost against error by another figure of the error [m].

    beaten: whether one that costs no more has a smaller figure, or one larger by 0.1 % at most.
    """

    cost: float
    figure_m: float
    error_m: float
    design: NamedDesign
    beaten: bool


@dataclass(frozen=True, slots=True)
class FrontByFigure(Record):
    """The designs of the front by the figure of the error that a requirement limits."""

    requirement: str
    figure: str
    limit_m: float
    designs: tuple[FiguredDesign, ...]


@dataclass(frozen=True, slots=True)
class ChoiceResult(Record):
    """The `choice` of a verdict; without a design, only what is known of one.

    front: of cost against error, where costs are known; front_left_out: what has no place on it.
    next_best: designs that differ in a sensor; next_best_every: of all designs.  excluded: a
    thousand rows at most, excluded_count: how many there are.  alternatives: without a sensor each;
    bargains: what a little more money, or a little more error, would buy.  cloud: all designs, or
    a sample of them, by_figure: the designs of the front by the figure that the tightest
    requirement on one limits, both where a picture was asked for.
    """

    proof: Proof | None = optional()
    front: tuple[FrontDesign, ...] | None = optional()
    front_left_out: tuple[str, ...] | None = optional()
    staircase: tuple[PriceStep, ...] | None = optional()
    next_best: tuple[RankedDesign, ...] | None = optional()
    next_best_every: tuple[RankedDesign, ...] | None = optional()
    excluded: tuple[Exclusion, ...] | None = optional()
    excluded_count: int | None = optional()
    alternatives: tuple[Alternative, ...] | None = optional()
    bargains: tuple[Bargain, ...] | None = optional()
    cloud: tuple[CloudDesign, ...] | None = optional()
    by_figure: FrontByFigure | None = optional()


@dataclass(frozen=True, slots=True)
class ExplainedStep(Record):
    """One figure: its name, its formula in symbols, the numbers put in (SI), its value, whence."""

    name: str
    formula: str
    numbers: str
    value: float
    unit: str
    source: str = ""


@dataclass(frozen=True, slots=True)
class ExplainedRequirement(Record):
    """A requirement's value, worked out step by step; the last step is its value."""

    id: str
    kind: str
    limit: float
    unit: str
    steps: tuple[ExplainedStep, ...]
    limit_written: str | None = optional()
