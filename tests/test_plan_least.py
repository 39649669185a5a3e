"""The least time that a plan tells: true when it is given, and never longer than what is shown."""

from __future__ import annotations

from pathlib import Path

import pytest

from syncline_design.planning.result import Plan
from syncline_design.planning.run import plan as planned
from syncline_design.planning.setup import PlanRequest
from syncline_design.planning.wanted import PlanWanted, reach_of
from syncline_design.spec.load import load

TIMED = "primitives: [pps]}, timestamping: {error: {distribution: uniform, low: -1 us, high: 1 us}}"
ROBOT = f"""\
syncline: 1
name: a robot in a small hall
requirements: [{{id: ACC, kind: accuracy, limit: 0.5 m}}]
stages:
  - name: robot
    platform: {{v_max: 1.5 m/s, omega_max: 60 deg/s, distance: 6 m, baseline: 1 m,
      acceleration: 0.7 m/s^2, area: [8 m, 5 m]}}
    position: {{sensor: {{modality: position, sigma_position: 1 cm, {TIMED},
      lever_arm: [0.3 m, 0.1 m, -0.5 m]}}
    attitude: {{sensor: {{modality: attitude, sigma_attitude: [0.1 deg, 0.1 deg, 0.3 deg], {TIMED}}}
    ranging: {{sensor: {{modality: ranging, sigma_range: 1 cm, sigma_bearing: 0.1 deg, rate: 10 Hz,
      {TIMED}, lever_arm: [-0.2 m, 0 m, 0.4 m]}}
"""


def told(folder: Path, minutes: float, reach: str | None) -> Plan:
    spec = folder / "robot.yaml"
    spec.write_text(ROBOT, "utf-8")
    wanted = PlanWanted() if reach is None else PlanWanted(reach_of(reach))
    request = PlanRequest(wanted, minutes=minutes, line_plans=False)
    return planned(load(spec), request).result


REACH = "latency(position)=5 ms, lever_arm(position)=1 cm"


@pytest.mark.parametrize("minutes", [0.1, 0.15])
def test_a_drive_that_is_shown_for_want_of_a_shorter_one_is_the_least(
    minutes: float, tmp_path: Path
) -> None:
    """It was told beside a least that was longer than the drive itself, which is enough."""
    fewer = told(tmp_path, minutes, REACH)
    assert not fewer.reached
    assert fewer.least_minutes is not None
    shown = fewer.legs[-1].to_s / 60.0
    assert fewer.least_minutes <= 1.05 * shown
    given = told(tmp_path, 1.02 * fewer.least_minutes, REACH)
    assert given.reached
    assert given.legs[-1].to_s / 60.0 <= 1.02 * fewer.least_minutes


def test_a_least_that_is_told_is_enough_when_it_is_given(tmp_path: Path) -> None:
    """It was a thousandth more than what was asked, whatever that was; now none where none is."""
    for minutes in (3.0, 5.0):
        found = told(tmp_path, minutes, None)
        assert not found.reached
        assert found.least_minutes is None or found.least_minutes > 1.01 * minutes
