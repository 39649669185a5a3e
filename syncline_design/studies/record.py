"""Whether a case's record hangs together: its verdict has to follow from its own requirements."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

Json = dict[str, Any]
_WORDS = ("meets", "fails", "infeasible", "refused", "indeterminate")
_STATUSES = ("pass", "fail", "indeterminate")
_ROUNDING = 1e-9  # of a printed figure against the exact one that was decided


def is_believable(record: Json) -> bool:
    """Whether a record has the shape of one and its verdict follows from what it says."""
    word, requirements = record.get("verdict"), record.get("requirements", [])
    if word not in _WORDS or not isinstance(requirements, list):
        return False
    if not all(_is_requirement(item) for item in requirements):
        return False
    if not all(isinstance(record.get(key) or {}, dict) for key in ("design", "syncline")):
        return False
    if not all(isinstance(record.get(key) or [], list) for key in ("front", "problems")):
        return False
    return word != "meets" or (bool(requirements) and _follows(requirements))


def _is_requirement(item: Any) -> bool:
    if not isinstance(item, dict) or item.get("status") not in _STATUSES:
        return False
    figures = (item.get("value"), item.get("limit"))
    return isinstance(item.get("id"), str) and all(_is_figure(figure) for figure in figures)


def _is_figure(value: Any) -> bool:
    if value is None:
        return True
    number = isinstance(value, int | float) and not isinstance(value, bool)
    return number and math.isfinite(value)


def _follows(requirements: Iterable[Json]) -> bool:
    """Whether a system with these requirements meets them: each passes, or is waived."""
    return all(_holds(item) for item in requirements)


def _holds(item: Json) -> bool:
    waiver = item.get("waiver")
    if item["status"] == "fail":
        return isinstance(waiver, dict) and waiver.get("expired") is False
    value, limit = item.get("value"), item.get("limit")
    if value is None or limit is None:
        return bool(item["status"] == "pass")
    room = _ROUNDING * max(abs(value), abs(limit))
    return bool(item["status"] == "pass" and value <= limit + room)
