"""Figures kept for tests of pages are those that would have been drawn."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from drawn_once import Kept
from syncline_design.report import charts_clocks, svg


def _line(height: float, more: Callable[[], float] | None = None) -> svg.InlineChart:
    def build(figure: Any) -> None:
        axes = figure.add_subplot()
        axes.plot([0.0, 1.0], [0.0, height if more is None else more()])

    return charts_clocks.draw("line", "Line", "A line", (300.0, 200.0), build)


def test_what_is_asked_again_is_kept_and_what_differs_is_drawn(figures_drawn_once: Kept) -> None:
    figures_drawn_once.clear()
    first = _line(1.0)
    assert _line(1.0) is first
    assert _line(2.0).svg != first.svg
    heights = [_line(0.0, more=lambda height=height: height) for height in (1.0, 2.0)]
    assert heights[0].svg != heights[1].svg
    assert len(figures_drawn_once) == 4


def test_what_cannot_be_told_is_drawn_anew(figures_drawn_once: Kept) -> None:
    values = (value for value in (1.0, 2.0))  # nothing says what it will give

    def following() -> float:
        return next(values)

    assert _line(0.0, more=following).svg != _line(0.0, more=following).svg


def test_it_ends_with_the_test() -> None:
    assert charts_clocks.draw is svg.draw
    with pytest.raises(AssertionError):
        assert _line(1.0) is _line(1.0)
