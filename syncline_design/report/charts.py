"""The charts of a verdict: the Syncline, tau against tau_crit, the ledger of terms."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final

from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.report import axes as scales
from syncline_design.report import numbers
from syncline_design.report.columns import alike, errors
from syncline_design.report.palette import BAD, GOOD, INK, LINE, MUTED, SERIES, SHADE, SURFACE, WARN
from syncline_design.report.svg import InlineChart, add_axes, draw, tell

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH = 344.0  # SVG units: on a phone, 390 px wide, text of 10 units is 11 px high


@dataclass(frozen=True, slots=True)
class SynclineCurve:
    """What the Syncline plot shows.

    total(tau) = floor_m + rate_mps * tau, floor_m being sensor error plus systematic error.
    """

    floor_m: float
    rate_mps: float
    tau_crit_s: float | None
    tau_s: float | None
    total_m: float | None
    limit: numbers.Limited | None
    lever_arm_rate_mps: float | None = None


def _tau_span(curve: SynclineCurve) -> tuple[float, float]:
    """Least and largest tau shown: three decades around tau_crit, the design well inside."""
    crit = curve.tau_crit_s or (curve.tau_s if curve.tau_s else 1e-3)
    low, high = crit / 1e3, crit * 1e3
    if curve.tau_s:
        low, high = min(low, curve.tau_s / 3), max(high, curve.tau_s * 3)
    return low, high


def syncline(
    curve: SynclineCurve, name: str = "fig-syncline", title: str = "Syncline of the design"
) -> InlineChart:
    """Accuracy against synchronisation accuracy, log-log, as in the paper's figure 1."""
    low, high = _tau_span(curve)

    def build(figure: Figure) -> Axes:
        import numpy as np

        axes = add_axes(figure)
        tau = np.geomspace(low, high, 241)
        error = curve.floor_m + curve.rate_mps * tau
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_xlim(1.0 / high, 1.0 / low)
        _set_accuracy_limits(axes, curve, float(error[-1]))
        _regions(axes, curve)
        _asymptotes(axes, curve, low, high)
        if curve.lever_arm_rate_mps and curve.lever_arm_rate_mps > 1.01 * curve.rate_mps:
            wider = curve.floor_m + curve.lever_arm_rate_mps * tau
            axes.plot(1 / tau, 1 / wider, color=LINE, linewidth=1, linestyle=(0, (1, 2)))
        axes.plot(1 / tau, 1 / error, color=LINE, linewidth=2.4, zorder=3)[0].set_gid("curve")
        _limit_and_design(axes, curve, low)
        _syncline_labels(axes, curve.limit)
        return axes

    return draw(name, title, _describe(curve), (WIDTH, 318.0), build)


def _set_accuracy_limits(axes: Axes, curve: SynclineCurve, worst_m: float) -> None:
    asked = None if curve.limit is None else curve.limit.limit
    errors = [curve.floor_m, worst_m, *([curve.total_m] if curve.total_m else [])]
    if asked and min(errors) / FAR <= asked <= max(errors) * FAR:
        errors.append(asked)
    axes.set_ylim(1.0 / (max(errors) * 1.3), 2.5 / min(errors))


def _regions(axes: Axes, curve: SynclineCurve) -> None:
    """Sync-bound left of 1/tau_crit (shaded), sensor-bound right of it."""
    if not curve.tau_crit_s:
        return
    border = 1.0 / curve.tau_crit_s
    left, right = axes.get_xlim()
    axes.axvspan(left, border, color=SHADE, linewidth=0, zorder=0)
    axes.axvline(border, color=MUTED, linewidth=1, linestyle=(0, (2, 2)), zorder=1)
    for text, ends in (("sync-bound", (left, border)), ("sensor-bound", (border, right))):
        axes.annotate(
            text,
            (math.sqrt(ends[0] * ends[1]), 0.015),
            xycoords=("data", "axes fraction"),
            ha="center",
            va="bottom",
            color=MUTED,
        )
    axes.annotate(
        f"\u03c4_crit {numbers.time(curve.tau_crit_s, 3)}",
        (border, 0.10),
        xycoords=("data", "axes fraction"),
        xytext=(5, 0),
        textcoords="offset points",
        color=INK,
    )


def _asymptotes(axes: Axes, curve: SynclineCurve, low: float, high: float) -> None:
    """Roof 1/floor and slope 1/(rate tau)."""
    left, right = axes.get_xlim()
    roof = 1.0 / curve.floor_m
    dashes: dict[str, Any] = {
        "color": MUTED,
        "linewidth": 1.0,
        "linestyle": (0, (5, 3)),
        "zorder": 2,
    }
    axes.plot([left, right], [roof, roof], **dashes)
    axes.annotate(
        f"roof {numbers.error(curve.floor_m, curve.limit, 3)}",
        (left, roof),
        xytext=(6, 4),
        textcoords="offset points",
        color=MUTED,
    )
    if curve.rate_mps > 0:
        ends = [1.0 / high, min(right, 1.6 * curve.rate_mps / curve.floor_m)]
        axes.plot(ends, [x / curve.rate_mps for x in ends], **dashes)
        place = ends[0] * (right / left) ** 0.12
        axes.annotate(
            f"slope {numbers.speed(curve.rate_mps, 3)}",
            (place, place / curve.rate_mps),
            xytext=(8, -6),
            textcoords="offset points",
            va="top",
            color=MUTED,
        )


def _limit_and_design(axes: Axes, curve: SynclineCurve, low: float) -> None:
    """Line of the limit and operating point, in groups of their own for the page's script."""
    left, right = axes.get_xlim()
    asked = None if curve.limit is None else curve.limit.limit
    if curve.limit is not None and asked:
        bottom, top = axes.get_ylim()
        place = min(max(1 / asked, bottom), top)
        beyond = {bottom: " \N{DOWNWARDS ARROW}", top: " \N{UPWARDS ARROW}"}.get(place, "")
        line = axes.plot([left, right], [place] * 2, color=WARN, linewidth=1.6)[0]
        line.set_gid("limit-line")
        above = place == bottom or (place < top and asked < curve.floor_m)
        label = axes.annotate(
            f"limit {numbers.limit(curve.limit)}{beyond}",
            (right, place),
            xytext=(-4, 4 if above else -9),  # clear of a mark on the line
            textcoords="offset points",
            ha="right",
            va="bottom" if above else "top",
            color=WARN,
        )
        label.set_gid("limit-label")
    if curve.total_m is None or curve.tau_s is None:
        return
    met = asked is None or curve.total_m <= asked
    point = axes.plot(
        [1.0 / max(curve.tau_s, low)],
        [1.0 / curve.total_m],
        marker="o" if met else "X",
        markersize=11,
        color=GOOD if met else BAD,
        markeredgecolor=SURFACE,
        markeredgewidth=1.5,
        linestyle="none",
        zorder=5,
        clip_on=False,
    )[0]
    point.set_gid("operating-point")
    tell(axes, 1.0 / max(curve.tau_s, low), 1.0 / curve.total_m,
         [("Design at \u03c4", numbers.time(curve.tau_s)),
          ("Error", numbers.error(curve.total_m, curve.limit))])  # fmt: skip


def _syncline_labels(axes: Axes, limit: numbers.Limited | None) -> None:
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    scales.set_ticks(axes, "x", scales.decades(left, right), scales.power_of_ten)
    scales.set_ticks(axes, "y", scales.log_ticks(bottom, top), lambda v: numbers.number(v, 6))
    axes.set_xlabel("synchronisation accuracy 1/\u03c4 [1/s]")
    axes.set_ylabel("accuracy 1/error [1/m]")
    scales.grid(axes)
    scales.inverse_axis(axes, "x", "timestamp error \u03c4", scales.short_time)
    scales.inverse_axis(axes, "y", "Syncline error", scales.error_label(limit))


def _describe(curve: SynclineCurve) -> str:
    parts = [
        "Accuracy against synchronisation accuracy on logarithmic axes.",
        f"Roof at {numbers.error(curve.floor_m, curve.limit)} of error, "
        f"slope {numbers.speed(curve.rate_mps)}.",
    ]
    if curve.tau_crit_s:
        parts.append(f"They meet at tau_crit {numbers.time(curve.tau_crit_s)}.")
    if curve.total_m is not None and curve.tau_s is not None:
        parts.append(
            f"The design sits at tau {numbers.time(curve.tau_s)} with an error of "
            f"{numbers.error(curve.total_m, curve.limit)}."
        )
    if curve.limit is not None:
        parts.append(f"The limit is {numbers.limit(curve.limit)}.")
    return " ".join(parts)


LONG_NAME: Final = 24  # letters of a sensor beside its bar
LAX: Final = 5.0  # times all that is drawn, from which on a limit is told at the edge
FAR: Final = 100.0  # times what a logarithmic axis holds, from which on it does the same
BEYOND: Final = " \N{RIGHTWARDS ARROW}"


@dataclass(frozen=True, slots=True)
class TauBar:
    """One sensor's timestamp error beside the largest it may have."""

    label: str
    tau_s: float
    tau_crit_s: float | None
    within: bool


def tau_bars(bars: Sequence[TauBar], name: str = "fig-tau") -> InlineChart:
    """tau of each sensor as a bar up to its tau_crit mark, on a logarithmic time axis."""
    known = [v for b in bars for v in (b.tau_s, b.tau_crit_s) if v]
    low = min(known, default=1e-6) / 5
    high = max(known, default=1.0) * 5

    def build(figure: Figure) -> None:
        axes = add_axes(figure)
        axes.set_xscale("log")
        axes.set_xlim(low, high)
        axes.set_ylim(len(bars) - 0.4, -0.6)
        for row, bar in enumerate(bars):
            _tau_row(axes, row, bar, low, high)
        scales.set_ticks(axes, "x", scales.log_ticks(low, high), scales.short_time)
        scales.set_ticks(axes, "y", range(len(bars)), lambda row: bars[int(row)].label)
        scales.hide_ticks(axes, "y")
        scales.grid(axes, "x")
        axes.set_xlabel(_tau_title(bars))

    spoken = "; ".join(
        f"{b.label}: tau {numbers.time(b.tau_s)}, tau_crit {numbers.time_limit(b.tau_crit_s)}, "
        + ("within" if b.within else "exceeded")
        for b in bars
    )
    title = "Timestamp error of each sensor against its tau_crit"
    lines = _tau_title(bars).count("\n")
    return draw(name, title, spoken, (WIDTH, 60.0 + 26.0 * len(bars) + 12.0 * lines), build)


def _tau_title(bars: Sequence[TauBar]) -> str:
    """The title of the time axis, in two lines beside names that leave it little room."""
    between = "\n" if max((len(b.label) for b in bars), default=0) > LONG_NAME else " "
    return f"timestamp error \u03c4 (bar){between}and \u03c4_crit (mark)"


def _tau_row(axes: Axes, row: int, bar: TauBar, low: float, high: float) -> None:
    colour = GOOD if bar.within else BAD
    end = max(bar.tau_s, low)
    crit = bar.tau_crit_s or high
    axes.barh(row, high - low, left=low, height=0.5, color=SHADE, zorder=1)
    axes.barh(row, end - low, left=low, height=0.5, color=colour, zorder=2)
    used = [("Used", numbers.percent(bar.tau_s / bar.tau_crit_s, 4))] if bar.tau_crit_s else []
    tell(axes, (low, end), (row - 0.25, row + 0.25),
         [("Sensor", bar.label), ("\u03c4", numbers.time(bar.tau_s)),
          ("\u03c4_crit", numbers.time_limit(bar.tau_crit_s)), *used])  # fmt: skip
    if bar.tau_crit_s:
        axes.plot([crit, crit], [row - 0.4, row + 0.4], color=INK, linewidth=2.2, zorder=4)
    beside(axes, row, "\u2713" if bar.within else "\u2717")


@dataclass(frozen=True, slots=True)
class LedgerBar:
    """One additive term of the total error."""

    label: str
    value_m: float
    kind: str  # sensor, sync or systematic


_HATCH = {"sensor": "", "sync": "///", "systematic": "xxx", "underway": "..."}


def ledger(
    terms: Sequence[LedgerBar],
    limit: numbers.Limited | None,
    name: str = "fig-ledger",
    total_m: float | None = None,
) -> InlineChart:
    """The terms as a waterfall that adds up to the total, with the limit.

    total_m: with terms that are too small to be shown; by default the sum of those that are.
    """
    total = math.fsum(t.value_m for t in terms) if total_m is None else total_m

    def build(figure: Figure) -> None:
        axes = add_axes(figure)
        _waterfall(axes, terms, total, limit)
        axes.set_ylim(len(terms) + 0.6, -0.6)
        far = limit is not None and limit.limit > LAX * total
        axes.set_xlim(0, 1.04 * max(total, 0.0 if limit is None or far else limit.limit) or 1.0)
        if limit is not None:
            _mark_limit(axes, limit)
        labels = [*(t.label for t in terms), "total"]
        scales.set_ticks(axes, "y", range(len(labels)), lambda row: labels[int(row)])
        scales.hide_ticks(axes, "y")
        _length_ticks(axes, limit)
        scales.grid(axes, "x")

    spoken = "; ".join(f"{t.label} {numbers.error(t.value_m, limit)}" for t in terms)
    spoken += f"; total {numbers.error(total, limit)}"
    if limit is not None:
        spoken += f"; limit {numbers.limit(limit)}"
    size = (WIDTH, 54.0 + 20.0 * (len(terms) + 1))
    return draw(name, "Terms that add up to the total error", spoken, size, build)


def _waterfall(
    axes: Axes, terms: Sequence[LedgerBar], total: float, limit: numbers.Limited | None
) -> None:
    """Each term's bar starts where the one before ends; the last bar is the total."""
    sizes = [*(term.value_m for term in terms), total]
    start, said, short = 0.0, errors(sizes, limit), errors(sizes, limit, 3)
    shares = alike([(numbers.percent(v / total), v / total) for v in sizes]) if total else []
    for row, term in enumerate(terms):
        colour = {"sensor": SERIES[0], "sync": SERIES[1]}.get(term.kind, SERIES[3])
        axes.barh(
            row, term.value_m, left=start, height=0.62, color=colour, edgecolor=SURFACE,
            linewidth=0.8, hatch=_HATCH.get(term.kind, ""), zorder=3,
        )  # fmt: skip
        start += term.value_m
        beside(axes, row, short[row])
        share = shares[row] if total else numbers.MISSING
        tell(
            axes,
            (start - term.value_m, start),
            (row - 0.31, row + 0.31),
            [("Term", term.label), ("Error", said[row]), ("Share", share)],
        )
    axes.barh(len(terms), total, height=0.62, color=INK, zorder=3)
    beside(axes, len(terms), numbers.error(total, limit))
    tell(axes, (0.0, total), (len(terms) - 0.31, len(terms) + 0.31),
         [("Term", "total"), ("Error", said[-1])])  # fmt: skip


def beside(axes: Axes, row: float, text: str) -> None:
    """A bar's value in the column right of the axes, where no line runs."""
    axes.annotate(
        text, (1.0, row), xycoords=("axes fraction", "data"), xytext=(5, 0),
        textcoords="offset points", va="center", color=INK, annotation_clip=False,
    )  # fmt: skip


def _mark_limit(axes: Axes, limit: numbers.Limited) -> None:
    """The limit's line; one far beyond all bars is told at the edge, for they would be slivers."""
    edge = axes.get_xlim()[1]
    far = limit.limit > edge
    if not far:
        axes.axvline(limit.limit, color=WARN, linewidth=1.6, zorder=4)
    axes.annotate(
        f"limit {numbers.limit(limit)}{BEYOND if far else ''}",
        (min(limit.limit, edge), 1.0),
        xycoords=("data", "axes fraction"),
        xytext=(0, 2),
        textcoords="offset points",
        ha="right",
        va="bottom",
        color=WARN,
        annotation_clip=False,
    )


def _length_ticks(axes: Axes, limit: numbers.Limited | None) -> None:
    """Linear ticks in the unit of the limit, else in the unit ladder."""
    from matplotlib.ticker import MaxNLocator

    ticks = [float(t) for t in MaxNLocator(5).tick_values(*axes.get_xlim())]
    high = axes.get_xlim()[1]
    scales.set_ticks(
        axes,
        "x",
        [t for t in ticks if 0 <= t <= high],
        scales.error_label(limit),
        room=105.0,
    )
