"""Charts of a plan: its path from above, and what is known after each leg."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from syncline_design.planning.result import Plan
from syncline_design.planning.telling import PlanRun
from syncline_design.report import axes as scales
from syncline_design.report import numbers
from syncline_design.report.charts import WIDTH
from syncline_design.report.charts_ways import from_above
from syncline_design.report.palette import INK, MUTED, SERIES
from syncline_design.report.plan_sentences import parameter
from syncline_design.report.svg import InlineChart, add_axes, draw, tell

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST_POINTS = 2000
LEGEND_ROW = 18.0  # SVG units that a row of the legend takes
FAR = 1e6  # times what is asked: not seen yet, and off the scale
_MARKERS: Final = ("o", "s", "^")


def path(run: PlanRun) -> InlineChart:
    """East to the right, north up; every leg in its colour, numbered where it begins."""
    north, east, _ = run.path.position_m.T
    leg, step = np.array(run.leg), max(1, len(run.leg) // MOST_POINTS)

    def build(figure: Figure) -> None:
        axes = add_axes(figure)
        starts: list[tuple[float, float]] = []
        for k in range(len(run.result.legs)):
            own = np.flatnonzero(leg == k)
            if own.size:
                rows = np.unique(np.r_[own[::step], own[-1], min(own[-1] + 1, len(leg) - 1)])
                axes.plot(east[rows], north[rows], color=SERIES[k % len(SERIES)], linewidth=1.4)
                start = float(east[own[0]]), float(north[own[0]])
                tell(axes, *start, [("Mark", f"leg {k + 1} begins"), ("Place", _place(*start))])
                starts.append(start)
        for words, at, colour in _numbered(starts, 0.08 * max(wide, high)):
            label = beside(at, np.c_[east, north][::step], 0.05 * max(wide, high))
            axes.text(*label, words, ha="center", va="center", color=colour, weight="bold",
                      zorder=5)  # fmt: skip
        axes.plot([t.east_m for t in run.result.targets], [t.north_m for t in run.result.targets],
                  "x", color=MUTED, markersize=4)  # fmt: skip
        for one in run.result.targets:
            place = _place(one.east_m, one.north_m)
            tell(axes, one.east_m, one.north_m, [("Mark", f"target {one.label}"), ("Place", place)])
        axes.plot(east[:1], north[:1], "o", color=SERIES[0], markersize=4.5)
        from_above(axes)

    wide, high = float(np.ptp(east)), float(np.ptp(north))
    legs = numbers.counted(len(run.result.legs), "leg")
    targets = numbers.counted(len(run.result.targets), "target")
    spoken = (
        f"{legs} over {numbers.length(wide, 3)} east to west and "
        f"{numbers.length(high, 3)} north to south, {targets}"
    )
    return draw("fig-path", "Path from above", spoken, (WIDTH, 340.0), build)


def beside(at: tuple[float, float], drawn: np.ndarray, apart: float) -> tuple[float, float]:
    """Of places around a point, `apart` from it [m], the one farthest from all that is drawn."""
    angles = np.arange(16) * math.pi / 8.0
    around = np.array(at) + apart * np.c_[np.cos(angles), np.sin(angles)]
    free = [float(np.min(np.hypot(*(drawn - one).T))) for one in around]
    x, y = around[int(np.argmax(free))]
    return float(x), float(y)


def _numbered(
    starts: Sequence[tuple[float, float]], apart: float
) -> list[tuple[str, tuple[float, float], str]]:
    """What stands where legs begin: one label for those less than `apart` apart [m]."""
    found: list[tuple[str, tuple[float, float], str]] = []
    for k, start in enumerate(starts):
        near = next((i for i, (_, one, _) in enumerate(found) if math.dist(one, start) <= apart),
                    None)  # fmt: skip
        if near is None:
            found.append((str(k + 1), start, SERIES[k % len(SERIES)]))
        else:
            found[near] = (f"{found[near][0]}, {k + 1}", found[near][1], INK)
    return found


def _place(east_m: float, north_m: float) -> str:
    return f"{numbers.places(east_m, 1)} m east, {numbers.places(north_m, 1)} m north"


def after(found: Plan) -> InlineChart:
    """Sigma over tolerance after every leg, logarithmic; reached below the line at 1."""
    keys = [k for k in found.after[-1].sigma if k in found.tolerance]
    legs = list(range(1, len(found.after) + 1))
    ratios = [ratio for key in keys for ratio in _ratios(found, key) if ratio < FAR]

    def build(figure: Figure) -> None:
        axes = add_axes(figure)
        for k, key in enumerate(keys):
            again = k // len(SERIES)  # colours are fewer than parameters may be
            axes.plot(legs, _ratios(found, key), marker=_MARKERS[again % len(_MARKERS)],
                      markersize=3.5, linestyle="--" if again else "-",
                      color=SERIES[k % len(SERIES)], label=parameter(key))  # fmt: skip
            for leg, ratio in zip(legs, _ratios(found, key), strict=True):
                tell(axes, leg, min(ratio, FAR), [("Leg", str(leg)), ("Effect", parameter(key)),
                     ("Sigma over asked", numbers.number(ratio, 3))])  # fmt: skip
        axes.axhline(1.0, color=MUTED, linewidth=1.0, linestyle=(0, (5, 3)))
        axes.set_yscale("log")
        low, high = 0.8 * min(*ratios, 1.0), 1.25 * max(*ratios, 1.0)
        axes.set_ylim(low, high)
        scales.set_ticks(axes, "y", scales.log_ticks(low, high, 6), lambda v: numbers.number(v, 6))
        axes.set_xticks(legs)
        axes.set_xlabel("leg")
        axes.set_ylabel("sigma / asked")
        axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)
        scales.grid(axes, "y")

    last = "; ".join(
        f"{parameter(key)} {numbers.number(_ratios(found, key)[-1], 2)}" for key in keys
    )
    return draw("fig-after", "Sigma over what is asked", f"after the last leg {last}",
                (WIDTH, 220.0 + LEGEND_ROW * math.ceil(len(keys) / 2)), build)  # fmt: skip


def _ratios(found: Plan, key: str) -> Sequence[float]:
    return [one.sigma[key] / found.tolerance[key] for one in found.after]
