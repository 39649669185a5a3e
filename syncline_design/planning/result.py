"""What a plan says: typed, and written as JSON (schema syncline-design/plan/v1)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Final

from syncline_design.diagnosis.result import SpecRead
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.records import Record, SchemaName, Unbounded, optional

SCHEMA: Final = "syncline-design/plan/v1"


@dataclass(frozen=True, slots=True)
class PlannedLeg(Record):
    """One leg: from when to when [s], what to do, who drives, the heading it has after the turn
    with which it begins, and that turn (right: above 0)."""

    name: str
    from_s: float
    to_s: float
    words: str
    stage: str
    heading_deg: float
    turn_deg: float = 0.0


@dataclass(frozen=True, slots=True)
class After(Record):
    """What is known after a leg, in SI units by `effect(sensor).parameter`.

    sigma: standard uncertainty of what is asked, with the named pair (else all of --reach) and the
    noise free; null where the log says nothing of it.  sigma_all: with every applicable effect
    free, within the priors.  correlation: of the named pair, the largest canonical one.
    noncentrality: of the named pair where its size is known, which decides whether it is told.
    """

    leg: str
    sigma: Mapping[str, Unbounded]
    sigma_all: Mapping[str, Unbounded]
    correlation: float | None
    noncentrality: float | None = optional()


@dataclass(frozen=True, slots=True)
class ToldBack(Record):
    """The same of a pair the other way about: the effect named second, of these sizes [SI], over
    the first refitted."""

    noncentrality: float
    sizes: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class Separated(Record):
    """A pair of effects: correlation, noncentrality reached and asked.

    noncentrality: twice the log likelihood by which the true effect, of the size stated, beats its
    rival refitted, on average; sizes: of the first effect's parameters, SI.  back: the other way
    about, where no size is known: told apart is what is told both ways.  told_from: of a pair that
    is not told apart and whose size is not known, the sizes of each parameter alone from which this
    drive tells it, to first order, where they are plausible.
    """

    first: str
    second: str
    correlation: float
    noncentrality: float
    wanted: float
    separated: bool
    sizes: Mapping[str, float]
    told_from: Mapping[str, float] | None = optional()
    back: ToldBack | None = optional()


@dataclass(frozen=True, slots=True)
class StandardPlan(Record):
    """A line plan of the field beside the designed one.

    legs, minutes: what it takes, with the turns between the lines, to reach what is asked and to
    tell it from all that the designed drive tells it from; null where it never does.  sigma: in
    the time of the designed drive.
    """

    name: str
    legs: int | None
    sigma: Mapping[str, Unbounded]
    correlation: float | None
    minutes: float | None
    noncentrality: float | None = optional()


@dataclass(frozen=True, slots=True)
class PlannedTarget(Record):
    """A target to survey: its number and place in the local frame [m].

    name: of one that is surveyed already.
    """

    id: int
    north_m: float
    east_m: float
    down_m: float
    name: str | None = optional()

    @property
    def label(self) -> str:
        """What it is called wherever it stands: by its name, else by its number."""
        return self.name or str(self.id)


@dataclass(frozen=True, slots=True)
class Flown(Record):
    """A log held against what was asked: its duration, and what it tells.

    cautions: where it contradicts itself or what the platform can do, as another vehicle's does.
    confused: effects any of which, left free, would widen what was asked too far.
    """

    files: tuple[str, ...]
    duration_s: float
    rows: int
    sigma: Mapping[str, Unbounded]
    correlation: float | None
    reached: bool
    cautions: tuple[str, ...] | None = optional()
    confused: tuple[str, ...] | None = optional()
    noncentrality: float | None = optional()


@dataclass(frozen=True, slots=True)
class Lacking(Record):
    """What is furthest from what is asked, SI.

    what: a parameter, of which value is the sigma, or a pair, of which it is the noncentrality: of
    the effect named first over the other; beside: the other effect, with which left free that is
    the sigma.  asked: what value is held to.
    """

    what: str
    beside: str | None
    value: Unbounded
    asked: float


@dataclass(frozen=True, slots=True)
class DearLeg(Record):
    """A leg that takes more than half of a drive's time, and what fails without it."""

    leg: str
    lasts_s: float
    without: Lacking


@dataclass(frozen=True, slots=True)
class Untold(Record):
    """Another effect that no drive tells from some of what is asked: with it free, as large as is
    plausible, what is asked stays this uncertain (by its name, SI)."""

    effect: str
    sigma: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class HeldEffect(Record):
    """An effect that is asked and held as known, since together with others that are asked it makes
    no error whatever is driven: those are told beside it.

    parameters: which of its own.  beside: the others; none where no drive shows it at all.
    """

    effect: str
    parameters: tuple[str, ...]
    beside: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class CalmWater(Record):
    """A drive in calm water: whether it is enough there, and what it lacks where it is not."""

    reached: bool
    lacking: Lacking | None


@dataclass(frozen=True, slots=True)
class PlanProvenance(Record):
    """What the plan depends on."""

    version: str
    seed: int
    spec_sha256: str
    catalogs_sha256: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan(Record):
    """A drive and what it tells.

    reached: within the minutes, and told from every other effect that some drive tells it from.
    least_minutes: the least that does so, null where no drive does.  tolerance: what is asked, SI.
    inseparable: pairs that no drive of this platform tells apart.  confused: effects any of which,
    left free, would widen what is asked too far, though another drive tells them apart; none where
    it is reached.  unseen: effects, or those of their parameters, whose sigma with what is asked
    free beside stays above the tolerance where one is asked, else above 0.7 of its prior.  priors:
    standard deviations before the drive, what is plausible, SI.  dear: legs that take more than
    half of the time.  calm: of a vehicle in waves, whether it is enough without them.  assumed:
    figures of the platform that the spec does not state.
    surveyed: whether the targets were there already, and the drive is laid beside them.  sized:
    whether pairs are judged at a size that is known, beyond first order.  cautions: where what the
    plan was given may not be of this system.  alike: of the inseparable ones those that make the
    same error on every leg that this platform can drive.  untold: what has to be known otherwise,
    since no drive tells it from what is asked.  held: what is asked and no drive tells from what is
    asked besides, taken as known.
    """

    schema: Annotated[str, SchemaName(SCHEMA)] = SCHEMA
    reached: bool
    spec: SpecRead
    minutes: float
    duration_s: float
    least_minutes: float | None
    legs: tuple[PlannedLeg, ...]
    after: tuple[After, ...]
    tolerance: Mapping[str, float]
    pairs: tuple[Separated, ...]
    inseparable: tuple[str, ...]
    confused: tuple[str, ...]
    unseen: tuple[str, ...]
    columns: tuple[str, ...]
    rate_hz: float
    noise: str
    priors: Mapping[str, float]
    standard: tuple[StandardPlan, ...]
    targets: tuple[PlannedTarget, ...]
    surveyed: bool
    assumed: tuple[str, ...]
    origin_deg_m: tuple[float, float, float] | None
    provenance: PlanProvenance
    flown: Flown | None = optional()
    sized: bool | None = optional()
    cautions: tuple[str, ...] | None = optional()
    alike: tuple[str, ...] | None = optional()
    dear: tuple[DearLeg, ...] | None = optional()
    calm: CalmWater | None = optional()
    untold: tuple[Untold, ...] | None = optional()
    held: tuple[HeldEffect, ...] | None = optional()

    @property
    def exit_code(self) -> int:
        """0 reached, 1 not in these minutes."""
        return 0 if self.reached else 1
