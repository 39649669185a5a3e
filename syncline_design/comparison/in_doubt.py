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
        """What a row is told of it that some of the ways would break.

        The way that was found is told in the words of the finding, the others by their figures.
        """
        others = " or ".join(way.name for way in self.ways if way not in own)
        first = self.ways[0]
        mine = " or ".join(way.name if way is first else way.words for way in own)
        said = f" ({self.found})" if first in own else ""
        return f"it is {mine}, or {others}: this log cannot tell which{said}"


@dataclass(frozen=True, slots=True)
class Suspicion:
    """What a finding in doubt would make of a row: of each way that breaks it its odds and figure.

    in_part: whether it acts in a part of the log alone; two such parts are never the same rows.
    """

    figures: tuple[tuple[float | None, MeasuredFigure | None], ...]
    in_part: bool = False

    @property
    def known(self) -> tuple[tuple[float, MeasuredFigure], ...]:
        """Those with a figure."""
        return tuple(
            (p or 0.0, f) for p, f in self.figures if f is not None and f.value is not None
        )

    @property
    def span(self) -> tuple[float, float] | None:
        """What holds the intervals of all its ways; None where one has none."""
        lows = [f.low for _, f in self.known if f.low is not None]
        highs = [f.high for _, f in self.known if f.high is not None]
        if min(len(lows), len(highs)) < max(len(self.known), 1):
            return None
        return min(lows), max(highs)


def likeliest(findings: Sequence[Suspicion], signed: bool) -> MeasuredFigure | None:
    """The likeliest figure of a row, with an interval that holds whichever of the findings act.

    Those of several findings add where they act together.  signed: of one component; of several
    the sizes add at most.
    """
    known = [each for each in findings if each.known]
    if not known:
        return None
    _, first = max((pair for each in known for pair in each.known), key=lambda pair: pair[0])
    spans = [each.span for each in known]
    ends = [span for span in spans if span is not None]
    if len(ends) < len(spans):
        return MeasuredFigure(first.value)
    whole = [span for each, span in zip(known, ends, strict=True) if not each.in_part]
    parts = [span for each, span in zip(known, ends, strict=True) if each.in_part]
    sums = [_of_some([*whole, *part], signed) for part in ([[p] for p in parts] or [[]])]
    return MeasuredFigure(first.value, min(low for low, _ in sums), max(high for _, high in sums))


def widened_by(
    figure: MeasuredFigure | None, findings: Sequence[Suspicion], signed: bool
) -> MeasuredFigure | None:
    """A figure that is sure, with an interval that holds whichever of the findings act as well."""
    others = likeliest(findings, signed)
    if figure is None or others is None or figure.low is None or figure.high is None:
        return figure
    if others.low is None or others.high is None:
        return MeasuredFigure(figure.value)
    if not signed:
        size, (_, more) = as_size(figure), _sizes_within(others.low, others.high)
        low, high = size.low or 0.0, size.high or 0.0
        return MeasuredFigure(size.value, max(low - more, 0.0), high + more)
    return MeasuredFigure(figure.value, figure.low + min(others.low, 0.0),
                          figure.high + max(others.high, 0.0))  # fmt: skip


def as_size(figure: MeasuredFigure) -> MeasuredFigure:
    """How large a departure is, whichever its sign: what others add to is no component any more."""
    value = None if figure.value is None else abs(figure.value)
    if figure.low is None or figure.high is None:
        return MeasuredFigure(value)
    return MeasuredFigure(value, *_sizes_within(figure.low, figure.high))


def _sizes_within(low: float, high: float) -> tuple[float, float]:
    least = 0.0 if low <= 0.0 <= high else min(abs(low), abs(high))
    return least, max(abs(low), abs(high))


def _of_some(spans: Sequence[tuple[float, float]], signed: bool) -> tuple[float, float]:
    """The ends of the sums over every choice of one or more of the intervals."""
    lows, highs = zip(*spans, strict=True)
    if len(spans) > 1 and not signed:
        return 0.0, sum(highs)
    below, above = [x for x in lows if x < 0.0], [x for x in highs if x > 0.0]
    return sum(below) if below else min(lows), sum(above) if above else max(highs)
