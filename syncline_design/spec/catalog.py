"""Catalogs: platforms, sensors, timestamping methods, clocks, shared hardware."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from typing import Annotated, Any, Literal, Self

from pydantic import Field, PlainValidator, model_validator
from pydantic_core import PydanticCustomError

from syncline_design.model.quantity import Dimension, Quantity
from syncline_design.model.roles import RoleName
from syncline_design.spec.facts import (
    Corrected,
    FieldOfView,
    Figures,
    Lifecycle,
    Medium,
    MoneyInterval,
    Rate,
    Reach,
    TemperatureInterval,
    unknown_figures,
)
from syncline_design.spec.fields import (
    Acceleration,
    AngularAcceleration,
    AngularRate,
    AtLeastOne,
    Count,
    FileRecord,
    Mass,
    Money,
    NonEmptyText,
    NonNegativeLength,
    NonNegativeTime,
    PositiveLength,
    PositiveTime,
    Power,
    Ratio,
    ReadBy,
    Speed,
    axes,
    kind_of,
    quantity_schema,
    read_quantity,
    refusal,
    refusals,
)
from syncline_design.spec.noise_table import NoiseTable, read_table, table_schema, table_where
from syncline_design.spec.timestamp_errors import TimestampError, read_error
from syncline_design.spec.yaml_text import KeyPath

Primitive = Literal["pps", "network", "tov", "trigger", "arrival"]
Need = Literal["gnss"]  # what an entry cannot work without
Motion = Literal["multirotor", "fixed_wing", "ground", "surface", "underwater"]
Sigma = float | tuple[float, ...]

SIGMAS_OF: dict[str, tuple[str, ...]] = {
    "position": ("sigma_position",),
    "attitude": ("sigma_attitude",),
    "ranging": ("sigma_range", "sigma_bearing"),
}


BASES = ("assumption", "transcript")  # a transcript: another's copy of a maker's document


def _read_basis(value: Any) -> Any:
    if value in BASES:
        return value
    if isinstance(value, dict) and value and all(v in BASES for v in value.values()):
        return value
    wanted = "assumption, transcript, or a mapping such as {cost: assumption}"
    raise refusal("a basis that is not known", wanted, kind_of(value))


Basis = Annotated[
    Any,
    ReadBy(
        _read_basis,
        {
            "anyOf": [
                {"enum": list(BASES)},
                {"type": "object", "additionalProperties": {"enum": list(BASES)}},
            ]
        },
    ),
]


DriveArea = Annotated[Sigma, axes(Dimension.LENGTH, ("north", "east"))]


class EntryKeys(FileRecord):
    """What every catalog entry may say about itself."""

    name: str = ""
    source: str = ""
    basis: Basis | None = None  # "assumption", or per figure: {cost: assumption}
    note: str = ""
    figures: Figures  # what sources print, by figure or by part: sigma_attitude.yaw
    unusual: dict[str, NonEmptyText] = Field(default_factory=dict)  # figure to why it stands apart

    @model_validator(mode="after")
    def _names_figures(self) -> EntryKeys:
        known = [name for name in type(self).model_fields if name not in _ABOUT]
        named = self.basis if isinstance(self.basis, dict) else {}
        if not named and not self.figures and not self.unusual:
            return self
        errors: list[tuple[KeyPath, PydanticCustomError]] = [
            ((field, key), refusal("no such figure", hint=hint))
            for field, keys in (
                ("basis", named),
                ("figures", self.figures),
                ("unusual", self.unusual),
            )
            for key, hint in unknown_figures(iter(keys), known)
        ]
        if errors:
            raise refusals(errors)
        return self

    def told(self) -> Iterator[tuple[str, Any]]:
        """Every key with its value, those that only this kind of entry has first."""
        own = [name for name in type(self).model_fields if name not in Product.model_fields]
        shared = [name for name in type(self).model_fields if name in Product.model_fields]
        return ((name, getattr(self, name)) for name in (*own, *shared))

    def told_figures(self) -> list[str]:
        """The figures that it gives."""
        return [
            key
            for key, value in self.told()
            if key not in _NOT_FIGURES and value not in (None, (), {})
        ]

    def basis_of(self, figure: str) -> str | None:
        """What a figure, or the part of one, stands on; None: on its source."""
        if not isinstance(self.basis, dict):
            return self.basis
        named: str | None = self.basis.get(figure, self.basis.get(figure.partition(".")[0]))
        return named


_ABOUT = frozenset({"name", "source", "basis", "note", "figures", "unusual"})
_NOT_FIGURES = _ABOUT | {"modality", "type", "timeline", "lifecycle"}


class Product(EntryKeys):
    """What can be bought."""

    needs: tuple[Need, ...] = ()
    cost: Money | None = None
    price_class: MoneyInterval | None = None  # where no list price is public
    mass: Mass | None = None
    power: Power | None = None
    lifecycle: Lifecycle | None = None
    lead_time: NonNegativeTime | None = None
    temperature: TemperatureInterval | None = None

    def at_no_cost(self, currency: str) -> Self:
        """The same entry where it is there already; that it costs nothing needs no source."""
        basis = self.basis
        if isinstance(basis, str):  # of all of it: of every other figure then
            basis = dict.fromkeys(self.told_figures(), basis)
        if basis is not None:
            basis = {name: kind for name, kind in basis.items() if name != "cost"} or None
        changes = {
            "cost": Quantity(Fraction(0), f"0 {currency}", None, currency),
            "price_class": None,
            "basis": basis,
            "figures": {name: one for name, one in self.figures.items() if name != "cost"},
        }
        return self.model_copy(update=changes)


class PlatformEntry(EntryKeys):
    v_max: Speed
    omega_max: AngularRate
    distance: PositiveLength
    baseline: NonNegativeLength
    medium: Medium | None = None  # of the path to the object
    motion: Motion | None = None  # what a test drive may ask of it, with the figures below
    acceleration: Acceleration | None = None
    angular_acceleration: AngularAcceleration | None = None
    minimum_turn_radius: NonNegativeLength | None = None
    minimum_speed: Speed | None = None
    area: DriveArea | None = None
    height: NonNegativeLength | None = None


_RANGE_SCHEMA = quantity_schema(Dimension.LENGTH, tolerance=True)


def _read_range_sigma(value: Any) -> Quantity:
    if isinstance(value, dict):
        return read_table(value, Dimension.LENGTH, ("range", "angle"))
    return read_quantity(value, Dimension.LENGTH, 0.0, above=True, tolerance=True)


RangeSigma = Annotated[
    float,
    ReadBy(_read_range_sigma, {"anyOf": [_RANGE_SCHEMA, table_schema(Dimension.LENGTH)]}),
]
_BEARING = axes(Dimension.ANGLE, ("azimuth", "elevation"))


def _read_bearing_sigma(value: Any) -> Any:
    if isinstance(value, dict):
        return read_table(value, Dimension.ANGLE, ("angle",))
    return _BEARING.read(value)


BearingSigma = Annotated[
    Sigma,
    ReadBy(
        _read_bearing_sigma,
        {"anyOf": [*_BEARING.schema["anyOf"], table_schema(Dimension.ANGLE)]},
    ),
]


class SensorEntry(Product):
    """A sensor; the sigmas of its modality are due, those of others refused.

    A single sigma_position, sigma_attitude or sigma_bearing holds for every axis.
    """

    modality: RoleName
    type: str = ""
    sigma_position: Annotated[Sigma, axes(Dimension.LENGTH, ("north", "east", "down"))] | None = (
        None
    )
    sigma_attitude: Annotated[Sigma, axes(Dimension.ANGLE, ("roll", "pitch", "yaw"))] | None = None
    sigma_range: RangeSigma | None = None
    sigma_bearing: BearingSigma | None = None
    primitives: tuple[Primitive, ...]
    reach: Reach | None = None
    medium: Medium | None = None
    field_of_view: FieldOfView | None = None
    rate: Rate | None = None
    corrects: tuple[Corrected, ...] | None = None  # []: the maker corrects for nothing
    depth_rating: PositiveLength | None = None

    @model_validator(mode="after")
    def _sigmas_fit_modality(self) -> SensorEntry:
        errors: list[tuple[KeyPath, PydanticCustomError]] = []
        for modality, names in SIGMAS_OF.items():
            for name in names:
                given = getattr(self, name) is not None
                if modality == self.modality and not given:
                    errors.append(
                        ((name,), refusal(f"missing for a sensor of modality {modality}"))
                    )
                elif modality != self.modality and given:
                    message = f"a figure of {modality} sensors"
                    errors.append(((name,), refusal(message, found=f"modality {self.modality}")))
        if errors:
            raise refusals(errors)
        return self

    @property
    def tables(self) -> dict[str, NoiseTable]:
        """Its deviations that depend on range or angle, by figure."""
        found = {"sigma_range": self.sigma_range, "sigma_bearing": self.sigma_bearing}
        return {name: one for name, one in found.items() if isinstance(one, NoiseTable)}

    def where(self, distance: float, look: FieldOfView | None) -> SensorEntry:
        """The sensor with its deviations where a stage uses it, `distance` [m] away at most."""
        tables = self.tables
        if not tables:
            return self
        placed = {name: table_where(one, distance, look) for name, one in tables.items()}
        return self.model_copy(update=placed)

    @property
    def serves(self) -> tuple[Primitive, ...]:
        """Primitives of the sensor; arrival, which every sensor has, included."""
        return tuple(dict.fromkeys((*self.primitives, "arrival")))


ErrorEntry = Annotated[
    TimestampError, PlainValidator(read_error, json_schema_input_type=TimestampError)
]


class TimestampingEntry(Product):
    """A timestamping method; cost, mass and power count per sensor that uses it."""

    primitives: Annotated[tuple[Primitive, ...], AtLeastOne]
    timeline: Literal["host", "utc"] = "host"
    error: ErrorEntry
    requires: dict[str, Count] = Field(default_factory=dict)  # channels of shared hardware


class InfrastructureEntry(Product):
    """Shared hardware, bought once per vehicle and per full set of channels."""

    channels: Count


class ClockEntry(Product):
    """How a vehicle's host clock is disciplined; offset is host against UTC.

    offset_after: of an offset that is stated after so long without a reference, and holds what the
    clock drifts till then; beside drift and holdover, which are added to it, it would count twice.
    """

    offset: ErrorEntry
    drift: Ratio | None = None  # free-running clock: ppm, times holdover
    holdover: PositiveTime | None = None
    offset_after: PositiveTime | None = None
    requires: dict[str, Count] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _drift_has_holdover(self) -> ClockEntry:
        if (self.drift is None) != (self.holdover is None):
            given, due = ("drift", "holdover") if self.holdover is None else ("holdover", "drift")
            raise refusals(
                [((due,), refusal(f"missing beside {given}", "drift and holdover, or neither"))]
            )
        if self.holdover is not None and self.offset_after is not None:
            raise refusals([(("offset_after",), refusal(
                "beside drift and holdover", "one of both", hint="delete one"))])  # fmt: skip
        return self

    @property
    def alone_s(self) -> float | None:
        """For how long without a reference its figures are [s]; None of a clock in lock."""
        length = self.offset_after if self.holdover is None else self.holdover
        return None if length is None else float(length)


class Catalog(FileRecord):
    """All entries of one file, or of several merged."""

    platforms: dict[NonEmptyText, PlatformEntry] = Field(default_factory=dict)
    sensors: dict[NonEmptyText, SensorEntry] = Field(default_factory=dict)
    timestamping: dict[NonEmptyText, TimestampingEntry] = Field(default_factory=dict)
    infrastructure: dict[NonEmptyText, InfrastructureEntry] = Field(default_factory=dict)
    clocks: dict[NonEmptyText, ClockEntry] = Field(default_factory=dict)


SECTIONS = tuple(Catalog.model_fields)


class CatalogFile(Catalog):
    """One catalog file: entries, and further catalog files it draws in."""

    catalogs: tuple[NonEmptyText, ...] = ()
