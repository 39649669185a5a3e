"""Lines that are bound each to all before it by their hashes (SHA-256)."""

from __future__ import annotations

import hashlib
import json
from typing import Any, Final

from syncline_design.machine.records import json_of

START: Final = "0" * 64


def line_of(previous: str, body: dict[str, Any]) -> tuple[bytes, str]:
    """A line that follows the one of a hash, and its own hash."""
    plain = json.loads(canonical(json_of(body)))
    own = digest(previous, plain)
    return canonical({"previous": previous, "sha256": own, "body": plain}, sort=False).encode(
        "ascii"
    ) + b"\n", own


def canonical(value: Any, *, sort: bool = True) -> str:
    """JSON in one way only."""
    return json.dumps(value, sort_keys=sort, separators=(",", ":"), allow_nan=False)


def digest(previous: str, body: Any) -> str:
    """Hash of a line: of the hash of the one before, and of its body in one way only."""
    return hashlib.sha256((previous + canonical(body)).encode("ascii")).hexdigest()
