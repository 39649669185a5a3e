"""The designs of the front by the figure of the error that a requirement limits, for a picture.

The exact front over a figure takes a search for the worst situation of every design that could lie
on it (`figure_front`, seconds to minutes); what a page of `check` shows are the designs of the
Syncline's front, which keep every requirement already, each by its own value of that figure.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from syncline_design.choice.outcome import FrontPoint
from syncline_design.choice.table import Judge, Problem
from syncline_design.spec.case import Case
from syncline_design.spec.requirement import STATED_KINDS
from syncline_design.verdict.design_data import full_design
from syncline_design.verdict.figure_front import LESS, figure_words
from syncline_design.verdict.named import FiguredDesign, FrontByFigure
from syncline_design.verdict.verified import Verified

MOST = 12  # designs, from the cheapest on


def front_by_figure(
    case: Case, problem: Problem, verified: Verified, points: Sequence[FrontPoint]
) -> FrontByFigure | None:
    """By the figure whose requirement has least to spare; None where none limits a figure."""
    stated = [row for row in verified.requirements if row.kind in STATED_KINDS and row.value]
    judge = problem.judge
    if not stated or judge is None:
        return None
    row = min(stated, key=lambda one: one.limit / (one.value or one.limit))
    asked = next(one for one in case.spec.requirements if one.id == row.id)
    if row.id not in dict(judge.limits):  # waived: it decides nothing
        return None
    designs = tuple(_figured(case, problem, judge, row.id, points[:MOST]))
    return FrontByFigure(row.id, figure_words(asked), row.limit, designs)


def _figured(
    case: Case, problem: Problem, judge: Judge, requirement: str, points: Sequence[FrontPoint]
) -> Iterator[FiguredDesign]:
    least = float("inf")
    for point in sorted(points, key=lambda one: one.amount):
        if point.undecided:
            continue
        value = judge.reached_m(problem, point.design, requirement)
        named = full_design(case, problem, point.design)
        beaten = value > LESS * least
        yield FiguredDesign(float(point.amount), value, point.error_m, named, beaten)
        least = min(least, value)
