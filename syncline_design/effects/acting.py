"""The known effects of a system: each where it acts, and what it adds to the budget."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from syncline_design.effects import registry
from syncline_design.effects.record import (
    NOTHING,
    Basis,
    Contribution,
    Departures,
    Effect,
    StageRows,
    Values,
)
from syncline_design.model.known import EffectEntry
from syncline_design.model.lever_arms import arm_lengths
from syncline_design.model.pairing import distance_m
from syncline_design.model.system import RoleName, SimulationError, Stage, System


@dataclass(frozen=True, slots=True)
class Acting:
    """One effect where it acts: the record, its sensor, its parameters in SI."""

    effect: Effect
    sensor: str
    values: Values


ByStage = Mapping[str, tuple[Acting, ...]]


def by_stage(system: System) -> ByStage:
    """Effects of each stage by its name; stages without any are left out."""
    if not system.effects:
        return {}
    known = registry()
    stages = {stage.name: stage for stage in system.stages}
    found: dict[str, tuple[Acting, ...]] = {}
    for number, entry in enumerate(system.effects):
        _demand_entry(number, entry, known, stages)
        values = dict(entry.parameters)
        acting = Acting(known[entry.effect], entry.sensor, values)  # type: ignore[arg-type]
        found[entry.stage] = (*found.get(entry.stage, ()), acting)
    return found


def tilts(system: System) -> bool:
    """Whether some effect of the system acts by roll and pitch."""
    return any(one.effect.tilted for acting in by_stage(system).values() for one in acting)


def _demand_entry(
    number: int, entry: EffectEntry, known: Mapping[str, Effect], stages: Mapping[str, Stage]
) -> None:
    path = f"effects[{number}]"
    if entry.effect not in known:
        raise SimulationError(
            f"{path}.effect: expected one of {', '.join(known)}, found {entry.effect!r}"
        )
    if entry.stage not in stages:
        raise SimulationError(
            f"{path}.stage: expected one of {', '.join(sorted(stages))}, found {entry.stage!r}"
        )
    effect = known[entry.effect]
    if entry.sensor not in effect.sensors:
        expected = ", ".join(effect.sensors)
        raise SimulationError(
            f"{path}.sensor: {entry.effect} acts on {expected}, found {entry.sensor!r}"
        )
    nowhere = entry.sensor == "position" and stages[entry.stage].position is None
    if nowhere and not effect.transponder:
        raise SimulationError(f"{path}.sensor: stage {entry.stage} has no position sensor")
    missing = {p.name for p in effect.parameters} - {name for name, _ in entry.parameters}
    if missing:
        raise SimulationError(f"{path}.parameters: missing {', '.join(sorted(missing))}")
    values = dict(entry.parameters)
    for parameter in effect.parameters:
        value = values[parameter.name]
        choices = parameter.choices.get(entry.sensor, ())
        if choices and value not in choices:
            raise SimulationError(
                f"{path}.parameters.{parameter.name}: expected one of {', '.join(choices)}, "
                f"found {value}"
            )


def departures(
    acting: tuple[Acting, ...],
    rows: StageRows,
    generator: np.random.Generator | None,
    systematic_only: bool = False,
) -> Departures:
    """All departures of a stage at once; stochastic effects draw from `generator`."""
    total = NOTHING
    for one in acting:
        if systematic_only and one.effect.kind == "stochastic":
            continue
        total = total + one.effect.depart(
            rows,
            one.values,
            one.sensor,  # type: ignore[arg-type]
            generator,
        )
    return total


def basis_of(system: System, index: int) -> Basis:
    """What the charges of a stage's effects depend on besides it."""
    stage = system.stages[index]
    _, arm = arm_lengths(stage, index == 0)
    return Basis(system.horizon, system.coverage_factor, distance_m(stage), arm)


def stage_contributions(system: System, index: int) -> tuple[tuple[Acting, Contribution], ...]:
    """What each effect of a stage adds."""
    stage, basis = system.stages[index], basis_of(system, index)
    return tuple(
        (one, one.effect.contribute(stage, one.values, one.sensor, basis))  # type: ignore[arg-type]
        for one in by_stage(system).get(stage.name, ())
    )


def contributions(
    system: System,
) -> tuple[dict[tuple[str, RoleName], float], tuple[tuple[str, str, float], ...]]:
    """What the effects add to the budget: (tau [s] by stage and role, systematic terms [m])."""
    extra: dict[tuple[str, RoleName], float] = {}
    systematic: list[tuple[str, str, float]] = []
    for index, stage in enumerate(system.stages):
        basis = basis_of(system, index)
        for one, added in stage_contributions(system, index):
            if added.tau_s and one.sensor != "target":
                key: tuple[str, RoleName] = (stage.name, one.sensor)  # type: ignore[assignment]
                extra[key] = extra.get(key, 0.0) + added.tau_s
            if total := added.total_m(basis):
                systematic.append((f"{one.effect.name} ({one.sensor})", stage.name, total))
    return extra, tuple(systematic)


@dataclass(frozen=True, slots=True)
class Known:
    """What effects add: tau [s] by (stage, role), and systematic terms (name, stage, value [m])."""

    extra_tau_s: Mapping[tuple[str, RoleName], float] = field(default_factory=dict)
    systematic: tuple[tuple[str, str, float], ...] = ()


def known_of(system: System) -> Known:
    """Contributions of a system's known effects."""
    return Known(*contributions(system)) if system.effects else Known()
