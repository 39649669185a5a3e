"""The catalog entry that logs become: its signs, its place, what `check` then says."""

from __future__ import annotations

import hashlib
import json
import os
import re
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from syncline_design.clocks.study import TimingSettings, study_logs
from syncline_design.spec.load import load
from syncline_design.verdict.verify import CheckSettings, check_loaded
from tests import clock_logs as made
from tests.clock_logs import START, write
from tests.clocked_specs import SPEC, run, week_of_logs


def test_a_week_of_logs_becomes_an_entry_that_decides_a_verdict(tmp_path: Path) -> None:
    """tau_crit of the position is sqrt(3) cm over 20 m/s: 866 us; its stamps are on UTC, the
    reference's on the host."""
    spec = tmp_path / "spec.yaml"
    spec.write_text(SPEC, "utf-8")
    entry = tmp_path / "own_clock.yaml"
    for sigma_s, word, code in ((1e-4, "meets", 0), (1e-3, "fails", 1)):
        logs = week_of_logs(tmp_path, sigma_s)
        done = run("timing", *logs, "--as", "own_clock", "--write-catalog", entry, "--coverage",
                   "0.96", "--conditions", "on the bench")  # fmt: skip
        assert done.exit_code == 0, done.stderr
        checked = run("check", spec, "-o", "json:-")
        assert checked.exit_code == code, checked.stdout + checked.stderr
        verdict = json.loads(checked.stdout)
        assert verdict["verdict"] == word
        (shown,) = verdict["measured"]
        assert shown["claim"]["sessions"] == 7
        assert shown["claim"]["session_s"] == pytest.approx(399 * 60.0)
        assert shown["conditions"] == "on the bench"
        hashes = {one["sha256"] for one in shown["evidence"]}
        assert hashes == {hashlib.sha256(p.read_bytes()).hexdigest() for p in logs}
        codes = {w["code"] for w in verdict["warnings"] if w["code"].startswith("measured")}
        assert codes == {"measured-servo"}
    case = load(spec)
    offset = case.catalog.clocks["own_clock"].offset
    said = study_logs(logs, TimingSettings(coverage=0.96)).timing
    assert offset.bound is not None
    assert said.bound_s is not None
    assert said.bound_s <= float(offset.bound) <= said.bound_s * 1.0001


def test_optimize_names_the_measured_clock_and_cautions_as_check_does(tmp_path: Path) -> None:
    """Of two clocks the one from logs costs nothing until somebody fills its price in."""
    text = SPEC.replace("candidates: [own_clock]", "candidates: [ocxo, own_clock]")
    assert text != SPEC
    text = text.replace("primitives: []", "primitives: [], cost: 1 EUR")
    spec = tmp_path / "spec.yaml"
    spec.write_text(text, "utf-8")
    logs = week_of_logs(tmp_path, 1e-6)
    run("timing", *logs, "--as", "own_clock", "--write-catalog", tmp_path / "own_clock.yaml")
    done = run("optimize", spec)
    assert done.exit_code == 0, done.stdout + done.stderr
    assert "uav clock" in done.stdout
    assert "own_clock" in done.stdout.split("Warnings")[0]
    told = json.loads(run("optimize", spec, "-o", "json:-").stdout)["warnings"]
    checked = json.loads(run("check", spec, "-o", "json:-").stdout)["warnings"]
    of_clock = {one["code"] for one in checked if one.get("entry") == "own_clock"}
    assert {"measured-servo", "assumption"} <= of_clock
    assert of_clock <= {one["code"] for one in told if one.get("entry") == "own_clock"}


def entry_of_a_week(folder: Path) -> Path:
    """An entry beside its logs, as `timing` writes it."""
    logs = week_of_logs(folder, 1e-4)
    entry = folder / "own_clock.yaml"
    done = run("timing", *logs, "--as", "own_clock", "--write-catalog", entry)
    assert done.exit_code == 0, done.stderr
    (folder / "spec.yaml").write_text(SPEC, "utf-8")
    return entry


def checked(folder: Path) -> dict[str, Any]:
    told: dict[str, Any] = json.loads(run("check", folder / "spec.yaml", "-o", "json:-").stdout)
    return told


def bound_of(entry: Path) -> str:
    (line,) = [one for one in entry.read_text("utf-8").splitlines() if "bound: " in one]
    return line.partition("bound: ")[2]


@pytest.mark.parametrize(
    "what", ["bound", "coverage", "sessions", "values", "hash", "distribution", "event"]
)
def test_an_entry_that_was_edited_is_not_taken_as_measured(tmp_path: Path, what: str) -> None:
    entry = entry_of_a_week(tmp_path)
    text = entry.read_text("utf-8")
    values = tmp_path / "own_clock_values.txt"
    changed = {
        "bound": text.replace(f"bound: {bound_of(entry)}", "bound: 12 us"),
        "coverage": text.replace("coverage: 0.95", "coverage: 0.999"),
        "sessions": text.replace("sessions: 7", "sessions: 60"),
        "hash": re.sub(r"(sha256: )(.)", lambda m: m[1] + f"{int(m[2], 16) ^ 1:x}", text, count=1),
        "distribution": text.replace(
            "distribution: empirical", "distribution: normal").replace(
            'file: "own_clock_values.txt"', "{mean: 0 s, std: 1 us}"),
        "event": text.replace("events: []", "events: [{kind: step, count: 1, largest: 1 ns}]"),
        "values": text,
    }[what]  # fmt: skip
    if what == "distribution":
        changed = changed.replace(
            "      {mean: 0 s, std: 1 us}", "      mean: 0 s\n      std: 1 us"
        )
    if what == "values":
        values.write_text(values.read_text("utf-8").replace("s\n", "s\n1e-9\n", 1), "utf-8")
    assert (changed != text) == (what != "values")
    entry.write_text(changed, "utf-8")
    told = checked(tmp_path)
    (caution,) = [one for one in told["warnings"] if one["code"].startswith("measured")]
    assert caution["code"] == "measured-altered"
    assert "own_clock is NOT taken as measured" in caution["message"]
    assert "measured" not in told
    done = run("catalog", "check", entry)
    assert done.exit_code == 1
    assert "clocks.own_clock.offset: not as it was measured" in done.stdout + done.stderr


def test_an_entry_as_written_is_taken_as_measured(tmp_path: Path) -> None:
    """Figures in other units, other words and prices, and values in another file, are no others."""
    entry = entry_of_a_week(tmp_path)
    assert run("catalog", "check", entry).exit_code == 0
    text = entry.read_text("utf-8")
    figure, unit = bound_of(entry).split()
    assert unit == "us"
    (tmp_path / "own_clock_values.txt").rename(tmp_path / "moved.txt")
    for old, new in ((f"bound: {figure} us", f"bound: {Decimal(figure) / 1000} ms"),
                     ("own_clock_values.txt", "moved.txt"), ("cost: 0 EUR", "cost: 12 EUR"),
                     ("as in the logs, not stated", "in the van")):  # fmt: skip
        assert old in text
        text = text.replace(old, new)
    entry.write_text(text, "utf-8")
    told = checked(tmp_path)
    assert [one["entry"] for one in told["measured"]] == ["own_clock"]
    codes = {one["code"] for one in told["warnings"] if one["code"].startswith("measured")}
    assert codes == {"measured-servo"}
    assert run("catalog", "check", entry).exit_code == 0


def test_an_entry_without_a_digest_is_taken_with_a_caution(tmp_path: Path) -> None:
    entry = entry_of_a_week(tmp_path)
    lines = entry.read_text("utf-8").splitlines(keepends=True)
    entry.write_text("".join(one for one in lines if "digest: " not in one), "utf-8")
    told = checked(tmp_path)
    assert [one["entry"] for one in told["measured"]] == ["own_clock"]
    codes = {one["code"] for one in told["warnings"] if one["code"].startswith("measured")}
    assert codes == {"measured-servo", "measured-unchecked"}
    assert run("catalog", "check", entry).exit_code == 0


def test_a_bound_that_its_own_values_contradict_is_not_measured(tmp_path: Path) -> None:
    """Typed anew, the digest taken out: 12 us hold a tenth of offsets of 0.1 ms, not 95 %."""
    entry = entry_of_a_week(tmp_path)
    lines = entry.read_text("utf-8").splitlines(keepends=True)
    text = "".join(one for one in lines if "digest: " not in one)
    entry.write_text(text.replace(f"bound: {bound_of(entry)}", "bound: 12 us"), "utf-8")
    told = checked(tmp_path)
    (caution,) = [one for one in told["warnings"] if one["code"].startswith("measured")]
    assert caution["code"] == "measured-altered"
    assert "of its own values lie within its bound" in caution["message"]
    assert "measured" not in told
    assert run("catalog", "check", entry).exit_code == 1


def test_a_log_that_changed_since_is_said(tmp_path: Path) -> None:
    entry_of_a_week(tmp_path)
    log = next(iter(sorted(tmp_path.glob("run*.csv"))))
    log.write_text(log.read_text("utf-8") + "\n", "utf-8")
    told = checked(tmp_path)
    (said,) = [one for one in told["warnings"] if one["code"] == "measured-evidence"]
    assert log.name in said["message"]
    log.unlink()
    told = checked(tmp_path)
    assert "measured-evidence" not in {one["code"] for one in told["warnings"]}
    os.mkfifo(log)
    try:
        told = checked(tmp_path)
    finally:
        log.unlink()
    assert "measured-evidence" not in {one["code"] for one in told["warnings"]}


def test_signs_of_an_entry(tmp_path: Path) -> None:
    """A clock 1 ms late: host minus UTC is -1 ms; data stamped by it were valid 1 ms later."""
    source = np.random.default_rng(0)
    logs = []
    for k in range(5):
        times = START + 86400.0 * k + 60.0 * np.arange(200)
        late = 1e-3 + source.normal(0.0, 1e-6, 200)
        logs.append(write(tmp_path / f"r{k}.csv", made.csv_lines(times, late)))
    means = {}
    for kind in ("clock", "timestamping"):
        path = tmp_path / f"{kind}.yaml"
        assert run("timing", *logs, "--as", kind, "--entry", kind, "--write-catalog",
                   path).exit_code == 0  # fmt: skip
        spec = tmp_path / f"{kind}_spec.yaml"
        spec.write_text(SPEC.replace("own_clock.yaml", path.name).replace(
            "    clock: {candidates: [own_clock]}\n", ""), "utf-8")  # fmt: skip
        catalog = load(spec).catalog
        error = (catalog.clocks["clock"].offset if kind == "clock"
                 else catalog.timestamping["timestamping"].error)  # fmt: skip
        means[kind] = float(np.mean([float(v) for v in error.values or ()]))  # type: ignore[union-attr]
    assert means["clock"] == pytest.approx(-1e-3, rel=1e-3)
    assert means["timestamping"] == pytest.approx(1e-3, rel=1e-3)


def test_what_it_means_for_a_spec_is_what_check_then_says(tmp_path: Path) -> None:
    base = SPEC.replace("catalogs: [own_clock.yaml]\n", "").replace("own_clock", "ntp")
    spec = tmp_path / "base.yaml"
    spec.write_text(base, "utf-8")
    logs = week_of_logs(tmp_path, 1e-3)
    done = run("timing", *logs, "--spec", spec, "-o", "json:-")
    means = json.loads(done.stdout)["spec"]
    assert (means["before"], means["after"]) == ("meets", "fails")
    assert means["requirement_changes"] == ["SYNC-1: pass to fail"]
    shown = run("timing", *logs, "--spec", spec).stdout
    assert "✗ Bound " in shown
    assert "with which the spec no longer passes" in shown
    assert means["measured_tau_s"] > 10.0 * means["tau_s"]
    assert "asked_coverage" not in means  # k = 2, said to be 95 %
    spec.write_text(base.replace("coverage_factor: 2", "coverage_factor: 3"), "utf-8")
    asked = json.loads(run("timing", *logs, "--spec", spec, "-o", "json:-").stdout)["spec"]
    assert asked["asked_coverage"] == pytest.approx(0.9973002, abs=1e-7)
    entry = tmp_path / "own_clock.yaml"
    run("timing", *logs, "--as", "own_clock", "--write-catalog", entry)
    with_it = tmp_path / "with.yaml"
    with_it.write_text(SPEC, "utf-8")
    verdict = check_loaded(load(with_it), CheckSettings(monte_carlo=False))
    assert verdict.design is not None
    (stage,) = verdict.design.stages
    (clock,) = verdict.design.clocks
    offsets = {"utc": 0.0, "host": clock.offset_bound_s}
    taus = {row["role"]: row["measured_tau_s"] for row in means["sensors"]}
    own = {k: r.tau_s + offsets[r.timeline] for k, r in stage.roles.items()}
    assert taus == pytest.approx(own, rel=2e-4)  # an entry is rounded up
    was = check_loaded(load(spec), CheckSettings(monte_carlo=False)).design
    assert was is not None
    more_s = clock.offset_bound_s - was.clocks[0].offset_bound_s
    assert {r.timeline for r in stage.roles.values()} == {"utc", "host"}
    for row in means["sensors"]:
        moved = row["measured_tau_s"] - row["tau_s"]
        change = more_s if row["timeline"] == "host" else 0.0
        assert moved == pytest.approx(change, rel=2e-4, abs=1e-12)
        assert (row["bound_ratio"] is None) == (row["timeline"] == "utc")


def test_toff_may_become_a_method_of_stamping_on_arrival(tmp_path: Path) -> None:
    logs = [write(tmp_path / f"g{k}.json", [made.gpsd_line(START + 86400 * k + i, -0.1 - 1e-6 * i,
                                                           "TOFF") for i in range(200)])
            for k in range(5)]  # fmt: skip
    done = run("timing", *logs, "--as", "serial", "--entry", "timestamping", "--write-catalog",
               tmp_path / "serial.yaml")  # fmt: skip
    assert done.exit_code == 0, done.stderr


def test_an_entry_takes_nobody_else_s_place(tmp_path: Path) -> None:
    logs = week_of_logs(tmp_path, 1e-5)
    other = write(tmp_path / "other.yaml", ["clocks: {}"])
    done = run("timing", *logs, "--as", "own", "--write-catalog", other)
    assert done.exit_code == 2
    assert other.read_text("utf-8") == "clocks: {}\n"
    again = tmp_path / "again.yaml"
    for _ in range(2):
        assert run("timing", *logs, "--as", "own", "--write-catalog", again).exit_code == 0
    assert run("timing", *logs, "--as", "else", "--write-catalog", again).exit_code == 2


def test_an_entry_has_its_own_id_and_the_spec_s_currency(tmp_path: Path) -> None:
    logs = week_of_logs(tmp_path, 1e-5)
    taken = run("timing", *logs, "--as", "ntp", "--write-catalog", tmp_path / "a.yaml")
    assert taken.exit_code == 2
    assert "built-in" in taken.stderr
    spec, base = tmp_path / "dollars.yaml", tmp_path / "own_clock.yaml"
    dollars = SPEC.replace("coverage_factor", "currency: USD\ncoverage_factor")
    without = dollars.replace("catalogs: [own_clock.yaml]\n", "").replace(
        "    clock: {candidates: [own_clock]}\n", ""
    )
    spec.write_text(without, "utf-8")
    done = run("timing", *logs, "--as", "own_clock", "--write-catalog", base, "--spec", spec)
    assert done.exit_code == 0, done.stderr
    spec.write_text(dollars, "utf-8")
    assert check_loaded(load(spec), CheckSettings(monte_carlo=False)).verdict == "meets"


@pytest.mark.parametrize("identity", ["Odd-X", "my.clock", "a__b", "9", "x" * 81])
def test_no_entry_is_written_by_an_id_that_catalogs_refuse(tmp_path: Path, identity: str) -> None:
    logs = week_of_logs(tmp_path, 1e-4)
    entry = tmp_path / "own.yaml"
    done = run("timing", *logs, "--as", identity, "--write-catalog", entry)
    assert (done.exit_code, done.stdout, entry.exists()) == (2, "", False)
    assert "not an id; expected lower case" in done.stderr


def _noted(folder: Path, off_s: float, other_s: float) -> list[Path]:
    """Seven sessions in lock; of each five rows off by so much, and another server's statistics."""
    paths = []
    for k in range(7):
        source = np.random.default_rng(k)
        times = START + 86400.0 * k + 60.0 * np.arange(400)
        late = source.normal(0.0, 1e-4, 400)
        late[200:205] += off_s
        lines = [made.tracking_line(t, x, hard_s=8e-4) for t, x in zip(times, late, strict=True)]
        paths.append(write(folder / f"tracking_{k}.log", lines))
        other = [made.statistics_line(t, other_s).replace("192.0.2.1 ", "192.0.2.9 ")
                 for t in times]  # fmt: skip
        paths.append(write(folder / f"statistics_{k}.log", other))
    return paths


@pytest.mark.parametrize(
    ("off_s", "other_s", "codes"),
    [
        (0.0, 0.0, set()),
        (0.02, 0.0, {"measured-events"}),
        (0.0, 0.03, {"measured-reserved"}),
    ],
)
def test_what_timing_said_of_the_logs_stays_with_the_entry(
    off_s: float, other_s: float, codes: set[str], tmp_path: Path
) -> None:
    """A step of 20 ms for five minutes of 400; another server 30 ms off."""
    spec = tmp_path / "spec.yaml"
    spec.write_text(SPEC, "utf-8")
    entry = tmp_path / "own_clock.yaml"
    done = run("timing", *_noted(tmp_path, off_s, other_s), "--as", "own_clock",
               "--write-catalog", entry, "--coverage", "0.96", "--use", "statistical")  # fmt: skip
    assert done.exit_code == 0, done.stdout + done.stderr
    verdict = json.loads(run("check", spec, "-o", "json:-").stdout)
    said = {w["code"]: w["message"] for w in verdict["warnings"]}
    assert {"measured-events", "measured-reserved"} & set(said) == codes
    assert ("20" in said.get("measured-events", "")) == ("measured-events" in codes)
    assert ("192.0.2.9" in said.get("measured-reserved", "")) == ("measured-reserved" in codes)
    assert "measured-altered" not in said


def test_values_of_an_entry_hold_what_the_clock_ran_off_by(tmp_path: Path) -> None:
    """Late by up to 20 ms in a silence of two thirds of the log, counted in twentieths of it."""
    paths = []
    for k in range(5):
        times = START + 86400.0 * k + 60.0 * np.arange(200)
        times[100:] += 24_000.0
        late = np.random.default_rng(k).normal(0.0, 1e-5, 200)
        late[100] = 0.02
        lines = [made.tracking_line(t, x, hard_s=8e-4) for t, x in zip(times, late, strict=True)]
        paths.append(write(tmp_path / f"tracking_{k}.log", lines))
    values = study_logs(paths, TimingSettings()).offsets_s
    exact = 2.0 / 3.0 * (1.0 - 12.5 / 20.0)
    assert exact - 0.002 <= np.mean(values < -0.0125) <= exact + 2.0 / 3.0 / 20.0
    assert np.max(values) < 1e-3
