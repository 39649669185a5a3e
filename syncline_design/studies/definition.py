"""The study file: base specs, what to vary over which values, how to check each case.

A range is `{low: 40 m, high: 100 m, count: 7}`, with `scale: log` where the ratio matters; in a
sample also `0.1 m .. 0.5 m`.  Values between the ends are rounded to six figures in the unit of
the low end, so that what is computed is what the table says.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping, Sequence
from fractions import Fraction
from functools import cached_property
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, WithJsonSchema

from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.quantity import UNITS, Dimension, UnitError, parse_number
from syncline_design.spec.fields import (
    AtLeastOne,
    FileRecord,
    NonEmptyText,
    PositiveTime,
    kind_of,
    refusal,
)
from syncline_design.spec.keys import label
from syncline_design.spec.yaml_text import plain_scalar

MAX_CASES = 1_000_000
MOST_KEPT = 2**16  # figures whose values are kept in memory
MeetsWhen = Literal["all", "any", "decided"]
FIGURES = 6
Scale = Literal["linear", "log"]


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


class SampleChoice(FileRecord):
    """A Latin hypercube: every range is cut into `count` equal parts, each part used once."""

    method: Literal["latin_hypercube"] = "latin_hypercube"
    count: Annotated[int, Field(ge=1, le=MAX_CASES)]
    seed: Annotated[int, Field(ge=0)] = 0
    over: Over


class CheckChoice(FileRecord):
    """How each case is checked.

    monte_carlo: true, false, or left out: only specs with a monte_carlo requirement simulate.
    """

    monte_carlo: bool | None = None
    method: Literal["auto", "front", "milp", "enumerate"] = "auto"
    time_limit: PositiveTime | None = None


class HeatMapChoice(FileRecord):
    """The two key paths of the heat map."""

    x: NonEmptyText
    y: NonEmptyText


class StudyFile(FileRecord):
    """A study as its file says it; meets_when: which cases have to meet their requirements."""

    study: Literal[1]
    name: NonEmptyText
    note: str = ""
    base: Annotated[
        tuple[NonEmptyText, ...],
        AtLeastOne,
        BeforeValidator(_read_base),
        WithJsonSchema(_BASE_SCHEMA),
    ]
    grid: Grid | None = None
    sample: SampleChoice | None = None
    check: CheckChoice = Field(default_factory=CheckChoice)
    heat_map: HeatMapChoice | None = None
    meets_when: MeetsWhen = "all"


class FactorError(Exception):
    """Values that cannot be varied over; where: path below the factor's own."""

    def __init__(
        self, message: str, expected: str = "", found: str = "", where: tuple[str | int, ...] = ()
    ) -> None:
        super().__init__(message)
        self.message, self.expected, self.found, self.where = message, expected, found, where


@dataclass(frozen=True)
class Factor:
    """One key path and the values it takes, in their order; plain data as a spec would hold."""

    key: str
    values: tuple[Any, ...]
    origin: Literal["grid", "sample"]
    place: tuple[str | int, ...]  # where the study file lists them
    listed: bool = True  # each value has its own place in the file
    scale: Scale = "linear"  # of the range that they come from

    @cached_property
    def axis(self) -> tuple[str, ...]:
        """The labels of the values along an axis: figures by size, all else as listed."""
        values = list(dict.fromkeys((label(v), figure_of(v)) for v in self.values))
        kinds = {figure[1] if figure is not None else "" for _, figure in values}
        if len(kinds) == 1 and "" not in kinds:
            values.sort(key=lambda item: item[1] or (0.0, ""))
        return tuple(text for text, _ in values)

    @cached_property
    def is_of_figures(self) -> bool:
        """Whether every value is a figure, so that there is something between two of them."""
        return all(figure_of(value) is not None for value in self.values)


@dataclass(frozen=True, slots=True)
class ValueSpan:
    """A range of a figure in one unit ("" for bare numbers)."""

    low: Fraction
    high: Fraction
    unit: str
    scale: Scale = "linear"

    def at(self, share: float) -> Any:
        """The value at a share of the range: low at 0, high at 1."""
        low, high = float(self.low), float(self.high)
        if self.scale == "log":
            figure = math.exp(math.log(low) + share * (math.log(high) - math.log(low)))
        else:
            figure = low + share * (high - low)
        text = f"{figure:.{FIGURES}g}"  # YAML of a spec
        return f"{text} {self.unit}" if self.unit else plain_scalar(text)


def figure_of(value: Any) -> tuple[float, str] | None:
    """(figure in SI, its dimension) of `40 m` or a bare number; None for anything else."""
    return _in_si(_text_of(value), bare=not isinstance(value, str)) if _may_be(value) else None


@functools.lru_cache(maxsize=MOST_KEPT)
def _in_si(text: str, *, bare: bool) -> tuple[float, str] | None:
    """A figure's text in SI; a study asks for that of every value again in each of its outputs."""
    try:
        number, unit = _parted(text, bare=bare)
    except FactorError:
        return None
    if not unit:
        return float(number), Dimension.DIMENSIONLESS.value
    dimension, factor = UNITS[unit]
    kind = unit if dimension is Dimension.MONEY else dimension.value
    return float(number * factor), kind


def _split(value: Any) -> tuple[Fraction, str]:
    """Number and unit of a figure."""
    if not _may_be(value):
        raise FactorError("not a figure", "one such as 40 m", kind_of(value))
    return _parted(_text_of(value), bare=not isinstance(value, str))


def _may_be(value: Any) -> bool:
    """Whether a value may be a figure: a number, or the text of one with its unit."""
    return isinstance(value, int | float | str) and not isinstance(value, bool)


def _text_of(value: float | str) -> str:
    """As it was written, where that is known."""
    return str(getattr(value, "text", None) or value).strip()


def _parted(text: str, *, bare: bool) -> tuple[Fraction, str]:
    """Number and unit; bare: the text of a number, which needs no unit."""
    digits, _, unit = text.partition(" ")
    unit = unit.strip()
    if unit and unit not in UNITS:
        raise FactorError("unknown unit", "a figure such as 40 m", repr(text))
    if not bare and not unit:
        raise FactorError("not a figure", "one such as 40 m", repr(text))
    try:
        return parse_number(digits), unit
    except UnitError:
        raise FactorError("not a figure", "one such as 40 m", repr(text)) from None


def span_of(value: Any) -> ValueSpan | None:
    """The range that a value of the file means; None when it is none."""
    if isinstance(value, str) and " .. " in value:
        low, _, high = value.partition(" .. ")
        return _span(_bound(low), _bound(high))
    if isinstance(value, Mapping) and {"low", "high"} <= set(value):
        unknown = sorted(set(value) - {"low", "high", "count", "scale"})
        if unknown:
            wanted = "low, high, count and scale"
            raise FactorError("unknown key in a range", wanted, unknown[0], (unknown[0],))
        scale = value.get("scale", "linear")
        if scale not in ("linear", "log"):
            raise FactorError("not a scale", "linear or log", kind_of(scale), ("scale",))
        return _span(value["low"], value["high"], scale)
    return None


def scale_of(value: Any) -> Scale:
    """How the values of a range lie; of a list, which has no scale: linear."""
    span = span_of(value)
    return "linear" if span is None else span.scale


def _bound(text: str) -> Any:
    """One end of `1 .. 3` or `0.1 m .. 0.5 m`."""
    return plain_scalar(text.strip())


def _span(low: Any, high: Any, scale: Scale = "linear") -> ValueSpan:
    (first, unit), (last, other) = _split(low), _split(high)
    if (unit and UNITS[unit][0]) != (other and UNITS[other][0]):
        raise FactorError("a range from one kind of figure to another", unit, other)
    if unit and UNITS[unit][0] is Dimension.MONEY and unit != other:
        raise FactorError("a range from one currency to another", unit, other)
    if unit != other:
        last = last * UNITS[other][1] / UNITS[unit][1]
    if not first < last:
        raise FactorError("an empty range", "low < high", f"{label(low)} .. {label(high)}")
    if scale == "log" and first <= 0:
        raise FactorError("a logarithmic range from 0 or below", "low > 0", label(low), ("low",))
    return ValueSpan(first, last, unit, scale)


def grid_values(value: Any) -> tuple[tuple[Any, ...], bool]:
    """The values of a grid factor, and whether each has its own place in the file."""
    span = span_of(value)
    if span is not None:
        count = value.get("count") if isinstance(value, Mapping) else None
        if not isinstance(count, int) or isinstance(count, bool) or not 2 <= count <= 100_000:
            wanted = "a range with count: 2 or more, such as {low: 40 m, high: 100 m, count: 7}"
            raise FactorError("a range without its number of values", wanted)
        return tuple(span.at(step / (count - 1)) for step in range(count)), False
    if not isinstance(value, tuple | list):
        raise FactorError("not a list of values", "a list such as [40 m, 60 m]", kind_of(value))
    if not value:
        raise FactorError("an empty list", "at least one value", "[]")
    seen: dict[str, int] = {}
    for index, item in enumerate(value):
        first = seen.setdefault(label(item), index)
        if first < index:
            raise FactorError("listed twice", "each value once", label(item), (index,))
    return tuple(value), True


def sample_values(over: Mapping[str, Any], count: int, seed: int) -> list[tuple[Any, ...]]:
    """Latin hypercube: per key `count` values, one from each of `count` equal parts, shuffled.

    u_ij = (pi_j(i) + r_ij) / n with pi_j a random permutation of 0 .. n-1 and r_ij uniform in
    [0, 1) (McKay, Beckman and Conover, Technometrics 21(2), 1979).  Every key has a stream of its
    own, so that adding one leaves the others' values alone.
    """
    columns = []
    for key, value in over.items():
        draw = _sampler(value)
        columns.append(tuple(draw(share) for share in _shares(key, count, seed)))
    return columns


def _shares(key: str, count: int, seed: int) -> list[float]:
    from syncline_design.machine.random_numbers import generator  # numpy

    stream = generator([seed, *key.encode("utf-8", "surrogatepass")])
    shares = (stream.permutation(count) + stream.random(count)) / count
    return [float(share) for share in shares]


def _sampler(value: Any) -> Any:
    span = span_of(value)
    if span is not None:
        if isinstance(value, Mapping) and "count" in value:
            raise FactorError("a range of a sample has no count of its own", where=("count",))
        return span.at
    if isinstance(value, tuple | list) and value:
        choices: Sequence[Any] = value
        return lambda share: choices[min(int(share * len(choices)), len(choices) - 1)]
    wanted = "a range such as 0.1 m .. 0.5 m, or a list to pick from"
    raise FactorError("not a range", wanted, kind_of(value))
