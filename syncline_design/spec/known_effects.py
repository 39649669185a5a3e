"""The systematic effects that a spec lists: checked against the dictionary, and described."""

from __future__ import annotations

from collections.abc import Iterator

from syncline_design.machine.sentences import one_of
from syncline_design.model.figure_text import format_components
from syncline_design.model.known import EffectEntry
from syncline_design.spec.fields import did_you_mean
from syncline_design.spec.files import problem_at
from syncline_design.spec.spec import EffectChoice, Spec
from syncline_design.spec.yaml_text import Flaw, KeyPath, ParsedFile


def effect_problems(document: ParsedFile, spec: Spec) -> Iterator[Flaw]:
    """Effects that do not exist, or do not fit where they are said to act."""
    if not spec.effects:
        return
    from syncline_design.effects import registry  # with numpy: only where a spec lists effects

    for index, effect in enumerate(spec.effects):
        at: KeyPath = ("effects", index)
        record = registry().get(effect.effect)
        if record is None:
            known = tuple(registry())
            yield _problem(document, (*at, "effect"), "unknown effect", effect.effect, known)
            continue
        for one in record.misfits(effect.sensor, effect.parameters):
            yield _problem(document, (*at, *one.keys), one.message, one.found, one.known)
        stands = effect.sensor in record.sensors and not record.transponder
        if effect.sensor == "position" and stands:
            acting = (name for name, other in registry().items() if other.transponder)
            yield from _transponder_problem(document, at, spec, effect, ", ".join(acting))


def _transponder_problem(
    document: ParsedFile, at: KeyPath, spec: Spec, effect: EffectChoice, acting: str
) -> Iterator[Flaw]:
    """A later stage has no position sensor whose stamps or noise an effect could change."""
    names = [stage.name for stage in spec.stages]
    place = names.index(effect.stage) if effect.stage in names else 0
    if place == 0:
        return
    before = names[place - 1]
    message = (
        f"stage {effect.stage} has no position sensor: its position is the chain before it, "
        f"stamped by the ranging sensor of {before}"
    )
    known = (f"{acting} (of the transponder)", f"sensor: ranging with stage: {before}")
    yield _problem(document, (*at, "sensor"), message, f"{effect.effect} of its position", known)


def _problem(
    document: ParsedFile, path: KeyPath, message: str, found: str, known: tuple[str, ...]
) -> Flaw:
    return problem_at(document, path, message, one_of(known), found, did_you_mean(found, known))


def describe(entry: EffectEntry) -> str:
    """An effect in one sentence, its parameters printed as `diagnose` prints them."""
    from syncline_design.effects import registry

    effect = registry()[entry.effect]
    units = {parameter.name: parameter.unit for parameter in effect.parameters}
    words = {name: value for name, value in entry.parameters if isinstance(value, str)}
    figures = {
        name: (value, None, units.get(name, ""))
        for name, value in entry.parameters
        if not isinstance(value, str)
    }
    return effect.in_words(entry.sensor, words | format_components(figures))
