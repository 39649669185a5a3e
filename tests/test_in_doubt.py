"""The figure of a row that several findings may act on, against every choice of them."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from syncline_design.comparison.acceptance import MeasuredFigure
from syncline_design.comparison.by_log import _with_room
from syncline_design.comparison.in_doubt import Suspicion, as_size, likeliest, widened_by


def _drawn(rng: np.random.Generator, in_part: bool, signed: bool) -> Suspicion:
    """One finding of one to three ways, each with odds and an interval."""
    values = rng.normal(0.0, 20.0, int(rng.integers(1, 4)))
    values = values if signed else np.abs(values) + 1.0
    odds = rng.dirichlet(np.ones(len(values)))
    return Suspicion(
        tuple((float(p), MeasuredFigure(float(v), float(v) - 0.5, float(v) + 0.5))
              for p, v in zip(odds, values, strict=True)),
        in_part,
    )  # fmt: skip


def _choices(findings: list[Suspicion]) -> list[list[MeasuredFigure]]:
    """One way or none of each, at least one in all, of the parts of a log one at most."""
    ways = [[None, *(f for _, f in each.known)] for each in findings]
    found = []
    for choice in itertools.product(*ways):
        acting = [(f, each) for f, each in zip(choice, findings, strict=True) if f is not None]
        if acting and sum(each.in_part for _, each in acting) <= 1:
            found.append([f for f, _ in acting])
    return found


@pytest.mark.parametrize("seed", range(40))
def test_delays_that_act_together_add(seed: int) -> None:
    """Every sum of intervals lies within, and both ends are reached by one."""
    rng = np.random.default_rng(seed)
    findings = [_drawn(rng, bool(rng.random() < 0.4), signed=True) for _ in range(seed % 4 + 1)]
    told = likeliest(findings, signed=True)
    sums = [
        (sum(f.low or 0.0 for f in acting), sum(f.high or 0.0 for f in acting))
        for acting in _choices(findings)
    ]
    assert told is not None
    assert told.low == pytest.approx(min(low for low, _ in sums))
    assert told.high == pytest.approx(max(high for _, high in sums))
    flat = [pair for each in findings for pair in each.known]
    most = max(odds for odds, _ in flat)
    assert told.value in [f.value for odds, f in flat if odds == most]


@pytest.mark.parametrize("seed", range(20))
def test_sizes_of_vectors_lie_between_nothing_and_their_sum(seed: int) -> None:
    """Vectors of drawn directions with such sizes never sum to more, nor to less than 0."""
    rng = np.random.default_rng(seed)
    findings = [_drawn(rng, False, signed=False) for _ in range(2 + seed % 2)]
    told = likeliest(findings, signed=False)
    assert told is not None
    assert told.low is not None
    assert told.high is not None
    for acting in _choices(findings):
        turned = rng.normal(size=(len(acting), 3))
        turned /= np.linalg.norm(turned, axis=1, keepdims=True)
        size = float(
            np.linalg.norm(sum(t * (f.value or 0.0) for t, f in zip(turned, acting, strict=True)))
        )
        assert told.low <= size <= told.high


def test_two_devices_late_at_once() -> None:
    """Attitude 30 ms and ranging 20 ms late, over ground that stands still: the log shows the
    attitude 10 ms after the others and the position 20 ms before them, or all others 20 ms late."""
    before_the_rest = Suspicion(((0.9, MeasuredFigure(9.9, 9.7, 10.2)),))
    late_together = Suspicion(((None, MeasuredFigure(20.2, 20.1, 20.4)),))
    told = likeliest([late_together, before_the_rest], signed=True)
    assert told is not None
    assert told.low is not None
    assert told.high is not None
    assert told.value == 9.9
    assert told.low <= 10.0
    assert told.high >= 30.0


def test_what_is_sure_may_be_more() -> None:
    sure = MeasuredFigure(9.9, 9.7, 10.2)
    other = Suspicion(((None, MeasuredFigure(20.2, 20.1, 20.4)),))
    told = widened_by(sure, [other], signed=True)
    assert told == MeasuredFigure(9.9, 9.7, pytest.approx(30.6))
    assert widened_by(sure, [], signed=True) == sure
    assert widened_by(sure, [other], signed=False) == MeasuredFigure(9.9, 0.0, pytest.approx(30.6))


def test_what_others_add_to_a_turn_to_the_left_makes_it_a_size() -> None:
    """An azimuth of -2.1 mrad that a boresight hides 100 mrad of: no interval of the other sign."""
    sure, other = MeasuredFigure(-2.1, -2.2, -2.0), Suspicion(((0.6, MeasuredFigure(1, 0.9, 1.1)),))
    assert widened_by(sure, [other], signed=False) == MeasuredFigure(
        2.1, pytest.approx(0.9), pytest.approx(3.3)
    )
    assert as_size(MeasuredFigure(-2.1, -2.2, 0.1)) == MeasuredFigure(2.1, 0.0, 2.2)
    assert _with_room(sure, 100.0, signed=False) == MeasuredFigure(2.1, 0.0, 102.1)
    assert _with_room(sure, 100.0, signed=True) == MeasuredFigure(-2.1, -102.1, 97.9)


def test_a_way_without_an_interval_leaves_none() -> None:
    told = likeliest([Suspicion(((0.6, MeasuredFigure(3.0)), (0.4, None)))], signed=True)
    assert told == MeasuredFigure(3.0)
    assert widened_by(MeasuredFigure(1.0, 0.5, 1.5), [Suspicion(((0.6, told),))], True) == (
        MeasuredFigure(1.0)
    )
    assert likeliest([Suspicion(((0.5, None),))], signed=True) is None
