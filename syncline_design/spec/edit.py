"""Specs written back: a chosen design pinned, or effects added, with the user's comments kept.

The change is made twice: to the plain data, which says what the result has to mean, and to the
text.  Where the edited text does not read back as exactly that data, the spec is written anew from
the data instead, with a comment that says so.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import yaml

from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.result_files import write_file
from syncline_design.model.quantity import Quantity
from syncline_design.model.roles import RoleName
from syncline_design.spec.case import Case
from syncline_design.spec.choices import ClockChoice
from syncline_design.spec.load import load_text
from syncline_design.spec.spec import EffectChoice
from syncline_design.spec.yaml_text import KeyPath, parse, plain_scalar

MAX_WIDTH = 96


@dataclass(frozen=True, slots=True)
class PinnedRole:
    """What was chosen for one role; timestamping None leaves the spec's own as it is."""

    stage: int
    role: RoleName
    sensor: str
    primitive: str | None = None
    timestamping: str | None = None


def pinned(
    case: Case, roles: Sequence[PinnedRole], clocks: Mapping[int, str] | None = None
) -> Case:
    """The case with every choice pinned; its spec is the one that `pinned_spec_text` writes."""
    stages = list(case.spec.stages)
    for one in roles:
        choice = stages[one.stage].role(one.role)
        assert choice is not None
        keys = choice.model_copy(update=pinned_keys(case, one))
        stages[one.stage] = stages[one.stage].model_copy(update={one.role: keys})
    for index, clock in (clocks or {}).items():
        only = ClockChoice(candidates=(clock,))
        stages[index] = stages[index].model_copy(update={"clock": only})
    return replace(case, spec=case.spec.model_copy(update={"stages": tuple(stages)}))


def pinned_spec_text(
    case: Case, roles: Sequence[PinnedRole], clocks: Mapping[int, str] | None = None
) -> str:
    """The spec with every choice pinned; clocks: stage index to clock id."""
    changes: list[tuple[KeyPath, dict[str, Any]]] = []
    for pinned in roles:
        path: KeyPath = ("stages", pinned.stage, pinned.role)
        changes.append((path, pinned_keys(case, pinned)))
    for stage, clock in sorted((clocks or {}).items()):
        changes.append((("stages", stage), {"clock": clock}))
    return changed_text(case, changes, "with the chosen design pinned")


def pinned_keys(case: Case, pinned: PinnedRole) -> dict[str, Any]:
    """Keys of a role that pin what was chosen; None: a key that goes."""
    choice = case.spec.stages[pinned.stage].role(pinned.role)
    inline = choice is not None and choice.sensor is not None and not isinstance(choice.sensor, str)
    keys: dict[str, Any] = {"candidates": None}
    if not inline:  # a sensor given in place stays as it stands
        keys["sensor"] = pinned.sensor
    if pinned.primitive is not None:
        keys["primitive"] = pinned.primitive
    if pinned.timestamping is not None:
        keys["timestamping"] = pinned.timestamping
    return keys


def with_timestamping_text(case: Case, errors: Sequence[tuple[int, RoleName, float, str]]) -> str:
    """The spec with roles' timestamp errors in place: uniform from minus a bound to 0.

    errors: stage index, role, bound [s], and the stream that it was seen in.
    """
    changes: list[tuple[KeyPath, dict[str, Any]]] = []
    for stage, role, bound_s, stream in errors:
        choice = case.spec.stages[stage].role(role)
        own = choice.note if choice is not None else ""
        said = f"timestamping: upper bound from audit of {stream}, transport included"
        error = {"distribution": "uniform", "low": f"{-bound_s:.6g} s", "high": "0 s"}
        keys = {"timestamping": {"error": error}, "note": f"{own}; {said}" if own else said}
        changes.append((("stages", stage, role), keys))
    return changed_text(case, changes, "with the residuals that `audit` found")


def with_effects(case: Case, effects: Sequence[EffectChoice]) -> Case:
    """The case with known effects added; its spec is the one that `with_effects_text` writes."""
    spec = case.spec.model_copy(update={"effects": (*case.spec.effects, *effects)})
    return replace(case, spec=spec)


def with_effects_text(case: Case, effects: Sequence[EffectChoice]) -> str:
    """The spec with entries added at the end of its `effects:`."""
    data = parse(case.text, str(case.path)).data
    entries = (*data.get("effects", ()), *(effect_entry(effect) for effect in effects))
    return changed_text(case, [((), {"effects": entries})], "with effects that `diagnose` found")


def with_log_text(case: Case, log: Mapping[str, Any]) -> str:
    """The spec with a mapping of streams in its `log:`, beside what stands there already."""
    data = parse(case.text, str(case.path)).data
    whole = {**data.get("log", {}), **log}
    return changed_text(
        case, [((), {"log": whole})], "with the mapping that `log inspect` proposes"
    )


def effect_entry(effect: EffectChoice) -> dict[str, Any]:
    """One effect as plain data of a spec: bare SI figures, as the parameter names say."""
    entry: dict[str, Any] = {"effect": effect.effect, "sensor": effect.sensor}
    if effect.stage is not None:
        entry["stage"] = effect.stage
    entry["parameters"] = {name: _bare(value) for name, value in effect.parameters.items()}
    if effect.standard_uncertainty:
        figures = effect.standard_uncertainty
        entry["standard_uncertainty"] = {name: _bare(value) for name, value in figures.items()}
    for key in ("source", "note"):
        if getattr(effect, key):
            entry[key] = getattr(effect, key)
    return entry


def _bare(value: float | str) -> float | str:
    return value if isinstance(value, str) else float(value)


def write_spec(text: str, path: str | Path, builtin: bool = True) -> Case:
    """Check a spec's text as if it lay at `path`, then write it there in one step; OutputError."""
    case = load_text(text, path, builtin)
    write_file(path, text.encode("utf-8"))
    return case


def changed_text(case: Case, changes: list[tuple[KeyPath, dict[str, Any]]], reason: str) -> str:
    """The spec's text with keys of mappings set (or, for None, dropped)."""
    data, text = parse(case.text, str(case.path)).data, case.text
    for path, keys in changes:
        data = _with_keys(data, path, keys)
    try:
        for path, keys in changes:
            text = _edited(text, path, keys)
    except yaml.YAMLError:
        text = ""
    if text and parse(text).data == data:
        return text
    header = f"# Written from {case.path.name}, {reason}; its comments could not be kept.\n"
    return header + yaml_text(data)


def _with_keys(data: Any, path: KeyPath, keys: dict[str, Any]) -> Any:
    if not path:
        merged = {k: v for k, v in data.items() if k not in keys or keys[k] is not None}
        return {**merged, **{k: v for k, v in keys.items() if v is not None}}
    head, rest = path[0], path[1:]
    if isinstance(data, tuple):
        return tuple(_with_keys(v, rest, keys) if i == head else v for i, v in enumerate(data))
    return {k: _with_keys(v, rest, keys) if k == head else v for k, v in data.items()}


def _edited(text: str, path: KeyPath, keys: dict[str, Any]) -> str:
    """One mapping of the text with keys set or dropped; everything else stays byte for byte."""
    node: Any = yaml.compose(text, Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader))
    for part in path:
        node = _child(node, part)
    entries = [(key.value, key.start_mark.index, _end(text, value)) for key, value in node.value]
    put = {key: value for key, value in keys.items() if value is not None}
    if node.flow_style:
        return _edited_flow(text, node, entries, put, set(keys))
    return _edited_block(text, entries, put, set(keys), _indent(text, entries[0][1]))


def _child(node: Any, part: str | int) -> Any:
    if isinstance(node, yaml.SequenceNode):
        return node.value[part]
    return next(value for key, value in node.value if key.value == part)


def _end(text: str, node: Any) -> int:
    """Where a node's own text ends; the mark of a block node lies after comments that follow."""
    if isinstance(node, yaml.CollectionNode) and not node.flow_style and node.value:
        last = node.value[-1]
        return _end(text, last[1] if isinstance(node, yaml.MappingNode) else last)
    end = int(node.end_mark.index)
    while end > node.start_mark.index and text[end - 1] in " \n":
        end -= 1
    return end


def _indent(text: str, start: int) -> str:
    return " " * (start - (text.rfind("\n", 0, start) + 1))


Entry = tuple[str, int, int]  # key, start, end in the text


def _edited_flow(
    text: str, node: Any, entries: list[Entry], put: dict[str, Any], gone: set[str]
) -> str:
    parts = [f"{key}: {flow_text(value)}" for key, value in put.items()]
    parts += [text[start:end] for key, start, end in entries if key not in gone]
    start, end = node.start_mark.index, node.end_mark.index
    return text[:start] + "{" + ", ".join(parts) + "}" + text[end:]


def _edited_block(
    text: str, entries: list[Entry], put: dict[str, Any], gone: set[str], indent: str
) -> str:
    lines = [_block_entry(key, value, indent) for key, value in put.items()]
    new = f"\n{indent}".join(lines)
    old = [(start, end) for key, start, end in entries if key in gone]
    if not old and not new:
        return text
    if not old:
        end = entries[-1][2]
        line_end = text.find("\n", end)
        at = len(text) if line_end < 0 else line_end
        return f"{text[:at]}\n{indent}{new}{text[at:]}"
    for start, end in reversed(old[1:] if new else old):
        text = _without(text, start, end)
    return text[: old[0][0]] + new + text[old[0][1] :] if new else text


def _without(text: str, start: int, end: int) -> str:
    """The text without a piece, and without its line where nothing else is on it."""
    line_start = text.rfind("\n", 0, start) + 1
    line_end = text.find("\n", end)
    stop = len(text) if line_end < 0 else line_end + 1
    if not text[line_start:start].strip() and not text[end:stop].strip():
        return text[:line_start] + text[stop:]
    return text[:start] + text[end:]


def _block_entry(key: str, value: Any, indent: str) -> str:
    if key == "effects" and value:
        return "\n".join([f"{key}:", *(f"{indent}  - {flow_text(item)}" for item in value)])
    return f"{key}: {flow_text(value)}"


def flow_text(value: Any) -> str:
    """A value on one line."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{flow_text(k)}: {flow_text(v)}" for k, v in value.items()) + "}"
    if isinstance(value, tuple | list):
        return "[" + ", ".join(flow_text(item) for item in value) + "]"
    if isinstance(value, str):
        return _scalar_text(value)
    if isinstance(value, Quantity):
        return value.text
    if isinstance(value, bool):
        return str(value).lower()
    return str(getattr(value, "text", None) or repr(value))


_PLAIN = frozenset("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_./ +%()^<>=;-")


def _scalar_text(text: str) -> str:
    """A text as a plain scalar where it reads back the same, else in double quotes."""
    first = text[:1].isalnum() or text[:1] in "_." or (text[:1] in "+-" and text[1:2].isdigit())
    plain = first and set(text) <= _PLAIN and text == text.strip() and plain_scalar(text) == text
    return text if plain and _is_text_everywhere(text) else _quoted(text)


def _is_text_everywhere(text: str) -> bool:
    """Whether a plain scalar is text to this project's reader and to YAML 1.1 ones as well."""
    try:
        return isinstance(plain_scalar(text), str) and yaml.safe_load(text) == text
    except yaml.YAMLError:
        return False


def _quoted(text: str) -> str:
    escapes = {'"': '\\"', "\\": "\\\\", "\n": "\\n", "\t": "\\t"}

    def escaped(c: str) -> str:
        if c in escapes:
            return escapes[c]
        if c.isprintable():
            return c
        code = ord(c)
        return (
            f"\\x{code:02x}"
            if code < 0x100
            else f"\\u{code:04x}"
            if code < 0x10000
            else f"\\U{code:08x}"
        )

    return '"' + "".join(escaped(c) for c in text) + '"'


def yaml_text(data: Any, indent: str = "") -> str:
    """Plain data as YAML: block style, with what fits a line on one line."""
    lines: list[str] = []
    for key, value in data.items():
        lines += _block_lines(f"{indent}{flow_text(key)}:", value, indent)
    return "\n".join(lines) + "\n"


def _block_lines(start: str, value: Any, indent: str) -> list[str]:
    flat = flow_text(value)
    if not isinstance(value, Mapping | tuple) or not value or len(start) + len(flat) < MAX_WIDTH:
        return [f"{start} {flat}"]
    deeper = indent + "  "
    if isinstance(value, Mapping):
        lines = [start]
        for key, item in value.items():
            lines += _block_lines(f"{deeper}{flow_text(key)}:", item, deeper)
        return lines
    lines = [start]
    for item in value:
        lines += _item_lines(item, deeper)
    return lines


def _item_lines(item: Any, indent: str) -> list[str]:
    flat = f"{indent}- {flow_text(item)}"
    if not isinstance(item, Mapping) or len(flat) < MAX_WIDTH:
        return [flat]
    lines = yaml_text(item, indent + "  ").rstrip("\n").split("\n")
    return [f"{indent}- {lines[0].lstrip(' ')}", *lines[1:]]
