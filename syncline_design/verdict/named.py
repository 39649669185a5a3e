"""Designs in the names of the spec and its catalogs, and what is told of the choice."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from syncline_design.choice.outcome import PriceStep, Proof
from syncline_design.machine.records import Record, optional

Figure = float | str | None


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
    figure: Figure = None
    limit: Figure = None


@dataclass(frozen=True, slots=True, kw_only=True)
class FrontDesign(Record):
    """A point of a front; of cost, mass and power it has the one that the front sets against error.

    undecided: simulated requirements that its samples leave open.
    """

    cost: float | None = optional()
    mass: float | None = optional()
    power: float | None = optional()
    error_m: float
    design: NamedDesign
    undecided: tuple[str, ...] | None = optional()


@dataclass(frozen=True, slots=True)
class RankedDesign(Record):
    """A design among the best, with what it takes (None: an entry does not say) and reaches."""

    cost: float | None
    mass: float | None
    power: float | None
    error_m: float
    design: NamedDesign
    undecided: tuple[str, ...] | None = optional()


@dataclass(frozen=True, slots=True)
class ChoiceResult(Record):
    """The `choice` of a verdict; without a design, only what is known of one.

    front: of cost against error, where costs are known; front_left_out: what has no place on it.
    next_best: designs that differ in a sensor; next_best_every: of all designs.  excluded: a
    thousand rows at most, excluded_count: how many there are.
    """

    proof: Proof | None = optional()
    front: tuple[FrontDesign, ...] | None = optional()
    front_left_out: tuple[str, ...] | None = optional()
    staircase: tuple[PriceStep, ...] | None = optional()
    next_best: tuple[RankedDesign, ...] | None = optional()
    next_best_every: tuple[RankedDesign, ...] | None = optional()
    excluded: tuple[Exclusion, ...] | None = optional()
    excluded_count: int | None = optional()


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
