"""A daemon that says that it began anew begins a session, however short it was away."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from syncline_design.clocks.reading import read_logs
from syncline_design.clocks.sessions import sessions_of
from syncline_design.clocks.study import TimingSettings, study_logs
from tests import clock_logs as made
from tests.clock_logs import START, write

POLL_S, RUNS, ROWS, BOUND_S, STARTING_S = 64.0, 3, 70, 6e-4, 1.5
EACH = 32  # lines between two banners


def _lost(time_s: float) -> str:
    """As chronyd writes it at its start, and where it has lost all servers."""
    return " ".join([made.tracking_line(time_s, 0.0).split(" 192")[0],
                     "0.0.0.0 0 -3.114 0.05 0.0 ? 0 0.0 0.0 1.0 1.0 1.5"])  # fmt: skip


def _times(away_s: float) -> list[np.ndarray]:
    lasts = POLL_S * (ROWS - 1) + away_s
    return [START + lasts * run + POLL_S * np.arange(ROWS) for run in range(RUNS)]


def _run(times: np.ndarray, seed: int) -> list[str]:
    """From a start: a row without reference, one with the bound of the time before, then lock."""
    late = np.random.default_rng(seed).normal(0.0, 1e-5, len(times))
    bounds = [STARTING_S, *[BOUND_S] * (len(times) - 2)]
    return [
        _lost(times[0]),
        *(
            made.tracking_line(t, x, hard_s=bound)
            for t, x, bound in zip(times[1:], late[1:], bounds, strict=True)
        ),
    ]


def _bannered(lines: list[str], each: int = EACH) -> list[str]:
    return [text for k, line in enumerate(lines)
            for text in ([made.BANNER, line] if k % each == 0 else [line])]  # fmt: skip


def _week(folder: Path, away_s: float) -> Path:
    runs = [_bannered(_run(times, k)) for k, times in enumerate(_times(away_s))]
    return write(folder / "tracking.log", [line for run in runs for line in run])


@pytest.mark.parametrize("away_s", [5.0, 180.0, 3000.0, 7200.0])
@pytest.mark.parametrize("gap_s", [1.0, 3600.0])
def test_each_start_of_chronyd_begins_a_session(
    away_s: float, gap_s: float, tmp_path: Path
) -> None:
    """What the daemon says of the time before its starts bounds none of the steady state."""
    found = study_logs([_week(tmp_path, away_s)], TimingSettings(gap_s=gap_s)).timing
    assert [one.counted for one in found.sessions] == [True] * RUNS
    assert found.claim.made
    assert found.hard_bound_s == pytest.approx(BOUND_S, rel=0.01)
    assert found.bound_s == found.hard_bound_s
    assert {one.kind for one in found.events} == {"startup"}


def _lines(change: Callable[[list[str]], list[str]]) -> list[str]:
    """One run in lock, bannered anew each 32 lines, with what `change` makes of it."""
    times = START + POLL_S * np.arange(2 * ROWS)
    late = np.random.default_rng(1).normal(0.0, 1e-5, 2 * ROWS)
    rows = [made.tracking_line(t, x, hard_s=BOUND_S) for t, x in zip(times, late, strict=True)]
    return change(rows)


def _with_lost(at: int, each: int) -> Callable[[list[str]], list[str]]:
    def changed(rows: list[str]) -> list[str]:
        time_s = START + POLL_S * (at - 0.5)
        after = rows[at].rsplit(maxsplit=1)[0] + " 1.500e+00"
        return _bannered([*rows[:at], _lost(time_s), after, *rows[at + 1 :]], each)

    return changed


def _with_bound(rows: list[str]) -> list[str]:
    rows[ROWS] = rows[ROWS].rsplit(maxsplit=1)[0] + " 1.500e+00"
    return _bannered(rows)


def _with_step(rows: list[str]) -> list[str]:
    rows[ROWS] = made.tracking_line(START + POLL_S * ROWS, 1.7, hard_s=BOUND_S)
    return _bannered(rows)


def _with_far_server(rows: list[str]) -> list[str]:
    for k in range(ROWS, ROWS + 3):
        rows[k] = made.tracking_line(START + POLL_S * k, 1e-5, hard_s=BOUND_S, dispersion_s=1.2)
    return _bannered(rows)


@pytest.mark.parametrize(
    ("change", "sessions", "why"),
    [
        (_bannered, 1, "banners in turn"),
        (_with_lost(50, EACH), 1, "a server that was lost"),
        (_with_lost(64, EACH), 1, "a server that was lost as a banner was due"),
        (_with_lost(60, 20), 1, "the same, with a banner each 20 lines, as seen before"),
        (lambda rows: _bannered(rows[:50]) + _bannered(_with_lost(0, 999)(rows[50:])), 2, "start"),
        (lambda rows: _bannered(rows[:50]) + _bannered(rows[50:]), 1, "the log alone is opened"),
        (_with_bound, 2, "a bound of before that no run in lock comes to"),
        (_with_step, 1, "an offset is no bound of the time before"),
        (_with_far_server, 1, "nor is the distance of the next server"),
    ],
)  # fmt: skip
def test_what_tells_a_start_from_an_outage_of_no_length(
    change: Callable[[list[str]], list[str]], sessions: int, why: str, tmp_path: Path
) -> None:
    (series,) = read_logs([write(tmp_path / "tracking.log", _lines(change))]).series
    assert len(sessions_of(series, 3600.0)) == sessions, why


def test_a_bound_of_the_time_without_lock_is_none_of_the_steady_state(tmp_path: Path) -> None:
    """The row that lock comes back with says what the clock was within before it."""
    log = write(tmp_path / "tracking.log", _lines(_with_lost(50, EACH)))
    found = study_logs([log], TimingSettings()).timing
    assert found.hard_bound_s == pytest.approx(BOUND_S, rel=0.01)
    assert (found.event_bound_s or 0.0) >= STARTING_S
    assert [one.kind for one in found.events][:1] == ["unlock"]


def test_starts_in_the_tracking_log_are_those_of_the_other_logs(tmp_path: Path) -> None:
    """Sources are measured on before lock is said, and some rows of theirs come no more."""
    tracking = _week(tmp_path, 180.0)
    for name, line in (("measurements", made.measurements_line),
                       ("statistics", made.statistics_line)):  # fmt: skip
        rows = [line(t + shift, 1e-5) for times in _times(180.0)
                for t, shift in zip(times[:-1], [20.0] + [30.0] * ROWS, strict=False)]  # fmt: skip
        beside = write(tmp_path / f"{name}.log", rows)
        for one in read_logs([tracking, beside]).series:
            begins = [cut.series.time_s[0] for cut in sessions_of(one, 3600.0)]
            wanted = [times[0] for times in _times(180.0)]
            assert begins == pytest.approx(wanted, abs=21.0), one.kind.name


@pytest.mark.parametrize(
    ("before", "after", "sessions"),
    [("0.002000", "0.000000", 2), ("0.000002", "0.000000", 2), ("0.000001", "0.000000", 1),
     ("0.002000", "0.001871", 1)],
)  # fmt: skip
def test_a_wander_that_falls_to_none_is_a_start_of_ntpd(
    before: str, after: str, sessions: int, tmp_path: Path
) -> None:
    """Away for 3 min; an average over eight updates falls by 7 % an update at most."""
    times = START + POLL_S * np.arange(2 * ROWS)
    times[ROWS:] += 180.0
    wanders = [before] * ROWS + [after] + [before] * (ROWS - 1)
    lines = [made.loopstats_line(t, 1e-5).replace("0.002000", wander)
             for t, wander in zip(times, wanders, strict=True)]  # fmt: skip
    (series,) = read_logs([write(tmp_path / "loopstats", lines)]).series
    assert len(sessions_of(series, 3600.0)) == sessions
