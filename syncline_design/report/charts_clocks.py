"""Who stamps whom: every sensor, the signal and method that stamp it, the clock that they go by.

A row a sensor, grouped by vehicle; an arrow ends at the bar of the clock whose time its stamps are
in: the vehicle's host clock, or UTC.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from textwrap import wrap
from typing import TYPE_CHECKING, Final

from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.report import numbers
from syncline_design.report.charts import WIDTH
from syncline_design.report.palette import BAD, GRID, INK, LINE, MUTED, SERIES, SHADE
from syncline_design.report.svg import InlineChart, draw, tell
from syncline_design.report.text import shortened, unbroken, visible

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ROW: Final = 44.0  # height of a sensor's row with one line of each, and below
STEP: Final = 15.0  # from line to line
HEAD: Final = 20.0  # of a vehicle's name [SVG units]
BOX, HOST, UTC, BAR = 112.0, 268.0, 318.0, 18.0  # right end of the boxes; left ends; width
LETTERS: Final = 17, 28  # in a line of a box, in one above or below an arrow
CLOCK_LETTERS: Final = 40  # in a line of a clock's name
_MARK: Final = re.compile(r"(?<=[._/])(?=\w)")
_JOINED: Final = "\N{WORD JOINER}"  # begins what goes on with a word
_DOT: Final = " \N{MIDDLE DOT} "
MOST_LINES: Final = 3  # of a name: a longer one is cut, its tooltip has it in full


@dataclass(frozen=True, slots=True)
class Stamped:
    """One sensor: what it is, what stamps it, by which clock, with what error.

    within: whether tau stays below tau_crit; signal: PPS, network time and so on.
    """

    role: str
    sensor: str
    signal: str
    method: str
    by_utc: bool
    tau_s: float
    tau_crit_s: float | None
    within: bool


@dataclass(frozen=True, slots=True)
class ClockedVehicle:
    """The sensors of one vehicle and its host clock; offset_s None: taken as in step with UTC."""

    name: str
    sensors: tuple[Stamped, ...]
    clock: str
    offset_s: float | None


def clocks(vehicles: Sequence[ClockedVehicle], name: str = "fig-clocks") -> InlineChart:
    """Sensors to the left, clocks to the right, tau on every arrow between them."""
    rows = sum(_high(one) for vehicle in vehicles for one in vehicle.sensors)
    height = HEAD + HEAD * len(vehicles) + rows + sum(map(_clock_high, vehicles))

    def build(figure: Figure) -> None:
        figure.set_layout_engine("none")
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        axes.set_axis_off()
        axes.set_xlim(0.0, WIDTH)
        axes.set_ylim(height, 0.0)
        _bar(axes, UTC, HEAD, height, "UTC", SERIES[2])
        top = HEAD
        for vehicle in vehicles:
            top = _vehicle(axes, vehicle, top)

    spoken = "; ".join(
        f"{one.role} {one.sensor}: {one.signal}, {one.method}, in "
        f"{'UTC' if one.by_utc else 'host time'}, tau {numbers.time(one.tau_s)}"
        for vehicle in vehicles
        for one in vehicle.sensors
    )
    return draw(name, "Who stamps whom", spoken, (WIDTH, height), build)


def _lines(text: str, letters: int) -> list[str]:
    """A name in lines, broken where its words are, a longer one after its dots, no unit off."""
    parted = " ".join(
        _MARK.sub(f" {_JOINED}", word) if len(word) > letters else word
        for word in unbroken(visible(text)).split(" ")
    )
    found = [line.replace(f" {_JOINED}", "").replace(_JOINED, "") for line in wrap(parted, letters)]
    if len(found) <= MOST_LINES:
        return found
    return [*found[: MOST_LINES - 1], shortened(f"{found[MOST_LINES - 1]} ...", letters)]


def _role(text: str) -> str:
    """`multi... · position`: what cannot stay of a role is the end of its stage's name."""
    stage, dot, role = text.rpartition(_DOT)
    left = LETTERS[0] - len(dot) - len(role)
    return (
        f"{shortened(stage, left)}{dot}{role}" if dot and left > 1 else shortened(text, LETTERS[0])
    )


def _signal(one: Stamped) -> str:
    return f"\u03c4 {numbers.time(one.tau_s, 3)}, {one.signal}"


def _high(one: Stamped) -> float:
    """Height of a sensor's row: what stands below one another in its box and at its arrow."""
    in_box = len(_lines(one.sensor, LETTERS[0])) - 1
    at_arrow = sum(len(_lines(text, LETTERS[1])) - 1 for text in (one.method, _signal(one)))
    return ROW + STEP * max(in_box, at_arrow)


def _clock_high(vehicle: ClockedVehicle) -> float:
    """Height of the row of a vehicle's own clock."""
    return ROW + STEP * (len(_lines(vehicle.clock, CLOCK_LETTERS)) - 1)


def _vehicle(axes: Axes, vehicle: ClockedVehicle, top: float) -> float:
    """One vehicle from `top` downwards; where it ends."""
    axes.text(4.0, top + 0.5 * HEAD, shortened(vehicle.name, 40), va="center", color=MUTED)
    first = top + HEAD
    end = first + sum(map(_high, vehicle.sensors))
    bottom = end + _clock_high(vehicle)
    _bar(axes, HOST, first, bottom - 8.0, "host clock", SERIES[0])
    above = first
    for one in vehicle.sensors:
        _sensor(axes, one, above + 0.5 * _high(one))
        above += _high(one)
    _to_utc(axes, vehicle, bottom - 0.5 * ROW - 4.0)
    return bottom


def _bar(axes: Axes, left: float, top: float, bottom: float, words: str, colour: str) -> None:
    from matplotlib.patches import Rectangle

    axes.add_patch(Rectangle((left, top), BAR, bottom - top, facecolor=SHADE, edgecolor=colour,
                             linewidth=1.2, zorder=1))  # fmt: skip
    axes.text(left + 0.5 * BAR, 0.5 * (top + bottom), words, rotation=90, ha="center",
              va="center", color=INK, zorder=5, gid=f"cell-{words}-{round(top)}")  # fmt: skip


def _sensor(axes: Axes, one: Stamped, y: float) -> None:
    from matplotlib.patches import Rectangle

    high = _high(one) - 12.0
    axes.add_patch(Rectangle((2.0, y - 0.5 * high), BOX - 2.0, high, facecolor="none",
                             edgecolor=GRID, linewidth=1.2))  # fmt: skip
    names = _lines(one.sensor, LETTERS[0])
    head = y - 0.5 * STEP * len(names)
    axes.text(8.0, head, _role(one.role), va="center", color=MUTED)
    for k, name in enumerate(names, 1):
        axes.text(8.0, head + k * STEP, name, va="center", color=INK)
    colour = LINE if one.within else BAD
    end = UTC if one.by_utc else HOST
    methods, signals = _lines(one.method, LETTERS[1]), _lines(_signal(one), LETTERS[1])
    at = y + 0.5 * STEP * (len(methods) - len(signals))
    _arrow(axes, BOX, end, at, colour)
    for k, words in enumerate(reversed(methods)):
        axes.text(BOX + 5.0, at - 10.0 - k * STEP, words, va="center", color=INK)
    for k, words in enumerate(signals):
        axes.text(BOX + 5.0, at + 10.0 + k * STEP, words, va="center", color=colour)
    tell(axes, (2.0, HOST), (y - 0.5 * high, y + 0.5 * high), [
        ("Sensor", f"{one.role}: {one.sensor}"), ("Signal", one.signal),
        ("Stamped by", one.method), ("In the time of", "UTC" if one.by_utc else "the host clock"),
        ("\u03c4", numbers.time(one.tau_s)), ("\u03c4_crit", numbers.time_limit(one.tau_crit_s)),
    ])  # fmt: skip


def _to_utc(axes: Axes, vehicle: ClockedVehicle, y: float) -> None:
    """How the host clock keeps to UTC; taken as the same where nothing is said of it."""
    offset = "in step" if vehicle.offset_s is None else (
        f"within {numbers.time(vehicle.offset_s, 3)}"
    )  # fmt: skip
    _arrow(axes, HOST + BAR, UTC, y, MUTED)
    for k, words in enumerate(reversed(_lines(vehicle.clock, CLOCK_LETTERS))):
        axes.text(HOST - 5.0, y - 7.0 - k * STEP, words, ha="right", va="center", color=MUTED)
    axes.text(HOST - 5.0, y + 7.0, f"{offset} of UTC" if vehicle.offset_s is not None else
              "taken as in step with UTC", ha="right", va="center", color=MUTED)  # fmt: skip
    bound = numbers.MISSING if vehicle.offset_s is None else numbers.time(vehicle.offset_s)
    tell(axes, (HOST, UTC), (y - 8.0, y + 8.0), [
        ("Sensor", f"host clock of {vehicle.name}"), ("Stamped by", vehicle.clock),
        ("In the time of", "UTC"), ("\u03c4", bound),
    ])  # fmt: skip


def _arrow(axes: Axes, left: float, right: float, y: float, colour: str) -> None:
    axes.annotate("", (right, y), (left, y), zorder=3, arrowprops={
        "arrowstyle": "-|>", "color": colour, "linewidth": 1.4, "shrinkA": 0.0, "shrinkB": 0.0,
        "mutation_scale": 9.0,
    })  # fmt: skip
