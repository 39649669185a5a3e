"""Verdicts read back from a file: whatever is in it, a verdict or a clear refusal."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NoReturn

from syncline_design.spec.load import BadInput
from syncline_design.spec.yaml_text import Problem, StopReadingError, read_bytes

Json = dict[str, Any]
WORDS = ("meets", "fails", "infeasible", "indeterminate")
_WANTED = "a verdict as `check --output json:PATH` writes it, of one spec"
_REQUIREMENT_FIGURES = ("value", "limit", "margin", "line", "column")
_REQUIREMENT_TEXTS = ("kind", "unit", "status")
_PICK_TEXTS = ("sensor", "name", "primitive", "timestamping")


def text_of(path: Path) -> str:
    """The text of a spec or verdict file."""
    try:
        return read_bytes(path).decode("utf-8-sig")
    except (OSError, StopReadingError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        _refuse(path, f"cannot read the file: {reason.lower()}")


def read_verdict(path: Path) -> Json:
    """The verdict in a JSON file; BadInput names the first thing in it that is none."""
    text = text_of(path)
    try:
        data = json.loads(text, parse_constant=_no_constant)
    except json.JSONDecodeError as error:
        problem = Problem(str(path), error.lineno, error.colno, "", f"not JSON: {error.msg}")
        raise BadInput((problem,)) from None
    except (ValueError, RecursionError) as error:
        deep = isinstance(error, RecursionError)
        _refuse(path, "nested too deeply" if deep else f"not JSON: {error}")
    wrong = next(_wrong(data), None)
    if wrong is not None:
        found = data.get("schema", "") if isinstance(data, dict) else ""
        where, what = wrong
        _refuse(path, f"not a verdict: {what}", where, _WANTED, str(found)[:80])
    result: Json = data
    return result


def _no_constant(name: str) -> NoReturn:
    raise ValueError(f"{name} is no number of JSON")


def _refuse(
    path: Path, message: str, where: str = "", expected: str = "", found: str = ""
) -> NoReturn:
    raise BadInput((Problem(str(path), 1, 1, where, message, expected, found),)) from None


Wrong = Iterator[tuple[str, str]]


def _wrong(data: Any) -> Wrong:
    """What is not as in a verdict: (where, what)."""
    if not isinstance(data, dict):
        yield "", "not a mapping"
        return
    if not isinstance(data.get("verdict"), str) or data["verdict"] not in WORDS:
        yield "verdict", f"not one of {', '.join(WORDS)}"
    if not isinstance(data.get("requirements"), list):
        yield "requirements", "not a list"
        return
    for index, row in enumerate(data["requirements"]):
        yield from _wrong_row(row, f"requirements[{index}]")
    for key in ("spec", "design", "syncline", "provenance"):
        if not isinstance(data.get(key), dict | None):
            yield key, "not a mapping"
            return
    yield from _wrong_figures(data.get("syncline") or {}, ("total_m",), "syncline")
    yield from _wrong_spec(data.get("spec") or {})
    yield from _wrong_design(data.get("design") or {})


def _wrong_row(row: Any, where: str) -> Wrong:
    if not isinstance(row, dict) or not isinstance(row.get("id"), str):
        yield where, "no requirement with an id"
        return
    yield from _wrong_figures(row, _REQUIREMENT_FIGURES, where)
    yield from _wrong_texts(row, _REQUIREMENT_TEXTS, where)


def _wrong_spec(spec: Json) -> Wrong:
    yield from _wrong_texts(spec, ("name", "file", "currency"), "spec")
    for stage, where in _stages(spec, "spec"):
        if stage is None or not isinstance(stage.get("platform"), dict):
            yield where, "no stage with a name and a platform"


def _wrong_design(design: Json) -> Wrong:
    yield from _wrong_figures(design, ("cost", "mass", "power"), "design")
    for stage, where in _stages(design, "design"):
        if stage is None or not isinstance(stage.get("roles"), dict):
            yield where, "no stage with a name and roles"
            continue
        for role, pick in stage["roles"].items():
            if not isinstance(pick, dict | None):
                yield f"{where}.roles.{role}", "not a mapping"
                continue
            yield from _wrong_texts(pick or {}, _PICK_TEXTS, f"{where}.roles.{role}")


def _stages(part: Json, where: str) -> Iterator[tuple[Json | None, str]]:
    """Stages with their places; None for what is none."""
    stages = part.get("stages") or []
    if not isinstance(stages, list):
        yield None, f"{where}.stages"
        return
    for index, stage in enumerate(stages):
        named = isinstance(stage, dict) and isinstance(stage.get("name"), str)
        yield (stage if named else None), f"{where}.stages[{index}]"


def _wrong_figures(part: Mapping[str, Any], keys: tuple[str, ...], where: str) -> Wrong:
    for key in keys:
        value = part.get(key)
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if value is not None and not (number and _is_finite(value)):
            yield f"{where}.{key}", "not a finite number"


def _is_finite(value: float) -> bool:
    try:
        return math.isfinite(value)
    except OverflowError:  # an integer beyond every float
        return False


def _wrong_texts(part: Mapping[str, Any], keys: tuple[str, ...], where: str) -> Wrong:
    for key in keys:
        if not isinstance(part.get(key), str | None):
            yield f"{where}.{key}", "not a text"
