"""Other effects that take what is asked of a drive: in which order they are told."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from syncline_design.planning.others import TWICE, Others, taken_by
from syncline_design.planning.wanted import Goal
from syncline_design.report import on_plan, plan_sentences
from syncline_design.report.document import Text


def test_what_is_taken_as_known_is_told_by_the_harm_that_it_does() -> None:
    """Three effects whose columns are the wanted one's by cosines of 0.9, 0.999 and 0: free, each
    widens sigma = 1 to 1 / sqrt(1 - cos^2), 2.3 and 22.4 of 1 asked; the last does nothing."""
    cosines = np.array([0.9, 0.999, 0.0])
    information = np.eye(4)
    information[0, 1:] = information[1:, 0] = cosines
    others = Others(np.array([[1], [2], [3]]), np.full((3, 1), 3.0))
    found = taken_by(others, Goal((0,), np.array([1.0]), ()), information, np.full(4, 1e6))
    assert list(found) == [2, 1]
    sigmas = [own[0] for own in found.values()]
    np.testing.assert_allclose(sigmas, 1.0 / np.sqrt(1.0 - cosines[[1, 0]] ** 2), rtol=1e-6)
    assert min(sigmas) > TWICE


def test_speeds_of_a_drive_are_in_metres_per_second() -> None:
    """One style, that of the legs: 0.755 m/s, not 760 mm/s."""
    path = SimpleNamespace(velocity_mps=np.array([[0.755, 0.0, 0.0]]))
    (words,) = (n for n in on_plan._legs(SimpleNamespace(legs=()), path) if isinstance(n, Text))
    assert str(words.words).replace("\u00a0", " ").startswith("The drive begins at 0.755 m/s")


def test_components_that_are_left_alike_are_told_together() -> None:
    """One figure for an arm's three parts, not the same words three times."""
    arm = "lever_arm(position)"
    left = {f"{arm}.x_m": 0.1412, f"{arm}.y_m": 0.1411, f"{arm}.z_m": 0.143,
            "latency(position).latency_s": 0.0973}  # fmt: skip
    told = plan_sentences._left(left)
    assert told.replace("\u00a0", " ") == (
        "lever arm x and y (position) at 141 mm, lever arm z (position) at 143 mm, "
        "latency (position) at 97.3 ms"
    )
