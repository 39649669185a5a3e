"""Limits of two verdicts side by side: how they read, and which of them a payload would break."""

from __future__ import annotations

from collections.abc import Iterator

from syncline_design.model.figure_text import format_quantity
from syncline_design.model.quantity import Dimension
from syncline_design.verdict.tree import RequirementResult, Verdict

MOST_DIGITS = 17
_DIMENSIONS = {
    "m": Dimension.LENGTH,
    "kg": Dimension.MASS,
    "W": Dimension.POWER,
    "1": Dimension.DIMENSIONLESS,
}


def limit_texts(old: RequirementResult, new: RequirementResult) -> tuple[str, str]:
    """Both limits as the specs write them; else, and where that reads alike, in units, with as
    many digits as tell them apart."""
    if old.limit_written and new.limit_written and old.limit_written != new.limit_written:
        return old.limit_written, new.limit_written
    texts = ("", "")
    for digits in range(4, MOST_DIGITS + 1):
        texts = (_shown(old, digits), _shown(new, digits))
        if texts[0] != texts[1]:
            break
    return texts


def _shown(row: RequirementResult, digits: int) -> str:
    dimension = _DIMENSIONS.get(row.unit, Dimension.MONEY)
    return format_quantity(row.limit, dimension, digits, row.unit)


def beyond(kept: Verdict, other: Verdict) -> Iterator[str]:
    """Requirements that one side's payload keeps at a value above the tighter limit of the other.

    Of a limit that grows with distance only where both sides are for the same one.
    """
    rows = {row.id: row for row in other.requirements}
    for row in kept.requirements:
        there = rows.get(row.id)
        if there is None or row.value is None or row.status != "pass":
            continue
        about = (row.kind, row.unit, row.quantile, row.axis, row.at_distance_m)
        same = (there.kind, there.unit, there.quantile, there.axis, there.at_distance_m)
        if about == same and there.limit < row.value <= row.limit:
            yield row.id
