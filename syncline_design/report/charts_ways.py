"""Maps: ways from above, and where along a trajectory the simulated errors are large."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from syncline_design.report import axes as scales
from syncline_design.report import numbers
from syncline_design.report.charts import WIDTH
from syncline_design.report.palette import BAD, INK, MUTED, SERIES, SURFACE
from syncline_design.report.svg import InlineChart, add_axes, draw, tell

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from syncline_design.simulation.results import Along, FlownStretch

LOWEST, HIGHEST, LABELS = 130.0, 340.0, 90.0  # of a map's height [SVG units]
LEAST, MOST = 2.5, 9.0  # diameters of the smallest and the largest error [SVG units]


def breadth(values: Sequence[float]) -> float:
    """From the smallest to the largest."""
    return max(values) - min(values) if values else 0.0


def map_height(north_m: Sequence[float], east_m: Sequence[float]) -> float:
    """Height of a map that is as wide as any figure, with room for its labels [SVG units]."""
    shape = breadth(north_m) / max(breadth(east_m), 1e-9)
    return min(max(WIDTH * shape, LOWEST), HIGHEST) + LABELS


def from_above(axes: Axes) -> None:
    """East to the right, north up, both to one scale."""
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("east [m]")
    axes.set_ylabel("north [m]")
    scales.grid(axes)


def errors_along(
    found: Along, limit: numbers.Limited | None, name: str = "fig-along"
) -> InlineChart:  # fmt: skip
    """Every stretch as a circle as wide as its 95 % quantile; the largest named.

    limit: of accuracy; a stretch beyond it is a cross.
    """
    north = [n for way in found.ways for n in way.north_m]
    east = [e for way in found.ways for e in way.east_m]

    def build(figure: Figure) -> None:
        axes = add_axes(figure)
        for place, way in enumerate(found.ways):
            colour = MUTED if len(found.ways) == 1 else SERIES[(place + 1) % len(SERIES)]
            axes.plot(way.east_m, way.north_m, color=colour, alpha=0.6, linewidth=1.2, zorder=1,
                      label=f"way of {way.stage}")  # fmt: skip
        _stretches(axes, found, limit)
        for one in found.stretches:
            tell(axes, one.east_m, one.north_m, _says(one, limit))
        axes.margins(0.12)
        from_above(axes)
        figure.legend(loc="outside upper left", ncols=2, handlelength=1.6)

    title = "Errors along the trajectory"
    size = (WIDTH, map_height(north, east) + 16.0)
    return draw(name, title, spoken(found, limit), size, build)


def _stretches(axes: Axes, found: Along, limit: numbers.Limited | None) -> None:
    largest = found.largest
    for beyond, marker, colour, label in (
        (False, "o", SERIES[0], "95 % of errors"),
        (True, "X", BAD, "beyond the limit"),
    ):
        some = [one for one in found.stretches if is_beyond(one, limit) is beyond]
        for one in some:
            share = one.quantile95_m / max(largest.quantile95_m, 1e-300)
            axes.plot([one.east_m], [one.north_m], marker, color=colour, alpha=0.8,
                      markersize=LEAST + (MOST - LEAST) * share, markeredgecolor=SURFACE,
                      markeredgewidth=0.5, linestyle="none", zorder=3)  # fmt: skip
        if some:
            axes.plot([], [], marker, color=colour, markersize=6, linestyle="none", label=label)
    axes.plot([largest.east_m], [largest.north_m], "o", markerfacecolor="none", color=INK,
              markersize=MOST + 5, markeredgewidth=1.6, linestyle="none", zorder=4,
              label="largest")  # fmt: skip


def is_beyond(one: FlownStretch, limit: numbers.Limited | None) -> bool:
    """Whether 95 % of the errors of a stretch need more than the limit."""
    return limit is not None and one.quantile95_m > limit.limit


def _says(one: FlownStretch, limit: numbers.Limited | None) -> list[tuple[str, str]]:
    return [
        ("Time", numbers.from_to(one.from_s, one.to_s)),
        ("95 % of errors within", numbers.error(one.quantile95_m, limit, 3)),
        ("RMS", numbers.error(one.rms_m, limit, 3)),
        ("Speed", numbers.speed(one.speed_mps, 3)),
        ("Turn rate", numbers.si_quantity(one.turn_rate_radps, "rad/s", 3)),
        *([("Distance", numbers.length(one.distance_m, 3))] if one.distance_m else []),
    ]


def spoken(found: Along, limit: numbers.Limited | None) -> str:
    """How the errors differ from stretch to stretch, and where they are largest."""
    sizes = [one.quantile95_m for one in found.stretches]
    low, high = (numbers.error(end, limit, 3) for end in (min(sizes), max(sizes)))
    largest = numbers.from_to(found.largest.from_s, found.largest.to_s)
    return f"95 % of the errors of a stretch are within {low} to {high}; largest from {largest}"
