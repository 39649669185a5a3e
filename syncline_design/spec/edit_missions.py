"""A spec of several missions written back with its payload pinned.

What missions share is pinned in the spec's stages, and what a mission says of it is taken out; what
each mission has of its own is pinned in the mission.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from syncline_design.model.roles import RoleName
from syncline_design.spec.case import Case
from syncline_design.spec.edit import PinnedRole, changed_text, pinned_keys
from syncline_design.spec.yaml_text import KeyPath, parse

Change = tuple[KeyPath, dict[str, Any]]
OPEN_KEYS = ("sensor", "candidates", "primitive", "timestamping")


def pinned_missions_text(
    case: Case,
    roles: Sequence[Sequence[PinnedRole]],
    clocks: Mapping[int, str],
) -> str:
    """The spec with every choice pinned; roles: those of each mission; clocks: by stage index."""
    data = parse(case.text, str(case.path)).data
    own = {
        (one.stage, one.role)
        for one in roles[0]
        if (role := case.spec.stages[one.stage].role(one.role)) is not None and role.per_mission
    }
    changes: list[Change] = [
        (("stages", one.stage, one.role), pinned_keys(case, one))
        for one in roles[0]
        if (one.stage, one.role) not in own
    ]
    changes += [(("stages", stage), {"clock": clock}) for stage, clock in sorted(clocks.items())]
    for index, mission in enumerate(case.missions):
        stages = _stages_of(data["missions"][index], case, mission.case, roles[index], own)
        if stages:
            changes.append((("missions", index), {"stages": stages}))
    return changed_text(case, changes, "with the chosen payload pinned")


def _stages_of(
    raw: Mapping[str, Any],
    case: Case,
    mission: Case,
    roles: Sequence[PinnedRole],
    own: set[tuple[int, RoleName]],
) -> dict[str, Any]:
    """A mission's overrides of stages without what was chosen, or with what is its own."""
    stages = {name: dict(keys) for name, keys in raw.get("stages", {}).items()}
    for one in roles:
        name = case.spec.stages[one.stage].name
        keys = dict(stages.get(name, {}).get(one.role, {}))
        inline = isinstance(keys.get("sensor"), Mapping)
        gone = [key for key in OPEN_KEYS if not (inline and key == "sensor")]
        left = {key: value for key, value in keys.items() if key not in gone}
        if (one.stage, one.role) in own:
            put = pinned_keys(mission, one)
            left |= {key: value for key, value in put.items() if value is not None}
        if left or keys:
            stages[name] = {**stages.get(name, {}), one.role: left}
        if not left and name in stages:
            stages[name].pop(one.role, None)
    for name, keys in stages.items():
        if any(stage.name == name and stage.clock is not None for stage in case.spec.stages):
            keys.pop("clock", None)
    return stages
