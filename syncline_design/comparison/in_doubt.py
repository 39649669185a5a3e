"""What a log shows beyond doubt without telling which assumption it breaks: one of a group.

Everything that explains a departure as well as what was named is a way of it.  A row that every way
breaks is broken; the others are a group of which at least one is, each with the figure it would
have.
"""

from __future__ import annotations

from collections.abc import Sequence

from syncline_design.comparison.acceptance import MeasuredFigure
from syncline_design.comparison.departing import Departing
from syncline_design.diagnosis.result import Finding
from syncline_design.machine.quick_dataclass import dataclass


@dataclass(frozen=True, slots=True)
class OneWay:
    """Departures that together are one explanation; probability: its odds among the others.

    together: whether all other sensors are late by as much as the one that was named is early,
    which no drive over ground that stands still tells from it.
    """

    parts: tuple[Departing, ...]
    probability: float | None = None
    together: bool = False

    @property
    def words(self) -> str:
        """`latency (ranging) of 20 ms with lever_arm (ranging) of ...`."""
        return " with ".join(part.words for part in self.parts)

    @property
    def name(self) -> str:
        """The same without figures."""
        return " with ".join(part.name for part in self.parts)

    @property
    def effects(self) -> tuple[str, ...]:
        """Names of all its departures."""
        return tuple(part.effect for part in self.parts)


@dataclass(frozen=True, slots=True)
class InDoubt:
    """What was found, in words, and all ways to explain it, that of the words first.

    from_s, to_s: the stretch in which it acts, where it does so in a part of the log alone.
    finding: of the diagnosis, where it is one.  may_be_sound: whether one way is what a sound
    sensor does as well.
    """

    found: str
    ways: tuple[OneWay, ...]
    from_s: float | None = None
    to_s: float | None = None
    finding: Finding | None = None
    may_be_sound: bool = False

    def words_of(self, own: Sequence[OneWay]) -> str:
        """What a row is told of it that some of the ways would break."""
        others = " or ".join(way.name for way in self.ways if way not in own)
        mine = " or ".join(way.words for way in own)
        return f"it is {mine}, or {others}: this log cannot tell which ({self.found})"


def likeliest(figures: Sequence[tuple[float | None, MeasuredFigure | None]]
              ) -> MeasuredFigure | None:  # fmt: skip
    """The likeliest figure of a row, with an interval that holds those of all its ways."""
    known = [(p or 0.0, f) for p, f in figures if f is not None and f.value is not None]
    if not known:
        return None
    _, first = max(known, key=lambda pair: pair[0])
    lows = [f.low for _, f in known]
    highs = [f.high for _, f in known]
    if any(low is None for low in lows) or any(high is None for high in highs):
        return MeasuredFigure(first.value)
    return MeasuredFigure(
        first.value,
        min(low for low in lows if low is not None),
        max(high for high in highs if high is not None),
    )
