"""The system spec: what is wanted, as read from YAML."""

from __future__ import annotations

import math
from datetime import date
from fractions import Fraction
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, PlainValidator, ValidationInfo, model_validator
from pydantic import field_validator as reads_field
from pydantic_core import PydanticCustomError

from syncline_design.model.horizon import DEFAULT_HORIZON, Horizon
from syncline_design.model.quantity import CURRENCIES, Dimension, Quantity
from syncline_design.model.roles import RoleName
from syncline_design.spec.catalog import ErrorEntry, Primitive, SensorEntry
from syncline_design.spec.effects_listed import EffectChoice as EffectChoice
from syncline_design.spec.fields import (
    AngularRate,
    AtLeastOne,
    FileRecord,
    Money,
    NonNegativeAngle,
    NonNegativeLength,
    NonNegativeTime,
    PositiveLength,
    PositiveMoney,
    PositiveNumber,
    Speed,
    Text,
    Vector,
    YesNo,
    did_you_mean,
    kind_of,
    read_ids,
    read_number,
    read_quantity,
    refusal,
    refusals,
)
from syncline_design.spec.log_block import LogChoice as LogChoice
from syncline_design.spec.log_block import split_column as split_column
from syncline_design.spec.yaml_text import KeyPath

MOST_REQUIREMENTS = 1_000
MOST_STAGES = 32  # the work grows with the square of their number; chains have two or three
MOST_EFFECTS = 1_000  # each acts on every simulated sample; a system is known by a few

LIMIT_DIMENSIONS: dict[str, Dimension] = {
    "accuracy": Dimension.LENGTH,
    "sync": Dimension.DIMENSIONLESS,
    "cost": Dimension.MONEY,
    "mass": Dimension.MASS,
    "power": Dimension.POWER,
    "monte_carlo": Dimension.LENGTH,
}


class Waiver(FileRecord):
    """Why a requirement may be missed, and until when."""

    reason: Text
    expires: str  # a date, 2027-01-31; the requirement counts again after it

    @reads_field("expires", mode="after")
    @classmethod
    def _is_date(cls, value: str) -> str:
        try:
            date.fromisoformat(value)
        except ValueError:
            raise refusal("not a date", "a date such as 2027-01-31", repr(value)) from None
        return value

    def holds_on(self, day: date) -> bool:
        """Whether the waiver still counts; its last day does."""
        return day <= date.fromisoformat(self.expires)


class Requirement(FileRecord):
    """One requirement; limit is a Quantity of the kind's dimension (a bare number for sync)."""

    id: Text
    kind: Literal["accuracy", "sync", "cost", "mass", "power", "monte_carlo"]
    limit: float
    quantile: float | None = None
    waiver: Waiver | None = None
    note: str = ""

    @reads_field("limit", mode="plain", json_schema_input_type=str | float)
    @classmethod
    def _read_limit(cls, value: Any, info: ValidationInfo) -> Any:
        kind = info.data.get("kind")
        if kind is None:  # its own error is enough
            return value
        if kind == "sync":
            return read_number(value, 0.0, above=True)
        above = kind in ("accuracy", "monte_carlo")
        return read_quantity(value, LIMIT_DIMENSIONS[kind], 0.0, above)

    @reads_field("quantile", mode="plain", json_schema_input_type=float)
    @classmethod
    def _read_quantile(cls, value: Any) -> Quantity | None:
        if value is None:
            return None
        number = read_number(value)
        if not 0.0 < number < 1.0:
            raise refusal("out of range", "between 0 and 1, such as 0.95", number.text)
        return number

    @model_validator(mode="after")
    def _quantile_fits_kind(self) -> Requirement:
        if self.kind == "monte_carlo" and self.quantile is None:
            raise refusals([(("quantile",), refusal("missing", "a quantile such as 0.95"))])
        if self.kind != "monte_carlo" and self.quantile is not None:
            message = f"a {self.kind} requirement takes no quantile"
            raise refusals([(("quantile",), refusal(message, hint="delete it"))])
        return self


class PlatformChoice(FileRecord):
    """A catalog id (`use`) with keys overridden, or all keys given."""

    use: Text | None = None
    name: str | None = None
    v_max: Speed | None = None
    omega_max: AngularRate | None = None
    distance: PositiveLength | None = None
    baseline: NonNegativeLength | None = None
    source: str | None = None
    note: str = ""

    @model_validator(mode="after")
    def _complete_without_use(self) -> PlatformChoice:
        keys = ("v_max", "omega_max", "distance", "baseline")
        absent = [key for key in keys if getattr(self, key) is None]
        if self.use is None and absent:
            hint = "or name a catalog platform: {use: ID}"
            raise refusals(((key,), refusal("missing", hint=hint)) for key in absent)
        return self


class Query(FileRecord):
    """A catalog query: every key given must match."""

    modality: RoleName | None = None
    type: Text | None = None
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


def _one_or_candidates(what: str, model: type[FileRecord]) -> BeforeValidator:
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

    name: Text
    platform: Annotated[
        PlatformChoice,
        BeforeValidator(_widen_platform, json_schema_input_type=str | PlatformChoice),
    ]
    vehicle: Text | None = None
    position: RoleChoice | None = None
    attitude: RoleChoice | None = None
    ranging: RoleChoice | None = None
    timestamping: Annotated[
        MethodChoice | None, _one_or_candidates("timestamping", MethodChoice)
    ] = None
    clock: Annotated[ClockChoice | None, _one_or_candidates("clock", ClockChoice)] = None
    gnss: YesNo | None = None  # None: yes for a first stage that is not at a depth
    depth: NonNegativeLength | None = None
    timing_from: Text | None = None  # stage that GNSS time comes from, by a cable
    note: str = ""

    def role(self, name: RoleName) -> RoleChoice | None:
        """The choice of one role."""
        return {"position": self.position, "attitude": self.attitude, "ranging": self.ranging}[name]

    @property
    def vehicle_name(self) -> str:
        """The vehicle: the stage itself unless `vehicle` says that stages share one."""
        return self.vehicle or self.name


class Trajectory(FileRecord):
    """What the vehicles do in a Monte Carlo run: a named manoeuvre, or a recorded track."""

    manoeuvre: Text | None = None
    file: Text | None = None

    @model_validator(mode="after")
    def _one_source(self) -> Trajectory:
        if (self.manoeuvre is None) == (self.file is None):
            error = refusal("not one source", "manoeuvre or file, one of them")
            raise refusals([((), error)])
        return self


class MonteCarloChoice(FileRecord):
    """Size and envelope of the Monte Carlo run."""

    samples: Annotated[int, Field(ge=1, le=100_000_000)] = 50_000
    envelope: Literal["limits", "inside", "trajectory"] = "limits"
    trajectory: Trajectory | None = None

    @model_validator(mode="after")
    def _trajectory_fits_envelope(self) -> MonteCarloChoice:
        given, wanted = self.trajectory is not None, self.envelope == "trajectory"
        if wanted and not given:
            error = refusal("missing", "{manoeuvre: NAME} or {file: PATH}")
            raise refusals([(("trajectory",), error)])
        if given and not wanted:
            error = refusal("not used", hint="set envelope: trajectory, or delete it")
            raise refusals([(("trajectory",), error)])
        return self


MOST_TILT_RAD = math.radians(80.0)  # beyond it a level vehicle's roll, pitch and yaw lose meaning


class HorizonChoice(FileRecord):
    """How long, how wide and how steep a mission is; what is not given is 1 h, 1 km, 10 deg."""

    duration: NonNegativeTime = DEFAULT_HORIZON.duration_s
    extent: NonNegativeLength = DEFAULT_HORIZON.extent_m
    tilt: NonNegativeAngle = DEFAULT_HORIZON.tilt_rad

    @reads_field("tilt", mode="after")
    @classmethod
    def _is_flown_upright(cls, value: float) -> float:
        if value > MOST_TILT_RAD * (1.0 + 1e-12):
            raise refusal("out of range", "at most 80 deg", f"{math.degrees(value):.6g} deg")
        return value

    def horizon(self) -> Horizon:
        """As the model takes it."""
        return Horizon(float(self.duration), float(self.extent), float(self.tilt))


class Spec(FileRecord):
    """One system: its requirements, stages, and how the choice is made."""

    syncline: Literal[1]
    name: Text
    note: str = ""
    catalogs: tuple[Text, ...] = ()
    currency: Literal["EUR", "USD", "GBP", "NOK", "SEK", "DKK", "CHF", "CAD", "AUD", "JPY"] = "EUR"
    exchange_rates: dict[str, PositiveMoney] = Field(default_factory=dict)  # {USD: 0.92 EUR}
    requirements: Annotated[
        tuple[Requirement, ...], AtLeastOne, Field(max_length=MOST_REQUIREMENTS)
    ]
    sync_model: Literal["syncline", "per_sensor"] = "syncline"
    stages: Annotated[tuple[StageChoice, ...], AtLeastOne, Field(max_length=MOST_STAGES)]
    timestamping: Annotated[
        MethodChoice | None, _one_or_candidates("timestamping", MethodChoice)
    ] = None
    coverage_factor: PositiveNumber = 3.0
    horizon: HorizonChoice = Field(default_factory=HorizonChoice)
    objective: Literal["cost", "mass", "power", "error"] = "cost"
    monte_carlo: MonteCarloChoice = Field(default_factory=MonteCarloChoice)
    effects: Annotated[tuple[EffectChoice, ...], Field(max_length=MOST_EFFECTS)] = ()
    log: LogChoice | None = None

    @model_validator(mode="after")
    def _consistent(self) -> Spec:
        errors = [
            *_duplicates("requirements", "id", [r.id for r in self.requirements]),
            *_duplicates("stages", "name", [s.name for s in self.stages]),
            *_rate_errors(self),
            *_stage_errors(self),
        ]
        if errors:
            raise refusals(errors)
        return self

    def can_convert(self, amount: Quantity) -> bool:
        """Whether an amount is in the spec's currency or one with a rate."""
        return amount.currency in (None, self.currency) or amount.currency in self.exchange_rates

    def in_currency(self, amount: Quantity) -> Fraction:
        """An amount of money in the spec's currency, exactly; loading has checked the rates."""
        if amount.currency in (None, self.currency):
            return amount.exact
        return amount.exact * self.exchange_rates[str(amount.currency)].exact


Located = tuple[KeyPath, PydanticCustomError]


def _duplicates(section: str, key: str, names: list[str]) -> list[Located]:
    errors: list[Located] = []
    first: dict[str, int] = {}
    for index, name in enumerate(names):
        if first.setdefault(name, index) < index:
            message = f"used twice: {name}, first in {section}[{first[name]}]"
            errors.append(((section, index, key), refusal(message, "each one once")))
    return errors


def _rate_errors(spec: Spec) -> list[Located]:
    errors: list[Located] = []
    for code, rate in spec.exchange_rates.items():
        if code not in CURRENCIES:
            hint = did_you_mean(code, CURRENCIES)
            error = refusal("unknown currency", f"one of {', '.join(CURRENCIES)}", code, hint)
            errors.append((("exchange_rates", code), error))
        elif rate.currency != spec.currency:
            wanted = f"what 1 {code} is worth in {spec.currency}"
            errors.append((("exchange_rates", code), refusal("wrong currency", wanted, rate.text)))
        elif code == spec.currency and rate.exact != 1:
            own = refusal("the spec's own currency", f"1 {code}, or no rate", rate.text)
            errors.append((("exchange_rates", code), own))
    return errors


def _stage_errors(spec: Spec) -> list[Located]:
    errors: list[Located] = []
    for index, stage in enumerate(spec.stages):
        at: KeyPath = ("stages", index)
        errors += _first_position(stage, at) if index == 0 else _later_position(stage, at)
        if stage.ranging is None and len(spec.stages) > 1:
            message = "missing: every stage of a chain measures the next object"
            errors.append(((*at, "ranging"), refusal(message, "a ranging sensor")))
        if stage.ranging is not None and stage.attitude is None:
            error = refusal("missing beside ranging", "an attitude sensor")
            errors.append(((*at, "attitude"), error))
        errors += _cable_errors(spec, stage, at)
        for name in ("attitude", "ranging"):
            role = stage.attitude if name == "attitude" else stage.ranging
            if role is not None and role.is_empty:
                errors.append(((*at, name), refusal("no sensor", "sensor or candidates")))
    return errors


def _cable_errors(spec: Spec, stage: StageChoice, at: KeyPath) -> list[Located]:
    """A cable comes from another stage, and not round in a circle."""
    source = {one.name: one.timing_from for one in spec.stages}
    name = stage.timing_from
    if name is None:
        return []
    others = [one for one in source if one != stage.name]
    if name not in others:
        wanted = f"one of {', '.join(others)}" if others else "no timing_from in a single stage"
        error = refusal("no other stage of that name", wanted, name, did_you_mean(name, others))
        return [((*at, "timing_from"), error)]
    passed: set[str | None] = set()
    while name in source and name != stage.name and name not in passed:
        passed.add(name)
        name = source[name]
    if name != stage.name:
        return []
    error = refusal("a cable that comes back to its own stage", "a stage that has time of its own")
    return [((*at, "timing_from"), error)]


def _first_position(stage: StageChoice, at: KeyPath) -> list[Located]:
    if stage.position is None:
        error = refusal("missing in the first stage", "a position sensor")
        return [((*at, "position"), error)]
    if stage.position.is_empty:
        return [((*at, "position"), refusal("no sensor", "sensor or candidates"))]
    return []


def _later_position(stage: StageChoice, at: KeyPath) -> list[Located]:
    role = stage.position
    given = [] if role is None else sorted(role.model_fields_set - {"lever_arm", "note"})
    message = "the position of a later stage is the chain before it"
    return [
        ((*at, "position", key), refusal(message, "lever_arm only", key, "delete it"))
        for key in given
    ]
