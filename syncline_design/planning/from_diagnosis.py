"""What a diagnosis leaves open: classes to tell apart, else effects to know better."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

from syncline_design.diagnosis.result import Diagnosis, Finding, Rival
from syncline_design.diagnosis.same_system import Difference, description, differences
from syncline_design.effects import registry
from syncline_design.machine.records import json_of
from syncline_design.model.roles import ROLES
from syncline_design.model.system import System
from syncline_design.planning.wanted import EffectPair, NamedEffect, PlanError, PlanWanted
from syncline_design.spec.case import Case

THERE: Final = "the diagnosis"
MOST_DIFFERENCES: Final = 5
SHARE = 0.2  # of the value that would turn a requirement: how well a blind spot is to be known


def asked_of(system: System, found: Diagnosis) -> PlanWanted:
    """The classes of a diagnosis; of one without, its causes; else what its log was blind to."""
    _demand_same(system, found)
    pairs = tuple(
        EffectPair(_named(system, one), _named(system, rival), sizes_of(one))
        for one in found.findings
        if moves(one.effect)
        for rival in one.open_aliases
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


def cautions_of(case: Case, system: System, found: Diagnosis) -> tuple[str, ...]:
    """Where a diagnosis that is taken is not wholly of this system, in words."""
    if found.system is None:
        if found.provenance.spec_sha256 == case.spec_sha256:
            return ()
        return (
            f"The diagnosis{_spec_of(found)} was not made with this very spec, and does not hold "
            "what system it is of: that it is of this one is taken on trust.",
        )
    unlike = [one.words(THERE) for one in _unlike(system, found) if not one.measures]
    if not unlike:
        return ()
    return (
        "The spec is not the one of the diagnosis, though its sensors are: "
        f"{'; '.join(_shortened(unlike))}. The drive is for the spec as it is now.",
    )


def foreign_words(left_out: Sequence[NamedEffect]) -> Iterator[str]:
    """That a diagnosis names what this system cannot have, and what becomes of it."""
    if left_out:
        names = ", ".join(one.text for one in left_out)
        yield f"The diagnosis names what does not apply to this system, left out here: {names}."


def _demand_same(system: System, found: Diagnosis) -> None:
    """Refuse a diagnosis of a system that measures otherwise: its classes and its noise, which
    counts in the spec's sigmas, say nothing of this one."""
    unlike = [one.words(THERE) for one in _unlike(system, found) if one.measures]
    if unlike:
        raise _foreign(found, "; ".join(_shortened(unlike)), "a diagnosis of this very system")
    sensors = {f"{s.name}/{role}" for s in system.stages for role in ROLES if getattr(s, role)}
    named = [*found.noise.white_factor, *found.noise.slow]
    missing = [one for one in dict.fromkeys(named) if one not in sensors]
    if missing:
        raise _foreign(found, f"noise of {', '.join(missing)}",
                       f"sensors of this spec, which are {', '.join(sorted(sensors))}")  # fmt: skip
    stages = {stage.name for stage in system.stages}
    for one in found.findings:
        if one.stage not in stages or one.effect not in registry():
            raise _foreign(found, f"{one.effect} of stage {one.stage!r}",
                           f"stages {', '.join(sorted(stages))}")  # fmt: skip


def _unlike(system: System, found: Diagnosis) -> Iterator[Difference]:
    """Where the system of a diagnosis is another than this; nothing where it does not say."""
    if found.system is not None:
        yield from differences(json_of(found.system), json_of(description(system)))


def _shortened(texts: Sequence[str]) -> list[str]:
    more = len(texts) - MOST_DIFFERENCES
    return [*texts[:MOST_DIFFERENCES], *([f"and {more} more"] if more > 0 else [])]


def _foreign(found: Diagnosis, what: str, expected: str) -> PlanError:
    return PlanError(
        f"--diagnosis: it is of another system{_spec_of(found)}: {what}; expected "
        f"{expected}. Diagnose the log with this spec, then plan with that"
    )


def _spec_of(found: Diagnosis) -> str:
    return "" if found.spec is None else f" ({found.spec.name}, {found.spec.file})"


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
