"""Verdicts read back from a file: whatever is in it, a verdict or a clear refusal."""

from __future__ import annotations

import json
from pathlib import Path
from typing import NoReturn, TypeVar

from syncline_design.machine.records import NotThisResultError, Record, read_as
from syncline_design.spec.load import BadInput
from syncline_design.spec.yaml_text import Flaw, StopReadingError, read_bytes
from syncline_design.verdict.tree import SCHEMA, SEVERAL_SCHEMA, Verdict, Verdicts

R = TypeVar("R", bound=Record)

_WANTED = "a verdict as `check --output json:PATH` writes it, of one spec"
_SOME = "what `check --output json:PATH` writes"
_ANEW = "a verdict written by this version; run `check` on its spec again"


def text_of(path: Path) -> str:
    """The text of a spec or verdict file."""
    try:
        return read_bytes(path).decode("utf-8-sig")
    except (OSError, StopReadingError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        _refuse(path, f"cannot read the file: {reason.lower()}")


def read_verdict(path: Path) -> Verdict:
    """The verdict in a JSON file; BadInput names the first thing in it that is none."""
    text = text_of(path)
    name, word = _is(path, text)
    if name != SCHEMA or word == "refused":
        where = "verdict" if name == SCHEMA else "schema"
        found = word if name == SCHEMA else name or "none"
        _refuse(path, "not a verdict that can be compared", where, _WANTED, found)
    return _read(path, text, Verdict, _WANTED)


def read_verdicts(path: Path) -> tuple[Verdict, ...]:
    """The verdicts in a JSON file of one or of several; specs that were refused have none."""
    text = text_of(path)
    name, word = _is(path, text)
    if name == SEVERAL_SCHEMA:
        found = _read(path, text, Verdicts, _SOME).verdicts
        return tuple(one for one in found if isinstance(one, Verdict))
    if name != SCHEMA:
        _refuse(path, "not a verdict that can be a baseline", "schema", _SOME, name or "none")
    return () if word == "refused" else (_read(path, text, Verdict, _SOME),)


def _read(path: Path, text: str, kind: type[R], wanted: str) -> R:
    try:
        return read_as(kind, text)
    except NotThisResultError as error:
        where, _, what = str(error).partition("\n")[0].partition(": ")
        if what == "Field required":
            what, wanted = "missing; perhaps an earlier syncline-design wrote this verdict", _ANEW
        else:
            what = f"not a verdict: {what}"
        _refuse(path, what, where, wanted)


def _is(path: Path, text: str) -> tuple[str, str]:
    """What a JSON file says it is, and its outcome; BadInput where it is no JSON."""
    try:
        data = json.loads(text, parse_constant=_no_constant)
    except json.JSONDecodeError as error:
        wanted = "a verdict as `check --output json:PATH` writes it"
        problem = Flaw(str(path), error.lineno, error.colno, "", f"not JSON: {error.msg}", wanted)
        raise BadInput((problem,)) from None
    except (ValueError, RecursionError) as error:
        deep = isinstance(error, RecursionError)
        _refuse(path, "nested too deeply" if deep else f"not JSON: {error}")
    said = data if isinstance(data, dict) else {}
    return str(said.get("schema", ""))[:80], str(said.get("verdict", ""))[:80]


def _no_constant(name: str) -> NoReturn:
    raise ValueError(f"{name} is no number of JSON")


def _refuse(
    path: Path, message: str, where: str = "", expected: str = "", found: str = ""
) -> NoReturn:
    raise BadInput((Flaw(str(path), 1, 1, where, message, expected, found),)) from None
