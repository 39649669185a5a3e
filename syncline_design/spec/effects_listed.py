"""Known systematic effects as a spec lists them; `diagnose` writes such entries."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field
from pydantic_core import PydanticCustomError

from syncline_design.model.quantity import (
    Dimension,
    UnitError,
    parse_quantity,
    plain_number,
    si_name,
    suffix_unit,
)
from syncline_design.spec.fields import (
    FileRecord,
    NonEmptyText,
    ReadBy,
    kind_of,
    read_number,
    read_quantity,
    refusal,
    refusals,
)
from syncline_design.spec.yaml_text import KeyPath


def _read_parameter(name: str, value: Any) -> float | str:
    """One effect parameter in SI: bare in the unit of its name, or a text with its own unit."""
    factor, dimension = suffix_unit(name)
    if isinstance(value, str):
        if dimension is Dimension.DIMENSIONLESS:
            return _plain_parameter(value)
        return read_quantity(value, dimension)
    number = read_number(value)
    return number if factor == 1.0 else float(number) * factor


def _plain_parameter(value: str) -> float | str:
    """A ratio with its unit, or a word such as the name of a convention."""
    try:
        return parse_quantity(value, Dimension.RATIO)
    except UnitError:
        pass
    try:
        plain_number(value)
    except UnitError as error:
        if error.hint == "unquote it":
            raise refusal(error.message, error.expected, error.found, error.hint) from None
    return value


def _read_parameters(value: Any) -> dict[str, float | str]:
    if not isinstance(value, dict):
        raise refusal("not parameters", "a mapping such as {latency_s: 0.087}", kind_of(value))
    parameters: dict[str, float | str] = {}
    errors: list[tuple[KeyPath, PydanticCustomError]] = []
    for name, item in value.items():
        if si_name(name) in parameters:
            errors.append(((name,), refusal("given twice, in two units", si_name(name))))
            continue
        try:
            parameters[si_name(name)] = _read_parameter(name, item)
        except PydanticCustomError as error:
            errors.append(((name,), error))
    if errors:
        raise refusals(errors)
    return parameters


def _read_uncertainties(value: Any) -> dict[str, float]:
    figures: dict[str, float] = {}
    for name, item in _read_parameters(value).items():
        if isinstance(item, str) or not item >= 0.0:
            raise refusals([((name,), refusal("not an uncertainty", "0 or more", str(item)))])
        figures[name] = item
    return figures


_ParameterSchema = {"type": "object", "additionalProperties": {"type": ["number", "string"]}}


class EffectChoice(FileRecord):
    """A known systematic effect, as `diagnose` writes it; parameter names carry their unit.

    Stored in SI under the name with the SI suffix: `latency_ms: 87` reads as latency_s = 0.087.
    """

    effect: NonEmptyText
    sensor: Literal["position", "attitude", "ranging", "target"]
    stage: NonEmptyText | None = None
    parameters: Annotated[dict[str, float | str], ReadBy(_read_parameters, _ParameterSchema)]
    standard_uncertainty: Annotated[
        dict[str, float], ReadBy(_read_uncertainties, _ParameterSchema)
    ] = Field(default_factory=dict)
    source: str = ""
    note: str = ""
