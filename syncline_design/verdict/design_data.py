"""The design of a verdict as data: who does what, by which clock, at what price, on what basis."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from fractions import Fraction
from typing import Any

from syncline_design.choice.effect_tables import design_budget
from syncline_design.choice.evaluate import Evaluation, chosen_clocks, chosen_options, evaluate
from syncline_design.choice.option import Option
from syncline_design.choice.table import Design, Problem
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.budget import Budget, SensorRow
from syncline_design.model.quantity import Quantity
from syncline_design.model.roles import RoleName
from syncline_design.spec.case import Case, RoleCase, StageCase
from syncline_design.spec.catalog import EntryKeys
from syncline_design.spec.facts import AXES, Reach, split_figure
from syncline_design.verdict.named import (
    HostClock,
    NamedDesign,
    NamedRole,
    NamedStage,
    SharedHardware,
)
from syncline_design.verdict.tree import Assumption, Source, finite


@dataclass(frozen=True, slots=True)
class UsedEntry:
    """A catalog entry (or one given in place) that a design rests on."""

    section: str
    id: str
    entry: EntryKeys


def number(amount: Fraction | None) -> float | None:
    """An exact sum as written; None where a catalog entry does not say."""
    return None if amount is None else float(amount)


def named_design(case: Case, problem: Problem, design: Design, figures: Budget) -> NamedDesign:
    """A design in names."""
    sums = evaluate(problem, design)
    rows = {(row.stage, row.role): row for row in figures.sensors}
    return NamedDesign(
        number(sums.cost),
        number(sums.mass),
        number(sums.power),
        case.spec.currency,
        tuple(_shared(case, problem, sums)),
        tuple(_clocks(case, problem, design)),
        tuple(
            NamedStage(
                stage.choice.name,
                stage.choice.vehicle_name,
                stage.platform.id,
                dict(_roles(stage, problem, design, rows)),
            )
            for stage in case.stages
        ),
    )


def sensor_names(case: Case, problem: Problem) -> list[dict[str, str]]:
    """The names of each role's sensors by their ids; what has none is called by its id."""
    found = []
    for table in problem.roles:
        role = case.stages[table.stage].role(table.role)
        assert role is not None
        ids = dict.fromkeys(option.sensor for option in table.options)
        found.append({one: _called(role, one) for one in ids})
    return found


def _called(role: RoleCase, sensor: str) -> str:
    entry = role.sensor(sensor)
    return (entry.name if entry is not None else "") or sensor


def _roles(
    stage: StageCase,
    problem: Problem,
    design: Design,
    rows: Mapping[tuple[str, RoleName], SensorRow],
) -> Iterator[tuple[str, NamedRole]]:
    for table, option in zip(problem.roles, chosen_options(problem, design), strict=True):
        role = stage.role(table.role)
        if table.stage == stage.index and role is not None:
            yield table.role, _role(role, option, rows[table.stage_name, table.role])


def _role(role: RoleCase, option: Option, row: SensorRow) -> NamedRole:
    method = role.method(option.method)
    return NamedRole(
        sensor=option.sensor,
        name=_called(role, option.sensor),
        primitive=option.primitive,
        timestamping=option.method,
        timestamping_name="given in the spec" if method is None else method.name or option.method,
        timeline=option.timeline,
        tau_s=row.tau_s,
        tau_crit_s=finite(row.tau_crit_s),
        tau_crit_lever_arm_s=finite(row.tau_crit_lever_arm_s),
        sensor_error_m=row.sensor_error_m,
        cost=number(option.resources.cost),
        mass=number(option.resources.mass),
        power=number(option.resources.power),
    )


def _shared(case: Case, problem: Problem, sums: Evaluation) -> Iterator[SharedHardware]:
    for units in sums.units:
        item = problem.infrastructure[units.infrastructure]
        cost = item.resources.cost
        yield SharedHardware(
            item.id,
            case.hardware[item.id].entry.name or item.id,
            problem.vehicles[units.vehicle].name,
            units.count,
            None if cost is None else float(cost * units.count),
        )


def _clocks(case: Case, problem: Problem, design: Design) -> Iterator[HostClock]:
    for vehicle, clock in zip(problem.vehicles, chosen_clocks(problem, design), strict=True):
        entry = case.clock(vehicle.name, clock.id)
        if entry is not None and clock.id is not None:
            cost = number(clock.resources.cost)
            name = entry.name or clock.id
            yield HostClock(vehicle.name, clock.id, name, clock.offset_bound_s, cost)


def used_entries(case: Case, problem: Problem, design: Design) -> list[UsedEntry]:
    """Every catalog entry a design rests on, each once: platforms, sensors, methods, hardware."""
    found: dict[tuple[str, str], EntryKeys | None] = {
        ("platforms", stage.platform.id): stage.platform.entry for stage in case.stages
    }
    for table, option in zip(problem.roles, chosen_options(problem, design), strict=True):
        role = case.stages[table.stage].role(table.role)
        assert role is not None
        found["sensors", option.sensor] = role.sensor(option.sensor)
        found["timestamping", option.method] = role.method(option.method)
    for units in evaluate(problem, design).units:
        identity = problem.infrastructure[units.infrastructure].id
        found["infrastructure", identity] = case.hardware[identity].entry
    for vehicle, clock in zip(problem.vehicles, chosen_clocks(problem, design), strict=True):
        found["clocks", clock.id or ""] = case.clock(vehicle.name, clock.id)
    return [
        UsedEntry(section, identity, entry)
        for (section, identity), entry in found.items()
        if entry is not None
    ]


def assumptions(entries: list[UsedEntry]) -> tuple[Assumption, ...]:
    """Figures without a public source, entry by entry."""
    return tuple(
        Assumption(used.id, used.section, figure, _figure_text(used.entry, figure), used.entry.note)
        for used in entries
        for figure in _resting_on(used.entry, "assumption")
    )


def transcripts(entries: list[UsedEntry]) -> dict[str, list[str]]:
    """Figures that were read in another's copy of a maker's document only, by entry."""
    found = {
        used.id: [
            figure
            for figure in _resting_on(used.entry, "transcript")
            if split_figure(figure)[0] in _WEIGHED
        ]
        for used in entries
    }
    return {identity: figures for identity, figures in found.items() if figures}


# What a verdict is computed from.
_WEIGHED = frozenset(
    {"sigma_position", "sigma_attitude", "sigma_range", "sigma_bearing", "error", "offset"}
    | {"drift", "holdover", "cost", "mass", "power"}
)


def _resting_on(entry: EntryKeys, basis: str) -> list[str]:
    """The figures of an entry that have a basis, in the order in which it names them."""
    figures = list(entry.basis) if isinstance(entry.basis, Mapping) else entry.told_figures()
    return [figure for figure in figures if entry.basis_of(figure) == basis]


def _figure_text(entry: EntryKeys, figure: str) -> str:
    """A figure of an entry, or the part of it that a name with a dot means."""
    name, part = split_figure(figure)
    value = getattr(entry, name, None)
    if isinstance(value, Reach):
        value = getattr(value, part) if part else value
    elif part and isinstance(value, tuple):
        value = tuple(value[axis] for axis in AXES[name][part])
        value = value[0] if len(set(value)) == 1 else value
    return figure_text(value)


def figure_text(value: Any) -> str:
    """A figure as its catalog writes it."""
    if isinstance(value, Quantity):
        return value.text
    if isinstance(value, tuple | list):
        return "[" + ", ".join(figure_text(item) for item in value) + "]"
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key}: {figure_text(item)}" for key, item in value.items()) + "}"
    if hasattr(value, "model_fields_set"):
        parts = [(key, item) for key, item in value if item not in (None, "", (), [], {})]
        return " ".join(
            str(item) if key == "distribution" else f"{key} {figure_text(item)}"
            for key, item in parts
        )
    return "" if value is None else str(value)


def sources(entries: list[UsedEntry]) -> tuple[Source, ...]:
    """Where the figures come from."""
    told = ((used, told_source(used.entry)) for used in entries)
    return tuple(Source(used.id, used.section, source) for used, source in told if source)


def told_source(entry: EntryKeys) -> str:
    """An entry's sources in one line: its own words, then those of its figures, each once."""
    by_source: dict[str, list[str]] = {}
    for key, one in entry.figures.items():
        place = f"{one.source} ({one.address})" if one.address else one.source
        by_source.setdefault(place, []).append(key)
    told = (f"{', '.join(keys)}: {place}" for place, keys in by_source.items())
    return "; ".join([*([entry.source] if entry.source else []), *told])


def full_design(case: Case, problem: Problem, design: Design) -> NamedDesign:
    """A design in names, with its own errors."""
    return named_design(case, problem, design, design_budget(case, problem, design))
