"""A silence of a daemon's log is an outage, unless something tells of a start after it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from syncline_design.clocks.reading import read_logs
from syncline_design.clocks.result import Timing
from syncline_design.clocks.sessions import sessions_of
from syncline_design.clocks.study import TimingSettings, study_logs
from syncline_design.comparison.assumptions import Assumed
from syncline_design.comparison.by_clock import Resting, by_clock
from tests import clock_logs as made
from tests.clock_logs import START, write

POLL_S, ROWS, AWAY_S, OFF_S = 64.0, 60, 5 * 3600.0, 20e-3
RESTING = Resting(coverage=0.95, horizon_s=600.0)
ASSUMED = Assumed("van", "clock", "clock", 2e-3, ("stages", 0, "clock"))


def _run(k: int, away_s: float, off_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Stamps and how late the clock is: quiet, a silence, the first row after it off by `off_s`."""
    source = np.random.default_rng(k)
    times = START + 86400.0 * k + POLL_S * np.arange(2 * ROWS)
    times[ROWS:] += away_s
    late = source.normal(0.0, 1e-5, 2 * ROWS)
    late[ROWS] = off_s
    return times, late


def _chrony(folder: Path, k: int, *, banner_after: int | None = None) -> Path:
    times, late = _run(k, AWAY_S, OFF_S)
    lines = [made.tracking_line(t, x, hard_s=6e-4) for t, x in zip(times, late, strict=True)]
    lines[ROWS] = made.tracking_line(times[ROWS], late[ROWS], hard_s=0.04)
    if banner_after is not None:
        lines.insert(banner_after, made.BANNER)
    return write(folder / f"tracking_{k}.log", [made.BANNER, *lines])


def _timing(folder: Path, count: int = 6, **settings: object) -> Timing:
    paths = [_chrony(folder, k) for k in range(count)]
    return study_logs(paths, TimingSettings(**settings)).timing  # type: ignore[arg-type]


@pytest.mark.parametrize("gap_s", [3600.0, 12 * 3600.0])
def test_an_outage_counts_whatever_cuts_sessions(gap_s: float, tmp_path: Path) -> None:
    """Away for 5 h of 7 h, run off evenly to 20 ms: 95 % of the time within 1 - 0.05 / 0.7 of it,
    or one twentieth of it more, as finely as the silence is counted."""
    found = _timing(tmp_path, gap_s=gap_s)
    assert [row.counted for row in found.sessions] == [True] * 6
    lasts = (2 * ROWS - 2) * POLL_S + AWAY_S
    exact = OFF_S * (1.0 - 0.05 * lasts / AWAY_S)
    for row in found.sessions:
        assert row.quantile_s is not None
        assert exact - 1e-4 <= row.quantile_s <= exact + 1.5 * OFF_S / 20.0
    assert found.statistical_bound_s is not None
    assert found.statistical_bound_s >= exact
    assert {e.kind for e in found.events} >= {"gap", "holdover"}
    assert found.event_bound_s is not None
    assert found.event_bound_s >= OFF_S
    said = [note for note in found.notes if "no sign of a start" in note]
    assert len(said) == (gap_s == 3600.0)


def test_an_outage_bears_no_bound_out(tmp_path: Path) -> None:
    study = study_logs([_chrony(tmp_path, k) for k in range(6)], TimingSettings())
    assert by_clock(ASSUMED, study, RESTING).status == "broken"


def _restarted(lines: list[str]) -> list[str]:
    lines[ROWS] = lines[ROWS].rsplit(maxsplit=1)[0] + " 1.040e+00"
    return lines


def _unreachable(lines: list[str]) -> list[str]:
    """chronyd says so after the silence, and is in lock again one line later."""
    lost = " ".join([*lines[ROWS].split()[:2], "0.0.0.0 0 -3.114 0.05 0.0 ? 0 0.0 0.0 1.0 1.0 1.5"])
    found = _restarted(lines)
    return [*found[:ROWS], lost, *found[ROWS:]]


@pytest.mark.parametrize(
    ("change", "sessions", "why"),
    [
        (lambda lines: lines, 1, "nothing tells of a start"),
        (lambda lines: [*lines[:ROWS], made.BANNER, *lines[ROWS:]], 2, "60 lines, not 32"),
        (lambda lines: [*lines[:28], made.BANNER, *lines[28:ROWS], made.BANNER, *lines[ROWS:]], 1,
         "each 32 lines"),
        (lambda lines: [*lines[:20], made.BANNER, *lines[20:40], made.BANNER, *lines[40:ROWS],
                        made.BANNER, *lines[ROWS:]], 1, "each 20 lines"),
        (_restarted, 2, "root dispersion of 1 s"),
        (_unreachable, 1, "root dispersion of 1 s of a daemon that lost its server"),
    ],
)  # fmt: skip
def test_what_tells_of_a_start_of_chronyd(
    change: Callable[[list[str]], list[str]], sessions: int, why: str, tmp_path: Path
) -> None:
    times, late = _run(0, AWAY_S, 0.0)
    lines = [made.tracking_line(t, x, hard_s=6e-4) for t, x in zip(times, late, strict=True)]
    log = write(tmp_path / "tracking.log", [made.BANNER, *change(lines)])
    (series,) = read_logs([log]).series
    assert len(sessions_of(series, 3600.0)) == sessions, why


def test_a_file_that_begins_between_two_banners_tells_of_no_start(tmp_path: Path) -> None:
    """Its first banner comes in turn, for all that it shows: it was cut, or copied and emptied."""
    times, late = _run(0, AWAY_S, 0.0)
    lines = [made.tracking_line(t, x, hard_s=6e-4) for t, x in zip(times, late, strict=True)]
    log = write(tmp_path / "tracking.log", [*lines[45:ROWS], made.BANNER, *lines[ROWS:]])
    (series,) = read_logs([log]).series
    assert len(sessions_of(series, 3600.0)) == 1


def test_a_start_in_the_tracking_log_is_one_of_the_other_logs(tmp_path: Path) -> None:
    times, late = _run(0, AWAY_S, 0.0)
    both = list(zip(times, late, strict=True))
    lines = _restarted([made.tracking_line(t, x, hard_s=6e-4) for t, x in both])
    tracking = write(tmp_path / "tracking.log", lines)
    beside = write(tmp_path / "statistics.log", [made.statistics_line(t, x) for t, x in both])
    alone = read_logs([beside]).series
    assert [len(sessions_of(one, 3600.0)) for one in alone] == [1]
    together = read_logs([tracking, beside]).series
    assert [len(sessions_of(one, 3600.0)) for one in together] == [2, 2]


@pytest.mark.parametrize(("process", "sessions"), [("812", 1), ("930", 2)])
def test_another_process_is_another_run(process: str, sessions: int, tmp_path: Path) -> None:
    times = START + np.concatenate([np.arange(60.0), 9000.0 + np.arange(60.0)])
    lines = [made.ptp4l_line(t, 1e-8).replace("ptp4l", f"ptp4l[{812 if k < 60 else process}]:")
             .replace(":[", ": [") for k, t in enumerate(times)]  # fmt: skip
    (series,) = read_logs([write(tmp_path / "ptp4l.log", lines)]).series
    assert len(series) == 120
    assert len(sessions_of(series, 3600.0)) == sessions


@pytest.mark.parametrize(("wander", "sessions"), [("0.002000", 1), ("0.000000", 2)])
def test_ntpd_begins_without_wander(wander: str, sessions: int, tmp_path: Path) -> None:
    times, late = _run(0, AWAY_S, 0.0)
    lines = [made.loopstats_line(t, x) for t, x in zip(times, late, strict=True)]
    lines[ROWS] = lines[ROWS].replace("0.002000", wander)
    (series,) = read_logs([write(tmp_path / "loopstats", lines)]).series
    assert len(sessions_of(series, 3600.0)) == sessions


def test_what_a_master_that_was_away_left_is_an_unlock(tmp_path: Path) -> None:
    """ptp4l lost its master for 2 h and came back 8 ms off, not in lock: no start of a session."""
    paths = []
    for k in range(5):
        times = START + 86400.0 * k + np.arange(240.0)
        late = np.random.default_rng(k).normal(0.0, 2e-8, 240)
        times[120:] += 7200.0
        late[120] = 8e-3
        lines = [made.ptp4l_line(t, x, 0 if n == 120 else 2)
                 for n, (t, x) in enumerate(zip(times, late, strict=True))]  # fmt: skip
        lines.insert(120, f"ptp4l[{times[119] + 1.0:.3f}]: port 1: SLAVE to MASTER on "
                     "ANNOUNCE_RECEIPT_TIMEOUT_EXPIRES")  # fmt: skip
        paths.append(write(tmp_path / f"s{k}.log", lines))
    found = study_logs(paths, TimingSettings()).timing
    assert len(found.sessions) == 5
    assert {e.kind for e in found.events if e.size_s > 7e-3} == {"gap", "unlock", "holdover"}
    assert found.event_bound_s == pytest.approx(8e-3, rel=1e-3)


@pytest.mark.parametrize(("off_s", "events"), [(1e-5, 0), (OFF_S, 1)])
def test_what_a_table_was_off_by_after_a_silence_is_an_event(
    off_s: float, events: int, tmp_path: Path
) -> None:
    """A table has no word for a start: its silence ends a session, and is none to be excused."""
    times, late = _run(0, AWAY_S, off_s)
    (series,) = read_logs([write(tmp_path / "a.csv", made.csv_lines(times, late))]).series
    first, second = sessions_of(series, 3600.0)
    assert first.events == ()
    found = [e for e in second.events if e.kind == "gap"]
    assert len(found) == events
    assert all(e.size_s == pytest.approx(OFF_S) for e in found)
