"""JSON as every reader takes it: ASCII, no NaN, a final newline, the same bytes every time."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

from syncline_design.verdict.tree import SEVERAL_SCHEMA, Checked, Verdicts


def json_text(data: Any) -> str:
    """Indented JSON; what is infinite or not a number becomes null, as the schemas say."""
    return json.dumps(_finite(data), indent=2, ensure_ascii=True, allow_nan=False) + "\n"


def _finite(value: Any) -> Any:
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(key): _finite(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(entry) for entry in value]
    return value


def verdicts_json(verdicts: Sequence[Checked]) -> str:
    """One verdict as it is; several under `verdicts`."""
    found = verdicts[0] if len(verdicts) == 1 else Verdicts(SEVERAL_SCHEMA, tuple(verdicts))
    return json_text(found.to_json())
