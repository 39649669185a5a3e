"""A datasheet figure that alone changes the choice, and the nearest value at which it does."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from fractions import Fraction
from typing import Final

from syncline_design.choice.outcome import NoVerdict, OutOfTime
from syncline_design.choice.variations import SheetFigure
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.records import Record
from syncline_design.model.figure_text import format_like

ASSUMED_SPREAD = Fraction(1, 5)  # where a datasheet gives no tolerance
HALVINGS: Final = 8  # of the way to an end: 20 % to less than 0.1 %
Ends = tuple[float, float]


@dataclass(frozen=True, slots=True)
class OtherChoice:
    """What a choice becomes, and by how much the objective changes; None: nothing can be chosen."""

    becomes: str
    objective_change: float | None


@dataclass(frozen=True, slots=True)
class Measurement(Record):
    """A datasheet figure that alone changes the choice when it lies at one end of its range.

    value and at are in SI; value_text is the figure as written, at_text the other end in its unit.
    assumed_tolerance: the datasheet gives no tolerance and 20 % to either side was tried.
    becomes, objective_change: at that end.  nearest: the value on the way there at which the choice
    is another already, what it becomes there; found by halving the way, to a 256th of it.
    """

    figure: str
    value: float
    at: float
    value_text: str
    at_text: str
    assumed_tolerance: bool
    becomes: str
    objective_change: float | None
    nearest: float
    nearest_text: str
    nearest_becomes: str
    nearest_objective_change: float | None


def ends_tried(figure: SheetFigure, *, assumed: bool) -> Ends:
    """The values that are tried."""
    value = figure.quantity
    if not assumed:
        return value.low, value.high
    spread = value.exact * ASSUMED_SPREAD
    return float(value.exact - spread), float(value.exact + spread)


def changes(
    figure: SheetFigure, *, assumed: bool, choice: Callable[[float], OtherChoice | None]
) -> Iterator[Measurement]:
    """The ends of a figure's range at which the choice is another.

    choice: what it becomes with the figure at a value; None where it stays.
    """
    value = figure.quantity
    for end in ends_tried(figure, assumed=assumed):
        then = _proven(choice, end)
        if then is None:
            continue
        nearest, first = _nearest(float(value), end, then, choice)
        yield Measurement(
            figure.name, float(value), end, value.text, format_like(value.text, end), assumed,
            then.becomes, then.objective_change, nearest, format_like(value.text, nearest),
            first.becomes, first.objective_change,
        )  # fmt: skip


def _nearest(
    now: float, end: float, then: OtherChoice, choice: Callable[[float], OtherChoice | None]
) -> tuple[float, OtherChoice]:
    """The value nearest to the present one that is known to change the choice."""
    stays, changed = now, end
    for _ in range(HALVINGS):
        middle = 0.5 * (stays + changed)
        found = _proven(choice, middle)
        if found is None:
            stays = middle
        else:
            changed, then = middle, found
    return changed, then


def _proven(choice: Callable[[float], OtherChoice | None], value: float) -> OtherChoice | None:
    try:
        return choice(value)
    except OutOfTime:
        raise
    except NoVerdict:  # what cannot be proven is not claimed
        return None


def weight(one: Measurement) -> float:
    """How much the objective changes; where nothing is left to choose, most."""
    return math.inf if one.objective_change is None else abs(one.objective_change)
