"""Sessions that run off from one to the next are said not to be alike."""

from __future__ import annotations

import itertools
import math
from pathlib import Path

import numpy as np
import pytest

from syncline_design.clocks.study import TimingSettings, TimingStudy, study_logs
from syncline_design.clocks.trend import GROW, REMEMBER, RUN_OFF, SessionCourse, neumann_ratio
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
    return study_logs(paths, TimingSettings(independent=True))


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


@pytest.mark.parametrize(
    ("assumed_s", "late_us", "words"),
    [
        (2.3e-4, LEVELS_US, GROW),
        (1e-3, LEVELS_US, GROW),
        (1e-3, LEVELS_US - 150.0, RUN_OFF),  # through 0: off by no more at the end than at first
    ],
)
def test_a_clock_that_ages_bears_no_bound_out(
    assumed_s: float, late_us: np.ndarray, words: str, tmp_path: Path
) -> None:
    """Within 1 ms today, and within 0.23 ms as far as each session goes: more of them break it."""
    one = Assumed("van", "clock", "clock", assumed_s, ("stages", 0, "clock"))
    resting = Resting(coverage=0.95, horizon_s=600.0)
    study = _timing(tmp_path, late_us)
    assert not study.timing.claim.made
    assert (study.timing.claim.why_not or "").startswith(words)
    row = by_clock(one, study, resting)
    assert row.status == "not_shown", row
    assert words in row.words
    assert "would narrow the bound" not in row.words
    alike = by_clock(one, _timing(tmp_path, LEVELS_US[[3, 0, 5, 1, 4, 2]]), resting)
    assert "run off" not in alike.words
    assert alike.status == ("holds" if assumed_s == 1e-3 else "not_shown")


def _courses(level: float, growth: float, keep: float, count: int) -> list[SessionCourse]:
    """200 draws of sessions with a level each that keeps so much of the one before, and a scatter
    that grows by `growth` from one to the next."""
    source, found = np.random.default_rng(count), []
    for _ in range(200):
        z = source.normal(size=count)
        for k in range(1, count):
            z[k] = keep * z[k - 1] + np.sqrt(1.0 - keep**2) * z[k]
        scatter = np.exp(0.1 * source.normal(size=count)) * (1.0 + growth) ** np.arange(count)
        figures = np.abs(level * z) + 1.65 * scatter
        found.append(SessionCourse.of_figures(level * z, figures, 0.95))
    return found


@pytest.mark.parametrize("count", [20, 60])
@pytest.mark.parametrize("level", [0.0, 2.0])
def test_sessions_that_are_alike_are_seldom_said_to_be_otherwise(level: float, count: int) -> None:
    said = [bool(one.words or one.forbids) for one in _courses(level, 0.0, 0.0, count)]
    assert np.mean(said) <= 0.05


@pytest.mark.parametrize(("count", "least"), [(20, 0.8), (60, 1.0)])
def test_scatter_that_grows_by_two_percent_a_session_carries_no_claim(
    count: int, least: float
) -> None:
    found = [(one.forbids or "").startswith(GROW) for one in _courses(0.0, 0.02, 0.0, count)]
    assert np.mean(found) >= least


@pytest.mark.parametrize(("keep", "count", "least"), [(0.95, 20, 0.8), (0.8, 60, 0.98)])
def test_sessions_that_remember_are_worth_fewer(keep: float, count: int, least: float) -> None:
    found = [one for one in _courses(2.0, 0.0, keep, count) if one.remembers is not None]
    assert len(found) >= least * 200
    assert all((one.remembers or "").startswith(REMEMBER) for one in found)
    wanted = count * (1.0 - keep) / (1.0 + keep)
    assert float(np.median([one.effective for one in found])) < 1.5 * max(wanted, 1.0)


def test_neumann_ratio_of_ranks_by_hand() -> None:
    """1 3 2 4 5: differences 2 -1 2 1, squares 10; about their mean 3: 4 0 1 1 4, 10."""
    ratio, chance = neumann_ratio(np.array([0.1, 0.4, 0.2, 7.0, 9.0]))
    assert ratio == pytest.approx(1.0)
    variance = 4 * 3 * (125 - 10 - 9) / (5 * 5 * 6 * 16)
    assert chance == pytest.approx(0.5 * math.erfc(1.0 / math.sqrt(2.0 * variance)), rel=1e-9)
    assert neumann_ratio(np.ones(8)) == (2.0, 1.0)


def test_a_claim_of_sessions_that_remember_counts_fewer(tmp_path: Path) -> None:
    """Levels that stay for two sessions each: the bound is wider than in another order."""
    levels = np.repeat(100.0 * np.random.default_rng(3).normal(size=25), 2)
    near = levels + np.random.default_rng(4).normal(0.0, 5.0, 50)
    (tmp_path / "near").mkdir()
    (tmp_path / "apart").mkdir()
    kept = _timing(tmp_path / "near", near).timing
    apart = _timing(tmp_path / "apart", np.random.default_rng(8).permutation(near)).timing
    assert apart.claim.effective_sessions is None
    assert kept.claim.effective_sessions is not None
    assert 3.0 <= kept.claim.effective_sessions < 25.0
    assert any(note.startswith(REMEMBER) for note in kept.notes)
    assert kept.statistical_bound_s is not None
    assert apart.statistical_bound_s is not None
    assert kept.statistical_bound_s > 1.1 * apart.statistical_bound_s
    assert (kept.claim.unseen_share or 0.0) > (apart.claim.unseen_share or 0.0)
