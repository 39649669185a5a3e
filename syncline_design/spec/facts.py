"""What a catalog entry says about where it works, and where each of its figures comes from.

Reach, medium, field of view, rate, depth, temperature: facts that decide whether a payload can
exist; and per figure what the source prints, of which kind, where it was read and when.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import Annotated, Any, Final, Literal

from pydantic import Field, model_validator
from pydantic import field_validator as reads_field
from pydantic_core import PydanticCustomError

from syncline_design.model.conversion import conversion_of, kinds
from syncline_design.model.quantity import Dimension, Quantity
from syncline_design.spec.fields import (
    Day,
    FileRecord,
    NonEmptyText,
    NonNegativeLength,
    PositiveLength,
    ReadBy,
    did_you_mean,
    figure_of,
    kind_of,
    quantity_schema,
    read_quantity,
    refusal,
    refusals,
)
from syncline_design.spec.yaml_text import KeyPath

Medium = Literal["air", "water", "both"]
Corrected = Literal["travel_time"]  # what the maker's own processing takes out
FULL_TURN: Final = 2.0 * math.pi
_STRENGTH = re.compile(r"-?[0-9]+(?:\.[0-9]+)? (?:%|dB)")


def _read_interval(value: Any, dimension: Dimension) -> Quantity:
    if isinstance(value, Quantity):
        return value
    quantity = read_quantity(value, dimension, tolerance=True)
    if ".." not in quantity.text:
        raise refusal("not an interval", "LOW .. HIGH, with a unit at both", quantity.text)
    return quantity


def _interval(dimension: Dimension) -> ReadBy:
    return ReadBy(
        lambda value: _read_interval(value, dimension), quantity_schema(dimension, tolerance=True)
    )


AngleInterval = Annotated[Quantity, _interval(Dimension.ANGLE)]
TemperatureInterval = Annotated[Quantity, _interval(Dimension.TEMPERATURE)]
MoneyInterval = Annotated[Quantity, _interval(Dimension.MONEY)]


def _read_span(value: Any) -> Quantity:
    span = read_quantity(value, Dimension.LENGTH, tolerance=True)
    if ".." not in span.text:
        hint = "one distance stands in the platform: {use: ID, distance: 60 m}"
        raise refusal("not an interval", "NEAR .. FAR, with a unit at both", span.text, hint)
    if not 0.0 < span.low < span.high:
        raise refusal("out of range", "NEAR .. FAR, both more than 0 and NEAR below FAR", span.text)
    return span


DistanceInterval = Annotated[
    Quantity, ReadBy(_read_span, quantity_schema(Dimension.LENGTH, tolerance=True))
]


def _read_distance(value: Any) -> Quantity:
    """One distance; whoever gives two of a platform is told where these stand."""
    if isinstance(value, str) and ".." in value:
        span = read_quantity(value, Dimension.LENGTH, 0.0, above=True, tolerance=True)
        hint = (
            "several distances are a key of the stage, beside `platform`: distance: NEAR .. FAR; "
            "then all of them count"
        )
        raise refusal("an interval where one distance is due", "one figure", span.text, hint)
    return read_quantity(value, Dimension.LENGTH, 0.0, above=True)


OneDistance = Annotated[float, ReadBy(_read_distance, quantity_schema(Dimension.LENGTH))]
Rate = Annotated[float, figure_of(Dimension.FREQUENCY, 0.0, above=True)]


def _read_reflectivity(value: Any) -> Quantity:
    share = read_quantity(value, Dimension.RATIO, 0.0, above=True)
    if share > 1.0:
        raise refusal("out of range", "at most 100 %", share.text)
    return share


Reflectivity = Annotated[float, ReadBy(_read_reflectivity, quantity_schema(Dimension.RATIO))]


def _read_far_end(value: Any) -> Quantity | dict[str, Quantity]:
    """One length, or one for each reflectivity (`10 %`) or target strength (`-30 dB`)."""
    if not isinstance(value, Mapping):
        return read_quantity(value, Dimension.LENGTH, 0.0, above=True)
    if not value:
        raise refusal("an empty table", "such as {10 %: 40 m, 80 %: 70 m}", "{}")
    errors: list[tuple[KeyPath, PydanticCustomError]] = []
    found: dict[str, Quantity] = {}
    for key, item in value.items():
        if not _STRENGTH.fullmatch(str(key)):
            wanted = "a reflectivity such as 10 %, or a target strength such as -30 dB"
            errors.append(((str(key),), refusal("not a target", wanted, kind_of(key))))
            continue
        try:
            found[str(key)] = read_quantity(item, Dimension.LENGTH, 0.0, above=True)
        except PydanticCustomError as error:
            errors.append(((str(key),), error))
    if errors:
        raise refusals(errors)
    return found


_LENGTH = quantity_schema(Dimension.LENGTH)
_TABLE = {"type": "object", "additionalProperties": _LENGTH}
FarEnd = Annotated[float | dict[str, float], ReadBy(_read_far_end, {"anyOf": [_LENGTH, _TABLE]})]


class Reach(FileRecord):
    """Between which distances a ranging sensor measures; `at` names the condition."""

    min: NonNegativeLength | None = None
    max: FarEnd | None = None
    at: str = ""

    @model_validator(mode="after")
    def _ends_in_order(self) -> Reach:
        if self.min is None and self.max is None:
            raise refusals([(("max",), refusal("missing", "min, max or both"))])
        far = self.farthest()
        if self.min is not None and far is not None and self.min > far:
            shown = f"min {_text(self.min)}, max {_text(far)}"
            raise refusals([(("min",), refusal("min above max", "min <= max", shown))])
        return self

    @model_validator(mode="after")
    def _brighter_is_no_nearer(self) -> Reach:
        """What reflects more is seen from at least as far."""
        named = {key: _ratio(key) for key in self._rows()} if self.max is not None else {}
        rows = sorted((r, key) for key, r in named.items() if r is not None and r < math.inf)
        for (_, darker), (_, brighter) in pairwise(rows):
            far, near = self._rows()[darker], self._rows()[brighter]
            if near < far:
                shown = f"{brighter}: {_text(near)} beside {darker}: {_text(far)}"
                told = refusal("a brighter target is seen less far", "at least as far", shown)
                raise refusals([(("max", brighter), told)])
        return self

    def farthest(self, reflectivity: float | None = None) -> float | None:
        """The far end; of a table the smallest row, unless a reflectivity (0.8) picks one.

        A row holds for every target that reflects at least what it says; None: no row does.
        """
        if self.max is None:
            return None
        if reflectivity is None:
            return min(self._rows().values())
        held = [
            length
            for target, length in self._rows().items()
            if (ratio := _ratio(target)) is None or ratio <= reflectivity * (1.0 + 1e-12)
        ]
        return max(held, default=None)

    def surely_ends(self, reflectivity: float | None = None) -> float | None:
        """The distance beyond which it does not measure, for all that is told; None: not told.

        Where no row holds for so dark a target, those of brighter ones bound it from above.
        """
        far = self.farthest(reflectivity)
        if far is not None or self.max is None or reflectivity is None:
            return far
        brighter = [end for row, end in self._rows().items() if _ratio(row) != math.inf]
        return min(brighter, default=max(self._rows().values()))

    def _rows(self) -> Mapping[str, float]:
        """The far end by target; one alone holds for the reflectivity that `at` names, if any."""
        if isinstance(self.max, Mapping):
            return self.max
        named = _PERCENT.search(self.at)
        assert self.max is not None
        return {f"{named[1]} %" if named else "": self.max}

    def is_favourable(self, distance_m: float, reflectivity: float | None = None) -> bool:
        """Whether a distance is within reach only of a target brighter than the darkest told."""
        far = self.farthest(reflectivity)
        if far is None or len(self._rows()) < 2:
            return False
        return min(self._rows().values()) < distance_m <= far


_PERCENT = re.compile(r"([0-9]+(?:\.[0-9]+)?) ?%")


def _ratio(target: str) -> float | None:
    """A row's reflectivity; None where it says none, and then holds for every target."""
    if target.endswith("dB"):  # a target strength: no reflectivity picks it
        return math.inf
    return float(target[:-2]) / 100.0 if target.endswith("%") else None


def _text(value: float) -> str:
    return str(getattr(value, "text", value))


class FieldOfView(FileRecord):
    """Where a sensor looks, about its own axes; left out: a full turn, or not known."""

    azimuth: AngleInterval | None = None
    elevation: AngleInterval | None = None

    @model_validator(mode="after")
    def _within_a_turn(self) -> FieldOfView:
        errors = []
        for name, value in self:
            if value is not None and value.high - value.low > FULL_TURN * (1.0 + 1e-12):
                errors.append(
                    ((name,), refusal("wider than a turn", "at most 360 deg", value.text))
                )
        if self.azimuth is None and self.elevation is None:
            errors.append((("azimuth",), refusal("missing", "azimuth, elevation or both")))
        if errors:
            raise refusals(errors)
        return self


class Lifecycle(FileRecord):
    """Whether a product can be had, as read on a day."""

    status: Literal["active", "discontinued", "announced"]
    read: Day
    source: str = ""
    successor: NonEmptyText | None = None  # id of the entry that follows it
    note: str = ""


def _read_kind(value: Any) -> str:
    if isinstance(value, str) and (conversion_of(value) is not None or value in kinds()):
        return value
    hint = did_you_mean(value, kinds()) if isinstance(value, str) else ""
    raise refusal("no such kind of figure", " or ".join(kinds()), kind_of(value), hint)


class PrintedFigure(FileRecord):
    """One figure as its source prints it.

    over: the length that a share of a length refers to (a baseline, a slant range); at: under
    which condition it holds; source and address: what was read; read: on which day.
    """

    figure: NonEmptyText
    kind: Annotated[str, ReadBy(_read_kind, {"type": "string"})]
    source: NonEmptyText
    read: Day
    address: str = ""
    over: PositiveLength | None = None
    at: str = ""
    note: str = ""

    @reads_field("figure", mode="after")
    @classmethod
    def _is_short(cls, value: str) -> str:
        if len(value) > 200:
            raise refusal("too long for a figure", "at most 200 characters", f"{len(value)}")
        return value


Figures = Annotated[dict[str, PrintedFigure], Field(default_factory=dict)]

# The parts of a figure that may have sources of their own: which axes each one gives.
AXES: Final[Mapping[str, Mapping[str, tuple[int, ...]]]] = {
    "sigma_position": {
        "north": (0,), "east": (1,), "down": (2,), "horizontal": (0, 1), "vertical": (2,),
    },
    "sigma_attitude": {"roll": (0,), "pitch": (1,), "yaw": (2,), "roll_pitch": (0, 1)},
    "sigma_bearing": {"azimuth": (0,), "elevation": (1,)},
}  # fmt: skip
PARTS: Final[Mapping[str, tuple[str, ...]]] = {
    **{name: tuple(parts) for name, parts in AXES.items()},
    "reach": ("min", "max"),
}
SIGMA_DIMENSIONS: Final[Mapping[str, Dimension]] = {
    "sigma_position": Dimension.LENGTH,
    "sigma_range": Dimension.LENGTH,
    "sigma_attitude": Dimension.ANGLE,
    "sigma_bearing": Dimension.ANGLE,
}


def split_figure(key: str) -> tuple[str, str]:
    """`sigma_attitude.yaw` -> (`sigma_attitude`, `yaw`); the part is empty for a whole figure."""
    name, _, part = key.partition(".")
    return name, part


def unknown_figures(keys: Iterator[str], known: list[str]) -> Iterator[tuple[str, str]]:
    """Keys that name no figure of an entry, each with what it might have meant."""
    for key in keys:
        name, part = split_figure(key)
        if name not in known:
            yield key, did_you_mean(name, known)
        elif part and part not in PARTS.get(name, ()):
            yield key, did_you_mean(part, PARTS.get(name, ())) or "no such part of this figure"
