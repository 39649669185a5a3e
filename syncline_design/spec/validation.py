"""Plain data to models, with every error as a Problem at its line and column."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any, TypeVar

from pydantic import ValidationError

from syncline_design.spec.fields import FileRecord, did_you_mean, kind_of
from syncline_design.spec.yaml_text import Flaw, KeyPath, ParsedFile, printable, show_path

M = TypeVar("M", bound=FileRecord)

_LIMITS = {
    "greater_than": ("gt", "more than"),
    "greater_than_equal": ("ge", "at least"),
    "less_than": ("lt", "less than"),
    "less_than_equal": ("le", "at most"),
}
_WANTED = {
    "string_type": "text",
    "int_type": "a whole number",
    "bool_type": "true or false",
    "tuple_type": "a list",
    "dict_type": "a mapping of keys and values",
    "model_type": "a mapping of keys and values",
}


def validate(model: type[M], document: ParsedFile, data: Any = None) -> tuple[M | None, list[Flaw]]:
    """The model of a document's data, or what is wrong with it.

    Places that the reader refused already are not reported a second time.
    """
    if document.data is None and data is None:
        return None, []
    nulls = dict(_nulls(document, document.data, ()))
    refused = {*document.problem_paths, *nulls}
    try:
        value = model.model_validate(document.data if data is None else data)
    except ValidationError as error:
        return None, [*nulls.values(), *_problems(error, document, refused)]
    return (None if nulls else value), list(nulls.values())


def _nulls(document: ParsedFile, data: Any, path: KeyPath) -> Iterator[tuple[KeyPath, Flaw]]:
    """Keys and items with nothing in them: a slip more often than a wish for the default."""
    if isinstance(data, dict | tuple):
        for key, item in data.items() if isinstance(data, dict) else enumerate(data):
            yield from _nulls(document, item, (*path, key))
    elif data is None and path not in document.problem_paths:
        place = document.position(path)
        hint = "give a value, or delete the key"
        yield path, Flaw(document.file, *place, show_path(path), "nothing (null)", hint=hint)


def _problems(
    error: ValidationError, document: ParsedFile, refused: set[KeyPath]
) -> Iterator[Flaw]:
    for detail in error.errors(include_url=False):
        path = tuple(detail["loc"])
        if any(path[:length] in refused for length in range(1, len(path) + 1)):
            continue
        if detail["type"] == "missing" and _had_a_refused_key(path[:-1], refused):
            continue
        yield _problem(dict(detail), path, document)


def _had_a_refused_key(path: KeyPath, refused: set[KeyPath]) -> bool:
    return any(len(r) == len(path) + 1 and r[:-1] == path for r in refused)


def _problem(detail: dict[str, Any], path: KeyPath, document: ParsedFile) -> Flaw:
    line, column = document.position(path)
    kind, context = detail["type"], detail.get("ctx", {})
    if kind in ("unknown_key", "extra_forbidden"):
        line, column = document.key_positions.get(path, (line, column))
        message, expected, found, hint = "unknown key", "", "", context.get("hint", "")
    elif kind == "missing":
        message, expected, found, hint = "missing key", "", "", f"add {path[-1]}: ..."
    elif kind == "refused":
        message, expected = context["message"], context["expected"]
        found, hint = context["found"], context["hint"]
    else:
        message, expected, found, hint = _standard(kind, context, detail)
    return Flaw(
        document.file, line, column, show_path(path), message, expected, printable(found, 80), hint
    )


def _standard(
    kind: str, context: dict[str, Any], detail: dict[str, Any]
) -> tuple[str, str, str, str]:
    """One of pydantic's own errors in the words of this project."""
    value = detail["input"]
    if kind == "literal_error":
        allowed = re.findall(r"'([^']*)'", str(context["expected"])) or [str(context["expected"])]
        hint = did_you_mean(value, allowed) if isinstance(value, str) else ""
        return "not one of the choices", " or ".join(allowed), kind_of(value), hint
    if kind in _LIMITS:
        key, words = _LIMITS[kind]
        return "out of range", f"{words} {context[key]}", kind_of(value), ""
    if kind in ("too_short", "string_too_short"):
        return "empty", "at least one entry" if kind == "too_short" else "some text", "", ""
    if kind == "too_long":
        most, found = context["max_length"], context.get("actual_length")
        return "too many entries", f"at most {most}", str(found) if found else "more", ""
    if kind in _WANTED:
        number_as_text = kind == "string_type" and isinstance(value, int | float)
        hint = "put it in quotes" if number_as_text else ""
        if kind == "int_type" and isinstance(value, str):
            hint = "unquote it"
        return "wrong kind of value", _WANTED[kind], kind_of(value), hint
    return str(detail["msg"]), "", kind_of(value), ""
