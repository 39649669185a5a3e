"""The system spec: what is wanted, as read from YAML."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator
from pydantic import field_validator as reads_field
from pydantic_core import PydanticCustomError

from syncline_design.model.figure_text import to_digits
from syncline_design.model.horizon import DEFAULT_HORIZON, Horizon
from syncline_design.model.quantity import CURRENCIES, Quantity
from syncline_design.spec.choices import MethodChoice, StageChoice, one_or_candidates
from syncline_design.spec.effects_listed import EffectChoice as EffectChoice
from syncline_design.spec.fields import (
    AtLeastOne,
    FileRecord,
    NonEmptyText,
    NonNegativeAngle,
    NonNegativeLength,
    NonNegativeTime,
    PositiveMoney,
    PositiveNumber,
    ReadBy,
    YesNo,
    did_you_mean,
    kind_of,
    read_number,
    refusal,
    refusals,
)
from syncline_design.spec.log_block import LogChoice as LogChoice
from syncline_design.spec.log_block import split_column as split_column
from syncline_design.spec.requirement import JUDGED_KINDS as JUDGED_KINDS
from syncline_design.spec.requirement import STATED_KINDS as STATED_KINDS
from syncline_design.spec.requirement import Requirement as Requirement
from syncline_design.spec.requirement import Waiver as Waiver
from syncline_design.spec.yaml_text import KeyPath

MOST_REQUIREMENTS = 1_000
MOST_STAGES = 32  # the work grows with the square of their number; chains have two or three
MOST_MISSIONS = 100
MOST_INTERVALS = 4  # stages with several distances: all holds at every combination of their ends
MOST_EFFECTS = 1_000  # each acts on every simulated sample; a system is known by a few


class Trajectory(FileRecord):
    """What the vehicles do in a Monte Carlo run: a named manoeuvre, or a recorded track."""

    manoeuvre: NonEmptyText | None = None
    file: NonEmptyText | None = None

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
            raise refusal(
                "out of range", "at most 80 deg", f"{to_digits(math.degrees(value), 6)} deg"
            )
        return value

    def horizon(self) -> Horizon:
        """As the model takes it."""
        return Horizon(float(self.duration), float(self.extent), float(self.tilt))


class MissionChoice(FileRecord):
    """One mission: keys of stages by their names, limits (or keys) of requirements by their ids."""

    name: NonEmptyText
    stages: dict[str, dict[str, Any]] = Field(default_factory=dict)
    requirements: dict[str, Any] = Field(default_factory=dict)
    note: str = ""


def _read_choose_for(value: Any) -> str | Quantity:
    if value in ("nominal", "always"):
        return str(value)
    wanted = "nominal, always, or a probability such as 0.95"
    if isinstance(value, str):
        raise refusal("not one of the choices", wanted, kind_of(value), did_you_mean(value, _HOW))
    share = read_number(value)
    if not 0.5 < share < 1.0:
        raise refusal("out of range", "more than 0.5 and less than 1", share.text)
    return share


_HOW = ("nominal", "always")
ChooseFor = Annotated[
    str | float,
    ReadBy(
        _read_choose_for,
        {"anyOf": [{"enum": list(_HOW)},
                   {"type": "number", "exclusiveMinimum": 0.5, "exclusiveMaximum": 1}]},
    ),
]  # fmt: skip


class Spec(FileRecord):
    """One system: its requirements, stages, and how the choice is made."""

    syncline: Literal[1]
    name: NonEmptyText
    note: str = ""
    catalogs: tuple[NonEmptyText, ...] = ()
    currency: Literal["EUR", "USD", "GBP", "NOK", "SEK", "DKK", "CHF", "CAD", "AUD", "JPY"] = "EUR"
    exchange_rates: dict[str, PositiveMoney] = Field(default_factory=dict)  # {USD: 0.92 EUR}
    requirements: Annotated[
        tuple[Requirement, ...], AtLeastOne, Field(max_length=MOST_REQUIREMENTS)
    ]
    sync_model: Literal["syncline", "per_sensor"] = "syncline"
    stages: Annotated[tuple[StageChoice, ...], AtLeastOne, Field(max_length=MOST_STAGES)]
    timestamping: Annotated[
        MethodChoice | None, one_or_candidates("timestamping", MethodChoice)
    ] = None
    coverage_factor: PositiveNumber = 3.0
    strict_facts: YesNo = False  # a fact that is asked for and not told rules out
    allow_discontinued: YesNo = False
    owned: tuple[NonEmptyText, ...] = ()  # sensors, shared hardware and clocks that cost nothing
    horizon: HorizonChoice = Field(default_factory=HorizonChoice)
    objective: Literal["cost", "mass", "power", "error"] = "cost"
    monte_carlo: MonteCarloChoice = Field(default_factory=MonteCarloChoice)
    effects: Annotated[tuple[EffectChoice, ...], Field(max_length=MOST_EFFECTS)] = ()
    log: LogChoice | None = None
    choose_for: ChooseFor = "nominal"  # or for any figures in their intervals, or a share
    missions: Annotated[tuple[MissionChoice, ...], Field(max_length=MOST_MISSIONS)] = ()

    @model_validator(mode="after")
    def _consistent(self) -> Spec:
        errors = [
            *_duplicates("missions", "name", [m.name for m in self.missions]),
            *_choose_for_errors(self),
            *_duplicates("requirements", "id", [r.id for r in self.requirements]),
            *_duplicates("stages", "name", [s.name for s in self.stages]),
            *_owned_twice(self.owned),
            *_rate_errors(self),
            *_stage_errors(self),
            *_spacing_errors(self),
            *_distance_errors(self),
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


def _owned_twice(owned: tuple[str, ...]) -> list[Located]:
    """An entry is owned or not: how many pieces there are is not counted."""
    first = {name: index for index, name in reversed([*enumerate(owned)])}
    return [
        (("owned", index), refusal("owned twice", "each id once", name, "delete it"))
        for index, name in enumerate(owned)
        if first[name] < index
    ]


def _rate_errors(spec: Spec) -> list[Located]:
    errors: list[Located] = []
    for code, rate in spec.exchange_rates.items():
        if code not in CURRENCIES:
            hint = did_you_mean(code, CURRENCIES)
            error = refusal("unknown currency", f"one of {', '.join(CURRENCIES)}", code, hint)
            errors.append((("exchange_rates", code), error))
        elif code != spec.currency and rate.currency != spec.currency:
            wanted = f"what 1 {code} is worth in {spec.currency}"
            errors.append((("exchange_rates", code), refusal("wrong currency", wanted, rate.text)))
        elif code == spec.currency and (rate.currency != code or rate.exact != 1):
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


def _distance_errors(spec: Spec) -> list[tuple[KeyPath, PydanticCustomError]]:
    several = [k for k, stage in enumerate(spec.stages) if stage.distance is not None]
    return [
        (
            ("stages", k, "distance"),
            refusal("too many intervals", f"at most {MOST_INTERVALS}", f"{len(several)}"),
        )
        for k in several[MOST_INTERVALS : MOST_INTERVALS + 1]
    ]


def _spacing_errors(spec: Spec) -> list[Located]:
    """The spacing of samples is that of ranging sensors: there has to be one."""
    if any(stage.ranging is not None for stage in spec.stages):
        return []
    error = refusal("no ranging sensor to take samples", "a stage with ranging", hint="delete it")
    return [
        (("requirements", index, "kind"), error)
        for index, one in enumerate(spec.requirements)
        if one.kind == "sample_spacing"
    ]


def _choose_for_errors(spec: Spec) -> list[Located]:
    """A share of the figures is counted on sums, at one distance; what is simulated has no sum."""
    if isinstance(spec.choose_for, str):
        return []
    if spec.objective == "error":
        message = "choose_for takes no probability where the error is made smallest"
        error = refusal(message, "an objective of cost, mass or power")
        return [(("choose_for",), error)]
    spans = [i for i, stage in enumerate(spec.stages) if stage.distance is not None]
    if spans:
        message = "choose_for takes no probability where a stage has several distances"
        error = refusal(message, "nominal or always", hint="or give the stage one distance")
        return [(("choose_for",), error)]
    message = f"choose_for: {spec.choose_for} does not go with a requirement that is no sum"
    hint = "choose for nominal or always, or delete the requirement"
    return [
        (("requirements", index, "kind"), refusal(message, found=one.kind, hint=hint))
        for index, one in enumerate(spec.requirements)
        if one.kind in JUDGED_KINDS
    ]


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
