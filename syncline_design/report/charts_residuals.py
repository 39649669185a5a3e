"""Charts of the residuals: on the track, against the motion, over frequency, normal or not."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from syncline_design.diagnosis.plotted import (
    NormalPlot,
    PlottedTrack,
    Spectrum,
)
from syncline_design.report import axes as scales
from syncline_design.report import charts_diagnosis as drawings
from syncline_design.report import numbers
from syncline_design.report.charts import WIDTH
from syncline_design.report.charts_ways import breadth, from_above, map_height
from syncline_design.report.palette import INK, MUTED, PALE, SERIES
from syncline_design.report.svg import InlineChart, add_axes, draw, tell

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LONGEST = 0.12  # of the map's width: the longest arrow
BINS = 24
UNITS = {"speed": "m/s", "turn_rate": "deg/s", "range": "m", "heading": "deg"}


def longest_m(track: PlottedTrack) -> tuple[float, float]:
    """Longest mean residual before and after [m]."""
    before = [(a.before_north_m**2 + a.before_east_m**2) ** 0.5 for a in track.arrows]
    after = [(a.after_north_m**2 + a.after_east_m**2) ** 0.5 for a in track.arrows]
    return max(before, default=0.0), max(after, default=0.0)


def drawn_larger(track: PlottedTrack) -> float:
    """How many times larger than the map the arrows are drawn."""
    wide = max(breadth(track.north_m), breadth(track.east_m), 1e-9)
    return LONGEST * wide / max(*longest_m(track), 1e-12)


def track_map(track: PlottedTrack, name: str = "fig-track") -> InlineChart:
    """The way from above, with the mean residual of each stretch as an arrow."""
    larger = drawn_larger(track)

    def build(figure: Figure) -> None:
        axes = add_axes(figure)
        axes.plot(track.east_m, track.north_m, color=SERIES[1], alpha=0.4, linewidth=1.2, zorder=1,
                  label="way")  # fmt: skip
        before = [(a.before_east_m, a.before_north_m) for a in track.arrows]
        after = [(a.after_east_m, a.after_north_m) for a in track.arrows]
        words = ((MUTED, PALE, before, "before"), (SERIES[0], 1.0, after, "after"))
        for colour, strength, pairs, label in words:
            tips = [(e.east_m + larger * x, e.north_m + larger * y)
                    for e, (x, y) in zip(track.arrows, pairs, strict=True)]  # fmt: skip
            axes.update_datalim(tips)
            axes.quiver(
                [a.east_m for a in track.arrows], [a.north_m for a in track.arrows],
                [larger * x for x, _ in pairs], [larger * y for _, y in pairs],
                angles="xy", scale_units="xy", scale=1.0, color=colour, width=0.005, alpha=strength,
                label=label, zorder=3,
            )  # fmt: skip
        for arrow in track.arrows:
            sizes = (
                math.hypot(arrow.before_east_m, arrow.before_north_m),
                math.hypot(arrow.after_east_m, arrow.after_north_m),
            )
            place = (f"{numbers.places(arrow.east_m, 1)} m east, "
                     f"{numbers.places(arrow.north_m, 1)} m north")  # fmt: skip
            tell(axes, arrow.east_m, arrow.north_m, [
                ("Place", place), ("Mean residual before", numbers.length(sizes[0], 3)),
                ("after", numbers.length(sizes[1], 3)),
            ])  # fmt: skip
        axes.margins(0.1)
        from_above(axes)
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, 1.25), ncols=3)

    first, last = (numbers.length(size, 3) for size in longest_m(track))
    spoken = f"Mean residual of {len(track.arrows)} stretches: at most {first} before, {last} after"
    size = (WIDTH, map_height(track.north_m, track.east_m))
    return draw(name, "Residuals along the way", spoken, size, build)


def binned(values: Sequence[float], sizes_m: Sequence[float]) -> list[tuple[float, float]]:
    """(middle, root mean square [m]) of rows put in order of a covariate, a share a bin."""
    order = sorted(range(len(values)), key=lambda k: values[k])
    found = []
    for k in range(BINS):
        part = order[k * len(order) // BINS : (k + 1) * len(order) // BINS]
        if part:
            middle = sum(values[i] for i in part) / len(part)
            square = sum(sizes_m[i] ** 2 for i in part) / len(part)
            found.append((middle, square**0.5))
    return found


def against(
    rows: Mapping[str, Sequence[float]],
    before_m: Sequence[float],
    after_m: Sequence[float],
    name: str = "fig-against",
) -> InlineChart:
    """RMS of the residuals before and after, over time and every part of the motion."""

    def build(figure: Figure) -> None:
        every = figure.subplots(len(rows), 1, squeeze=False)[:, 0]
        for axes, (covariate, values) in zip(every, rows.items(), strict=True):
            _against(axes, covariate, binned(values, before_m), binned(values, after_m))
        every[0].legend(loc="upper center", bbox_to_anchor=(0.5, 1.4), ncols=2)

    spoken = "; ".join(
        f"{covariate.replace('_', ' ')}: {_range_of(binned(values, before_m))} before, "
        f"{_range_of(binned(values, after_m))} after"
        for covariate, values in rows.items()
    )
    size = (WIDTH, 40.0 + 105.0 * len(rows))
    return draw(name, "Residuals against the motion", spoken, size, build)


def _against(
    axes: Axes,
    covariate: str,
    before: Sequence[tuple[float, float]],
    after: Sequence[tuple[float, float]],
) -> None:
    axes.spines[["top", "right"]].set_visible(False)
    axes.plot(*zip(*before, strict=True), color=MUTED, marker="s", markersize=3, label="before",
              linestyle=(0, (4, 2)))  # fmt: skip
    axes.plot(*zip(*after, strict=True), color=SERIES[0], marker="o", markersize=3, label="after")
    unit = "s" if covariate == "time" else UNITS[covariate]
    for word, found in (("before", before), ("after", after)):
        for middle, size in found:
            where = f"{numbers.number(middle, 3)} {unit}"
            tell(axes, middle, size, [(covariate.replace("_", " "), where),
                 ("Residuals", word), ("RMS", numbers.length(size, 3))])  # fmt: skip
    axes.set_xlabel(f"{covariate.replace('_', ' ')} [{unit}]")
    axes.set_ylabel("RMS")
    top = 1.08 * max(size for _, size in (*before, *after)) or 1.0
    axes.set_ylim(0.0, top)
    drawings.length_ticks(axes, 0.0, top)
    scales.grid(axes, "y")


def _range_of(found: Sequence[tuple[float, float]]) -> str:
    sizes = [size for _, size in found]
    return f"{numbers.length(min(sizes), 2)} to {numbers.length(max(sizes), 2)}"


def spectrum(found: Spectrum, name: str = "fig-spectrum") -> InlineChart:
    """Power of the whitened remainder over frequency, with what white noise seldom exceeds."""

    def build(figure: Figure) -> None:
        axes = add_axes(figure)
        axes.plot(found.frequency_hz, found.most, color=MUTED, linewidth=1, linestyle=(0, (3, 2)),
                  label="white noise seldom exceeds")  # fmt: skip
        axes.plot(found.frequency_hz, found.power, color=SERIES[0], marker="o", markersize=3,
                  linewidth=1.4, label="what is left")  # fmt: skip
        axes.axhline(1.0, color=INK, linewidth=0.8)
        for hertz, power, most in zip(found.frequency_hz, found.power, found.most, strict=True):
            tell(axes, hertz, power, [("Frequency", f"{numbers.number(hertz, 3)} Hz"),
                 ("Power", numbers.number(power, 3)),
                 ("White noise seldom exceeds", numbers.number(most, 3))])  # fmt: skip
        axes.set_xscale("log")
        low, high = found.frequency_hz[0], found.frequency_hz[-1]
        scales.set_ticks(
            axes, "x", scales.one_two_five(low, high)[::2], lambda v: numbers.number(v, 6)
        )
        axes.set_ylim(0.0, 1.1 * max(*found.power, *found.most))
        axes.set_xlabel("frequency [Hz]")
        axes.set_ylabel("power over white noise's")
        axes.legend(loc="upper right")
        scales.grid(axes)

    top = max(range(len(found.power)), key=lambda k: found.power[k] / found.most[k])
    spoken = (
        f"Highest against what white noise seldom exceeds at "
        f"{numbers.number(found.frequency_hz[top], 3)} Hz: "
        f"{numbers.number(found.power[top], 3)} of {numbers.number(found.most[top], 3)}"
    )
    return draw(name, "Spectrum of what is left", spoken, (WIDTH, 260.0), build)


def normal(found: NormalPlot, name: str = "fig-normal") -> InlineChart:
    """Quantiles of the whitened remainder against those of the standard normal."""

    def build(figure: Figure) -> None:
        axes = add_axes(figure)
        ends = (found.normal[0], found.normal[-1])
        axes.plot(ends, ends, color=MUTED, linewidth=1, linestyle=(0, (3, 2)), label="normal")
        axes.plot(found.normal, found.remainder, color=SERIES[0], marker="o", markersize=3.5,
                  linewidth=1.2, label="what is left")  # fmt: skip
        for normal_at, at in zip(found.normal, found.remainder, strict=True):
            tell(axes, normal_at, at, [("Standard normal", numbers.places(normal_at, 2)),
                 ("What is left", numbers.places(at, 2))])  # fmt: skip
        axes.set_xlabel("quantile of the standard normal")
        axes.set_ylabel("quantile, in its own sigma")
        axes.legend(loc="upper left")
        scales.grid(axes)

    normal, rest = (
        f"{numbers.places(row[0], 2)} and {numbers.places(row[-1], 2, sign=True)}"
        for row in (found.normal, found.remainder)
    )
    spoken = f"At {normal} the remainder is at {rest}"
    return draw(name, "Normal plot of what is left", spoken, (WIDTH, 300.0), build)
