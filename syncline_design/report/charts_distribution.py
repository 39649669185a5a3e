"""The distribution of the simulated error, limit and quantiles marked."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.report import axes as scales
from syncline_design.report import numbers
from syncline_design.report.charts import BEYOND, LAX, WIDTH
from syncline_design.report.columns import errors
from syncline_design.report.palette import BAD, INK, SERIES, WARN
from syncline_design.report.svg import InlineChart, add_axes, draw, tell

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LEVEL = 0.075  # of the height of a distribution: what a line of text takes
LETTER = 0.0185  # of its width: what a letter takes


def _span_of(low_m: float, high_m: float, limit: numbers.Limited | None) -> str:
    """`0 mm to 9.93 mm`: nothing at all in the unit of the other end."""
    high = numbers.error(high_m, limit, 3)
    return f"{numbers.error(low_m, limit, 3) if low_m else numbers.like(high, 0.0)} to {high}"


@dataclass(frozen=True, slots=True)
class DensityBars:
    """Density of the simulated error over bins, with marks on the error axis."""

    edges_m: tuple[float, ...]
    density: tuple[float, ...]
    marks: tuple[tuple[str, float], ...]  # (word, error) of the quantiles
    limit: numbers.Limited | None
    syncline_m: float | None


@dataclass(frozen=True, slots=True)
class _Mark:
    """A vertical line and its label."""

    error_m: float
    label: str
    spoken: str
    colour: str


def _marks(data: DensityBars) -> list[_Mark]:
    """The quantiles, the limit, the Syncline; figures to as many digits as one another."""
    named = [(word, value, INK) for word, value in data.marks]
    if data.syncline_m is not None:
        named.append(("Syncline", data.syncline_m, BAD))
    values = [value for _, value, _ in named]
    labels, spoken = errors(values, data.limit, 3), errors(values, data.limit)
    found = [
        _Mark(value, f"{word} {label}", f"{word} at {said}", colour)
        for (word, value, colour), label, said in zip(named, labels, spoken, strict=True)
    ]
    if data.limit is not None:
        words = numbers.limit(data.limit)
        limit = _Mark(data.limit.limit, f"limit {words}", f"limit at {words}", WARN)
        found.insert(len(data.marks), limit)
    return found


def error_histogram(data: DensityBars, name: str = "fig-mc") -> InlineChart:
    """Distribution of the simulated error, limit, Syncline and quantiles marked."""
    marks = _marks(data)

    def build(figure: Figure) -> None:
        axes = add_axes(figure)
        top = max(data.density, default=1.0) or 1.0
        for density, low, high in zip(data.density, data.edges_m, data.edges_m[1:], strict=False):
            tell(axes, (low, high), (0.0, density), [
                ("Error", _span_of(low, high, data.limit)),
                ("Share of samples", numbers.percent(density * (high - low), 3)),
            ])  # fmt: skip
        axes.stairs(data.density, data.edges_m, fill=True, color=SERIES[0], alpha=0.35, zorder=2)
        axes.stairs(data.density, data.edges_m, color=SERIES[0], linewidth=1.4, zorder=3)
        axes.set_ylim(0, top / (0.96 - LEVEL * len(marks)))
        near = [mark for mark in marks if mark.error_m <= LAX * data.edges_m[-1]]
        axes.set_xlim(min(data.edges_m[0], 0.0), _room_for(near, data.edges_m[-1]))
        _vertical_marks(axes, near)
        for mark in [one for one in marks if one not in near]:
            _at_the_edge(axes, mark, len(near))
        _length_axis(axes, data.limit)
        axes.set_yticks([])
        axes.spines["left"].set_visible(False)
        axes.set_xlabel("georeferencing error")

    spoken = "; ".join(mark.spoken for mark in marks)
    return draw(name, "Distribution of the simulated error", spoken, (WIDTH, 205.0), build)


def _room_for(marks: Sequence[_Mark], last: float) -> float:
    """Right end of an axis from 0 on which every mark's label has room to its right."""
    ends = [mark.error_m / (1.0 - LETTER * (len(mark.label) + 1)) for mark in marks]
    return max([1.02 * last, *ends])


def _vertical_marks(axes: Axes, marks: Sequence[_Mark]) -> None:
    """Labelled vertical lines; each label right of its own, above every line further right."""
    top = axes.get_ylim()[1]
    for index, mark in enumerate(sorted(marks, key=lambda one: one.error_m)):
        value, colour = mark.error_m, mark.colour
        level = 0.985 - LEVEL * index
        solid = colour != INK
        axes.plot(
            [value, value], [0, level * top], color=colour, linewidth=1.6 if solid else 1.0,
            linestyle="-" if solid else (0, (3, 2)), zorder=4,
        )  # fmt: skip
        axes.annotate(
            mark.label, (value, level * top), xytext=(4, 1), textcoords="offset points",
            ha="left", va="top", color=colour, zorder=6,
        )  # fmt: skip


def _at_the_edge(axes: Axes, mark: _Mark, below: int) -> None:
    """The label of a line far beyond all that is drawn, below the others' labels."""
    axes.annotate(
        mark.label + BEYOND, (1.0, 0.985 - LEVEL * below), xycoords="axes fraction",
        ha="right", va="top", color=mark.colour, zorder=6,
    )  # fmt: skip


def _length_axis(axes: Axes, limit: numbers.Limited | None) -> None:
    from matplotlib.ticker import MaxNLocator

    low, high = axes.get_xlim()
    places = [float(t) for t in MaxNLocator(5).tick_values(low, high) if low <= t <= high]
    scales.set_ticks(axes, "x", places, scales.error_label(limit))
    scales.grid(axes, "x")
