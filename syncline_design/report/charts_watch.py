"""Charts of a watch: the evidence for a change, and every parameter over the runs."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Final

from syncline_design.campaign.watch_result import RunValue, WatchedRun, e_value_text
from syncline_design.report import axes as scales
from syncline_design.report import numbers
from syncline_design.report.charts import WIDTH
from syncline_design.report.palette import BAD, MUTED, SERIES
from syncline_design.report.svg import InlineChart, add_axes, draw, tell
from syncline_design.report.text import shortened

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Key = tuple[str, str, str, str]  # effect, sensor, stage, parameter
ACROSS: Final = 2
HEIGHT: Final = 118.0  # of a row of panels
MOST: Final = 1e12


def evidence(runs: Sequence[WatchedRun], threshold: float) -> InlineChart:
    """E-values over the runs, logarithmic."""
    numbers_of = [r.run for r in runs]
    values = [min(max(r.e_value or 0.0, 1e-3), MOST) for r in runs]

    def build(figure: Figure) -> None:
        axes = add_axes(figure)
        axes.plot(numbers_of, values, marker="o", markersize=3.5, color=SERIES[0])
        for run, value in zip(numbers_of, values, strict=True):
            tell(axes, run, value, [("Run", str(run)), ("e-value", numbers.number(value, 3))])
        axes.axhline(threshold, color=MUTED, linewidth=1.0, linestyle=(0, (5, 3)))
        axes.set_yscale("log")
        low, high = 0.7 * min(values), 2.0 * max(*values, threshold)
        axes.set_ylim(low, high)
        scales.set_ticks(axes, "y", scales.log_ticks(low, high, 6), lambda v: numbers.number(v, 6))
        _whole_ticks(axes, numbers_of)
        axes.set_xlabel("run")
        axes.set_ylabel("e-value")
        scales.grid(axes, "y")

    spoken = (
        f"{e_value_text(values[-1])} after run {numbers_of[-1]}, alarm from "
        f"{numbers.number(threshold, 3)} on"
    )
    return draw("fig-evidence", "Evidence for a change", spoken, (WIDTH, 220.0), build)


def courses(
    runs: Sequence[WatchedRun], keys: Sequence[Key], since: Mapping[Key, int],
    name: str = "fig-courses",
) -> InlineChart:  # fmt: skip
    """A small panel a parameter: values of single runs with their intervals."""
    across = min(ACROSS, len(keys))
    rows = math.ceil(len(keys) / across)

    def build(figure: Figure) -> None:
        for place, key in enumerate(keys):
            axes = add_axes(figure, rows, across, place + 1)
            _panel(axes, runs, key, since.get(key), many=across > 1)

    changed = ", ".join(f"{e} ({s})" for e, s, *_ in since) or "none"
    spoken = f"{len(keys)} parameters over {len(runs)} runs; changed: {changed}"
    height = HEIGHT * rows + (30.0 if across > 1 else 90.0)
    return draw(name, "Effects over the runs", spoken, (WIDTH, height), build)  # fmt: skip


def _panel(
    axes: Axes, runs: Sequence[WatchedRun], key: Key, since: int | None, *, many: bool
) -> None:
    points = [(r.run, v) for r in runs for v in r.values if _key(v) == key]
    shown = [(run, v) for run, v in points if v.interval95 is not None]
    scale, unit = _scale([v for _, v in shown], key[3])
    colour = BAD if since is not None else SERIES[0]
    for run, v in shown:
        low, high = v.interval95 or (0.0, 0.0)
        tell(axes, run, v.value / scale, [
            ("Run", str(run)), ("Effect", f"{key[0].replace('_', ' ')} ({key[1]})"),
            ("Value", f"{numbers.number(v.value / scale, 4)} {unit}"),
            ("95 % interval", f"{numbers.number(low / scale, 4)} to "
                              f"{numbers.number(high / scale, 4)} {unit}"),
        ])  # fmt: skip
        axes.plot([run, run], [low / scale, high / scale], color=colour, linewidth=1.2)
    axes.plot([run for run, _ in shown], [v.value / scale for _, v in shown], "o", color=colour,
              markersize=2.8)  # fmt: skip
    axes.axhline(0.0, color=MUTED, linewidth=0.8)
    if since is not None:
        axes.axvline(since - 0.5, color=BAD, linewidth=1.0, linestyle=(0, (4, 3)))
    effect, sensor, _, parameter = key
    title = shortened(f"{effect.replace('_', ' ')} ({sensor})", 20 if many else 40)
    axes.set_title(title, loc="left", pad=3)
    figure, _, _ = parameter.rpartition("_")
    axes.set_ylabel(f"{figure or parameter}{f', {unit}' if unit else ''}")
    _whole_ticks(axes, [r.run for r in runs])
    axes.margins(x=0.06)


def _key(one: RunValue) -> Key:
    return one.effect, one.sensor, one.stage, one.parameter


def _scale(values: Sequence[RunValue], parameter: str) -> tuple[float, str]:
    """A unit in which the values are easy to read: `ms` of `latency_s`."""
    size = max((max(abs(end) for end in v.interval95 or (0.0,)) for v in values), default=0.0)
    suffix = parameter.rpartition("_")[2]
    for unit, factor, name in (("s", 1.0, "s"), ("s", 1e-3, "ms"), ("s", 1e-6, "\u00b5s"),
                               ("m", 1.0, "m"), ("m", 1e-2, "cm"), ("m", 1e-3, "mm"),
                               ("rad", math.pi / 180.0, "deg")):  # fmt: skip
        if suffix == unit and (size >= factor or name in ("\u00b5s", "mm", "deg")):
            return factor, name
    power = 10.0 ** math.floor(math.log10(size)) if size > 0.0 else 1.0
    exponent = round(math.log10(power))
    return (1.0, suffix if suffix == "radps" else "") if -2 <= exponent <= 3 else (
        power, f"1e{exponent}{' rad/s' if suffix == 'radps' else ''}")  # fmt: skip


def _whole_ticks(axes: Axes, runs: Sequence[int]) -> None:
    step = max(1, math.ceil((max(runs) - min(runs) + 1) / 6))
    ticks = list(range(min(runs), max(runs) + 1, step))
    axes.set_xticks(ticks)
    axes.set_xticklabels([numbers.count(t) for t in ticks])
