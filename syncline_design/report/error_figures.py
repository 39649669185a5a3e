"""The figures of a design side by side: Syncline, certified worst case, statistical budget."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Final

from syncline_design.report import numbers, verdict_charts
from syncline_design.report.document import Group, Node, Span, Text, code, show
from syncline_design.report.table import Cell, Table, table

if TYPE_CHECKING:
    from syncline_design.simulation.figures import MissionFigures, StageSituation
    from syncline_design.verdict.tree import ErrorFigures, Verdict

Row = tuple[str, float | None, float | None, str]  # name, over missions, one mission, what it is
SHOWN_SHARE = 0.001
LEAD: Final[tuple[str | Span, ...]] = (
    "Three figures that claim three things. Each holds for the worst situation that the spec "
    "allows: directions of motion, rotation and look, lean up to the horizon's tilt, time and "
    "place; where no ",
    code("look"),
    " is given, level looks count too. The Monte Carlo below draws directions at random and is "
    "therefore lower.",
)


def error_figures(verdict: Verdict) -> list[Node]:
    """The figures, and what makes the quantiles large."""
    found = verdict.figures
    if found is None or found.worst_case_m is None:
        return []
    limit = verdict_charts.tightest_limit(verdict, "accuracy")
    return [
        Text((*LEAD, verdict_charts.of_mission(verdict))),
        *show(_figures(found, limit), silent=True),
        *_makers(found),
        *(Text(text, quiet=True) for text in _situation(found)),
    ]  # fmt: skip


def _makers(found: ErrorFigures) -> list[Node]:
    """What makes the statistical figures, folded away."""
    if not found.worst_at:
        return []
    shown = tuple(show(_shares(found)))
    return [Group(shown, "fold", summary="What makes them, where they are worst", reach="page")]


def _figures(found: ErrorFigures, limit: numbers.Limited | None) -> Table:
    rows = [
        (
            Cell(name),
            _against(over, limit),
            _cell(one, limit),
            says,
        )
        for name, over, one, says in _rows(found)
        if over is not None
    ]
    heads = ("Figure", "Over missions #", "One mission #", "What it says")
    return table("Error figures", heads, rows)


def _cell(value: float | None, limit: numbers.Limited | None) -> Cell:
    """A figure, in the unit of the accuracy limit where there is one."""
    if value is None:
        return Cell(numbers.MISSING)
    return Cell(numbers.error(value, limit), value)


def _against(value: float | None, limit: numbers.Limited | None) -> Cell:
    """The same, marked where it exceeds that limit."""
    cell = _cell(value, limit)
    above = value is not None and limit is not None and not value <= limit.limit
    return replace(cell, tone="warn", mark="!") if above else cell


def _rows(found: ErrorFigures) -> Iterator[Row]:
    k = numbers.number(found.worst_case_k or 0.0)
    yield "Syncline error", found.syncline_m, None, (
        "sum of one-sigma sensor terms and the timing bound (the paper's); no worst case, no "
        "quantile"
    )  # fmt: skip
    yield "Certified worst case, sensors at 1 \u03c3", found.worst_case_1sigma_m, None, (
        "nothing exceeds it while sensors stay within one \u03c3 and stamps within their bounds"
    )  # fmt: skip
    yield f"Certified worst case, sensors at {k} \u03c3", found.worst_case_m, None, (
        f"the same, sensors within {k} \u03c3"
    )  # fmt: skip
    one = found.one_mission
    yield "95 % of 3D errors", found.quantile95_3d_m, _of(one, "quantile95_3d_m"), (
        "95 % of the errors are shorter"
    )  # fmt: skip
    yield "95 % horizontal (THU)", found.thu95_m, _of(one, "thu95_m"), "95 % are within, level"
    yield "95 % vertical (TVU)", found.tvu95_m, _of(one, "tvu95_m"), "95 % are within, up and down"
    for axis, value in (found.rmse_m or {}).items():
        held = None if one is None else one.rmse_m.get(axis)
        yield f"RMS {axis if axis != '3d' else '3D'}", value, held, "root mean square"


def _of(found: MissionFigures | None, key: str) -> float | None:
    return None if found is None else float(getattr(found, key))


def _shares(found: ErrorFigures) -> Table:
    """Parts of the mean square, source by source, where each quantile is largest."""
    columns = {"quantile95_3d_m": "3D #", "thu95_m": "Horizontal #", "tvu95_m": "Vertical #"}
    parts = {
        one.figure: {share.source: share.share for share in one.shares}
        for one in found.worst_at or ()
        if one.figure in columns
    }
    sources = dict.fromkeys(source for shares in parts.values() for source in shares)
    rows: list[tuple[Cell | str, ...]] = [
        (source, *(_share(parts[figure].get(source, 0.0)) for figure in columns if figure in parts))
        for source in sources
        if max(shares.get(source, 0.0) for shares in parts.values()) >= SHOWN_SHARE
    ]
    note = "Noise and timestamps to first order; sources below 0.1 % are left out."
    return table("Share of the mean square error", ("Source", *columns.values()), rows, note)


def _share(value: float) -> Cell:
    return Cell(numbers.percent(value) if value >= SHOWN_SHARE else numbers.MISSING, value)


def _situation(found: ErrorFigures) -> Iterator[str]:
    """Where the 3D quantile is largest, in words."""
    for one in found.worst_at or ():
        if one.figure == "quantile95_3d_m":
            told = "; ".join(_stage(stage) for stage in one.stages)
            yield f"The 3D quantile is largest where {told}."


def _stage(stage: StageSituation) -> str:
    tilt = math.acos(min(1.0, math.cos(stage.roll_rad) * math.cos(stage.pitch_rad)))
    look = ""
    if stage.look is not None:
        x, y, z = stage.look
        azimuth = numbers.angle(math.atan2(y, x))
        look = f" and looks at azimuth {azimuth}, elevation {numbers.angle(-math.asin(z))}"
    away = "" if stage.distance_m is None else f" at {numbers.length(stage.distance_m)}"
    return f"{stage.stage} leans by {numbers.angle(tilt)}{look} (body axes){away}"
