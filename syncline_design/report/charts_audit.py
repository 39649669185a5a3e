"""Charts of audited stamps: receipt minus stamp over time, one row a stream, faults marked."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

from syncline_design.auditing.result import StampFault, StreamAudit
from syncline_design.report import axes as scales
from syncline_design.report import numbers
from syncline_design.report.charts import WIDTH
from syncline_design.report.palette import BAD, MUTED, SERIES, SHADE, SURFACE, WARN
from syncline_design.report.svg import InlineChart, add_axes, draw, tell

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ROW: Final = 76.0
MOST_MARKS: Final = 30
MOST_LETTERS: Final = 34
LINE: Final = 0.2  # height of a fault's name as a share of a row
HEIGHTS: Final = (0.97, 0.8, 0.63, 0.46, 0.29)  # of a name's upper edge
DRAWN: Final = 0.8 * WIDTH  # of the chart, without its labels [SVG units]


def traces(rows: Sequence[StreamAudit]) -> InlineChart:
    """One row a stream, all over the same time."""
    end = max((row.trace[-1].time_s for row in rows), default=1.0)
    begin = min((row.trace[0].time_s for row in rows), default=0.0)

    def build(figure: Figure) -> None:
        for k, row in enumerate(rows, 1):
            axes = add_axes(figure, len(rows), 1, k)
            _trace(axes, row)
            axes.set_xlim(begin, end if end > begin else begin + 1.0)
            _faults(axes, row)
            _labels(axes, row, last=k == len(rows))

    spoken = "; ".join(
        f"{row.name}: " + (", ".join(f.fault for f in row.faults) or "no fault") for row in rows
    )
    size = (WIDTH, 46.0 + ROW * len(rows))
    return draw("fig-traces", "Receipt minus stamp over time", spoken, size, build)


def _trace(axes: Axes, row: StreamAudit) -> None:
    times = [p.time_s for p in row.trace]
    low, high = [p.low_s for p in row.trace], [p.high_s for p in row.trace]
    axes.vlines(times, low, high, color=SERIES[0], linewidth=1.0)
    axes.plot(times, low, color=SERIES[0], linewidth=0.7)
    bottom, top = min(low), max(high)
    room = 0.08 * (top - bottom) or 1e-9
    axes.set_ylim(bottom - room, top + room)


def _faults(axes: Axes, row: StreamAudit) -> None:
    """Episodes as a shade, moments as a line; what concerns the whole stream is in its name."""
    for fault in [f for f in row.faults if f.from_s is not None][:MOST_MARKS]:
        begin = fault.from_s or 0.0
        tell(axes, (begin, fault.to_s or begin), axes.get_ylim(), [
            ("Stream", row.name), ("Fault", fault.fault), ("From", f"{numbers.places(begin, 3)} s"),
            ("To", "" if fault.to_s is None else f"{numbers.places(fault.to_s, 3)} s"),
        ])  # fmt: skip
        colour = BAD if fault.counts else MUTED
        axes.axvline(begin, color=colour, linewidth=1.1, linestyle=(0, (4, 2)))
        if fault.to_s is not None and fault.to_s > begin and _is_episode(fault):
            axes.axvspan(begin, fault.to_s, color=SHADE, linewidth=0, zorder=0)
            axes.axvline(fault.to_s, color=colour, linewidth=0.7, linestyle=(0, (1, 2)))
    _names(axes, row)


def _names(axes: Axes, row: StreamAudit) -> None:
    """Each fault's name beside its first beginning, at the height where it hides least."""
    marked = [f for f in row.faults if f.from_s is not None][:6]
    free = list(HEIGHTS)
    for name in dict.fromkeys(f.fault for f in marked):
        first = next(f for f in marked if f.fault == name)
        begin, (left, right) = first.from_s or 0.0, axes.get_xlim()
        wide = (right - left) * min(1.0, len(name) * scales.LETTER / DRAWN)
        leftwards = begin + wide > right
        over = (begin - wide, begin) if leftwards else (begin, begin + wide)
        top = min(free or HEIGHTS, key=lambda top: _hidden(row, over, top, axes.get_ylim()))
        free = [one for one in free if one != top]
        axes.annotate(
            name, (begin, top), xycoords=("data", "axes fraction"),
            xytext=(-3 if leftwards else 3, 0), textcoords="offset points",
            color=BAD if first.counts else MUTED, va="top", zorder=6,
            ha="right" if leftwards else "left",
            bbox={"facecolor": SURFACE, "edgecolor": "none", "pad": 0.8},  # over lines, not on them
        )  # fmt: skip


def _hidden(
    row: StreamAudit, over: tuple[float, float], top: float, ylim: tuple[float, float]
) -> int:
    """Points of the trace that a name would cover; over: its time [s], top: share of the row."""
    low, high = ylim
    upper, lower = low + top * (high - low), low + (top - LINE) * (high - low)
    return sum(
        over[0] <= p.time_s <= over[1] and p.low_s <= upper and p.high_s >= lower for p in row.trace
    )


def _is_episode(fault: StampFault) -> bool:
    return fault.fault in ("whole_second_slip", "relock", "gap") or (
        fault.fault == "step" and fault.to_s is not None
    )


def _labels(axes: Axes, row: StreamAudit, *, last: bool) -> None:
    from matplotlib.ticker import MaxNLocator

    whole = [f.fault for f in row.faults if f.from_s is None]
    name = row.name if len(row.name) <= MOST_LETTERS else "\u2026" + row.name[-MOST_LETTERS:]
    mark = "\u2713" if row.sound else "\u2717"
    title = f"{mark} {name}" + (f": {', '.join(dict.fromkeys(whole))}" if whole else "")
    axes.set_title(title, loc="left", color=WARN if not row.sound else MUTED)
    low, high = axes.get_ylim()
    ticks = [float(t) for t in MaxNLocator(3).tick_values(low, high) if low <= t <= high]
    scales.set_ticks(axes, "y", ticks, lambda v: "0" if v == 0 else numbers.time(v, 3))
    scales.grid(axes, "y")
    if last:
        axes.set_xlabel("seconds of receipt since the first message")
    else:
        axes.set_xticklabels([])
