"""Stamps that count within a day, a week or a counter's range are one session over its end."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest

from syncline_design.clocks.entry import _time
from syncline_design.clocks.reading import read_logs
from syncline_design.clocks.series import ClockSeries
from syncline_design.clocks.sessions import sessions_of
from tests.clock_logs import write

PERIODS = {"the hour": 3600.0, "a counter of 32 bit in us": 4294.967296, "the day": 86400.0,
           "the GPS week": 604800.0, "a counter of 32 bit in ms": 4294967.296}  # fmt: skip


def _read(tmp_path: Path, times: list[float]) -> tuple[ClockSeries, tuple[str, ...]]:
    rows = [f"{t:.6f},{5.0 + 0.01 * (k % 7)}" for k, t in enumerate(times)]
    read = read_logs([write(tmp_path / "run.csv", ["time_s,offset_us", *rows])])
    return read.series[0], read.notes


@pytest.mark.parametrize("within", PERIODS)
def test_a_fold_is_no_start_of_the_clock(within: str, tmp_path: Path) -> None:
    period = PERIODS[within]
    true = period - 800.0 + 16.0 * np.arange(100)
    series, notes = _read(tmp_path, (true % period).tolist())
    assert series.time_s == pytest.approx(true, abs=1e-5)
    assert len(sessions_of(series, 3600.0)) == 1
    (said,) = notes
    assert "begin anew once" in said
    assert within in said


def test_two_midnights_are_counted_on_twice(tmp_path: Path) -> None:
    true = 86000.0 + 16.0 * np.arange(6000)
    series, notes = _read(tmp_path, (true % 86400.0).tolist())
    assert series.time_s == pytest.approx(true, abs=1e-5)
    assert "begin anew 2 times" in notes[0]


@pytest.mark.parametrize("last", [5000.0, 86400.0 - 160.0, 604800.0 - 3600.0, 90000.0])
def test_a_clock_that_starts_again_begins_a_session(last: float, tmp_path: Path) -> None:
    first = last - 16.0 * np.arange(50)[::-1]
    series, notes = _read(tmp_path, [*first.tolist(), *(16.0 * np.arange(50)).tolist()])
    assert len(sessions_of(series, 3600.0)) == 2
    assert not notes


def test_a_leap_second_is_a_time(tmp_path: Path) -> None:
    stamps = [f"2016-12-31T23:59:{s:02d}Z" for s in range(30, 61)]
    stamps += [f"2017-01-01T00:00:{s:02d}+00:00" for s in range(30)]
    rows = [f"{stamp},{k % 5}" for k, stamp in enumerate(stamps)]
    (series,) = read_logs([write(tmp_path / "leap.csv", ["time,offset_us", *rows])]).series
    assert series.time_s[30] == series.time_s[31] == 1483228800.0  # 2017-01-01T00:00:00Z
    assert len(sessions_of(series, 3600.0)) == 1


@pytest.mark.parametrize("number", range(1, 60, 2))
def test_what_was_declared_is_written_as_it_was(number: int) -> None:
    for scale, unit in ((1e-3, "ms"), (1e-6, "us"), (1e-9, "ns")):
        assert _time(number * scale) == f"{number} {unit}"


def test_a_bound_is_still_rounded_up() -> None:
    for value in itertools.chain([1.2345678e-6, 9.9999999e-4], np.geomspace(1e-8, 0.5, 40)):
        number, unit = _time(float(value)).split(" ")
        scale = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}[unit]
        assert float(value) * (1.0 - 1e-12) <= float(number) * scale <= float(value) * (1 + 3e-5)
