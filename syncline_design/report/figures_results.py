"""Figures of computed results: Monte Carlo, simulation against the Syncline, Pareto front."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.report import axes as scales
from syncline_design.report import numbers
from syncline_design.report.figures import WIDTH
from syncline_design.report.palette import BAD, GOOD, INK, LINE, MUTED, SERIES, SURFACE, WARN
from syncline_design.report.svg import InlineFigure, add_axes, draw, tell

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


FAR = 8.0  # times the largest error of a front: beyond it no other design is drawn
LEVEL = 0.075  # of the height of a distribution: what a line of text takes
LETTER = 0.0185  # of its width: what a letter takes


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
    found = [_mark(word, value, INK, data.limit) for word, value in data.marks]
    if data.limit is not None:
        words = numbers.limit(data.limit)
        found.append(_Mark(data.limit.limit, f"limit {words}", f"limit at {words}", WARN))
    if data.syncline_m is not None:
        found.append(_mark("Syncline", data.syncline_m, BAD, data.limit))
    return found


def _mark(word: str, value_m: float, colour: str, limit: numbers.Limited | None) -> _Mark:
    label, spoken = numbers.error(value_m, limit, 3), numbers.error(value_m, limit)
    return _Mark(value_m, f"{word} {label}", f"{word} at {spoken}", colour)


def error_histogram(data: DensityBars, name: str = "fig-mc") -> InlineFigure:
    """Distribution of the simulated error, limit, Syncline and quantiles marked."""
    marks = _marks(data)

    def build(figure: Figure) -> None:
        axes = add_axes(figure)
        top = max(data.density, default=1.0) or 1.0
        for density, low, high in zip(data.density, data.edges_m, data.edges_m[1:], strict=False):
            tell(axes, (low, high), (0.0, density), [
                ("Error", f"{numbers.length(low, 3)} to {numbers.length(high, 3)}"),
                ("Share of samples", numbers.percent(density * (high - low), 3)),
            ])  # fmt: skip
        axes.stairs(data.density, data.edges_m, fill=True, color=SERIES[0], alpha=0.35, zorder=2)
        axes.stairs(data.density, data.edges_m, color=SERIES[0], linewidth=1.4, zorder=3)
        axes.set_ylim(0, top / (0.96 - LEVEL * len(marks)))
        axes.set_xlim(min(data.edges_m[0], 0.0), _room_for(marks, data.edges_m[-1]))
        _vertical_marks(axes, marks)
        _plain_length_axis(axes)
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


def _plain_length_axis(axes: Axes) -> None:
    from matplotlib.ticker import MaxNLocator

    low, high = axes.get_xlim()
    places = [float(t) for t in MaxNLocator(5).tick_values(low, high) if low <= t <= high]
    scales.set_ticks(axes, "x", places, lambda v: "0" if v == 0 else scales.short_length(v))
    scales.grid(axes, "x")


@dataclass(frozen=True, slots=True)
class GridPoint:
    """Worst simulated error and Syncline at one timestamp error."""

    tau_s: float
    worst_m: float
    syncline_m: float


def simulated_against_syncline(
    points: Sequence[GridPoint], name: str = "fig-grid", title: str | None = None
) -> InlineFigure:
    """Worst case of the simulator over a grid of tau, beside the Syncline, and their ratio."""
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
                    ("Simulated worst case", numbers.length(point.worst_m)),
                    ("Syncline", numbers.length(point.syncline_m)),
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


@dataclass(frozen=True, slots=True)
class FrontMark:
    """One design; words: its sensors and how each is stamped, where known.

    breaks: whether it breaks a requirement other than accuracy.
    """

    cost: float
    error_m: float
    chosen: bool
    words: str = ""
    breaks: bool = False


def pareto_front(
    points: Sequence[FrontMark],
    currency: str,
    limit: numbers.Limited | None,
    cost_limit: float | None,
    name: str = "fig-front",
    beside: tuple[float, float] | None = None,
    cloud: Sequence[FrontMark] = (),
    over: str = "error",
) -> InlineFigure:
    """The exact front of cost against error as a staircase, the chosen design on it.

    beside: cost and error of the design that is nearest to what is asked; cloud: other designs;
    over: which figure of the error it is drawn over, where that is not the Syncline's.
    """

    def build(figure: Figure) -> None:
        axes = add_axes(figure)
        _staircase(axes, points, cost_limit)
        for point in points:
            tell(axes, point.cost, point.error_m, _says(point, currency))
        errors = [*(p.error_m for p in points), *([limit.limit] if limit is not None else [])]
        around = _near(cloud, points, axes.get_xlim()[1])
        errors += [p.error_m for p in around]
        _cloud(axes, around, currency)
        if beside is not None:
            errors.append(beside[1])
            _named_mark(axes, *beside, "nearest", WARN)
        axes.set_ylim(min(errors) / 1.5, max(errors) * 1.6)
        _limits(axes, limit, cost_limit, currency)
        low, high = axes.get_ylim()
        scales.set_ticks(axes, "y", scales.log_ticks(low, high), scales.short_length)
        _money_ticks(axes)
        axes.set_xlabel(f"cost [{currency}]")
        axes.set_ylabel("Syncline error" if over == "error" else over)
        scales.grid(axes)
        if axes.get_legend_handles_labels()[1]:
            figure.legend(loc="outside upper left", ncols=2, handlelength=1.6)

    title = f"Pareto front of cost against {over}"
    return draw(name, title, _front_words(points, currency, beside), (WIDTH, 290.0), build)


def _near(
    cloud: Sequence[FrontMark], front: Sequence[FrontMark], most: float
) -> list[FrontMark]:  # fmt: skip
    """Designs whose price has a place on the axis and whose error is not far from the front's."""
    far = FAR * max(p.error_m for p in front)
    return [p for p in cloud if p.cost <= most and p.error_m <= far]


def _cloud(axes: Axes, shown: Sequence[FrontMark], currency: str) -> None:
    """Other designs: a quiet dot each, a cross for those that break another requirement."""
    for marker, size, breaks in (("o", 3.0, False), ("x", 3.0, True)):
        some = [p for p in shown if p.breaks is breaks]
        axes.plot([p.cost for p in some], [p.error_m for p in some], marker, color=MUTED,
                  alpha=0.45, markersize=size, markeredgewidth=0.7 if breaks else 0,
                  linestyle="none", zorder=1)  # fmt: skip
    for point in shown:
        tell(axes, point.cost, point.error_m, _says(point, currency))


def _says(point: FrontMark, currency: str) -> list[tuple[str, str]]:
    named = [("Design", point.words)] if point.words else []
    return [*named, ("Price", numbers.money(point.cost, currency)),
            ("Error", numbers.length(point.error_m))]  # fmt: skip


def _staircase(axes: Axes, points: Sequence[FrontMark], cost_limit: float | None) -> None:
    costs = [p.cost for p in points]
    errors = [p.error_m for p in points]
    span = max(costs) - min(costs) or max(costs) or 1.0
    right = max([max(costs) + 0.15 * span, *([1.04 * cost_limit] if cost_limit else [])])
    axes.set_yscale("log")
    axes.step([*costs, right], [*errors, errors[-1]], where="post", color=LINE, linewidth=2)
    axes.plot(costs, errors, "o", color=LINE, markersize=5, markeredgecolor=SURFACE)
    for point in points:
        if point.chosen:
            _named_mark(axes, point.cost, point.error_m, "chosen", GOOD)
    axes.set_xlim(max(0.0, min(costs) - 0.12 * span), right)


def _named_mark(axes: Axes, cost: float, error_m: float, words: str, color: str) -> None:
    axes.plot([cost], [error_m], "D", color=color, markersize=10, markeredgecolor=SURFACE,
              markeredgewidth=1.4, zorder=5, linestyle="none", label=words)  # fmt: skip


def _front_words(
    points: Sequence[FrontMark], currency: str, beside: tuple[float, float] | None = None
) -> str:
    spoken = (
        f"{len(points)} designs from {numbers.money(points[0].cost, currency)} with an error of "
        f"{numbers.length(points[0].error_m)} to {numbers.money(points[-1].cost, currency)} with "
        f"{numbers.length(points[-1].error_m)}."
    )
    for point in points:
        if point.chosen:
            spoken += (
                f" Chosen: {numbers.money(point.cost, currency)}, {numbers.length(point.error_m)}."
            )
    if beside is not None:
        spoken += f" Nearest: {numbers.money(beside[0], currency)}, {numbers.length(beside[1])}."
    return spoken


def _limits(
    axes: Axes, limit: numbers.Limited | None, cost_limit: float | None, currency: str
) -> None:
    if limit is not None:
        axes.axhline(limit.limit, color=WARN, linewidth=1.6,
                     label=f"limit {numbers.limit(limit)}")  # fmt: skip
    if cost_limit:
        axes.axvline(cost_limit, color=WARN, linewidth=1.6, linestyle=(0, (5, 3)),
                     label=f"limit {numbers.money(cost_limit, currency)}")  # fmt: skip


def _money_ticks(axes: Axes) -> None:
    from matplotlib.ticker import MaxNLocator

    low, high = axes.get_xlim()
    places = [float(t) for t in MaxNLocator(4).tick_values(low, high) if low <= t <= high]
    scales.set_ticks(axes, "x", places, numbers.count)
