"""One value for a figure of the error that a requirement limits and the budget states as well.

Both look for the worst situation, from other starting points; what either finds is a situation that
the spec allows, so the larger value is the figure as far as it is known.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from syncline_design.simulation.figures import WANTED
from syncline_design.simulation.statistical import Wanted
from syncline_design.spec.case import Case
from syncline_design.spec.requirement import STATED_KINDS
from syncline_design.verdict.stated import Certified, wanted_of
from syncline_design.verdict.tree import ErrorFigures, RequirementResult, settled

_ONE_FIGURE = 1e-2  # relative; what lies farther apart is not the same figure (two distances)


def agreed(
    case: Case, rows: Sequence[RequirementResult], figures: ErrorFigures
) -> tuple[tuple[RequirementResult, ...], ErrorFigures]:
    """Requirements and figures with the larger of both values where they state the same figure."""
    names: dict[Wanted | Certified, str] = {wanted: name for name, wanted in WANTED.items()}
    limited = {one.id: one for one in case.spec.requirements if one.kind in STATED_KINDS}
    found = []
    for row in rows:
        name = names.get(wanted_of(limited[row.id])) if row.id in limited else None
        stated = None if name is None else _stated(figures, name)
        if name is None or stated is None or row.value is None or not _near(stated, row.value):
            found.append(row)
            continue
        largest = max(stated, row.value)
        figures = _with(figures, name, largest)
        found.append(_with_value(row, largest))
    return tuple(found), figures


def _near(one: float, other: float) -> bool:
    return abs(one - other) <= _ONE_FIGURE * max(one, other)


def _stated(figures: ErrorFigures, name: str) -> float | None:
    match name:
        case "thu95_m":
            return figures.thu95_m
        case "tvu95_m":
            return figures.tvu95_m
        case "quantile95_3d_m":
            return figures.quantile95_3d_m
        case axis:
            return (figures.rmse_m or {}).get(axis)


def _with(figures: ErrorFigures, name: str, value: float) -> ErrorFigures:
    match name:
        case "thu95_m":
            return replace(figures, thu95_m=value)
        case "tvu95_m":
            return replace(figures, tvu95_m=value)
        case "quantile95_3d_m":
            return replace(figures, quantile95_3d_m=value)
        case axis:
            return replace(figures, rmse_m={**(figures.rmse_m or {}), axis: value})


def _with_value(row: RequirementResult, value: float) -> RequirementResult:
    """A requirement at a value that is at least its own: one above the limit is a miss."""
    if value == row.value:
        return row
    status = "fail" if row.status == "pass" and value > row.limit else row.status
    return replace(settled(row, status, value), note=row.note)
