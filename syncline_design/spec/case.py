"""A case: a spec looked up in its catalogs, once.

Who works with a spec takes what a stage, a role or a vehicle may use from here and asks no catalog
again.  A what-if (`replace(case, spec=...)`, `replace(case, catalog=...)`) is a case of its own,
looked up anew as it is made, so that what was found never lags behind what was asked for.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field, replace
from datetime import date
from fractions import Fraction
from pathlib import Path
from typing import Generic, TypeVar

from syncline_design.machine.input_files import FileContent, FileRead
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.known import NOTHING_KNOWN as NOTHING_KNOWN
from syncline_design.model.known import EffectEntry
from syncline_design.model.known import Known as Known
from syncline_design.model.quantity import Dimension, Quantity, parse_quantity
from syncline_design.model.roles import ROLES, RoleName
from syncline_design.spec.catalog import (
    Catalog,
    ClockEntry,
    EntryKeys,
    InfrastructureEntry,
    PlatformEntry,
    Primitive,
    Product,
    SensorEntry,
    TimestampingEntry,
)
from syncline_design.spec.choices import (
    PLATFORM_FIGURES,
    InlineTimestamping,
    PlatformChoice,
    Query,
    RoleChoice,
    StageChoice,
)
from syncline_design.spec.requirement import DistanceLimit
from syncline_design.spec.spec import Requirement, Spec
from syncline_design.spec.yaml_text import KeyPath, TextPosition

E = TypeVar("E", bound=EntryKeys)
P = TypeVar("P", bound=Product)
Origins = Mapping[tuple[str, str], str]  # (section, id) to file:line:column
IN_PLACE = "spec"  # origin of what the spec itself gives


@dataclass(frozen=True, slots=True)
class CandidateEntry(Generic[E]):
    """An entry that a design may use; origin: `file:line:column` that defines it.

    owned: it is there already, so that the entry here costs nothing.
    """

    id: str
    entry: E
    origin: str = IN_PLACE
    owned: bool = False


@dataclass(frozen=True, slots=True)
class RoleCase:
    """What may take one role, in the order of the spec (of the catalog for a query).

    inline: a timestamp error given in place; there are no methods then.  incomplete: what answers
    the query but lacks a figure that the spec needs, by that figure.
    """

    role: RoleName
    choice: RoleChoice
    sensors: tuple[CandidateEntry[SensorEntry], ...]
    methods: tuple[CandidateEntry[TimestampingEntry], ...]
    inline: InlineTimestamping | None
    incomplete: tuple[tuple[str, str], ...] = ()  # (id, figure)

    def sensor(self, identity: str) -> SensorEntry | None:
        """The candidate sensor of that id."""
        return _named(self.sensors, identity)

    def method(self, identity: str) -> TimestampingEntry | None:
        """The candidate method of that id."""
        return _named(self.methods, identity)


@dataclass(frozen=True, slots=True)
class StageCase:
    """One stage with its platform, the roles that sensors take, and the clocks it offers."""

    index: int
    choice: StageChoice
    platform: CandidateEntry[PlatformEntry]
    roles: tuple[RoleCase, ...]
    clocks: tuple[CandidateEntry[ClockEntry], ...]

    @property
    def distances(self) -> tuple[float, float]:
        """Nearest and farthest distance of the object [m]; the same where there is only one."""
        far = self.platform.entry.distance
        span = self.choice.distance
        return (far, far) if span is None else ends_of(span)

    def role(self, name: RoleName) -> RoleCase | None:
        """One role; None where no sensor takes it."""
        return next((one for one in self.roles if one.role == name), None)


@dataclass(frozen=True, slots=True)
class Case:
    """A spec that can be worked with: its catalogs merged, every reference found.

    positions: key path, as in ("requirements", 0, "limit"), to (line, column); origins: where each
    catalog entry is defined; files: what was read besides.  Looked up as the case is made: stages,
    hardware (shared, of all that may be used, in the order of the catalogs) and effects (known).
    missions: of a spec that has them, each a case of its own; the spec itself is none of them.
    eased: by id what a waived requirement is in the choice; None: left out.
    """

    spec: Spec
    catalog: Catalog
    path: Path
    positions: dict[KeyPath, TextPosition] = field(repr=False)
    spec_sha256: str
    catalogs_sha256: str
    text: str = field(repr=False)
    origins: Origins = field(repr=False)
    files: tuple[FileRead, ...] = ()
    trajectory: FileContent | None = None
    missions: tuple[Mission, ...] = ()
    eased: Mapping[str, Fraction | None] = field(default_factory=dict)
    stages: tuple[StageCase, ...] = field(init=False, repr=False)
    hardware: Mapping[str, CandidateEntry[InfrastructureEntry]] = field(init=False, repr=False)
    effects: tuple[EffectEntry, ...] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        stages = tuple(_stage(self, index) for index in range(len(self.spec.stages)))
        object.__setattr__(self, "stages", stages)
        object.__setattr__(
            self, "spec", _limited(self.spec, float(stages[-1].platform.entry.distance))
        )
        object.__setattr__(self, "hardware", _hardware(self, stages))
        object.__setattr__(self, "effects", _effects(self.spec))

    @property
    def has_waivers(self) -> bool:
        """Whether what is said of it depends on the day: waivers end on one."""
        return bool(self.eased) or any(one.waiver is not None for one in self.spec.requirements)

    def judged_on(self, day: date) -> str | None:
        """The day as a provenance names it, of a spec whose waivers end on one."""
        return day.isoformat() if self.has_waivers else None

    def position(self, path: KeyPath) -> TextPosition:
        """Line and column of a key path, or of the nearest thing around it."""
        around = (path[:length] for length in range(len(path), -1, -1))
        return next((self.positions[one] for one in around if one in self.positions), (1, 1))

    def limit(self, requirement: Requirement) -> Fraction:
        """A requirement's limit exactly, in SI or in the spec's currency."""
        limit = requirement.limit
        if not isinstance(limit, Quantity):
            return Fraction(limit)
        return self.spec.in_currency(limit) if requirement.kind == "cost" else limit.exact

    def choice_limit(self, requirement: Requirement) -> Fraction | None:
        """What a design is chosen by: the limit, or what a waiver eases it to (None: nothing)."""
        return self.eased.get(requirement.id, self.limit(requirement))

    def clocks(self, vehicle: str) -> tuple[CandidateEntry[ClockEntry], ...]:
        """Clock disciplines that a vehicle's host may have; its stages agree on them."""
        aboard = (one for one in self.stages if one.choice.vehicle_name == vehicle)
        return next((one.clocks for one in aboard if one.clocks), ())

    def clock(self, vehicle: str, identity: str | None) -> ClockEntry | None:
        """A vehicle's clock of that id; None: its timelines are taken as common."""
        return _named(self.clocks(vehicle), identity)


@dataclass(frozen=True, slots=True)
class Mission:
    """One mission of a spec: the spec with the mission's overrides in place."""

    name: str
    case: Case


def _limited(spec: Spec, distance_m: float) -> Spec:
    """The spec with limits that grow with distance at their value for the last stage's."""
    if not any(isinstance(one.limit, DistanceLimit) for one in spec.requirements):
        return spec
    requirements = tuple(
        one.model_copy(update={"limit": DistanceLimit.at(one.limit.rule, distance_m)})
        if isinstance(one.limit, DistanceLimit)
        else one
        for one in spec.requirements
    )
    return spec.model_copy(update={"requirements": requirements})


def ends_of(span: Quantity) -> tuple[Quantity, Quantity]:
    """Both ends of an interval of lengths, each as it is written."""
    near, far = span.text.split("..")
    unit = far.split()[-1]
    texts = (near.strip() if not _is_bare(near) else f"{near.strip()} {unit}", far.strip())
    first, last = (parse_quantity(text, Dimension.LENGTH) for text in texts)
    return first, last


def _is_bare(text: str) -> bool:
    return len(text.split()) == 1


def _named(candidates: tuple[CandidateEntry[E], ...], identity: str | None) -> E | None:
    return next((one.entry for one in candidates if one.id == identity), None)


def _stage(case: Case, index: int) -> StageCase:
    choice, catalog, origins = case.spec.stages[index], case.catalog, case.origins
    platform = _platform(choice, catalog, origins)
    named = choice.clock.candidates if choice.clock is not None else ()
    return StageCase(
        index,
        choice,
        platform,
        tuple(
            _role(case, choice, name, role, platform.entry.distance)
            for name in ROLES
            if (role := choice.role(name)) is not None and not role.is_empty
        ),
        tuple(
            _bought(
                case, CandidateEntry(one, catalog.clocks[one], origins.get(("clocks", one), ""))
            )
            for one in named
        ),
    )


def _platform(
    stage: StageChoice, catalog: Catalog, origins: Origins
) -> CandidateEntry[PlatformEntry]:
    """The platform with the spec's keys put over the catalog's."""
    choice: PlatformChoice = stage.platform
    own = {
        key: value
        for key in (*PLATFORM_FIGURES, "source")
        if (value := getattr(choice, key)) is not None
    }
    if stage.distance is not None:  # figures of the platform are those at the far end
        own["distance"] = ends_of(stage.distance)[1]
    if choice.use is None:
        return CandidateEntry(choice.name or stage.name, PlatformEntry.model_validate(own))
    entry = catalog.platforms[choice.use].model_copy(update=own)
    return CandidateEntry(choice.use, entry, origins.get(("platforms", choice.use), ""))


def _role(
    case: Case, stage: StageChoice, name: RoleName, choice: RoleChoice, distance_m: float
) -> RoleCase:
    """Candidates of a role; timestamping is its own, else the stage's, else the spec's."""
    stamping = choice.timestamping or stage.timestamping or case.spec.timestamping
    inline = stamping if isinstance(stamping, InlineTimestamping) else None
    methods: tuple[str, ...] = ()
    if isinstance(stamping, str):
        methods = (stamping,)
    elif stamping is not None and not isinstance(stamping, InlineTimestamping):
        methods = stamping.candidates
    listed = case.catalog.timestamping
    sensors = tuple(
        replace(one, entry=one.entry.where(distance_m, stage.look))
        for one in _sensors(case, stage, name, choice)
    )
    incomplete = _incomplete(case, choice, sensors)
    without = {identity for identity, _ in incomplete}
    return RoleCase(
        name,
        choice,
        tuple(one for one in sensors if one.id not in without),
        tuple(
            CandidateEntry(one, listed[one], case.origins.get(("timestamping", one), ""))
            for one in methods
        ),
        inline,
        incomplete,
    )


def _incomplete(
    case: Case, choice: RoleChoice, sensors: tuple[CandidateEntry[SensorEntry], ...]
) -> tuple[tuple[str, str], ...]:
    """What a query finds without a figure that is due, unless nothing else answers it.

    Whoever lists ids means them: there a missing figure is an error.
    """
    if not isinstance(choice.candidates, Query):
        return ()
    due = figures_due(case.spec, True)
    found = tuple(
        (one.id, figure) for one in sensors for figure in due if getattr(one.entry, figure) is None
    )
    return found if len({identity for identity, _ in found}) < len(sensors) else ()


def figures_due(spec: Spec, is_open: bool) -> dict[str, str]:
    """Cost, mass or power where something needs it of every part, and what does."""
    due: dict[str, str] = {
        r.kind: f"requirement {r.id}"
        for r in spec.requirements
        if r.kind in ("cost", "mass", "power")
    }
    if spec.objective != "error" and is_open:
        due.setdefault(spec.objective, f"objective: {spec.objective}")
    return due


def _sensors(
    case: Case, stage: StageChoice, role: RoleName, choice: RoleChoice
) -> tuple[CandidateEntry[SensorEntry], ...]:
    if isinstance(choice.sensor, SensorEntry):  # named by itself, or by stage and role
        given = CandidateEntry(choice.sensor.name or f"{stage.name}.{role}", choice.sensor)
        return (_bought(case, given),)
    listed = case.catalog.sensors
    named: tuple[str, ...]
    if isinstance(choice.sensor, str):
        named = (choice.sensor,)
    elif isinstance(choice.candidates, Query):
        query = choice.candidates
        named = tuple(n for n, entry in listed.items() if _answers(case, query, n, entry, role))
    else:
        named = choice.candidates or ()
    return tuple(
        _bought(case, CandidateEntry(one, listed[one], case.origins.get(("sensors", one), "")))
        for one in named
    )


def _answers(case: Case, query: Query, identity: str, entry: SensorEntry, role: RoleName) -> bool:
    """Whether a sensor answers a query; what is owned costs nothing."""
    if identity in case.spec.owned:
        query = query.model_copy(update={"max_cost": None})
    return matches(query, entry, role, case.spec)


def _bought(case: Case, one: CandidateEntry[P]) -> CandidateEntry[P]:
    """A candidate as the spec has to pay for it: at no cost where it is owned."""
    if one.id not in case.spec.owned:
        return one
    return replace(one, entry=one.entry.at_no_cost(case.spec.currency), owned=True)


def matches(query: Query, entry: SensorEntry, role: RoleName, spec: Spec) -> bool:
    """Whether a sensor answers a query; it has to suit the role in any case."""
    if entry.modality != role or query.modality not in (None, entry.modality):
        return False
    if query.type is not None and query.type != entry.type:
        return False
    if query.max_cost is None or entry.cost is None:
        return query.max_cost is None
    if not spec.can_convert(query.max_cost) or not spec.can_convert(entry.cost):
        return True  # loading says that a rate is missing
    return spec.in_currency(entry.cost) <= spec.in_currency(query.max_cost)


def _hardware(
    case: Case, stages: tuple[StageCase, ...]
) -> Mapping[str, CandidateEntry[InfrastructureEntry]]:
    """Shared hardware that a candidate method or clock requires."""
    methods = (one.entry for stage in stages for role in stage.roles for one in role.methods)
    required = {name for method in methods for name in method.requires}
    required |= {name for stage in stages for one in stage.clocks for name in one.entry.requires}
    return {
        name: _bought(
            case, CandidateEntry(name, entry, case.origins.get(("infrastructure", name), ""))
        )
        for name, entry in case.catalog.infrastructure.items()
        if name in required
    }


def _effects(spec: Spec) -> tuple[EffectEntry, ...]:
    """Known effects where they act: unless it says so, in the only stage, or on the last target."""
    first, last = spec.stages[0].name, spec.stages[-1].name
    return tuple(
        EffectEntry(
            one.effect,
            one.sensor,
            one.stage or (last if one.sensor == "target" else first),
            tuple(
                (name, value if isinstance(value, str) else float(value))
                for name, value in one.parameters.items()
            ),
        )
        for one in spec.effects
    )


def usable_primitives(
    sensor: SensorEntry, method: TimestampingEntry, pinned: Primitive | None = None
) -> tuple[Primitive, ...]:
    """Primitives by which a method can stamp a sensor, in the sensor's order; arrival last.

    (sensor primitives + arrival) that the method serves.  With a pinned primitive only that one;
    a method of arrival stamps any sensor, whatever signal it could send besides.
    """
    if pinned is None:
        return tuple(p for p in sensor.serves if p in method.primitives)
    served = pinned in method.primitives or "arrival" in method.primitives
    return (pinned,) if pinned in sensor.serves and served else ()
