"""The spec's known systematic effects, as the simulator and the budget take them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from syncline_design.effects.base import (
    NOTHING,
    Array,
    Basis,
    Contribution,
    Departures,
    Effect,
    StageRows,
    Values,
)
from syncline_design.model.pairing import distance_m
from syncline_design.model.system import EffectEntry, RoleName, System
from syncline_design.simulate import kernel
from syncline_design.simulate.chain import Motion, Noise, stage_error
from syncline_design.simulate.draws import arm_lengths
from syncline_design.simulate.settings import SimulationError
from syncline_design.simulate.surroundings import Moment, placed_rows


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
    from syncline_design.effects import registry

    known = registry()
    names = {stage.name for stage in system.stages}
    found: dict[str, tuple[Acting, ...]] = {}
    for number, entry in enumerate(system.effects):
        _demand_entry(number, entry, known, names)
        values = dict(entry.parameters)
        acting = Acting(known[entry.effect], entry.sensor, values)  # type: ignore[arg-type]
        found[entry.stage] = (*found.get(entry.stage, ()), acting)
    return found


def tilts(system: System) -> bool:
    """Whether some effect of the system acts by roll and pitch."""
    return any(one.effect.tilted for acting in by_stage(system).values() for one in acting)


def _demand_entry(
    number: int, entry: EffectEntry, known: Mapping[str, Effect], stages: set[str]
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
    missing = {p.name for p in effect.parameters} - {name for name, _ in entry.parameters}
    if missing:
        raise SimulationError(f"{path}.parameters: missing {', '.join(sorted(missing))}")
    values = dict(entry.parameters)
    for parameter in effect.parameters:
        value, choices = values[parameter.name], parameter.choices
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
        try:
            departed = one.effect.depart(
                rows,
                one.values,
                one.sensor,  # type: ignore[arg-type]
                generator,
            )
        except KeyError as unknown:
            raise SimulationError(
                f"effects: {one.effect.name} ({one.sensor}) does not know {unknown}"
            ) from None
        total = total + departed
    return total


@dataclass(frozen=True, slots=True)
class Carried:
    """What a stage hands on to the next one.

    error_m (3, n): error of the object it georeferences, NED; ranging_shift_s (n,): what effects
    add to mu of its ranging sensor, whose stamp the next stage's position carries.
    """

    error_m: Array
    ranging_shift_s: Array


def level_error(draw: kernel.Draw, before: Carried | None) -> Carried:
    """Error of one stage where no stage has an effect: the fast kernel, level."""
    error = kernel.stage_error(draw, None if before is None else before.error_m)
    return Carried(error, _NO_SHIFT)


def placed_error(
    draw: kernel.Draw,
    around: tuple[Moment, Array],
    acting: tuple[Acting, ...],
    generator: np.random.Generator | None,
    before: Carried | None,
) -> Carried:
    """Error of one stage at its moment and lean (roll, pitch), with effects: the row-wise chain."""
    return moved_error(placed_rows(draw, *around), acting, generator, before)


def moved_error(
    rows: tuple[StageRows, Motion, Noise],
    acting: tuple[Acting, ...],
    generator: np.random.Generator | None,
    before: Carried | None,
) -> Carried:
    """Error of one stage, row by row; without a generator stochastic effects do not act."""
    state, motion, noise = rows
    carried = None
    if before is not None:
        carried = before.error_m.T
        noise = replace(noise, mu_position_s=noise.mu_position_s + before.ranging_shift_s)
    world = departures(acting, state, generator, systematic_only=generator is None)
    error = np.ascontiguousarray(stage_error(state, motion, noise, world, carried).T)
    return Carried(error, world.ranging_shift_s)


_NO_SHIFT = np.zeros(1)


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
