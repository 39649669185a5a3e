"""Logs of clocks are read with their signs, sessions, rotations and faults."""

from __future__ import annotations

import gzip
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from syncline_design.clocks.reading import read_logs
from syncline_design.clocks.series import Array
from syncline_design.clocks.sessions import sessions_of
from syncline_design.clocks.stability import mtie, tdev
from syncline_design.spec.load import BadInput
from tests import clock_logs as made
from tests.clock_logs import START, write

LATE_S = 1e-3  # a clock that is 1 ms late: local minus reference is -1 ms
LINES: dict[str, Callable[[float], list[str]]] = {
    "chrony tracking": lambda t: [made.tracking_line(t, LATE_S)],
    "chrony statistics": lambda t: [made.statistics_line(t, LATE_S)],
    "chrony measurements": lambda t: [made.measurements_line(t, LATE_S)],
    "chrony refclock": lambda t: made.refclock_lines(t, LATE_S),
    "ntpd loopstats": lambda t: [made.loopstats_line(t, LATE_S)],
    "ntpd peerstats": lambda t: [made.peerstats_line(t, LATE_S)],
    "ptp4l": lambda t: [made.ptp4l_line(t, LATE_S)],
    "phc2sys CLOCK_REALTIME": lambda t: [made.phc2sys_line(t, LATE_S)],
    "ts2phc": lambda t: [made.ts2phc_line(t, LATE_S)],
    "gpsd PPS": lambda t: [made.gpsd_line(t, LATE_S)],
    "gpsd TOFF": lambda t: [made.gpsd_line(t, LATE_S, "TOFF")],
    "ppstest": lambda t: [made.ppstest_line(t, LATE_S)],
}


@pytest.mark.parametrize("name", LINES)
def test_a_late_clock_is_negative_whatever_the_log_writes(name: str, tmp_path: Path) -> None:
    times = START + 16.0 * np.arange(30)
    lines = [line for t in times for line in LINES[name](float(t))]
    read = read_logs([write(tmp_path / "any.log", lines)])
    (series,) = read.series
    assert series.kind.name.startswith(name)
    assert series.offset_s == pytest.approx(-LATE_S, rel=1e-6)
    assert series.time_s == pytest.approx(times, abs=2e-3)
    assert bool(np.all(series.locked))


def test_a_table_says_its_unit_and_its_sign(tmp_path: Path) -> None:
    rows = ["time;offset [ms];locked", "2027-01-15T08:00:00Z;-1,5;1", "2027-01-15T08:00:10Z;2;0"]
    (series,) = read_logs([write(tmp_path / "a.csv", rows)]).series
    assert series.offset_s.tolist() == [-1.5e-3, 2e-3]
    assert series.time_s.tolist() == [START, START + 10.0]
    assert series.locked.tolist() == [True, False]


HARD = {
    "chrony tracking": LATE_S + 1e-4 + 2e-4,
    "chrony measurements": LATE_S + (4e-4 + 6e-4) / 2 + 1e-5 + 2e-5,
    "chrony refclock": LATE_S + 1e-6,
    "ntpd peerstats": LATE_S + 2e-4 + 1e-4,
    "ptp4l": LATE_S + 1.5e-6,
    "phc2sys CLOCK_REALTIME": LATE_S + 0.25e-6,
}


@pytest.mark.parametrize("name", HARD)
def test_the_hard_bound_is_offset_dispersion_and_half_the_round_trip(
    name: str, tmp_path: Path
) -> None:
    lines = [line for k in range(30) for line in LINES[name](START + 16.0 * k)]
    (series,) = read_logs([write(tmp_path / "any.log", lines)]).series
    assert series.hard_s == pytest.approx(HARD[name], rel=1e-6)


def test_chrony_s_own_maximum_counts_where_it_is_larger(tmp_path: Path) -> None:
    lines = [made.tracking_line(START + 16 * k, 1e-4, hard_s=1.76e-3) for k in range(30)]
    (series,) = read_logs([write(tmp_path / "tracking.log", lines)]).series
    assert series.hard_s == pytest.approx(1.76e-3)


def test_signs_agree_with_ntpstats(tmp_path: Path) -> None:
    """ntpstats turns everything into reference minus local."""
    parsers = pytest.importorskip(
        "ntpstats.parsers", reason="ntpstats is not installed (pip install ntpstats)"
    )
    for name in ("chrony tracking", "chrony statistics", "chrony measurements", "chrony refclock",
                 "ntpd loopstats", "ntpd peerstats", "ptp4l", "ts2phc"):  # fmt: skip
        lines = [line for k in range(30) for line in LINES[name](START + 16.0 * k)]
        path = write(tmp_path / f"{name.split()[-1]}.log", lines)
        (series,) = read_logs([path]).series
        theirs = parsers.load_one(str(path))
        assert np.median(theirs.offset) == pytest.approx(-np.median(series.offset_s)), name


def test_summaries_give_their_maximum_as_one_sample(tmp_path: Path) -> None:
    lines = [f"ptp4l[{100 + k}.5]: rms    8 max   {16 + k} freq  -1134 +/-  12 delay  1503 +/-   3"
             for k in range(30)]  # fmt: skip
    (series,) = read_logs([write(tmp_path / "ptp.log", lines)]).series
    assert series.offset_s.tolist() == pytest.approx([1e-9 * (16 + k) for k in range(30)])


def test_an_older_phc2sys_names_the_system_clock_by_silence(tmp_path: Path) -> None:
    lines = [f"phc2sys[{100 + k}.000]: phc offset {500 + k:9d} s2 freq  +2748 delay  500"
             for k in range(30)]  # fmt: skip
    (series,) = read_logs([write(tmp_path / "phc.log", lines)]).series
    assert series.kind.name == "phc2sys CLOCK_REALTIME"
    assert series.offset_s[0] == pytest.approx(5e-7)


def test_times_may_be_unix_seconds_under_any_name_of_a_time(tmp_path: Path) -> None:
    rows = ["timestamp,offset_ns", f"{START},5", f"{START + 1.5},-5"]
    (series,) = read_logs([write(tmp_path / "a.csv", rows)]).series
    assert series.time_s.tolist() == [START, START + 1.5]


def test_lines_of_a_journal_are_found_among_others(tmp_path: Path) -> None:
    lines = ["-- Journal begins at Mon --", "Nov 22 03:00:00 host systemd[1]: Started thing."]
    for k in range(30):
        said = made.ptp4l_line(100.0 + k, 1e-7).partition(": ")[2]
        lines.append(f"Nov 22 03:00:{k:02d} host ptp4l[812]: [{100 + k}.000] {said}")
        lines.append(f"Nov 22 03:00:{k:02d} host kernel: eth0 up")
    (series,) = read_logs([write(tmp_path / "journal.txt", lines)]).series
    assert series.time_s.tolist() == [100.0 + k for k in range(30)]
    assert series.offset_s == pytest.approx(-1e-7)


def test_rotations_of_one_log_are_one_log(tmp_path: Path) -> None:
    times = START + 64.0 * np.arange(300)
    lines = made.tracking(times, np.full(300, 1e-5))
    oldest, middle, live = lines[:103], lines[103:203], lines[203:]
    (tmp_path / "tracking.log.2.gz").write_bytes(gzip.compress("\n".join(oldest).encode()))
    write(tmp_path / "tracking.log.1", middle)
    write(tmp_path / "tracking.log", live)
    names = ["tracking.log", "tracking.log.1", "tracking.log.2.gz"]
    (series,) = read_logs([tmp_path / name for name in names]).series
    assert series.time_s.tolist() == times.tolist()
    assert len(sessions_of(series, 3600.0)) == 1


def test_a_session_begins_with_a_file_a_restart_or_a_gap(tmp_path: Path) -> None:
    times = START + 16.0 * np.arange(60)
    first = made.tracking(times[:20], np.zeros(20))
    restart = made.tracking_line(
        times[20], 0.0, leap="?", skew_ppm=1e6, reference="0.0.0.0", hard_s=1.5
    )
    second = made.tracking(times[21:40], np.zeros(19))
    third = made.tracking(times[40:] + 3700.0, np.zeros(20))
    a = write(tmp_path / "a.log", [*first, restart, *second, *third])
    b = write(tmp_path / "b.log", made.tracking(times + 86400.0, np.zeros(60)))
    read = read_logs([a, b])
    lengths = [[len(s.series) for s in sessions_of(x, 3600.0)] for x in read.series]
    assert lengths == [[20, 20, 20], [60]]
    joined = [[len(s.series) for s in sessions_of(x, 4000.0)] for x in read.series]
    assert joined == [[20, 40], [60]]
    begun = sessions_of(read.series[0], 3600.0)[1]
    assert [event.kind for event in begun.events] == ["startup"]
    assert begun.hard_s < 1e-2


def test_the_same_session_counts_once(tmp_path: Path) -> None:
    times = START + 16.0 * np.arange(60)
    late = 1e-5 * np.sin(times)
    a = write(tmp_path / "a.log", made.tracking(times, late))
    again = write(tmp_path / "copy.log", made.tracking(times, late))
    part = write(tmp_path / "part.log", made.tracking(times[20:50], late[20:50]))
    packed = tmp_path / "a.log.gz"
    packed.write_bytes(gzip.compress(a.read_bytes()))
    rotated = write(tmp_path / "a.log.1", made.tracking(times[:30], late[:30]))
    for twin in (a, again, part, packed, rotated):
        with pytest.raises(BadInput, match=r"the same (session as in|log as)"):
            read_logs([a, twin])


@pytest.mark.parametrize(
    "how", ["ms", "rounded", "nearly all lost", "whole seconds", "wrong unit", "turned"]
)
def test_another_export_of_a_session_is_that_session(how: str, tmp_path: Path) -> None:
    """One clock has one offset at one moment: it does not matter how many digits a file keeps."""
    rng = np.random.default_rng(7)
    times = START + 10.0 * np.arange(300) + rng.uniform(0.0, 0.3, 300)
    late = 3e-4 + 1e-5 * rng.standard_normal(300)
    first = write(tmp_path / "a.csv", _table("us", times, late, 1e6, 3))
    name, values, factor, digits = {
        "ms": ("ms", late, 1e3, 6), "rounded": ("us", late, 1e6, 0),
        "nearly all lost": ("ms", late, 1e3, 2), "whole seconds": ("ns", late, 1e9, 0),
        "wrong unit": ("us", late, 1e9, 3), "turned": ("us", -late, 1e6, 3),
    }[how]  # fmt: skip
    stamps = np.round(times) if how == "whole seconds" else times
    again = write(tmp_path / "b.csv", _table(name, stamps[100:], values[100:], factor, digits))
    with pytest.raises(BadInput, match=r"the same session as in .* 200 rows of CSV"):
        read_logs([first, again])


@pytest.mark.parametrize(
    ("later_s", "factor", "digits"), [(3600.0, 1e6, 3), (-START, 1e6, 3), (-START, -1e6, 1)]
)
def test_a_session_on_another_time_base_is_that_session(
    later_s: float, factor: float, digits: int, tmp_path: Path
) -> None:
    """In another zone, or from its own start: offsets that come back to the last digit are one."""
    rng = np.random.default_rng(11)
    times = START + 10.0 * np.arange(300) + rng.uniform(0.0, 0.3, 300)
    late = 3e-4 + 1e-5 * rng.standard_normal(300)
    first = write(tmp_path / "a.csv", _table("us", times, late, 1e6, 3))
    again = write(tmp_path / "b.csv", _table("us", times[50:] + later_s, late[50:], factor, digits))
    with pytest.raises(BadInput, match=r"the same session as in .* 250 rows of CSV"):
        read_logs([first, again])


@pytest.mark.parametrize("how", ["between", "midway", "slower", "pairs", "eights"])
@pytest.mark.parametrize("clock", ["white", "slow"])
def test_a_session_resampled_is_that_session(clock: str, how: str, tmp_path: Path) -> None:
    """Read between its rows, or averaged: no stamp comes back, and no offset does."""
    rng = np.random.default_rng(17)
    times = START + 16.0 * np.arange(1600)
    noise = rng.standard_normal(1600)
    late = 1e-5 * (noise if clock == "white" else np.cumsum(noise) / 10.0)
    first = write(tmp_path / "a.csv", _table("us", times, late, 1e6, 3))
    if how in ("pairs", "eights"):
        count = {"pairs": 2, "eights": 8}[how]
        stamps, values = (x.reshape(-1, count).mean(axis=1) for x in (times, late))
    else:
        stamps = {"between": times + 3.0, "midway": times + 8.0,
                  "slower": START + 25.0 * np.arange(1000)}[how]  # fmt: skip
        values = np.interp(stamps, times, late)
    again = write(tmp_path / "b.csv", _table("us", stamps, values, 1e6, 3))
    for pair in ([first, again], [again, first]):
        with pytest.raises(BadInput, match="the same session as in"):
            read_logs(pair)


@pytest.mark.parametrize(("stride", "phase"), [(2, 0), (2, 1), (5, 3)])
def test_each_second_row_from_its_own_start_is_that_session(
    stride: int, phase: int, tmp_path: Path
) -> None:
    rng = np.random.default_rng(19)
    times = START + 16.0 * np.arange(400)
    late = 1e-5 * rng.standard_normal(400)
    first = write(tmp_path / "a.csv", _table("us", times, late, 1e6, 3))
    kept = slice(phase, None, stride)
    again = write(tmp_path / "b.csv", _table("ns", times[kept] - times[phase], late[kept], 1e9, 0))
    for pair in ([first, again], [again, first]):
        with pytest.raises(BadInput, match="follow one another as there, stamped from another"):
            read_logs(pair)


@pytest.mark.parametrize("later_s", [0.0, 4.0])
def test_two_clocks_left_alone_are_not_one_session(later_s: float, tmp_path: Path) -> None:
    """Both drift, by 20 and by 30 ppm: that is no more alike than two straight lines are."""
    rng = np.random.default_rng(23)
    times = START + 10.0 * np.arange(2000)
    logs = []
    for k, rate in enumerate((2e-5, 3e-5)):
        late = rate * 10.0 * np.arange(2000) + 1e-6 * rng.standard_normal(2000)
        logs.append(write(tmp_path / f"{k}.csv", _table("us", times + k * later_s, late, 1e6, 1)))
    assert len(read_logs(logs).series) == 2


@pytest.mark.parametrize("kind", ["few levels", "ramp", "noise"])
def test_sessions_that_are_alike_are_not_one(kind: str, tmp_path: Path) -> None:
    """Offsets of a few nanoseconds, a steady drift, or noise about one bias: 20 days of each."""
    rng = np.random.default_rng(13)
    logs = []
    for day in range(20):
        times = START + 86400.0 * day + 10.0 * np.arange(300)
        late = {"few levels": 1e-9 * rng.integers(-2, 3, 300), "ramp": 1e-8 * np.arange(300),
                "noise": 3e-4 + 1e-6 * rng.standard_normal(300)}[kind]  # fmt: skip
        logs.append(write(tmp_path / f"{day}.csv", _table("ns", times, late, 1e9, 0)))
    assert len(read_logs(logs).series) == 20


def test_one_log_is_looked_for_in_another_only_as_far_as_rows_are_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Twenty unlike days: few comparisons of columns a pair; a whole probe has 1 400."""
    rng, compared, plain = np.random.default_rng(13), [0], np.abs
    logs = []
    for day in range(20):
        times = START + 86400.0 * day + 10.0 * np.arange(300)
        late = 3e-4 + 1e-6 * rng.standard_normal(300)
        logs.append(write(tmp_path / f"{day}.csv", _table("ns", times, late, 1e9, 0)))

    def counted(values: Array) -> Array:
        compared[0] += 1
        return plain(values)

    with monkeypatch.context() as patched:
        patched.setattr(np, "abs", counted)
        read_logs(logs)
    assert compared[0] < 100 * 190


@pytest.mark.parametrize("seed", range(20))
def test_clocks_compared_at_the_same_moments_are_not_one_session(seed: int, tmp_path: Path) -> None:
    """Two clocks of one room: half of their noise, and the day's temperature, is one."""
    rng = np.random.default_rng([seed, 3])
    times = START + 10.0 * np.arange(300)
    day = 2e-4 * np.sin(times / 1000.0)
    common = 1e-5 * rng.standard_normal(300)
    logs = [
        write(tmp_path / f"{k}.csv",
              _table("us", times, day + common + 1e-5 * rng.standard_normal(300), 1e6, 1))
        for k in range(2)
    ]  # fmt: skip
    assert len(read_logs(logs).series) == 2


def _table(unit: str, times: Array, late: Array, factor: float, digits: int) -> list[str]:
    rows = zip(times, factor * late, strict=True)
    return [f"time_s,offset_{unit}", *(f"{t:.3f},{x:.{digits}f}" for t, x in rows)]


def test_lost_lock_gaps_steps_and_leap_seconds_are_events(tmp_path: Path) -> None:
    states = [0 if k < 10 or 80 <= k < 95 else 2 for k in range(200)]
    late = 1e-8 * np.random.default_rng(1).normal(size=200)
    late[120:] += 3e-7
    late[80:95] = 2e-6
    lines = [made.ptp4l_line(100.0 + k + (50.0 if k >= 150 else 0.0), late[k], states[k])
             for k in range(200)]  # fmt: skip
    (series,) = read_logs([write(tmp_path / "ptp.log", lines)]).series
    (session,) = sessions_of(series, 3600.0)
    kinds = {event.kind: event for event in session.events}
    assert set(kinds) == {"startup", "unlock", "holdover", "relock", "step", "gap"}
    assert kinds["unlock"].size_s == pytest.approx(2e-6)
    assert (kinds["unlock"].from_s, kinds["unlock"].to_s) == (180.0, 195.0)
    assert kinds["gap"].to_s - kinds["gap"].from_s == 51.0
    assert int(np.sum(session.steady)) == 200 - 10 - 15
    midnight = 1_798_761_600.0  # 2027-01-01T00:00:00Z
    jump = [made.csv_lines([midnight + 16.0 * k], [1e-5 if k < 0 else 1.0])[1]
            for k in range(-50, 50)]  # fmt: skip
    (series,) = read_logs([write(tmp_path / "leap.csv", ["time_s,offset_us", *jump])]).series
    (session,) = sessions_of(series, 3600.0)
    assert [event.kind for event in session.events] == ["leap_second"]


def test_quantiles_are_of_time_not_of_samples(tmp_path: Path) -> None:
    """Samples every second while it is bad, every minute while it is good."""
    times = np.concatenate([np.arange(60.0), 60.0 + 60.0 * np.arange(1, 60)])
    late = np.where(times < 60.0, 1e-3, 1e-6)
    lines = made.csv_lines(START + times, late)
    (series,) = read_logs([write(tmp_path / "a.csv", lines)]).series
    (session,) = sessions_of(series, 3600.0)
    assert session.quantile_s(0.95) == pytest.approx(1e-6, rel=1e-3)
    assert session.quantile_s(0.99) == pytest.approx(1e-3, rel=1e-3)


REFUSED = {
    "empty": (b"", "an empty file"),
    "binary": (b"abc\x00\x01\x02" * 50, "not text"),
    "xz": (b"\xfd7zXZ\x00" + bytes(50), "packed with xz"),
    "prose": (b"Lorem ipsum dolor sit amet\n" * 50, "no clock log that is known"),
    "headers": ("\n".join([made.BANNER, "   Date (UTC) Time", made.BANNER]).encode(), "no samples"),
    "no unit": (b"time_s,offset\n" + b"1,2\n" * 30, "no offset whose unit and sign are known"),
    "no time": (b"epoch,offset_us\n" + b"1,2\n" * 30, "no time"),
    "no number": (b"time_s,offset_us\n1,2\n2,x\n", "no number in column offset"),
    "negative bound": (b"time_s,offset_us,bound_us\n1,2,3\n2,2,-3\n", "a bound below 0"),
    "filtered alone": (
        "\n".join(made.refclock_lines(START + 16.0 * k, 1e-5)[1] for k in range(40)).encode(),
        "only filtered samples",
    ),
    "infinite": (b"time_s,offset_us\n1,2\n2,inf\n", "no number in column offset"),
    "beyond": (b"time_s,offset_us\n1,2\n2,1e300\n", "no number in column offset"),
    "ragged": (b"time_s,offset_us\n1,2\n2\n3,4\n", "a row has not the header's cells"),
    "two offsets": (b"time_s,offset_us,offset_ms\n1,2,3\n", "two columns of one meaning"),
    "damaged gzip": (b"\x1f\x8b" + bytes(30), "damaged gzip file"),
    "long line": (b"x" * 70_000 + b"\n", "a line too long"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_no_clock_log_is_refused(name: str, tmp_path: Path) -> None:
    content, words = REFUSED[name]
    path = tmp_path / "any.log"
    path.write_bytes(content)
    with pytest.raises(BadInput, match=words):
        read_logs([path])


def test_what_is_cut_off_is_said(tmp_path: Path) -> None:
    text = "\n".join(made.tracking(START + 16.0 * np.arange(200), np.full(200, 1e-5)))
    plain = tmp_path / "plain.log"
    plain.write_text(text[:-60])
    packed = tmp_path / "packed.log.gz"
    packed.write_bytes(gzip.compress(text.replace("192.0.2.1", "192.0.2.9").encode())[:-300])
    read = read_logs([plain])
    assert len(read.series[0]) == 199
    assert read.notes == (f"{plain}: the last line is cut off and left out",)
    read = read_logs([packed])
    assert 20 < len(read.series[0]) < 200
    assert "cut off" in read.notes[0]


def test_rows_without_an_offset_are_counted_and_said(tmp_path: Path) -> None:
    """Every third cell is empty or nan: 34 of 100, too few in a row to be a gap."""
    cells = [("" if k % 2 else "nan") if k % 3 == 0 else f"1.{k:03d}" for k in range(100)]
    rows = [f"{1.7e9 + 10.0 * k:.3f},{cell}" for k, cell in enumerate(cells)]
    table = write(tmp_path / "table.csv", ["time_s,offset_us", *rows])
    read = read_logs([table])
    assert len(read.series[0]) == 66
    assert read.notes == (f"{table}: 34 rows without time or offset left out, the first in line 2",)


def test_a_number_that_lost_figures_is_left_out(tmp_path: Path) -> None:
    """0.000123456 cut to 0.00 still reads as a number; whole lines need no end."""
    rows = [f"{1.7e9 + 10.0 * k:.3f},{1.23456e-4 + 1e-9 * k:.9f}" for k in range(100)]
    table = tmp_path / "table.csv"
    table.write_text("\n".join(["time_s,offset_s", *rows]))
    assert len(read_logs([table]).series[0]) == 100
    table.write_text("\n".join(["time_s,offset_s", *rows])[:-7])
    read = read_logs([table])
    assert len(read.series[0]) == 99
    assert read.notes == (f"{table}: the last line is cut off and left out",)
    log = tmp_path / "tracking.log"
    text = "\n".join(made.tracking(START + 16.0 * np.arange(200), np.full(200, 1e-5)))
    log.write_text(text[: text.rindex(" ") - 2])  # three columns are gone, the offset is there
    assert len(read_logs([log]).series[0]) == 199


def test_a_bomb_is_refused_before_it_bursts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("syncline_design.clocks.files.MOST_UNPACKED", 2**20)
    path = tmp_path / "bomb.gz"
    path.write_bytes(gzip.compress(b"0" * 2**24))
    with pytest.raises(BadInput, match="too large once unpacked"):
        read_logs([path])


def _slow_tdev(x: list[float], n: int) -> float:
    total = 0.0
    count = len(x) - 3 * n + 1
    for j in range(count):
        inner = sum(x[i + 2 * n] - 2 * x[i + n] + x[i] for i in range(j, j + n))
        total += inner * inner
    return float((total / (6.0 * n * n * count)) ** 0.5)


def _slow_mtie(x: list[float], n: int) -> float:
    return max(max(x[j : j + n + 1]) - min(x[j : j + n + 1]) for j in range(len(x) - n))


@pytest.mark.parametrize("n", [1, 2, 3, 10, 33])
def test_tdev_and_mtie_are_their_definitions(n: int) -> None:
    source = np.random.default_rng(n)
    for x in (source.normal(size=120), np.cumsum(source.normal(size=100))):
        assert tdev(x, n) == pytest.approx(_slow_tdev(x.tolist(), n), rel=1e-9)
        assert mtie(x, n) == pytest.approx(_slow_mtie(x.tolist(), n), rel=1e-12)


def test_tdev_and_mtie_are_those_of_allantools() -> None:
    theirs = pytest.importorskip(
        "allantools", reason="allantools is not installed (the dev extra has it)"
    )
    x = np.cumsum(np.random.default_rng(0).normal(size=1000))
    for n in (1, 2, 5, 17, 100, 300):
        keys = {"rate": 1.0, "data_type": "phase", "taus": [n]}
        assert tdev(x, n) == pytest.approx(theirs.tdev(x, **keys)[1][0], rel=1e-9)
        assert mtie(x, n) == pytest.approx(theirs.mtie(x, **keys)[1][0], rel=1e-12)


HOSTILE = {
    "one word": "ptp4l[1.5]: " + "a" * 60_000,
    "blanks": "ptp4l[1.5]: " + " " * 60_000 + "x",
    "offsets": "ptp4l[1.5]: " + "offset " * 8_000,
    "brackets": "ptp4l" + "[1.5]" * 10_000,
    "ports": "ptp4l[1.5]: " + "port 1" * 9_000,
    "nested JSON": '{"class":"PPS",' + "[" * 60_000,
    "large JSON": '{"class":"PPS","device":"x","real_sec":1,"real_nsec":0,"clock_nsec":0,'
    '"clock_sec":1' + "0" * 3_000 + "}",
    "digits": "ppstest source 0 - assert " + "1" * 60_000,
}


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_lines_cost_no_more_than_their_length(name: str, tmp_path: Path) -> None:
    lines = [HOSTILE[name]] * 20 + [made.ptp4l_line(100.0 + k, 1e-6) for k in range(30)]
    started = time.process_time()
    (series,) = read_logs([write(tmp_path / "any.log", lines)]).series
    assert len(series) == 30
    assert time.process_time() - started < 2.0


def test_figures_that_are_none_are_damaged_lines(tmp_path: Path) -> None:
    lines = made.tracking(START + 16.0 * np.arange(60), np.full(60, 1e-5))
    lines[10] = lines[10].replace("-1.000e-05", "nan")
    lines[20] = lines[20].replace("-1.000e-05", "inf")
    path = write(tmp_path / "tracking.log", lines)
    read = read_logs([path])
    assert len(read.series[0]) == 58
    said = "2 damaged lines were left out, the first of them line 11: no line of this log"
    assert read.notes == (f"{path}: {said}",)
