"""The systematic effects that a spec lists: checked, described, and what they add to the budget."""

from __future__ import annotations

from collections.abc import Iterator
from difflib import get_close_matches
from typing import TYPE_CHECKING

from syncline_design.model.estimates import figure
from syncline_design.model.known import EffectEntry
from syncline_design.spec.case import Case
from syncline_design.spec.load import BadInput
from syncline_design.spec.spec import EffectChoice
from syncline_design.spec.yaml_text import KeyPath, Problem, show_path

if TYPE_CHECKING:
    from syncline_design.effects.record import Parameter, Target


def effect_entries(case: Case) -> tuple[EffectEntry, ...]:
    """The spec's effects for the simulator; BadInput where one does not exist or fit."""
    if not case.spec.effects:
        return ()
    problems = [
        problem
        for index, effect in enumerate(case.spec.effects)
        for problem in _problems(case, ("effects", index), effect)
    ]
    if problems:
        raise BadInput(tuple(problems))
    last = case.spec.stages[-1].name
    only = case.spec.stages[0].name
    return tuple(
        EffectEntry(
            effect.effect,
            effect.sensor,
            effect.stage or (last if effect.sensor == "target" else only),
            tuple((name, _plain(value)) for name, value in effect.parameters.items()),
        )
        for effect in case.spec.effects
    )


def _transponder_problem(case: Case, at: KeyPath, effect: EffectChoice) -> Iterator[Problem]:
    """A later stage has no position sensor whose stamps or noise an effect could change."""
    from syncline_design.effects import registry

    names = [stage.name for stage in case.spec.stages]
    place = names.index(effect.stage) if effect.stage in names else 0
    if place == 0:
        return
    before = names[place - 1]
    message = (
        f"stage {effect.stage} has no position sensor: its position is the chain before it, "
        f"stamped by the ranging sensor of {before}"
    )
    acting = ", ".join(name for name, record in registry().items() if record.transponder)
    known = [f"{acting} (of the transponder)", f"sensor: ranging with stage: {before}"]
    yield _problem(case, (*at, "sensor"), message, f"{effect.effect} of its position", known)


def demand_budget(case: Case) -> None:
    """BadInput where an effect has no place in a budget with its values; in a log it may have."""
    problems = list(_unbudgeted(case))
    if problems:
        raise NoBudget(tuple(problems))


class NoBudget(BadInput):
    """What no budget can hold, at its place in the spec."""


def _unbudgeted(case: Case) -> Iterator[Problem]:
    from syncline_design.effects import registry

    for index, entry in enumerate(effect_entries(case)):
        record = registry()[entry.effect]
        values = dict(entry.parameters)
        if not (why := record.unbudgeted(values)):  # type: ignore[arg-type]
            continue
        path: KeyPath = ("effects", index, "parameters")
        line, column = _place(case, path)
        message, _, hint = why.partition("; ")
        yield Problem(str(case.path), line, column, show_path(path), message, hint=hint)


def _place(case: Case, path: KeyPath) -> tuple[int, int]:
    """Line and column of a key, or of the nearest one above it that the file holds."""
    known = case.positions
    return next(known[path[:n]] for n in range(len(path), -1, -1) if path[:n] in known)


def _plain(value: float | str) -> float | str:
    return value if isinstance(value, str) else float(value)


def _problems(case: Case, at: KeyPath, effect: EffectChoice) -> Iterator[Problem]:
    from syncline_design.effects import registry

    record = registry().get(effect.effect)
    if record is None:
        yield _problem(case, (*at, "effect"), "unknown effect", effect.effect, list(registry()))
        return
    if effect.sensor not in record.sensors:
        message = f"{effect.effect} does not act on this sensor"
        yield _problem(case, (*at, "sensor"), message, effect.sensor, list(record.sensors))
    elif effect.sensor == "position" and not record.transponder:
        yield from _transponder_problem(case, at, effect)
    names = [parameter.name for parameter in record.parameters]
    for name in effect.parameters:
        if name not in names:
            yield _problem(case, (*at, "parameters", name), "unknown parameter", name, names)
    for parameter in record.parameters:
        place = (*at, "parameters")
        if parameter.name not in effect.parameters:
            yield _problem(case, place, f"missing parameter {parameter.name}", "", names)
        elif misfit := _misfit(effect.parameters[parameter.name], parameter, effect.sensor):
            wanted = list(parameter.choices.get(effect.sensor, ())) or [parameter.domain]
            found = str(effect.parameters[parameter.name])
            yield _problem(case, (*place, parameter.name), misfit, found, wanted)


def _misfit(value: float | str, parameter: Parameter, sensor: Target) -> str | None:
    """What is wrong with a parameter's value for this sensor."""
    if isinstance(value, str) != bool(parameter.choices):
        return "wrong kind of value"
    if isinstance(value, str):
        choices = parameter.choices.get(sensor)  # none: the sensor itself was refused
        return None if choices is None or value in choices else "not one of the choices"
    return None if parameter.holds(float(value)) else "out of range"


def _problem(case: Case, path: KeyPath, message: str, found: str, known: list[str]) -> Problem:
    line, column = _place(case, path)
    close = get_close_matches(found, known, 1)
    hint = f"did you mean {close[0]}?" if close else ""
    expected = f"one of {', '.join(known)}" if len(known) > 1 else known[0]
    return Problem(str(case.path), line, column, show_path(path), message, expected, found, hint)


def describe(entry: EffectEntry) -> str:
    """An effect in one sentence, its parameters printed as `diagnose` prints them."""
    from syncline_design.effects import registry

    effect = registry()[entry.effect]
    units = {parameter.name: parameter.unit for parameter in effect.parameters}
    shown = {
        name: value if isinstance(value, str) else figure(value, None, units.get(name, ""))
        for name, value in entry.parameters
    }
    return effect.sentence.format(sensor=entry.sensor, **shown)
