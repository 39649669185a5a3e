"""What the choices of a spec mean in the catalogs: platforms, candidates, methods, primitives."""

from __future__ import annotations

from syncline_design.spec.catalog import (
    Catalog,
    ClockEntry,
    InfrastructureEntry,
    PlatformEntry,
    Primitive,
    SensorEntry,
    TimestampingEntry,
)
from syncline_design.spec.spec import (
    InlineTimestamping,
    MethodChoice,
    PlatformChoice,
    Query,
    Role,
    RoleChoice,
    Spec,
    StageChoice,
)

Methods = tuple[tuple[str, TimestampingEntry], ...]


def platform_of(choice: PlatformChoice, catalog: Catalog) -> PlatformEntry:
    """The platform with the spec's keys put over the catalog's."""
    own = {
        key: value
        for key in ("name", "v_max", "omega_max", "distance", "baseline", "source")
        if (value := getattr(choice, key)) is not None
    }
    if choice.use is None:
        return PlatformEntry.model_validate(own)
    return catalog.platforms[choice.use].model_copy(update=own)


def sensor_id(entry: SensorEntry, stage: StageChoice, role: Role) -> str:
    """Name of a sensor given in place: its own, or stage and role."""
    return entry.name or f"{stage.name}.{role}"


def candidate_sensors(
    spec: Spec, stage: StageChoice, role: Role, catalog: Catalog
) -> tuple[tuple[str, SensorEntry], ...]:
    """Sensors that may take a role, in the order of the spec (of the catalog for a query)."""
    choice = stage.role(role)
    if choice is None or choice.is_empty:
        return ()
    if isinstance(choice.sensor, SensorEntry):
        return ((sensor_id(choice.sensor, stage, role), choice.sensor),)
    if isinstance(choice.sensor, str):
        return ((choice.sensor, catalog.sensors[choice.sensor]),)
    if isinstance(choice.candidates, Query):
        return tuple(
            (identity, entry)
            for identity, entry in catalog.sensors.items()
            if matches(choice.candidates, entry, role, spec)
        )
    return tuple((identity, catalog.sensors[identity]) for identity in choice.candidates or ())


def matches(query: Query, entry: SensorEntry, role: Role, spec: Spec) -> bool:
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


def timestamping_of(
    spec: Spec, stage: StageChoice, role: RoleChoice, catalog: Catalog
) -> Methods | InlineTimestamping:
    """Timestamping of a role: its own, else the stage's, else the spec's."""
    choice = role.timestamping or stage.timestamping or spec.timestamping
    if isinstance(choice, InlineTimestamping):
        return choice
    if isinstance(choice, str):
        choice = MethodChoice.model_construct(candidates=(choice,))
    identities = choice.candidates if choice is not None else ()
    return tuple((identity, catalog.timestamping[identity]) for identity in identities)


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


def clocks_of(stage: StageChoice, catalog: Catalog) -> tuple[tuple[str, ClockEntry], ...]:
    """Clock disciplines that a stage lets its host choose from."""
    identities = stage.clock.candidates if stage.clock is not None else ()
    return tuple((identity, catalog.clocks[identity]) for identity in identities)


def infrastructure_of(
    requires: dict[str, int], catalog: Catalog
) -> tuple[tuple[str, InfrastructureEntry], ...]:
    """Shared hardware whose channels are required."""
    return tuple((identity, catalog.infrastructure[identity]) for identity in requires)
