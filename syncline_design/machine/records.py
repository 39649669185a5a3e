"""Results as data: one walk from frozen records to JSON, one from their types to JSON Schema, and
one back from JSON.

A result is a frozen dataclass below `Record`; its fields are the keys of its JSON, in their order.
A field that ends in an underscore stands for the key without it (`from_` is `from`).  A field made
by `optional()` is left out of the JSON while it is None; every other one is always there, null
where a figure is unknown or has no end: `float | None` for the one, `Unbounded` for the other.

The rule for versions (`.../v1`): within a version keys are added, never renamed, never given
another meaning and never dropped.  What is added later is `optional()` or has a default, so that
files of an earlier state of the same version still read.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Annotated, Any, ClassVar, Final, TypeVar

from syncline_design.machine.frozen import frozen
from syncline_design.machine.notebooks import Shown
from syncline_design.machine.quick_dataclass import dataclass

Json = dict[str, Any]
R = TypeVar("R", bound="Record")
DRAFT: Final = "https://json-schema.org/draft/2020-12/schema"
_OPTIONAL: Final = "optional"
_ADAPTERS: Final[dict[Any, Any]] = {}


def key_of(field: str) -> str:
    """The JSON key of a field."""
    return field.removesuffix("_")


class Record(Shown):
    """Base of every result that is written as JSON; subclasses are frozen dataclasses."""

    __slots__ = ()
    # what pydantic reads when it makes a schema of a record, or a record of a file
    __pydantic_config__: ClassVar[Json] = {
        "alias_generator": key_of,
        "strict": True,
        "allow_inf_nan": False,
    }

    def __post_init__(self) -> None:
        """Its mappings are as frozen as it is."""
        for name in _mappings(type(self)):  # type: ignore[arg-type]
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, frozen(value))

    def to_json(self) -> Json:
        """The record as plain data, ready for `json`."""
        return _record_json(self)


@functools.cache
def _mappings(kind: Any) -> tuple[str, ...]:
    """The fields of a record that hold a mapping."""
    fields = dataclasses.fields(kind)
    return tuple(one.name for one in fields if str(one.type).startswith(("Mapping[", "dict[")))


class _NullIsInfinite:
    """Of a float: null in JSON stands for it too, and is read as infinity."""

    @staticmethod
    def __get_pydantic_core_schema__(source: Any, handler: Any) -> Any:
        from pydantic_core import core_schema

        def read(value: Any, finite: Callable[[Any], float]) -> float:
            return math.inf if value is None else finite(value)

        return core_schema.no_info_wrap_validator_function(read, handler(source))

    @staticmethod
    def __get_pydantic_json_schema__(schema: Any, handler: Any) -> Json:
        return {"anyOf": [handler(schema), {"type": "null"}]}


Unbounded = Annotated[float, _NullIsInfinite]  # may be infinite: unlimited, or no end known


@dataclass(frozen=True, slots=True)
class SchemaName:
    """Of the `schema` key: only this name is taken, so that no other kind or version is read."""

    name: str

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        from pydantic_core import core_schema

        return core_schema.literal_schema([self.name])


def optional() -> Any:
    """A field that may be missing: None here, no key there."""
    return dataclasses.field(default=None, metadata={_OPTIONAL: True})


def json_of(value: Any) -> Any:
    """Nested records, mappings, sequences and scalars as plain JSON data.

    Whatever is infinite or not a number becomes null: JSON has neither.
    """
    if value is None or isinstance(value, str | bool | int):
        return value
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, Record):
        return _record_json(value)
    if isinstance(value, Mapping):
        return {str(key): json_of(entry) for key, entry in value.items()}
    if isinstance(value, Sequence):
        return [json_of(entry) for entry in value]
    raise TypeError(f"{type(value).__name__} has no place in a result")


def _record_json(record: Record) -> Json:
    found: Json = {}
    for field in dataclasses.fields(record):  # type: ignore[arg-type]
        value = getattr(record, field.name)
        if value is not None or _OPTIONAL not in field.metadata:
            found[key_of(field.name)] = json_of(value)
    return found


def with_texts(value: Any, change: Callable[[str], str]) -> Any:
    """A copy of a record, or of nested data, in which every text (keys included) is changed."""
    if isinstance(value, str):
        return change(value)
    if isinstance(value, Record):
        fields = dataclasses.fields(value)  # type: ignore[arg-type]
        parts = {f.name: with_texts(getattr(value, f.name), change) for f in fields}
        return type(value)(**parts)
    if isinstance(value, Mapping):
        return {with_texts(k, change): with_texts(entry, change) for k, entry in value.items()}
    if isinstance(value, tuple | list):
        return tuple(with_texts(entry, change) for entry in value)
    return value


class NotThisResultError(ValueError):
    """JSON that is not a result of the kind asked for; each line says where and what."""


def read_as(kind: type[R], text: str | bytes) -> R:
    """A result read back from its JSON; NotThisResultError where it does not hold what it must."""
    from pydantic import ValidationError

    try:
        found: R = _adapter(kind).validate_json(text)
    except ValidationError as error:
        raise NotThisResultError("\n".join(_lines(error.errors()))) from None
    return found


def _adapter(kind: Any) -> Any:
    """The reader of a kind of record; making one takes as long as reading hundreds."""
    from pydantic import TypeAdapter

    if kind not in _ADAPTERS:
        _ADAPTERS[kind] = TypeAdapter(kind)
    return _ADAPTERS[kind]


def _lines(errors: Sequence[Mapping[str, Any]]) -> list[str]:
    """`path: what is wrong`, one line an error, the same ones every time."""
    return sorted({f"{_path(e['loc']) or 'the file'}: {e['msg']}" for e in errors})


def _path(location: Sequence[int | str]) -> str:
    shown = ""
    for part in location:
        shown += f"[{part}]" if isinstance(part, int) else f".{part}" if shown else part
    return shown


def schema_of(kind: Any, name: str, title: str) -> Json:
    """JSON Schema (draft 2020-12) of a result; name: its `schema` key, as in `.../verdict/v1`.

    kind: a record's type, or the union of those that go by this name.

    Further keys are allowed everywhere: a later state of the same version may add some.
    """
    raw = _adapter(kind).json_schema()
    body = _without_titles(raw)
    body.setdefault("properties", {})["schema"] = {"const": name}
    return {"$schema": DRAFT, "$id": f"urn:{name.replace('/', ':')}", **body, "title": title}


def _without_titles(node: Any) -> Any:
    """A schema without the titles that only repeat the names of its keys."""
    if isinstance(node, list):
        return [_without_titles(entry) for entry in node]
    if not isinstance(node, dict):
        return node
    kept = {k: v for k, v in node.items() if not (k == "title" and isinstance(v, str))}
    return {key: _without_titles(entry) for key, entry in kept.items()}
