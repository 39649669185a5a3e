"""Entries that a spec does not list, let in as candidates one place at a time."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from syncline_design.choice.holding import EntryKind
from syncline_design.choice.variations import with_methods, with_stage
from syncline_design.spec.case import IN_PLACE, Case, RoleCase, StageCase
from syncline_design.spec.catalog import Catalog
from syncline_design.spec.choices import ClockChoice
from syncline_design.spec.fields import did_you_mean
from syncline_design.spec.load import builtin_collection

SECTIONS: dict[EntryKind, str] = {
    "sensor": "sensors",
    "timestamping": "timestamping",
    "hardware": "infrastructure",
    "clock": "clocks",
}
Kinds = Mapping[str, tuple[EntryKind, ...]]


class NoSuchEntry(ValueError):  # noqa: N818 - names a state of the input
    """An id that no catalog has."""


def kinds_of(case: Case, entries: Sequence[str]) -> Kinds:
    """What kinds of entry each id names; NoSuchEntry for one that names none."""
    found = {entry: tuple(_kinds(case, entry)) for entry in entries}
    for entry, kinds in found.items():
        if not kinds:
            listed = (
                name for section in SECTIONS.values() for name in getattr(case.catalog, section)
            )
            hint = did_you_mean(entry, sorted({*listed, *_in_place(case)}))
            raise NoSuchEntry(
                f"{entry}: no such entry in the catalogs" + (f"; {hint}" if hint else "")
            )
    return found


def _kinds(case: Case, entry: str) -> Iterator[EntryKind]:
    for kind, section in SECTIONS.items():
        if entry in getattr(case.catalog, section) or (
            kind == "sensor" and entry in _in_place(case)
        ):
            yield kind


def _in_place(case: Case) -> set[str]:
    """Sensors that the spec itself describes."""
    every = (one for stage in case.stages for role in stage.roles for one in role.sensors)
    return {one.id for one in every if one.origin == IN_PLACE}


def with_whole_catalog(case: Case) -> Case:
    """The case with every shipped entry, those too that nothing in its spec asks for."""
    shipped = builtin_collection()
    whole = shipped.catalog()
    sections = ("platforms", *SECTIONS.values())
    merged = {name: {**getattr(whole, name), **getattr(case.catalog, name)} for name in sections}
    catalog: Catalog = case.catalog.model_copy(update=merged)
    return replace(case, catalog=catalog, origins={**shipped.origins, **case.origins})


def homes(case: Case, kind: EntryKind, entry: str) -> Iterator[str]:
    """Roles and vehicles that could list an entry among their candidates."""
    for stage in case.stages:
        if kind == "clock":
            yield f"the clock of {stage.choice.vehicle_name}"
        for role in stage.roles:
            if _suits(case, role, kind, entry):
                yield f"{stage.choice.name}.{role.role}"


def admissions(case: Case, kind: EntryKind, entry: str) -> Iterator[Case]:
    """The case with an entry as the only candidate of one place, for every place that suits it."""
    if kind == "hardware":
        yield from _by_hardware(case, entry)
        return
    for stage in case.stages:
        for role in stage.roles:
            if _suits(case, role, kind, entry):
                yield _in_role(case, stage, role, kind, entry)
    if kind == "clock":
        for vehicle in dict.fromkeys(stage.choice.vehicle_name for stage in case.stages):
            yield _on_vehicle(case, vehicle, entry)


def _by_hardware(case: Case, item: str) -> Iterator[Case]:
    """Hardware comes with the methods and clocks that need it."""
    for method, one in case.catalog.timestamping.items():
        if item in one.requires:
            yield from admissions(case, "timestamping", method)
    for clock, other in case.catalog.clocks.items():
        if item in other.requires:
            yield from admissions(case, "clock", clock)


def _suits(case: Case, role: RoleCase, kind: EntryKind, entry: str) -> bool:
    if kind == "timestamping":
        return True
    return kind == "sensor" and case.catalog.sensors[entry].modality == role.role


def _in_role(case: Case, stage: StageCase, role: RoleCase, kind: EntryKind, entry: str) -> Case:
    if kind == "timestamping":
        return with_methods(case, stage.index, role.role, (entry,))
    choice = role.choice.model_copy(update={"sensor": entry, "candidates": None})
    return with_stage(case, stage.index, **{role.role: choice})


def _on_vehicle(case: Case, vehicle: str, clock: str) -> Case:
    """Stages of a vehicle that name clocks agree on them; where none does, the first names it."""
    aboard = [stage for stage in case.stages if stage.choice.vehicle_name == vehicle]
    naming = [stage for stage in aboard if stage.choice.clock is not None] or aboard[:1]
    for stage in naming:
        chosen = ClockChoice.model_construct(candidates=(clock,))
        case = with_stage(case, stage.index, clock=chosen)
    return case
