"""What each log alone says and no joint search looks for: its noise, its gross faults."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest

from syncline_design.campaign.joint import JointRequest, diagnose_joint
from syncline_design.comparison.meaning import with_design
from syncline_design.report.on_diagnosis import on_diagnosis
from syncline_design.report.render_console import console
from syncline_design.spec.load import load
from tests.world import hidden, make_log, scenario

LOUD = hidden("noise_understated", "position", factor=6.0)


def test_a_noisy_log_among_quiet_ones_is_no_agreement(tmp_path: Path) -> None:
    """Three logs, positions of the second six times as noisy as the spec says."""
    logs = []
    for k in range(3):
        made = make_log(scenario("car_stops", 300 + k, 60.0, 5.0), (LOUD,) if k == 1 else ())
        logs.append(made.to_csv(tmp_path / f"log{k}.csv"))
        (tmp_path / "spec.yaml").write_text(made.spec_yaml(), encoding="utf-8")
    found = diagnose_joint(load(tmp_path / "spec.yaml"), JointRequest(tuple(logs)))
    assert found.verdict == "explained"
    (one,) = found.findings
    assert (one.effect, one.sensor, one.scope) == ("noise_understated", "position", "log")
    assert [log.file for log in one.per_log or ()] == ["log1.csv"]
    assert one.sentence.startswith("In log1.csv: ")
    assert found.effects_entries() == ()  # a spec holds what all logs have
    said = " ".join(console(on_diagnosis(with_design(found, None)), colour=False).split())
    assert "Nothing beyond the spec's own noise" not in said
    assert "Another value in every log" not in said


@pytest.mark.parametrize("every", [True, False])
def test_a_convention_of_all_logs_is_the_builds_and_one_of_some_is_theirs(
    every: bool, tmp_path: Path
) -> None:
    """The yaw of whole logs with its sign turned: a spec can hold that of all, none of some."""
    logs = []
    for k in range(2):
        made = make_log(scenario("car_stops", 300 + k, 60.0, 5.0), ())
        path = made.to_csv(tmp_path / f"log{k}.csv")
        if every or k == 0:
            _with_yaw_turned(path)
        logs.append(path)
        (tmp_path / "spec.yaml").write_text(made.spec_yaml(), encoding="utf-8")
    found = diagnose_joint(load(tmp_path / "spec.yaml"), JointRequest(tuple(logs)))
    (one,) = found.findings
    assert (one.effect, one.sensor) == ("frame_convention", "attitude")
    assert one.parameters["convention"].value == "yaw_sign"
    assert one.scope == ("build" if every else "log")
    files = None if every else ["log0.csv"]
    assert (one.per_log and [log.file for log in one.per_log]) == files
    written = [(entry.effect, dict(entry.parameters)) for entry in found.effects_entries()]
    assert written == ([("frame_convention", {"convention": "yaw_sign"})] if every else [])


def _with_yaw_turned(path: Path) -> None:
    head, *rows = list(csv.reader(path.read_text(encoding="utf-8").splitlines()))
    yaw = head.index("yaw_deg")
    for row in rows:
        row[yaw] = repr(-float(row[yaw]))
    path.write_text("\n".join(",".join(row) for row in [head, *rows]) + "\n", encoding="utf-8")
