"""Charts of a diagnosis: residuals before and after, where they live, the gap step by step."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.report import axes as scales
from syncline_design.report import numbers
from syncline_design.report.charts import WIDTH, beside
from syncline_design.report.palette import MUTED, PALE, SERIES
from syncline_design.report.svg import InlineChart, add_axes, draw, tell
from syncline_design.report.text import shortened

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


STRETCHES = 20  # of time, whose residuals are told together: more than a key is pressed through


@dataclass(frozen=True, slots=True)
class ResidualAxis:
    """Residuals of one axis [m] over the common time; signature: what the named effects explain."""

    name: str
    before_m: tuple[float, ...]
    after_m: tuple[float, ...]
    signature_m: tuple[float, ...]


def residuals(
    time_s: Sequence[float], shown: Sequence[ResidualAxis], name: str = "fig-residuals"
) -> InlineChart:
    """Residuals per axis before and after, with the named effects' own signature."""

    def build(figure: Figure) -> None:
        rows = figure.subplots(len(shown), 1, sharex=True, squeeze=False)[:, 0]
        for axes, axis in zip(rows, shown, strict=True):
            axes.spines[["top", "right"]].set_visible(False)
            axes.plot(
                time_s, axis.before_m, ".", markersize=2.6, color=(MUTED, PALE), label="before"
            )
            if axis.signature_m:
                axes.plot(time_s, axis.signature_m, color=SERIES[1], linewidth=1.4,
                          label="named effect")  # fmt: skip
            if axis.after_m:
                axes.plot(time_s, axis.after_m, ".", markersize=2.2, color=SERIES[0], label="after")
            axes.set_ylabel(axis.name)
            _tell_stretches(axes, time_s, axis)
            low, high = axes.get_ylim()
            length_ticks(axes, low, high)
            scales.grid(axes)
        rows[0].legend(loc="upper center", bbox_to_anchor=(0.5, 1.32), ncols=3, markerscale=4)
        rows[-1].set_xlabel("time [s]")

    spoken = "; ".join(
        f"{axis.name}: {_rms_words(axis.before_m)} before"
        + (f", {_rms_words(axis.after_m)} after" if axis.after_m else "")
        for axis in shown
    )
    size = (WIDTH, 60.0 + 100.0 * len(shown))
    return draw(name, "Residuals before and after", spoken, size, build)


def _tell_stretches(axes: Axes, time_s: Sequence[float], axis: ResidualAxis) -> None:
    """What the readings of a stretch of time come to, in its middle."""
    rows = len(time_s)
    for k in range(min(STRETCHES, rows)):
        own = slice(k * rows // min(STRETCHES, rows), (k + 1) * rows // min(STRETCHES, rows))
        times, before, after = time_s[own], axis.before_m[own], axis.after_m[own]
        ends = [f"{numbers.places(at, 1)}\N{NO-BREAK SPACE}s" for at in (times[0], times[-1])]
        said = [("Axis", axis.name), ("Time", " to ".join(ends)), ("Before", _rms_words(before))]
        if after:
            said.append(("After", _rms_words(after)))
        middle = sum(times) / len(times)
        tell(axes, middle, sum(before) / len(before) if before else 0.0, said)


def _rms_words(values: Sequence[float]) -> str:
    if not values:
        return "nothing"
    rms = (sum(value * value for value in values) / len(values)) ** 0.5
    return f"{numbers.length(rms, 3)} RMS"


def length_ticks(axes: Axes, low: float, high: float) -> None:
    """Some four ticks of a length."""
    from matplotlib.ticker import MaxNLocator

    places = [float(t) for t in MaxNLocator(4).tick_values(low, high) if low <= t <= high]
    scales.set_ticks(axes, "y", places, lambda v: "0" if v == 0 else scales.short_length(v))


@dataclass(frozen=True, slots=True)
class Step:
    """The gap on held-out data after one addition."""

    label: str
    rms_m: float


def gap_staircase(
    steps: Sequence[Step], floor_m: float | None, name: str = "fig-gap"
) -> InlineChart:
    """RMS on held-out data as effects are added, down to the floor of the spec's own noise.

    All in the unit that the largest is told in.
    """
    largest = max([floor_m or 0.0, *(step.rms_m for step in steps)])
    unit = numbers.with_uncertainty(largest, None, "m")

    def shown(value_m: float, digits: int = 4) -> str:
        return numbers.like(unit, value_m, digits)

    def build(figure: Figure) -> None:
        axes = add_axes(figure)
        for row, step in enumerate(steps):
            axes.barh(row, step.rms_m, height=0.6, color=SERIES[0] if row else MUTED, zorder=3)
            beside(axes, row, shown(step.rms_m, 3))
            tell(
                axes,
                (0.0, step.rms_m),
                (row - 0.3, row + 0.3),
                [("After", step.label), ("RMS held out", shown(step.rms_m))],
            )
        axes.set_xlim(0, 1.05 * largest or 1.0)
        if floor_m:
            _mark_floor(axes, floor_m, shown(floor_m, 3))
        axes.set_ylim(len(steps) - 0.4, -0.6)
        labels = [shortened(step.label, 30) for step in steps]
        scales.set_ticks(axes, "y", range(len(labels)), lambda row: labels[int(row)])
        scales.hide_ticks(axes, "y")
        scales.set_ticks(axes, "x", _linear(axes.get_xlim()[1]),
                         lambda v: "0" if v == 0 else shown(v, 3), 150.0)  # fmt: skip
        scales.grid(axes, "x")
        axes.set_xlabel("RMS of the residual on held-out data")

    spoken = "; ".join(f"{step.label}: {shown(step.rms_m)}" for step in steps)
    if floor_m:
        spoken += f"; floor {shown(floor_m)}"
    size = (WIDTH, 76.0 + 26.0 * len(steps))
    return draw(name, "Gap on held-out data, step by step", spoken, size, build)


def _mark_floor(axes: Axes, floor_m: float, said: str) -> None:
    axes.axvline(floor_m, color=SERIES[2], linewidth=1.6, linestyle=(0, (5, 3)), zorder=4)
    axes.annotate(
        f"floor {said}", (floor_m, 1.0), xycoords=("data", "axes fraction"),
        xytext=(0, 2), textcoords="offset points", va="bottom", ha="center", color=SERIES[2],
        annotation_clip=False,
    )  # fmt: skip


def _linear(high: float) -> list[float]:
    from matplotlib.ticker import MaxNLocator

    return [float(t) for t in MaxNLocator(5).tick_values(0.0, high) if 0.0 <= t <= high]


@dataclass(frozen=True, slots=True)
class WhereCells:
    """Disagreement over the cells of one covariate: (low, high, score)."""

    covariate: str
    unit: str
    cells: tuple[tuple[float, float, float], ...]


def largest(maps: Sequence[WhereCells]) -> float:
    """The largest disagreement of these: charts beside one another share its scale."""
    return max((score for m in maps for *_, score in m.cells), default=1.0) or 1.0


def where_map(maps: Sequence[WhereCells], top: float, name: str = "fig-where") -> InlineChart:
    """Disagreement in standard errors over cells of speed, turn rate, range and so on."""

    def build(figure: Figure) -> None:
        rows = figure.subplots(len(maps), 1, squeeze=False)[:, 0]
        for axes, entry in zip(rows, maps, strict=True):
            axes.spines[["top", "right"]].set_visible(False)
            edges = [entry.cells[0][0], *(high for _, high, _ in entry.cells)]
            scores = [score for *_, score in entry.cells]
            axes.stairs(scores, edges, fill=True, color=SERIES[0], alpha=0.5)
            axes.stairs(scores, edges, color=SERIES[0], linewidth=1.2)
            for low, high, score in entry.cells:
                tell(axes, (low, high), (0.0, score), [
                    (entry.covariate.replace("_", " "), f"{numbers.number(low, 3)} to "
                                                        f"{numbers.number(high, 3)} {entry.unit}"),
                    ("Standard errors", numbers.number(score, 3)),
                ])  # fmt: skip
            axes.axhline(3.0, color=MUTED, linewidth=1, linestyle=(0, (3, 2)))
            axes.set_ylim(0, 1.08 * max(top, 4.0))
            unit = f" [{entry.unit}]" if entry.unit else ""
            axes.set_xlabel(entry.covariate.replace("_", " ") + unit)
            axes.set_ylabel("|z|")
            scales.grid(axes, "y")

    spoken = "; ".join(
        f"{entry.covariate}: standard errors "
        f"{numbers.number(min(s for *_, s in entry.cells), 3)} to "
        f"{numbers.number(max(s for *_, s in entry.cells), 3)}"
        for entry in maps
    )
    size = (WIDTH, 20.0 + 105.0 * len(maps))
    return draw(name, "Where simulation and log disagree", spoken, size, build)


def coverage(rows: Sequence[tuple[float, float, float]], name: str = "fig-coverage") -> InlineChart:
    """Share of residuals inside the expected interval against its nominal share.

    rows: (nominal, before, after), each a share of 1.
    """

    def build(figure: Figure) -> None:
        axes = add_axes(figure)
        nominal = [row[0] for row in rows]
        axes.plot([0, 1], [0, 1], color=MUTED, linewidth=1, linestyle=(0, (3, 2)))
        axes.plot(nominal, [row[1] for row in rows], color=MUTED, marker="s", markersize=4,
                  linewidth=1.2, label="before")  # fmt: skip
        axes.plot(nominal, [row[2] for row in rows], color=SERIES[0], marker="o", markersize=4.5,
                  linewidth=1.8, label="after")  # fmt: skip
        for share, before, after in rows:
            tell(
                axes,
                share,
                after,
                [
                    ("Nominal", numbers.percent(share)),
                    ("Before", numbers.percent(before)),
                    ("After", numbers.percent(after)),
                ],
            )
        axes.set_xlim(0, 1.02)
        axes.set_ylim(0, 1.02)
        quarters = (0.0, 0.25, 0.5, 0.75, 1.0)
        scales.set_ticks(axes, "x", quarters, numbers.percent)
        scales.set_ticks(axes, "y", quarters, numbers.percent)
        axes.set_xlabel("nominal share inside the interval")
        axes.set_ylabel("observed share")
        axes.legend(loc="upper left")
        scales.grid(axes)

    spoken = "; ".join(
        f"nominal {numbers.percent(n)}: {numbers.percent(b)} before, {numbers.percent(a)} after"
        for n, b, a in rows
    )
    return draw(name, "Coverage of the expected intervals", spoken, (WIDTH, 280.0), build)
