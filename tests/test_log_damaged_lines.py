"""Damaged lines of text formats: they cost themselves, are counted and said, and no other line.

Every file is made here, line by line, so that what has to be read is known: all lines but those
that the damage touches.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest

from syncline_design.logs.readers import open_recording
from syncline_design.logs.readers.decimal_stamps import calendar_ns
from syncline_design.logs.readers.stream import Recording
from syncline_design.spec.load import BadInput

SECOND = 10**9
COUNT = 40
TITLE = (
    "%  GPST                  latitude(deg) longitude(deg)  height(m)   Q  ns   sdn(m)   sde(m)   "
    "sdu(m)  sdne(m)  sdeu(m)  sdun(m) age(s)  ratio"
)
DEVIATIONS = "1  19   0.0045   0.0046   0.0097   0.0027   0.0011  -0.0030   0.03    5.9"
ORIGIN = 1_688_990_400  # 2023-07-10 12:00 as a calendar reads it


def solution(k: int) -> str:
    return f"2023/07/10 12:00:{k:02d}.250   35.{k:04d}   136.8814   41.4   {DEVIATIONS}"


def tum(k: int) -> str:
    return f"{ORIGIN + k}.250 {k} 2.5 3.5 0 0 0.6 0.8"


def euroc(k: int) -> str:
    return f"{(ORIGIN + k) * SECOND + 250_000_000},{k},2.5,3.5,0.8,0,0,0.6"


def kitti(k: int) -> str:
    return f"1 0 0 {k} 0 1 0 2.5 0 0 1 3.5"


def table(k: int) -> str:
    return f"{ORIGIN + k}.250,35.{k:04d},136.8814,41.4"


def dated(k: int) -> str:
    return f"2023-07-10T12:00:{k:02d}.250Z;35,{k:04d};136,8814;41,4"


def report(k: int) -> str:
    return (
        f'{{"class":"TPV","mode":3,"time":"2023-07-10T12:00:{k:02d}.250Z","lat":35.{k:04d},'
        '"lon":136.8814,"altHAE":41.4,"track":30.0,"speed":2.0,"climb":0.5}'
    )


FORMATS: dict[str, tuple[list[str], Callable[[int], str]]] = {
    "solution": (["% program : RTKPOST", TITLE], solution),
    "solution without header": ([], solution),
    "TUM": ([], tum),
    "EuRoC": ([], euroc),
    "KITTI": ([], kitti),
    "gpsd": ([], report),
    "CSV": (["time_s,latitude_deg,longitude_deg,height_m"], table),
    "CSV of dates": (["time;latitude_deg;longitude_deg;height_m"], dated),
}


def lines(name: str) -> list[bytes]:
    head, row = FORMATS[name]
    return [line.encode() for line in (*head, *(row(k) for k in range(COUNT)))]


def cut_and_joined(rows: list[bytes], at: int) -> set[int]:
    """The end of a row was never written: the next one begins in the midst of it."""
    if at + 1 < len(rows):
        rows[at : at + 2] = [rows[at][: len(rows[at]) // 2] + rows[at + 1], b""]
        return {at, at + 1}
    rows[at] = rows[at][: len(rows[at]) // 2]
    return {at}


def zeros(rows: list[bytes], at: int) -> set[int]:
    """What a power cut leaves: a block of NUL from the midst of a row on."""
    rows[at] = rows[at][:9] + bytes(4096) + rows[at][20:]
    return {at}


def half_twice(rows: list[bytes], at: int) -> set[int]:
    """The first half of a row, and then the whole of it."""
    rows[at] = rows[at][: len(rows[at]) // 2] + b"\n" + rows[at]
    return set()


def a_word(rows: list[bytes], at: int) -> set[int]:
    rows[at] = rows[at].replace(b"2", b"z").replace(b"168", b"z")
    return {at}


def endless(rows: list[bytes], at: int) -> set[int]:
    """A line of 2 MB; where nothing else begins a file, it has no format to be told by."""
    at = max(at, 1)
    rows[at] = rows[at] + b" 1" * 10**6
    return {at}


DAMAGES = (cut_and_joined, zeros, half_twice, a_word, endless)


def written(path: Path, rows: Sequence[bytes], end: bytes = b"\n") -> Recording:
    path.write_bytes(b"".join(row + end for row in rows))
    return open_recording(path)


def told(recording: Recording) -> list[int]:
    """Which of the rows was read, by the figures that count them."""
    (stream,) = recording.streams()
    found: list[int] = []
    for piece in recording.samples(stream.name):
        latitude = piece.columns.get("latitude_deg")
        if latitude is not None:
            found += np.rint((latitude - 35) * 1e4).astype(int).tolist()
        else:
            found += piece.columns["position_x_m"].astype(int).tolist()
    if stream.stamps is not None:
        wanted = [(ORIGIN + k) * SECOND + 250_000_000 for k in found]
        assert stream.stamps.primary_ns.tolist() == wanted
    return found


@pytest.mark.parametrize("damage", DAMAGES)
@pytest.mark.parametrize("place", ["first", "middle", "last"])
@pytest.mark.parametrize("name", FORMATS)
def test_a_damaged_line_costs_itself(
    tmp_path: Path, name: str, place: str, damage: Callable[[list[bytes], int], set[int]]
) -> None:
    rows = lines(name)
    head = len(rows) - COUNT
    if damage is endless and name.startswith("CSV"):
        pytest.skip("a cell, which only samples look at")
    at = {"first": 0, "middle": 17, "last": COUNT - 1}[place]
    lost = {k - head for k in damage(rows, head + at)}
    at = min(lost, default=at)
    recording = written(tmp_path / "run.txt", rows)
    assert told(recording) == [k for k in range(COUNT) if k not in lost]
    assert recording.incomplete is not None
    assert recording.incomplete.reason.startswith("1 damaged line was left out")
    assert f"line {head + at + 1}: " in recording.incomplete.reason
    assert recording.incomplete.messages == COUNT - len(lost)
    assert all(stream.partial for stream in recording.streams())


@pytest.mark.parametrize("name", FORMATS)
def test_many_damaged_lines_are_counted(tmp_path: Path, name: str) -> None:
    rows = lines(name)
    head = len(rows) - COUNT
    for k in range(3, COUNT, 10):
        rows[head + k] = rows[head + k][:11]
    recording = written(tmp_path / "run.txt", rows)
    assert told(recording) == [k for k in range(COUNT) if k % 10 != 3]
    assert recording.incomplete is not None
    assert recording.incomplete.reason.startswith("4 damaged lines were left out, the first of")


@pytest.mark.parametrize("name", FORMATS)
def test_ends_of_lines_may_be_mixed(tmp_path: Path, name: str) -> None:
    rows = [row + b"\r" * (k % 3 == 0) for k, row in enumerate(lines(name))]
    recording = written(tmp_path / "run.txt", [b"", *rows, b"", b"  "])
    assert told(recording) == list(range(COUNT))
    assert recording.incomplete is None


@pytest.mark.parametrize("name", FORMATS)
def test_where_no_line_is_good_the_file_is_refused(tmp_path: Path, name: str) -> None:
    rows = lines(name)
    rows[-COUNT:] = [row[:11] for row in rows[-COUNT:]]
    with pytest.raises(BadInput):
        written(tmp_path / "run.txt", rows).streams()
    with pytest.raises(BadInput):
        written(tmp_path / "empty.txt", []).streams()
    with pytest.raises(BadInput):
        written(tmp_path / "head.txt", rows[:-COUNT]).streams()


@pytest.mark.parametrize("name", ["CSV", "CSV of dates"])
def test_a_table_that_is_not_as_its_header_says_is_no_damage(tmp_path: Path, name: str) -> None:
    """Decimal commas between commas, or units in cells: many rows in vain, and one in the end."""
    rows = lines(name)
    for k in range(3, COUNT, 5):
        rows[1 + k] = rows[1 + k] + rows[1][4:5] + b",5;5"
    with pytest.raises(BadInput, match="cells"):
        written(tmp_path / "run.csv", rows).streams()


@pytest.mark.parametrize(("every", "words"), [(1, "cells"), (11, "cells"), (400, "")])
def test_looking_for_damaged_rows_takes_no_longer_than_it_may(
    tmp_path: Path, every: int, words: str
) -> None:
    """A row too short each so many of 100 000: all, one in eleven, few."""
    rows = [b"%d.5,%d.6" % (k, k) if k % every else b"7.5" for k in range(1, 100_001)]
    began = time.process_time()
    if words:
        with pytest.raises(BadInput, match=words):
            written(tmp_path / "run.csv", [b"stamp_s,receive_s", *rows]).streams()
    else:
        (stream,) = written(tmp_path / "run.csv", [b"stamp_s,receive_s", *rows]).streams()
        assert stream.messages == 100_000 - 100_000 // every
    assert time.process_time() - began < 20.0


@pytest.mark.parametrize(
    "time_said",
    ['"2023-07-10T25:00:17.250Z"', '"2023-13-10T12:00:17.250Z"', '"nan"', '""', "1688990417.25"],
)
def test_a_bad_time_of_a_report_costs_that_report(tmp_path: Path, time_said: str) -> None:
    rows = lines("gpsd")
    rows[17] = rows[17].replace(b'"2023-07-10T12:00:17.250Z"', time_said.encode())
    recording = written(tmp_path / "run.json", rows)
    assert told(recording) == [k for k in range(COUNT) if k != 17]
    assert recording.incomplete is not None
    assert "line 18: no time of a report" in recording.incomplete.reason


@pytest.mark.parametrize("zone", ["Z", "", "+05:30", "-0130", "+01"])
@pytest.mark.parametrize("day", ["1995-02-28", "2024-02-29", "2026-12-31"])
def test_calendar_times_are_those_of_the_calendar(day: str, zone: str) -> None:
    """Against the library's own calendar, to nanoseconds that it does not hold."""
    at = datetime.fromisoformat(f"{day}T23:59:58{zone or 'Z'}")
    found = calendar_ns(f"{day}T23:59:58.123456789{zone}")
    assert found == int(at.timestamp()) * SECOND + 123_456_789
    assert calendar_ns(f"{day}T23:59:60{zone}") == (int(at.timestamp()) + 2) * SECOND
    for wrong in (f"{day}T24:00:00", f"{day[:-2]}32T00:00:00", day, ""):
        with pytest.raises(ValueError, match=r"not a time|day is out of range|day .* must be"):
            calendar_ns(wrong)


def test_a_header_settles_how_many_fields_where_rows_disagree(tmp_path: Path) -> None:
    """Two rows, one of them cut: the names above tell which."""
    short = solution(0)[: solution(0).rindex("-")]
    recording = written(tmp_path / "run.pos", [row.encode() for row in (TITLE, short, solution(1))])
    assert told(recording) == [1]
    recording = written(tmp_path / "run.pos", [row.encode() for row in (TITLE, solution(0), short)])
    assert told(recording) == [0]


LAST = {
    "decimals": lambda k: f"{1795000000 + 0.02 * k:.6f},{1795000000.5 + 0.02 * k:.6f}",
    "exponents": lambda k: f"{0.02 * k + 1.5:.6e},{0.02 * k + 1.7:.9e}",
    "whole": lambda k: f"{(1795000000 + k) * 10**9},{(1795000000 + k) * 10**9 + 524_618_137}",
    "dates": lambda k: (
        f"2026-11-30T12:{k // 60:02d}:{k % 60:02d}.125,2026-11-30T12:{k // 60:02d}:{k % 60:02d}.225"
    ),
}


@pytest.mark.parametrize("kind", LAST)
@pytest.mark.parametrize("rows", [30, 150, 900])
def test_a_last_row_that_is_cut_within_its_last_figure_is_left_out(
    tmp_path: Path, kind: str, rows: int
) -> None:
    """A row of fewer digits than all above it, which no line end closes; a whole one is read."""
    unit = "" if kind == "dates" else "_ns" if kind == "whole" else "_s"
    lines_ = [f"stamp{unit},receive{unit}", *(LAST[kind](k) for k in range(rows))]
    text = "\n".join(lines_)
    digits = len(lines_[-1].split(",")[1])
    for cut in range(digits + 1):
        path = tmp_path / "x.csv"
        path.write_text(text[: len(text) - cut], "utf-8")
        recording = open_recording(path)
        stamps = recording.streams()[0].stamps
        assert stamps is not None
        assert stamps.primary_ns.size == rows - (cut > 0), cut
        assert (recording.incomplete is not None) == (cut > 0), cut
        assert cut == 0 or "the last row is cut" in str(recording.incomplete)


def test_a_last_row_of_fewer_digits_is_whole_where_figures_vary(tmp_path: Path) -> None:
    """Figures as Python writes them end in any digit, and counts fall to fewer."""
    rng = np.random.default_rng(3)
    for figures in (
        [*(round(float(v), 3) for v in rng.uniform(0.0, 9.0, 2000)), 4.5],
        [*rng.integers(10, 14, 2000).tolist(), 9],
        [*rng.integers(100000, 999999, 2000).tolist(), 3],
        [*range(10, 90), 9],
        [*(round(float(v), 3) for v in rng.uniform(0.0, 9.0, 30)), 4.5],
        [*rng.integers(1000, 4000, 40).tolist(), 3],
    ):
        path = tmp_path / "x.csv"
        rows = [f"{k}.25,{one}" for k, one in enumerate(figures)]
        path.write_text("\n".join(["time_s,range_m", *rows]), "utf-8")
        recording = open_recording(path)
        assert len(recording.streams()[0].stamps.primary_ns) == len(figures)  # type: ignore[union-attr]
        assert recording.incomplete is None
