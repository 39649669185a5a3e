"""Price and error of every case of a study over the one key that varies."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Final, Literal

from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.report import axes as scales
from syncline_design.report import numbers
from syncline_design.report.charts import WIDTH
from syncline_design.report.palette import BAD, MUTED, SERIES, SURFACE, WARN
from syncline_design.report.study_words import COMBINED, short_key
from syncline_design.report.svg import InlineChart, draw, tell
from syncline_design.report.text import shortened
from syncline_design.report.words import BRIEF
from syncline_design.studies.scatter import KeySweep

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Fill = Literal["full", "left", "none"]  # of a mark
Says = Sequence[Sequence[tuple[str, str]]]  # of every case: labels and values
SHAPES: Final = "osD^"
LOG_SPAN: Final = 30.0  # times the smallest error: beyond it their axis is logarithmic
EDGE: Final = 0.16  # of a panel, for cases without a design
MOST_LABEL: Final = 22  # letters of an entry of the legend beside another
MOST_WORD: Final = 22  # letters of a word beside its row
_MARKS: Final = {  # marker, colour, word
    "fails": ("x", BAD, BRIEF["fails"].word),
    "infeasible": ("X", BAD, BRIEF["infeasible"].word),
    "indeterminate": ("2", WARN, BRIEF["indeterminate"].word),
    "refused": ("+", MUTED, COMBINED),
}


@dataclass(frozen=True, slots=True)
class _Panel:
    label: str
    values: tuple[float | None, ...]
    tick: Callable[[float], str]
    log: bool = False


@dataclass(frozen=True, slots=True)
class _Group:
    label: str
    marker: str
    colour: str
    cases: list[int]
    size: float = 6.0
    fill: Fill = "full"


def over_key(
    data: KeySweep,
    currency: str,
    limit: numbers.Limited | None,
    says: Says,
    name: str = "fig-along",
) -> InlineChart:
    """Prices, and errors, of all cases over one key; those without a design along the edge.

    Figures run from left to right, words stand below one another.
    """
    errors = tuple(point.error_m for point in data.points)
    known = [error for error in errors if error]
    log = bool(known) and max(known) > LOG_SPAN * min(known)
    panels = [
        _Panel(f"price [{currency}]", tuple(p.cost for p in data.points), numbers.count),
        _Panel("Syncline error", errors, scales.error_label(limit), log),
    ]
    panels = [one for one in panels if any(value is not None for value in one.values)]
    words = data.axis.words

    def build(figure: Figure) -> None:
        every = list(figure.subplots(len(panels), 1, sharex=not words, squeeze=False).flat)
        for axes, panel in zip(every, panels, strict=True):
            axes.spines[["top", "right"]].set_visible(False)
            axes.set_axisbelow(True)
            _panel(axes, data, panel, says)
        for axes in every if words else [every[-1]]:
            _key_axis(axes, data)
        handles, labels = every[0].get_legend_handles_labels()
        columns = 1 if max(map(len, labels)) > MOST_LABEL else 2
        figure.legend(handles, labels, loc="outside lower left", ncols=columns)

    meeting = sum(point.verdict == "meets" for point in data.points)
    key = short_key(data.axis.key)
    spoken = f"{numbers.share_of(meeting, len(data.points))} cases meet their requirements."
    if known:
        spoken += f" Errors from {numbers.error(min(known), limit)} to "
        spoken += f"{numbers.error(max(known), limit)}."
    height = 70.0 + len(panels) * (60.0 + 24.0 * min(len(words), 12) if words else 150.0)
    return draw(name, f"Price and error over {key}", spoken, (WIDTH, height), build)


def _panel(axes: Axes, data: KeySweep, panel: _Panel, says: Says) -> None:
    """One panel: where a case has the value, and along its edge where it has none."""
    across: Literal["x", "y"] = "x" if data.axis.words else "y"
    (axes.set_xscale if across == "x" else axes.set_yscale)("log" if panel.log else "linear")
    edge = _with_edge(axes, across, panel)
    values = [edge if value is None else value for value in panel.values]
    for group in _groups(data):
        places = [data.points[k].place for k in group.cases]
        told = [values[k] for k in group.cases]
        axes.plot(*((told, places) if across == "x" else (places, told)), group.marker,
                  color=group.colour, markersize=group.size, label=group.label,
                  fillstyle=group.fill, markerfacecoloralt=SURFACE)  # fmt: skip
    for point, value, words in zip(data.points, values, says, strict=True):
        tell(axes, *((value, point.place) if across == "x" else (point.place, value)), words)
    scales.grid(axes)
    (axes.set_xlabel if across == "x" else axes.set_ylabel)(panel.label)


def _with_edge(axes: Axes, which: Literal["x", "y"], panel: _Panel) -> float:
    """Limits with ticks for the values, and room below them; where in that room the rest stands."""
    known = [value for value in panel.values if value is not None]
    low, high = min(known), max(known)
    room = EDGE if len(known) < len(panel.values) else 0.0
    if panel.log:
        ratio = high / low
        ends = (low / ratio ** (0.08 + room), high * ratio**0.08)
        edge = float(low / ratio ** (0.04 + room))
        ticks = scales.log_ticks(low, high)
    else:
        span = (high - low) or 0.2 * abs(high) or 1.0
        ends = (low - (0.08 + room) * span, high + 0.08 * span)
        edge = low - (0.02 + room) * span
        ticks = _linear_ticks(low - 0.08 * span, ends[1]) if high > low else [low]
    (axes.set_xlim if which == "x" else axes.set_ylim)(*ends)
    scales.set_ticks(axes, which, ticks, panel.tick, 200.0)
    return edge


def _linear_ticks(low: float, high: float) -> list[float]:
    from matplotlib.ticker import MaxNLocator

    return [float(t) for t in MaxNLocator(4).tick_values(low, high) if low <= t <= high]


def _groups(data: KeySweep) -> list[_Group]:
    """The cases by how they ended; those that meet by base too, half filled if by a waiver."""
    found = []
    meeting = {(p.kind, p.waived) for p in data.points if p.verdict == "meets"}
    for kind, waived in sorted(meeting):
        which = ", waived" if waived else ""
        which += f": {shortened(data.kinds[kind], 26)}" if data.kinds else ""
        chosen = [
            k
            for k, p in enumerate(data.points)
            if p.verdict == "meets" and (p.kind, p.waived) == (kind, waived)
        ]
        style = SHAPES[kind % len(SHAPES)], SERIES[kind % len(SERIES)]
        size = 5.0 + 3.0 * kind  # one around the other, where bases come to the same
        fill: Fill = "left" if waived else "none" if kind else "full"
        found.append(
            _Group(f"meets{which} ({numbers.count(len(chosen))})", *style, chosen, size, fill)
        )
    for verdict, (marker, colour, word) in _MARKS.items():
        chosen = [k for k, point in enumerate(data.points) if point.verdict == verdict]
        if chosen:
            found.append(_Group(f"{word} ({numbers.count(len(chosen))})", marker, colour, chosen))
    return found


def _key_axis(axes: Axes, data: KeySweep) -> None:
    """The values of the key: figures below, words beside."""
    axis = data.axis
    if axis.words:
        scales.set_ticks(axes, "y", range(len(axis.words)),
                         lambda p: shortened(axis.words[round(p)], MOST_WORD))  # fmt: skip
        axes.set_ylim(len(axis.words) - 0.4, -0.6)
        return
    axes.set_xlabel(shortened(short_key(axis.key), 60) + (f" [{axis.unit}]" if axis.unit else ""))
    if axis.log:
        axes.set_xscale("log")
        scales.set_ticks(axes, "x", scales.log_ticks(*axes.get_xlim()),
                         lambda p: numbers.number(p, 6))  # fmt: skip
