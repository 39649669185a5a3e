"""Charts of many logs: the evidence for a change, every parameter over the runs or the logs."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from statistics import median
from textwrap import wrap
from typing import TYPE_CHECKING, Final

from syncline_design.campaign.watch_result import RunValue, WatchedRun, e_value_text
from syncline_design.report import axes as scales
from syncline_design.report import numbers
from syncline_design.report.charts import WIDTH
from syncline_design.report.columns import padded
from syncline_design.report.palette import BAD, MUTED, SERIES, SHADE
from syncline_design.report.svg import InlineChart, add_axes, draw, tell
from syncline_design.report.text import shortened

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from syncline_design.diagnosis.result import Estimate, PerLog

Key = tuple[str, str, str, str]  # effect, sensor, stage, parameter
ACROSS: Final = 2
HEIGHT: Final = 130.0  # of a row of panels
PANEL_LETTERS: Final = 18  # of a line of a panel's title, on a phone too
MOST: Final = 1e12
SINGLE: Final = 100  # runs up to which each has a mark of its own


def evidence(runs: Sequence[WatchedRun], threshold: float) -> InlineChart:
    """E-values over the runs in the order in which they are compared, logarithmic; of those beyond
    MOST the place is that of MOST with a triangle that points up, the words are their own."""
    numbers_of, places = [r.run for r in runs], range(len(runs))
    beyond = [place for place, r in enumerate(runs) if (r.e_value or 0.0) > MOST]
    values = [min(max(r.e_value or 0.0, 1e-3), MOST) for r in runs]

    def build(figure: Figure) -> None:
        axes = add_axes(figure)
        axes.plot(places, values, marker="o", markersize=3.5, color=SERIES[0])
        axes.plot(beyond, [MOST] * len(beyond), "^", markersize=7.0, color=SERIES[0])
        for place, run, value in zip(places, runs, values, strict=True):
            told = e_value_text(run.e_value or 0.0)
            tell(axes, place, value, [("Run", str(run.run)), ("e-value", told)])
        axes.axhline(threshold, color=MUTED, linewidth=1.0, linestyle=(0, (5, 3)))
        axes.set_yscale("log")
        low, high = 0.7 * min(values), 2.0 * max(*values, threshold)
        axes.set_ylim(low, high)
        scales.set_ticks(axes, "y", scales.log_ticks(low, high, 6), _e_value_tick)
        _run_ticks(axes, numbers_of)
        axes.set_xlabel("run")
        axes.set_ylabel("e-value")
        scales.grid(axes, "y")

    spoken = (
        f"{e_value_text(runs[-1].e_value or 0.0)} after run {numbers_of[-1]}, alarm from "
        f"{numbers.number(threshold, 3)} on{_beyond_words(len(beyond))}"
    )
    return draw("fig-evidence", "Evidence for a change", spoken, (WIDTH, 220.0), build)


def _beyond_words(count: int) -> str:
    """What the alternative text says of runs whose evidence lies above the drawn range."""
    return f"; {numbers.counted(count, 'run')} above the drawn range" if count else ""


def _e_value_tick(value: float) -> str:
    """`0.1`, `20`, `1000`, and from there on powers of ten."""
    return numbers.number(value, 6) if value <= 1e3 else scales.power_of_ten(value)


def courses(
    runs: Sequence[WatchedRun], keys: Sequence[Key], since: Mapping[Key, Sequence[int]],
    name: str = "fig-courses",
) -> InlineChart:  # fmt: skip
    """A small panel a parameter: values of single runs with their intervals, in the order in which
    the runs are compared; since: the runs with which it changed."""
    across = min(ACROSS, len(keys))
    rows = math.ceil(len(keys) / across)

    def build(figure: Figure) -> None:
        for place, key in enumerate(keys):
            axes = add_axes(figure, rows, across, place + 1)
            _panel(axes, runs, key, since.get(key, ()), many=across > 1)

    changed = ", ".join(f"{e} ({s})" for e, s, *_ in since) or "none"
    counts = f"{numbers.counted(len(keys), 'parameter')} over {numbers.counted(len(runs), 'run')}"
    spoken = f"{counts}; changed: {changed}"
    height = HEIGHT * rows + (30.0 if across > 1 else 90.0)
    return draw(name, "Effects over the runs", spoken, (WIDTH, height), build)  # fmt: skip


def _panel(
    axes: Axes, runs: Sequence[WatchedRun], key: Key, since: Sequence[int], *, many: bool
) -> None:
    points = [(place, v) for place, r in enumerate(runs) for v in r.values if _key(v) == key]
    shown = [(place, v) for place, v in points if v.interval95 is not None]
    scale, unit = _scale([v.interval95 or () for _, v in shown], key[3])
    colour = BAD if since else SERIES[0]
    size, named = _of_words(scale, unit)
    decimals = _decimals([(v.interval95[1] - v.interval95[0]) / size for _, v in shown
                          if v.interval95 is not None])  # fmt: skip
    for place, v in shown:
        low, high = v.interval95 or (0.0, 0.0)
        value, *ends = (numbers.places(x / size, decimals) for x in (v.value, low, high))
        tell(axes, place, v.value / scale, [
            ("Run", str(runs[place].run)), ("Effect", f"{key[0].replace('_', ' ')} ({key[1]})"),
            ("Parameter", (key[3].rpartition("_")[0] or key[3]).replace("_", " ")),
            ("Value", f"{value} {named}".strip()),
            ("95 % interval", " to ".join(f"{end} {named}".strip() for end in ends)),
        ])  # fmt: skip
    _intervals(axes, [(place, v.interval95 or (0.0, 0.0)) for place, v in shown], scale, colour)
    drawn = (
        {"linewidth": 0.9} if len(shown) > SINGLE else {"marker": "o", "markersize": 2.8, "ls": ""}
    )
    axes.plot([place for place, _ in shown], [v.value / scale for _, v in shown], color=colour,
              **drawn)  # fmt: skip
    axes.axhline(0.0, color=MUTED, linewidth=0.8)
    for place, r in enumerate(runs):
        if r.run in since:
            axes.axvline(place - 0.5, color=BAD, linewidth=1.0, linestyle=(0, (4, 3)))
    effect, sensor, _, parameter = key
    name = effect.replace("_", " ")
    lines = wrap(
        f"{name} {sensor}", PANEL_LETTERS, max_lines=2, placeholder="\N{HORIZONTAL ELLIPSIS}"
    )
    title = "\n".join(lines) if many else shortened(f"{name} ({sensor})", 40)
    axes.set_title(title, loc="left", pad=3)
    figure, _, _ = parameter.rpartition("_")
    words = scales.power_of_ten(scale) if unit.startswith("1e") else unit
    axes.set_ylabel(f"{(figure or parameter).replace('_', ' ')}{f' [{words}]' if words else ''}")
    _run_ticks(axes, [r.run for r in runs])
    axes.margins(x=0.06)


def _intervals(
    axes: Axes, ends: Sequence[tuple[int, tuple[float, float]]], scale: float, colour: str
) -> None:
    """Intervals as one path with gaps: a path each makes a page of many runs several times as
    large.  Of many runs they are a pale band behind the values."""
    gap = math.nan
    places = [x for place, _ in ends for x in (place, place, gap)]
    heights = [y for _, (low, high) in ends for y in (low / scale, high / scale, gap)]
    many = len(ends) > SINGLE
    axes.plot(places, heights, color=colour, linewidth=1.2, alpha=0.35 if many else 1.0)


def _decimals(widths: Sequence[float]) -> int:
    """Places at which half of the middle width of these intervals has two digits."""
    half = 0.5 * median(widths) if widths else 0.0
    return max(0, 1 - math.floor(math.log10(half))) if half > 0.0 else 3


def _interval(low: float, high: float, unit: str) -> str:
    """`45.00 ms to 52.08 ms`."""
    ends = (numbers.typeset(f"{numbers.number(end, 4)} {unit}".strip()) for end in (low, high))
    return " to ".join(padded(list(ends)))


def _key(one: RunValue) -> Key:
    return one.effect, one.sensor, one.stage, one.parameter


_BARE: Final = (("", 1.0),)
_UNITS: Final = {  # of a parameter's last word: names with their sizes, the largest first
    "s": (("s", 1.0), ("ms", 1e-3), ("\u00b5s", 1e-6)),
    "m": (("m", 1.0), ("cm", 1e-2), ("mm", 1e-3)),
    "mps": (("m/s", 1.0), ("mm/s", 1e-3)),
    "rad": (("deg", math.pi / 180.0),),
    "radps": (("deg/s", math.pi / 180.0), ("deg/h", math.pi / 648e3)),
} | dict.fromkeys(("rate", "scale", "error"), (("", 1e-2), ("ppm", 1e-6)))  # bare from 0.01 on


def _scale(intervals: Sequence[Sequence[float]], parameter: str) -> tuple[float, str]:
    """A unit in which the values are easy to read: `ms` of `latency_s`."""
    size = max((abs(end) for one in intervals for end in one), default=0.0)
    ladder = _UNITS.get(parameter.rpartition("_")[2], ())
    name, factor = next((one for one in ladder if size >= one[1]), (ladder or _BARE)[-1])
    exponent = math.floor(math.log10(size)) if size > 0.0 else 0
    if not name and not -2 <= exponent <= 3:
        return 10.0**exponent, f"1e{exponent}"
    return (factor, name) if name else (1.0, "")


def _of_words(scale: float, unit: str) -> tuple[float, str]:
    """The same for words: no power of ten stands for a unit there."""
    return (1.0, "") if unit.startswith("1e") else (scale, unit)


def by_log(logs: Sequence[PerLog], common: Mapping[str, Estimate], name: str) -> InlineChart:
    """A panel a parameter: what each log by itself tells, with its interval; common: one value."""
    names = drawn_by_log(logs)
    across = min(ACROSS, len(names))
    rows = math.ceil(len(names) / across)

    def build(figure: Figure) -> None:
        for place, parameter in enumerate(names):
            axes = add_axes(figure, rows, across, place + 1)
            _logs_panel(axes, logs, parameter, common.get(parameter))

    spoken = "; ".join(
        f"{parameter}: " + ", ".join(f"log {one.log} {one.parameters[parameter].text}"
                                     for one in logs)
        for parameter in names
    )  # fmt: skip
    height = HEIGHT * rows + (30.0 if across > 1 else 90.0)
    return draw(name, "Values log by log", spoken, (WIDTH, height), build)


def drawn_by_log(logs: Sequence[PerLog]) -> list[str]:
    """Parameters that every one of several logs tells as a number with an interval."""
    return [
        name
        for name in (logs[0].parameters if len(logs) > 1 else ())
        if all(one.parameters[name].interval95 is not None for one in logs)
    ]


def _logs_panel(
    axes: Axes, logs: Sequence[PerLog], parameter: str, common: Estimate | None
) -> None:  # fmt: skip
    ends = [one.parameters[parameter].interval95 or (0.0, 0.0) for one in logs]
    scale, unit = _scale([*ends, (common and common.interval95) or ()], parameter)
    if common is not None and common.interval95 is not None:
        low, high = common.interval95
        axes.axhspan(low / scale, high / scale, color=SHADE, linewidth=0, zorder=0)
        axes.axhline(0.5 * (low + high) / scale, color=MUTED, linewidth=1.0, linestyle=(0, (5, 3)))
    size, named = _of_words(scale, unit)
    for one, (low, high) in zip(logs, ends, strict=True):
        own = one.parameters[parameter]
        axes.plot([one.log] * 2, [low / scale, high / scale], color=SERIES[0], linewidth=1.4)
        axes.plot([one.log], [0.5 * (low + high) / scale], "o", color=SERIES[0], markersize=4)
        tell(axes, one.log, 0.5 * (low + high) / scale, [
            ("Log", f"{one.log}, {one.file}"), ("Value", own.text),
            ("95 % interval", _interval(low / size, high / size, named)),
        ])  # fmt: skip
    figure, _, _ = parameter.rpartition("_")
    words = scales.power_of_ten(scale) if unit.startswith("1e") else unit
    axes.set_ylabel(f"{(figure or parameter).replace('_', ' ')}{f' [{words}]' if words else ''}")
    axes.set_xlabel("log")
    _whole_ticks(axes, [one.log for one in logs])
    axes.margins(x=0.08)
    scales.grid(axes, "y")


def _whole_ticks(axes: Axes, runs: Sequence[int]) -> None:
    step = max(1, math.ceil((max(runs) - min(runs) + 1) / 6))
    ticks = list(range(min(runs), max(runs) + 1, step))
    axes.set_xticks(ticks)
    axes.set_xticklabels([numbers.count(t) for t in ticks])


def _run_ticks(axes: Axes, runs: Sequence[int]) -> None:
    """Numbers of runs: of the first and of some six round ones, or at round places of runs that
    are out of their order."""
    step = _round_step(len(runs) / 6)
    counted = runs if list(runs) == sorted(runs) else range(1, len(runs) + 1)
    places = [k for k, number in enumerate(counted) if k == 0 or number % step == 0]
    axes.set_xticks(places)
    axes.set_xticklabels([numbers.count(runs[place]) for place in places])


def _round_step(least: float) -> int:
    """1, 2 or 5 times a power of ten, not below so much."""
    power = 10 ** max(0, math.floor(math.log10(least))) if least > 1.0 else 1
    return next(m * power for m in (1, 2, 5, 10) if m * power >= least)
