"""`diagnose` on logs in which a device hangs: its rows are told, and in no fit."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from syncline_design.diagnosis import DiagnosisSettings, diagnose
from syncline_design.diagnosis.hanging_rows import without_hanging
from syncline_design.diagnosis.system import Measured, measured
from syncline_design.spec.load import load
from tests.world import Hidden, WorldLog, hidden, make_log, scenario

RUN, ROWS = ("multirotor_lines", 7), slice(200, 215)
PLACES = tuple(f"position_{axis}_m" for axis in ("north", "east", "down"))
QUICK = DiagnosisSettings(seed=0, unseen_block=False)


def log_of(*effects: Hidden) -> WorldLog:
    return make_log(scenario(*RUN, 80.0, 5.0, "georeference"), effects)


def written(log: WorldLog, folder: Path, names: tuple[str, ...] = (), rows: slice = ROWS) -> Path:
    """The log with some columns that repeat the row before these."""
    for name in names:
        log.columns[name][rows] = log.columns[name][rows.start - 1]
    (folder / "spec.yaml").write_text(log.spec_yaml(), encoding="utf-8")
    log.to_csv(folder / "log.csv")
    return folder


def told(folder: Path) -> dict[str, Any]:
    found: dict[str, Any] = diagnose(folder / "spec.yaml", [folder / "log.csv"], QUICK).to_json()
    return found


def read(folder: Path) -> Measured:
    return measured(load(folder / "spec.yaml"), [folder / "log.csv"])


def test_a_receiver_that_hangs_is_all_that_is_wrong_with_a_log(tmp_path: Path) -> None:
    """Some metres for three seconds: whatever else is made of them is false."""
    found = told(written(log_of(), tmp_path, PLACES))
    assert found["verdict"] == "explained"
    assert [one for one in found["findings"] if one["material"]] == []
    (check,) = [one for one in found["checks"] if one["code"] == "frozen_readings"]
    assert "the 15 rows in which it does are left out" in check["message"]
    assert list(found["log"]["rejected"].values()) == [15]
    assert found["log"]["used"] == found["log"]["rows"] - 15
    held_out = found["gap"]["held_out"]["before"]["rms_m"]
    assert held_out == pytest.approx(found["gap"]["expected_rms_m"], rel=0.25)


def test_what_acts_beside_a_heading_that_hangs_has_its_value(tmp_path: Path) -> None:
    """As the rows that do not hang have it: by the true value and by a log without them."""
    true_s = 0.06
    found = told(written(log_of(hidden("latency", "position", latency_s=true_s)), tmp_path,
                         ("yaw_deg",)))  # fmt: skip
    (one,) = [each for each in found["findings"] if each["material"]]
    assert (one["effect"], one["sensor"], one["kind"]) == ("latency", "position", "cause")
    low, high = one["parameters"]["latency_s"]["interval95"]
    assert low < true_s < high
    assert high - low < 0.2 * true_s
    assert list(found["log"]["rejected"]) == ["yaw of attitude of multirotor hangs"]


def test_a_log_that_is_read_anew_is_without_these_rows_as_well(tmp_path: Path) -> None:
    inputs = read(written(log_of(), tmp_path, PLACES))
    less, hanging = without_hanging(replace(inputs, reread=lambda _: inputs.log))
    assert hanging.left_out
    assert less.reread is not None
    for log in (less.log, less.reread(1.0)):
        assert np.array_equal(log.time_s, np.delete(inputs.log.time_s, ROWS))


def test_a_log_that_hangs_nearly_all_the_time_is_left_as_it_is(tmp_path: Path) -> None:
    inputs = read(written(log_of(), tmp_path, PLACES, slice(100, 400)))
    less, hanging = without_hanging(inputs)
    assert less is inputs
    assert not hanging.left_out
    (check,) = hanging.checks
    assert "left out" not in check.message
