"""The study file: base specs, what to vary over which values, how to check each case."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, WithJsonSchema

from syncline_design.spec.fields import AtLeastOne, PositiveTime, Record, Text, kind_of, refusal

MAX_CASES = 1_000_000


def _read_base(value: Any) -> Any:
    if isinstance(value, str) and value:
        return (value,)
    if not isinstance(value, tuple | list):
        raise refusal("no base spec", "a list of spec files", kind_of(value))
    return value


def _read_mapping(value: Any) -> Any:
    if not isinstance(value, dict):
        example = 'a mapping such as {"stages[uav].distance": [40 m, 60 m]}'
        raise refusal("not what to vary", example, kind_of(value))
    if not value:
        raise refusal("nothing to vary", "at least one key path", "{}")
    return value


_END: dict[str, Any] = {"type": ["number", "string"]}
_RANGE: dict[str, Any] = {
    "type": "object",
    "properties": {"low": _END, "high": _END, "scale": {"enum": ["linear", "log"]}},
    "required": ["low", "high"],
    "additionalProperties": False,
}
_COUNTED: dict[str, Any] = {
    **_RANGE,
    "properties": {
        **_RANGE["properties"],
        "count": {"type": "integer", "minimum": 2, "maximum": 100_000},
    },
    "required": ["low", "high", "count"],
}
_LISTED: dict[str, Any] = {"type": "array", "minItems": 1}
_SPAN: dict[str, Any] = {"type": "string", "pattern": r" \.\. "}


def _mapping_of(*shapes: dict[str, Any]) -> WithJsonSchema:
    """The JSON Schema of a mapping from key paths to values of these shapes."""
    entry = {"anyOf": list(shapes)}
    return WithJsonSchema({"type": "object", "minProperties": 1, "additionalProperties": entry})


_BASE_SCHEMA: dict[str, Any] = {
    "anyOf": [
        {"type": "string", "minLength": 1},
        {"type": "array", "minItems": 1, "items": {"type": "string", "minLength": 1}},
    ]
}
Grid = Annotated[dict[str, Any], BeforeValidator(_read_mapping), _mapping_of(_LISTED, _COUNTED)]
Over = Annotated[
    dict[str, Any], BeforeValidator(_read_mapping), _mapping_of(_LISTED, _RANGE, _SPAN)
]


class SampleChoice(Record):
    """A Latin hypercube: every range is cut into `count` equal parts, each part used once."""

    method: Literal["latin_hypercube"] = "latin_hypercube"
    count: Annotated[int, Field(ge=1, le=MAX_CASES)]
    seed: Annotated[int, Field(ge=0)] = 0
    over: Over


class CheckChoice(Record):
    """How each case is checked.

    monte_carlo: true, false, or left out: only specs with a monte_carlo requirement simulate.
    """

    monte_carlo: bool | None = None
    method: Literal["auto", "front", "milp", "enumerate"] = "auto"
    time_limit: PositiveTime | None = None


class HeatMapChoice(Record):
    """The two key paths of the heat map."""

    x: Text
    y: Text


class StudyFile(Record):
    """A study as its file says it; meets_when: which cases have to meet their requirements."""

    study: Literal[1]
    name: Text
    note: str = ""
    base: Annotated[
        tuple[Text, ...], AtLeastOne, BeforeValidator(_read_base), WithJsonSchema(_BASE_SCHEMA)
    ]
    grid: Grid | None = None
    sample: SampleChoice | None = None
    check: CheckChoice = Field(default_factory=CheckChoice)
    heat_map: HeatMapChoice | None = None
    meets_when: Literal["all", "any", "decided"] = "all"
