"""Checks of a spec against the catalogs: ids, modalities, primitives, currencies, figures due."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import islice
from typing import Any

from syncline_design.model.quantity import Quantity
from syncline_design.spec.catalog import Catalog, SensorEntry
from syncline_design.spec.fields import MAX_SUGGESTIONS, did_you_mean
from syncline_design.spec.files import Collection, problem_at
from syncline_design.spec.resolve import (
    candidate_sensors,
    clocks_of,
    infrastructure_of,
    timestamping_of,
    usable_primitives,
)
from syncline_design.spec.spec import (
    ROLE_NAMES,
    InlineTimestamping,
    MethodChoice,
    Query,
    Role,
    RoleChoice,
    Spec,
    StageChoice,
)
from syncline_design.spec.yaml_text import Document, KeyPath, Problem

_WORDS = {
    "platforms": "platform",
    "sensors": "sensor",
    "timestamping": "timestamping method",
    "infrastructure": "shared hardware",
    "clocks": "clock",
}


def unknown_ids(spec: Document, collection: Collection) -> list[Problem]:
    """Ids that no catalog has; looked for in the raw data, so that other errors don't hide them."""
    unknown = (
        (path, section, identity)
        for section, path, identity in _spec_ids(spec.data)
        if (section, identity) not in collection.origins
    )
    problems = [_unknown(spec, *item, collection) for item in islice(unknown, MAX_SUGGESTIONS)]
    for document, path in collection.documents.values():
        requires = _at(document.data, (*path, "requires"))
        for identity in requires if isinstance(requires, dict) else ():
            if ("infrastructure", identity) not in collection.origins:
                at = (*path, "requires", identity)
                problems.append(_unknown(document, at, "infrastructure", identity, collection))
    return problems


def _unknown(
    document: Document, path: KeyPath, section: str, identity: str, collection: Collection
) -> Problem:
    known = [name for part, name in collection.origins if part == section]
    elsewhere = [part for part, name in collection.origins if name == identity]
    hint = did_you_mean(identity, known)
    if elsewhere and not hint:
        hint = f"{identity} is a {_WORDS[elsewhere[0]]}"
    if not hint:
        hint = f"known: {', '.join(known[:12])}" + (", ..." if len(known) > 12 else "")
    message = f"unknown {_WORDS[section]}"
    return problem_at(document, path, message, found=identity, hint=hint)


def _at(data: Any, path: KeyPath) -> Any:
    for part in path:
        if not isinstance(data, dict):
            return None
        data = data.get(str(part))
    return data


def _spec_ids(data: Any) -> Iterator[tuple[str, KeyPath, str]]:
    """(section, key path, id) of everything a spec names in the catalogs."""
    yield from _choice_ids("timestamping", _at(data, ("timestamping",)), ("timestamping",))
    stages = _at(data, ("stages",))
    for index, stage in enumerate(stages if isinstance(stages, tuple) else ()):
        at: KeyPath = ("stages", index)
        platform = _at(stage, ("platform",))
        use = _at(platform, ("use",))
        if isinstance(platform, str) and platform:
            yield "platforms", (*at, "platform"), platform
        elif isinstance(use, str) and use:
            yield "platforms", (*at, "platform", "use"), use
        for section, key in (("timestamping", "timestamping"), ("clocks", "clock")):
            yield from _choice_ids(section, _at(stage, (key,)), (*at, key))
        for name in ROLE_NAMES:
            role, place = _at(stage, (name,)), (*at, name)
            sensor = _at(role, ("sensor",))
            if isinstance(sensor, str) and sensor:
                yield "sensors", (*place, "sensor"), sensor
            yield from _choice_ids("sensors", role, place)
            method = _at(role, ("timestamping",))
            yield from _choice_ids("timestamping", method, (*place, "timestamping"))


def _choice_ids(section: str, choice: Any, path: KeyPath) -> Iterator[tuple[str, KeyPath, str]]:
    if isinstance(choice, str) and choice:
        yield section, path, choice
    candidates = _at(choice, ("candidates",))
    for index, identity in enumerate(candidates if isinstance(candidates, tuple) else ()):
        if isinstance(identity, str) and identity:
            yield section, (*path, "candidates", index), identity


def misfits(document: Document, spec: Spec, catalog: Catalog) -> list[Problem]:
    """Where valid ids do not fit together."""
    problems: list[Problem] = []
    for index, stage in enumerate(spec.stages):
        for name in ROLE_NAMES:
            role = stage.role(name)
            if role is not None and not role.is_empty:
                at: KeyPath = ("stages", index, name)
                problems += _role_misfits(document, at, spec, stage, name, role, catalog)
    problems += _vehicle_misfits(document, spec)
    problems += _effect_misfits(document, spec)
    return problems


def _role_misfits(
    document: Document, at: KeyPath, spec: Spec, stage: StageChoice, name: Role,
    role: RoleChoice, catalog: Catalog,
) -> Iterator[Problem]:  # fmt: skip
    sensors = candidate_sensors(spec, stage, name, catalog)
    if not sensors:
        message = "no sensor of the catalogs matches this query"
        yield problem_at(document, (*at, "candidates"), message, f"at least one {name} sensor")
        return
    for position, (identity, sensor) in enumerate(sensors):
        if sensor.modality != name:
            path = (*at, "sensor") if role.sensor is not None else (*at, "candidates", position)
            message = f"{identity} is a sensor of modality {sensor.modality}"
            yield problem_at(document, path, message, name, sensor.modality)
    if role.primitive is not None and not any(role.primitive in s.serves for _, s in sensors):
        offered = sorted({p for _, s in sensors for p in s.serves})
        message = f"no such primitive on {_named(sensors)}"
        wanted = " or ".join(offered)
        yield problem_at(document, (*at, "primitive"), message, wanted, role.primitive)
        return
    yield from _method_misfits(document, at, spec, stage, role, sensors, catalog)


def _method_misfits(
    document: Document, at: KeyPath, spec: Spec, stage: StageChoice, role: RoleChoice,
    sensors: tuple[tuple[str, SensorEntry], ...], catalog: Catalog,
) -> Iterator[Problem]:  # fmt: skip
    methods = timestamping_of(spec, stage, role, catalog)
    if isinstance(methods, InlineTimestamping):
        return
    if not methods:
        wanted = (
            "a method id, {candidates: [...]}, or {error: {...}} here, in the stage or the spec"
        )
        yield problem_at(document, at, "no timestamping is given for this role", wanted)
    if not isinstance(role.timestamping, str):
        return  # open: what does not fit is left out of the choice, with the reason kept
    identity, method = methods[0]
    if not any(usable_primitives(s, method, role.primitive) for _, s in sensors):
        offered = sorted({p for _, s in sensors for p in s.serves})
        has = role.primitive or ", ".join(offered)
        message = f"{identity} cannot stamp {_named(sensors)}"
        wanted = f"a method for {has}"
        found = f"{identity}, which serves {', '.join(method.primitives)}"
        yield problem_at(document, (*at, "timestamping"), message, wanted, found)


def _named(sensors: tuple[tuple[str, SensorEntry], ...]) -> str:
    return sensors[0][0] if len(sensors) == 1 else "any of the candidates"


def _vehicle_misfits(document: Document, spec: Spec) -> Iterator[Problem]:
    """Stages on one vehicle share its host clock: at most one of them says which."""
    first: dict[str, int] = {}
    for index, stage in enumerate(spec.stages):
        if stage.clock is None:
            continue
        other = first.setdefault(stage.vehicle_name, index)
        if other != index and spec.stages[other].clock != stage.clock:
            message = f"vehicle {stage.vehicle_name} has another clock in stages[{other}]"
            path: KeyPath = ("stages", index, "clock")
            yield problem_at(document, path, message, "one clock per vehicle")


def _effect_misfits(document: Document, spec: Spec) -> Iterator[Problem]:
    names = [stage.name for stage in spec.stages]
    for index, effect in enumerate(spec.effects):
        at: KeyPath = ("effects", index)
        if effect.stage is None and len(names) > 1 and effect.sensor != "target":
            yield problem_at(document, at, "missing key stage", f"one of {', '.join(names)}")
        if effect.stage is not None and effect.stage not in names:
            hint = did_you_mean(effect.stage, names)
            wanted = f"one of {', '.join(names)}"
            yield problem_at(document, (*at, "stage"), "unknown stage", wanted, effect.stage, hint)
        elif effect.sensor in ROLE_NAMES:
            place = names.index(effect.stage) if effect.stage else 0
            stage = spec.stages[place]
            if place > 0 and effect.sensor == "position":
                continue  # a transponder: which effects act on it is the dictionary's to say
            if stage.role(effect.sensor) is None:
                message = f"stage {stage.name} has no {effect.sensor} sensor"
                yield problem_at(document, (*at, "sensor"), message)


Part = tuple[KeyPath, str, Any]  # where the spec names it, what it is, the entry


def parts_in_use(spec: Spec, catalog: Catalog) -> Iterator[Part]:
    """Every entry that a design of this spec may buy, once, with where the spec names it."""
    seen: set[str] = set()
    for path, label, entry in _parts(spec, catalog):
        if label not in seen:
            seen.add(label)
            yield path, label, entry


def _parts(spec: Spec, catalog: Catalog) -> Iterator[Part]:
    for index, stage in enumerate(spec.stages):
        for name in ROLE_NAMES:
            role = stage.role(name)
            if role is not None and not role.is_empty:
                yield from _role_parts(spec, stage, name, role, ("stages", index, name), catalog)
        for identity, clock in clocks_of(stage, catalog):
            at: KeyPath = ("stages", index, "clock")
            yield at, f"clock {identity}", clock
            yield from _hardware(at, clock.requires, catalog)


def _role_parts(
    spec: Spec, stage: StageChoice, name: Role, role: RoleChoice, at: KeyPath, catalog: Catalog
) -> Iterator[Part]:
    sensors = candidate_sensors(spec, stage, name, catalog)
    for identity, sensor in sensors:
        yield at, f"sensor {identity}", sensor
    methods = timestamping_of(spec, stage, role, catalog)
    for identity, method in () if isinstance(methods, InlineTimestamping) else methods:
        if any(usable_primitives(s, method, role.primitive) for _, s in sensors):
            yield at, f"timestamping method {identity}", method
            yield from _hardware(at, method.requires, catalog)


def _hardware(at: KeyPath, requires: dict[str, int], catalog: Catalog) -> Iterator[Part]:
    for identity, entry in infrastructure_of(requires, catalog):
        yield at, f"shared hardware {identity}", entry


def currency_problems(document: Document, spec: Spec, catalog: Catalog) -> list[Problem]:
    """Amounts in a currency that the spec gives no rate for."""
    problems = []
    for path, what, amount in _amounts(spec, catalog):
        if not spec.can_convert(amount):
            code = amount.currency
            hint = f"add exchange_rates: {{{code}: RATE {spec.currency}}}"
            problems.append(
                problem_at(document, path, f"{what} in {code}", spec.currency, amount.text, hint)
            )
    return problems


def _amounts(spec: Spec, catalog: Catalog) -> Iterable[tuple[KeyPath, str, Quantity]]:
    for index, requirement in enumerate(spec.requirements):
        if requirement.kind == "cost" and isinstance(requirement.limit, Quantity):
            yield ("requirements", index, "limit"), "a limit", requirement.limit
    for index, stage in enumerate(spec.stages):
        for name in ROLE_NAMES:
            role = stage.role(name)
            query = role.candidates if role is not None else None
            if isinstance(query, Query) and query.max_cost is not None:
                at: KeyPath = ("stages", index, name, "candidates", "max_cost")
                yield at, "a limit", query.max_cost
    for path, label, entry in parts_in_use(spec, catalog):
        if entry.cost is not None:
            yield path, f"the cost of {label} is", entry.cost


def names_candidates(spec: Spec) -> bool:
    """Whether a spec lists what to choose from, however much of it can be used.

    A list with one method or clock means the same as its bare id; sensors say which they mean.
    """
    return any(
        (stage.clock is not None and len(stage.clock.candidates) > 1)
        or any(
            (role := stage.role(name)) is not None
            and (role.candidates is not None or _lists_methods(spec, stage, role))
            for name in ROLE_NAMES
        )
        for stage in spec.stages
    )


def _lists_methods(spec: Spec, stage: StageChoice, role: RoleChoice) -> bool:
    """Whether the timestamping in force for a role names several methods."""
    choice = role.timestamping or stage.timestamping or spec.timestamping
    return not role.is_empty and isinstance(choice, MethodChoice) and len(choice.candidates) > 1


def is_open(spec: Spec, catalog: Catalog) -> bool:
    """Whether anything is left to choose."""
    for stage in spec.stages:
        if len(clocks_of(stage, catalog)) > 1:
            return True
        for name in ROLE_NAMES:
            role = stage.role(name)
            if (
                role is not None
                and not role.is_empty
                and _has_options(spec, stage, name, role, catalog)
            ):
                return True
    return False


def _has_options(
    spec: Spec, stage: StageChoice, name: Role, role: RoleChoice, catalog: Catalog
) -> bool:
    sensors = candidate_sensors(spec, stage, name, catalog)
    if len(sensors) > 1:
        return True
    methods = timestamping_of(spec, stage, role, catalog)
    if isinstance(methods, InlineTimestamping):
        return False
    pairs = (usable_primitives(s, m, role.primitive) for _, s in sensors for _, m in methods)
    return sum(len(primitives) for primitives in pairs) > 1


def missing_figures(document: Document, spec: Spec, catalog: Catalog) -> list[Problem]:
    """Costs, masses and powers that a requirement or the objective needs and a catalog lacks."""
    needed: dict[str, str] = {
        r.kind: f"requirement {r.id}"
        for r in spec.requirements
        if r.kind in ("cost", "mass", "power")
    }
    if spec.objective != "error" and is_open(spec, catalog):
        needed.setdefault(spec.objective, f"objective: {spec.objective}")
    return [
        problem_at(
            document, path, f"{label} has no {figure}", f"a {figure}, needed by {reason}",
            hint="give the entry one, or drop it from the candidates",
        )
        for path, label, entry in parts_in_use(spec, catalog)
        for figure, reason in sorted(needed.items())
        if getattr(entry, figure) is None
    ]  # fmt: skip
