"""Charts of a measured clock: offset over time, sessions against the bound, TDEV and MTIE."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Final

from syncline_design.clocks.result import SessionResult, StabilityPoint, TracePoint
from syncline_design.report import axes as scales
from syncline_design.report import numbers
from syncline_design.report.charts import WIDTH
from syncline_design.report.palette import MUTED, SERIES, SHADE
from syncline_design.report.svg import InlineChart, add_axes, draw, tell

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


BEYOND: Final = 1.1  # an axis with a bound at both sides ends a little beyond it
FAR: Final = 10.0  # a bound so many times the largest offset would leave the offsets a flat line


def in_sight(trace: Sequence[TracePoint], bound_s: float | None) -> bool:
    """Whether the bound is near enough to be drawn with the offsets."""
    return bool(bound_s) and (bound_s or 0.0) <= FAR * _worst(trace)


def _worst(trace: Sequence[TracePoint]) -> float:
    return max(max(abs(p.low_s), abs(p.high_s)) for p in trace)


def offsets(trace: Sequence[TracePoint], bound_s: float | None) -> InlineChart:
    """Offset over time, the sessions one after another; the bound as two lines where it is near."""

    def build(figure: Figure) -> None:
        axes = add_axes(figure)
        places, begins = _placed(trace)
        size, unit = _operation(places[-1])
        places, begins = [p / size for p in places], [p / size for p in begins]
        first = {point.session: point.time_s for point in reversed(trace)}
        for place, point in zip(places, trace, strict=True):
            says = _says(point, point.time_s - first[point.session])
            tell(axes, place, 0.5 * (point.low_s + point.high_s), says)
        axes.vlines(places, [p.low_s for p in trace], [p.high_s for p in trace], color=SERIES[0],
                    linewidth=0.8)  # fmt: skip
        axes.plot(places, [0.5 * (p.low_s + p.high_s) for p in trace], ".", markersize=1.6,
                  color=SERIES[0])  # fmt: skip
        ends = [*begins[1:], places[-1]]
        for k, (start, end) in enumerate(zip(begins, ends, strict=True)):
            if k % 2:
                axes.axvspan(start, end, color=SHADE, linewidth=0, zorder=0)
        for side in (-1.0, 1.0):
            if bound_s and in_sight(trace, bound_s):
                axes.axhline(side * bound_s, color=SERIES[1], linewidth=1.2, linestyle=(0, (5, 3)))
        if bound_s and in_sight(trace, bound_s):
            axes.set_ylim(-BEYOND * bound_s, BEYOND * bound_s)
        low, high = axes.get_ylim()
        scales.set_ticks(axes, "y", _linear(low, high), _time_or_zero)
        axes.set_xlabel(f"{unit} of operation, sessions one after another")
        axes.set_ylabel("local \N{MINUS SIGN} reference")
        scales.grid(axes, "y")

    spoken = f"largest offset {numbers.time(_worst(trace))}"
    if bound_s:
        spoken += f", bound {numbers.time(bound_s)}"
    return draw("fig-offsets", "Offset over time", spoken, (WIDTH, 240.0), build)


def _says(point: TracePoint, since_s: float) -> list[tuple[str, str]]:
    """A stretch of a session: since its begin, and between which offsets it stays."""
    ends = [numbers.time(end) for end in (point.low_s, point.high_s)]
    told = ends[0] if ends[0] == ends[1] else " to ".join(ends)
    return [("Session", str(point.session)), ("Since its begin", numbers.si_quantity(since_s, "s")),
            ("Offset", told)]  # fmt: skip


def _placed(trace: Sequence[TracePoint]) -> tuple[list[float], list[float]]:
    """Hours of operation of every point, and where each session begins."""
    places: list[float] = []
    begins: list[float] = []
    start, before, session = 0.0, 0.0, None
    for point in trace:
        if point.session != session:
            start, before, session = before, point.time_s, point.session
            begins.append(start)
            origin = point.time_s
        here = start + (point.time_s - origin) / 3600.0
        places.append(here)
        before = here
    return places, begins


def _operation(last_h: float) -> tuple[float, str]:
    """The unit of a time of operation that lasts so long: its size in hours, and its name."""
    known = ((1.0, "hours"), (1.0 / 60.0, "minutes"))
    return next((one for one in known if last_h >= 3.0 * one[0]), (1.0 / 3600.0, "seconds"))


def _linear(low: float, high: float) -> list[float]:
    from matplotlib.ticker import MaxNLocator

    return [float(t) for t in MaxNLocator(5).tick_values(low, high) if low <= t <= high]


def _time_or_zero(value: float) -> str:
    return "0" if value == 0 else scales.short_time(value)


def sessions(
    rows: Sequence[tuple[int, SessionResult]], coverage: float,
    bounds: Sequence[tuple[str, float]],
) -> InlineChart:  # fmt: skip
    """What |offset| stays below in each session, against the bounds; logarithmic.

    rows: sessions with their numbers.
    """
    numbered = [number for number, _ in rows]
    label = f"{numbers.percent(coverage)} of a session"
    values = [row.quantile_s or 0.0 for _, row in rows]

    def build(figure: Figure) -> None:
        axes = add_axes(figure)
        axes.plot(numbered, values, linestyle="none", marker="o", markersize=4.5,
                  color=SERIES[0], label=label)  # fmt: skip
        for number, value in zip(numbered, values, strict=True):
            tell(axes, number, value, [("Session", str(number)), (label, numbers.time(value))])
        for k, (name, value) in enumerate(bounds):
            axes.axhline(value, color=SERIES[1 + k], linewidth=1.3, label=name,
                         linestyle=((0, (5, 3)), (0, (2, 2)))[k % 2])  # fmt: skip
        _log_times(axes, "y", [v for v in (*values, *(b for _, b in bounds)) if v > 0.0])
        axes.set_xlabel("session")
        axes.set_xlim(min(numbered) - 0.5, max(numbered) + 0.5)
        _whole_ticks(axes)
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, 1.2), ncols=3)
        scales.grid(axes, "y")

    spoken = "; ".join(f"{label} {numbers.time(value)}" for label, value in bounds)
    shown = f"{len(values)} sessions, largest {numbers.time(max(values))}; {spoken}"
    return draw("fig-sessions", "Sessions against the bound", shown, (WIDTH, 240.0), build)


def _whole_ticks(axes: Axes) -> None:
    from matplotlib.ticker import MaxNLocator

    axes.xaxis.set_major_locator(MaxNLocator(8, integer=True, min_n_ticks=1))


def _log_times(axes: Axes, which: str, values: Sequence[float]) -> None:
    low, high = 0.7 * min(values, default=1e-9), 1.5 * max(values, default=1e-6)
    set_scale: Callable[[str], object] = axes.set_yscale if which == "y" else axes.set_xscale
    set_scale("log")
    if which == "y":
        axes.set_ylim(low, high)
        scales.set_ticks(axes, "y", scales.log_ticks(low, high, 6), scales.short_time)
    else:
        axes.set_xlim(low, high)
        scales.set_ticks(axes, "x", scales.log_ticks(low, high, 6), scales.short_time)


def stability(points: Sequence[StabilityPoint]) -> InlineChart:
    """TDEV and MTIE over the averaging time, both axes logarithmic."""

    def build(figure: Figure) -> None:
        axes = add_axes(figure)
        drawn: list[float] = []
        for k, (label, values) in enumerate(_lines(points)):
            axes.plot([t for t, _ in values], [v for _, v in values], color=SERIES[k],
                      marker="os"[k], markersize=3.5, linewidth=1.6, label=label)  # fmt: skip
            drawn += [v for _, v in values]
            for over, value in values:
                tell(axes, over, value, [("Curve", label), ("Over", numbers.time(over)),
                     ("Value", numbers.time(value))])  # fmt: skip
        _log_times(axes, "x", [p.tau_s for p in points])
        _log_times(axes, "y", drawn)
        axes.set_xlabel("averaging time, or length of the window")
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, 1.17), ncols=2)
        axes.tick_params(colors=MUTED)
        scales.grid(axes)

    spoken = "; ".join(
        f"{label} {numbers.time(values[0][1])} at {numbers.time(values[0][0])} to "
        f"{numbers.time(values[-1][1])} at {numbers.time(values[-1][0])}"
        for label, values in _lines(points)
    )
    return draw("fig-stability", "TDEV and MTIE", spoken, (WIDTH, 260.0), build)


def _lines(points: Sequence[StabilityPoint]) -> list[tuple[str, list[tuple[float, float]]]]:
    """The two curves, without points that a logarithm has no place for."""
    tdev = [(p.tau_s, p.tdev_s) for p in points if p.tdev_s]
    mtie = [(p.tau_s, p.mtie_s) for p in points if p.mtie_s]
    return [(label, values) for label, values in (("TDEV", tdev), ("MTIE", mtie)) if values]
