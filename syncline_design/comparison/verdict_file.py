"""Verdicts read back from a file: whatever is in it, a verdict or a clear refusal."""

from __future__ import annotations

import json
from pathlib import Path
from typing import NoReturn

from syncline_design.machine.records import NotThisResultError, read_as
from syncline_design.spec.load import BadInput
from syncline_design.spec.yaml_text import Flaw, StopReadingError, read_bytes
from syncline_design.verdict.tree import Verdict

_WANTED = "a verdict as `check --output json:PATH` writes it, of one spec"


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
    found = _schema_of(path, text)
    try:
        return read_as(Verdict, text)
    except NotThisResultError as error:
        where, _, what = str(error).partition("\n")[0].partition(": ")
        _refuse(path, f"not a verdict: {what}", where, _WANTED, found)


def _schema_of(path: Path, text: str) -> str:
    """What a JSON file says it is; BadInput where it is no JSON."""
    try:
        data = json.loads(text, parse_constant=_no_constant)
    except json.JSONDecodeError as error:
        problem = Flaw(str(path), error.lineno, error.colno, "", f"not JSON: {error.msg}")
        raise BadInput((problem,)) from None
    except (ValueError, RecursionError) as error:
        deep = isinstance(error, RecursionError)
        _refuse(path, "nested too deeply" if deep else f"not JSON: {error}")
    return str(data.get("schema", ""))[:80] if isinstance(data, dict) else ""


def _no_constant(name: str) -> NoReturn:
    raise ValueError(f"{name} is no number of JSON")


def _refuse(
    path: Path, message: str, where: str = "", expected: str = "", found: str = ""
) -> NoReturn:
    raise BadInput((Flaw(str(path), 1, 1, where, message, expected, found),)) from None
