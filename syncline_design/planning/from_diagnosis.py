"""What a diagnosis leaves open: classes to tell apart, else effects to know better."""

from __future__ import annotations

from syncline_design.diagnosis.result import Diagnosis, Finding, Rival
from syncline_design.effects import registry
from syncline_design.model.system import System
from syncline_design.planning.wanted import EffectPair, NamedEffect, PlanError, PlanWanted

SHARE = 0.2  # of the value that would turn a requirement: how well a blind spot is to be known


def asked_of(system: System, found: Diagnosis) -> PlanWanted:
    """The classes of a diagnosis; of one without, its causes; else what its log was blind to."""
    _demand_same(system, found)
    pairs = tuple(
        EffectPair(_named(system, one), _named(system, rival), sizes_of(one))
        for one in found.findings
        if moves(one.effect)
        for rival in one.aliases
        if moves(rival.effect)
    )
    if pairs:
        return PlanWanted((), pairs)
    causes = [one for one in found.findings if one.material and moves(one.effect)]
    if causes:
        return PlanWanted(tuple((_named(system, one), None) for one in causes))
    blind: dict[NamedEffect, float | None] = {}
    for spot in found.informative.blind_to:
        if moves(spot.effect):
            name = _spelt(system, spot.effect, spot.sensor, spot.stage)
            known = blind.get(name)
            limit = SHARE * abs(spot.turns_at)
            blind[name] = limit if known is None else min(known, limit)
    return PlanWanted(tuple(blind.items()))


def _demand_same(system: System, found: Diagnosis) -> None:
    stages = {stage.name for stage in system.stages}
    for one in found.findings:
        if one.stage not in stages or one.effect not in registry():
            raise PlanError(
                f"--diagnosis: it is of another system: {one.effect} of stage {one.stage!r}; "
                f"expected a diagnosis of this spec, whose stages are {', '.join(sorted(stages))}"
            )


def moves(effect: str) -> bool:
    """Whether an effect moves the mean error, so that a drive can show it."""
    known = registry().get(effect)
    return known is not None and known.sensitivity is not None


def _named(system: System, one: Finding | Rival) -> NamedEffect:
    return _spelt(system, one.effect, one.sensor, one.stage)


def _spelt(system: System, effect: str, sensor: str, stage: str) -> NamedEffect:
    return NamedEffect(effect, sensor, stage if len(system.stages) > 1 else None)


def sizes_of(one: Finding) -> dict[str, float]:
    """What was found of an effect, by its parameters."""
    return {
        name: float(e.value)
        for name, e in one.parameters.items()
        if not isinstance(e.value, str) and e.seen
    }
