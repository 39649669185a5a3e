"""Missions of a spec: what each puts over the stages and requirements, read as a spec of its own.

A mission is the spec with its overrides in their places, checked as any other spec; every message
says the place in the file where the user wrote what is wrong.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any

from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.roles import ROLES
from syncline_design.spec.case import Mission, RoleCase
from syncline_design.spec.fields import did_you_mean
from syncline_design.spec.files import problem_at
from syncline_design.spec.keys import PLATFORM_KEYS
from syncline_design.spec.yaml_text import Flaw, KeyPath, ParsedFile

SECTION = "missions"
MERGED = ("platform", *ROLES)  # overridden key by key
SAME_IN_ALL = {
    "stages": {"name": "it says which stage is meant", "vehicle": "vehicles are shared"},
    "requirements": {
        "id": "it says which one is meant",
        "kind": "a limit may differ, not its kind",
    },
}
INSTEAD_OF = {"sensor": "candidates", "candidates": "sensor"}
_LIMIT_KEYS = {"a", "b", "of"}


@dataclass
class _Draft:
    """A mission's document as it grows out of the spec's."""

    document: ParsedFile
    data: Any
    positions: dict[KeyPath, tuple[int, int]]
    key_positions: dict[KeyPath, tuple[int, int]]
    flaws: list[Flaw]

    def put(self, path: KeyPath, value: Any, source: KeyPath) -> None:
        """A value at a place of the spec; messages about it lead to where it was written."""
        self.data = _put(self.data, path, value)
        for places in (self.positions, self.key_positions):
            for old in [one for one in places if one[: len(path)] == path]:
                del places[old]
        for places, own in (
            (self.positions, self.document.positions),
            (self.key_positions, self.document.key_positions),
        ):
            places.update(
                {(*path, *one[len(source) :]): at for one, at in own.items()
                 if one[: len(source)] == source}
            )  # fmt: skip

    def refuse(self, path: KeyPath, message: str, wanted: str = "", found: str = "",
               hint: str = "") -> None:  # fmt: skip
        place = self.document.key_positions.get(path)
        flaw = problem_at(self.document, path, message, wanted, found, hint)
        self.flaws.append(flaw if place is None else replace(flaw, line=place[0], column=place[1]))

    def finished(self) -> ParsedFile:
        """The mission as a document."""
        return replace(
            self.document, data=self.data, positions=self.positions,
            key_positions=self.key_positions,
        )  # fmt: skip


def mission_documents(document: ParsedFile) -> tuple[list[tuple[str, ParsedFile]], list[Flaw]]:
    """Each mission's name and document, and what is wrong with the overrides themselves."""
    data = document.data
    listed = data.get(SECTION) if isinstance(data, Mapping) else None
    found: list[tuple[str, ParsedFile]] = []
    flaws: list[Flaw] = []
    for index, raw in enumerate(listed if isinstance(listed, tuple) else ()):
        if not isinstance(raw, Mapping) or not isinstance(raw.get("name"), str):
            continue  # the model of the spec says so
        draft = _Draft(
            document, {key: value for key, value in data.items() if key != SECTION},
            dict(document.positions), dict(document.key_positions), flaws,
        )  # fmt: skip
        at: KeyPath = (SECTION, index)
        _override(draft, raw, (*at, "stages"), "name", _override_stage)
        _override(draft, raw, (*at, "requirements"), "id", _override_requirement)
        found.append((raw["name"], draft.finished()))
    return found, flaws


def _override(draft: _Draft, raw: Mapping[str, Any], at: KeyPath, key: str, change: Any) -> None:
    """What a mission changes of stages, or of requirements, each named as in the spec."""
    section = str(at[-1])
    changes, items = raw.get(section), draft.data.get(section)
    if not isinstance(changes, Mapping) or not isinstance(items, tuple):
        return
    names = [one.get(key) if isinstance(one, Mapping) else None for one in items]
    for name, value in changes.items():
        if name not in names:
            known = [str(one) for one in names if one]
            message = f"no {section.removesuffix('s')} of that {key}"
            hint = did_you_mean(name, known)
            draft.refuse((*at, name), message, f"one of {', '.join(known)}", name, hint)
            continue
        change(draft, (section, names.index(name)), value, (*at, name))


def _override_requirement(draft: _Draft, path: KeyPath, value: Any, source: KeyPath) -> None:
    """A limit, or keys of the requirement."""
    if not isinstance(value, Mapping) or set(value) <= _LIMIT_KEYS:
        draft.put((*path, "limit"), value, source)
        return
    for key, item in value.items():
        if not _is_the_same(draft, "requirements", key, (*source, key)):
            draft.put((*path, key), item, (*source, key))


def _override_stage(draft: _Draft, path: KeyPath, value: Any, source: KeyPath) -> None:
    """Keys of a stage; platform and roles key by key."""
    for key, item in value.items() if isinstance(value, Mapping) else ():
        inside = (*source, key)
        if _is_the_same(draft, "stages", key, inside):
            continue
        if key in PLATFORM_KEYS and not _is_interval(item):
            _put_platform(draft, path, key, item, inside)
        elif key in MERGED and isinstance(item, Mapping):
            _override_part(draft, (*path, key), item, inside)
        else:
            draft.put((*path, key), item, inside)
            if key == "distance":
                _drop(draft, (*path, "platform"), "distance")


def _is_the_same(draft: _Draft, section: str, key: str, at: KeyPath) -> bool:
    why = SAME_IN_ALL[section].get(key)
    if why is not None:
        draft.refuse(at, f"{key} is the same in every mission", hint=f"delete it: {why}")
    return why is not None


def _is_interval(value: Any) -> bool:
    return isinstance(value, str) and ".." in value


def _put_platform(draft: _Draft, path: KeyPath, key: str, item: Any, source: KeyPath) -> None:
    """A figure of the platform, written in the stage as a study does."""
    _widened(draft, (*path, "platform"))
    draft.put((*path, "platform", key), item, source)
    if key == "distance":
        _drop(draft, path, "distance")


def _widened(draft: _Draft, path: KeyPath) -> None:
    """A platform that is a bare id as a mapping."""
    own = _at(draft.data, path)
    if isinstance(own, str):
        draft.data = _put(draft.data, path, {"use": own})


def _override_part(draft: _Draft, path: KeyPath, item: Mapping[str, Any], source: KeyPath) -> None:
    """Keys of a platform or a role."""
    part = str(path[-1])
    if part == "platform":
        _widened(draft, path)
    elif _at(draft.data, path) is None:
        draft.refuse(source, f"the spec's stage has no {part}", hint="give it one in `stages`")
        return
    for key, value in item.items():
        if key == "per_mission":
            message = "per_mission is said once, in the spec's stage"
            draft.refuse((*source, key), message, hint="delete it here")
            continue
        if key in INSTEAD_OF:
            _drop(draft, path, INSTEAD_OF[key])
        draft.put((*path, key), value, (*source, key))
        if part == "platform" and key == "distance":
            _drop(draft, path[:-1], "distance")


def _drop(draft: _Draft, path: KeyPath, key: str) -> None:
    own = _at(draft.data, path)
    if isinstance(own, Mapping) and key in own:
        draft.data = _put(draft.data, path, {k: v for k, v in own.items() if k != key})


def _at(data: Any, path: KeyPath) -> Any:
    for step in path:
        if isinstance(data, Mapping):
            data = data.get(step)
        elif isinstance(data, tuple) and isinstance(step, int):
            data = data[step]
        else:
            return None
    return data


def _put(data: Any, path: KeyPath, value: Any) -> Any:
    if not path:
        return value
    step, rest = path[0], path[1:]
    if isinstance(step, int):
        return (*data[:step], _put(data[step], rest, value), *data[step + 1 :])
    kept = dict(data) if isinstance(data, Mapping) else {}
    kept[step] = _put(kept.get(step), rest, value)
    return kept


def in_mission(name: str, flaws: Iterable[Flaw]) -> tuple[Flaw, ...]:
    """What is wrong in a mission alone, as such."""
    return tuple(replace(one, path=f"mission {name}: {one.path}") for one in flaws)


def disagreements(document: ParsedFile, missions: tuple[Mission, ...]) -> Iterator[Flaw]:
    """Roles that missions cannot share: no sensor in common, or one with other figures of cost."""
    first = missions[0].case
    for stage in first.stages:
        for role in stage.roles:
            if role.choice.per_mission:
                continue
            own = [m.case.stages[stage.index].role(role.role) for m in missions]
            yield from _role_disagreements(document, missions, stage.index, own)


def _role_disagreements(
    document: ParsedFile, missions: tuple[Mission, ...], stage: int, roles: list[RoleCase | None]
) -> Iterator[Flaw]:
    common: dict[str, Any] = {}
    for mission, role in zip(missions, roles, strict=True):
        assert role is not None
        known = {one.id: one.entry for one in role.sensors}
        key = "candidates" if role.choice.sensor is None else "sensor"
        place = mission.case.position(("stages", stage, role.role, key))
        named = f"mission {mission.name}: stages[{stage}].{role.role}"
        if mission is not missions[0] and not common.keys() & known.keys():
            message = "no sensor that earlier missions may use too"
            wanted = f"one of {', '.join(list(common)[:6])}"
            hint = "say per_mission: yes in the spec's stage if each mission may have its own"
            yield Flaw(document.file, *place, named, message, wanted, ", ".join(known)[:80], hint)
            return
        for name, entry in known.items():
            other = common.get(name, entry) if common else entry
            if any(getattr(other, key) != getattr(entry, key) for key in ("cost", "mass", "power")):
                message = f"{name} has another cost, mass or power than in an earlier mission"
                hint = "one sensor has one price: give it a name of its own, and per_mission: yes"
                yield Flaw(document.file, *place, named, message, hint=hint)
        common = {k: v for k, v in known.items() if not common or k in common}
