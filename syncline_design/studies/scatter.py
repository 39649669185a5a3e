"""A study as points over two factors: only what was computed, nothing in between."""

from __future__ import annotations

import math
from itertools import pairwise

from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.spec.yaml_text import plain_scalar
from syncline_design.studies.definition import Factor
from syncline_design.studies.summary import StudySummary, varied

MOST_KINDS = 4  # values of a further factor that shapes can tell apart
ALIKE = 0.1  # of ratios of neighbours, in their logarithms: no more apart are equal ratios
LEVEL = 0.01  # of steps: no more apart are equal steps


@dataclass(frozen=True, slots=True)
class ScatterAxis:
    """One axis: figures in `unit` ("" for plain numbers), or words at 0, 1, 2 and so on."""

    key: str
    unit: str = ""
    words: tuple[str, ...] = ()
    log: bool = False


@dataclass(frozen=True, slots=True)
class ScatterPoint:
    """One case: where it lies, how it ended, what its design costs, its number.

    kind: the place of its value of what else varies, 0 where that is not one factor of a few.
    """

    x: float
    y: float
    verdict: str
    cost: float | None
    number: int = 0
    kind: int = 0


@dataclass(frozen=True, slots=True)
class Scatter:
    """Every case of a study in the plane of two factors; others: what varies besides.

    kinds: the values of that, where it is one factor with a few.  sampled: the cases were drawn.
    """

    x: ScatterAxis
    y: ScatterAxis
    points: tuple[ScatterPoint, ...]
    others: tuple[str, ...]
    kinds: tuple[str, ...] = ()
    sampled: bool = False


def scatter(summary: StudySummary) -> Scatter | None:
    """The cases over the two factors that the study names, else over its first two of figures.

    None where fewer than two factors vary.
    """
    chosen = _axes(summary)
    if chosen is None:
        return None
    (across, first), (up, second) = chosen
    x, y = _axis(first), _axis(second)
    others = [(i, f) for i, f in varied(summary) if i not in (across, up)]
    kinds = _kinds(others)
    points = tuple(
        ScatterPoint(
            _place(x, brief.labels[across]),
            _place(y, brief.labels[up]),
            brief.verdict,
            brief.cost if brief.meets else None,
            brief.number,
            kinds.index(brief.labels[others[0][0]]) if kinds else 0,
        )
        for brief in summary.briefs
    )
    drawn = bool(summary.result.study.sample)
    return Scatter(x, y, points, tuple(f.key for _, f in others), kinds, drawn)


def _kinds(others: list[tuple[int, Factor]]) -> tuple[str, ...]:
    """The values of the one other factor, where they are few enough to be told apart."""
    if len(others) != 1:
        return ()
    values = others[0][1].axis
    return values if len(values) <= MOST_KINDS else ()


def _axes(summary: StudySummary) -> tuple[tuple[int, Factor], tuple[int, Factor]] | None:
    several = varied(summary)
    named = summary.result.study.heat_map
    if named is not None:
        by_key = {f.key: (i, f) for i, f in enumerate(summary.result.study.factors)}
        return by_key[named.x], by_key[named.y]
    # Sampled figures first, then other figures; words last, and never across if avoidable.
    order = sorted(several, key=lambda item: (not _unit(item[1])[0], item[1].origin != "sample"))
    if len(order) < 2:
        return None
    return order[0], order[1]


def _unit(factor: Factor) -> tuple[bool, str]:
    """Whether a factor's values are figures of one unit, and that unit."""
    if not factor.is_of_figures:
        return False, ""
    units = {text.partition(" ")[2].strip() for text in factor.axis}
    return len(units) == 1, units.pop()


def _axis(factor: Factor) -> ScatterAxis:
    values = factor.axis
    figures, unit = _unit(factor)
    if not figures:
        return ScatterAxis(factor.key, words=values)
    numbers = [float(text.partition(" ")[0]) for text in values]
    return ScatterAxis(factor.key, unit, log=_is_log(factor, sorted(numbers)))


def _is_log(factor: Factor, numbers: list[float]) -> bool:
    """Whether the values were spaced by ratios: the study says so, or those of its grid show it."""
    if factor.scale == "log":
        return True
    if numbers[0] <= 0.0 or factor.origin == "sample" or len(numbers) < 3:
        return False
    ratios = [math.log(b / a) for a, b in pairwise(numbers)]
    steps = [b - a for a, b in pairwise(numbers)]
    return max(ratios) <= (1.0 + ALIKE) * min(ratios) and max(steps) > (1.0 + LEVEL) * min(steps)


def _place(axis: ScatterAxis, text: str) -> float:
    if axis.words:
        return float(axis.words.index(text))
    return float(plain_scalar(text.partition(" ")[0]))


@dataclass(frozen=True, slots=True)
class SweptCase:
    """One case: where its value lies, how it ended, what its design costs and how far it errs.

    kind: the place of its base, 0 where these are too many to be told apart.  waived: it meets
    all but what a waiver covers.
    """

    place: float
    verdict: str
    cost: float | None
    error_m: float | None
    kind: int
    waived: bool


@dataclass(frozen=True, slots=True)
class KeySweep:
    """Every case of a study in which one key varies; kinds: the names of its bases, if a few."""

    axis: ScatterAxis
    points: tuple[SweptCase, ...]
    kinds: tuple[str, ...]


def along(summary: StudySummary) -> KeySweep | None:
    """The cases over the only key that varies; None where more do, or where none has a design."""
    several = varied(summary)
    if len(several) != 1 or all(brief.error_m is None for brief in summary.briefs):
        return None
    [(column, factor)] = several
    axis, names = _axis(factor), tuple(base.name for base in summary.result.study.bases)
    kinds = names if 1 < len(names) <= MOST_KINDS else ()
    points = (
        SweptCase(
            _place(axis, brief.labels[column]),
            brief.verdict,
            brief.cost,
            brief.error_m,
            brief.base if kinds else 0,
            bool(brief.waived),
        )
        for brief in summary.briefs
    )
    return KeySweep(axis, tuple(points), kinds)
