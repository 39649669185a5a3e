"""Several Synclines in one plot, as in the paper's figures 1 to 7."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.report import axes as scales
from syncline_design.report import numbers
from syncline_design.report.charts import WIDTH
from syncline_design.report.palette import INK, MUTED, SERIES, SURFACE
from syncline_design.report.svg import InlineChart, add_axes, draw, tell
from syncline_design.report.text import shortened

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_DASHES = ("-", (0, (6, 2)), (0, (2, 1.5)), (0, (6, 2, 1.5, 2)))  # told apart without colour
_LONGEST = 36  # characters of a label that a legend holds


@dataclass(frozen=True, slots=True)
class LabelledCurve:
    """One Syncline: its label, roof error, tau_crit and error over tau."""

    label: str
    roof_m: float
    tau_crit_s: float | None
    tau_s: tuple[float, ...]
    error_m: tuple[float, ...]


def synclines(
    curves: Sequence[LabelledCurve],
    simulated: Sequence[tuple[float, float]],
    name: str,
    title: str,
) -> InlineChart:
    """Accuracy against synchronisation accuracy of several systems.

    simulated: (tau [s], worst case [m]) points drawn beside the first curve.
    """

    def build(figure: Figure) -> Axes:
        axes = add_axes(figure)
        axes.set_xscale("log")
        axes.set_yscale("log")
        for index, (curve, letter) in enumerate(zip(curves, letters(curves), strict=True)):
            _curve(axes, curve, index, letter or shortened(curve.label, _LONGEST))
        if simulated:
            axes.plot(
                [1.0 / tau for tau, _ in simulated], [1.0 / error for _, error in simulated],
                linestyle="none", marker="o", markersize=5.5, color=SERIES[1],
                markeredgecolor=SURFACE, label="simulated worst case", zorder=4,
            )  # fmt: skip
        taus = [tau for curve in curves for tau in curve.tau_s]
        errors = [error for curve in curves for error in curve.error_m]
        axes.set_xlim(1.0 / max(taus), 1.0 / min(taus))
        axes.set_ylim(0.8 / max(errors), 2.2 / min(errors))
        _ticks(axes)
        axes.legend(loc="lower right", handlelength=3.2)
        return axes

    return draw(name, title, _spoken(curves, simulated), (WIDTH, 300.0), build)


def letters(curves: Sequence[LabelledCurve]) -> list[str]:
    """A letter for each curve where their labels are too long for a legend; else none."""
    if len(curves) < 2 or max(len(curve.label) for curve in curves) <= _LONGEST:
        return [""] * len(curves)
    return [chr(ord("A") + index % 26) for index in range(len(curves))]


def _curve(axes: Axes, curve: LabelledCurve, index: int, legend: str) -> None:
    colour = SERIES[index % len(SERIES)]
    axes.plot(
        [1.0 / tau for tau in curve.tau_s], [1.0 / error for error in curve.error_m],
        color=colour, linewidth=2.2, linestyle=_DASHES[index % len(_DASHES)],
        label=legend, zorder=3,
    )  # fmt: skip
    if curve.tau_crit_s:
        place = (1.0 / curve.tau_crit_s, 1.0 / (2.0 * curve.roof_m))
        tell(axes, *place, [
            ("System", curve.label), ("\u03c4_crit", numbers.time(curve.tau_crit_s)),
            ("Roof", numbers.length(curve.roof_m)),
        ])  # fmt: skip
        axes.plot(*place, marker="|", markersize=13, markeredgewidth=2, color=colour, zorder=4)


def _ticks(axes: Axes) -> None:
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    scales.set_ticks(axes, "x", scales.decades(left, right), scales.power_of_ten)
    scales.set_ticks(axes, "y", scales.log_ticks(bottom, top), lambda v: numbers.number(v, 6))
    axes.set_xlabel("synchronisation accuracy 1/\u03c4 [1/s]", color=INK)
    axes.set_ylabel("accuracy 1/error [1/m]", color=INK)
    scales.grid(axes)
    scales.inverse_axis(axes, "x", "timestamp error \u03c4", scales.short_time)
    scales.inverse_axis(axes, "y", "Syncline error", scales.short_length)
    axes.tick_params(colors=MUTED, labelcolor=INK)


def _spoken(curves: Sequence[LabelledCurve], simulated: Sequence[tuple[float, float]]) -> str:
    parts = [
        f"{curve.label}: roof at {numbers.length(curve.roof_m)}, tau_crit "
        f"{numbers.time_limit(curve.tau_crit_s)}"
        for curve in curves
    ]
    if simulated:
        parts.append(f"{len(simulated)} simulated worst cases beside it")
    return "; ".join(parts) + "."
