"""Sessions that run off from one to the next are said not to be alike."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest

from syncline_design.clocks.study import TimingSettings, TimingStudy, study_logs
from syncline_design.comparison.assumptions import Assumed
from syncline_design.comparison.by_clock import Resting, by_clock
from tests.clock_logs import START, csv_lines, write

LEVELS_US = np.array([100.0, 120.0, 140.0, 160.0, 180.0, 200.0])


def _timing(folder: Path, late_us: np.ndarray, scatter_us: float = 2.0) -> TimingStudy:
    source = np.random.default_rng(5)
    paths = []
    for k, level in enumerate(late_us):
        times = START + 86400.0 * k + 30.0 * np.arange(60)
        late = 1e-6 * (level + source.normal(0.0, scatter_us, 60))
        paths.append(write(folder / f"day{k}.csv", csv_lines(times, late)))
    return study_logs(paths, TimingSettings())


def _said(folder: Path, late_us: np.ndarray) -> list[str]:
    notes = _timing(folder, late_us).timing.notes
    return [note for note in notes if note.startswith("the sessions run off")]


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_clock_that_ages_is_said_to_run_off(sign: float, tmp_path: Path) -> None:
    """20 us a day, later by the day: local minus reference falls; 2 of 720 orders are so."""
    (said,) = _said(tmp_path, sign * LEVELS_US)
    assert f"move by {'-' if sign > 0 else ''}20 us or so" in said
    orders = list(itertools.permutations(range(6)))
    score = [sum(a < b for a, b in itertools.combinations(one, 2)) for one in orders]
    chance = sum(one in (0, 15) for one in score) / len(orders)
    assert f"chance of {chance:.1g}" in said


@pytest.mark.parametrize(
    ("late_us", "why"),
    [
        (LEVELS_US[[0, 2, 1, 3, 4, 5]], "2 x 6 of 720 orders are as extreme: more than 0.5 %"),
        (LEVELS_US[[3, 0, 5, 1, 4, 2]], "any order"),
        (100.0 + 0.05 * LEVELS_US, "5 us of a bound of 117 us or more: not worth a word"),
        (LEVELS_US[:5], "five sessions: 2 of 120"),
    ],
)
def test_sessions_in_no_order_are_not(late_us: np.ndarray, why: str, tmp_path: Path) -> None:
    assert _said(tmp_path, late_us) == [], why


@pytest.mark.parametrize("assumed_s", [2.3e-4, 1e-3])
def test_a_clock_that_ages_bears_no_bound_out(assumed_s: float, tmp_path: Path) -> None:
    """Within 1 ms today, and within 0.23 ms as far as each session goes: more of them break it."""
    one = Assumed("van", "clock", "clock", assumed_s, ("stages", 0, "clock"))
    resting = Resting(coverage=0.95, horizon_s=600.0)
    row = by_clock(one, _timing(tmp_path, LEVELS_US), resting)
    assert row.status == "not_shown", row
    assert "the sessions run off" in row.words
    assert "would narrow the bound" not in row.words
    alike = by_clock(one, _timing(tmp_path, LEVELS_US[[3, 0, 5, 1, 4, 2]]), resting)
    assert "run off" not in alike.words
    assert alike.status == ("holds" if assumed_s == 1e-3 else "not_shown")
