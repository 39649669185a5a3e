"""Figures of a spec that are allowed and hardly meant: a unit slipped, a digit too many.

Nothing here is refused.  A figure is held against what it says it is: a platform against the entry
that it changes, or against all platforms of the catalogs; a lever arm against the largest of the
platform; a sensor's noise against shipped sensors of its type.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from statistics import median
from typing import Final

from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import format_quantity, to_digits
from syncline_design.model.quantity import Dimension, Quantity
from syncline_design.model.roles import ROLES
from syncline_design.spec.case import CandidateEntry, Case, StageCase
from syncline_design.spec.catalog import PlatformEntry, SensorEntry
from syncline_design.spec.catalog_check import FACTOR, FEWEST_SIBLINGS, size_of
from syncline_design.spec.facts import SIGMA_DIMENSIONS
from syncline_design.spec.load import load_siblings

LONG_ARM: Final = 3.0  # times the largest lever arm that the platform says it has
MAST_M: Final = 5.0  # from so deep a mast or a float may still reach the air
FIGURES: Final = {
    "v_max": Dimension.SPEED,
    "omega_max": Dimension.ANGULAR_RATE,
    "baseline": Dimension.LENGTH,
}
DEGREE: Final = math.pi / 180.0
SHIPPED: Final = "builtin:"  # origin of the product's own entries, which are looked over as such


@dataclass(frozen=True, slots=True)
class Implausible:
    """A figure that stands apart: of an entry (None: of the spec itself), under which key."""

    entry: str | None
    key: str
    reason: str


def implausible(
    case: Case, sensors: Iterable[CandidateEntry[SensorEntry]]
) -> Iterator[Implausible]:
    """What of a spec, and of some sensors that it may use, is hardly meant."""
    for stage in case.stages:
        yield from _platform(case, stage)
        yield from _arms(stage)
        yield from _under_water(stage)
    own = {one.id: one.entry for one in sensors if not one.origin.startswith(SHIPPED)}
    types = {(one.modality, one.type) for one in own.values() if one.type}
    shipped = tuple(load_siblings(types).sensors.values()) if types else ()
    for name, entry in own.items():
        yield from _noise(name, entry, shipped)


def _platform(case: Case, stage: StageCase) -> Iterator[Implausible]:
    """Figures of a platform that the spec gives, against those it changes, or all there are."""
    choice = stage.choice.platform
    given = {key: getattr(choice, key) for key in FIGURES}
    figures = {key: v for key, v in given.items() if isinstance(v, Quantity) and v > 0.0}
    others = case.catalog.platforms if figures else {}
    base = None if choice.use is None else others.get(choice.use)
    for key, value in figures.items():
        reason = _changed(key, value, base) if base else _unheard(key, value, others.values())
        if reason:
            name = stage.platform.id
            yield Implausible(name, key, f"{stage.choice.name}: {key} {value.text} {reason}")


def _changed(key: str, value: Quantity, base: PlatformEntry) -> str:
    """Why a figure is hardly meant in place of the catalog's; empty where it may be."""
    was: float = getattr(base, key)
    if not was > 0.0 or was / FACTOR <= value <= was * FACTOR:
        return ""
    ratio = max(value / was, was / value)
    way = "times" if value > was else "times less than"
    shown = getattr(was, "text", format_quantity(was, FIGURES[key]))
    return (
        f"is {to_digits(ratio, 3)} {way} the {shown} of the platform that it "
        f"changes{_slip(value, was)}"
    )


def _unheard(key: str, value: Quantity, others: Iterable[PlatformEntry]) -> str:
    """The same of a platform given in place: beyond all that are in the catalogs.

    Small figures are nothing unheard of: a tripod does not move.
    """
    most = max((float(getattr(one, key)) for one in others), default=math.inf)
    slip = _slip(value, most) if value > most else ""
    if value <= most * FACTOR and not slip:
        return ""
    shown = format_quantity(most, FIGURES[key])
    return (
        f"is {to_digits(value / most, 3)} times the most of any platform in the catalogs, "
        f"{shown}{slip}"
    )


def _slip(value: Quantity, usual: float) -> str:
    """A hint where the same number in degrees would be usual."""
    number, _, unit = value.text.strip().partition(" ")
    if unit.strip() != "rad/s":
        return ""
    in_degrees = float(value) * DEGREE
    return f"; did you mean {number} deg/s?" if in_degrees <= usual * FACTOR else ""


def _arms(stage: StageCase) -> Iterator[Implausible]:
    """Lever arms against the largest between sensors of the platform."""
    baseline = stage.platform.entry.baseline
    for name in ROLES:
        role = stage.choice.role(name)
        arm = None if role is None else role.lever_arm
        if arm is None:
            continue
        length = math.hypot(*arm)
        if length > LONG_ARM * baseline:
            shown = format_quantity(length, Dimension.LENGTH)
            most = getattr(baseline, "text", format_quantity(baseline, Dimension.LENGTH))
            where = f"stages[{stage.index}].{name}.lever_arm"
            yield Implausible(
                None, where,
                f"{stage.choice.name}.{name}: a lever arm of {shown}, and the platform's baseline "
                f"(its largest) is {most}",
            )  # fmt: skip


def _under_water(stage: StageCase) -> Iterator[Implausible]:
    """What a spec says of a stage at a depth that holds above the surface only."""
    choice = stage.choice
    if choice.depth is None or choice.depth <= MAST_M:
        return
    where, name = f"stages[{stage.index}]", choice.name
    deep = getattr(choice.depth, "text", format_quantity(choice.depth, Dimension.LENGTH))
    if choice.medium == "air":
        reason = f"{name}: medium is air at a depth of {deep}: what it looks at lies under water"
        yield Implausible(None, f"{where}.medium", reason)
    if choice.gnss:
        reason = f"{name}: gnss is yes at a depth of {deep}: no signal of a satellite gets there"
        yield Implausible(None, f"{where}.gnss", reason)


def _noise(name: str, entry: SensorEntry, shipped: Iterable[SensorEntry]) -> Iterator[Implausible]:
    """A sensor's sigmas against those of shipped sensors of its type."""
    siblings = [
        one
        for one in shipped
        if entry.type and one.modality == entry.modality and one.type == entry.type
    ]
    for key, dimension in SIGMA_DIMENSIONS.items():
        value = size_of(entry, key)
        others = [size for one in siblings if (size := size_of(one, key))]
        if not value or key in entry.unusual or len(others) < FEWEST_SIBLINGS:
            continue
        middle = median(others)
        if not middle / FACTOR <= value <= middle * FACTOR:
            ratio = max(value / middle, middle / value)
            way = "more" if value > middle else "less"
            shown = [format_quantity(figure, dimension) for figure in (value, middle)]
            yield Implausible(
                name, key,
                f"{name}: {key} {shown[0]} is {to_digits(ratio, 3)} times {way} than usual: the "
                f"median of "
                f"{len(others)} sensors of type {entry.type} is {shown[1]}",
            )  # fmt: skip
