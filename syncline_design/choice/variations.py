"""A spec with one thing changed: what-if questions are answered by building and solving anew."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from fractions import Fraction
from typing import Any, Literal

from syncline_design.choice.table import Problem
from syncline_design.machine.deadline import in_force
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import format_quantity
from syncline_design.model.quantity import Dimension, Quantity
from syncline_design.model.roles import RoleName
from syncline_design.model.unit_table import SI_UNITS
from syncline_design.spec.case import IN_PLACE, Case, ends_of
from syncline_design.spec.catalog import SensorEntry
from syncline_design.spec.choices import MethodChoice
from syncline_design.spec.noise_table import NoiseTable

Build = Callable[[Case], Problem]
PlatformFigure = Literal["v_max", "distance", "omega_max"]
PLATFORM_FIGURES: dict[PlatformFigure, tuple[str, Dimension]] = {
    "v_max": ("speed v_max", Dimension.SPEED),
    "distance": ("distance", Dimension.LENGTH),
    "omega_max": ("turn rate omega_max", Dimension.ANGULAR_RATE),
}
PLATFORM_UNITS = {figure: SI_UNITS[of] for figure, (_, of) in PLATFORM_FIGURES.items()}
SIGMA_DIMENSIONS = {
    "sigma_position": Dimension.LENGTH,
    "sigma_attitude": Dimension.ANGLE,
    "sigma_range": Dimension.LENGTH,
    "sigma_bearing": Dimension.ANGLE,
}


def quantity(value: float | Fraction, dimension: Dimension) -> Quantity:
    """A figure of our own making as the spec would hold it."""
    exact = Fraction(value)
    return Quantity(exact, format_quantity(float(exact), dimension))


def with_stage(case: Case, index: int, **changes: Any) -> Case:
    """The spec with some keys of one stage changed; every what-if asks for time first."""
    in_force().check()
    stages = list(case.spec.stages)
    stages[index] = stages[index].model_copy(update=changes)
    spec = case.spec.model_copy(update={"stages": tuple(stages)})
    return replace(case, spec=spec)


def with_platform_figure(case: Case, stage: int, figure: PlatformFigure, value: Quantity) -> Case:
    """The spec with one figure of a stage's platform changed."""
    choice = case.spec.stages[stage]
    if figure == "distance" and choice.distance is not None:
        return with_stage(case, stage, distance=_up_to(ends_of(choice.distance)[0], value))
    platform = choice.platform.model_copy(update={figure: value})
    return with_stage(case, stage, platform=platform)


def _up_to(near: Quantity, far: Quantity) -> Quantity:
    """Distances up to another far end; the near end gives way to it."""
    near = min(near, far)
    middle = (near.exact + far.exact) / 2
    return Quantity(middle, f"{near.text} .. {far.text}", (near.exact, far.exact))


def platform_figure(case: Case, stage: int, figure: PlatformFigure) -> float:
    """One figure of a stage's platform [SI], as written."""
    value: float = getattr(case.stages[stage].platform.entry, figure)
    return value


def with_methods(case: Case, stage: int, role: RoleName, methods: tuple[str, ...]) -> Case:
    """The spec with other timestamping methods open to one role."""
    choice = case.spec.stages[stage].role(role)
    assert choice is not None
    opened = MethodChoice.model_construct(candidates=methods)
    return with_stage(case, stage, **{role: choice.model_copy(update={"timestamping": opened})})


@dataclass(frozen=True, slots=True)
class SheetFigure:
    """One datasheet figure of a sensor: `figure` of axis `axis` (None: the one for all axes).

    stage, role: where a sensor given in place stands; None: an entry of the catalogs.
    """

    sensor: str
    figure: str
    axis: int | None
    quantity: Quantity
    place: tuple[int, RoleName] | None = None

    @property
    def dimension(self) -> Dimension:
        """What it measures."""
        return SIGMA_DIMENSIONS[self.figure]

    @property
    def name(self) -> str:
        """`ublox_f9p_rtk sigma_position`, with the axis where there are several."""
        axis = "" if self.axis is None else f"[{self.axis}]"
        return f"{self.sensor} {self.figure}{axis}"


def sigma_figures(case: Case) -> Iterator[SheetFigure]:
    """Every datasheet figure of every sensor that the spec may use, once."""
    seen: set[tuple[str, str, int | None]] = set()
    for stage in case.stages:
        for role in stage.roles:
            for one in role.sensors:
                place = (stage.index, role.role) if one.origin == IN_PLACE else None
                for figure in _figures(one.id, one.entry, place):
                    key = (figure.sensor, figure.figure, figure.axis)
                    if key not in seen:
                        seen.add(key)
                        yield figure


def _figures(
    name: str, entry: SensorEntry, place: tuple[int, RoleName] | None
) -> Iterator[SheetFigure]:
    for figure in SIGMA_DIMENSIONS:
        value = getattr(entry, figure)
        if isinstance(value, NoiseTable):
            continue  # not one figure
        if isinstance(value, Quantity):
            yield SheetFigure(name, figure, None, value, place)
        elif isinstance(value, tuple):
            for axis, one in enumerate(value):
                if isinstance(one, Quantity):
                    yield SheetFigure(name, figure, axis, one, place)


def with_figure(case: Case, figure: SheetFigure, value: Quantity) -> Case:
    """The spec and catalogs with one datasheet figure changed; OutOfTime after the deadline."""
    in_force().check()
    if figure.place is not None:
        stage, role = figure.place
        choice = case.spec.stages[stage].role(role)
        assert choice is not None
        assert isinstance(choice.sensor, SensorEntry)
        sensor = with_changed(choice.sensor, figure, value)
        return with_stage(case, stage, **{role: choice.model_copy(update={"sensor": sensor})})
    sensors = dict(case.catalog.sensors)
    sensors[figure.sensor] = with_changed(sensors[figure.sensor], figure, value)
    catalog = case.catalog.model_copy(update={"sensors": sensors})
    return replace(case, catalog=catalog)


def with_changed(entry: SensorEntry, figure: SheetFigure, value: Quantity) -> SensorEntry:
    """A sensor with one of its figures changed."""
    new: Any = value
    if figure.axis is not None:
        axes = list(getattr(entry, figure.figure))
        axes[figure.axis] = value
        new = tuple(axes)
    return entry.model_copy(update={figure.figure: new})
