"""How a log is refused: file, line, column, what was expected, what was found, what to do."""

from __future__ import annotations

from pathlib import Path

from syncline_design.spec.load import BadInput
from syncline_design.spec.yaml_text import Flaw


def refuse(
    path: Path,
    message: str,
    *,
    line: int = 0,
    column: int = 0,
    field: str = "",
    expected: str = "",
    found: str = "",
    hint: str = "",
) -> BadInput:
    """The error for a log that cannot be read."""
    problem = Flaw(str(path), line, column, field, message, expected, found, hint)
    return BadInput((problem,))
