"""Charts of a study: least cost over two factors, fronts side by side, a sampled study.

A cost is shown by the strength of one colour over the page's surface: the dearer, the stronger,
which holds on a light and on a dark page alike.  A scale beside the cells says what is what.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal

from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.report import axes as scales
from syncline_design.report import numbers
from syncline_design.report.charts import WIDTH
from syncline_design.report.charts_cells import MOST_BESIDE, CellLook, draw_cells, explain_cells
from syncline_design.report.palette import BAD, GRID, INK, MUTED, SERIES, SURFACE, WARN
from syncline_design.report.study_words import (
    COMBINED,
    UNPRICED,
    WAIVED_SIGN,
    cell_word,
    rounded,
    short_key,
)
from syncline_design.report.svg import InlineChart, add_axes, draw, tell
from syncline_design.report.text import shortened
from syncline_design.report.words import BRIEF
from syncline_design.studies.record import CasePoint
from syncline_design.studies.scatter import Scatter, ScatterAxis, ScatterPoint
from syncline_design.studies.summary import CellWord, HeatMap

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Says = Sequence[Sequence[tuple[str, str]]]  # of every point: labels and values
CELL = (0.08, 0.5)  # opacity of the cheapest and of the dearest cell: text stays readable
MARK = (0.2, 0.9)  # of marks, in which nothing is written: the cheapest is seen to be filled
MOST_PATCHES = 5  # of a scale of prices
_UNPRICED = {
    "none": "no case is known to meet",
    "undecided": "not known: a case got no verdict",
    "refused": COMBINED,
}
_WAIVED = ", with a waived requirement missed"
MOST_LABEL = 44  # characters of a front's in a legend
MOST_TEXT = 8  # cells across in which the cost itself still fits
MOST_SIGNS = 24  # cells across, and rows, in which a sign still fits: a map of more is a fine one
PATCH = 24.0  # of the scale, with what is around it [SVG units]
ACROSS = 262.0  # all cells, beside the labels of the rows [SVG units]


def cost_map(heat: HeatMap, name: str = "fig-heat") -> InlineChart:
    """Heat map of the least cost over two factors; a cross, or a hatch, where no case meets."""
    costs = [cost for row in heat.least_cost for cost in row if cost is not None]
    across = len(heat.x_values)
    whole = _room(costs) <= ACROSS / across or across > MOST_TEXT
    fine = is_fine(heat)
    ends = _ends(costs)

    def build(figure: Figure) -> None:
        axes = add_axes(figure)
        looks: dict[CellLook, list[tuple[int, int]]] = {}
        for y, row in enumerate(heat.least_cost):
            for x, cost in enumerate(row):
                word = cell_word(heat, x, y)
                if fine:
                    looks.setdefault(_look(word, cost, ends), []).append((x, y))
                else:
                    words = _amount(cost or 0.0, whole) if across <= MOST_TEXT else ""
                    words += f" {WAIVED_SIGN}" if word == "waived" else ""
                    _cell(axes, (x, y), word, cost, costs, words.strip())
                tell(axes, (x - 0.5, x + 0.5), (y - 0.5, y + 0.5), [
                    (short_key(heat.x), heat.x_values[x]), (short_key(heat.y), heat.y_values[y]),
                    ("Least cost", _UNPRICED.get(word, "") if cost is None
                     else numbers.money(cost, heat.currency) + _WAIVED * (word == "waived")),
                    ("Payload", heat.payload[y][x]),
                ])  # fmt: skip
        draw_cells(axes, looks)
        axes.set_xlim(-0.5, len(heat.x_values) - 0.5)
        axes.set_ylim(-0.5, len(heat.y_values) - 0.5)
        _label_axis(axes, "x", heat.x_values, fine)
        _label_axis(axes, "y", heat.y_values, fine)
        axes.set_xlabel(shortened(short_key(heat.x), 60))
        axes.set_ylabel(shortened(short_key(heat.y), 40))
        _cost_scale(figure, costs, heat.currency, whole, MARK if fine else CELL)
        explain_cells(figure, looks)

    spoken = "No case meets its requirements."
    if costs:
        spoken = (
            f"Least cost from {numbers.money(min(costs), heat.currency)} to "
            f"{numbers.money(max(costs), heat.currency)} in "
            f"{numbers.share_of(len(costs), across * len(heat.y_values))} cells; in the others no "
            "case is known to meet."
        )
    height = 140.0 + 30.0 * min(len(heat.y_values), 14)
    return draw(name, "Least cost over two factors", spoken, (WIDTH, height), build)


def is_fine(heat: HeatMap) -> bool:
    """Whether its cells are too small for a sign in them."""
    return max(len(heat.x_values), len(heat.y_values)) > MOST_SIGNS


def _look(word: CellWord, cost: float | None, ends: Sequence[float]) -> CellLook:
    if cost is None:
        return CellLook(word, None)
    return CellLook(word, round(_strength(cost, ends, MARK) / STEP) * STEP)


def _cell(
    axes: Axes, place: tuple[int, int], word: CellWord, cost: float | None,
    costs: Sequence[float], words: str,
) -> None:  # fmt: skip
    from matplotlib.patches import Rectangle

    x, y = place
    corner = (x - 0.5, y - 0.5)
    if cost is None:
        axes.add_patch(Rectangle(corner, 1, 1, facecolor="none", edgecolor=GRID, linewidth=0.6))
        colour = {"none": BAD, "undecided": WARN}.get(word, MUTED)
        sign = "\u2715" if word == "none" else UNPRICED[word][2]
        axes.text(x, y, sign, ha="center", va="center", color=colour)
        return
    axes.add_patch(
        Rectangle(
            corner, 1, 1, facecolor=SERIES[0], alpha=_strength(cost, costs), linewidth=0
        )
    )  # fmt: skip
    axes.add_patch(Rectangle(corner, 1, 1, facecolor="none", edgecolor=SURFACE, linewidth=1.2))
    axes.text(x, y, words, ha="center", va="center", color=INK, gid=f"cell-{x}-{y}")


def _amount(cost: float, whole: bool) -> str:
    """A price in whole units of its currency, or in thousands of them."""
    return numbers.count(cost) if whole else numbers.number(cost / 1000, 4)


def _room(costs: Sequence[float]) -> float:
    """What the longest of these prices takes, written out [SVG units]."""
    return scales.LETTER * max((len(numbers.count(cost)) for cost in costs), default=0)


def _label_axis(
    axes: Axes, which: Literal["x", "y"], labels: Sequence[str], fine: bool
) -> None:  # fmt: skip
    """Values beside their cells; along a fine map as many as have room, to four figures."""
    step = max(1, -(-len(labels) // (7 if which == "x" else 14)))
    places = list(range(0, len(labels), step))
    shown = {place: shortened(labels[place], 16) for place in places}
    if fine:
        shown = {place: shortened(rounded(labels[place]), 16) for place in places}
        scales.set_ticks(axes, which, places, lambda place: shown[round(place)], ACROSS)
    elif which == "x":
        axes.set_xticks(places, list(shown.values()))
    else:
        axes.set_yticks(places, list(shown.values()))
    axes.tick_params(axis=which, length=0 if not fine else 2)


@dataclass(frozen=True, slots=True)
class NamedFront:
    """One exact front with the words that tell it from the others."""

    label: str
    points: tuple[CasePoint, ...]


def fronts(
    shown: Sequence[NamedFront],
    currency: str,
    limit: numbers.Limited | None = None,
    name: str = "fig-fronts",
) -> InlineChart:
    """Exact fronts of cost against error as staircases, one colour and line style per case.

    limit: of accuracy, in whose unit errors are told.
    """
    styles = ("-", (0, (5, 2)), (0, (1, 1.5)), (0, (5, 2, 1, 2)))

    def build(figure: Figure) -> None:
        axes = add_axes(figure)
        axes.set_yscale("log")
        costs = [point.cost for front in shown for point in front.points]
        span = (max(costs) - min(costs)) or max(costs) or 1.0
        right = max(costs) + 0.08 * span
        for index, front in enumerate(shown):
            x = [point.cost for point in front.points] + [right]
            y = [point.error_m for point in (*front.points, front.points[-1])]
            colour, style = SERIES[index % len(SERIES)], styles[index % len(styles)]
            axes.step(x, y, where="post", color=colour, linestyle=style, linewidth=1.8,
                      label=shortened(front.label, MOST_LABEL))  # fmt: skip
            axes.plot(x[:-1], y[:-1], "os"[index // len(styles) % 2], color=colour, markersize=3.5)
            for point in front.points:
                tell(axes, point.cost, point.error_m, [
                    ("Front", front.label), ("Price", numbers.money(point.cost, currency)),
                    ("Error", numbers.error(point.error_m, limit)),
                ])  # fmt: skip
        axes.set_xlim(max(0.0, min(costs) - 0.08 * span), right)
        axes.margins(y=0.12)
        low, high = axes.get_ylim()
        scales.set_ticks(axes, "y", scales.log_ticks(low, high), scales.error_label(limit))
        scales.grid(axes)
        _count_axis(axes)
        axes.set_xlabel(f"cost [{currency}]")
        axes.set_ylabel("Syncline error")
        figure.legend(loc="outside lower left", ncols=1 if any(map(_long, shown)) else 2)

    errors = [point.error_m for front in shown for point in front.points]
    spoken = (
        f"{len(shown)} exact fronts; errors from {numbers.error(min(errors), limit)} to "
        f"{numbers.error(max(errors), limit)}. The table holds their ends."
    )
    lines = len(shown) if any(map(_long, shown)) else -(-len(shown) // 2)
    size = (WIDTH, 300.0 + 17.0 * lines)
    return draw(name, "Cost against error, front by case", spoken, size, build)


def _long(front: NamedFront) -> bool:
    """Whether its label needs a line of the legend for itself."""
    return len(front.label) > MOST_LABEL // 2


def _count_axis(axes: Axes) -> None:
    from matplotlib.ticker import MaxNLocator

    low, high = axes.get_xlim()
    places = [float(t) for t in MaxNLocator(5).tick_values(low, high) if low <= t <= high]
    scales.set_ticks(axes, "x", places, numbers.count)


SHAPES = "osD^vP"
FEW, LEAST_MARK = 200, 0.35  # cases whose marks are of full size; and the least share of it
STEP = 0.06  # of opacity: finer nobody sees
_VERDICTS = (  # verdicts, marker, colour, word
    (("fails", "infeasible"), "x", BAD, BRIEF["fails"].word),
    (("indeterminate",), "^", WARN, BRIEF["indeterminate"].word),
    (("refused",), "+", MUTED, COMBINED),
)


def sampled_cases(
    data: Scatter, currency: str, says: Says = (), name: str = "fig-sampled"
) -> InlineChart:
    """Cases over two factors: filled ones meet, the stronger the dearer; crosses do not.

    Called sampled only where they were drawn.
    """
    meeting = [point for point in data.points if point.verdict == "meets"]
    costs = [point.cost for point in meeting if point.cost is not None]
    size = max(LEAST_MARK, min(1.0, (FEW / max(len(data.points), 1)) ** 0.5))

    def build(figure: Figure) -> None:
        axes = add_axes(figure)
        for verdicts, marker, colour, word in _VERDICTS:
            chosen = [(p.x, p.y) for p in data.points if p.verdict in verdicts]
            if chosen:
                axes.plot(*zip(*chosen, strict=True), marker, color=colour, markersize=5 * size,
                          label=f"{word} ({numbers.count(len(chosen))})")  # fmt: skip
        _meeting(axes, data, meeting, costs, size)
        for point, words in zip(data.points, says, strict=False):
            tell(axes, point.x, point.y, words)
        _scatter_axis(axes, "x", data.x)
        _scatter_axis(axes, "y", data.y)
        scales.grid(axes)
        _cost_scale(figure, costs, currency, ends=MARK)
        told = max((len(words) for words in axes.get_legend_handles_labels()[1]), default=0)
        figure.legend(loc="outside lower left", ncols=2 if told <= MOST_BESIDE else 1)

    cases = "sampled cases" if data.sampled else "cases"
    met = numbers.share_of(len(meeting), len(data.points))
    spoken = f"{met} {cases} meet their requirements."
    height = 360.0 if not data.y.words else 190.0 + 40.0 * len(data.y.words)
    title = f"{cases[0].upper()}{cases[1:]} over two factors"
    return draw(name, title, spoken, (WIDTH, height), build)


def _meeting(
    axes: Axes, data: Scatter, meeting: Sequence[ScatterPoint], costs: Sequence[float],
    size: float,
) -> None:  # fmt: skip
    """Cases that meet: a shape for each value of what else varies, all of one strength at once."""
    groups: dict[tuple[int, float], list[ScatterPoint]] = {}
    ends = _ends(costs)
    for point in meeting:
        strength = round(_strength(point.cost, ends, MARK) / STEP) * STEP
        groups.setdefault((point.kind, strength), []).append(point)
    for (kind, strength), points in groups.items():
        places = [p.x for p in points], [p.y for p in points]
        shape = SHAPES[kind % len(SHAPES)]
        axes.plot(*places, shape, markersize=7 * size, markerfacecolor=(SERIES[0], strength),
                  markeredgecolor=SERIES[0], markeredgewidth=0.8 * size)  # fmt: skip
    for kind in sorted({kind for kind, _ in groups}):
        count = sum(p.kind == kind for p in meeting)
        which = f": {shortened(data.kinds[kind], 26)}" if data.kinds else ""
        axes.plot([], [], SHAPES[kind % len(SHAPES)], markersize=7,
                  markerfacecolor=(SERIES[0], sum(MARK) / 2),
                  markeredgecolor=SERIES[0],
                  label=f"meets{which} ({numbers.count(count)})")  # fmt: skip


def _scatter_axis(axes: Axes, which: Literal["x", "y"], axis: ScatterAxis) -> None:
    label = f"{shortened(short_key(axis.key), 60 if which == 'x' else 40)}" + (
        f" [{axis.unit}]" if axis.unit else ""
    )
    if which == "x":
        axes.set_xlabel(label)
    else:
        axes.set_ylabel(label)
    if axis.words:
        places = range(len(axis.words))
        scales.set_ticks(axes, which, places, lambda p: shortened(axis.words[round(p)], 20))
        limits = (-0.6, len(axis.words) - 0.4)
        (axes.set_xlim if which == "x" else axes.set_ylim)(*limits)
    elif axis.log:
        (axes.set_xscale if which == "x" else axes.set_yscale)("log")
        low, high = axes.get_xlim() if which == "x" else axes.get_ylim()
        scales.set_ticks(axes, which, scales.log_ticks(low, high), lambda p: numbers.number(p, 6))


def _ends(costs: Sequence[float]) -> tuple[float, ...]:
    """The cheapest and the dearest, found once for all marks; of no cost none."""
    return (min(costs), max(costs)) if costs else ()


def _strength(
    cost: float | None, costs: Sequence[float], ends: tuple[float, float] = CELL
) -> float:
    """Opacity of a cost between the cheapest and the dearest."""
    faint, strong = ends
    if cost is None or not costs:
        return faint
    span = (max(costs) - min(costs)) or 1.0
    return faint + (strong - faint) * (cost - min(costs)) / span


def _cost_scale(
    figure: Figure, costs: Sequence[float], currency: str, whole: bool = True,
    ends: tuple[float, float] = CELL,
) -> None:  # fmt: skip
    """Patches from the cheapest to the dearest, labelled."""
    if not costs:
        return
    from matplotlib.patches import Rectangle

    steps = _steps(costs, whole)
    patches = [
        Rectangle((0, 0), 1, 1, edgecolor=SERIES[0], linewidth=0.8,
                  facecolor=(SERIES[0], _strength(cost, costs, ends)))
        for cost in steps
    ]  # fmt: skip
    words = [_amount(cost, whole) for cost in steps]
    words[-1] += f" {currency}" if whole else f" thousand {currency}"
    figure.legend(patches, words, loc="outside upper left", ncols=MOST_PATCHES,
                  handlelength=1.2, columnspacing=0.8, handletextpad=0.4)  # fmt: skip


def _steps(costs: Sequence[float], whole: bool) -> list[float]:
    """The prices themselves where a scale has room for them all, else steps between the ends."""
    across = MOST_PATCHES if not whole or MOST_PATCHES * (_room(costs) + PATCH) <= ACROSS else 3
    found = sorted(set(costs))
    if len(found) <= across:
        return found
    return [found[0] + (found[-1] - found[0]) * k / (across - 1) for k in range(across)]
