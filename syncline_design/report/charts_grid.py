"""Simulation against the Syncline, over a grid of timestamp errors."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.report import axes as scales
from syncline_design.report import numbers
from syncline_design.report.charts import WIDTH
from syncline_design.report.palette import LINE, MUTED, SERIES, SURFACE
from syncline_design.report.svg import InlineChart, draw, tell

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@dataclass(frozen=True, slots=True)
class GridPoint:
    """Worst simulated error and Syncline at one timestamp error."""

    tau_s: float
    worst_m: float
    syncline_m: float


def simulated_against_syncline(
    points: Sequence[GridPoint],
    limit: numbers.Limited | None = None,
    name: str = "fig-grid",
    title: str | None = None,
) -> InlineChart:
    """Worst case of the simulator over a grid of tau, beside the Syncline, and their ratio.

    limit: of accuracy, in whose unit errors are told.
    """
    shown = [p for p in points if p.tau_s > 0 and p.worst_m > 0 and p.syncline_m > 0]
    ratios = [p.worst_m / p.syncline_m for p in shown]

    def build(figure: Figure) -> None:
        upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=[3, 1])
        for axes in (upper, lower):
            axes.spines[["top", "right"]].set_visible(False)
            axes.set_xscale("log")
        _accuracies(upper, shown)
        inverse = [1.0 / p.tau_s for p in shown]
        lower.axhline(1.0, color=MUTED, linewidth=1)
        for point, ratio in zip(shown, ratios, strict=True):
            says = [("\u03c4", numbers.time(point.tau_s)),
                    ("Simulated worst case", numbers.error(point.worst_m, limit)),
                    ("Syncline", numbers.error(point.syncline_m, limit)),
                    ("Ratio", numbers.percent(ratio))]  # fmt: skip
            tell(upper, 1.0 / point.tau_s, 1.0 / point.worst_m, says)
        lower.plot(inverse, ratios, color=SERIES[1], marker="o", markersize=3.5, linewidth=1)
        lower.set_ylabel("ratio")
        lower.set_xlabel("synchronisation accuracy 1/\u03c4 [1/s]")
        low, high = upper.get_xlim()
        scales.set_ticks(lower, "x", scales.decades(low, high), scales.power_of_ten)
        for axes in (upper, lower):
            scales.grid(axes)

    spoken = "No point to show."
    if ratios:
        spoken = (
            f"{len(ratios)} timestamp errors from {numbers.time(min(p.tau_s for p in shown))} to "
            f"{numbers.time(max(p.tau_s for p in shown))}: the simulated worst case is "
            f"{numbers.percent(min(ratios))} to {numbers.percent(max(ratios))} of the Syncline."
        )
    heading = title or "Simulated worst case against the Syncline"
    return draw(name, heading, spoken, (WIDTH, 360.0), build)


def _accuracies(axes: Axes, shown: Sequence[GridPoint]) -> None:
    """Syncline and simulated worst cases, as accuracy over synchronisation accuracy."""
    inverse = [1.0 / p.tau_s for p in shown]
    axes.set_yscale("log")
    axes.plot(inverse, [1.0 / p.syncline_m for p in shown], color=LINE, linewidth=2.2,
              label="Syncline")  # fmt: skip
    axes.plot(inverse, [1.0 / p.worst_m for p in shown], color=SERIES[1], linestyle="none",
              marker="o", markersize=5, markeredgecolor=SURFACE,
              label="simulated worst case")  # fmt: skip
    axes.legend(loc="lower right")
    axes.set_ylabel("accuracy 1/error [1/m]")
    low, high = axes.get_ylim()
    scales.set_ticks(axes, "y", scales.log_ticks(low, high), lambda v: numbers.number(v, 6))
    scales.inverse_axis(axes, "x", "timestamp error \u03c4", scales.short_time)
