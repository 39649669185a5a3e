"""Damaged lines of clock logs: each costs itself, whatever daemon wrote it, and no row is false.

The clock is later by 1 us from row to row, so that a figure beside another row's time shows.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from syncline_design.clocks.reading import is_clock_log, read_logs
from syncline_design.spec.load import BadInput
from tests import clock_logs as made
from tests.clock_logs import START

COUNT = 40
JOURNALS = ("ptp4l", "phc2sys", "ts2phc", "gpsd", "ppstest", "ptp4l in the journal")


def in_journal(time_s: float, late_s: float) -> str:
    own = made.ptp4l_line(time_s, late_s).replace("]: ", "]: [ptp4l.0.config] ", 1)
    return f"Jan 15 08:00:00 host ptp4l[812]: {own}"


ROWS: dict[str, tuple[list[str], Callable[[float, float], str]]] = {
    "tracking": ([made.BANNER, "   Date (UTC) Time", made.BANNER], made.tracking_line),
    "statistics": ([], made.statistics_line),
    "measurements": ([], made.measurements_line),
    "refclocks": ([], lambda t, x: made.refclock_lines(t, x)[0]),
    "loopstats": ([], made.loopstats_line),
    "peerstats": ([], made.peerstats_line),
    "ptp4l": ([], made.ptp4l_line),
    "ptp4l in the journal": ([], in_journal),
    "phc2sys": ([], made.phc2sys_line),
    "ts2phc": ([], made.ts2phc_line),
    "gpsd": ([], made.gpsd_line),
    "ppstest": ([], made.ppstest_line),
    "table": (["time_s,offset_us"], lambda t, x: made.csv_lines([t], [x])[1]),
    "dated table": (
        ["time;offset [ms];locked"],
        lambda t, x: (
            f"2027-01-15T08:{int(t - START) // 60:02d}:{int(t - START) % 60:02d}Z;"
            f"{-1e3 * x:.6f};1".replace(".", ",")
        ),
    ),
}


def late(k: int) -> float:
    return 1e-3 + 1e-6 * k


def lines(name: str) -> tuple[int, list[bytes]]:
    head, row = ROWS[name]
    rows = [row(START + 16.0 * k, late(k)) for k in range(COUNT)]
    return len(head), [line.encode() for line in (*head, *rows)]


def cut_and_joined(row: bytes, following: bytes, share: float) -> list[bytes]:
    return [row[: int(len(row) * share)] + following, b""]


def zeros(row: bytes, following: bytes, share: float) -> list[bytes]:
    """What a power cut leaves; what is written after it follows in the same line."""
    return [row[: int(len(row) * share)] + bytes(4096), following]


def endless(row: bytes, following: bytes, share: float) -> list[bytes]:
    return [row[: int(len(row) * share)] + b"9" * 70_000, following]


def written(path: Path, rows: list[bytes]) -> Path:
    path.write_bytes(b"".join(row + b"\n" for row in rows))
    return path


@pytest.mark.parametrize("share", [0.1, 0.3, 0.5, 0.7, 0.9])
@pytest.mark.parametrize("damage", [cut_and_joined, zeros, endless])
@pytest.mark.parametrize("name", ROWS)
def test_a_damaged_line_costs_itself(
    tmp_path: Path, name: str, damage: Callable[[bytes, bytes, float], list[bytes]], share: float
) -> None:
    head, rows = lines(name)
    at = head + 17
    rows[at : at + 2] = damage(rows[at], rows[at + 1], share)
    path = written(tmp_path / "run.log", rows)
    read = read_logs([path])
    (series,) = read.series
    found = np.rint((series.time_s - START) / 16.0).astype(int).tolist()
    assert set(range(COUNT)) - set(found) <= {17, 18}
    assert found == sorted(set(found))
    assert series.offset_s == pytest.approx([-late(k) for k in found], rel=1e-9, abs=2e-9)
    if damage is not cut_and_joined:
        assert 18 in found
    if damage is not cut_and_joined or not name.startswith(JOURNALS):
        (said,) = read.notes
        assert said.startswith(f"{path}: 1 damaged line was left out, line {at + 1}: ")
    assert is_clock_log(path)


@pytest.mark.parametrize("name", [name for name in ROWS if not name.startswith(JOURNALS)])
def test_where_more_than_a_tenth_is_damaged_the_log_is_refused(tmp_path: Path, name: str) -> None:
    head, rows = lines(name)
    for k in range(0, COUNT, 10):
        rows[head + k] = rows[head + k][:9] + b"\0"
    read = read_logs([written(tmp_path / "few.log", rows)])
    assert len(read.series[0]) == COUNT - 4
    assert "4 damaged lines were left out, the first of them" in read.notes[0]
    for k in range(1, COUNT, 10):
        rows[head + k] = b"Lorem ipsum, dolor; sit amet"
    with pytest.raises(BadInput, match="not text: NUL"):
        read_logs([written(tmp_path / "many.log", rows)])


def test_a_binary_file_is_no_clock_log(tmp_path: Path) -> None:
    """A recording that holds lines of a daemon among bytes that are no text."""
    rows = [made.ptp4l_line(100.0 + k, 1e-6).encode() for k in range(5)]
    path = written(tmp_path / "run.bag", [b"\0\1" * 20, *rows, *[b"\0\2" * 20] * 20])
    assert not is_clock_log(path)
