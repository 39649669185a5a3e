"""Timestamp errors as catalogs and specs write them: a distribution with its figures."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import model_validator

from syncline_design.model.quantity import Dimension, Quantity
from syncline_design.spec.fields import (
    NonNegativeTime,
    ReadBy,
    Time,
    did_you_mean,
    kind_of,
    quantity_schema,
    read_list,
    read_quantity,
    refusal,
    refusals,
)
from syncline_design.spec.measured import MeasuredKeys


class UniformError(MeasuredKeys):
    distribution: Literal["uniform"]
    low: Time
    high: Time
    calibrated: NonNegativeTime | None = None  # mean removed, this much remains

    @model_validator(mode="after")
    def _ends_in_order(self) -> UniformError:
        if not self.low <= self.high:
            raise refusals([(("low",), refusal("above high", "low <= high"))])
        return self


class NormalError(MeasuredKeys):
    distribution: Literal["normal"]
    mean: Time
    std: NonNegativeTime
    calibrated: NonNegativeTime | None = None


class ConstantError(MeasuredKeys):
    distribution: Literal["constant"]
    value: Time
    calibrated: NonNegativeTime | None = None


def _read_times(value: Any) -> tuple[Quantity, ...]:
    return read_list(value, "times", lambda item: read_quantity(item, Dimension.TIME))


_TIMES_SCHEMA = {"type": "array", "items": quantity_schema(Dimension.TIME), "minItems": 1}


class EmpiricalError(MeasuredKeys):
    """Measured values, given here or in a file (one per line) whose values loading puts here."""

    distribution: Literal["empirical"]
    values: Annotated[tuple[float, ...], ReadBy(_read_times, _TIMES_SCHEMA)] | None = None
    file: str | None = None
    calibrated: NonNegativeTime | None = None

    @model_validator(mode="after")
    def _has_values(self) -> EmpiricalError:
        if self.values is None and self.file is None:
            raise refusals([(("values",), refusal("missing", "values, or a file with values"))])
        return self


TimestampError = UniformError | NormalError | ConstantError | EmpiricalError


_ERRORS: dict[str, type[TimestampError]] = {
    "uniform": UniformError,
    "normal": NormalError,
    "constant": ConstantError,
    "empirical": EmpiricalError,
}


def read_error(value: Any) -> TimestampError:
    """A timestamp error; its distribution says which keys it has."""
    if isinstance(value, UniformError | NormalError | ConstantError | EmpiricalError):
        return value
    if not isinstance(value, dict):
        example = "{distribution: uniform, low: 0 ms, high: 16 ms}"
        raise refusal("not a timestamp error", f"a mapping such as {example}", kind_of(value))
    kind = value.get("distribution")
    if "distribution" not in value:
        raise refusal("missing key distribution", "uniform, normal, constant or empirical")
    if not isinstance(kind, str) or kind not in _ERRORS:
        hint = did_you_mean(kind, _ERRORS) if isinstance(kind, str) else ""
        wanted = "uniform, normal, constant or empirical"
        error = refusal("unknown distribution", wanted, kind_of(kind), hint)
        raise refusals([(("distribution",), error)])
    return _ERRORS[kind].model_validate(value)
