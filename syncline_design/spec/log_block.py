"""How a measured log names its columns, as a spec says it."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from syncline_design.model.quantity import UNITS, Dimension, Quantity, suffix_unit
from syncline_design.spec.fields import (
    FileRecord,
    NonEmptyText,
    ReadBy,
    did_you_mean,
    kind_of,
    quantity_schema,
    read_quantity,
    refusal,
    refusals,
)
from syncline_design.spec.yaml_text import KeyPath


def split_column(text: str) -> tuple[str, str]:
    """`att.phi [rad]` -> (`att.phi`, `rad`); without brackets the unit is empty."""
    whole = text.strip()
    name, bracket, unit = whole.rpartition("[")
    bare = name.rstrip()
    if not (bracket and bare and bare != name and whole.endswith("]")) or "]" in unit[:-1]:
        return whole, ""
    return bare, unit[:-1].strip()


def _read_place(value: Any) -> tuple[Quantity, ...]:
    """Latitude, longitude and height, each with its unit."""
    wanted = "latitude, longitude, height, such as [47.3 deg, 8.55 deg, 460 m]"
    if not isinstance(value, tuple | list) or len(value) != 3:
        found = f"{len(value)} figures" if isinstance(value, tuple | list) else kind_of(value)
        raise refusal("not a place", wanted, found)
    kinds = (Dimension.ANGLE, Dimension.ANGLE, Dimension.LENGTH)
    read, errors = [], list[tuple[KeyPath, PydanticCustomError]]()
    for k, (item, kind) in enumerate(zip(value, kinds, strict=True)):
        try:
            read.append(read_quantity(item, kind))
        except PydanticCustomError as error:
            errors.append(((k,), error))
    if not errors and abs(read[0]) > 0.5 * math.pi * (1.0 + 1e-12):
        errors.append(((0,), refusal("no latitude", "at most 90 deg", read[0].text)))
    if not errors and abs(read[1]) > 2.0 * math.pi * (1.0 + 1e-12):
        errors.append(((1,), refusal("no longitude", "at most 360 deg", read[1].text)))
    if errors:
        raise refusals(errors)
    return tuple(read)


Place = Annotated[
    tuple[float, float, float],
    ReadBy(
        _read_place,
        {
            "type": "array",
            "items": [
                quantity_schema(Dimension.ANGLE),
                quantity_schema(Dimension.ANGLE),
                quantity_schema(Dimension.LENGTH),
            ],
            "minItems": 3,
            "maxItems": 3,
            "description": "WGS 84: latitude, longitude, height above the ellipsoid",
        },
    ),
]


class StreamChoice(FileRecord):
    """Which stream of a log plays which part: a topic, a message or a file, by name."""

    position: NonEmptyText | None = None
    attitude: NonEmptyText | None = None
    velocity: NonEmptyText | None = None
    rate: NonEmptyText | None = None
    ranging: NonEmptyText | None = None
    target: NonEmptyText | None = None
    reference: NonEmptyText | None = None


class LogChoice(FileRecord):
    """How a measured log is read.

    columns: canonical name to `their.name [unit]`.  origin: latitude, longitude, height above the
    ellipsoid of the log's local frame.  streams: of bags and flight logs, what plays which part.
    frame, body, timeline, gps_week: of streams that do not say so themselves.
    """

    columns: dict[NonEmptyText, NonEmptyText] = Field(default_factory=dict)
    files: tuple[NonEmptyText, ...] = ()
    origin: Place | None = None
    streams: StreamChoice = Field(default_factory=StreamChoice)
    frame: Literal["enu", "ned"] | None = None
    body: Literal["flu", "frd"] | None = None
    timeline: Literal["utc", "gps", "tai", "boot"] | None = None
    gps_week: Annotated[int, Field(ge=0, le=10_000)] | None = None

    @model_validator(mode="after")
    def _units_fit(self) -> LogChoice:
        errors: list[tuple[KeyPath, PydanticCustomError]] = []
        for canonical, theirs in self.columns.items():
            dimension, (_, unit) = suffix_unit(canonical)[1], split_column(theirs)
            known = UNITS.get(unit)
            if unit and known is None:
                hint = did_you_mean(unit, UNITS)
                errors.append(
                    (("columns", canonical), refusal("unknown unit", found=repr(unit), hint=hint))
                )
            elif known is not None and known[0] is not dimension:
                error = refusal("wrong dimension", dimension.value, f"{unit} ({known[0].value})")
                errors.append((("columns", canonical), error))
        if errors:
            raise refusals(errors)
        return self
