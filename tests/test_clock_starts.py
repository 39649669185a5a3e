"""What a clock does after its start is of its session: only what came before its lock is not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from syncline_design.clocks.study import TimingSettings, TimingStudy, study_logs
from syncline_design.comparison.assumptions import Assumed
from syncline_design.comparison.by_clock import Resting, by_clock
from syncline_design.report.on_timing import _claim_words
from tests import clock_logs as made
from tests.clock_logs import START, write

ROWS, STEP_S, OFF_S = 240, 16.0, 0.3
ASSUMED = Assumed("van", "clock", "clock", 8e-3, ("stages", 0, "clock"))
RESTING = Resting(coverage=0.95, horizon_s=600.0)


def _study(folder: Path, slow_rows: int, leap: str = "N") -> TimingStudy:
    """Sessions that begin 0.3 s off and are slewed in over so many rows, in lock all the time; the
    daemon's bound, of the time before each row, stays above what the row before was off by."""
    paths = []
    for k in range(6):
        times = START + 86400.0 * k + STEP_S * np.arange(ROWS)
        late = np.random.default_rng(k).normal(0.0, 1e-5, ROWS)
        late[:slow_rows] = np.linspace(OFF_S, 0.02, slow_rows) if slow_rows > 1 else OFF_S
        lines = [made.tracking_line(t, x, hard_s=abs(late[max(n - 1, 0)]) + 6e-4,
                                    leap=leap if n < slow_rows else "N")
                 for n, (t, x) in enumerate(zip(times, late, strict=True))]  # fmt: skip
        paths.append(write(folder / f"tracking_{k}.log", lines))
    return study_logs(paths, TimingSettings())


def test_a_slow_start_in_lock_is_of_the_session(tmp_path: Path) -> None:
    """A quarter of each session: what the first twentieth of it is beyond, 95 % is within."""
    study = _study(tmp_path, ROWS // 4)
    found = study.timing
    exact = np.interp(0.05 * ROWS, np.arange(ROWS // 4), np.linspace(OFF_S, 0.02, ROWS // 4))
    for row in found.sessions:
        assert row.quantile_s == pytest.approx(exact, abs=0.01)
    assert found.hard_bound_s is not None
    assert found.hard_bound_s < 0.03  # the daemon's own is of the steady state
    assert found.event_bound_s is not None
    assert found.event_bound_s >= 0.29
    row = by_clock(ASSUMED, study, RESTING)
    assert row.status == "broken"


def test_a_slow_start_of_little_time_bears_no_bound_out(tmp_path: Path) -> None:
    """Ten rows of 240 are beyond: less than a twentieth, and still 0.3 s with the clock in lock."""
    study = _study(tmp_path, 10)
    assert study.timing.bound_s is not None
    assert study.timing.bound_s < 8e-3 < 0.2 < (study.timing.event_bound_s or 0.0)
    row = by_clock(ASSUMED, study, RESTING)
    assert row.status == "not_shown"
    assert "with the starts" in row.words


@pytest.mark.parametrize(("slow_rows", "leap"), [(1, "N"), (ROWS // 4, "?")])
def test_what_came_before_lock_is_not(slow_rows: int, leap: str, tmp_path: Path) -> None:
    """The first update tells how far off the clock was before; so do rows without lock."""
    study = _study(tmp_path, slow_rows, leap)
    assert study.timing.event_bound_s == study.timing.bound_s
    assert {event.kind for event in study.timing.events} == {"startup"}
    assert by_clock(ASSUMED, study, RESTING).status == "holds"


@pytest.mark.parametrize(("slow_rows", "share", "said"), [(1, 1.0, False), (60, 0.75, True)])
def test_the_claim_says_of_which_share_it_is(
    slow_rows: int, share: float, said: bool, tmp_path: Path
) -> None:
    found = _study(tmp_path, slow_rows, "?").timing
    assert found.claim.lock_share == pytest.approx(share, abs=0.01)
    assert ("of the time logged" in _claim_words(found)) == said
