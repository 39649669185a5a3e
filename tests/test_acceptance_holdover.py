"""`accept` of a clock whose figure is for a time without a reference, and of logs given twice."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.acceptance_samples import EXAMPLE, ROOT, first_rows, run
from tests.clock_logs import START, sessions_csv, tracking_line, write
from tests.test_acceptance_clocks import CLOCKED, OWN_CLOCK


def clock_row(folder: Path, logs: list[Path], holdover: str) -> tuple[dict[str, Any], int]:
    """Of 1 ms in lock and, with a holdover, 0.1 ppm without one."""
    drifting = OWN_CLOCK.replace("cost: 0 EUR", f"{holdover}cost: 0 EUR")
    (folder / "clocks.yaml").write_text(drifting, "utf-8")
    spec = folder / "clocked.yaml"
    spec.write_text(CLOCKED, "utf-8")
    done = run("accept", spec, *logs, "--only", "clock", "--independent", "-o", "json:-")
    (row,) = json.loads(done.stdout)["assumptions"]
    return row, done.exit_code


@pytest.mark.parametrize(
    ("holdover", "status"),
    [("", "holds"), ("drift: 0.1 ppm, holdover: 2 h, ", "not_shown"),
     ("offset_after: 2 h, ", "not_shown")],
)  # fmt: skip
def test_logs_in_lock_show_no_holdover(tmp_path: Path, holdover: str, status: str) -> None:
    """Offsets of 0.1 ms are within 1 ms, or within 1.72 ms: in lock no drift shows."""
    logs = sessions_csv(tmp_path, [1e-4] * 20, count=800, step_s=10.0)
    row, code = clock_row(tmp_path, logs, holdover)
    assert (row["status"], code) == (status, {"holds": 0, "not_shown": 3}[status]), row
    assert ("2 h without a reference" in row["evidence"]) == (status == "not_shown")


def dive(folder: Path, day: int, unlocked_s: float) -> Path:
    """A session of chrony in lock, some time without its reference (0.1 ppm), in lock again."""
    source = np.random.default_rng(day)
    lines = []
    for k in range(900):
        at_s = 16.0 * k
        free_s = at_s - 3000.0 if 3000.0 <= at_s < 3000.0 + unlocked_s else 0.0
        lines.append(tracking_line(START + 86400.0 * day + at_s, source.normal(0.0, 1e-5)
                                   + 1e-7 * free_s, leap="?" if free_s else "N"))  # fmt: skip
    place = folder / f"day{day}"
    place.mkdir()
    return write(place / "tracking.log", lines)


@pytest.mark.parametrize(("dives", "status"), [(8, "holds"), (5, "not_shown")])
def test_a_free_run_in_every_session_bears_a_holdover_out(
    tmp_path: Path, dives: int, status: str
) -> None:
    """0.72 ms at the end of 2 h: within 1 ms and 0.72 ms of drift."""
    logs = [dive(tmp_path, day, 7300.0 if day < dives else 600.0) for day in range(8)]
    row, _ = clock_row(tmp_path, logs, "drift: 0.1 ppm, holdover: 2 h, ")
    assert row["status"] == status, row
    assert ("5 of 8 sessions" in row["evidence"]) == (status == "not_shown")


def test_a_clock_that_dives_is_not_borne_out_by_its_logs_at_the_surface(tmp_path: Path) -> None:
    """The shipped relay: 1 us and 0.005 ppm over 4 h."""
    logs = sessions_csv(tmp_path, [2e-6] * 10, count=800, step_s=5.0)
    given = [part for log in logs for part in ("--assign", f"auv={log}")]
    asked = ("--only", "clock", "--independent", "-o", "json:-")
    done = run("accept", ROOT / "specs" / "rov_relay.yaml", *given, *asked)
    rows = {row["stage"]: row for row in json.loads(done.stdout)["assumptions"]}
    assert rows["auv"]["status"] == "not_shown", rows["auv"]
    assert "4 h without a reference" in rows["auv"]["evidence"]


@pytest.mark.parametrize("given_as", ["the same files", "copies", "in another unit"])
def test_one_log_is_not_of_several_clocks(tmp_path: Path, given_as: str) -> None:
    """Three vehicles have three clocks, whose noise cannot be the same from row to row."""
    logs = sessions_csv(tmp_path, [2e-4] * 3, count=400, step_s=10.0)
    others = logs
    if given_as != "the same files":
        (tmp_path / "rov").mkdir()
        others = [tmp_path / "rov" / log.name for log in logs]
        for log, other in zip(logs, others, strict=True):
            text = log.read_text("utf-8")
            if given_as == "in another unit":
                rows = [line.split(",") for line in text.splitlines()[1:]]
                kept = [f"{at},{float(late) / 1e3:.6f}" for at, late in rows]
                text = "\n".join(["time_s,offset_ms", *kept]) + "\n"
            other.write_text(text, "utf-8")
    given = [part for log in logs for part in ("--assign", f"auv={log}")]
    given += [part for log in others for part in ("--assign", f"rov={log}")]
    done = run("accept", ROOT / "specs" / "rov_relay.yaml", *given, "--only", "clock")
    assert (done.exit_code, done.stdout) == (2, ""), done.stdout
    assert "one clock's log for several vehicles (auv, rov)" in done.stderr
    assert "the same `vehicle`" in done.stderr
    fresh = tmp_path / "fresh"
    fresh.mkdir()
    own = sessions_csv(fresh, [2e-4] * 3, count=400, step_s=10.0, seed=5)
    given = [part for log in logs for part in ("--assign", f"auv={log}")]
    given += [part for log in own for part in ("--assign", f"rov={log}")]
    done = run("accept", ROOT / "specs" / "rov_relay.yaml", *given, "--only", "clock")
    assert done.exit_code != 2, done.stderr


def test_one_clock_may_stamp_several_sensors_of_a_vehicle(tmp_path: Path) -> None:
    logs = sessions_csv(tmp_path, [1e-4] * 20, count=800, step_s=10.0)
    (tmp_path / "clocks.yaml").write_text(OWN_CLOCK, "utf-8")
    spec = tmp_path / "clocked.yaml"
    spec.write_text(CLOCKED, "utf-8")
    given = [part for log in logs for role in ("", "/position")
             for part in ("--assign", f"uav{role}={log}")]  # fmt: skip
    done = run("accept", spec, *given, "--only", "clock,timing", "--independent", "-o", "json:-")
    rows = {(row["role"], row["status"]) for row in json.loads(done.stdout)["assumptions"]}
    assert {("clock", "holds"), ("position", "holds")} <= rows


def test_a_log_that_is_assigned_and_given_besides_is_refused_so(tmp_path: Path) -> None:
    (log,) = sessions_csv(tmp_path, [1e-4], count=400, step_s=10.0)
    spec = ROOT / "specs" / "rov_relay.yaml"
    done = run("accept", spec, log, "--assign", f"auv={log}", "--only", "clock")
    assert (done.exit_code, done.stdout) == (2, "")
    assert "given with --assign auv and without; expected each log once" in done.stderr


def test_places_that_are_given_twice_are_refused(tmp_path: Path) -> None:
    """By the same path it was taken once, without a word; by a copy it was refused."""
    log = first_rows(tmp_path)
    for again in (log, tmp_path / "." / log.name):
        done = run("accept", EXAMPLE, log, again)
        assert (done.exit_code, done.stdout) == (2, "")
        assert "the same log is given twice" in done.stderr
