"""Key paths of a study: `stages[uav].distance` to a place in a spec's data, and a value put there.

A selector in brackets is the name of a stage, the id of a requirement, or an index.  Motion and
distance of a stage may be named without their `platform`.  `catalog.sensors[ID].cost` means an
entry of the catalogs instead of the spec.  Values are as the YAML reader left them; `label` writes
one for people, `plain` for JSON.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from typing import Any

from syncline_design.spec.catalog import SECTIONS
from syncline_design.spec.fields import did_you_mean
from syncline_design.spec.yaml_text import KeyPath, Number

CATALOG = "catalog"
PLATFORM_KEYS = ("v_max", "omega_max", "distance", "baseline")
# What says which files are read, or what a file is: one study has one of each.
FIXED_KEYS = ("syncline", "catalogs", "log")
_NAMES_IN = {"stages": "name", "requirements": "id", "missions": "name"}
_EXCLUDES = {"sensor": "candidates", "candidates": "sensor"}
_PART = re.compile(r"(?P<name>[^.\[\]]+)(?P<selectors>(\[[^\[\]]+\])*)(?:\.|$)")


class KeyPathError(Exception):
    """A key path that does not lead anywhere: message, what was expected, what to do."""

    def __init__(self, message: str, expected: str = "", hint: str = "") -> None:
        super().__init__(message)
        self.message, self.expected, self.hint = message, expected, hint


def split_key(text: str) -> tuple[str, ...]:
    """`stages[uav].distance` -> ("stages", "uav", "distance")."""
    parts: list[str] = []
    at = 0
    while at < len(text):
        found = _PART.match(text, at)
        if found is None or (found.end() == len(text) and text.endswith(".")):
            raise KeyPathError("not a key path", "one such as stages[uav].distance")
        parts.append(found["name"].strip())
        parts += [s.strip() for s in re.findall(r"\[([^\[\]]+)\]", found["selectors"])]
        at = found.end()
    if not parts:
        raise KeyPathError("an empty key path", "one such as stages[uav].distance")
    return tuple(parts)


def resolve(text: str, data: Any) -> KeyPath:
    """The place in a spec's data that a key path means; names become indices."""
    parts = split_key(text)
    if parts[0] == CATALOG:
        return _catalog_path(parts)
    if parts[0] in FIXED_KEYS:
        raise KeyPathError(f"{parts[0]} is the same in every case", hint="write several bases")
    path: list[str | int] = []
    node = data
    for part in parts:
        step = _index(path, part, node) if isinstance(node, tuple | list) else part
        path.append(step)
        node = _below(node, step)
    return _with_platform(tuple(path))


def _catalog_path(parts: tuple[str, ...]) -> KeyPath:
    if len(parts) < 4:
        wanted = "catalog.SECTION[ID].KEY, such as catalog.sensors[ID].cost"
        raise KeyPathError("not a key of a catalog entry", wanted)
    if parts[1] not in SECTIONS:
        hint = did_you_mean(parts[1], SECTIONS)
        raise KeyPathError("no such section of a catalog", " or ".join(SECTIONS), hint)
    return parts


def _below(node: Any, step: str | int) -> Any:
    if isinstance(node, Mapping):
        return node.get(step)
    if isinstance(node, tuple | list) and isinstance(step, int):
        return node[step]
    return None


def _index(path: Sequence[str | int], selector: str, items: Sequence[Any]) -> int:
    """The index of a list entry named by its name, its id or its number."""
    section = str(path[-1]) if path else ""
    key = _NAMES_IN.get(section)
    names = [str(item.get(key, "")) if isinstance(item, Mapping) else "" for item in items]
    if key is not None and selector in names:
        return names.index(selector)
    if selector.isdecimal() and selector.isascii() and len(selector) < 9:
        if int(selector) < len(items):
            return int(selector)
        wanted = f"0 to {len(items) - 1}" if items else "an entry, the list is empty"
        raise KeyPathError(f"no entry [{selector}] in {section}", wanted)
    if key is None:
        raise KeyPathError(f"{section} is a list", "an index such as [0]")
    known = [name for name in names if name]
    wanted = f"one of {', '.join(known)}" if known else "an entry"
    message = f"no entry of {section} has the {key} {selector}"
    raise KeyPathError(message, wanted, did_you_mean(selector, known))


def _with_platform(path: KeyPath) -> KeyPath:
    """`stages[0].distance` means `stages[0].platform.distance`."""
    if len(path) == 3 and path[0] == "stages" and path[2] in PLATFORM_KEYS:
        return (*path[:2], "platform", path[2])
    return path


def put(data: Any, path: KeyPath, value: Any) -> Any:
    """A copy of the data with a value at a place; only what lies on the way is copied."""
    if not path:
        return value
    step, rest = path[0], path[1:]
    if isinstance(step, int):
        items = list(data)
        items[step] = put(items[step], rest, value)
        return tuple(items)
    if isinstance(data, str) and step in PLATFORM_KEYS:
        data = {"use": data}  # `platform: ID`, one key of it overridden
    if not isinstance(data, Mapping | None):
        hint = "catalog.sensors[ID].KEY and the like vary a catalog entry"
        raise KeyPathError(f"nothing can be set below {data!r}", "a mapping", hint)
    kept = dict(data or {})
    if not rest and step in _EXCLUDES:
        kept.pop(_EXCLUDES[str(step)], None)
    kept[str(step)] = put(kept.get(str(step)), rest, value)
    return kept


def without(data: Any, path: KeyPath) -> Any:
    """A copy of the data without the key at a place, which is there."""
    step, rest = path[0], path[1:]
    if isinstance(step, int):
        items = list(data)
        items[step] = without(items[step], rest)
        return tuple(items)
    kept = dict(data)
    if rest:
        kept[step] = without(kept[step], rest)
    else:
        del kept[step]
    return kept


def value_at(data: Any, path: KeyPath) -> Any:
    """What a spec's data hold at a place; None where there is nothing."""
    for step in path:
        data = _below(data, step)
    return data


def label(value: Any) -> str:
    """A value as the tables show it: text as it is, lists and mappings as compact JSON."""
    if isinstance(value, str):
        return value
    if isinstance(value, bool) or value is None:
        return json.dumps(value)
    if isinstance(value, int | float):
        return str(getattr(value, "text", None) or value)
    return _compact(value)


def _compact(value: Any) -> str:
    """Compact JSON whose numbers are written as the file has them."""
    if isinstance(value, Mapping):
        pairs = (f"{_compact(str(key))}: {_compact(item)}" for key, item in value.items())
        return "{" + ", ".join(pairs) + "}"
    if isinstance(value, tuple | list):
        return "[" + ", ".join(map(_compact, value)) + "]"
    return json.dumps(value, ensure_ascii=False) if isinstance(value, str) else label(value)


def plain(value: Any) -> Any:
    """Data of the YAML reader as JSON can hold it, decimals with their own digits as text."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, tuple | list):
        return [plain(item) for item in value]
    return {"number": value.text} if isinstance(value, Number) else value
