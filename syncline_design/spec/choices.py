"""What a spec leaves open or pins: platforms, sensors, methods, clocks, stages."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, PlainValidator, model_validator

from syncline_design.model.roles import RoleName
from syncline_design.spec.catalog import DriveArea, ErrorEntry, Motion, Primitive, SensorEntry
from syncline_design.spec.effects_listed import EffectChoice as EffectChoice
from syncline_design.spec.facts import (
    DistanceInterval,
    FieldOfView,
    Medium,
    OneDistance,
    Reflectivity,
    TemperatureInterval,
)
from syncline_design.spec.fields import (
    Acceleration,
    AngularAcceleration,
    AngularRate,
    FileRecord,
    Money,
    NonEmptyText,
    NonNegativeLength,
    PositiveSpeed,
    Speed,
    Vector,
    YesNo,
    kind_of,
    read_ids,
    refusal,
    refusals,
)
from syncline_design.spec.log_block import LogChoice as LogChoice
from syncline_design.spec.log_block import split_column as split_column

# What a spec may say of a platform, put over the catalog's.
PLATFORM_FIGURES = (
    "name", "v_max", "omega_max", "distance", "baseline", "medium", "motion", "acceleration",
    "angular_acceleration", "minimum_turn_radius", "minimum_speed", "area", "height",
)  # fmt: skip


class PlatformChoice(FileRecord):
    """A catalog id (`use`) with keys overridden, or all keys given."""

    use: NonEmptyText | None = None
    name: str | None = None
    v_max: Speed | None = None
    omega_max: AngularRate | None = None
    distance: OneDistance | None = None
    baseline: NonNegativeLength | None = None
    medium: Medium | None = None
    motion: Motion | None = None
    acceleration: Acceleration | None = None
    angular_acceleration: AngularAcceleration | None = None
    minimum_turn_radius: NonNegativeLength | None = None
    minimum_speed: Speed | None = None
    area: DriveArea | None = None
    height: NonNegativeLength | None = None
    source: str | None = None
    note: str = ""

    @model_validator(mode="after")
    def _complete_without_use(self) -> PlatformChoice:
        keys = ("v_max", "omega_max", "baseline")  # the stage looks after the distance
        absent = [key for key in keys if getattr(self, key) is None]
        if self.use is None and absent:
            hint = "or name a catalog platform: {use: ID}"
            raise refusals(((key,), refusal("missing", hint=hint)) for key in absent)
        return self


class Query(FileRecord):
    """A catalog query: every key given must match."""

    modality: RoleName | None = None
    type: NonEmptyText | None = None
    max_cost: Money | None = None


def _read_candidates(value: Any) -> tuple[str, ...] | Query:
    if isinstance(value, dict | Query):
        return Query.model_validate(value)
    if not isinstance(value, tuple | list):
        wanted = "a list of sensor ids, or a query such as {modality: attitude}"
        raise refusal("not candidates", wanted, kind_of(value))
    return read_ids(value, "sensor")


class MethodChoice(FileRecord):
    """Timestamping methods to choose from."""

    candidates: Annotated[
        tuple[str, ...], BeforeValidator(lambda value: read_ids(value, "timestamping"))
    ]


class InlineTimestamping(FileRecord):
    """A role's timestamp error given in place, without method or hardware."""

    error: ErrorEntry
    timeline: Literal["host", "utc"] = "host"


class ClockChoice(FileRecord):
    """Clock disciplines of a vehicle's host to choose from."""

    candidates: Annotated[tuple[str, ...], BeforeValidator(lambda value: read_ids(value, "clock"))]


def _read_role_timestamping(value: Any) -> str | MethodChoice | InlineTimestamping:
    if isinstance(value, MethodChoice | InlineTimestamping) or (isinstance(value, str) and value):
        return value
    if isinstance(value, dict) and "error" in value:
        return InlineTimestamping.model_validate(value)
    if isinstance(value, dict) and "candidates" in value:
        return MethodChoice.model_validate(value)
    wanted = "a method id, {candidates: [...]}, or {error: {...}}"
    raise refusal("not a timestamping choice", wanted, kind_of(value))


def one_or_candidates(what: str, model: type[FileRecord]) -> BeforeValidator:
    """A bare id stands for a list of one candidate."""

    def widen(value: Any) -> Any:
        if isinstance(value, str) and value:
            return {"candidates": (value,)}
        if not isinstance(value, dict | FileRecord):
            raise refusal(
                f"not a {what} choice", f"a {what} id, or {{candidates: [...]}}", kind_of(value)
            )
        return value

    return BeforeValidator(widen, json_schema_input_type=str | model)


def _read_sensor(value: Any) -> str | SensorEntry:
    if isinstance(value, dict | SensorEntry):
        return SensorEntry.model_validate(value)
    if isinstance(value, str) and value:
        return value
    wanted = "a sensor id, or a mapping with the catalog's keys"
    hint = "put the id in quotes" if isinstance(value, int | float) else ""
    raise refusal("not a sensor", wanted, kind_of(value), hint)


class RoleChoice(FileRecord):
    """One role: pinned by `sensor`, or open with `candidates` (ids or a query).

    A later stage's position has neither: the chain before it is its position.
    """

    sensor: Annotated[
        str | SensorEntry | None,
        PlainValidator(_read_sensor, json_schema_input_type=str | SensorEntry),
    ] = None
    candidates: Annotated[
        tuple[str, ...] | Query | None,
        PlainValidator(_read_candidates, json_schema_input_type=tuple[str, ...] | Query),
    ] = None
    primitive: Primitive | None = None
    timestamping: Annotated[
        str | MethodChoice | InlineTimestamping | None,
        PlainValidator(
            _read_role_timestamping,
            json_schema_input_type=str | MethodChoice | InlineTimestamping,
        ),
    ] = None
    lever_arm: Vector | None = None
    per_mission: YesNo = False  # whether each mission may have a sensor of its own
    note: str = ""

    @model_validator(mode="after")
    def _pinned_or_open(self) -> RoleChoice:
        if self.sensor is not None and self.candidates is not None:
            error = refusal("both sensor and candidates", "one of them", hint="delete one")
            raise refusals([(("candidates",), error)])
        return self

    @property
    def is_empty(self) -> bool:
        """Whether neither a sensor nor candidates are named."""
        return self.sensor is None and self.candidates is None


def _widen_platform(value: Any) -> Any:
    if isinstance(value, str) and value:
        return {"use": value}
    if not isinstance(value, dict | PlatformChoice):
        wanted = (
            "a platform id, {use: ID, ...}, or a mapping with v_max, omega_max, distance, baseline"
        )
        raise refusal("not a platform", wanted, kind_of(value))
    return value


class StageChoice(FileRecord):
    """One vehicle that georeferences something."""

    name: NonEmptyText
    platform: Annotated[
        PlatformChoice,
        BeforeValidator(_widen_platform, json_schema_input_type=str | PlatformChoice),
    ]
    vehicle: NonEmptyText | None = None
    position: RoleChoice | None = None
    attitude: RoleChoice | None = None
    ranging: RoleChoice | None = None
    timestamping: Annotated[
        MethodChoice | None, one_or_candidates("timestamping", MethodChoice)
    ] = None
    clock: Annotated[ClockChoice | None, one_or_candidates("clock", ClockChoice)] = None
    gnss: YesNo | None = None  # None: yes for a first stage that is not at a depth
    depth: NonNegativeLength | None = None
    medium: Literal["air", "water"] | None = None  # of the path to the object
    look: FieldOfView | None = None  # where the ranging sensor has to look
    temperature: TemperatureInterval | None = None
    reflectivity: Reflectivity | None = None  # of the object
    sound_speed: PositiveSpeed | None = None  # in the water; None: 1500 m/s
    timing_from: NonEmptyText | None = None  # stage that GNSS time comes from, by a cable
    distance: DistanceInterval | None = None  # NEAR .. FAR: every distance between counts
    note: str = ""

    @model_validator(mode="after")
    def _one_distance(self) -> StageChoice:
        own = self.platform.distance
        if self.distance is not None and own is not None:
            error = refusal("distance given twice", "one of them", hint="delete the platform's")
            raise refusals([(("distance",), error)])
        if self.distance is not None and (self.ranging is None or self.ranging.is_empty):
            message = "a distance of a stage that ranges nothing"
            raise refusals([(("distance",), refusal(message, hint="delete it"))])
        if self.platform.use is None and self.distance is None and own is None:
            hint = "or name a catalog platform: {use: ID}"
            raise refusals([(("platform", "distance"), refusal("missing", hint=hint))])
        return self

    def role(self, name: RoleName) -> RoleChoice | None:
        """The choice of one role."""
        return {"position": self.position, "attitude": self.attitude, "ranging": self.ranging}[name]

    @property
    def vehicle_name(self) -> str:
        """The vehicle: the stage itself unless `vehicle` says that stages share one."""
        return self.vehicle or self.name
