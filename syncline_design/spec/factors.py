"""What a study varies: the values of each key path, listed, spaced or drawn.

A range is `{low: 40 m, high: 100 m, count: 7}`, with `scale: log` where the ratio matters; in a
sample also `0.1 m .. 0.5 m`.  Values between the ends are rounded to six figures in the unit of
the low end, so that what is computed is what the table says.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, Literal

from syncline_design.model.quantity import UNITS, Dimension, UnitError, parse_number
from syncline_design.spec.fields import kind_of
from syncline_design.spec.yaml_text import Number, plain_scalar

FIGURES = 6
Scale = Literal["linear", "log"]


class FactorError(Exception):
    """Values that cannot be varied over; where: path below the factor's own."""

    def __init__(
        self, message: str, expected: str = "", found: str = "", where: tuple[str | int, ...] = ()
    ) -> None:
        super().__init__(message)
        self.message, self.expected, self.found, self.where = message, expected, found, where


@dataclass(frozen=True, slots=True)
class Factor:
    """One key path and the values it takes, in their order; plain data as a spec would hold."""

    key: str
    values: tuple[Any, ...]
    origin: Literal["grid", "sample"]
    place: tuple[str | int, ...]  # where the study file lists them
    listed: bool = True  # each value has its own place in the file


@dataclass(frozen=True, slots=True)
class Span:
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
        text = f"{figure:.{FIGURES}g}"
        return f"{text} {self.unit}" if self.unit else plain_scalar(text)


def label(value: Any) -> str:
    """A value as the tables show it: text as it is, lists and mappings as compact JSON."""
    if isinstance(value, str):
        return value
    if isinstance(value, bool) or value is None:
        return json.dumps(value)
    if isinstance(value, int | float):
        return str(getattr(value, "text", None) or value)
    return _compact(value)


def _compact(value: Any) -> str:
    """Compact JSON whose numbers are written as the file has them."""
    if isinstance(value, Mapping):
        pairs = (f"{_compact(str(key))}: {_compact(item)}" for key, item in value.items())
        return "{" + ", ".join(pairs) + "}"
    if isinstance(value, tuple | list):
        return "[" + ", ".join(map(_compact, value)) + "]"
    return json.dumps(value, ensure_ascii=False) if isinstance(value, str) else label(value)


def plain(value: Any) -> Any:
    """Data of the YAML reader as JSON can hold it, decimals with their own digits as text."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, tuple | list):
        return [plain(item) for item in value]
    return {"number": value.text} if isinstance(value, Number) else value


def figure_of(value: Any) -> tuple[float, str] | None:
    """(figure in SI, its dimension) of `40 m` or a bare number; None for anything else."""
    try:
        number, unit = _split(value)
    except FactorError:
        return None
    if not unit:
        return float(number), Dimension.DIMENSIONLESS.value
    dimension, factor = UNITS[unit]
    kind = unit if dimension is Dimension.MONEY else dimension.value
    return float(number * factor), kind


def _split(value: Any) -> tuple[Fraction, str]:
    """Number and unit of a figure."""
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise FactorError("not a figure", "one such as 40 m", kind_of(value))
    text = str(getattr(value, "text", None) or value).strip()
    digits, _, unit = text.partition(" ")
    unit = unit.strip()
    if unit and unit not in UNITS:
        raise FactorError("unknown unit", "a figure such as 40 m", repr(text))
    if isinstance(value, str) and not unit:
        raise FactorError("not a figure", "one such as 40 m", repr(text))
    try:
        return parse_number(digits), unit
    except UnitError:
        raise FactorError("not a figure", "one such as 40 m", repr(text)) from None


def span_of(value: Any) -> Span | None:
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


def _bound(text: str) -> Any:
    """One end of `1 .. 3` or `0.1 m .. 0.5 m`."""
    return plain_scalar(text.strip())


def _span(low: Any, high: Any, scale: Scale = "linear") -> Span:
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
    return Span(first, last, unit, scale)


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
    import numpy as np

    stream = np.random.SeedSequence([seed, *key.encode("utf-8", "surrogatepass")])
    generator = np.random.Generator(np.random.Philox(stream))
    shares = (generator.permutation(count) + generator.random(count)) / count
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
