"""The known effects of a system: each where it acts, and what it adds to the budget."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NoReturn

import numpy as np

from syncline_design.effects import registry
from syncline_design.effects.record import (
    NOTHING,
    ActsOn,
    Basis,
    Contribution,
    Departures,
    Effect,
    StageRows,
    Values,
)
from syncline_design.effects.underway import OF_CAUSE
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.known import Known
from syncline_design.model.lever_arms import arm_lengths
from syncline_design.model.pairing import distance_m
from syncline_design.model.roles import RoleName
from syncline_design.model.system import SimulationError, System
from syncline_design.model.underway import Underway, underway


@dataclass(frozen=True, slots=True)
class Acting:
    """One effect where it acts: the record, its sensor, the place of its stage, values in SI."""

    effect: Effect
    sensor: ActsOn
    stage: int
    values: Values

    @property
    def label(self) -> tuple[str, str, int]:
        """What tells it from others: two of one label are one."""
        return self.effect.name, self.sensor, self.stage


ByStage = Mapping[str, tuple[Acting, ...]]


def acting_of(system: System) -> tuple[Acting, ...]:
    """The known effects of a system's stages, in their order; then what no spec lists."""
    return (*listed(system), *implied(system))


def acts(system: System) -> bool:
    """Whether anything departs from the spec beside noise and timestamps."""
    return bool(system.effects) or bool(underway(system))


def implied(system: System) -> tuple[Acting, ...]:
    """What is interpolated, and sound under way, as effects."""
    return tuple(
        Acting(OF_CAUSE[one.cause], one.role, one.stage, _values_of(one))
        for one in underway(system)
    )


def _values_of(one: Underway) -> Values:
    if one.cause in ("travel", "object"):
        assert one.sensor.sound_mps is not None
        return {"share": 2.0 / one.sensor.sound_mps}
    return {"size": one.size}


def listed(system: System) -> tuple[Acting, ...]:
    """The known effects that a spec lists, where they act."""
    if not system.effects:
        return ()
    known = registry()
    places = {stage.name: k for k, stage in enumerate(system.stages)}
    return tuple(
        Acting(
            known[entry.effect],
            entry.sensor,  # type: ignore[arg-type]  # by the rules of `demand_acting`
            places[entry.stage],
            dict(entry.parameters),  # type: ignore[arg-type]  # a convention's value is its name
        )
        for entry in system.effects
        if entry.stage in places
    )


def by_stage(system: System) -> ByStage:
    """Effects of each stage by its name; stages without any are left out."""
    found: dict[str, tuple[Acting, ...]] = {}
    for one in acting_of(system):
        name = system.stages[one.stage].name
        found[name] = (*found.get(name, ()), one)
    return found


def tilts(system: System) -> bool:
    """Whether some effect of the system acts by roll and pitch."""
    return any(one.effect.tilted for one in acting_of(system))


def demand_acting(system: System) -> None:
    """Raise SimulationError unless every known effect of a system exists and fits where it acts.

    Those of a spec were checked as it was read, by the same rules.
    """
    known = registry() if system.effects else {}
    stages = {stage.name: stage for stage in system.stages}
    for number, entry in enumerate(system.effects):
        path = f"effects[{number}]"
        if entry.effect not in known:
            _refuse(f"{path}.effect", f"one of {', '.join(known)}", repr(entry.effect))
        if entry.stage not in stages:
            _refuse(f"{path}.stage", f"one of {', '.join(sorted(stages))}", repr(entry.stage))
        effect = known[entry.effect]
        for one in effect.misfits(entry.sensor, dict(entry.parameters)):
            at = ".".join((path, *one.keys))
            if not one.found:
                raise SimulationError(f"{at}: {one.message}")
            _refuse(at, one.expected, one.found)
        nowhere = entry.sensor == "position" and stages[entry.stage].position is None
        if nowhere and not effect.transponder:
            raise SimulationError(f"{path}.sensor: stage {entry.stage} has no position sensor")


def _refuse(path: str, expected: str, found: str) -> NoReturn:
    raise SimulationError(f"{path}: expected {expected}, found {found}")


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
            one.sensor,
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
        (one, one.effect.contribute(stage, one.values, one.sensor, basis))
        for one in by_stage(system).get(stage.name, ())
    )


def known_of(system: System) -> Known:
    """What a system's known effects add to its budget."""
    extra: dict[tuple[str, RoleName], float] = {}
    systematic: list[tuple[str, str, float]] = []
    for index, stage in enumerate(system.stages):
        basis = basis_of(system, index)
        for one, added in stage_contributions(system, index):
            if one.effect.implied:
                continue
            if added.tau_s and one.sensor != "target":
                key: tuple[str, RoleName] = (stage.name, one.sensor)
                extra[key] = extra.get(key, 0.0) + added.tau_s
            if total := added.total_m(basis):
                systematic.append((f"{one.effect.name} ({one.sensor})", stage.name, total))
    return Known(extra, tuple(systematic))
