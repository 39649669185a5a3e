"""From logs to a claim: bounds over sessions, what forbids a claim, the entry, the command."""

from __future__ import annotations

import json
import os
from pathlib import Path

import jsonschema
import numpy as np
import pytest

import syncline_design as sd
from syncline_design.clocks.study import TimingSettings, study_logs
from syncline_design.machine.records import read_as
from syncline_design.report.result_schemas import result_schema
from syncline_design.spec.load import load
from tests import clock_logs as made
from tests.clock_logs import START, sessions_csv, write
from tests.clocked_specs import ROOT, SPEC, run, week_of_logs
from tests.html_page import Page


def test_a_claim_over_sessions(tmp_path: Path) -> None:
    """Normal offsets: 95 % of |x| lie below 1.96 standard deviations, in every session alike."""
    paths = sessions_csv(tmp_path, [1e-5] * 20, count=2000, step_s=5.0)
    timing = study_logs(paths, TimingSettings()).timing
    claim = timing.claim
    assert (claim.made, claim.sessions, claim.needs_sessions, claim.why_not) == (True, 20, 0, None)
    assert claim.hours == pytest.approx(20 * 1999 * 5.0 / 3600.0)
    assert [row.quantile_s for row in timing.sessions] == pytest.approx([1.96e-5] * 20, rel=0.08)
    assert timing.statistical_bound_s is not None
    assert 1.96e-5 < timing.statistical_bound_s < 1.2 * 1.96e-5
    assert timing.bound_s == timing.statistical_bound_s
    assert timing.hard_bound_s is None
    assert timing.exit_code == 0
    assert claim.rests_on == "unknown"
    assert all(row.stationary for row in timing.sessions)
    assert len(timing.evidence) == 20


@pytest.mark.parametrize(("count", "need"), [(1, 2), (2, 1)])
def test_too_few_sessions_carry_no_claim(count: int, need: int, tmp_path: Path) -> None:
    paths = sessions_csv(tmp_path, [1e-5] * count)
    timing = study_logs(paths, TimingSettings()).timing
    assert (timing.claim.made, timing.claim.needs_sessions) == (False, need)
    assert timing.statistical_bound_s is None
    assert timing.exit_code == 1
    entry = tmp_path / "own.yaml"
    done = run("timing", *paths, "--as", "own", "--write-catalog", entry)
    assert done.exit_code == 1
    assert "no claim, so no entry written" in done.stderr
    assert not entry.exists()
    if count == 1:
        said = " ".join(done.stdout.split())
        assert "It holds for this session: |offset| stays below" in said
        assert "It says nothing about the next start: 2 more sessions" in said


def test_the_larger_of_both_bounds_is_taken_unless_asked_otherwise(tmp_path: Path) -> None:
    source = np.random.default_rng(5)
    paths = []
    for k in range(6):
        times = START + 86400.0 * k + 64.0 * np.arange(200)
        lines = made.tracking(times, source.normal(0.0, 1e-5, 200), hard_s=5e-4)
        paths.append(write(tmp_path / f"s{k}.log", lines))
    found = {use: study_logs(paths, TimingSettings(use=use)).timing
             for use in ("larger", "statistical", "hard")}  # type: ignore[arg-type]  # fmt: skip
    statistical = found["larger"].statistical_bound_s
    assert statistical is not None
    assert statistical < 1e-4
    hard = found["larger"].hard_bound_s
    assert hard == pytest.approx(5e-4, rel=0.02)
    assert found["larger"].bound_s == found["hard"].bound_s == hard
    assert found["statistical"].bound_s == statistical
    assert found["larger"].claim.rests_on == "servo"
    declared = TimingSettings(use="statistical", declared={"path_asymmetry": 5e-6})
    told = study_logs(paths, declared).timing
    assert told.bound_s == pytest.approx(statistical + 5e-6)
    assert told.claim.rests_on == "servo_and_declared"


def test_a_refclock_that_steers_nothing_is_the_evidence(tmp_path: Path) -> None:
    """The servo nulls its own offset; a second pulse shows 20 us of asymmetry."""
    tracking, pulses = [], []
    for k in range(6):
        for i in range(200):
            time_s = START + 86400.0 * k + 16.0 * i
            tracking.append(made.tracking_line(time_s, 1e-7))
            pulses += made.refclock_lines(time_s, 2e-5 + 1e-9 * (i % 2))
    logs = [write(tmp_path / "tracking.log", tracking), write(tmp_path / "refclocks.log", pulses)]
    timing = study_logs(logs, TimingSettings()).timing
    assert timing.source.name == "chrony refclock PPS2"
    assert timing.claim.rests_on == "independent"
    assert timing.bound_s == pytest.approx(2.1e-5, rel=1e-3)
    steered = [line.replace("192.0.2.1", "PPS2") for line in tracking]
    logs[0] = write(tmp_path / "steered.log", steered)
    assert study_logs(logs, TimingSettings()).timing.claim.rests_on == "servo"
    for rows, share in ((tracking[:200], "17 %"), (tracking[:-150], "98 %")):
        logs[0] = write(tmp_path / "part.log", rows)
        part = study_logs(logs, TimingSettings()).timing
        assert part.claim.rests_on == "servo"
        assert any(f"is of {share} of its rows" in note for note in part.notes), part.notes


def test_the_system_clock_is_phc2sys_and_ptp4l_together(tmp_path: Path) -> None:
    paths = []
    for k in range(5):
        lines = []
        for i in range(300):
            lines.append(made.ptp4l_line(1000.0 + i + 0.01 * k, 3e-7))
            lines.append(made.phc2sys_line(1000.5 + i, -1e-7 + 1e-9 * k))
        paths.append(write(tmp_path / f"boot{k}.log", lines))
    timing = study_logs(paths, TimingSettings()).timing
    assert timing.source.name == "CLOCK_REALTIME by phc2sys and ptp4l"
    assert timing.claim.sessions == 5
    assert timing.sessions[0].median_s == pytest.approx(-2e-7, abs=1e-12)
    assert timing.hard_bound_s == pytest.approx(4e-7 + 1.5e-6 + 0.25e-6, rel=0.02)


def test_lost_lock_of_the_card_is_lost_lock_of_the_chain(tmp_path: Path) -> None:
    lines = []
    for i in range(400):
        lost = 200 <= i < 230
        lines.append(made.ptp4l_line(1000.0 + i, 4e-6 if lost else 3e-8, 0 if lost else 2))
        lines.append(made.phc2sys_line(1000.5 + i, 1e-8))
    timing = study_logs([write(tmp_path / "boot.log", lines)], TimingSettings()).timing
    (lock,) = [event for event in timing.events if event.kind == "unlock"]
    assert lock.size_s == pytest.approx(4e-6 + 1e-8, rel=1e-3)
    assert timing.sessions[0].samples == 400 - 31
    paths = 1.5e-6 + 0.5e-6 / 2.0  # mean path delay of the card, half the reading of the card
    assert timing.event_bound_s == pytest.approx(4e-6 + 1e-8 + paths, rel=1e-3)


def test_what_the_daemon_says_of_a_lost_lock_is_part_of_the_bound_with_events(
    tmp_path: Path,
) -> None:
    """Offsets of 0.1 ms at most, and a root dispersion that grows to 303 ms without a source."""
    lines = made.tracking([], [])
    for day in range(6):
        for k in range(400):
            free = max(0, k - 99) if day == 3 and k < 130 else 0
            lines.append(made.tracking_line(START + 86400.0 * day + 16.0 * k, 1e-6 * (k % 7),
                                            hard_s=3e-3 + 1e-2 * free,
                                            leap="?" if free else "N"))  # fmt: skip
    timing = study_logs([write(tmp_path / "tracking.log", lines)], TimingSettings()).timing
    (lock,) = [event for event in timing.events if event.kind == "unlock"]
    assert lock.size_s < 1e-4
    assert timing.bound_s == pytest.approx(3e-3, rel=0.01)
    assert timing.event_bound_s == pytest.approx(0.303, rel=0.01)
    assert any("by the daemon's own word" in note for note in timing.notes)


def _spoiled(folder: Path, name: str) -> list[Path]:
    """Six good sessions, of which something is wrong."""
    paths = sessions_csv(folder, [1e-5] * 6, count=300, step_s=10.0)
    lines = paths[3].read_text("utf-8").splitlines()
    rows = [[float(cell) for cell in line.split(",")] for line in lines[1:]]
    if name == "DST":
        rows = [[t - (3600.0 if k > 150 else 0.0), x] for k, (t, x) in enumerate(rows)]
    elif name == "DST in spring":
        sunday = 1_805_590_800.0  # 2027-03-21T01:00:00Z
        rows = [[sunday + 10.0 * k + (3600.0 if k > 150 else 0.0), x]
                for k, (_, x) in enumerate(rows)]  # fmt: skip
    elif name == "leap":
        midnight = 1_798_761_600.0
        rows = [[midnight + 10.0 * (k - 150), x + (1e6 if k >= 150 else 0.0)]
                for k, (_, x) in enumerate(rows)]  # fmt: skip
    elif name == "hour":
        rows = [[t, x + (3600e6 if k > 150 else 0.0)] for k, (t, x) in enumerate(rows)]
    elif name == "TAI":
        rows = [[t, x + 37e6] for t, x in rows]
    elif name == "ns as us":
        rows = [[t, 1e3 * x] for t, x in rows]
    elif name == "ns from the middle on":
        rows = [[t, x * (1e3 if k > 150 else 1.0)] for k, (t, x) in enumerate(rows)]
    elif name == "ns at the end":
        rows = [[t, x * (1e3 if k > 275 else 1.0)] for k, (t, x) in enumerate(rows)]
    elif name == "stuck":
        rows = [[t, rows[0][1]] for t, _ in rows]
    elif name == "us as s":
        rows = [[t, 1e6 * x] for t, x in rows]
    write(paths[3], ["time_s,offset_us", *(f"{t:.3f},{x:.6f}" for t, x in rows)])
    return paths


DOUBTS = {
    "DST": "local time set back",
    "DST in spring": "local time set ahead (DST)?",
    "leap": "a leap second?",
    "hour": "local time (DST)?",
    "TAI": "TAI against UTC (37 s)",
    "ns as us": "are the units the same?",
    "ns from the middle on": "does another unit begin there?",
    "ns at the end": "does another unit begin there?",
    "us as s": "is that the unit",
    "stuck": "the offset never changes",
}


@pytest.mark.parametrize("name", DOUBTS)
def test_logs_in_doubt_carry_no_claim_and_nothing_is_written(name: str, tmp_path: Path) -> None:
    entry = tmp_path / "own.yaml"
    logs = _spoiled(tmp_path, name)
    done = run("timing", *logs, "--as", "own", "--write-catalog", entry, "-o", "json:-")
    assert done.exit_code == 1, done.stderr
    found = json.loads(done.stdout)
    assert any(DOUBTS[name] in one for one in found["doubts"]), found["doubts"]
    assert found["claim"]["made"] is False
    bounds = ("bound_s", "event_bound_s", "statistical_bound_s", "hard_bound_s")
    assert [found[bound] for bound in bounds] == [None] * 4
    assert found["claim"]["why_not"] == "the logs are in doubt"
    assert found["entry"] is None
    assert not entry.exists()
    assert study_logs(_spoiled(tmp_path, "nothing"), TimingSettings()).timing.doubts == ()


@pytest.mark.parametrize("what", ["step", "bad start", "settling", "noisy start", "noisy minutes"])
def test_a_clock_that_is_a_thousand_times_worse_for_a_while_is_no_change_of_unit(
    what: str, tmp_path: Path
) -> None:
    """The level moves without its scatter, or through all sizes between."""
    rng = np.random.default_rng(4)
    times, noise = START + 10.0 * np.arange(600), 1e-6 * rng.standard_normal(600)
    later = np.arange(600) >= 300
    if what == "bad start":
        times = times + later * 86_400.0
    extra = {"step": 1e-3 * later, "bad start": 1e-3 * later,
             "settling": 1e-3 * np.exp(-np.arange(600) / 60.0),
             "noisy start": 1e3 * noise * (np.arange(600) < 20),
             "noisy minutes": 1e3 * noise * (np.abs(np.arange(600) - 300) < 10)}[what]  # fmt: skip
    log = write(tmp_path / "a.csv", made.csv_lines(times, 1e-6 + noise + extra))
    assert study_logs([log], TimingSettings()).timing.doubts == ()


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("mean_s", [0.0, 1e-4])
def test_a_session_in_another_unit_within_one_table_is_in_doubt(
    seed: int, mean_s: float, tmp_path: Path
) -> None:
    """Slow noise about nothing: blocks of a session overlap with those of another, levels do not.

    A session with a bad start of the same size, and no more scatter, is none.
    """
    rng = np.random.default_rng(100 + seed)
    times, rows = [], []
    for day in range(6):
        walk = np.empty(400)
        walk[0] = 0.0
        for k in range(1, 400):
            walk[k] = 0.97 * walk[k - 1] + 5e-6 * rng.standard_normal()
        times.append(START + 86400.0 * day + 16.0 * np.arange(400))
        rows.append(mean_s + walk)
    other = [1e3 * row if day == 4 else row for day, row in enumerate(rows)]
    bad = [row + 1e-1 if day == 4 else row for day, row in enumerate(rows)]
    for name, late, doubted in (("mixed", other, True), ("bad", bad, False)):
        lines = made.csv_lines(np.concatenate(times), np.concatenate(late))
        found = study_logs([write(tmp_path / f"{name}.csv", lines)], TimingSettings()).timing
        assert bool(found.doubts) is doubted, (name, found.doubts)
        assert found.claim.made is not doubted


def test_a_log_of_one_minute_is_no_session(tmp_path: Path) -> None:
    times = START + np.arange(60.0)
    log = write(tmp_path / "a.csv", made.csv_lines(times, np.full(60, 1e-5)))
    timing = study_logs([log], TimingSettings()).timing
    assert (timing.claim.sessions, timing.claim.made) == (0, False)
    assert timing.bound_s is None
    assert any("too short" in note for note in timing.notes)


def test_a_share_that_the_samples_cannot_show_is_not_claimed(tmp_path: Path) -> None:
    paths = sessions_csv(tmp_path, [1e-5] * 6)
    assert study_logs(paths, TimingSettings(coverage=0.99)).timing.claim.made
    claim = study_logs(paths, TimingSettings(coverage=0.9999)).timing.claim
    assert not claim.made
    assert "too few samples in a session" in (claim.why_not or "")


REFUSED = {
    "mixed": (lambda p: [*sessions_csv(p, [1e-5]),
                         write(p / "t.log", made.tracking([START], [0.0]))],
              "several kinds of logs"),
    "TOFF": (lambda p: [write(p / "g.json", [made.gpsd_line(START + k, 0.1, "TOFF")
                                             for k in range(200)])],
             "latency of the serial line"),
    "missing": (lambda p: [p / "none.log"], "cannot read"),
    "folder": (lambda p: [p], "a folder"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_logs_that_cannot_be_used_are_refused(name: str, tmp_path: Path) -> None:
    make, words = REFUSED[name]
    entry = tmp_path / "own.yaml"
    done = run("timing", *make(tmp_path), "--as", "own", "--write-catalog", entry)
    assert done.exit_code == 2
    assert words in done.stderr
    assert not entry.exists()


@pytest.mark.parametrize(
    "arguments",
    [
        ("--coverage", "1"), ("--coverage", "95"), ("--confidence", "0"), ("--session", "5"),
        ("--session", "-1 h"), ("--declare", "5us"), ("--declare", "path=5 m"),
        ("--source", "ptp4l"), ("--as", "own clock"), ("--write-catalog", "x.yaml"),
    ],
)  # fmt: skip
def test_slips_of_the_command_line_are_named(arguments: tuple[str, str], tmp_path: Path) -> None:
    done = run("timing", *sessions_csv(tmp_path, [1e-5] * 2), *arguments)
    assert done.exit_code == 2
    assert done.stdout == ""
    assert arguments[0] in done.stderr
    assert "Traceback" not in done.stderr


def test_outputs_agree_and_are_as_the_schema_says(tmp_path: Path) -> None:
    logs = week_of_logs(tmp_path, 1e-5)
    page, data, text = (tmp_path / f"t.{end}" for end in ("html", "json", "md"))
    done = run("timing", *logs, "--spec", ROOT / "specs" / "position_track.yaml",
               "-o", f"html:{page}", "-o", f"json:{data}", "-o", f"markdown:{text}")  # fmt: skip
    assert done.exit_code == 0, done.stderr
    told = json.loads(data.read_text("utf-8"))
    jsonschema.Draft202012Validator(result_schema("timing")).validate(told)
    assert told["schema"] == "syncline-design/timing/v1"
    wanted = {"sessions", "bound_s", "event_bound_s", "statistical_bound_s", "hard_bound_s",
              "claim", "events", "entry"}  # fmt: skip
    assert wanted <= set(told)
    assert set(told["sessions"][0]) >= {"from", "to", "samples", "median_s", "quantile_s"}
    assert set(told["claim"]) >= {"coverage", "session_share", "confidence", "sessions", "hours",
                                  "rests_on", "made", "needs_sessions"}  # fmt: skip
    from syncline_design.comparison.clock_meaning import TimingAndSpec

    again = read_as(TimingAndSpec, data.read_text("utf-8"))
    assert again.to_json() == told
    seen = Page(page.read_text("utf-8"))
    assert (seen.open, seen.unbalanced) == ([], [])
    assert len(seen.attribute("svg", "aria-labelledby")) == 3
    for words in ("Offset over time", "TDEV and MTIE", "Sessions against the bound"):
        assert words in page.read_text("utf-8")
    assert "No τ changes" not in text.read_text("utf-8") or told["spec"]["before"]
    assert sd.timing(logs).to_json()["bound_s"] == told["bound_s"]
    assert run("timing", *logs).stdout == run("timing", *logs, "--seed", "3").stdout


def test_names_of_files_do_no_harm(tmp_path: Path) -> None:
    """Bytes that are no text, markup, quotes, lines, escapes and hidden turns of direction."""
    names = [b"a\xff.csv", b"<script>.csv", b'x"; y.csv', "\u202e.csv".encode(), b"new\nline.csv",
             b"z\x1b[31m.csv"]  # fmt: skip
    logs = []
    for plain, name in zip(sessions_csv(tmp_path, [1e-5] * 6), names, strict=True):
        logs.append(plain.rename(tmp_path / os.fsdecode(name)))
    entry, page = tmp_path / "own_clock.yaml", tmp_path / "page.html"
    done = run("timing", *logs, "--as", "own_clock", "--write-catalog", entry, "-o", f"html:{page}",
               "--conditions", 'bad\x07 \u202e "words"')  # fmt: skip
    assert done.exit_code == 0, done.stderr
    assert "<script>.csv" not in page.read_text("utf-8")
    spec = tmp_path / "spec.yaml"
    spec.write_text(SPEC, "utf-8")
    offset = load(spec).catalog.clocks["own_clock"].offset
    assert len(offset.evidence) == 6
    assert (offset.conditions or "").isprintable()


def test_what_a_session_remembers_is_held_against_its_length(tmp_path: Path) -> None:
    paths = []
    for k in range(5):
        times = START + 86400.0 * k + 10.0 * np.arange(400)
        late = 1e-5 * np.cumsum(np.random.default_rng(k).normal(size=400))
        paths.append(write(tmp_path / f"walk{k}.csv", made.csv_lines(times, late)))
    notes = study_logs(paths, TimingSettings()).timing.notes
    assert any("shorter than ten times what they remember" in note for note in notes)
    noise = study_logs(sessions_csv(tmp_path, [1e-5] * 5), TimingSettings()).timing.notes
    assert not any("remember" in note for note in noise)


def test_clocks_at_the_same_time_are_said(tmp_path: Path) -> None:
    source = np.random.default_rng(0)
    times = START + 10.0 * np.arange(200)
    paths = [write(tmp_path / f"van{k}.csv", made.csv_lines(times, source.normal(0, 1e-5, 200)))
             for k in range(3)]  # fmt: skip
    notes = study_logs(paths, TimingSettings()).timing.notes
    assert any("overlap in time" in note for note in notes)
    apart = study_logs(sessions_csv(tmp_path, [1e-5] * 3), TimingSettings()).timing.notes
    assert not any("overlap" in note for note in apart)


def test_a_session_a_row_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("syncline_design.clocks.study.MOST_SESSIONS", 100)
    done = run("timing", *sessions_csv(tmp_path, [1e-5]), "--session", "5 s")
    assert done.exit_code == 2
    assert "is --session shorter" in done.stderr


def test_sessions_of_different_length_are_said(tmp_path: Path) -> None:
    paths = []
    for k, count in enumerate((100, 100, 100, 100, 400)):
        folder = tmp_path / str(k)
        folder.mkdir()
        paths += sessions_csv(folder, [1e-5], count=count, seed=k)
    notes = study_logs(paths, TimingSettings()).timing.notes
    assert any("the claim is for such a mixture" in note for note in notes)


def test_the_session_that_makes_a_bound_wide_is_named(tmp_path: Path) -> None:
    """Four sessions of 40 us and one that stepped by 2 ms: its start is said beside the width."""
    rng = np.random.default_rng(5)
    logs = []
    for day in range(5):
        late = 4e-5 + 4e-6 * rng.standard_normal(400) + (2e-3 if day == 3 else 0.0)
        rows = (f"{START + 86400 * day + 10 * k:.0f},{1e6 * x:.3f}" for k, x in enumerate(late))
        logs.append(write(tmp_path / f"{day}.csv", ["time_s,offset_us", *rows]))
    result = study_logs(logs, TimingSettings()).timing
    (said,) = [note for note in result.notes if "times the largest session" in note]
    assert f"the session from {result.sessions[3].from_} alone" in said
    even = study_logs(logs[:3], TimingSettings()).timing
    assert not [note for note in even.notes if "alone makes it" in note]
