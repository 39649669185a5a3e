"""The Pareto front of cost against error, and the designs around it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING

from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.report import axes as scales
from syncline_design.report import numbers
from syncline_design.report.charts import BEYOND, LAX, WIDTH
from syncline_design.report.palette import GOOD, LINE, MUTED, SURFACE, WARN
from syncline_design.report.svg import InlineChart, add_axes, draw, tell

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


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
) -> InlineChart:
    """The exact front of cost against error as a staircase, the chosen design on it.

    beside: cost and error of the design that is nearest to what is asked; cloud: other designs;
    over: which figure of the error it is drawn over, where that is not the Syncline's.
    """

    def build(figure: Figure) -> None:
        axes = add_axes(figure)
        costs = [p.cost for p in points]
        near = cost_limit if cost_limit and cost_limit <= LAX * max(costs, default=0.0) else None
        around = scales.in_view(cloud, costs, max(p.error_m for p in points), near)
        _staircase(axes, points, scales.price_axis(costs, near, [p.cost for p in around]), near)
        errors = [*(p.error_m for p in points), *([limit.limit] if limit is not None else [])]
        errors += [p.error_m for p in around]
        _cloud(axes, around)
        _tell_each(axes, points, around, currency, limit)
        if beside is not None:
            errors.append(beside[1])
            _named_mark(axes, *beside, "nearest", WARN)
        axes.set_ylim(min(errors) / 1.5, max(errors) * 1.6)
        _limits(axes, limit, cost_limit, currency)
        low, high = axes.get_ylim()
        scales.set_ticks(axes, "y", scales.log_ticks(low, high), scales.error_label(limit))
        _money_ticks(axes)
        axes.set_xlabel(f"cost [{currency}]")
        axes.set_ylabel("Syncline error" if over == "error" else over)
        scales.grid(axes)
        if axes.get_legend_handles_labels()[1]:
            figure.legend(loc="outside upper left", ncols=2, handlelength=1.6)

    title = f"Pareto front of cost against {over}"
    return draw(name, title, _front_words(points, currency, limit, beside), (WIDTH, 290.0), build)


def _cloud(axes: Axes, shown: Sequence[FrontMark]) -> None:
    """Other designs: a quiet dot each, a cross for those that break another requirement."""
    for marker, size, breaks in (("o", 3.0, False), ("x", 3.0, True)):
        some = [p for p in shown if p.breaks is breaks]
        axes.plot([p.cost for p in some], [p.error_m for p in some], marker, color=MUTED,
                  alpha=0.45, markersize=size, markeredgewidth=0.7 if breaks else 0,
                  linestyle="none", zorder=1)  # fmt: skip


def _tell_each(
    axes: Axes, points: Sequence[FrontMark], around: Sequence[FrontMark], currency: str,
    limit: numbers.Limited | None,
) -> None:  # fmt: skip
    """What stands at every mark; designs that these words do not tell apart are told once."""
    alike = Counter(tuple(_says(one, currency, limit)) for one in around)
    placed: dict[tuple[tuple[str, str], ...], FrontMark] = {}
    for one in (*points, *around):
        placed.setdefault(tuple(_says(one, currency, limit)), one)
    for says, one in placed.items():
        count = alike[says]
        more = [("Alike", f"{count}, which differ in signal or clock")] if count > 1 else []
        tell(axes, one.cost, one.error_m, [*says, *more])


def _says(point: FrontMark, currency: str, limit: numbers.Limited | None) -> list[tuple[str, str]]:
    named = [("Design", point.words)] if point.words else []
    return [*named, ("Price", numbers.money(point.cost, currency)),
            ("Error", numbers.error(point.error_m, limit))]  # fmt: skip


def _staircase(
    axes: Axes, points: Sequence[FrontMark], ends: tuple[float, float], most: float | None
) -> None:
    """The front, as far as prices may go; most: the limit on cost, where it is in view."""
    costs = [p.cost for p in points]
    errors = [p.error_m for p in points]
    left, right = ends
    axes.set_yscale("log")
    last = right if most is None else max(most, costs[-1])
    axes.step([*costs, last], [*errors, errors[-1]], where="post", color=LINE, linewidth=2,
              label="front")  # fmt: skip
    axes.plot(costs, errors, "o", color=LINE, markersize=5, markeredgecolor=SURFACE)
    for point in points:
        if point.chosen:
            _named_mark(axes, point.cost, point.error_m, "chosen", GOOD)
    axes.set_xlim(left, right)


def _named_mark(axes: Axes, cost: float, error_m: float, words: str, color: str) -> None:
    axes.plot([cost], [error_m], "D", color=color, markersize=10, markeredgecolor=SURFACE,
              markeredgewidth=1.4, zorder=5, linestyle="none", label=words)  # fmt: skip


def _front_words(
    points: Sequence[FrontMark],
    currency: str,
    limit: numbers.Limited | None,
    beside: tuple[float, float] | None,
) -> str:
    (cost, error), (last_cost, last_error) = (
        (numbers.money(one.cost, currency), numbers.error(one.error_m, limit))
        for one in (points[0], points[-1])
    )
    spoken = (
        f"{len(points)} designs from {cost} with an error of {error} to {last_cost} with "
        f"{last_error}."
    )
    for point in points:
        if point.chosen:
            error = numbers.error(point.error_m, limit)
            spoken += f" Chosen: {numbers.money(point.cost, currency)}, {error}."
    if beside is not None:
        error = numbers.error(beside[1], limit)
        spoken += f" Nearest: {numbers.money(beside[0], currency)}, {error}."
    return spoken


def _limits(
    axes: Axes, limit: numbers.Limited | None, cost_limit: float | None, currency: str
) -> None:
    if limit is not None:
        axes.axhline(limit.limit, color=WARN, linewidth=1.6,
                     label=f"limit {numbers.limit(limit)}")  # fmt: skip
    if cost_limit:
        beyond = BEYOND if cost_limit > axes.get_xlim()[1] else ""
        axes.axvline(cost_limit, color=WARN, linewidth=1.6, linestyle=(0, (5, 3)),
                     label=f"limit {numbers.money(cost_limit, currency)}{beyond}")  # fmt: skip


def _money_ticks(axes: Axes) -> None:
    from matplotlib.ticker import MaxNLocator

    low, high = axes.get_xlim()
    places = [float(t) for t in MaxNLocator(4).tick_values(low, high) if low <= t <= high]
    scales.set_ticks(axes, "x", places, numbers.count)
