"""Checks of a spec against the catalogs: ids, modalities, primitives, currencies, figures due."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import islice
from typing import Any

from syncline_design.model.quantity import Quantity
from syncline_design.model.roles import ROLES
from syncline_design.spec.case import Case, RoleCase, figures_due, usable_primitives
from syncline_design.spec.choices import Query
from syncline_design.spec.fields import MAX_SUGGESTIONS, did_you_mean
from syncline_design.spec.files import Collection, problem_at
from syncline_design.spec.spec import Spec
from syncline_design.spec.yaml_text import Flaw, KeyPath, ParsedFile

_WORDS = {
    "platforms": "platform",
    "sensors": "sensor",
    "timestamping": "timestamping method",
    "infrastructure": "shared hardware",
    "clocks": "clock",
}
_OWNABLE = ("sensors", "infrastructure", "clocks")


def unknown_ids(spec: ParsedFile, collection: Collection) -> list[Flaw]:
    """Ids that no catalog has; looked for in the raw data, so that other errors don't hide them."""
    named = [(path, section, identity) for section, path, identity in _spec_ids(spec.data)]
    if any((section, identity) not in collection.origins for _, section, identity in named):
        collection.note_families()  # what nothing has asked for yet is known all the same
    unknown = (item for item in named if item[1:] not in collection.origins)
    problems = [_unknown(spec, *item, collection) for item in islice(unknown, MAX_SUGGESTIONS)]
    return problems + _unknown_owned(spec, collection) + unknown_requirements(collection)


def _unknown_owned(spec: ParsedFile, collection: Collection) -> list[Flaw]:
    """What is owned has to be there: a sensor, a piece of shared hardware, a clock."""
    named = _at(spec.data, ("owned",))
    listed = enumerate(named if isinstance(named, tuple) else ())
    owned = [(index, one) for index, one in listed if isinstance(one, str) and one]
    if owned:
        collection.note_families()
    known = {name for section, name in collection.origins if section in _OWNABLE}
    known |= set(_given_in_place(spec.data))
    methods = {name for section, name in collection.origins if section == "timestamping"}
    wanted = "the id of a sensor, shared hardware or clock"
    problems = []
    unknown = ((index, one) for index, one in owned if one not in known)
    for index, one in islice(unknown, MAX_SUGGESTIONS):
        hint = did_you_mean(one, known)
        if one in methods:
            hint = f"{one} is a timestamping method, which each sensor that uses it pays for"
        at: KeyPath = ("owned", index)
        problems.append(problem_at(spec, at, "nothing to own", wanted, one, hint))
    return problems


def _given_in_place(data: Any) -> Iterator[str]:
    """Ids of sensors that the spec itself describes: their name, else stage and role."""
    stages = _at(data, ("stages",))
    for stage in stages if isinstance(stages, tuple) else ():
        for role in ROLES:
            sensor = _at(stage, (role, "sensor"))
            if isinstance(sensor, dict):
                yield str(sensor.get("name") or f"{_at(stage, ('name',))}.{role}")


def unknown_requirements(collection: Collection) -> list[Flaw]:
    """Shared hardware that an entry requires and no catalog has."""
    problems: list[Flaw] = []
    for document, path in collection.documents.values():
        requires = _at(document.data, (*path, "requires"))
        for identity in requires if isinstance(requires, dict) else ():
            if ("infrastructure", identity) not in collection.origins:
                at = (*path, "requires", identity)
                problems.append(_unknown(document, at, "infrastructure", identity, collection))
    return problems


def draw_in(spec: ParsedFile, collection: Collection) -> None:
    """Read the shipped families that a spec can need: by an id, or by a query that they answer."""
    collection.draw((section, identity) for section, _, identity in _spec_ids(spec.data))
    for role, query in _queries(spec.data):
        kind = query.get("type")
        collection.note_families()
        collection.draw(
            [
                key
                for key, one in collection.unread.items()
                if one.modality == role and kind in (None, one.type)
            ]
        )


def _queries(data: Any) -> Iterator[tuple[str, dict[str, Any]]]:
    stages = _at(data, ("stages",))
    for stage in stages if isinstance(stages, tuple) else ():
        for role in ROLES:
            query = _at(stage, (role, "candidates"))
            if isinstance(query, dict):
                yield role, query


def _unknown(
    document: ParsedFile, path: KeyPath, section: str, identity: str, collection: Collection
) -> Flaw:
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
        for name in ROLES:
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


def misfits(document: ParsedFile, case: Case) -> list[Flaw]:
    """Where valid ids do not fit together."""
    problems: list[Flaw] = []
    for stage in case.stages:
        for role in stage.roles:
            problems += _role_misfits(document, ("stages", stage.index, role.role), role)
    problems += _vehicle_misfits(document, case.spec)
    problems += _effect_misfits(document, case.spec)
    return problems


def _role_misfits(document: ParsedFile, at: KeyPath, role: RoleCase) -> Iterator[Flaw]:
    name, pinned = role.role, role.choice.primitive
    if not role.sensors:
        message = "no sensor of the catalogs matches this query"
        yield problem_at(document, (*at, "candidates"), message, f"at least one {name} sensor")
        return
    for position, one in enumerate(role.sensors):
        if one.entry.modality != name:
            named = role.choice.sensor is not None
            path = (*at, "sensor") if named else (*at, "candidates", position)
            message = f"{one.id} is a sensor of modality {one.entry.modality}"
            yield problem_at(document, path, message, name, one.entry.modality)
    if pinned is not None and not any(pinned in one.entry.serves for one in role.sensors):
        message = f"no such primitive on {_named(role)}"
        yield problem_at(document, (*at, "primitive"), message, " or ".join(_offered(role)), pinned)
        return
    if role.inline is None:
        yield from _method_misfits(document, at, role)


def _method_misfits(document: ParsedFile, at: KeyPath, role: RoleCase) -> Iterator[Flaw]:
    if not role.methods:
        wanted = (
            "a method id, {candidates: [...]}, or {error: {...}} here, in the stage or the spec"
        )
        yield problem_at(document, at, "no timestamping is given for this role", wanted)
    if not isinstance(role.choice.timestamping, str):
        return  # open: what does not fit is left out of the choice, with the reason kept
    method, pinned = role.methods[0], role.choice.primitive
    if not any(usable_primitives(one.entry, method.entry, pinned) for one in role.sensors):
        message = f"{method.id} cannot stamp {_named(role)}"
        wanted = f"a method for {pinned or ', '.join(_offered(role))}"
        found = f"{method.id}, which serves {', '.join(method.entry.primitives)}"
        yield problem_at(document, (*at, "timestamping"), message, wanted, found)


def _offered(role: RoleCase) -> list[str]:
    """Primitives of any candidate."""
    return sorted({primitive for one in role.sensors for primitive in one.entry.serves})


def _named(role: RoleCase) -> str:
    return role.sensors[0].id if len(role.sensors) == 1 else "any of the candidates"


def _vehicle_misfits(document: ParsedFile, spec: Spec) -> Iterator[Flaw]:
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


def _effect_misfits(document: ParsedFile, spec: Spec) -> Iterator[Flaw]:
    names = [stage.name for stage in spec.stages]
    for index, effect in enumerate(spec.effects):
        at: KeyPath = ("effects", index)
        if effect.stage is None and len(names) > 1 and effect.sensor != "target":
            yield problem_at(document, at, "missing key stage", f"one of {', '.join(names)}")
        if effect.stage is not None and effect.stage not in names:
            hint = did_you_mean(effect.stage, names)
            wanted = f"one of {', '.join(names)}"
            yield problem_at(document, (*at, "stage"), "unknown stage", wanted, effect.stage, hint)
        elif effect.sensor in ROLES:
            place = names.index(effect.stage) if effect.stage else 0
            stage = spec.stages[place]
            if place > 0 and effect.sensor == "position":
                continue  # a transponder: which effects act on it is the dictionary's to say
            if stage.role(effect.sensor) is None:
                message = f"stage {stage.name} has no {effect.sensor} sensor"
                yield problem_at(document, (*at, "sensor"), message)


Part = tuple[KeyPath, str, Any]  # where the spec names it, what it is, the entry


def parts_in_use(case: Case) -> Iterator[Part]:
    """Every entry that a design of this spec may buy, once, with where the spec names it."""
    seen: set[str] = set()
    for path, label, entry in _parts(case):
        if label not in seen:
            seen.add(label)
            yield path, label, entry


def _parts(case: Case) -> Iterator[Part]:
    for stage in case.stages:
        for role in stage.roles:
            yield from _role_parts(case, ("stages", stage.index, role.role), role)
        at: KeyPath = ("stages", stage.index, "clock")
        for clock in stage.clocks:
            yield at, f"clock {clock.id}", clock.entry
            yield from _hardware(case, at, clock.entry.requires)


def _role_parts(case: Case, at: KeyPath, role: RoleCase) -> Iterator[Part]:
    for one in role.sensors:
        yield at, f"sensor {one.id}", one.entry
    for method in role.methods:
        pinned = role.choice.primitive
        if any(usable_primitives(one.entry, method.entry, pinned) for one in role.sensors):
            yield at, f"timestamping method {method.id}", method.entry
            yield from _hardware(case, at, method.entry.requires)


def _hardware(case: Case, at: KeyPath, requires: Iterable[str]) -> Iterator[Part]:
    for identity in requires:
        yield at, f"shared hardware {identity}", case.hardware[identity].entry


def currency_problems(document: ParsedFile, case: Case) -> list[Flaw]:
    """Amounts in a currency that the spec gives no rate for."""
    spec, problems = case.spec, []
    for path, what, amount in _amounts(case):
        if not spec.can_convert(amount):
            code = amount.currency
            hint = f"add exchange_rates: {{{code}: RATE {spec.currency}}}"
            problems.append(
                problem_at(document, path, f"{what} in {code}", spec.currency, amount.text, hint)
            )
    return problems


def _amounts(case: Case) -> Iterable[tuple[KeyPath, str, Quantity]]:
    for index, requirement in enumerate(case.spec.requirements):
        if requirement.kind == "cost" and isinstance(requirement.limit, Quantity):
            yield ("requirements", index, "limit"), "a limit", requirement.limit
    for stage in case.stages:
        for role in stage.roles:
            query = role.choice.candidates
            if isinstance(query, Query) and query.max_cost is not None:
                at: KeyPath = ("stages", stage.index, role.role, "candidates", "max_cost")
                yield at, "a limit", query.max_cost
    for path, label, entry in parts_in_use(case):
        if entry.cost is not None:
            yield path, f"the cost of {label} is", entry.cost


def names_candidates(case: Case) -> bool:
    """Whether a spec lists what to choose from, however much of it can be used.

    A list with one method or clock means the same as its bare id; sensors say which they mean.
    """
    return any(
        len(stage.clocks) > 1
        or any(one.choice.candidates is not None or len(one.methods) > 1 for one in stage.roles)
        for stage in case.stages
    )


def is_open(case: Case) -> bool:
    """Whether anything is left to choose."""
    return any(
        len(stage.clocks) > 1 or any(_has_options(role) for role in stage.roles)
        for stage in case.stages
    )


def _has_options(role: RoleCase) -> bool:
    if len(role.sensors) > 1:
        return True
    pairs = (
        usable_primitives(one.entry, method.entry, role.choice.primitive)
        for one in role.sensors
        for method in role.methods
    )
    return sum(len(primitives) for primitives in pairs) > 1


def missing_figures(document: ParsedFile, case: Case) -> list[Flaw]:
    """Costs, masses and powers that a requirement or the objective needs and a catalog lacks."""
    needed = figures_due(case.spec, is_open(case))
    return [
        problem_at(
            document, path, f"{label} has no {figure}", f"a {figure}, needed by {reason}",
            hint="give the entry one, or drop it from the candidates",
        )
        for path, label, entry in parts_in_use(case)
        for figure, reason in sorted(needed.items())
        if getattr(entry, figure) is None
    ]  # fmt: skip
