"""Axes in units people read: decades of metres and seconds, labelled by their unit ladder."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Literal, Protocol, TypeVar

from syncline_design.report import numbers
from syncline_design.report.palette import GRID, MUTED

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FAR = 30.0  # times the largest error of a front: beyond it no other design is drawn
DEAR = 2.5  # times the end of the front's axis of prices: the same
GAP_OF_UNIT = "\N{NO-BREAK SPACE}"
LETTER, GAP = 5.8, 7.0  # width of a letter of a label, and between two labels [SVG units]
_SUPERSCRIPT = str.maketrans(
    "-0123456789", "\u207b\u2070\u00b9\u00b2\u00b3\u2074\u2075\u2076\u2077\u2078\u2079"
)


class Priced(Protocol):
    """A design with its price and its error [m]."""

    @property
    def cost(self) -> float: ...
    @property
    def error_m(self) -> float: ...


P = TypeVar("P", bound=Priced)


def price_axis(
    costs: Sequence[float], limit: float | None, others: Sequence[float] = ()
) -> tuple[float, float]:
    """Ends of an axis of prices that shows those of a front, and their limit where there is one.

    others: prices of further designs, which it shows too.
    """
    span = max(costs) - min(costs) or max(costs) or 1.0
    right = max([max(costs) + 0.15 * span, *([1.04 * limit] if limit else []),
                 1.03 * max(others, default=0.0)])  # fmt: skip
    left, least = min(costs) - 0.12 * span, min(others, default=right)
    return max(0.0, min(left, least - 0.04 * (right - least))), right


def in_view(designs: Iterable[P], costs: Sequence[float], worst_m: float,
            limit: float | None) -> list[P]:  # fmt: skip
    """Designs that can be drawn with a front and leave it room; costs, worst_m: of the front."""
    most = DEAR * price_axis(costs, limit)[1]
    return [p for p in designs if p.cost <= most and 0.0 < p.error_m <= FAR * worst_m]


def power_of_ten(value: float) -> str:
    """1000 as 10 with a superscript 3, in plain characters; 1 and 10 as they are."""
    exponent = round(math.log10(value))
    return (
        numbers.number(value, 6)
        if exponent in (0, 1)
        else "10" + str(exponent).translate(_SUPERSCRIPT)
    )


def decades(low: float, high: float, most: int = 7) -> list[float]:
    """Powers of ten from low to high, thinned to at most `most`."""
    first, last = math.ceil(math.log10(low) - 1e-9), math.floor(math.log10(high) + 1e-9)
    step = max(1, math.ceil((last - first + 1) / most))
    return [10.0**exponent for exponent in range(first, last + 1, step)]


def one_two_five(low: float, high: float) -> list[float]:
    """1, 2, 5 times powers of ten from low to high."""
    exponents = range(math.floor(math.log10(low)), math.floor(math.log10(high)) + 1)
    steps = (leading * 10.0**exponent for exponent in exponents for leading in (1.0, 2.0, 5.0))
    return [s for s in steps if low * (1 - 1e-9) <= s <= high * (1 + 1e-9)]


def log_ticks(low: float, high: float, most: int = 7) -> list[float]:
    """Decades, 1-2-5 steps where there are fewer than three of them, else equal steps."""
    from matplotlib.ticker import MaxNLocator

    whole = decades(low, high, most)
    if len(whole) >= 3:
        return whole
    steps = one_two_five(low, high)
    if len(steps) >= 2:
        return steps
    return [float(t) for t in MaxNLocator(4).tick_values(low, high) if low <= t <= high]


def _in_one_unit(places: Sequence[float], labels: list[str]) -> list[str]:
    """Labels of an axis in one unit, `0.1 m ... 100 m`, where one serves all its ticks.

    places: of the ticks, in the SI unit of their labels. One serves where none is below a
    hundredth or above 9 999 of it: a tick of 0.00001 m is read worse than one of 10 um.
    """
    units = dict.fromkeys(text.partition(GAP_OF_UNIT)[2] for text in labels if text != "0")
    if len(units) < 2 or not all(unit[:1].isalpha() for unit in units):
        return labels  # one already, or counts with grouped thousands
    for shown in reversed(labels):
        alike = [text if text == "0" else numbers.like(shown, place, 3)
                 for place, text in zip(places, labels, strict=True)]  # fmt: skip
        figures = [abs(_figure(text)) for text in alike if text != "0"]
        if min(figures) >= 0.01 and max(figures) <= 9999.0:
            return alike
    return labels


def _figure(text: str) -> float:
    return float(text.partition(GAP_OF_UNIT)[0].replace("\N{MINUS SIGN}", "-"))


def set_ticks(
    axes: Axes, which: Literal["x", "y"], ticks: Iterable[float], label: Callable[[float], str],
    room: float = 270.0,
) -> None:  # fmt: skip
    """Fixed major ticks with the given labels; no minor ones.

    Along x, of labels that would run into one another only every second, third ... stays.
    room: width of the axes [SVG units].
    """
    from matplotlib.ticker import FixedFormatter, FixedLocator, NullLocator

    places = list(ticks)
    axis = axes.xaxis if which == "x" else axes.yaxis
    labels = _in_one_unit(places, [label(place) for place in places])
    if which == "x" and len(labels) > 1:
        widest = LETTER * max(len(text) for text in labels) + GAP
        step = max(1, math.ceil(widest * (len(labels) - 1) / room))
        labels = [text if i % step == 0 else "" for i, text in enumerate(labels)]
    axis.set_major_locator(FixedLocator(places))
    axis.set_major_formatter(FixedFormatter(labels))
    axis.set_minor_locator(NullLocator())


def grid(axes: Axes, which: Literal["x", "y", "both"] = "both") -> None:
    """A quiet grid."""
    axes.grid(True, axis=which, color=GRID, linewidth=0.7)


def hide_ticks(axes: Axes, which: Literal["x", "y"]) -> None:
    """Labels stay, tick marks and the axis line go."""
    axes.tick_params(axis=which, length=0)
    axes.spines["left" if which == "y" else "bottom"].set_visible(False)


def inverse_axis(
    axes: Axes, which: Literal["x", "y"], label: str, shown: Callable[[float], str]
) -> None:
    """A second axis opposite the first, in the reciprocal quantity (tau for 1/tau)."""
    low, high = axes.get_xlim() if which == "x" else axes.get_ylim()
    twin = axes.twiny() if which == "x" else axes.twinx()
    spine = "top" if which == "x" else "right"
    for name, line in twin.spines.items():
        line.set_visible(name == spine)
    if which == "x":
        twin.set_xscale("log")
        twin.set_xlim(low, high)
        twin.set_xlabel(label)
    else:
        twin.set_yscale("log")
        twin.set_ylim(low, high)
        twin.set_ylabel(label)
    wanted = log_ticks(1.0 / high, 1.0 / low, 6)
    set_ticks(twin, which, [1.0 / value for value in wanted], lambda place: shown(1.0 / place))
    twin.tick_params(colors=MUTED, labelcolor=MUTED)


def short_length(value: float) -> str:
    """A tick label in metres' ladder."""
    return numbers.length(value, 3)


def error_label(limit: numbers.Limited | None) -> Callable[[float], str]:
    """Tick labels of an axis of errors: in the unit of the limit, where there is one."""
    return lambda value: "0" if value == 0 else numbers.error(value, limit, 3)


def short_time(value: float) -> str:
    """A tick label in seconds' ladder."""
    return numbers.time(value, 3)
